// Ranks the pairs of a tile with ballots, on devices whose subgroups have 32 to 64 invocations (Ashkiani et al., "GPU
// Multisplit", 2016). Each subgroup has a run of the tile, so that it needs no barriers before all subgroups are done.

// By subgroup and digit: the number of pairs, then that in the subgroups before
var<workgroup> tallies: array<atomic<u32>, 2048>;

// The place in the tile of a pair of an invocation
fn place_of(round: u32, lane: Lane) -> u32 {
  return (lane.group * ROUNDS + round) * lane.size + lane.number;
}

// Sums of subgroups
var<workgroup> sums: array<u32, 8>;

// The exclusive sum of `own` over the workgroup.
fn sum_before(lane: Lane, own: u32) -> u32 {
  var sum = subgroupExclusiveAdd(own);
  let all = subgroupAdd(own);
  if (lane.number == 0u) { sums[lane.group] = all; }
  workgroupBarrier();
  for (var k = 0u; k < lane.group; k++) { sum += sums[k]; }
  workgroupBarrier();
  return sum;
}

// The invocations of the subgroup with a pair of the same digit, as a mask
fn peers_of(is_valid: bool, d: u32) -> vec2<u32> {
  var peers = subgroupBallot(is_valid).xy;
  for (var bit = 0u; bit < 8u; bit++) {
    let is_set = ((d >> bit) & 1u) == 1u;
    let those = subgroupBallot(is_set).xy;
    peers &= select(~those, those, is_set);
  }
  return peers;
}

fn count_bits(mask: vec2<u32>) -> u32 {
  let counts = countOneBits(mask);
  return counts.x + counts.y;
}

// Ranks the pairs of each invocation. Returns how many have the digit whose number is that of the invocation.
fn rank_pairs(valid: u32, lane: Lane) -> u32 {
  let local = local_of(lane);
  for (var k = 0u; k < 8u; k++) { atomicStore(&tallies[k * DIGITS + local], 0u); }
  workgroupBarrier();
  // Among the pairs of the subgroup: the first peer counts for all
  let below = (1u << (lane.number & 31u)) - 1u;
  let before = select(vec2<u32>(below, 0u), vec2<u32>(0xffffffffu, below), lane.number >= 32u);
  for (var round = 0u; round < ROUNDS; round++) {
    let is_valid = place_of(round, lane) < valid;
    let d = digit(pairs[round].x);
    let peers = peers_of(is_valid, d);
    let rank = count_bits(peers & before);
    var counted = 0u;
    if (is_valid && rank == 0u) { counted = atomicAdd(&tallies[lane.group * DIGITS + d], count_bits(peers)); }
    let first = select(32u + firstTrailingBit(peers.y), firstTrailingBit(peers.x), peers.x != 0u);
    ranks[round] = rank + subgroupShuffle(counted, first & (lane.size - 1u));
  }
  workgroupBarrier();
  // Among those of the tile
  var seen = 0u;
  for (var k = 0u; k < 8u; k++) {
    let count = atomicLoad(&tallies[k * DIGITS + local]);
    atomicStore(&tallies[k * DIGITS + local], seen);
    seen += count;
  }
  workgroupBarrier();
  for (var round = 0u; round < ROUNDS; round++) {
    ranks[round] += atomicLoad(&tallies[lane.group * DIGITS + digit(pairs[round].x)]);
  }
  return seen;
}

@compute @workgroup_size(256)
fn scatter(
  @builtin(workgroup_id) group: vec3<u32>,
  @builtin(num_workgroups) groups: vec3<u32>,
  @builtin(subgroup_id) subgroup: u32,
  @builtin(subgroup_invocation_id) number: u32,
  @builtin(subgroup_size) size: u32,
) {
  scatter_tile(group.y * groups.x + group.x, Lane(subgroup, number, size));
}
