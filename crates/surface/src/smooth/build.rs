//! Builds bricks from particles.

use glam::Vec3;
use rayon::prelude::*;
use spherule_tree::order::index_u32;
use thiserror::Error;

use super::blocks::{self, BlockPlan, Plan};
use super::blur::{Around, Blur, BrickField, Part, taps};
use super::brick::{Brick, BrickKind, CODES, SAMPLES};
use super::layout::Layout;
use super::raw::{Codes, Gather, RawBrick};
use super::tree::{Block, BrickNode, BrickTree};
use crate::SurfaceSettings;
use crate::field::FieldParticles;
use spherule_files::Bytes;
use spherule_tree::accel::simd::{ArrayLanes, ArrayTask};

/// Blocks per thread whose bricks are made at once. Few, because the results of a batch are held until they are
/// appended in order.
const BATCH: usize = 16;

/// Reasons why there is no surface.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SmoothError {
    /// The grid does not fit into memory.
    #[error(
        "the smooth surface of {particles} particles of radius {radius} in voxels of {voxel} needs about {} of \
         memory, {} are left for it; is the radius right? Else give larger voxels (surface.voxel) or more memory",
        Bytes(*.need), Bytes(*.left)
    )]
    TooLarge {
        /// Number of particles.
        particles: u64,
        /// Their radius.
        radius: f32,
        /// Edge of a voxel.
        voxel: f32,
        /// Bytes needed.
        need: u64,
        /// Bytes available.
        left: u64,
    },
}

/// Cost of building a surface.
#[derive(Debug, Clone, Default)]
pub struct SmoothReport {
    /// Bytes of the grid, and of the particles that are kept for attributes or exact intersections.
    pub bytes: u64,
    /// Peak memory of the build in bytes, including `bytes`.
    pub peak_bytes: u64,
    /// Number of particles that are too far from all others to be drawn.
    pub left_out: u64,
    /// Whether there are particles, but the field does not reach the threshold anywhere.
    pub is_empty: bool,
}

/// A grid with the data that ray queries need in addition.
#[derive(Debug, Default)]
pub(super) struct Built {
    pub(super) tree: BrickTree,
    pub(super) field: Option<FieldParticles>,
    /// The layout, if intersections and normals are to be computed from the field.
    pub(super) exact: Option<Layout>,
    /// Number of the first particles, whose attributes points of the surface have; None: all.
    pub(super) own: Option<u32>,
}

/// Builds the surface of `centers`. With `keep` the particles are kept. `left` is the available memory in bytes.
pub(super) fn build(
    centers: &[Vec3],
    radius: f32,
    settings: &SurfaceSettings,
    keep: bool,
    left: Option<u64>,
) -> Result<(Built, SmoothReport), SmoothError> {
    let layout = Layout::new(settings, radius);
    let count = centers.len() as u64;
    let check_memory = |need: u64| match left {
        Some(left) if need > left => {
            Err(SmoothError::TooLarge { particles: count, radius, voxel: layout.voxel, need, left })
        }
        _ => Ok(()),
    };
    // Sort the particles into bins
    let keep = keep || settings.exact;
    check_memory(count * if keep { 24 } else { 20 })?;
    let mut field = FieldParticles::sorted(centers, layout.support, keep);
    // Select the bricks that the surface may pass through
    let plan = Plan::of(field.bins(), &layout);
    let need = MemoryNeed::of(&plan);
    check_memory(field.byte_len() + 4 * count + need.total())?;
    let sorted_bytes = field.byte_len() + plan.byte_len();
    find_volumes(&mut field, &layout, &plan, Volumes { exact: settings.exact, keep });
    // Sample the field, then assemble bricks and their tree
    let work = Work { field: &field, layout: &layout, plan: &plan, lanes: ArrayLanes::default() };
    let raw = work.raw();
    let (blocks, bricks) = work.bricks(&raw);
    let raw_bytes = raw.byte_len();
    drop(raw);
    let tree = BrickTree::new(&blocks, bricks, layout.voxel, layout.threshold * CODES);
    // Report the cost of the build
    let report = SmoothReport {
        bytes: tree.byte_len() + if keep { field.byte_len() } else { 0 },
        peak_bytes: sorted_bytes
            .max(field.byte_len() + plan.byte_len() + raw_bytes + tree.byte_len()),
        left_out: field.bins().left_out(),
        is_empty: count > 0 && tree.is_empty(),
    };
    let built = Built {
        tree,
        field: keep.then_some(field),
        exact: settings.exact.then_some(layout),
        own: None,
    };
    Ok((built, report))
}

