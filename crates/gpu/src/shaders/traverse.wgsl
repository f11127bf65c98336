// Finds the spheres that rays intersect. Distances, and which sphere wins, equal those of the CPU to the bit.
//
// If spheres are not opaque (HAS_OPACITY), a ray that enters one ends there with the probability of its opacity, or else
// passes it in a straight line; shadow rays are attenuated by all that they enter. Spheres in which a ray starts do not
// count then.
//
// Light passes clear spheres (HAS_GLASS) in a straight line.
//
// Files that include this one define `view: View` with the fields used here, `fn opacity_of(index: u32) -> f32`, and
// `fn straight_transmittance(cosine: f32) -> f32`.
// Spheres move or not, by `moving.wgsl` or `still.wgsl`; `decoded_spheres.wgsl` or `coded_spheres.wgsl` has them.

@group(0) @binding(1) var<storage, read> nodes: array<vec4<u32>>;

const MISS: u32 = 0xffffffffu;
const FAR: f32 = 3.4e38;
// Coordinates of spheres that no ray meets
const NOWHERE: f32 = 3e38;
// Transmittance below which a shadow ray ends
const DARK: f32 = 1.0 / 4096.0;
// The same behind clear spheres: 2^-32
const CLEAR_DARK: f32 = 2.3283064365386963e-10;
// Rounding of the box test, relative to the distances in it
const SLAB_SLACK: f32 = 1e-6;

struct Ray { origin: vec3<f32>, direction: vec3<f32>, time: f32 }

// Distance, slot in the order of the tree, and index of the sphere
struct Hit { t: f32, slot: u32, index: u32 }

// A ray with the constants of its tests.
struct Prepared { ray: Ray, inverse: vec3<f32>, negative: vec3<bool>, padding: vec3<f32> }

fn prepare(ray: Ray) -> Prepared {
  // Without infinities: no product with them is NaN
  let tiny = vec3<f32>(1e-12);
  let d = select(ray.direction, select(tiny, -tiny, ray.direction < vec3<f32>(0.0)), abs(ray.direction) < tiny);
  let inverses = 1.0 / d;
  return Prepared(ray, inverses, inverses < vec3<f32>(0.0), abs(inverses) * view.padding);
}

fn radius_of(sphere: vec4<f32>) -> f32 {
  if (COMMON_RADIUS) { return view.radius; }
  return sphere.w;
}

// The line of a ray and a sphere: the distance to its point nearest to the centre, and the square of half the chord, which
// is negative without an intersection, or NaN. The discriminant uses the vector from the centre to the line (Haines et al.,
// "Precision improvements for ray/sphere intersection", 2019).
struct Chord { middle: f32, discriminant: f32 }

fn chord_of(sphere: vec4<f32>, ray: Ray) -> Chord {
  let to_center = sphere.xyz - ray.origin;
  let middle = test_dot(to_center, ray.direction);
  let across = test_minus(to_center, middle, ray.direction);
  let radius = radius_of(sphere);
  // A plain product could be fused with the subtraction
  return Chord(middle, mul(radius, radius) - test_dot(across, across));
}

// The spheres of a block whose surfaces the line of a ray meets, as a mask. Neighbouring invocations find these together,
// and the distances to the few that are left one after the other.
fn candidates_of(block: u32, ray: Ray) -> u32 {
  var mask = 0u;
  for (var j = 0u; j < BLOCK; j++) {
    let chord = chord_of(sphere_at(block * BLOCK + j, ray.time), ray);
    mask |= select(0u, 1u << j, chord.discriminant >= 0.0);
  }
  return mask;
}

// The distance to a sphere that the line of the ray meets, from outside, or from inside if the ray starts there; negative
// if it is behind the origin.
fn distance_to(sphere: vec4<f32>, ray: Ray) -> f32 {
  let chord = chord_of(sphere, ray);
  let half = root(chord.discriminant);
  let near = chord.middle - half;
  if (HAS_OPACITY) { return near; }
  return select(chord.middle + half, near, near >= 0.0);
}

// The bytes of a word as floats.
fn bytes_of(word: u32) -> vec4<f32> {
  return vec4<f32>(f32(word & 255u), f32((word >> 8u) & 255u), f32((word >> 16u) & 255u), f32(word >> 24u));
}

// For each child in which the ray is somewhere from `start` to `limit`: the distance, with the number of the child in the
// lowest three bits; MISS for the others. The keys of distances that are not negative have the order of the distances.
struct Keys { low: vec4<u32>, high: vec4<u32> }

