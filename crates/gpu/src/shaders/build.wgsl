// The uniform of all kernels that build a tree.
struct Build {
  count: u32, tiles: u32, shift: u32, word: u32, children: u32, nodes: u32, first: u32, radius: f32,
  // Blocks of a native frame that are not coded; the blocks, and the nodes of a level, before those of a dispatch
  keeps_copies: u32, wide_count: u32, blocks_before: u32, nodes_before: u32,
  zero: u32, zero_too: u32, zero_three: u32, zero_four: u32,
}
@group(0) @binding(0) var<uniform> build: Build;
