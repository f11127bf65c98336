//! Builds the tree of a frame on the device: the order of the spheres along a Hilbert curve, blocks of eight, and levels
//! of nodes with eight children (Lauterbach et al., "Fast BVH construction on GPUs", 2009, with an implicit tree).
//!
//! The picture does not depend on the order: boxes only have to contain their spheres.

use std::collections::BTreeMap;

use bytemuck::{Pod, Zeroable};
use wgpu::BindingResource;

use crate::arrays::{Array, Uniform, Uniforms};
use crate::commands::{Commands, Kernel, Timer};
use crate::spheres::{Centers, Encoding, KeyLength, Order, Radii, Spheres};
use crate::tree_kernels::{KeyKernels, KeyVariant, NodeKernels, NodeVariant, SortKernels};
use crate::tree_need::{
    BLOCK, BYTES_OF_SPHERE, MAX_SPHERES, TILE, WIDTH, block_count, blocks_of_part, largest_part,
    level_sizes,
};
use crate::{Device, GpuError};

/// What the levels of a tree are.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct TreeShape {
    /// Levels of nodes.
    pub(crate) levels: u32,
    /// First node of each level, from the lowest on.
    pub(crate) starts: [u32; 16],
    /// Radius of all spheres; 0 if each has its own.
    pub(crate) radius: f32,
    /// Length by which boxes grow when they are tested.
    pub(crate) padding: f32,
    /// Whether all spheres have the same radius.
    pub(crate) is_common: bool,
    /// Whether spheres move while the shutter is open.
    pub(crate) has_motion: bool,
    /// Whether all copies of a sphere are kept.
    keeps_copies: bool,
    /// Number of spheres.
    pub(crate) count: u64,
    /// How the centres are stored.
    encoding: Encoding,
    /// Number of blocks that are not coded.
    pub(crate) wide_count: u64,
    /// Whether centres stay coded.
    keeps_codes: bool,
}

impl TreeShape {
    /// How centres are stored that stay coded.
    pub(crate) fn kept_encoding(&self) -> Option<Encoding> {
        self.keeps_codes.then_some(self.encoding)
    }
}

/// A uniform of the kernels.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
struct Build {
    count: u32,
    tiles: u32,
    shift: u32,
    word: u32,
    children: u32,
    nodes: u32,
    first: u32,
    radius: f32,
    keeps_copies: u32,
    wide_count: u32,
    blocks_before: u32,
    nodes_before: u32,
    zeros: [u32; 4],
}

/// Builds the tree of one frame after another in the same memory.
#[derive(Debug)]
pub(crate) struct TreeBuilder {
    keys: BTreeMap<KeyVariant, KeyKernels>,
    sort: SortKernels,
    nodes: BTreeMap<NodeVariant, NodeKernels>,
    uniforms: Uniforms,
    arrays: TreeArrays,
    shape: TreeShape,
    order: Order,
    /// Words of coded centres in an array.
    part_words: u64,
    /// Coded blocks whose boxes are computed together, a multiple of [`WIDTH`].
    blocks_of_part: usize,
}

/// The arrays of a tree, and those that only its build needs.
#[derive(Debug, Default)]
struct TreeArrays {
    centers: Array,
    radii: Array,
    bounds: Array,
    pairs: [Array; 2],
    counts: Array,
    totals: Array,
    spheres: Array,
    order: Array,
    boxes: [Array; 2],
    nodes: Array,
    displacements: Array,
    moves: Array,
    grids: Array,
    wide: Array,
    /// Coded centres beyond the first array of these.
    more_centers: Array,
}

impl TreeArrays {
    fn all(&self) -> [&Array; 17] {
        let [first, second] = &self.pairs;
        let [boxes, other_boxes] = &self.boxes;
        [
            &self.centers,
            &self.radii,
            &self.bounds,
            first,
            second,
            &self.counts,
            &self.totals,
            &self.spheres,
            &self.order,
            boxes,
            other_boxes,
            &self.nodes,
            &self.displacements,
            &self.moves,
            &self.grids,
            &self.wide,
            &self.more_centers,
        ]
    }
}

