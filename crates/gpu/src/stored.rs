//! The centres of native frames, as their blocks store them.

use bytemuck::Pod;
use rayon::prelude::*;
use spherule_tree::blocks::{CompactBlock, CompactBlocks, StoredBlocks, StoredLeaves, WIDTH};

use crate::spheres::{Centers, Encoding, Grid};

/// The grids of the blocks of `leaves`, if these are coded.
pub(crate) fn grids_of(leaves: &StoredLeaves<'_>) -> Vec<Grid> {
    match &leaves.blocks {
        StoredBlocks::F32(_) => Vec::new(),
        StoredBlocks::Q16(coded) => grids(leaves, coded),
        StoredBlocks::Q10(coded) => grids(leaves, coded),
    }
}

fn grids<B: CompactBlock + Sync>(
    leaves: &StoredLeaves<'_>,
    coded: &CompactBlocks<'_, B>,
) -> Vec<Grid> {
    let grid = |index: usize| {
        let frame = leaves.nodes[index / WIDTH].child_frame(index % WIDTH);
        let ([x, y, z], [dx, dy, dz]) = (frame.base, B::steps(&frame));
        [x, y, z, dx, dy, dz]
    };
    (0..coded.blocks.len()).into_par_iter().map(grid).collect()
}

/// The centres of `leaves`, whose grids are `grids`.
pub(crate) fn centers_of<'a>(leaves: &StoredLeaves<'a>, grids: &'a [Grid]) -> Centers<'a> {
    let count = leaves.count;
    match leaves.blocks {
        StoredBlocks::F32(blocks) => {
            Centers::Blocks { blocks: bytemuck::cast_slice(blocks), count }
        }
        StoredBlocks::Q16(coded) => centers(Encoding::Q16, &coded, grids, count),
        StoredBlocks::Q10(coded) => centers(Encoding::Q10, &coded, grids, count),
    }
}

fn centers<'a, B: Pod>(
    encoding: Encoding,
    coded: &CompactBlocks<'a, B>,
    grids: &'a [Grid],
    count: u64,
) -> Centers<'a> {
    let (words, wide) = (bytemuck::cast_slice(coded.blocks), bytemuck::cast_slice(coded.wide));
    Centers::Coded { encoding, words, grids, wide, count }
}

#[cfg(test)]
mod tests {
    use spherule_tree::blocks::{BLOCK_SIZE, Block, Node, Q10Block, Q16Block, StoredRadii};

    use super::*;
    use crate::Device;
    use crate::spheres::{Order, Radii, Spheres};
    use crate::tree::TreeBuilder;
    use crate::{Colors, NearestSample, Picture, Renderer};

    /// Nodes with grids that differ, from a fixed sequence.
    fn nodes(count: usize) -> Vec<Node> {
        let node = |number: usize| {
            let mut node: Node = bytemuck::Zeroable::zeroed();
            for axis in 0..3 {
                node.origin[axis] = 0.1 + (number * 3 + axis) as f32 / 7.0;
                node.exponent[axis] = 115 + u8::try_from((number + axis) % 4).unwrap();
                for slot in 0..WIDTH {
                    let lower = u8::try_from((number * 17 + slot * 5 + axis * 31) % 120).unwrap();
                    node.planes[axis][0][slot] = lower;
                    node.planes[axis][1][slot] = lower + 40 + u8::try_from(slot).unwrap();
                }
            }
            node
        };
        (0..count).map(node).collect()
    }

    /// Coded blocks. Some are references, one of them to a block that is missing.
    fn blocks<B: CompactBlock>(count: usize) -> Vec<B> {
        let code = |index: usize, axis: usize, lane: usize| {
            let number = u32::try_from((index * 48 + axis * 16 + lane) * 7919).unwrap();
            number % (B::LARGEST[axis] + 1)
        };
        let block = |index: usize| match index % 5 {
            3 => B::referring_to(u32::try_from(index / 5).unwrap()),
            _ => {
                let mut codes: [[u32; BLOCK_SIZE]; 3] =
                    std::array::from_fn(|axis| std::array::from_fn(|lane| code(index, axis, lane)));
                if codes[2][0] > codes[2][BLOCK_SIZE - 1] {
                    codes[2].swap(0, BLOCK_SIZE - 1);
                }
                B::from_codes(&codes)
            }
        };
        (0..count).map(block).collect()
    }

