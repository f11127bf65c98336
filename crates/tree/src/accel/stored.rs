//! Trees with leaves in a native frame. Rays are traced through the frame itself; only the node levels above the
//! stored ones are built, one node per eight stored nodes.
//!
//! Stored data come from a file and may contain anything. Every stored node is checked once, so that rays only reach
//! blocks that exist and boxes that are finite. Positions and radii are not checked: at worst, damaged ones give a
//! wrong picture.

use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};

use super::levels::{Child, TopLevels, build_levels, level_counts, level_starts, sah_cost};
use super::report::PhaseClock;
use super::simd::{SimdLevel, Supported};
use super::topology::LEVEL_CODES;
use super::view::{TieOrder, TreeView, split_levels};
use super::{Aabb, BuildReport, Structure};
use crate::blocks::{
    BLOCK_SIZE, CompactBlocks, FARTHEST_PLANE, Node, StoredBlocks, StoredLeaves, StoredRadii, WIDTH,
};
use crate::order::index_u32;

/// Settings for the build of a [`StoredTree`].
#[derive(Debug, Clone, Copy)]
pub struct StoredSettings {
    /// The structure that ordered the particles, for the report.
    pub structure: Structure,
    /// Radius of all spheres, scene units; replaces stored radii.
    pub radius: Option<f32>,
    /// Whether particles are identified by their index, which is their position in the frame. If not, ties in
    /// distance go to the lower centre, as in built trees without indices.
    pub keep_indices: bool,
}

/// Reasons why stored leaves cannot be traced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StoredFault {
    /// More particles than a tree can number.
    TooMany {
        /// Number of particles.
        count: u64,
    },
    /// The length of an array does not match the number of particles.
    Length {
        /// Content of the array.
        what: &'static str,
        /// Actual length.
        found: usize,
        /// Expected length.
        expected: u64,
    },
    /// The child mask of a node does not match the number of blocks below it.
    ChildMask {
        /// Index of the node.
        node: u64,
    },
    /// A plane of a node is not finite, or too large for the arithmetic of rays.
    Plane {
        /// Index of the node.
        node: u64,
    },
    /// There is neither a stored radius nor a given one.
    NoRadius,
}

impl fmt::Display for StoredFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooMany { count } => {
                write!(f, "{count} particles, but a tree holds fewer than 2^32")
            }
            Self::Length { what, found, expected } => {
                write!(f, "{found} {what}, should be {expected}")
            }
            Self::ChildMask { node } => {
                write!(f, "node {node} does not have the blocks below it")
            }
            Self::Plane { node } => {
                write!(f, "node {node}: a plane is not finite or beyond {FARTHEST_PLANE:.1e}")
            }
            Self::NoRadius => write!(f, "the particles have no radius: give one"),
        }
    }
}

impl std::error::Error for StoredFault {}

/// The levels above stored leaves. Rays use [`StoredTree::view`].
#[derive(Debug, Default)]
pub struct StoredTree {
    /// Nodes of the levels above the stored ones, root level first.
    nodes: Vec<Node>,
    /// Index of the first node of each of those levels.
    level_starts: Vec<u32>,
    /// See [`TreeView`].
    mapped_level: u32,
    mapped: Vec<u32>,
    shape: Shape,
    /// The common radius, if it replaces stored ones.
    radius: Option<f32>,
    ties: TieOrder,
    bounds: Aabb,
    simd: Supported,
}

impl StoredTree {
    /// An empty tree that has not allocated memory yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Builds a tree over `leaves`, replacing the previous tree in its memory. After an error the tree is empty.
    ///
    /// # Errors
    /// The first fault found; among faulty nodes, the one with the lowest index.
    pub fn build(
        &mut self,
        leaves: &StoredLeaves,
        settings: StoredSettings,
    ) -> Result<BuildReport, StoredFault> {
        let mut clock = PhaseClock::new();
        self.clear();
        let shape = Shape::of(leaves)?;
        let padding = match (settings.radius, &leaves.radii) {
            (Some(radius), _) => radius,
            (None, StoredRadii::None) => return Err(StoredFault::NoRadius),
            (None, _) => 0.0,
        };
        let counts = shape.level_counts();
        let cost = self.build_levels(leaves, &shape, &counts, padding)?;
        self.shape = shape;
        self.radius = settings.radius;
        self.ties = if settings.keep_indices { TieOrder::Index } else { TieOrder::Center };
        clock.lap("nodes");
        Ok(self.report(leaves, settings.structure, cost, clock))
    }