impl TreeBuilder {
    pub(crate) fn new(device: &Device) -> Self {
        Self {
            keys: BTreeMap::new(),
            sort: SortKernels::new(device),
            nodes: BTreeMap::new(),
            uniforms: Uniforms::default(),
            arrays: TreeArrays::default(),
            shape: TreeShape::default(),
            order: Order::AlongCurve,
            part_words: largest_part(device.adapter().max_array),
            blocks_of_part: usize::try_from(blocks_of_part(device.adapter().max_array))
                .expect("at most 2^26"),
        }
    }

    /// Divides what stays coded into smaller parts, as if arrays were smaller.
    #[cfg(test)]
    pub(crate) fn divide(&mut self, part_words: u64, blocks_of_part: usize) {
        (self.part_words, self.blocks_of_part) = (part_words, blocks_of_part);
    }

    /// The constant of the shaders that divides coded centres between two arrays, if they stay coded.
    pub(crate) fn part_constant(&self) -> String {
        let words = if self.shape.keeps_codes { self.part_words } else { u64::from(u32::MAX) };
        format!("const PART: u32 = {words}u;\n")
    }

    /// Copies `spheres` to the device, and starts to build their tree.
    ///
    /// # Errors
    /// If there are more than the device holds, or if the device fails.
    ///
    /// # Panics
    /// If there are fewer radii than centres, if keys are needed for coded centres, or if spheres are to stay coded that
    /// move, have a radius each, or are not coded.
    pub(crate) fn build(
        &mut self,
        device: &Device,
        spheres: &Spheres<'_>,
        timer: Option<&Timer>,
    ) -> Result<(), GpuError> {
        let is_coded = matches!(spheres.centers, Centers::Coded { .. });
        assert!(!is_coded || spheres.order == Order::AlongCurve, "coded centres have no keys");
        let can_keep = matches!(spheres.radii, Radii::Common(_)) && spheres.displacements.is_none();
        assert!(!spheres.keeps_codes || (is_coded && can_keep), "these do not stay coded");
        self.shape = TreeShape::default();
        let shape = shape_of(spheres)?;
        self.upload(device, spheres)?;
        self.shape = shape;
        self.order = spheres.order;
        self.start(device, timer)
    }

    /// Starts to build the tree of the spheres that were copied last.
    ///
    /// # Errors
    /// If the device fails.
    pub(crate) fn start(&mut self, device: &Device, timer: Option<&Timer>) -> Result<(), GpuError> {
        let shape = self.shape;
        let (length, keyed) = match self.order {
            Order::Any(length) => (length, shape.encoding),
            Order::AlongCurve => (KeyLength::Short, Encoding::Points),
        };
        let of_nodes = (shape.is_common, shape.encoding, shape.keeps_codes, shape.has_motion);
        let variants = ((length, keyed), of_nodes);
        let part = self.part_constant();
        self.keys.entry(variants.0).or_insert_with(|| KeyKernels::new(device, variants.0));
        self.nodes.entry(variants.1).or_insert_with(|| NodeKernels::new(device, variants.1, &part));
        // Record and start all stages
        let mut steps = Steps::default();
        self.uniforms.clear();
        if shape.keeps_codes {
            self.plan_coded_nodes(&mut steps, &shape);
        } else {
            let sorted = self.plan_order(&mut steps, &shape, self.order);
            self.plan_nodes(&mut steps, &shape, sorted);
        }
        self.uniforms.upload(device)?;
        let mut commands = Commands::new(device);
        for step in &steps.0 {
            let array_of = |binding| self.array(binding, step);
            commands.add(self.kernel(step.kind, variants), &array_of, step.work, step.group);
        }
        commands.end_stage(timer.map(|timer| (timer, 0)));
        commands.submit();
        device.check()
    }

    /// The tree that was built last.
    pub(crate) const fn shape(&self) -> &TreeShape {
        &self.shape
    }

