// Rays of paths.

// A path up to a ray. `diffuse` is the part of its throughput from the diffuse reflection before.
struct Path { throughput: vec3<f32>, pdf: f32, pixel: u32, on_film: vec2<f32>, diffuse: vec3<f32>, state: State }

// The next ray of a path. It starts at the point of the surface, unless its state says where.
struct Next {
  is_ray: bool, direction: vec3<f32>, throughput: vec3<f32>, pdf: f32, state: State,
}

fn no_ray(state: State) -> Next {
  return Next(false, vec3<f32>(0.0), vec3<f32>(0.0), 0.0, state);
}

// The path of a camera ray
fn camera_path(pixel: u32, on_film: vec2<f32>) -> Path {
  return Path(vec3<f32>(1.0), FAR, pixel, on_film, vec3<f32>(1.0), camera_state(pixel));
}
