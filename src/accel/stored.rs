//! Trees whose leaves lie in a native frame: they are traced there, and only the levels of nodes above
//! them are built, one node of eight for eight that are stored.
//!
//! What is stored is the content of a file and may be anything. Every stored node is looked at once, so
//! that rays come to blocks that are there and to boxes that are numbers; positions and radii are not
//! looked at, and damaged ones make a wrong picture at worst.

use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};

use super::levels::{Child, UpperLevels, build_levels, level_counts, level_starts, sah_cost};
use super::report::PhaseClock;
use super::simd::{SimdLevel, Supported};
use super::topology::LEVEL_CODES;
use super::view::{TieOrder, TreeView, split_levels};
use super::{Aabb, BuildReport, Structure};
use spherule_formats::blocks::{
    BLOCK_SIZE, CompactBlocks, FARTHEST_PLANE, Node, StoredBlocks, StoredLeaves, StoredRadii, WIDTH,
};
use spherule_formats::order::index_u32;

/// What the build of a [`StoredTree`] may be told.
#[derive(Debug, Clone, Copy)]
pub struct StoredSettings {
    /// Who brought the particles into their order, for the report.
    pub structure: Structure,
    /// Radius of all spheres, scene units; stored ones then do not count.
    pub radius: Option<f32>,
    /// Whether particles are told apart by their index, which is their place in the frame. Else the one
    /// with the lower centre comes first at equal distance, as in built trees without indices.
    pub keep_indices: bool,
}

/// Why stored leaves cannot be traced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StoredFault {
    /// More particles than a tree tells apart.
    TooMany {
        /// So many.
        count: u64,
    },
    /// An array is longer or shorter than the number of particles asks for.
    Length {
        /// Of what.
        what: &'static str,
        /// What is there.
        found: usize,
        /// What should be.
        expected: u64,
    },
    /// A node is for more or fewer blocks than lie below it.
    ChildMask {
        /// Its number.
        node: u64,
    },
    /// A plane of a node is no number, or so large that rays cannot be reckoned with it.
    Plane {
        /// The node's number.
        node: u64,
    },
    /// Neither stored nor given.
    NoRadius,
}

impl fmt::Display for StoredFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooMany { count } => {
                write!(f, "{count} particles, but a tree holds fewer than 2^32")
            }
            Self::Length {
                what,
                found,
                expected,
            } => write!(f, "{found} {what}, should be {expected}"),
            Self::ChildMask { node } => {
                write!(f, "node {node} does not have the blocks that lie below it")
            }
            Self::Plane { node } => {
                write!(
                    f,
                    "node {node}: a plane is not finite or beyond {FARTHEST_PLANE:.1e}"
                )
            }
            Self::NoRadius => write!(f, "the particles have no radius: give one"),
        }
    }
}

impl std::error::Error for StoredFault {}

/// The levels above stored leaves. Rays see [`StoredTree::view`].
#[derive(Debug, Default)]
pub struct StoredTree {
    /// Nodes of the levels above the stored ones, root level first.
    nodes: Vec<Node>,
    /// Number of the first node of each of those levels.
    level_starts: Vec<u32>,
    /// See [`TreeView`].
    mapped_level: u32,
    mapped: Vec<u32>,
    shape: Shape,
    /// The common radius, where stored ones do not count.
    radius: Option<f32>,
    ties: TieOrder,
    bounds: Aabb,
    simd: Supported,
}

impl StoredTree {
    /// A tree without memory yet, over nothing.
    pub fn new() -> Self {
        Self::default()
    }

    /// Builds over `leaves`, replacing the last tree in its memory. After a fault it is over nothing.
    ///
    /// # Errors
    /// The first fault found; of several faulty nodes that with the lowest number.
    pub fn build(
        &mut self,
        leaves: &StoredLeaves,
        settings: StoredSettings,
    ) -> Result<BuildReport, StoredFault> {
        let mut clock = PhaseClock::new();
        self.forget();
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
        self.ties = match settings.keep_indices {
            true => TieOrder::Index,
            false => TieOrder::Center,
        };
        clock.lap("nodes");
        Ok(self.report(leaves, settings.structure, cost, clock))
    }

    /// The tree as rays see it, over the `leaves` that it was built over.
    ///
    /// # Panics
    /// If those were not as many.
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

    /// Traces with `level` from now on, or with the best the machine has if it lacks that.
    pub fn set_simd(&mut self, level: SimdLevel) {
        self.simd = Supported::or_best(level);
    }

