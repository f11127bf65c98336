// A stable radix sort of pairs, 8 bits in each pass (Satish, Harris and Garland, "Designing efficient sorting algorithms
// for manycore GPUs", 2009). It uses no subgroup operations, so that it runs on every device.
//
// A pass has three dispatches: `histogram` counts the digits of each tile, `scan_digits` turns the counts into starts,
// and `scatter` orders each tile in workgroup memory and writes runs of equal digits.

@group(0) @binding(3) var<storage, read> pairs_in: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read_write> pairs_out: array<vec2<u32>>;
// For each digit, one number for each tile
@group(0) @binding(5) var<storage, read_write> counts: array<u32>;
@group(0) @binding(6) var<storage, read_write> totals: array<u32>;

const DIGITS: u32 = 256u;
const ROUNDS: u32 = 8u;
const TILE: u32 = DIGITS * ROUNDS;

fn digit(key: u32) -> u32 { return (key >> build.shift) & 255u; }

var<workgroup> tally: array<atomic<u32>, 256>;

@compute @workgroup_size(256)
fn histogram(
  @builtin(workgroup_id) group: vec3<u32>,
  @builtin(num_workgroups) groups: vec3<u32>,
  @builtin(local_invocation_index) local: u32,
) {
  let tile = group.y * groups.x + group.x;
  if (tile >= build.tiles) { return; }
  atomicStore(&tally[local], 0u);
  workgroupBarrier();
  for (var round = 0u; round < ROUNDS; round++) {
    let i = tile * TILE + round * DIGITS + local;
    if (i < build.count) { atomicAdd(&tally[digit(pairs_in[i].x)], 1u); }
  }
  workgroupBarrier();
  counts[local * build.tiles + tile] = atomicLoad(&tally[local]);
}

var<workgroup> partial: array<u32, 512>;

// Exclusive sums over the tiles, one workgroup for each digit.
@compute @workgroup_size(512)
fn scan_digits(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) local: u32) {
  let row = group.x * build.tiles;
  var carry = 0u;
  for (var start = 0u; start < build.tiles; start += TILE) {
    // Four tiles for each invocation
    var before: array<u32, 4>;
    var sum = 0u;
    for (var k = 0u; k < 4u; k++) {
      let i = start + local * 4u + k;
      before[k] = sum;
      if (i < build.tiles) { sum += counts[row + i]; }
    }
    // Inclusive sums over the invocations
    partial[local] = sum;
    for (var step = 1u; step < 512u; step <<= 1u) {
      workgroupBarrier();
      var other = 0u;
      if (local >= step) { other = partial[local - step]; }
      workgroupBarrier();
      partial[local] += other;
    }
    workgroupBarrier();
    let first = carry + partial[local] - sum;
    for (var k = 0u; k < 4u; k++) {
      let i = start + local * 4u + k;
      if (i < build.tiles) { counts[row + i] = first + before[k]; }
    }
    carry += partial[511];
    workgroupBarrier();
  }
  if (local == 0u) { totals[group.x] = carry; }
}

// By digit: the next rank of a pair in the tile, then the place in the output relative to that in the tile
var<workgroup> base: array<u32, 256>;
var<workgroup> starts: array<u32, 256>;
// For each 32 invocations, a mask of those with each digit
var<workgroup> masks: array<atomic<u32>, 2048>;
var<workgroup> ordered_pairs: array<vec2<u32>, TILE>;

// The exclusive sum of `own` over the workgroup, through `starts`.
fn scan_group(local: u32, own: u32) -> u32 {
  starts[local] = own;
  for (var step = 1u; step < DIGITS; step <<= 1u) {
    workgroupBarrier();
    var other = 0u;
    if (local >= step) { other = starts[local - step]; }
    workgroupBarrier();
    starts[local] += other;
  }
  workgroupBarrier();
  return starts[local] - own;
}

@compute @workgroup_size(256)
fn scatter(
  @builtin(workgroup_id) group: vec3<u32>,
  @builtin(num_workgroups) groups: vec3<u32>,
  @builtin(local_invocation_index) local: u32,
) {
  let tile = group.y * groups.x + group.x;
  if (tile >= build.tiles) { return; }
  // Read the tile, and find where its pairs with digit `local` go
  var pairs: array<vec2<u32>, ROUNDS>;
  var ranks: array<u32, ROUNDS>;
  let first = tile * TILE;
  let valid = min(TILE, build.count - first);
  for (var round = 0u; round < ROUNDS; round++) {
    let i = round * DIGITS + local;
    if (i < valid) { pairs[round] = pairs_in[first + i]; }
  }
  let output_start = scan_group(local, totals[local]) + counts[local * build.tiles + tile];
  // Rank each pair among those with its digit, in the order of the input
  var seen = 0u;
  base[local] = 0u;
  for (var warp = 0u; warp < 8u; warp++) { atomicStore(&masks[warp * DIGITS + local], 0u); }
  let own_warp = local >> 5u;
  let bit = 1u << (local & 31u);
  workgroupBarrier();
  for (var round = 0u; round < ROUNDS; round++) {
    let is_valid = round * DIGITS + local < valid;
    let d = digit(pairs[round].x);
    if (is_valid) { atomicOr(&masks[own_warp * DIGITS + d], bit); }
    workgroupBarrier();
    if (is_valid) {
      var rank = base[d] + countOneBits(atomicLoad(&masks[own_warp * DIGITS + d]) & (bit - 1u));
      for (var warp = 0u; warp < own_warp; warp++) { rank += countOneBits(atomicLoad(&masks[warp * DIGITS + d])); }
      ranks[round] = rank;
    }
    workgroupBarrier();
    for (var warp = 0u; warp < 8u; warp++) {
      seen += countOneBits(atomicLoad(&masks[warp * DIGITS + local]));
      atomicStore(&masks[warp * DIGITS + local], 0u);
    }
    base[local] = seen;
    workgroupBarrier();
  }
  // Order the tile, so that neighbours write to neighbours
  let tile_start = scan_group(local, seen);
  base[local] = output_start - tile_start;
  starts[local] = tile_start;
  workgroupBarrier();
  for (var round = 0u; round < ROUNDS; round++) {
    if (round * DIGITS + local < valid) {
      ordered_pairs[starts[digit(pairs[round].x)] + ranks[round]] = pairs[round];
    }
  }
  workgroupBarrier();
  for (var round = 0u; round < ROUNDS; round++) {
    let i = round * DIGITS + local;
    if (i < valid) {
      let pair = ordered_pairs[i];
      pairs_out[base[digit(pair.x)] + i] = pair;
    }
  }
}
