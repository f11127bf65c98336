// Light sources, sampled from a point, and hit by rays: without extent, suns, spheres, rectangles and ellipses.

const POINT: u32 = 0u;
const POINT_WITH_FALLOFF: u32 = 1u;
const DISTANT: u32 = 2u;
const SUN: u32 = 3u;
const SPHERE: u32 = 4u;
const RECTANGLE: u32 = 5u;
const ELLIPSE: u32 = 6u;

// Solid angle from which on a rectangle is sampled in it
const MIN_SOLID_ANGLE: f32 = 0.05;

// A direction to a light, its distance, the radiance from there, and the density of the choice: FAR for lights without
// extent, whose radiance is the irradiance on a surface that faces them.
struct LightSample { direction: vec3<f32>, distance: f32, radiance: vec3<f32>, pdf: f32 }

fn has_extent(light: Light) -> bool { return light.kind >= SUN; }

// A sphere as seen from a point: unit vector to its centre, distance, and 1 minus the cosine of half its apparent diameter
struct Cap { axis: vec3<f32>, distance: f32, cap: f32 }

fn cap_of(light: Light, start: vec3<f32>) -> Cap {
  let v = light.place - start;
  let distance2 = dot(v, v);
  let distance = sqrt(distance2);
  let sin2 = light.half.x * light.half.x / distance2;
  let is_outside = sin2 < 1.0;
  let cosine = sqrt(select(0.0, 1.0 - sin2, is_outside));
  let axis = select(vec3<f32>(0.0, 0.0, 1.0), v / distance, distance > 0.0);
  return Cap(axis, distance, select(2.0, sin2 / (1.0 + cosine), is_outside));
}

fn distance_in(cap: Cap, cosine: f32, radius: f32) -> f32 {
  let middle = cap.distance * cosine;
  let half = sqrt(max(radius * radius - cap.distance * cap.distance + middle * middle, 0.0));
  return select(middle + half, middle - half, cap.cap < 2.0);
}

// A rectangle in a plane as seen from a point (Ureña, Fajardo and King, "An area-preserving parametrization for spherical
// rectangles", 2013)
struct SphericalRectangle { x: vec2<f32>, y: vec2<f32>, z: f32, b0: f32, b1: f32, k: f32, solid_angle: f32 }

fn edge_normal(a: f32, z: f32) -> f32 { return a / sqrt(z * z + a * a); }

fn inner_angle(a: f32, b: f32) -> f32 { return arc_cosine(clamp(-a * b, -1.0, 1.0)); }

fn rectangle_from(center: vec3<f32>, half: vec2<f32>) -> SphericalRectangle {
  let x = vec2<f32>(center.x - half.x, center.x + half.x);
  let y = vec2<f32>(center.y - half.y, center.y + half.y);
  let z = -abs(center.z);
  let n0 = -edge_normal(y.x, z);
  let n1 = edge_normal(x.y, z);
  let n2 = edge_normal(y.y, z);
  let n3 = -edge_normal(x.x, z);
  let k = 2.0 * PI - inner_angle(n2, n3) - inner_angle(n3, n0);
  return SphericalRectangle(x, y, z, n0, n2, k, inner_angle(n0, n1) + inner_angle(n1, n2) - k);
}

// The point at `u`, uniform in solid angle
fn on_rectangle(r: SphericalRectangle, u: vec2<f32>) -> vec2<f32> {
  let turned = sine_cosine(u.x * r.solid_angle + r.k);
  let f = (turned.y * r.b0 - r.b1) / turned.x;
  let c = 1.0 / sqrt(f * f + r.b0 * r.b0);
  let cosine = clamp(select(-c, c, f > 0.0), -1.0, 1.0);
  let x = clamp(-cosine * r.z / sqrt(max(1.0 - cosine * cosine, 1e-12)), r.x.x, r.x.y);
  let d2 = x * x + r.z * r.z;
  let h0 = r.y.x / sqrt(d2 + r.y.x * r.y.x);
  let h1 = r.y.y / sqrt(d2 + r.y.y * r.y.y);
  let h = h0 + u.y * (h1 - h0);
  let y = h * sqrt(d2 / max(1.0 - h * h, 1e-12));
  return vec2<f32>(x, clamp(y, r.y.x, r.y.y));
}

