// Points of spheres, their colours, and what is behind them.

// Base colours of the spheres, `COLOR` numbers each: a fourth is the opacity
@group(0) @binding(12) var<storage, read> colors: array<f32>;

const OFFSET_OF_RADIUS: f32 = 1e-4;
// Eight units in the last place of 1
const OFFSET_OF_ROUNDING: f32 = 9.5367431640625e-7;

// Backdrop of a studio: its brightest point, and how it falls off to the corners
const BACKDROP_CENTER: vec2<f32> = vec2<f32>(0.5, 0.45);
const BACKDROP_STRETCH: f32 = 1.15;
const BACKDROP_FALLOFF: f32 = 1.6;
const BACKDROP_VIGNETTE: f32 = 0.25;

fn background(direction: vec3<f32>) -> vec3<f32> {
  if (view.background_kind == 0u) { return view.background_bottom; }
  let height = clamp(dot(direction, view.background_up), -1.0, 1.0);
  let part = 0.5 + arc_sine(height) * INVERSE_PI;
  return view.background_bottom * (1.0 - part) + view.background_top * part;
}

// What camera rays without an intersection see; `at` is the position on the film, (0, 0) at the top left.
fn backdrop(direction: vec3<f32>, at: vec2<f32>) -> vec3<f32> {
  if (view.background_kind < 2u) { return background(direction); }
  let v = (at - BACKDROP_CENTER) * vec2<f32>(BACKDROP_STRETCH, 1.0);
  let brightness = 1.0 - BACKDROP_VIGNETTE * min(BACKDROP_FALLOFF * dot(v, v), 1.0);
  return brightness * (view.background_top * (1.0 - at.y) + view.background_bottom * at.y);
}

fn base_color(index: u32) -> vec3<f32> {
  if (view.color_kind == 0u) { return view.color; }
  let at = COLOR * index;
  return vec3<f32>(colors[at], colors[at + 1u], colors[at + 2u]);
}

fn opacity_of(index: u32) -> f32 { return colors[COLOR * index + 3u]; }

struct Surface {
  point: vec3<f32>, normal: vec3<f32>, start: vec3<f32>, inner: vec3<f32>, is_entering: bool,
}

// The point of an intersection, the normal on the side of the ray, and where rays start on this side and on the other.
fn surface_at(ray: Ray, hit: Hit) -> Surface {
  let sphere = sphere_at(hit.slot, ray.time);
  let radius = radius_of(sphere);
  let v = (ray.origin + scaled(ray.direction, hit.t)) - sphere.xyz;
  let scale = inverse(root(dot_in_order(v, v)));
  // A sphere that is too small has no direction
  let has_direction = scale > 0.0 && scale <= FAR && radius > 0.0;
  let normal = select(-ray.direction, scaled(v, scale), has_direction);
  let point = sphere.xyz + scaled(normal, radius);
  // A step above the rounding of the point
  let largest = max(abs(point), abs(ray.origin));
  let rounding = OFFSET_OF_ROUNDING * max(max(largest.x, largest.y), largest.z);
  let offset = max(OFFSET_OF_RADIUS * radius, rounding);
  let is_entering = dot_in_order(ray.direction, normal) < 0.0;
  let facing = select(-normal, normal, is_entering);
  let step = scaled(facing, offset);
  return Surface(point, facing, point + step, point - step, is_entering);
}