/// Which particles remain after their volumes have been computed.
#[derive(Debug, Clone, Copy)]
struct Volumes {
    /// All of them: intersections are computed from the field.
    exact: bool,
    /// Whether those that remain are put into the order of their positions, as they are kept.
    keep: bool,
}

/// Computes the volumes of the particles that contribute to the surface.
fn find_volumes(field: &mut FieldParticles, layout: &Layout, plan: &Plan, volumes: Volumes) {
    if volumes.exact {
        field.order_by_position();
        field.find_volumes(|_| true);
        return;
    }
    let needed = discard_unused(field, layout, plan);
    if volumes.keep {
        field.order_by_position();
    }
    field.find_volumes(|bin| needed[bin]);
}

/// Removes all particles that do not affect the surface. Returns a flag for each remaining bin: whether its volumes
/// contribute to the field. The other bins are neighbours of those.
pub(super) fn discard_unused(
    field: &mut FieldParticles,
    layout: &Layout,
    plan: &Plan,
) -> Vec<bool> {
    let near = |reach: f32| blocks::bins_near(field.bins(), layout, &plan.blocks, reach);
    let (needed, kept) = (near(layout.support), near(2.0 * layout.support));
    field.retain(&kept);
    let remaining = needed.iter().zip(&kept).filter(|(_, kept)| **kept);
    remaining.map(|(needed, _)| *needed).collect()
}

/// Upper bound of the memory of all bricks in bytes, before it is known which of them the surface passes through.
struct MemoryNeed {
    raw: u64,
    bricks: u64,
}

impl MemoryNeed {
    fn of(plan: &Plan) -> Self {
        Self {
            raw: plan.raw_count() * (size_of::<Codes>() + size_of::<RawBrick>()) as u64,
            bricks: plan.band_count() * size_of::<Brick>() as u64,
        }
    }

    const fn total(&self) -> u64 {
        self.raw + self.bricks
    }
}

/// Input for making bricks.
pub(super) struct Work<'a> {
    pub(super) field: &'a FieldParticles,
    pub(super) layout: &'a Layout,
    pub(super) plan: &'a Plan,
    pub(super) lanes: ArrayLanes,
}

/// The field of all bricks that need it, block by block in the order of their bits.
pub(super) struct RawField {
    bricks: Vec<RawBrick>,
    /// Index of the first brick of each block.
    firsts: Vec<usize>,
}

impl RawField {
    pub(super) fn byte_len(&self) -> u64 {
        let codes = self
            .bricks
            .iter()
            .map(|raw| u64::from(raw.smooth.is_some()) + u64::from(raw.sharp.is_some()));
        size_of_val(&self.bricks[..]) as u64 + size_of::<Codes>() as u64 * codes.sum::<u64>()
    }
}

impl Work<'_> {
    pub(super) fn raw(&self) -> RawField {
        let mut firsts = Vec::with_capacity(self.plan.blocks.len());
        let mut places = Vec::new();
        for block in &self.plan.blocks {
            firsts.push(places.len());
            places.extend(
                blocks::cells(block.raw).map(|cell| blocks::brick_at(block.position, cell)),
            );
        }
        // Sum the particles of each brick
        let gather = |brick: &[i32; 3]| {
            self.lanes.run(Gather { field: self.field, layout: self.layout, brick: *brick })
        };
        RawField { bricks: places.par_iter().map(gather).collect(), firsts }
    }

    /// All blocks that are not outside, and their bricks in the same order.
    pub(super) fn bricks(&self, raw: &RawField) -> (Vec<Block>, Vec<Brick>) {
        let taps = taps(self.layout);
        let (mut blocks, mut bricks) = (Vec::new(), Vec::new());
        let indices: Vec<usize> = (0..self.plan.blocks.len()).collect();
        for batch in indices.chunks(BATCH * rayon::current_num_threads()) {
            // Make the bricks of a batch of blocks in parallel
            let made: Vec<(Block, Vec<Brick>)> = batch
                .par_iter()
                .map_init(BrickScratch::default, |scratch, number| {
                    let neighbours = Neighbours::of(self.plan, raw, *number);
                    self.lanes.run(MakeBlock {
                        scratch,
                        plan: &self.plan.blocks[*number],
                        neighbours,
                        layout: self.layout,
                        taps: &taps,
                    })
                })
                .collect();
            // Append them in order, without empty blocks
            for (mut block, mut own_bricks) in made {
                if block.node.children | block.node.inside == 0 {
                    continue;
                }
                block.node.first = index_u32(bricks.len());
                bricks.append(&mut own_bricks);
                blocks.push(block);
            }
        }
        bricks.shrink_to_fit();
        (blocks, bricks)
    }
}

