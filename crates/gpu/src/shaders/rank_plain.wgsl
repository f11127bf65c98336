// Ranks the pairs of a tile on devices without large subgroups.

// For each 32 invocations, a mask of those with each digit
var<workgroup> masks: array<atomic<u32>, 2048>;

// The place in the tile of a pair of an invocation
fn place_of(round: u32, lane: Lane) -> u32 { return round * DIGITS + local_of(lane); }

// The exclusive sum of `own` over the workgroup, through `starts`.
fn sum_before(lane: Lane, own: u32) -> u32 {
  let local = local_of(lane);
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

// Ranks the pairs of each invocation. Returns how many have the digit whose number is that of the invocation.
fn rank_pairs(valid: u32, lane: Lane) -> u32 {
  let local = local_of(lane);
  let bit = 1u << lane.number;
  // By digit: the number of pairs in the rounds before
  var seen = 0u;
  base[local] = 0u;
  for (var k = 0u; k < 8u; k++) { atomicStore(&masks[k * DIGITS + local], 0u); }
  workgroupBarrier();
  for (var round = 0u; round < ROUNDS; round++) {
    let is_valid = place_of(round, lane) < valid;
    let d = digit(pairs[round].x);
    if (is_valid) { atomicOr(&masks[lane.group * DIGITS + d], bit); }
    workgroupBarrier();
    if (is_valid) {
      var rank = base[d] + countOneBits(atomicLoad(&masks[lane.group * DIGITS + d]) & (bit - 1u));
      for (var k = 0u; k < lane.group; k++) { rank += countOneBits(atomicLoad(&masks[k * DIGITS + d])); }
      ranks[round] = rank;
    }
    workgroupBarrier();
    for (var k = 0u; k < 8u; k++) {
      seen += countOneBits(atomicLoad(&masks[k * DIGITS + local]));
      atomicStore(&masks[k * DIGITS + local], 0u);
    }
    base[local] = seen;
    workgroupBarrier();
  }
  return seen;
}

@compute @workgroup_size(256)
fn scatter(
  @builtin(workgroup_id) group: vec3<u32>,
  @builtin(num_workgroups) groups: vec3<u32>,
  @builtin(local_invocation_index) local: u32,
) {
  scatter_tile(group.y * groups.x + group.x, Lane(local / 32u, local % 32u, 32u));
}
