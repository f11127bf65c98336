// Elementary functions with the accuracy of the CPU's, whose polynomials these are (Moshier, Cephes): WGSL allows far
// larger errors of its own.

const PI: f32 = 3.14159265;
const HALF_PI: f32 = 1.57079633;
const QUARTER_PI: f32 = 0.785398163;
const INVERSE_PI: f32 = 0.31830987;

// `magnitude` with the sign of another number
fn with_sign(magnitude: f32, sign_of: f32) -> f32 {
  return bitcast<f32>((bitcast<u32>(magnitude) & 0x7fffffffu) | (bitcast<u32>(sign_of) & 0x80000000u));
}

fn arc_sine(x: f32) -> f32 {
  let a = abs(x);
  let is_large = a > 0.5;
  let z = select(a * a, 0.5 * (1.0 - a), is_large);
  let s = select(a, sqrt(z), is_large);
  let p = fma(fma(fma(fma(4.21632e-2, z, 2.4181312e-2), z, 4.5470026e-2), z, 7.4953e-2), z, 1.6666752e-1);
  let r = s + s * z * p;
  return with_sign(select(r, HALF_PI - 2.0 * r, is_large), x);
}

fn arc_cosine(x: f32) -> f32 {
  let a = abs(x);
  let s = arc_sine(sqrt(0.5 * (1.0 - a)));
  let large = select(2.0 * s, PI - 2.0 * s, x < 0.0);
  return select(HALF_PI - arc_sine(x), large, a > 0.5);
}

// The angle of the vector (x, y) from the x axis
fn angle_of(y: f32, x: f32) -> f32 {
  let ax = abs(x);
  let ay = abs(y);
  let is_steep = ay > ax;
  let small = min(ax, ay);
  let most = max(ax, ay);
  let large = select(1.0, most, most > 0.0);
  let is_far = small > 0.41421357 * large;
  let t = select(small, small - large, is_far) / select(large, small + large, is_far);
  let z = t * t;
  let p = fma(fma(fma(8.0537445e-2, z, -1.3877686e-1), z, 1.9977711e-1), z, -3.333295e-1);
  var angle = p * z * t + t;
  angle = select(angle, QUARTER_PI + angle, is_far);
  angle = select(angle, HALF_PI - angle, is_steep);
  angle = select(angle, PI - angle, x < 0.0);
  return with_sign(angle, y);
}

// Sine and cosine of an angle of at most a few turns, with the bits of the CPU
fn sine_cosine(x: f32) -> vec2<f32> {
  let quadrant = round(mul(x, 2.0 * INVERSE_PI));
  let r = ((x - mul(quadrant, 1.5703125)) - mul(quadrant, 4.837513e-4)) - mul(quadrant, 7.5497895e-8);
  let z = mul(r, r);
  let s = mul(mul(-1.9515296e-4, z) + 8.332161e-3, z) - 1.6666655e-1;
  let sine = mul(mul(s, z), r) + r;
  let c = mul(mul(2.4433157e-5, z) - 1.3887316e-3, z) + 4.1666646e-2;
  let cosine = (mul(mul(c, z), z) - 0.5 * z) + 1.0;
  let quarter = i32(quadrant);
  let swapped = select(vec2<f32>(sine, cosine), vec2<f32>(cosine, sine), (quarter & 1) == 1);
  return vec2<f32>(
    select(swapped.x, -swapped.x, (quarter & 2) != 0),
    select(swapped.y, -swapped.y, ((quarter + 1) & 2) != 0),
  );
}

fn largest_of(v: vec3<f32>) -> f32 { return max(max(v.x, v.y), v.z); }

// Two unit vectors perpendicular to the unit vector `n` and to each other (Duff et al., "Building an orthonormal basis,
// revisited", 2017).
struct Tangents { s: vec3<f32>, t: vec3<f32> }

fn tangents_of(n: vec3<f32>) -> Tangents {
  let side = select(1.0, -1.0, n.z < 0.0);
  let a = -inverse(side + n.z);
  let b = mul(mul(n.x, n.y), a);
  return Tangents(
    vec3<f32>(1.0 + mul(mul(side * n.x, n.x), a), side * b, -side * n.x),
    vec3<f32>(b, side + mul(mul(n.y, n.y), a), -n.y),
  );
}

// The unit vector with these components along the tangents of `n` and `n`, with the bits of the CPU
fn to_world(along: vec3<f32>, n: vec3<f32>) -> vec3<f32> {
  let frame = tangents_of(n);
  let world = (scaled(frame.s, along.x) + scaled(frame.t, along.y)) + scaled(n, along.z);
  return scaled(world, inverse(root(dot_in_order(world, world))));
}

// A point of the unit disc (Shirley and Chiu, "A low distortion map between disk and square", 1997), with the bits of the
// CPU
fn on_disc(u: vec2<f32>) -> vec2<f32> {
  let at = 2.0 * u - 1.0;
  let is_steep = abs(at.y) > abs(at.x);
  let radius = select(at.x, at.y, is_steep);
  let other = select(at.y, at.x, is_steep);
  let angle = mul(QUARTER_PI, select(quotient(other, radius), 0.0, radius == 0.0));
  let turned = sine_cosine(select(angle, HALF_PI - angle, is_steep));
  return vec2<f32>(mul(radius, turned.y), mul(radius, turned.x));
}

// The direction at `u` in a cone around `axis`: `cap` is 1 minus the cosine of half its opening angle.
fn in_cone(axis: vec3<f32>, cap: f32, u: vec2<f32>) -> vec3<f32> {
  let below = u.x * cap;
  let level = sqrt(max(below * (2.0 - below), 0.0));
  let turned = sine_cosine(2.0 * PI * u.y);
  return to_world(vec3<f32>(level * turned.y, level * turned.x, 1.0 - below), axis);
}
