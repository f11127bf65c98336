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

// The ray of a sample of the pixel at a column and row. Its planes are empty then.
fn start_sample(pixel: u32, at: vec2<u32>, path: ptr<function, Path>) -> Ray {
  empty_sample(pixel);
  let on_film = film_position(at.x, at.y, sample_number());
  let ray = camera_ray(on_film, time_of(pixel));
  (*path).on_film = seen_on_film(on_film, ray.time);
  if (view.lens_radius == 0.0) { return ray; }
  let seed = child_of(seed_at(pixel, 0u, BOUNCED), CAMERA);
  return through_lens(ray, numbers_2d(seed, LENS, sample_number()));
}
