// A stable radix sort of pairs, 8 bits in each pass (Satish, Harris and Garland, "Designing efficient sorting algorithms
// for manycore GPUs", 2009).
//
// A pass has three dispatches: `histogram` counts the digits of each tile, `scan_digits` turns the counts into starts,
// and `scatter` orders each tile in workgroup memory and writes runs of equal digits. `rank_subgroup.wgsl` or
// `rank_plain.wgsl` ranks the pairs of a tile.

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

// By digit: where its pairs start in the tile, then where they start in the output, relative to that
var<workgroup> starts: array<u32, 256>;
var<workgroup> base: array<u32, 256>;
var<workgroup> ordered_pairs: array<vec2<u32>, TILE>;

// An invocation: its group of `size` neighbours, and its number in this group
struct Lane { group: u32, number: u32, size: u32 }

fn local_of(lane: Lane) -> u32 { return lane.group * lane.size + lane.number; }

// The pairs of an invocation, and how many of the same digit are before each in the tile
var<private> pairs: array<vec2<u32>, ROUNDS>;
var<private> ranks: array<u32, ROUNDS>;

fn scatter_tile(tile: u32, lane: Lane) {
  if (tile >= build.tiles) { return; }
  let local = local_of(lane);
  // Read the tile, and find where its pairs with digit `local` go
  let first = tile * TILE;
  let valid = min(TILE, build.count - first);
  for (var round = 0u; round < ROUNDS; round++) {
    let i = place_of(round, lane);
    if (i < valid) { pairs[round] = pairs_in[first + i]; }
  }
  let output_start = sum_before(lane, totals[local]) + counts[local * build.tiles + tile];
  // Order the tile, so that neighbours write to neighbours
  let tile_start = sum_before(lane, rank_pairs(valid, lane));
  base[local] = output_start - tile_start;
  starts[local] = tile_start;
  workgroupBarrier();
  for (var round = 0u; round < ROUNDS; round++) {
    if (place_of(round, lane) < valid) {
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
