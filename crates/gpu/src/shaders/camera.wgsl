// Camera rays, with the bits of the CPU's.

// The sets of sample points, and the set of each pixel
@group(0) @binding(4) var<storage, read> points: array<vec2<f32>>;
@group(0) @binding(5) var<storage, read> sets: array<u32>;

// The position of a sample of the pixel in this column and row of the film, from 0 at the top left to 1.
fn film_position(column: u32, row: u32, sample: u32) -> vec2<f32> {
  let point = points[sets[row * view.width + column] * view.samples + sample];
  let x = f32(i32(column) + view.corner.x) + point.x;
  let y = f32(i32(row) + view.corner.y) + point.y;
  return vec2<f32>(quotient(x, view.size.x), quotient(y, view.size.y));
}

// The origin of a ray of a camera, and its direction, which has any length
struct Line { origin: vec3<f32>, direction: vec3<f32> }

// The line of a camera through a position of the film.
fn line_of(camera: CameraAt, at: vec2<f32>) -> Line {
  // The point on the film from the middle
  let across = mul(2.0 * at.x - 1.0, camera.half_width);
  let along = mul(1.0 - 2.0 * at.y, camera.half_height);
  // A parallel camera moves its rays, a perspective one turns them
  let start = select(camera.forward, camera.eye, camera.is_parallel == 1u);
  let moved = (start + scaled(camera.right, across)) + scaled(camera.up, along);
  if (camera.is_parallel == 1u) { return Line(moved, camera.forward); }
  return Line(camera.eye, moved);
}

// The ray through a position of the film, at a time from -1/2 to 1/2.
fn camera_ray(at: vec2<f32>, time: f32) -> Ray {
  let line = camera_line(at, time);
  let scale = inverse(root(dot_in_order(line.direction, line.direction)));
  return Ray(line.origin, scaled(line.direction, scale), time);
}

// Distance along the view axis of a point on a camera ray; along the ray if all are parallel.
fn depth_of(ray: Ray, t: f32) -> f32 {
  if (view.camera.is_parallel == 1u) { return t; }
  return mul(t, dot_in_order(ray.direction, view.camera.forward));
}

// Moves a ray through the centre of the lens to the point of the lens that `u` chooses. It still passes through the same
// point of the plane in focus.
fn through_lens(ray: Ray, u: vec2<f32>) -> Ray {
  let camera = view.camera;
  let at = on_disc(u);
  let offset = scaled(camera.right, mul(at.x, view.lens_radius)) + scaled(camera.up, mul(at.y, view.lens_radius));
  let distance = quotient(view.lens_focus, dot_in_order(ray.direction, camera.forward));
  let to_focus = scaled(ray.direction, distance) - offset;
  let direction = scaled(to_focus, inverse(root(dot_in_order(to_focus, to_focus))));
  return Ray(ray.origin + offset, direction, ray.time);
}