/// A block and its 26 neighbours.
struct Neighbours<'a> {
    blocks: [Option<(&'a BlockPlan, &'a [RawBrick])>; 27],
}

impl<'a> Neighbours<'a> {
    fn of(plan: &'a Plan, raw: &'a RawField, block: usize) -> Self {
        let with_bricks = |number: usize| (&plan.blocks[number], &raw.bricks[raw.firsts[number]..]);
        Self { blocks: plan.around(block).map(|number| number.map(with_bricks)) }
    }

    /// One part of the field over the brick at `cell` of the central block, and around it. `deep` is its value deep
    /// inside.
    #[inline(always)]
    fn around(
        &self,
        cell: u32,
        deep: f32,
        part: impl Fn(&'a RawBrick) -> Option<&'a Codes>,
    ) -> Around<'a> {
        let mut around = [Part::Uniform(0.0); 27];
        for (number, found) in (0..27_u32).zip(&mut around) {
            // Compute the position of the brick in 3x3x3 blocks; one block is 4 bricks
            let along = |step: u32, shift: u32| 3 + step + (cell >> shift & 3);
            let (x, y, z) = (along(number % 3, 0), along(number / 3 % 3, 2), along(number / 9, 4));
            let block = self.blocks[(x / 4 + 3 * (y / 4) + 9 * (z / 4)) as usize];
            let Some((plan, raw)) = block else {
                continue;
            };
            // Look up the brick in its block
            let bit = (x % 4) | ((y % 4) << 2) | ((z % 4) << 4);
            if plan.inside >> bit & 1 == 1 {
                *found = Part::Uniform(deep);
            } else if plan.raw >> bit & 1 == 1 {
                let position = (plan.raw & ((1 << bit) - 1)).count_ones() as usize;
                if let Some(codes) = part(&raw[position]) {
                    *found = Part::Codes(codes);
                }
            }
        }
        around
    }
}

/// Buffers of one thread for making bricks.
struct BrickScratch {
    blur: Blur,
    field: Box<BrickField>,
}

impl Default for BrickScratch {
    fn default() -> Self {
        Self { blur: Blur::default(), field: Box::new([[[0.0; 16]; SAMPLES]; SAMPLES]) }
    }
}

/// Makes the bricks of a block.
struct MakeBlock<'a> {
    scratch: &'a mut BrickScratch,
    plan: &'a BlockPlan,
    neighbours: Neighbours<'a>,
    layout: &'a Layout,
    taps: &'a [f32],
}

impl ArrayTask for MakeBlock<'_> {
    type Output = (Block, Vec<Brick>);

    #[inline(always)]
    fn run(self) -> (Block, Vec<Brick>) {
        let BrickScratch { blur, field } = self.scratch;
        let is_blurred = self.layout.blur > 0;
        let (mut children, mut inside) = (0, self.plan.inside);
        let mut bricks = Vec::new();
        for cell in blocks::cells(self.plan.band) {
            // Assemble the samples of the brick; all particles deep inside are crowded
            let (deep_sharp, deep_smooth) = if is_blurred { (0.0, 1.0) } else { (1.0, 0.0) };
            let sharp = self.neighbours.around(cell, deep_sharp, |raw| raw.sharp.as_deref());
            blur.copy_sharp(&sharp, field);
            if is_blurred {
                let smooth = self.neighbours.around(cell, deep_smooth, |raw| raw.smooth.as_deref());
                blur.add_smooth(&smooth, self.taps, field);
            }
            // Quantise them, unless the brick is uniform
            match Brick::make(field, self.layout.threshold * CODES) {
                BrickKind::Brick(brick) => {
                    children |= 1 << cell;
                    bricks.push(brick);
                }
                BrickKind::Inside => inside |= 1 << cell,
                BrickKind::Outside => {}
            }
        }
        let node = BrickNode { children, inside, first: 0 };
        let block = Block { position: self.plan.position, node };
        (block, bricks)
    }
}
