// Blocks of BLOCK spheres in sorted order.

@group(0) @binding(3) var<storage, read> pairs: array<vec2<u32>>;
@group(0) @binding(7) var<storage, read> radii: array<f32>;
// Centre, and the index of the sphere (COMMON_RADIUS) or its radius
@group(0) @binding(8) var<storage, read_write> spheres: array<vec4<f32>>;
// Index of each sphere, unless it is in `spheres`
@group(0) @binding(9) var<storage, read_write> order: array<u32>;
// By how far each sphere moves while the shutter is open (HAS_MOTION), and the same in the order of the tree
@group(0) @binding(13) var<storage, read> displacements: array<f32>;
@group(0) @binding(14) var<storage, read_write> moves: array<vec4<f32>>;

// Coordinates of spheres that no ray meets
const NOWHERE: f32 = 3e38;

// Spheres in the order of the tree.
@compute @workgroup_size(256)
fn gather_spheres(
  @builtin(workgroup_id) group: vec3<u32>,
  @builtin(num_workgroups) groups: vec3<u32>,
  @builtin(local_invocation_index) local: u32,
) {
  let slot = linear_index(group, groups, local, 256u);
  if (slot >= build.children * BLOCK) { return; }
  if (slot >= build.count) {
    spheres[slot] = vec4<f32>(vec3<f32>(NOWHERE), 0.0);
    return;
  }
  let i = pairs[slot].y;
  if (HAS_MOTION) {
    let along = vec3<f32>(displacements[3u * i], displacements[3u * i + 1u], displacements[3u * i + 2u]);
    moves[slot] = vec4<f32>(along, 0.0);
  }
  if (COMMON_RADIUS) {
    spheres[slot] = vec4<f32>(center(i), bitcast<f32>(i));
  } else {
    spheres[slot] = vec4<f32>(center(i), radii[i]);
    order[slot] = i;
  }
}

// Boxes of blocks: of the centres with a common radius, which rays add later, otherwise of the spheres. Unless spheres move,
// no ray sees a copy of the opaque sphere before it, which has the lower index; without this rule, rays would test all
// particles of a place. The box of a block that has nothing else is empty: its lowest corner is above the highest one.
@compute @workgroup_size(256)
fn block_boxes(
  @builtin(workgroup_id) group: vec3<u32>,
  @builtin(num_workgroups) groups: vec3<u32>,
  @builtin(local_invocation_index) local: u32,
) {
  let block = linear_index(group, groups, local, 256u);
  if (block >= build.children) { return; }
  // The sphere before the first one
  let first = block * BLOCK;
  var before = vec4<f32>(vec3<f32>(NOWHERE), 0.0);
  if (first > 0u) {
    let i = pairs[first - 1u].y;
    before = vec4<f32>(center(i), 0.0);
    if (!COMMON_RADIUS) { before.w = radii[i]; }
  }
  var low = vec3<f32>(LARGEST);
  var high = vec3<f32>(-LARGEST);
  for (var j = 0u; j < BLOCK; j++) {
    let sphere = spheres[first + j];
    let is_equal = all(sphere.xyz == before.xyz) && (COMMON_RADIUS || sphere.w == before.w);
    let is_copy = is_equal && build.keeps_copies == 0u;
    before = sphere;
    if (is_copy) { spheres[first + j] = vec4<f32>(vec3<f32>(NOWHERE), sphere.w); }
    if (is_copy || sphere.x == NOWHERE) { continue; }
    var reach = vec3<f32>(select(sphere.w, 0.0, COMMON_RADIUS));
    // All places during the exposure, with the rounding of these
    if (HAS_MOTION) { reach += 0.500001 * abs(moves[first + j].xyz) + 2.4e-7 * abs(sphere.xyz); }
    low = min(low, sphere.xyz - reach);
    high = max(high, sphere.xyz + reach);
  }
  write_box(block, low, high);
}
