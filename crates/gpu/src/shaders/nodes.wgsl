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

// The nodes of a level, and their boxes.
@compute @workgroup_size(64)
fn build_level(
  @builtin(workgroup_id) group: vec3<u32>,
  @builtin(num_workgroups) groups: vec3<u32>,
  @builtin(local_invocation_index) local: u32,
) {
  let i = linear_index(group, groups, local, 64u);
  if (i >= build.nodes) { return; }
  // Unite the boxes of the children
  let first = 8u * i;
  let count = min(8u, build.children - first);
  var low = vec3<f32>(LARGEST);
  var high = vec3<f32>(-LARGEST);
  for (var j = 0u; j < count; j++) {
    let at = 6u * (first + j);
    low = min(low, vec3<f32>(boxes_in[at], boxes_in[at + 1u], boxes_in[at + 2u]));
    high = max(high, vec3<f32>(boxes_in[at + 3u], boxes_in[at + 4u], boxes_in[at + 5u]));
  }
  write_box(build.nodes_before + i, low, high);
  // Leave out empty children
  var mask = 0u;
  for (var j = 0u; j < count; j++) {
    let at = 6u * (first + j);
    if (boxes_in[at] <= boxes_in[at + 3u]) { mask |= 1u << j; }
  }
  // Round the planes of the others outwards to a grid of 255 steps, whose width is a power of two
  var exponents: vec3<u32>;
  var planes: array<vec4<u32>, 3>;
  for (var axis = 0u; axis < 3u; axis++) {
    exponents[axis] = clamp((bitcast<u32>((high[axis] - low[axis]) / 254.0) >> 23u) + 1u, 1u, 254u);
    let steps = 1.0 / bitcast<f32>(exponents[axis] << 23u);
    for (var j = 0u; j < count; j++) {
      let at = 6u * (first + j) + axis;
      let lower = u32(clamp(floor((boxes_in[at] - low[axis]) * steps), 0.0, 255.0));
      let upper = u32(clamp(ceil((boxes_in[at + 3u] - low[axis]) * steps), 0.0, 255.0));
      let shift = 8u * (j & 3u);
      planes[axis][j >> 2u] |= lower << shift;
      planes[axis][2u + (j >> 2u)] |= upper << shift;
    }
  }
  let at = 4u * (build.first + i);
  let grid = exponents.x | (exponents.y << 8u) | (exponents.z << 16u) | (mask << 24u);
  nodes[at] = vec4<u32>(bitcast<u32>(low.x), bitcast<u32>(low.y), bitcast<u32>(low.z), grid);
  nodes[at + 1u] = planes[0];
  nodes[at + 2u] = planes[1];
  nodes[at + 3u] = planes[2];
}
