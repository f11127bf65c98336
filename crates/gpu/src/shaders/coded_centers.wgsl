// The centres of a native frame whose blocks have 16 bits for each axis (ENCODING 2), or 11, 11 and 10 bits (3). They are on
// the grid of their block, with the bits of the CPU (`blocks/compact.rs` of the crate for trees).
@group(0) @binding(1) var<storage, read> centers: array<u32>;
// For each block, the place of code 0, and the step of the grid on each axis
@group(0) @binding(15) var<storage, read> grids: array<f32>;
// Blocks that are too coarse for a grid: 16 x, 16 y, 16 z
@group(0) @binding(16) var<storage, read> wide: array<f32>;

fn zero() -> f32 { return f32(build.zero); }

// The codes of a centre in a block
fn codes_at(block: u32, lane: u32) -> vec3<u32> {
  if (ENCODING == 3u) {
    let word = centers[16u * block + lane];
    return vec3<u32>(word & 2047u, (word >> 11u) & 2047u, word >> 22u);
  }
  let at = 24u * block + (lane >> 1u);
  let words = vec3<u32>(centers[at], centers[at + 8u], centers[at + 16u]);
  return (words >> vec3<u32>(16u * (lane & 1u))) & vec3<u32>(0xffffu);
}

// The number of the wide block that a block stands for
fn reference_of(block: u32) -> u32 {
  if (ENCODING == 3u) { return centers[16u * block + 1u]; }
  return centers[24u * block];
}

fn center(i: u32) -> vec3<f32> {
  let block = i >> 4u;
  let lane = i & 15u;
  // A reference has the z of its first and last lane the other way round
  let is_reference = codes_at(block, 0u).z > codes_at(block, 15u).z;
  let other = reference_of(block);
  if (is_reference && other < build.wide_count) {
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
