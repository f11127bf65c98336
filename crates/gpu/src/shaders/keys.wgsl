// The box of all centres, and the position of each on a Hilbert curve through it.

// Least and greatest coordinates as integers with the same order
@group(0) @binding(2) var<storage, read_write> bounds: array<atomic<u32>, 8>;
@group(0) @binding(2) var<storage, read> box_of_all: array<u32, 8>;
// Key and index of each sphere
@group(0) @binding(3) var<storage, read> pairs_in: array<vec2<u32>>;
@group(0) @binding(4) var<storage, read_write> pairs_out: array<vec2<u32>>;

const LARGEST: f32 = 3.4e38;
const GROUP: u32 = 256u;

// Floats as unsigned integers with the same order, and back.
fn ordered(x: f32) -> u32 {
  let bits = bitcast<u32>(x);
  return select(bits | 0x80000000u, ~bits, (bits >> 31u) == 1u);
}
fn unordered(u: u32) -> f32 {
  return bitcast<f32>(select(~u, u & 0x7fffffffu, (u >> 31u) == 1u));
}

@compute @workgroup_size(1)
fn clear_bounds() {
  for (var axis = 0u; axis < 3u; axis++) {
    atomicStore(&bounds[axis], 0xffffffffu);
    atomicStore(&bounds[axis + 3u], 0u);
  }
}

var<workgroup> extremes: array<vec3<f32>, 512>;

@compute @workgroup_size(256)
fn find_bounds(
  @builtin(workgroup_id) group: vec3<u32>,
  @builtin(num_workgroups) groups: vec3<u32>,
  @builtin(local_invocation_index) local: u32,
) {
  // Each invocation takes every n-th sphere
  var low = vec3<f32>(LARGEST);
  var high = vec3<f32>(-LARGEST);
  for (var i = group.x * GROUP + local; i < build.count; i += groups.x * GROUP) {
    let c = center(i);
    low = min(low, c);
    high = max(high, c);
  }
  // Combine the boxes of the group, then those of all groups
  extremes[local] = low;
  extremes[GROUP + local] = high;
  for (var half = GROUP / 2u; half > 0u; half >>= 1u) {
    workgroupBarrier();
    if (local < half) {
      extremes[local] = min(extremes[local], extremes[local + half]);
      extremes[GROUP + local] = max(extremes[GROUP + local], extremes[GROUP + local + half]);
    }
  }
  workgroupBarrier();
  if (local < 3u) {
    atomicMin(&bounds[local], ordered(extremes[0][local]));
    atomicMax(&bounds[3u + local], ordered(extremes[GROUP][local]));
  }
}

// Spreads the lowest ten bits to every third bit.
fn spread(v: u32) -> u32 {
  var x = v & 1023u;
  x = (x | (x << 16u)) & 0x030000ffu;
  x = (x | (x << 8u)) & 0x0300f00fu;
  x = (x | (x << 4u)) & 0x030c30c3u;
  return (x | (x << 2u)) & 0x09249249u;
}

// One word of the position of a point on the Hilbert curve (Skilling, "Programming the Hilbert curve", 2004): BITS bits
// for each axis in all words, 8 of them in each.
fn position_on_curve(point: vec3<f32>, word: u32) -> u32 {
  // Cells of a cube around all centres
  let low = vec3<f32>(unordered(box_of_all[0]), unordered(box_of_all[1]), unordered(box_of_all[2]));
  let high = vec3<f32>(unordered(box_of_all[3]), unordered(box_of_all[4]), unordered(box_of_all[5]));
  let size = max(max(high.x - low.x, high.y - low.y), max(high.z - low.z, 1e-30));
  let last = f32((1u << BITS) - 1u);
  var x = vec3<u32>(clamp((point - low) * (last / size), vec3<f32>(0.0), vec3<f32>(last)));
  // Undo the rotations of the curve, level by level
  for (var m = 1u << (BITS - 1u); m > 1u; m >>= 1u) {
    let lower = m - 1u;
    for (var i = 0u; i < 3u; i++) {
      if ((x[i] & m) != 0u) {
        x.x ^= lower;
      } else {
        let t = (x.x ^ x[i]) & lower;
        x.x ^= t;
        x[i] ^= t;
      }
    }
  }
  // Gray code
  x.y ^= x.x;
  x.z ^= x.y;
  var t = 0u;
  for (var m = 1u << (BITS - 1u); m > 1u; m >>= 1u) {
    if ((x.z & m) != 0u) { t ^= m - 1u; }
  }
  x ^= vec3<u32>(t);
  let bits = (x >> vec3<u32>(8u * word)) & vec3<u32>(255u);
  return (spread(bits.x) << 2u) | (spread(bits.y) << 1u) | spread(bits.z);
}

// Keys of the spheres in their own order.
@compute @workgroup_size(256)
fn first_keys(
  @builtin(workgroup_id) group: vec3<u32>,
  @builtin(num_workgroups) groups: vec3<u32>,
  @builtin(local_invocation_index) local: u32,
) {
  let i = linear_index(group, groups, local, GROUP);
  if (i >= build.count) { return; }
  pairs_out[i] = vec2<u32>(position_on_curve(center(i), build.word), i);
}

// The next word of the keys, in the order that the words before have given.
@compute @workgroup_size(256)
fn next_keys(
  @builtin(workgroup_id) group: vec3<u32>,
  @builtin(num_workgroups) groups: vec3<u32>,
  @builtin(local_invocation_index) local: u32,
) {
  let i = linear_index(group, groups, local, GROUP);
  if (i >= build.count) { return; }
  let sphere = pairs_in[i].y;
  pairs_out[i] = vec2<u32>(position_on_curve(center(sphere), build.word), sphere);
}

// Spheres that are in the order of the tree already.
@compute @workgroup_size(256)
fn keep_order(
  @builtin(workgroup_id) group: vec3<u32>,
  @builtin(num_workgroups) groups: vec3<u32>,
  @builtin(local_invocation_index) local: u32,
) {
  let i = linear_index(group, groups, local, GROUP);
  if (i >= build.count) { return; }
  pairs_out[i] = vec2<u32>(0u, i);
}
