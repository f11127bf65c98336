// The centres of a native frame whose blocks have 16 bits for each axis (ENCODING 2), or 11, 11 and 10 bits (3). They are on
// the grid of their block, with the bits of the CPU (`blocks/compact.rs` of the crate for trees).
//
// Files that include this one define the arrays: the words of all blocks, PART of them in `centers` and the others in
// `more_centers`; `grids` with the place of code 0 and the step of the grid on each axis of each block; and `fn wide_count()
// -> u32` blocks in `wide` that are too coarse for a grid: 16 x, 16 y, 16 z.

fn word_at(i: u32) -> u32 {
  if (i >= PART) { return more_centers[i - PART]; }
  return centers[i];
}

// The codes of a centre in a block
fn codes_at(block: u32, lane: u32) -> vec3<u32> {
  if (ENCODING == 3u) {
    let word = word_at(16u * block + lane);
    return vec3<u32>(word & 2047u, (word >> 11u) & 2047u, word >> 22u);
  }
  let at = 24u * block + (lane >> 1u);
  let words = vec3<u32>(word_at(at), word_at(at + 8u), word_at(at + 16u));
  return (words >> vec3<u32>(16u * (lane & 1u))) & vec3<u32>(0xffffu);
}

// The number of the wide block that a block stands for
fn reference_of(block: u32) -> u32 {
  if (ENCODING == 3u) { return word_at(16u * block + 1u); }
  return word_at(24u * block);
}

fn center(i: u32) -> vec3<f32> {
  let block = i >> 4u;
  let lane = i & 15u;
  // A reference has the z of its first and last lane the other way round
  let is_reference = codes_at(block, 0u).z > codes_at(block, 15u).z;
  let other = reference_of(block);
  if (is_reference && other < wide_count()) {
    let x = 48u * other + lane;
    return vec3<f32>(wide[x], wide[x + 16u], wide[x + 32u]);
  }
  let codes = codes_at(block, lane);
  let at = 6u * block;
  return vec3<f32>(
    grids[at] + mul(f32(codes.x), grids[at + 3u]),
    grids[at + 1u] + mul(f32(codes.y), grids[at + 4u]),
    grids[at + 2u] + mul(f32(codes.z), grids[at + 5u]),
  );
}
