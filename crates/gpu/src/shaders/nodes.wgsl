// The levels of nodes with eight children above the blocks. Node `i` of a level has
// the children `8 i` to `8 i + 7` of the level below, so that nodes need no pointers.
//
// A node is four vectors: its lowest corner with the exponents of its grid and the mask of its children, then the
// planes of the children for x, y and z: four bytes for the lower planes of the children 0 to 3, four for 4 to 7, and
// the same for the upper planes (Ylitie, Karras and Laine, "Efficient incoherent ray traversal on GPUs through
// compressed wide BVHs", 2017).

// Lowest and highest corner of each child
@group(0) @binding(10) var<storage, read> boxes_in: array<f32>;
@group(0) @binding(11) var<storage, read_write> boxes_out: array<f32>;
@group(0) @binding(12) var<storage, read_write> nodes: array<vec4<u32>>;

const LARGEST: f32 = 3.4e38;

fn write_box(i: u32, low: vec3<f32>, high: vec3<f32>) {
  for (var axis = 0u; axis < 3u; axis++) {
    boxes_out[6u * i + axis] = low[axis];
    boxes_out[6u * i + 3u + axis] = high[axis];
  }
}

// Boxes of the children, and their planes on the grid of the node
var<workgroup> lows: array<vec3<f32>, 64>;
var<workgroup> highs: array<vec3<f32>, 64>;
// Lower planes, then upper ones
var<workgroup> planes: array<vec3<u32>, 128>;

// The bytes of four planes from `first` on, on an axis.
fn word_of_planes(first: u32, axis: u32) -> u32 {
  return planes[first][axis] | (planes[first + 1u][axis] << 8u) | (planes[first + 2u][axis] << 16u)
    | (planes[first + 3u][axis] << 24u);
}

// The nodes of a level, and their boxes: one invocation for each child.
@compute @workgroup_size(64)
fn build_level(
  @builtin(workgroup_id) group: vec3<u32>,
  @builtin(num_workgroups) groups: vec3<u32>,
  @builtin(local_invocation_index) local: u32,
) {
  let child = linear_index(group, groups, local, 64u);
  var own_low = vec3<f32>(LARGEST);
  var own_high = vec3<f32>(-LARGEST);
  if (child < build.children) {
    let at = 6u * child;
    own_low = vec3<f32>(boxes_in[at], boxes_in[at + 1u], boxes_in[at + 2u]);
    own_high = vec3<f32>(boxes_in[at + 3u], boxes_in[at + 4u], boxes_in[at + 5u]);
  }
  lows[local] = own_low;
  highs[local] = own_high;
  workgroupBarrier();
  // Unite the boxes of the children, and leave out empty ones
  let first = local & ~7u;
  var low = vec3<f32>(LARGEST);
  var high = vec3<f32>(-LARGEST);
  var mask = 0u;
  for (var j = 0u; j < 8u; j++) {
    low = min(low, lows[first + j]);
    high = max(high, highs[first + j]);
    mask |= select(0u, 1u << j, lows[first + j].x <= highs[first + j].x);
  }
  // Round the planes of the others outwards to a grid of 255 steps, whose width is a power of two
  let exponents = clamp(
    (bitcast<vec3<u32>>((high - low) / 254.0) >> vec3<u32>(23u)) + vec3<u32>(1u), vec3<u32>(1u), vec3<u32>(254u));
  let steps = 1.0 / bitcast<vec3<f32>>(exponents << vec3<u32>(23u));
  planes[local] = vec3<u32>(clamp(floor((own_low - low) * steps), vec3<f32>(0.0), vec3<f32>(255.0)));
  planes[64u + local] = vec3<u32>(clamp(ceil((own_high - low) * steps), vec3<f32>(0.0), vec3<f32>(255.0)));
  workgroupBarrier();
  // Four invocations write one vector each
  let i = child >> 3u;
  let part = local & 7u;
  if (i >= build.nodes || part >= 4u) { return; }
  let at = 4u * (build.first + i);
  if (part == 0u) {
    let grid = exponents.x | (exponents.y << 8u) | (exponents.z << 16u) | (mask << 24u);
    nodes[at] = vec4<u32>(bitcast<vec3<u32>>(low), grid);
    write_box(build.nodes_before + i, low, high);
    return;
  }
  let axis = part - 1u;
  nodes[at + part] = vec4<u32>(
    word_of_planes(first, axis), word_of_planes(first + 4u, axis),
    word_of_planes(first + 64u, axis), word_of_planes(first + 68u, axis));
}
