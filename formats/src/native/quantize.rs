//! Encodes positions in tree order as the stored leaves of a tree: nodes, coded blocks, and uncoded blocks
//! where codes would be too coarse.
//!
//! The grid of a block follows from its node, and the node from the boxes of its blocks, so that eight blocks
//! are encoded together. A decoded position never leaves the box that its node stores: codes at the border are
//! rounded inwards. The stored error is measured after that.

use bytemuck::Zeroable;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::Bound;
use super::radii::CodedRadii;
use crate::blocks::{
    Aabb, BLOCK_SIZE, Block, BlockFrame, BlockRadii, CompactBlock, Node, Q10Block, Q16Block, WIDTH,
};
use crate::order::index_u32;

/// Particles under one node.
pub(super) const GROUP: usize = WIDTH * BLOCK_SIZE;
/// Groups per task.
const TASK: usize = 64;

/// The leaves over a run of particles.
#[derive(Debug, Default)]
pub(super) struct EncodedLeaves<B> {
    /// One node for each eight blocks.
    pub(super) nodes: Vec<Node>,
    /// Blocks that hold codes or refer to `wide` (counted from the first block of the run).
    pub(super) blocks: Vec<B>,
    /// Uncoded blocks.
    pub(super) wide: Vec<Block>,
    /// Largest distance of a stored position from the given one.
    pub(super) max_error: f64,
    /// Bounding box of the stored positions.
    pub(super) bounds: Aabb,
}

/// Limits of the encoding of a frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct EncodeLimits {
    /// The largest error of a position.
    pub(super) bound: Bound,
    /// The common radius of all particles, if there is one.
    pub(super) radius: Option<f32>,
}

/// A block in its stored form.
pub(super) trait StoredBlock: Copy + Send + Sync + bytemuck::Pod {
    /// Whether all blocks are stored without loss.
    const IS_EXACT: bool;

    /// `block` in the grid of its node, with its largest error; `None` if a position would leave the box of the
    /// grid or the coded block would look like a reference.
    fn encode(block: &Block, node: &Node, slot: usize) -> Option<(Self, f64)>;

    /// A reference to an uncoded block; `None` if this encoding has no references.
    fn reference(index: u32) -> Option<Self>;

    /// The decoded positions of a coded block.
    fn stored(&self, frame: &BlockFrame) -> Block;

    /// The same block; a reference points `by` blocks further.
    #[must_use]
    fn shifted(self, by: u32) -> Self;

    /// Half a grid step as a fraction of the grid's extent, on each axis: the largest distance of a coded
    /// position from the true one.
    fn half_steps() -> Vec3;
}

impl StoredBlock for Block {
    const IS_EXACT: bool = true;

    fn encode(block: &Block, _node: &Node, _slot: usize) -> Option<(Self, f64)> {
        Some((*block, 0.0))
    }

    fn reference(_index: u32) -> Option<Self> {
        None
    }

    fn stored(&self, _frame: &BlockFrame) -> Block {
        *self
    }

    fn shifted(self, _by: u32) -> Self {
        self
    }

    fn half_steps() -> Vec3 {
        Vec3::ZERO
    }
}

/// One implementation for all [`CompactBlock`]s would overlap with that for [`Block`], a type of another crate.
macro_rules! stored_codes {
    ($($block:ty),*) => {$(
        impl StoredBlock for $block {
            const IS_EXACT: bool = false;

            fn encode(block: &Block, node: &Node, slot: usize) -> Option<(Self, f64)> {
                encode_block(block, node, slot)
            }

            fn reference(index: u32) -> Option<Self> {
                Some(Self::referring_to(index))
            }

            fn stored(&self, frame: &BlockFrame) -> Block {
                self.decode(frame)
            }

            fn shifted(self, by: u32) -> Self {
                match self.wide_index() {
                    Some(index) => Self::referring_to(index + by),
                    None => self,
                }
            }

            fn half_steps() -> Vec3 {
                Vec3::from_array(<$block>::LARGEST.map(|largest| 0.5 / largest as f32))
            }
        }
    )*};
}

stored_codes!(Q10Block, Q16Block);

