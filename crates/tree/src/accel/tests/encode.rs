//! Leaves as a native frame stores them, by the simplest correct encoder.

use super::*;
use crate::blocks::{
    BLOCK_SIZE, Block, BlockFrame, BlockRadii, CompactBlock, CompactBlocks, Q10Block, Q16Block,
    StoredBlocks, StoredLeaves, StoredRadii, WIDTH,
};

/// How positions are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Positions {
    F32,
    Q16,
    Q10,
}

impl Positions {
    pub(super) const ALL: [Self; 3] = [Self::F32, Self::Q16, Self::Q10];
}

/// How radii are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Radii {
    None,
    F32,
    U16,
    U8,
}

impl Radii {
    pub(super) const ALL: [Self; 4] = [Self::None, Self::F32, Self::U16, Self::U8];
}

#[derive(Debug, Clone)]
pub(super) enum OwnedBlocks {
    F32(Vec<Block>),
    Q16(Vec<Q16Block>),
    Q10(Vec<Q10Block>),
}

#[derive(Debug, Clone)]
pub(super) enum OwnedRadii {
    None,
    F32(Vec<BlockRadii>),
    U16(Vec<[u16; BLOCK_SIZE]>),
    U8(Vec<[u8; BLOCK_SIZE]>),
}

/// Stored leaves that own their memory.
#[derive(Debug, Clone)]
pub(super) struct OwnedLeaves {
    pub(super) count: u64,
    pub(super) nodes: Vec<Node>,
    pub(super) blocks: OwnedBlocks,
    pub(super) wide: Vec<Block>,
    pub(super) radii: OwnedRadii,
    /// Radius of code 0 and between codes.
    pub(super) radius_codes: [f32; 2],
}

impl OwnedLeaves {
    /// Encodes the spheres of `scene`, which needs a radius per sphere if radii are stored.
    pub(super) fn encode(scene: &Scene, positions: Positions, radii: Radii) -> Self {
        let mut builder = TreeBuilder::new();
        builder.build(&scene.spheres(), &BuildSettings::new(Structure::Lbvh));
        let tree = builder.tree();
        let count = scene.centers.len();
        let mut blocks = tree.blocks.clone();
        let mut values: Vec<BlockRadii> = tree
            .indices
            .chunks(BLOCK_SIZE)
            .map(|indices| BlockRadii(std::array::from_fn(|i| scene.radius(indices[i] as usize))))
            .collect();
        for (index, (block, radii)) in blocks.iter_mut().zip(&mut values).enumerate() {
            arrange(block, radii, (count - index * BLOCK_SIZE).min(BLOCK_SIZE));
        }
        let mut leaves = Self {
            count: count as u64,
            nodes: Vec::new(),
            blocks: OwnedBlocks::F32(Vec::new()),
            wide: Vec::new(),
            radii: OwnedRadii::None,
            radius_codes: [0.0; 2],
        };
        leaves.encode_radii(radii, values);
        leaves.make_nodes(&blocks);
        match positions {
            Positions::F32 => leaves.blocks = OwnedBlocks::F32(blocks),
            Positions::Q16 => leaves.blocks = OwnedBlocks::Q16(leaves.encode_blocks(&blocks)),
            Positions::Q10 => leaves.blocks = OwnedBlocks::Q10(leaves.encode_blocks(&blocks)),
        }
        leaves
    }

