// What the denoiser compares pixels by: `denoise.wgsl`.

// For each pixel, the base colour and the depth of the nearest sample, then its normal
@group(0) @binding(28) var<storage, read_write> guides: array<vec4<f32>>;

fn color_of_nearest(index: u32, point: vec3<f32>) -> vec3<f32> {
  if (index == MISS) { return vec3<f32>(0.0); }
  if (index == GROUND) { return ground_color(point); }
  return base_color(index);
}

@compute @workgroup_size(GROUP)
fn store_features(
  @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
  @builtin(local_invocation_index) local: u32,
) {
  let pixel = linear_index(group, groups, local, GROUP);
  if (pixel >= view.width * view.height) { return; }
  let first = data[2u * pixel];
  let second = bitcast<vec4<f32>>(data[2u * pixel + 1u]);
  let normal = vec3<f32>(bitcast<vec2<f32>>(first.zw), second.x);
  guides[2u * pixel] = vec4<f32>(color_of_nearest(first.y, second.yzw), bitcast<f32>(first.x));
  guides[2u * pixel + 1u] = vec4<f32>(normal, 0.0);
}
