// The spheres in the order of the tree: centre, and index (COMMON_RADIUS) or radius; then the indices.
@group(0) @binding(2) var<storage, read> spheres: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> order: array<u32>;

fn stored_sphere(slot: u32) -> vec4<f32> { return spheres[slot]; }

fn index_of(slot: u32) -> u32 {
  if (COMMON_RADIUS) { return bitcast<u32>(spheres[slot].w); }
  return order[slot];
}