    /// The device decodes the bits of the host.
    fn check(device: &Device, leaves: &StoredLeaves<'_>) {
        let grids = grids_of(leaves);
        let mut builder = TreeBuilder::new(device);
        for radii in [Radii::Common(0.1), Radii::PerSphere(&vec![0.2; 1000])] {
            let centers = centers_of(leaves, &grids);
            let (order, displacements) = (Order::AlongCurve, None);
            let spheres = Spheres {
                centers,
                radii,
                order,
                displacements,
                keeps_codes: false,
                keeps_copies: true,
            };
            builder.build(device, &spheres, None).unwrap();
            let content = builder.content(device).unwrap();
            for index in 0..usize::try_from(leaves.count).unwrap() {
                let expected = leaves.center(index).to_array().map(f32::to_bits);
                let [x, y, z, _] = content.spheres[index].map(f32::to_bits);
                assert_eq!([x, y, z], expected, "{index}");
            }
        }
    }

    /// Calls `each` with the leaves of two encodings.
    fn each_encoding(mut each: impl FnMut(&StoredLeaves<'_>)) {
        let nodes = nodes(4);
        let place = |i: usize| std::array::from_fn(|lane| (100 * i + lane) as f32 / 3.0);
        let wide: Vec<Block> =
            (0..4).map(|i| Block { x: place(i), y: place(i + 4), z: place(i + 8) }).collect();
        let (q10, q16) = (blocks::<Q10Block>(30), blocks::<Q16Block>(30));
        for blocks in [
            StoredBlocks::Q10(CompactBlocks { blocks: &q10, wide: &wide }),
            StoredBlocks::Q16(CompactBlocks { blocks: &q16, wide: &wide }),
        ] {
            each(&StoredLeaves { count: 475, nodes: &nodes, blocks, radii: StoredRadii::None });
        }
    }

    #[test]
    fn coded_blocks_are_decoded_to_the_bits_of_the_host() {
        let Some(device) = Device::for_tests() else { return };
        each_encoding(|leaves| check(&device, leaves));
    }

    /// The pixels of a picture of `leaves`, which stay coded or not.
    fn pixels(device: &Device, leaves: &StoredLeaves<'_>, keeps_codes: bool) -> Vec<NearestSample> {
        let grids = grids_of(leaves);
        let mut renderer = Renderer::new(device);
        // Arrays hold ten blocks of 16 particles, and boxes of eight blocks of the tree are computed together
        renderer.tree_mut().divide(240, 8);
        let spheres = Spheres {
            centers: centers_of(leaves, &grids),
            radii: Radii::Common(0.2),
            order: Order::AlongCurve,
            displacements: None,
            keeps_codes,
            keeps_copies: true,
        };
        renderer.prepare(device, &spheres, Colors::Constant([0.5; 3])).unwrap();
        let picture = Picture::for_tests([64, 48], &[0; 64 * 48]);
        renderer.trace(device, &picture, &|_| false).unwrap();
        renderer.read(device).unwrap().pixels().nearest.to_vec()
    }

    #[test]
    fn blocks_that_stay_coded_give_the_same_picture() {
        let Some(device) = Device::for_tests() else { return };
        each_encoding(|leaves| {
            let [decoded, coded] = [false, true].map(|keeps| pixels(&device, leaves, keeps));
            let hits = decoded.iter().filter(|pixel| pixel.index != NearestSample::NONE).count();
            assert!(hits > 100, "{hits}");
            let bits = |pixel: &NearestSample| -> [u32; 8] { bytemuck::cast(*pixel) };
            let is_hit = |pixel: &&NearestSample| pixel.index != NearestSample::NONE;
            assert!(decoded.iter().zip(&coded).all(|(a, b)| a.index == b.index));
            let [a, b] = [&decoded, &coded].map(|all| all.iter().filter(is_hit).map(bits));
            assert!(a.eq(b));
        });
    }
}