fn test_children(at: u32, p: Prepared, start: f32, limit: f32) -> Keys {
  let head = nodes[at];
  let px = nodes[at + 1u];
  let py = nodes[at + 2u];
  let pz = nodes[at + 3u];
  // The grid of the node as distances along the ray, with slack
  let grid = head.w;
  let steps = vec3<f32>(
    bitcast<f32>((grid & 255u) << 23u),
    bitcast<f32>(((grid >> 8u) & 255u) << 23u),
    bitcast<f32>(((grid >> 16u) & 255u) << 23u),
  ) * p.inverse;
  let base = (bitcast<vec3<f32>>(head.xyz) - p.ray.origin) * p.inverse;
  let slack = fma(fma(abs(steps), vec3<f32>(255.0), abs(base)), vec3<f32>(SLAB_SLACK), p.padding);
  let low = base - slack;
  let high = base + slack;
  // Where the ray enters and leaves the slabs of the children
  let x = select(px, px.zwxy, p.negative.x);
  let y = select(py, py.zwxy, p.negative.y);
  let z = select(pz, pz.zwxy, p.negative.z);
  let sx = vec4<f32>(steps.x);
  let sy = vec4<f32>(steps.y);
  let sz = vec4<f32>(steps.z);
  let starts = vec4<f32>(start);
  let limits = vec4<f32>(limit);
  let enter0 = max(
    max(fma(bytes_of(x.x), sx, vec4<f32>(low.x)), fma(bytes_of(y.x), sy, vec4<f32>(low.y))),
    max(fma(bytes_of(z.x), sz, vec4<f32>(low.z)), starts));
  let enter1 = max(
    max(fma(bytes_of(x.y), sx, vec4<f32>(low.x)), fma(bytes_of(y.y), sy, vec4<f32>(low.y))),
    max(fma(bytes_of(z.y), sz, vec4<f32>(low.z)), starts));
  let leave0 = min(
    min(fma(bytes_of(x.z), sx, vec4<f32>(high.x)), fma(bytes_of(y.z), sy, vec4<f32>(high.y))),
    min(fma(bytes_of(z.z), sz, vec4<f32>(high.z)), limits));
  let leave1 = min(
    min(fma(bytes_of(x.w), sx, vec4<f32>(high.x)), fma(bytes_of(y.w), sy, vec4<f32>(high.y))),
    min(fma(bytes_of(z.w), sz, vec4<f32>(high.z)), limits));
  let children = vec4<u32>(grid >> 24u);
  let in0 = (enter0 <= leave0) & ((children & vec4<u32>(1u, 2u, 4u, 8u)) != vec4<u32>(0u));
  let in1 = (enter1 <= leave1) & ((children & vec4<u32>(16u, 32u, 64u, 128u)) != vec4<u32>(0u));
  let distances = vec4<u32>(0xfffffff8u);
  return Keys(
    select(vec4<u32>(MISS), (bitcast<vec4<u32>>(enter0) & distances) | vec4<u32>(0u, 1u, 2u, 3u), in0),
    select(vec4<u32>(MISS), (bitcast<vec4<u32>>(enter1) & distances) | vec4<u32>(4u, 5u, 6u, 7u), in1),
  );
}

fn swap(a: ptr<function, u32>, b: ptr<function, u32>) {
  let least = min(*a, *b);
  *b = max(*a, *b);
  *a = least;
}

// A place in the tree: its level above the blocks in the highest four bits, and its number in the level.
fn first_node(level: u32) -> u32 {
  return view.starts[(level - 1u) >> 2u][(level - 1u) & 3u];
}

// The nearest sphere before `limit`, behind `last` if spheres are not opaque. At equal distances, the lower index wins.
fn nearest_behind(last: Hit, ray: Ray, limit: f32) -> Hit {
  let p = prepare(ray);
  var hit = Hit(limit, MISS, MISS);
  // Place and key of nodes that are left
  var stack: array<vec2<u32>, STACK>;
  var size = 0u;
  var at = view.levels << 28u;
  loop {
    let level = at >> 28u;
    let index = at & 0x0fffffffu;
    if (level == 0u) {
      var candidates = candidates_of(index, ray);
      while (candidates != 0u) {
        let slot = index * BLOCK + firstTrailingBit(candidates);
        candidates &= candidates - 1u;
        let t = distance_to(sphere_at(slot, ray.time), ray);
        if (t >= 0.0 && t <= hit.t) {
          let found = index_of(slot);
          let is_passed = t < last.t || (t == last.t && found <= last.index);
          if (HAS_OPACITY && is_passed) { continue; }
          if (t < hit.t || found < hit.index) { hit = Hit(t, slot, found); }
        }
      }
    } else {
      let keys = test_children(4u * (first_node(level) + index), p, select(0.0, last.t, HAS_OPACITY), hit.t);
      let child = ((level - 1u) << 28u) | (index << 3u);
      // Sort the children by distance (the network of Batcher, 1968)
      var k0 = keys.low.x; var k1 = keys.low.y; var k2 = keys.low.z; var k3 = keys.low.w;
      var k4 = keys.high.x; var k5 = keys.high.y; var k6 = keys.high.z; var k7 = keys.high.w;
      swap(&k0, &k1); swap(&k2, &k3); swap(&k4, &k5); swap(&k6, &k7);
      swap(&k0, &k2); swap(&k1, &k3); swap(&k4, &k6); swap(&k5, &k7);
      swap(&k1, &k2); swap(&k5, &k6); swap(&k0, &k4); swap(&k1, &k5); swap(&k2, &k6); swap(&k3, &k7);
      swap(&k2, &k4); swap(&k3, &k5);
      swap(&k1, &k2); swap(&k3, &k4); swap(&k5, &k6);
      // Go to the nearest, and leave the others for later, the farthest first
      if (k0 != MISS) {
        if (k7 != MISS) { stack[size] = vec2<u32>(child | (k7 & 7u), k7); size++; }
        if (k6 != MISS) { stack[size] = vec2<u32>(child | (k6 & 7u), k6); size++; }
        if (k5 != MISS) { stack[size] = vec2<u32>(child | (k5 & 7u), k5); size++; }
        if (k4 != MISS) { stack[size] = vec2<u32>(child | (k4 & 7u), k4); size++; }
        if (k3 != MISS) { stack[size] = vec2<u32>(child | (k3 & 7u), k3); size++; }
        if (k2 != MISS) { stack[size] = vec2<u32>(child | (k2 & 7u), k2); size++; }
        if (k1 != MISS) { stack[size] = vec2<u32>(child | (k1 & 7u), k1); size++; }
        at = child | (k0 & 7u);
        continue;
      }
    }
    // Take the next place that is not behind the nearest sphere
    var is_found = false;
    while (size > 0u) {
      size--;
      let next = stack[size];
      if (bitcast<f32>(next.y) <= hit.t) {
        at = next.x;
        is_found = true;
        break;
      }
    }
    if (!is_found) { break; }
  }
  return hit;
}