    /// Makes it a tree over nothing; memory stays.
    fn forget(&mut self) {
        self.nodes.clear();
        self.level_starts.clear();
        self.mapped.clear();
        self.mapped_level = u32::MAX;
        self.shape = Shape::default();
        self.radius = None;
        self.bounds = Aabb::EMPTY;
    }

    /// Builds the levels above the stored nodes, which are the last of the `counts`. Returns the SAH
    /// cost.
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
        let mapped_level = UpperLevels::Mapped.mapped_level(counts.len());
        let lowest_fault = LowestFault::default();
        let child = |index: usize| {
            let node = leaves.nodes.get(index)?;
            let read = read_node(node, shape.children_of(index), padding);
            Some(read.unwrap_or_else(|fault| lowest_fault.note(index, fault)))
        };
        self.nodes
            .resize(upper.iter().sum(), bytemuck::Zeroable::zeroed());
        let built = build_levels(&mut self.nodes, upper, mapped_level, padding, child);
        let (bounds, areas) = match upper {
            [] => child(0).map_or((Aabb::EMPTY, 0.0), |root| (root.bounds, root.inner_area)),
            _ => (built.bounds, built.child_areas),
        };
        if let Some(fault) = lowest_fault.found() {
            self.forget();
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
        // Brought into order are a copy of the level above the stored ones and its boxes, twice.
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

/// How many there are of everything.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
struct Shape {
    count: usize,
    blocks: usize,
}

impl Shape {
    /// That of `leaves`, all of whose lengths fit.
    fn of(leaves: &StoredLeaves) -> Result<Self, StoredFault> {
        let too_many = |_| StoredFault::TooMany {
            count: leaves.count,
        };
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
        Ok(Self {
            count: count as usize,
            blocks: blocks as usize,
        })
    }

    /// Nodes of each level, root level first; the last are the stored ones.
    fn level_counts(&self) -> Vec<usize> {
        level_counts(self.blocks)
    }

    /// Blocks below stored node `index`.
    fn children_of(&self, index: usize) -> usize {
        self.blocks.saturating_sub(index * WIDTH).min(WIDTH)
    }
}

fn expect_length(what: &'static str, found: usize, expected: u32) -> Result<(), StoredFault> {
    if found == expected as usize {
        return Ok(());
    }
    Err(StoredFault::Length {
        what,
        found,
        expected: u64::from(expected),
    })
}

/// What may be wrong with a stored node.
#[derive(Debug, Clone, Copy)]
enum NodeFault {
    ChildMask,
    Plane,
}

/// What a stored node over so many blocks encloses.
fn read_node(node: &Node, children: usize, padding: f32) -> Result<Child, NodeFault> {
    if u32::from(node.child_mask) != (1 << children) - 1 {
        return Err(NodeFault::ChildMask);
    }
    let mut own = Child::default();
    for slot in 0..children {
        let mut bounds = Aabb::EMPTY;
        for axis in 0..3 {
            let planes = node.interval(slot, axis);
            // Said so that NaN is beyond, too.
            if !planes.iter().all(|plane| plane.abs() <= FARTHEST_PLANE) {
                return Err(NodeFault::Plane);
            }
            // The two of a damaged node may have changed places.
            bounds.min[axis] = rounded_down(planes[0].min(planes[1]));
            bounds.max[axis] = -rounded_down(-planes[0].max(planes[1]));
        }
        own.inner_area += bounds.padded(padding).area();
        own.bounds = own.bounds.union(bounds);
    }
    Ok(own)
}

/// The largest f32 that is not above `value`.
#[expect(clippy::cast_possible_truncation, reason = "rounded, then put right")]
fn rounded_down(value: f64) -> f32 {
    let nearest = value as f32;
    if f64::from(nearest) > value {
        nearest.next_down()
    } else {
        nearest
    }
}

/// The faulty node with the lowest number, whoever comes to it first.
struct LowestFault(AtomicU64);

impl Default for LowestFault {
    fn default() -> Self {
        Self(AtomicU64::new(u64::MAX))
    }
}

impl LowestFault {
    /// Notes the `fault` of node `index`. Returns what goes on in its place, in a tree that nobody will
    /// see.
    fn note(&self, index: usize, fault: NodeFault) -> Child {
        let word = (index as u64) << 1 | fault as u64;
        self.0.fetch_min(word, Ordering::Relaxed);
        Child {
            bounds: Aabb::around(&[glam::Vec3::ZERO]),
            inner_area: 0.0,
        }
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