/// See [`StoredBlock::encode`].
fn encode_block<B: CompactBlock>(block: &Block, node: &Node, slot: usize) -> Option<(B, f64)> {
    let frame = node.child_frame(slot);
    let steps = B::steps(&frame);
    // Find the codes of each axis on its grid of steps
    let mut codes = [[0; BLOCK_SIZE]; 3];
    let axes = [&block.x, &block.y, &block.z];
    for (axis, (codes, values)) in codes.iter_mut().zip(axes).enumerate() {
        let grid = CodeGrid {
            base: frame.base[axis],
            step: steps[axis],
            largest: B::LARGEST[axis],
            planes: node.interval(slot, axis),
        };
        for (code, value) in codes.iter_mut().zip(values) {
            *code = grid.code(*value)?;
        }
    }
    // Check that the codes are not a reference to an uncoded block
    let coded = B::from_codes(&codes);
    if coded.wide_index().is_some() {
        // The block is not arranged as coded blocks must be.
        return None;
    }
    // Measure the error of what a reader will decode
    let error = largest_distance(&coded.decode(&frame), block);
    Some((coded, error))
}

/// The codes of a block on one axis.
struct CodeGrid {
    base: f32,
    step: f32,
    largest: u32,
    /// The planes of the block's box on the axis.
    planes: [f64; 2],
}

impl CodeGrid {
    /// The code nearest to `value` whose position is inside the box. If rounding leads outside, the next codes
    /// inwards are tried.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a cast saturates, and NaN is 0"
    )]
    fn code(&self, value: f32) -> Option<u32> {
        let exact = (f64::from(value) - f64::from(self.base)) / f64::from(self.step);
        // `round` would be a function call on machines without an instruction for it.
        let nearest = ((exact + 0.5) as u32).min(self.largest);
        let lower = (nearest + 1).min(self.largest);
        [nearest, nearest.saturating_sub(1), lower].into_iter().find(|code| {
            let place = f64::from(self.base + *code as f32 * self.step);
            self.planes[0] <= place && place <= self.planes[1]
        })
    }
}

fn largest_distance(a: &Block, b: &Block) -> f64 {
    let distance = |lane: usize| {
        let [a, b] = [a, b].map(|block| block.center(lane).as_dvec3());
        DVec3::distance_squared(a, b)
    };
    let largest = (0..BLOCK_SIZE).map(distance).fold(0.0, f64::max);
    largest.sqrt()
}

/// Encodes `positions`, which are in tree order. All groups except the last one of a frame are full.
pub(super) fn encode<B: StoredBlock>(
    positions: &[Vec3],
    radii: Option<&CodedRadii>,
    allowed: EncodeLimits,
) -> EncodedLeaves<B> {
    // Encode groups in parallel
    let parts: Vec<EncodedLeaves<B>> = positions
        .par_chunks(TASK * GROUP)
        .enumerate()
        .map(|(task, positions)| {
            let radii = radii.map(|r| &r.blocks[task * TASK * WIDTH..]);
            encode_task(positions, radii, allowed)
        })
        .collect();
    // Join the results in order
    let mut all = EncodedLeaves {
        nodes: Vec::with_capacity(positions.len().div_ceil(GROUP)),
        blocks: Vec::with_capacity(positions.len().div_ceil(BLOCK_SIZE)),
        ..EncodedLeaves::empty()
    };
    for part in parts {
        all.append(part);
    }
    all
}

fn encode_task<B: StoredBlock>(
    positions: &[Vec3],
    radii: Option<&[BlockRadii]>,
    allowed: EncodeLimits,
) -> EncodedLeaves<B> {
    let mut leaves = EncodedLeaves::empty();
    for (group, positions) in positions.chunks(GROUP).enumerate() {
        let radii = radii.map(|radii| &radii[group * WIDTH..]);
        leaves.push_group(positions, radii, allowed);
    }
    leaves
}

impl<B: StoredBlock> EncodedLeaves<B> {
    fn empty() -> Self {
        Self {
            nodes: Vec::new(),
            blocks: Vec::new(),
            wide: Vec::new(),
            max_error: 0.0,
            bounds: Aabb::EMPTY,
        }
    }

    /// Encodes up to eight blocks under one node.
    fn push_group(
        &mut self,
        positions: &[Vec3],
        radii: Option<&[BlockRadii]>,
        allowed: EncodeLimits,
    ) {
        // Compute the boxes of the blocks
        let mut blocks = [Block::zeroed(); WIDTH];
        let mut boxes = [Aabb::EMPTY; WIDTH];
        let chunks = positions.chunks(BLOCK_SIZE);
        let used = chunks.len();
        for (slot, chunk) in chunks.enumerate() {
            blocks[slot] = block_of(chunk);
            boxes[slot] = match radii {
                None => blocks[slot].bounds(),
                Some(radii) => room_for_spheres::<B>(&blocks[slot], &radii[slot]),
            };
        }
        // Encode the blocks within the boxes that the node stores
        let node = Node::enclosing(&boxes[..used]);
        for (slot, block) in blocks[..used].iter().enumerate() {
            let own = radii.map(|radii| &radii[slot]);
            self.push_block(block, &node, slot, own, allowed);
        }
        self.nodes.push(node);
    }