    /// The arrays that rays need, by their bindings.
    pub(crate) fn traversal_array(&self, binding: u32) -> Option<BindingResource<'_>> {
        match binding {
            1 => Some(self.arrays.nodes.binding()),
            2 => Some(self.arrays.spheres.binding()),
            3 => Some(self.arrays.order.binding()),
            22 => Some(self.arrays.moves.binding()),
            24 => Some(self.arrays.centers.binding()),
            25 => Some(self.arrays.more_centers.binding()),
            26 => Some(self.arrays.grids.binding()),
            27 => Some(self.arrays.wide.binding()),
            _ => None,
        }
    }

    /// Memory in use, bytes.
    pub(crate) fn bytes(&self) -> u64 {
        self.arrays.all().iter().map(|array| array.bytes()).sum()
    }

    fn upload(&mut self, device: &Device, spheres: &Spheres<'_>) -> Result<(), GpuError> {
        let count = spheres.centers.count();
        let blocks = block_count(count);
        let nodes: u64 = level_sizes(blocks).iter().sum();
        let arrays = &mut self.arrays;
        // Reserve what the kernels write
        let (ordered, boxed) = if spheres.keeps_codes {
            (0, blocks.min(self.blocks_of_part as u64))
        } else {
            (count, blocks)
        };
        arrays.bounds.reserve(device, "bounds", 32)?;
        for pairs in &mut arrays.pairs {
            pairs.reserve(device, "keys of particles", 8 * ordered)?;
        }
        arrays.counts.reserve(device, "counts of digits", 1024 * ordered.div_ceil(TILE))?;
        arrays.totals.reserve(device, "totals of digits", 1024)?;
        arrays.spheres.reserve(device, "particles", 16 * block_count(ordered) * BLOCK)?;
        arrays.nodes.reserve(device, "nodes", 64 * nodes)?;
        for boxes in &mut arrays.boxes {
            boxes.reserve(device, "boxes", 24 * boxed)?;
        }
        let moves = if spheres.displacements.is_some() { 16 * blocks * BLOCK } else { 0 };
        arrays.moves.reserve(device, "motion of particles", moves)?;
        // Copy what they read
        let (grids, wide) = spheres.centers.coding();
        arrays.grids.write(device, "grids of positions", bytemuck::cast_slice(grids))?;
        arrays.wide.write(device, "positions", bytemuck::cast_slice(wide))?;
        let displacements = spheres.displacements.unwrap_or_default();
        let bytes = bytemuck::cast_slice(displacements);
        arrays.displacements.write(device, "motion of particles", bytes)?;
        let bytes = spheres.centers.bytes();
        let part = usize::try_from(4 * self.part_words).unwrap_or(usize::MAX);
        let most = if spheres.keeps_codes { part } else { usize::MAX };
        let (first, others) = bytes.split_at(most.min(bytes.len()));
        arrays.centers.write(device, "positions", first)?;
        arrays.more_centers.write(device, "positions", others)?;
        match spheres.radii {
            Radii::Common(_) => {
                arrays.radii.reserve(device, "radii", 0)?;
                arrays.order.reserve(device, "order", 0)
            }
            Radii::PerSphere(radii) => {
                assert!(radii.len() as u64 >= count, "one radius for each centre");
                arrays.radii.write(device, "radii", bytemuck::cast_slice(radii))?;
                arrays.order.reserve(device, "order", 4 * blocks * BLOCK)
            }
        }
    }

    /// Plans the keys and the sort. Returns which of the two arrays of pairs has the result.
    fn plan_order(&mut self, steps: &mut Steps, shape: &TreeShape, order: Order) -> usize {
        let uniforms = &mut self.uniforms;
        let mut step = |kind, side, build: Build, work, group| {
            let uniform = uniforms.push(&build);
            steps.0.push(Step { kind, side, uniform, work, group });
        };
        let tiles = shape.count.div_ceil(TILE);
        let build = Build { count: narrow(shape.count), tiles: narrow(tiles), ..Build::default() };
        let Order::Any(length) = order else {
            step(Kind::KeepOrder, 1, build, shape.count, 256);
            return 0;
        };
        step(Kind::ClearBounds, 0, build, 1, 1);
        step(Kind::FindBounds, 0, build, shape.count.min(256 * 1024), 256);
        // The lowest word first, because each pass of the sort keeps the order of the passes before
        let mut side = 0;
        for word in 0..length.words() {
            let build = Build { word, ..build };
            if word == 0 {
                // Has no input, and writes side 0
                step(Kind::FirstKeys, 1, build, shape.count, 256);
            } else {
                step(Kind::NextKeys, side, build, shape.count, 256);
                side = 1 - side;
            }
            for shift in [0, 8, 16] {
                let build = Build { shift, ..build };
                step(Kind::Histogram, side, build, tiles, 1);
                step(Kind::ScanDigits, side, build, 256, 1);
                step(Kind::Scatter, side, build, tiles, 1);
                side = 1 - side;
            }
        }
        side
    }

    /// Plans the levels of nodes above blocks that stay coded. The boxes of blocks have room for a part of them.
    fn plan_coded_nodes(&mut self, steps: &mut Steps, shape: &TreeShape) {
        let uniforms = &mut self.uniforms;
        let mut step = |kind, side, build: Build, work, group| {
            let uniform = uniforms.push(&build);
            steps.0.push(Step { kind, side, uniform, work, group });
        };
        let build = Build {
            count: narrow(shape.count),
            wide_count: narrow(shape.wide_count),
            ..Build::default()
        };
        let blocks = block_count(shape.count);
        for first in (0..blocks).step_by(self.blocks_of_part) {
            let children = (blocks - first).min(self.blocks_of_part as u64);
            let (before, nodes) = (narrow(first / WIDTH), children.div_ceil(WIDTH));
            let part = Build {
                children: narrow(children),
                nodes: narrow(nodes),
                blocks_before: narrow(first),
                nodes_before: before,
                first: before,
                ..build
            };
            step(Kind::BlockBoxes, 0, part, children, 256);
            step(Kind::BuildLevel, 1, part, WIDTH * nodes, 64);
        }
        let sizes = level_sizes(blocks);
        let (mut children, mut boxes) = (sizes[0], 0);
        for (size, first) in sizes.into_iter().zip(shape.starts).skip(1) {
            let build = Build { children: narrow(children), nodes: narrow(size), first, ..build };
            step(Kind::BuildLevel, boxes, build, WIDTH * size, 64);
            (children, boxes) = (size, 1 - boxes);
        }
    }

    /// Plans the blocks and the levels of nodes, from pairs on `side`.
    fn plan_nodes(&mut self, steps: &mut Steps, shape: &TreeShape, side: usize) {
        let uniforms = &mut self.uniforms;
        let mut step = |kind, side, build: Build, work, group| {
            let uniform = uniforms.push(&build);
            steps.0.push(Step { kind, side, uniform, work, group });
        };
        let blocks = block_count(shape.count);
        let build = Build {
            count: narrow(shape.count),
            children: narrow(blocks),
            radius: shape.radius,
            keeps_copies: shape.keeps_copies.into(),
            wide_count: narrow(shape.wide_count),
            ..Build::default()
        };
        step(Kind::GatherSpheres, side, build, blocks * BLOCK, 256);
        step(Kind::BlockBoxes, side, build, blocks, 256);
        let (mut children, mut boxes) = (blocks, 1 - side);
        for (size, first) in level_sizes(blocks).into_iter().zip(shape.starts) {
            let build = Build { children: narrow(children), nodes: narrow(size), first, ..build };
            step(Kind::BuildLevel, boxes, build, WIDTH * size, 64);
            (children, boxes) = (size, 1 - boxes);
        }
    }

    fn kernel(&self, kind: Kind, (keys, nodes): (KeyVariant, NodeVariant)) -> &Kernel {
        let (keys, nodes) = (&self.keys[&keys], &self.nodes[&nodes]);
        match kind {
            Kind::ClearBounds => &keys.clear_bounds,
            Kind::FindBounds => &keys.find_bounds,
            Kind::FirstKeys => &keys.first_keys,
            Kind::NextKeys => &keys.next_keys,
            Kind::KeepOrder => &keys.keep_order,
            Kind::Histogram => &self.sort.histogram,
            Kind::ScanDigits => &self.sort.scan_digits,
            Kind::Scatter => &self.sort.scatter,
            Kind::GatherSpheres => {
                nodes.gather_spheres.as_ref().expect("planned unless spheres stay coded")
            }
            Kind::BlockBoxes => &nodes.block_boxes,
            Kind::BuildLevel => &nodes.build_level,
        }
    }

    /// The argument of a step for a binding. A step reads the arrays of its side, and writes those of the other.
    fn array(&self, binding: u32, step: &Step) -> BindingResource<'_> {
        let arrays = &self.arrays;
        let array = match binding {
            0 => return self.uniforms.binding(step.uniform),
            1 => &arrays.centers,
            2 => &arrays.bounds,
            3 => &arrays.pairs[step.side],
            4 => &arrays.pairs[1 - step.side],
            5 => &arrays.counts,
            6 => &arrays.totals,
            7 => &arrays.radii,
            8 => &arrays.spheres,
            9 => &arrays.order,
            10 => &arrays.boxes[step.side],
            11 => &arrays.boxes[1 - step.side],
            13 => &arrays.displacements,
            14 => &arrays.moves,
            15 => &arrays.grids,
            16 => &arrays.wide,
            17 => &arrays.more_centers,
            _ => &arrays.nodes,
        };
        array.binding()
    }

    /// The nodes and spheres, for tests.
    #[cfg(test)]
    pub(crate) fn content(&self, device: &Device) -> Result<TreeContent, GpuError> {
        Ok(TreeContent {
            nodes: bytemuck::pod_collect_to_vec(&self.arrays.nodes.read(device)?),
            spheres: bytemuck::pod_collect_to_vec(&self.arrays.spheres.read(device)?),
            order: bytemuck::pod_collect_to_vec(&self.arrays.order.read(device)?),
        })
    }
}

