// Motion blur: each ray sees spheres and the camera at its own time, from -1/2 to 1/2. `still.wgsl` has the counterparts of
// these functions.

// By how far spheres move from the opening of the shutter to its closing
@group(0) @binding(22) var<storage, read> moves: array<vec4<f32>>;

// The sphere in a slot at the time of a ray
fn sphere_at(slot: u32, time: f32) -> vec4<f32> {
  let sphere = stored_sphere(slot);
  return vec4<f32>(sphere.xyz + scaled(moves[slot].xyz, time), sphere.w);
}

// The time at which the rays of a sample see the scene
fn time_of(pixel: u32) -> f32 {
  return number_1d(child_of(seed_at(pixel, 0u, BOUNCED), CAMERA), TIME, sample_number()) - 0.5;
}

// Between the lines of the camera at both ends of the exposure
fn camera_line(at: vec2<f32>, time: f32) -> Line {
  let open = line_of(view.open, at);
  let close = line_of(view.close, at);
  // With the zero, compilers do not see that the sum of both is 1, for which they have another formula
  let end = (time + 0.5) + zero();
  let start = (0.5 - time) + zero();
  return Line(
    open.origin + scaled(close.origin - open.origin, end),
    scaled(open.direction, start) + scaled(close.direction, end),
  );
}

// The position on the film at which the camera of the frame sees what a ray through the position `at` sees
fn seen_on_film(at: vec2<f32>, time: f32) -> vec2<f32> {
  let camera = view.camera;
  let line = camera_line(at, time);
  var offset = line.direction / dot(line.direction, camera.forward);
  if (camera.is_parallel == 1u) { offset = line.origin - camera.eye; }
  let place = vec2<f32>(dot(offset, camera.right) / camera.half_width, dot(offset, camera.up) / camera.half_height);
  return 0.5 + 0.5 * vec2<f32>(place.x, -place.y);
}

// Arithmetic of the sphere test: the CPU's kernels for moving spheres round all products.
fn test_dot(a: vec3<f32>, b: vec3<f32>) -> f32 { return dot_in_order(a, b); }

fn test_minus(o: vec3<f32>, m: f32, d: vec3<f32>) -> vec3<f32> { return o - scaled(d, m); }