    fn push_block(
        &mut self,
        block: &Block,
        node: &Node,
        slot: usize,
        radii: Option<&BlockRadii>,
        allowed: EncodeLimits,
    ) {
        // Encode the block, if its error and its spheres are within the limits
        let smallest = |r: &BlockRadii| r.0.iter().copied().fold(f32::INFINITY, f32::min);
        let radius = radii.map(smallest).or(allowed.radius);
        let most = allowed.bound.length(radius);
        let frame = node.child_frame(slot);
        let coded = B::encode(block, node, slot).filter(|(coded, error)| {
            let fits = |radii: &BlockRadii| {
                node.child_holds(slot, &coded.stored(&frame).sphere_bounds(radii))
            };
            B::IS_EXACT || *error <= most && radii.is_none_or(fits)
        });
        if let Some((coded, error)) = coded {
            self.max_error = self.max_error.max(error);
            self.bounds = self.bounds.union(coded.stored(&frame).bounds());
            self.blocks.push(coded);
            return;
        }
        // Otherwise store it uncoded, and refer to it
        self.bounds = self.bounds.union(block.bounds());
        let reference = B::reference(index_u32(self.wide.len()));
        // Encodings without loss accept every block, so that this encoding has references.
        self.blocks.push(reference.expect("only coded blocks are refused"));
        self.wide.push(*block);
    }

    /// Appends the leaves of the following particles.
    fn append(&mut self, next: Self) {
        let first = index_u32(self.wide.len());
        let has_references = first > 0 && !next.wide.is_empty();
        if has_references {
            let shifted = next.blocks.into_iter().map(|block| block.shifted(first));
            self.blocks.extend(shifted);
        } else {
            self.blocks.extend(next.blocks);
        }
        self.nodes.extend(next.nodes);
        self.wide.extend(next.wide);
        self.max_error = self.max_error.max(next.max_error);
        self.bounds = self.bounds.union(next.bounds);
    }

    /// Adds `before`, the number of earlier uncoded blocks, to all references.
    pub(super) fn shift(&mut self, before: u32) {
        if before > 0 && !self.wide.is_empty() {
            let blocks = self.blocks.par_iter_mut();
            blocks.for_each(|block| *block = block.shifted(before));
        }
    }
}

/// The bounding box of the spheres, for any position that coding can give them.
fn room_for_spheres<B: StoredBlock>(block: &Block, radii: &BlockRadii) -> Aabb {
    let spheres = block.sphere_bounds(radii);
    // The stored box of the node exceeds this one by up to two steps of its planes, and so does the grid.
    let reach = 1.25 * B::half_steps() * spheres.size();
    Aabb { min: spheres.min - reach, max: spheres.max + reach }
}

/// A block of up to 16 positions; the remaining lanes repeat the last one.
fn block_of(positions: &[Vec3]) -> Block {
    let mut block = Block::zeroed();
    for lane in 0..BLOCK_SIZE {
        block.set_center(lane, positions[lane.min(positions.len() - 1)]);
    }
    block
}

/// Arranges each block of `positions` as coded blocks require (z of the first particle not above z of the
/// last), and `indices` in the same way unless it is empty. Call it before attributes are gathered by the indices.
/// Coincident particles keep their order, because it decides which of them a ray hits first.
pub fn arrange(positions: &mut [Vec3], indices: &mut [u32]) {
    if indices.is_empty() {
        positions
            .par_chunks_mut(BLOCK_SIZE)
            .with_min_len(1024)
            .for_each(|block| arrange_block(block, &mut []));
        return;
    }
    positions
        .par_chunks_mut(BLOCK_SIZE)
        .zip(indices.par_chunks_mut(BLOCK_SIZE))
        .with_min_len(1024)
        .for_each(|(positions, indices)| arrange_block(positions, indices));
}

fn arrange_block(positions: &mut [Vec3], indices: &mut [u32]) {
    let last = positions.len() - 1;
    if positions[0].z <= positions[last].z {
        return;
    }
    let mut swap = |positions: &mut [Vec3], a: usize, b: usize| {
        positions.swap(a, b);
        if !indices.is_empty() {
            indices.swap(a, b);
        }
    };
    // Exchange the first and the last particle
    swap(positions, 0, last);
    // Move the former first particle to the first position among its coincident particles
    for slot in 1..last {
        if positions[slot] == positions[last] {
            swap(positions, slot, last);
        }
    }
    // Move the former last particle to the last position among its coincident particles
    for slot in (1..last).rev() {
        if positions[slot] == positions[0] {
            swap(positions, slot, 0);
        }
    }
}