    /// The tree in the form that rays use, over the `leaves` that it was built over.
    ///
    /// # Panics
    /// If the number of leaves differs from that of the build.
    pub fn view<'a>(&'a self, leaves: &StoredLeaves<'a>) -> TreeView<'a> {
        assert!(
            Shape::of(leaves) == Ok(self.shape),
            "a tree is traced over the leaves that it was built over"
        );
        let mut levels: [&[Node]; LEVEL_CODES] = [&[]; LEVEL_CODES];
        split_levels(&self.nodes, &self.level_starts, &mut levels);
        let depth = self.shape.level_counts().len();
        if let Some(lowest) = depth.checked_sub(1) {
            levels[lowest] = leaves.nodes;
        }
        TreeView {
            levels,
            depth: index_u32(depth),
            mapped_level: self.mapped_level,
            mapped: &self.mapped,
            links: &[],
            blocks: leaves.blocks,
            radii: match self.radius {
                Some(_) => StoredRadii::None,
                None => leaves.radii,
            },
            radius: self.radius.unwrap_or(0.0),
            padding: self.radius.unwrap_or(0.0),
            has_copies: false,
            indices: &[],
            ties: self.ties,
            count: self.shape.count,
            bounds: self.bounds,
            simd: self.simd,
        }
    }

    /// Traces with `level` from now on, or with the best instruction set of the machine if `level` is not supported.
    pub fn set_simd(&mut self, level: SimdLevel) {
        self.simd = Supported::or_best(level);
    }

    /// Empties the tree; its memory is kept.
    fn clear(&mut self) {
        self.nodes.clear();
        self.level_starts.clear();
        self.mapped.clear();
        self.mapped_level = u32::MAX;
        self.shape = Shape::default();
        self.radius = None;
        self.bounds = Aabb::EMPTY;
    }

    /// Builds the levels above the stored nodes, which are the last of the `counts`. Returns the SAH cost.
    fn build_levels(
        &mut self,
        leaves: &StoredLeaves,
        shape: &Shape,
        counts: &[usize],
        padding: f32,
    ) -> Result<f64, StoredFault> {
        let Some((_, upper)) = counts.split_last() else {
            return Ok(sah_cost(0.0, Aabb::EMPTY));
        };
        let mapped_level = TopLevels::Mapped.mapped_level(counts.len());
        let lowest_fault = LowestFault::default();
        // Build the levels above the stored nodes, and check each stored node on the way
        let child = |index: usize| {
            let node = leaves.nodes.get(index)?;
            let read = read_node(node, shape.children_of(index), padding);
            Some(read.unwrap_or_else(|fault| lowest_fault.record(index, fault)))
        };
        self.nodes.resize(upper.iter().sum(), bytemuck::Zeroable::zeroed());
        let built = build_levels(&mut self.nodes, upper, mapped_level, padding, child);
        // A single stored node is the root itself
        let (bounds, areas) = match upper {
            [] => child(0).map_or((Aabb::EMPTY, 0.0), |root| (root.bounds, root.inner_area)),
            _ => (built.bounds, built.child_areas),
        };
        // Reject the whole tree if any node is faulty
        if let Some(fault) = lowest_fault.found() {
            self.clear();
            return Err(fault);
        }
        self.level_starts = level_starts(upper);
        self.mapped_level = mapped_level.map_or(u32::MAX, index_u32);
        self.mapped = built.mapped;
        self.bounds = bounds.padded(padding).rounded_outwards();
        Ok(sah_cost(areas, self.bounds))
    }

    fn report(
        &self,
        leaves: &StoredLeaves,
        structure: Structure,
        sah_cost: f64,
        clock: PhaseClock,
    ) -> BuildReport {
        let phases = clock.finish();
        let position_bytes = position_bytes(&leaves.blocks) + radius_bytes(&leaves.radii);
        let stored_node_bytes = size_of_val(leaves.nodes) as u64;
        let built_bytes = (size_of_val(&self.nodes[..]) + size_of_val(&self.mapped[..])) as u64;
        // The reordering needs a copy of the level above the stored one, and its boxes twice.
        let ordered = leaves.nodes.len().div_ceil(WIDTH) as u64;
        let scratch_bytes = ordered * (size_of::<Node>() + 2 * size_of::<Aabb>()) as u64;
        BuildReport {
            structure,
            order: "as stored, k-d above 1024 particles",
            total: phases.iter().map(|p| p.time).sum(),
            phases,
            particles: leaves.count,
            references: leaves.count,
            nodes: (leaves.nodes.len() + self.nodes.len()) as u64,
            leaves: leaves.block_count() as u64,
            depth: index_u32(self.shape.level_counts().len()),
            sah_cost,
            position_bytes,
            structure_bytes: stored_node_bytes + built_bytes,
            file_bytes: position_bytes + stored_node_bytes,
            peak_bytes: position_bytes + stored_node_bytes + built_bytes + scratch_bytes,
            simd: self.simd.level().name(),
        }
    }
}

/// Number of particles and blocks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Shape {
    count: usize,
    blocks: usize,
}

