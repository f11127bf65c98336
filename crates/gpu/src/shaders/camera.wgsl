// Camera rays, with the bits of the CPU's.

// The sets of sample points, and the set of each pixel
@group(0) @binding(4) var<storage, read> points: array<vec2<f32>>;
@group(0) @binding(5) var<storage, read> sets: array<u32>;

// The ray of a sample of the pixel in this column and row of the film.
fn camera_ray(column: u32, row: u32, sample: u32) -> Ray {
  // The point on the film, from the top left corner in pixels, then from the middle
  let point = points[sets[row * view.width + column] * view.samples + sample];
  let x = f32(i32(column) + view.corner.x) + point.x;
  let y = f32(i32(row) + view.corner.y) + point.y;
  let across = mul(2.0 * quotient(x, view.size.x) - 1.0, view.half_width);
  let along = mul(1.0 - 2.0 * quotient(y, view.size.y), view.half_height);
  // A parallel camera moves its rays, a perspective one turns them
  let start = select(view.forward, view.eye, view.is_parallel == 1u);
  let moved = (start + scaled(view.right, across)) + scaled(view.up, along);
  let direction = select(moved, view.forward, view.is_parallel == 1u);
  let scale = inverse(root(dot_in_order(direction, direction)));
  return Ray(select(view.eye, moved, view.is_parallel == 1u), scaled(direction, scale));
}

// Distance along the view axis of a point on a camera ray; along the ray if all are parallel.
fn depth_of(ray: Ray, t: f32) -> f32 {
  if (view.is_parallel == 1u) { return t; }
  return mul(t, dot_in_order(ray.direction, view.forward));
}
