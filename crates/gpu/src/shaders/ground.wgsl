// The ground: a plane that is visible from above, and fades out far from the particles.

const NO_GROUND: u32 = 0u;
const CHECKER: u32 = 2u;

// Distance of the ground along a ray, FAR without it; its opacity there.
struct GroundHit { t: f32, opacity: f32, point: vec3<f32> }

fn hit_ground(ray: Ray) -> GroundHit {
  let none = GroundHit(FAR, 0.0, vec3<f32>(0.0));
  if (scene.ground_kind == NO_GROUND) { return none; }
  let slope = dot_in_order(ray.direction, scene.ground_up);
  let t = quotient(scene.ground_height - dot_in_order(ray.origin, scene.ground_up), slope);
  if (!(slope < 0.0 && t >= 0.0 && t < FAR)) { return none; }
  let point = ray.origin + scaled(ray.direction, t);
  let outside = max(abs(point - scene.ground_center) - scene.ground_base, vec3<f32>(0.0));
  let span = max(scene.fade_end - scene.fade_start, 1.17549435e-38);
  // A part of the coverage, so with the bits of the CPU
  let x = clamp(quotient(scene.fade_end - root(dot_in_order(outside, outside)), span), 0.0, 1.0);
  let opacity = mul(mul(x, x), 3.0 - 2.0 * x);
  if (!(opacity > 0.0)) { return none; }
  return GroundHit(t, opacity, point);
}

// The whole plane occludes, faded or not.
fn is_below_ground(ray: Ray, limit: f32) -> bool {
  if (scene.ground_kind == NO_GROUND) { return false; }
  let slope = dot(ray.direction, scene.ground_up);
  let t = (scene.ground_height - dot(ray.origin, scene.ground_up)) / slope;
  return slope < 0.0 && t >= 0.0 && t < limit;
}

// Where rays that leave the ground start
fn above_ground(ground: GroundHit) -> vec3<f32> {
  let largest = max(max(largest_of(abs(ground.point)), ground.t), abs(scene.ground_height));
  return ground.point + max(OFFSET_OF_ROUNDING * largest, 1.17549435e-38) * scene.ground_up;
}

fn ground_normal() -> vec3<f32> { return scene.ground_up; }

// What it reflects of ambient light, and of other light, by Whitted's model
fn ground_ambient() -> vec3<f32> { return scene.ground_ambient; }

fn ground_diffuse() -> f32 { return scene.ground_diffuse; }

fn ground_color(point: vec3<f32>) -> vec3<f32> {
  if (scene.ground_kind != CHECKER) { return scene.ground_color; }
  let v = (point - scene.ground_center) / scene.ground_tile;
  let along = cross(scene.ground_up, scene.ground_across);
  let square = vec2<i32>(floor(vec2<f32>(dot(v, scene.ground_across), dot(v, along))));
  return scene.ground_color * select(1.0, 0.35, ((square.x ^ square.y) & 1) == 1);
}