impl Shape {
    /// The shape of `leaves`, after a check of the lengths of all arrays.
    fn of(leaves: &StoredLeaves) -> Result<Self, StoredFault> {
        let too_many = |_| StoredFault::TooMany { count: leaves.count };
        let count = u32::try_from(leaves.count).map_err(too_many)?;
        let blocks = count.div_ceil(index_u32(BLOCK_SIZE));
        let nodes = blocks.div_ceil(index_u32(WIDTH));
        expect_length("nodes", leaves.nodes.len(), nodes)?;
        expect_length("blocks", leaves.block_count(), blocks)?;
        let radii = match leaves.radii {
            StoredRadii::None => None,
            StoredRadii::F32(radii) => Some(radii.len()),
            StoredRadii::U16 { codes, .. } => Some(codes.len()),
            StoredRadii::U8 { codes, .. } => Some(codes.len()),
        };
        if let Some(radii) = radii {
            expect_length("blocks of radii", radii, blocks)?;
        }
        Ok(Self { count: count as usize, blocks: blocks as usize })
    }

    /// Node count of each level, root level first; the last level is the stored one.
    fn level_counts(&self) -> Vec<usize> {
        level_counts(self.blocks)
    }

    /// Number of blocks below stored node `index`.
    fn children_of(&self, index: usize) -> usize {
        self.blocks.saturating_sub(index * WIDTH).min(WIDTH)
    }
}

fn expect_length(what: &'static str, found: usize, expected: u32) -> Result<(), StoredFault> {
    if found == expected as usize {
        return Ok(());
    }
    Err(StoredFault::Length { what, found, expected: u64::from(expected) })
}

/// Faults of a stored node.
#[derive(Debug, Clone, Copy)]
enum NodeFault {
    ChildMask,
    Plane,
}

/// Checks a stored node over `children` blocks, and returns its bounds.
fn read_node(node: &Node, children: usize, padding: f32) -> Result<Child, NodeFault> {
    if u32::from(node.child_mask) != (1 << children) - 1 {
        return Err(NodeFault::ChildMask);
    }
    let mut own = Child::default();
    for slot in 0..children {
        let mut bounds = Aabb::EMPTY;
        for axis in 0..3 {
            let planes = node.interval(slot, axis);
            // Written as `!(a <= b)` so that NaN is rejected as well.
            if !planes.iter().all(|plane| plane.abs() <= FARTHEST_PLANE) {
                return Err(NodeFault::Plane);
            }
            // The planes of a damaged node may be swapped.
            bounds.min[axis] = rounded_down(planes[0].min(planes[1]));
            bounds.max[axis] = -rounded_down(-planes[0].max(planes[1]));
        }
        own.inner_area += bounds.padded(padding).area();
        own.bounds = own.bounds.union(bounds);
    }
    Ok(own)
}

/// The largest f32 that is not greater than `value`.
#[expect(clippy::cast_possible_truncation, reason = "rounded, then put right")]
fn rounded_down(value: f64) -> f32 {
    let nearest = value as f32;
    if f64::from(nearest) > value { nearest.next_down() } else { nearest }
}

/// The faulty node with the lowest index, whatever the order of the checks.
struct LowestFault(AtomicU64);

impl Default for LowestFault {
    fn default() -> Self {
        Self(AtomicU64::new(u64::MAX))
    }
}

impl LowestFault {
    /// Records the `fault` of node `index`. Returns a child that takes its place; the tree is discarded anyway.
    fn record(&self, index: usize, fault: NodeFault) -> Child {
        let word = (index as u64) << 1 | fault as u64;
        self.0.fetch_min(word, Ordering::Relaxed);
        Child { bounds: Aabb::around(&[glam::Vec3::ZERO]), inner_area: 0.0 }
    }

    fn found(&self) -> Option<StoredFault> {
        let word = self.0.load(Ordering::Relaxed);
        let node = word >> 1;
        (word != u64::MAX).then_some(if word & 1 == NodeFault::Plane as u64 {
            StoredFault::Plane { node }
        } else {
            StoredFault::ChildMask { node }
        })
    }
}

fn position_bytes(blocks: &StoredBlocks) -> u64 {
    fn both<B>(stored: &CompactBlocks<B>) -> usize {
        size_of_val(stored.blocks) + size_of_val(stored.wide)
    }
    let bytes = match blocks {
        StoredBlocks::F32(blocks) => size_of_val(*blocks),
        StoredBlocks::Q16(stored) => both(stored),
        StoredBlocks::Q10(stored) => both(stored),
    };
    bytes as u64
}

fn radius_bytes(radii: &StoredRadii) -> u64 {
    let bytes = match radii {
        StoredRadii::None => 0,
        StoredRadii::F32(radii) => size_of_val(*radii),
        StoredRadii::U16 { codes, .. } => size_of_val(*codes),
        StoredRadii::U8 { codes, .. } => size_of_val(*codes),
    };
    bytes as u64
}