/// The arrays of a tree on the host.
#[cfg(test)]
pub(crate) struct TreeContent {
    pub(crate) nodes: Vec<[u32; 16]>,
    pub(crate) spheres: Vec<[f32; 4]>,
    pub(crate) order: Vec<u32>,
}

/// The kernels of a build.
#[derive(Debug, Clone, Copy)]
enum Kind {
    ClearBounds,
    FindBounds,
    FirstKeys,
    NextKeys,
    KeepOrder,
    Histogram,
    ScanDigits,
    Scatter,
    GatherSpheres,
    BlockBoxes,
    BuildLevel,
}

/// A dispatch of a build.
struct Step {
    kind: Kind,
    /// The side of double arrays that it reads.
    side: usize,
    uniform: Uniform,
    /// Invocations, in workgroups of `group`.
    work: u64,
    group: u64,
}

#[derive(Default)]
struct Steps(Vec<Step>);

/// The shape of the tree of `spheres`.
fn shape_of(spheres: &Spheres<'_>) -> Result<TreeShape, GpuError> {
    let count = spheres.centers.count();
    if count > MAX_SPHERES {
        let (bytes, max) = (BYTES_OF_SPHERE * count, BYTES_OF_SPHERE * MAX_SPHERES);
        return Err(GpuError::TooLarge { what: "particles", bytes, max });
    }
    let encoding = spheres.centers.encoding();
    let wide_count = spheres.centers.coding().1.len() as u64;
    let has_motion = spheres.displacements.is_some();
    // Spheres with the same centre may move in different directions
    let keeps_copies = spheres.keeps_copies || has_motion;
    let keeps_codes = spheres.keeps_codes;
    let mut shape = TreeShape {
        count,
        encoding,
        wide_count,
        has_motion,
        keeps_copies,
        keeps_codes,
        ..TreeShape::default()
    };
    (shape.radius, shape.is_common) = match spheres.radii {
        Radii::Common(radius) => (radius, true),
        Radii::PerSphere(_) => (0.0, false),
    };
    shape.padding = shape.radius;
    let mut first = 0;
    for (size, start) in level_sizes(block_count(count)).into_iter().zip(&mut shape.starts) {
        *start = narrow(first);
        first += size;
        shape.levels += 1;
    }
    Ok(shape)
}

/// A number of spheres, tiles or nodes in 32 bits.
fn narrow(number: u64) -> u32 {
    u32::try_from(number).expect("no more than MAX_SPHERES")
}

#[cfg(test)]
#[path = "tree_tests.rs"]
mod tests;