    /// The leaves as files contain them.
    pub(super) fn leaves(&self) -> StoredLeaves<'_> {
        let wide = &self.wide;
        let [low, step] = self.radius_codes;
        StoredLeaves {
            count: self.count,
            nodes: &self.nodes,
            blocks: match &self.blocks {
                OwnedBlocks::F32(blocks) => StoredBlocks::F32(blocks),
                OwnedBlocks::Q16(blocks) => StoredBlocks::Q16(CompactBlocks { blocks, wide }),
                OwnedBlocks::Q10(blocks) => StoredBlocks::Q10(CompactBlocks { blocks, wide }),
            },
            radii: match &self.radii {
                OwnedRadii::None => StoredRadii::None,
                OwnedRadii::F32(radii) => StoredRadii::F32(radii),
                OwnedRadii::U16(codes) => StoredRadii::U16 { codes, low, step },
                OwnedRadii::U8(codes) => StoredRadii::U8 { codes, low, step },
            },
        }
    }

    /// The decoded content; all spheres have `radius` if it is given or if no radii are stored.
    pub(super) fn scene(&self, name: &'static str, radius: Option<f32>) -> Scene {
        let leaves = self.leaves();
        let count = self.count as usize;
        let centers = (0..count).map(|i| leaves.center(i)).collect();
        let own = |i: usize| Some(leaves.radii.load(i / BLOCK_SIZE)?.0[i % BLOCK_SIZE]);
        let radii = match radius {
            Some(radius) => vec![radius],
            None => (0..count).map(|i| own(i).expect("stored")).collect(),
        };
        Scene { name, centers, radii }
    }

    fn encode_radii(&mut self, form: Radii, values: Vec<BlockRadii>) {
        let all = values.iter().flat_map(|block| block.0);
        let low = all.clone().fold(f32::INFINITY, f32::min);
        let high = all.fold(0.0, f32::max);
        let step = |largest: f32| ((high - low) / largest).max(0.0);
        let codes = |largest: f32| {
            let step = step(largest);
            values.iter().map(move |block| {
                block.0.map(|radius| {
                    if step > 0.0 {
                        ((radius - low) / step).round().clamp(0.0, largest)
                    } else {
                        0.0
                    }
                })
            })
        };
        (self.radius_codes, self.radii) = match form {
            Radii::None => ([0.0; 2], OwnedRadii::None),
            Radii::U16 => {
                let codes = codes(65_535.0).map(|block| block.map(|code| code as u16));
                ([low, step(65_535.0)], OwnedRadii::U16(codes.collect()))
            }
            Radii::U8 => {
                let codes = codes(255.0).map(|block| block.map(|code| code as u8));
                ([low, step(255.0)], OwnedRadii::U8(codes.collect()))
            }
            Radii::F32 => ([0.0; 2], OwnedRadii::F32(values)),
        };
    }

    /// Makes nodes over `blocks` and the stored radii.
    fn make_nodes(&mut self, blocks: &[Block]) {
        let radii = self.leaves().radii;
        let bounds: Vec<_> = (0..blocks.len())
            .map(|index| match radii.load(index) {
                Some(radii) => blocks[index].sphere_bounds(&radii),
                None => blocks[index].bounds(),
            })
            .collect();
        self.nodes = bounds.chunks(WIDTH).map(Node::enclosing).collect();
    }

    /// Encodes `blocks`; some are stored uncoded although they could be coded.
    fn encode_blocks<B: CompactBlock>(&mut self, blocks: &[Block]) -> Vec<B> {
        let mut coded = Vec::new();
        for (index, block) in blocks.iter().enumerate() {
            let (node, slot) = (&self.nodes[index / WIDTH], index % WIDTH);
            let codes = (index % 5 != 3).then(|| codes_of::<B>(block, node, slot)).flatten();
            coded.push(codes.unwrap_or_else(|| {
                self.wide.push(*block);
                B::referring_to(self.wide.len() as u32 - 1)
            }));
        }
        coded
    }
}

/// Moves the lowest of the `used` lanes to the front; the unused lanes repeat the last one.
fn arrange(block: &mut Block, radii: &mut BlockRadii, used: usize) {
    let lowest = (1..used).fold(0, |a, b| if block.z[b] < block.z[a] { b } else { a });
    for axis in [&mut block.x, &mut block.y, &mut block.z, &mut radii.0] {
        axis.swap(0, lowest);
        let last = axis[used - 1];
        axis[used..].fill(last);
    }
}

/// The nearest codes with positions between the planes; None if there are none.
fn codes_of<B: CompactBlock>(block: &Block, node: &Node, slot: usize) -> Option<B> {
    let frame = node.child_frame(slot);
    let mut codes = [[0; BLOCK_SIZE]; 3];
    for (axis, values) in [&block.x, &block.y, &block.z].into_iter().enumerate() {
        for (lane, value) in values.iter().enumerate() {
            codes[axis][lane] = code_of::<B>(*value, &frame, axis, node.interval(slot, axis))?;
        }
    }
    let coded = B::from_codes(&codes);
    assert_eq!(coded.wide_index(), None, "lanes are arranged");
    Some(coded)
}

fn code_of<B: CompactBlock>(
    value: f32,
    frame: &BlockFrame,
    axis: usize,
    [lower, upper]: [f64; 2],
) -> Option<u32> {
    let (base, step) = (frame.base[axis], B::steps(frame)[axis]);
    let nearest =
        if step > 0.0 { (f64::from(value) - f64::from(base)) / f64::from(step) } else { 0.0 };
    let nearest = nearest.round().clamp(0.0, f64::from(B::LARGEST[axis])) as u32;
    let position = |code: &u32| f64::from(base + *code as f32 * step);
    let near = [nearest, nearest.saturating_sub(1), nearest + 1];
    near.into_iter()
        .filter(|code| *code <= B::LARGEST[axis])
        .find(|code| (lower..=upper).contains(&position(code)))
}