fn panel_area(light: Light) -> f32 {
  return light.half.x * light.half.y * select(4.0, PI, light.kind == ELLIPSE);
}

// A vector in the axes of a panel
fn on_axes(light: Light, v: vec3<f32>) -> vec3<f32> {
  return vec3<f32>(dot(v, light.across), dot(v, light.along), dot(v, light.normal));
}

fn sample_panel(light: Light, start: vec3<f32>, u: vec2<f32>) -> LightSample {
  let center = on_axes(light, light.place - start);
  let is_rectangle = light.kind == RECTANGLE;
  var at = select(on_disc(u), 2.0 * u - 1.0, is_rectangle);
  var to_point = vec3<f32>(center.xy + at * light.half, center.z);
  var solid_angle = 0.0;
  if (is_rectangle) {
    let seen = rectangle_from(center, light.half);
    solid_angle = seen.solid_angle;
    if (solid_angle >= MIN_SOLID_ANGLE) { to_point = vec3<f32>(on_rectangle(seen, u), center.z); }
  }
  let distance2 = dot(to_point, to_point);
  let distance = sqrt(distance2);
  let direction = (to_point.x * light.across + to_point.y * light.along + to_point.z * light.normal) / distance;
  // Only points in front of the light are lit
  let height = -center.z;
  let of_area = distance2 * distance / (height * panel_area(light));
  let pdf = select(of_area, 1.0 / solid_angle, solid_angle >= MIN_SOLID_ANGLE);
  if (!(height > 0.0)) { return LightSample(direction, distance, vec3<f32>(0.0), 1.0); }
  return LightSample(direction, distance, light.radiance, pdf);
}

fn sample_light(light: Light, start: vec3<f32>, u: vec2<f32>) -> LightSample {
  if (light.kind == DISTANT) { return LightSample(light.place, FAR, light.radiance, FAR); }
  if (light.kind == SUN) {
    let cap = light.half.x;
    return LightSample(in_cone(light.place, cap, u), FAR, light.radiance, 1.0 / (2.0 * PI * cap));
  }
  if (light.kind == SPHERE) {
    let seen = cap_of(light, start);
    let direction = in_cone(seen.axis, seen.cap, u);
    let distance = distance_in(seen, dot(direction, seen.axis), light.half.x);
    return LightSample(direction, distance, light.radiance, 1.0 / (2.0 * PI * seen.cap));
  }
  if (light.kind >= RECTANGLE) { return sample_panel(light, start, u); }
  let v = light.place - start;
  let distance = sqrt(dot(v, v));
  let falloff = select(1.0, 1.0 / (distance * distance), light.kind == POINT_WITH_FALLOFF);
  return LightSample(v / distance, distance, falloff * light.radiance, FAR);
}

// Where a ray hits a light with an extent, and the density with which the light samples its direction.
struct LightHit { is_hit: bool, t: f32, pdf: f32 }

fn hit_light(light: Light, ray: Ray) -> LightHit {
  if (light.kind == SUN) {
    let v = ray.direction - light.place;
    return LightHit(dot(v, v) < 2.0 * light.half.x, FAR, 1.0 / (2.0 * PI * light.half.x));
  }
  if (light.kind == SPHERE) {
    let seen = cap_of(light, ray.origin);
    let v = ray.direction - seen.axis;
    let t = distance_in(seen, dot(ray.direction, seen.axis), light.half.x);
    return LightHit(dot(v, v) < 2.0 * seen.cap, t, 1.0 / (2.0 * PI * seen.cap));
  }
  let center = on_axes(light, light.place - ray.origin);
  let along = on_axes(light, ray.direction);
  let t = center.z / along.z;
  let at = (along.xy * t - center.xy) / light.half;
  let is_within = select(dot(at, at) < 1.0, abs(at.x) < 1.0 && abs(at.y) < 1.0, light.kind == RECTANGLE);
  var pdf = t * t * t / (-center.z * panel_area(light));
  if (light.kind == RECTANGLE) {
    let solid_angle = rectangle_from(center, light.half).solid_angle;
    pdf = select(pdf, 1.0 / solid_angle, solid_angle >= MIN_SOLID_ANGLE);
  }
  return LightHit(is_within && along.z < 0.0 && t > 0.0, t, pdf);
}
