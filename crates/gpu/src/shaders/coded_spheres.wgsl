// Spheres that stay coded: the counterparts of `decoded_spheres.wgsl`.
@group(0) @binding(24) var<storage, read> centers: array<u32>;
@group(0) @binding(25) var<storage, read> more_centers: array<u32>;
@group(0) @binding(26) var<storage, read> grids: array<f32>;
@group(0) @binding(27) var<storage, read> wide: array<f32>;

fn wide_count() -> u32 { return view.wide_count; }

fn stored_sphere(slot: u32) -> vec4<f32> {
  if (slot >= view.sphere_count) { return vec4<f32>(vec3<f32>(NOWHERE), 0.0); }
  return vec4<f32>(center(slot), 0.0);
}

fn index_of(slot: u32) -> u32 { return slot; }