// The sphere at which a ray ends before `limit`; the number `u` chooses it if spheres are not opaque.
fn nearest(ray: Ray, limit: f32, u: f32) -> Hit {
  var hit = nearest_behind(Hit(0.0, MISS, 0u), ray, limit);
  if (!HAS_OPACITY) { return hit; }
  var rest = u;
  while (hit.slot != MISS) {
    let opacity = opacity_of(hit.index);
    if (rest < opacity) { break; }
    // What is left of the number is random, too
    rest = quotient(rest - opacity, 1.0 - opacity);
    hit = nearest_behind(hit, ray, limit);
  }
  return hit;
}

// The part of the light that passes a sphere straight through, at the points of the ray before `limit`.
fn passing_sphere(slot: u32, ray: Ray, limit: f32) -> f32 {
  let sphere = sphere_at(slot, ray.time);
  let chord = chord_of(sphere, ray);
  let middle = chord.middle;
  let half = root(chord.discriminant);
  let part = straight_transmittance(half / radius_of(sphere));
  var product = 1.0;
  if (middle - half >= 0.0 && middle - half < limit) { product *= part; }
  if (middle + half >= 0.0 && middle + half < limit) { product *= part; }
  return product;
}

// The part of the light that the spheres before `limit` let through. `is_straight`: light passes clear ones.
fn transmittance(ray: Ray, limit: f32, is_straight: bool) -> f32 {
  let p = prepare(ray);
  var product = 1.0;
  // First child and the mask of the children that are left
  var stack: array<vec2<u32>, STACK>;
  var size = 0u;
  var at = view.levels << 28u;
  loop {
    let level = at >> 28u;
    let index = at & 0x0fffffffu;
    if (level == 0u) {
      var candidates = candidates_of(index, ray);
      while (candidates != 0u) {
        let slot = index * BLOCK + firstTrailingBit(candidates);
        candidates &= candidates - 1u;
        if (HAS_GLASS && is_straight) {
          product *= passing_sphere(slot, ray, limit);
          if (product < CLEAR_DARK) { return 0.0; }
          continue;
        }
        let t = distance_to(sphere_at(slot, ray.time), ray);
        if (!(t >= 0.0 && t < limit)) { continue; }
        if (!HAS_OPACITY) { return 0.0; }
        product *= 1.0 - opacity_of(index_of(slot));
        if (product < DARK) { return 0.0; }
      }
    } else {
      let keys = test_children(4u * (first_node(level) + index), p, 0.0, limit);
      let child = ((level - 1u) << 28u) | (index << 3u);
      let misses = vec4<u32>(MISS);
      let low = select(vec4<u32>(1u, 2u, 4u, 8u), vec4<u32>(0u), keys.low == misses);
      let high = select(vec4<u32>(16u, 32u, 64u, 128u), vec4<u32>(0u), keys.high == misses);
      let both = low | high;
      let children = (both.x | both.y) | (both.z | both.w);
      if (children != 0u) {
        at = child | firstTrailingBit(children);
        let rest = children & (children - 1u);
        if (rest != 0u) {
          stack[size] = vec2<u32>(child, rest);
          size++;
        }
        continue;
      }
    }
    // Take the next child
    if (size == 0u) { break; }
    let next = stack[size - 1u];
    at = next.x | firstTrailingBit(next.y);
    let rest = next.y & (next.y - 1u);
    if (rest == 0u) { size--; } else { stack[size - 1u].y = rest; }
  }
  return product;
}
