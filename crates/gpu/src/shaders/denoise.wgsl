// Removes the noise of a picture: non-local means of the two halves of its samples, with features. The formulas and the
// names are those of the CPU's `denoise`, whose constants precede this file; sums are in another order.

// Invocations along a side of a tile
const TILE: u32 = 16u;
// Those of a tile and of the pixels around it that patches reach
const WIDE_TILE: u32 = TILE + 2u;
const GROUP: u32 = 64u;
// Above all components of colours
const NO_LIMIT: f32 = 3.4e38;
// Neighbours on each side that glints and noise are found by
const RADIUS: i32 = 2;
// Neighbours of its kind with which a pixel is no glint
const FEW: u32 = 4u;
const SEVERAL: u32 = 8u;

struct Denoise {
  // Size of the picture, and the search radius
  width: i32, height: i32, search: i32, is_transparent: u32,
  // Parts of the samples that are even and odd; one over the number of samples, and over that of the odd ones
  even: f32, odd: f32, share: f32, odd_share: f32,
  // Factor of the sum of colour distances over a patch; whether colours are not negative, and coverage is 0 to 1
  color_scale: f32, is_bounded: u32, zero: u32, zero_too: u32,
}
@group(0) @binding(0) var<uniform> denoise: Denoise;
// Sums over the samples of each pixel, then those over every second sample: red, green, blue, coverage
@group(0) @binding(1) var<storage, read> film: array<vec4<f32>>;
// For each pixel, albedo and depth, then the normal: as `features.wgsl` finds them, from `halve` on in units of their
// tolerances
@group(0) @binding(2) var<storage, read_write> guides: array<vec4<f32>>;
// The largest component of both halves without albedo; 0 if a pixel cannot be filtered
@group(0) @binding(3) var<storage, read_write> brightness: array<f32>;
// For each pixel, the even and the odd half without albedo, with their coverages
@group(0) @binding(4) var<storage, read_write> halves: array<vec4<f32>>;
// Variance of one half, also of the pixels around the picture
@group(0) @binding(5) var<storage, read_write> noise: array<f32>;
// Tolerance of depth per column and per row
@group(0) @binding(6) var<storage, read_write> slopes: array<vec2<f32>>;
// The result
@group(0) @binding(7) var<storage, read_write> clean: array<vec4<f32>>;

fn size() -> vec2<i32> { return vec2<i32>(denoise.width, denoise.height); }

fn is_inside(p: vec2<i32>) -> bool { return all(p >= vec2<i32>(0)) && all(p < size()); }

// The number of a pixel, or of the nearest one at the edge.
fn number_of(p: vec2<i32>) -> u32 {
  let inside = clamp(p, vec2<i32>(0), size() - 1);
  return u32(inside.y * denoise.width + inside.x);
}

// The place in `noise` of a pixel of the picture or around it.
fn noise_place(p: vec2<i32>) -> u32 {
  let inside = clamp(p, vec2<i32>(-1), size()) + 1;
  return u32(inside.y * (denoise.width + 2) + inside.x);
}

fn pixel_count() -> u32 { return u32(denoise.width * denoise.height); }

fn bounded(color: vec4<f32>) -> vec4<f32> {
  if (denoise.is_bounded == 0u) { return color; }
  return vec4<f32>(max(color.rgb, vec3<f32>(0.0)), clamp(color.a, 0.0, 1.0));
}

fn mean_of(pixel: u32) -> vec4<f32> { return bounded(film[pixel] * denoise.share); }

fn odd_mean_of(pixel: u32) -> vec4<f32> { return bounded(film[pixel_count() + pixel] * denoise.odd_share); }

fn is_depth(depth: f32) -> bool { return depth >= LEAST_DEPTH && depth <= GREATEST_DEPTH; }

// The colour that a pixel is compared by: a transparent background over white.
fn compared(color: vec4<f32>, depth: f32) -> vec3<f32> {
  let is_background = denoise.is_transparent == 1u && !is_depth(depth);
  return color.rgb + select(0.0, 1.0 - color.a, is_background);
}

fn divisor(albedo: vec3<f32>, depth: f32) -> vec3<f32> {
  let limited = clamp(albedo, vec3<f32>(MIN_ALBEDO), vec3<f32>(MAX_VALUE));
  return select(vec3<f32>(1.0), limited, is_depth(depth));
}

fn magnitude(v: vec3<f32>) -> f32 { return abs(v.x) + abs(v.y) + abs(v.z); }

// A pixel without albedo: both halves, or zeros if it cannot be filtered.
struct Halved { even: vec3<f32>, odd: vec3<f32>, is_usable: bool }

fn halved(pixel: u32) -> Halved {
  let guide = guides[2u * pixel];
  let mean = compared(mean_of(pixel), guide.w);
  let odd = compared(odd_mean_of(pixel), guide.w);
  let features = magnitude(guide.xyz) + magnitude(guides[2u * pixel + 1u].xyz);
  if (!(magnitude(mean) + magnitude(odd) + features <= MAX_VALUE)) {
    return Halved(vec3<f32>(0.0), vec3<f32>(0.0), false);
  }
  let scale = 1.0 / divisor(guide.xyz, guide.w);
  return Halved((mean - odd * denoise.odd) / denoise.even * scale, odd * scale, true);
}

fn largest_of(v: vec3<f32>) -> f32 { return max(v.x, max(v.y, v.z)); }

@compute @workgroup_size(GROUP)
fn find_brightness(
  @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
  @builtin(local_invocation_index) local: u32,
) {
  let pixel = linear_index(group, groups, local, GROUP);
  if (pixel >= pixel_count()) { return; }
  let halves_of = halved(pixel);
  brightness[pixel] = max(largest_of(abs(halves_of.even)), largest_of(abs(halves_of.odd)));
}

// The limit of a pixel of this brightness: a glint gives the others no more.
fn limit_of(p: vec2<i32>, own: f32) -> f32 {
  let low = max(p - RADIUS, vec2<i32>(0));
  let high = min(p + RADIUS, size() - 1);
  // Count the pixels of its kind, with itself
  var alike = 0u;
  for (var y = low.y; y <= high.y; y++) {
    for (var x = low.x; x <= high.x; x++) {
      alike += select(0u, 1u, brightness[number_of(vec2<i32>(x, y))] * FEW_FACTOR >= own);
    }
  }
  if (alike > SEVERAL) { return NO_LIMIT; }
  // Sort the largest ones; the first is the pixel itself, or one like it
  var largest = array<f32, 9>();
  for (var y = low.y; y <= high.y; y++) {
    for (var x = low.x; x <= high.x; x++) {
      var rest = brightness[number_of(vec2<i32>(x, y))];
      for (var place = 0u; place <= SEVERAL; place++) {
        let there = largest[place];
        largest[place] = max(there, rest);
        rest = min(there, rest);
      }
    }
  }
  // At the edges of tiny pictures, there are fewer neighbours
  let extent = high - low + 1;
  let neighbours = u32(extent.x * extent.y - 1);
  let few = FEW_FACTOR * largest[min(FEW, neighbours)];
  let several = SEVERAL_FACTOR * largest[min(SEVERAL, neighbours)];
  return min(select(NO_LIMIT, few, own > few), select(NO_LIMIT, several, own > several));
}

@compute @workgroup_size(GROUP)
fn halve(
  @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
  @builtin(local_invocation_index) local: u32,
) {
  let pixel = linear_index(group, groups, local, GROUP);
  if (pixel >= pixel_count()) { return; }
  let p = vec2<i32>(i32(pixel) % denoise.width, i32(pixel) / denoise.width);
  let found = halved(pixel);
  let limit = vec3<f32>(limit_of(p, brightness[pixel]));
  // The even half is what the odd one leaves of the mean
  let odd_coverage = odd_mean_of(pixel).a;
  let even_coverage = (mean_of(pixel).a - odd_coverage * denoise.odd) / denoise.even;
  let coverages = select(vec2<f32>(0.0), vec2<f32>(even_coverage, odd_coverage), found.is_usable);
  halves[2u * pixel] = vec4<f32>(clamp(found.even, -limit, limit), coverages.x);
  halves[2u * pixel + 1u] = vec4<f32>(clamp(found.odd, -limit, limit), coverages.y);
  // Features in units of their tolerances
  let guide = guides[2u * pixel];
  let albedo = select(vec3<f32>(UNUSABLE), guide.xyz / ALBEDO_TOLERANCE, found.is_usable);
  let normal = select(vec3<f32>(0.0), guides[2u * pixel + 1u].xyz / NORMAL_TOLERANCE, found.is_usable);
  guides[2u * pixel] = vec4<f32>(albedo, select(MISSED, guide.w, is_depth(guide.w)));
  guides[2u * pixel + 1u] = vec4<f32>(normal, 0.0);
}

fn is_usable(pixel: u32) -> bool { return guides[2u * pixel].x < UNUSABLE; }

// Weights of variances on each axis
fn noise_weight(offset: i32) -> f32 { return f32(RADIUS + 1 - abs(offset)); }

// The depth of a pixel; those beside the picture are missed.
fn depth_at(p: vec2<i32>) -> f32 { return select(MISSED, guides[2u * number_of(p)].w, is_inside(p)); }

fn lesser_slope(before: f32, at: f32, after: f32) -> f32 {
  let slope = min(abs(at - before), abs(after - at));
  return SLOPE_TOLERANCE * select(0.0, slope, slope <= GREATEST_DEPTH);
}

// The variance of a pixel of the picture or around it, averaged over its neighbours, and the slopes of its depth.
@compute @workgroup_size(GROUP)
fn estimate_noise(
  @builtin(workgroup_id) group: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>,
  @builtin(local_invocation_index) local: u32,
) {
  let place = i32(linear_index(group, groups, local, GROUP));
  let columns = denoise.width + 2;
  if (place >= columns * (denoise.height + 2)) { return; }
  let p = vec2<i32>(place % columns, place / columns) - 1;
  let pixel = number_of(p);
  // Average variances
  var sum = 0.0;
  for (var y = -RADIUS; y <= RADIUS; y++) {
    for (var x = -RADIUS; x <= RADIUS; x++) {
      let other = number_of(p + vec2<i32>(x, y));
      let difference = halves[2u * other].xyz - halves[2u * other + 1u].xyz;
      sum += noise_weight(x) * noise_weight(y) * 0.5 * dot(difference, difference);
    }
  }
  let both = halves[2u * pixel].xyz + halves[2u * pixel + 1u].xyz;
  let least = dot(both, both) * (0.25 * RELATIVE_NOISE * RELATIVE_NOISE) + MIN_NOISE;
  let estimate = min(sum / 81.0 + least, UNUSABLE_NOISE);
  noise[place] = select(UNUSABLE_NOISE, estimate, is_usable(pixel));
  // Find slopes
  if (is_inside(p)) {
    let depth = depth_at(p);
    let x = vec2<i32>(1, 0);
    let y = vec2<i32>(0, 1);
    slopes[pixel] = vec2<f32>(
      lesser_slope(depth_at(p - x), depth, depth_at(p + x)),
      lesser_slope(depth_at(p - y), depth, depth_at(p + y)),
    );
  }
}

// Distances of the pixels of a tile and around it from those at an offset, for both halves
var<workgroup> distances: array<vec2<f32>, WIDE_TILE * WIDE_TILE>;

fn distance_of(p: vec2<i32>, q: vec2<i32>) -> vec2<f32> {
  let at = 2u * number_of(p);
  let other = 2u * number_of(q);
  let p_noise = noise[noise_place(p)];
  let q_noise = noise[noise_place(q)];
  let even = halves[at].xyz - halves[other].xyz;
  let odd = halves[at + 1u].xyz - halves[other + 1u].xyz;
  let differences = vec2<f32>(dot(even, even), dot(odd, odd)) - 2.0 * min(p_noise, q_noise);
  return min(differences / (p_noise + q_noise), vec2<f32>(MAX_DISTANCE));
}

// The sums over the patch of an invocation.
fn patch_distance(local: vec2<u32>) -> vec2<f32> {
  var sum = vec2<f32>(0.0);
  for (var row = 0u; row < 3u; row++) {
    let first = (local.y + row) * WIDE_TILE + local.x;
    sum += distances[first] + distances[first + 1u] + distances[first + 2u];
  }
  return sum * denoise.color_scale;
}

fn tolerance(pixel: u32, depth: f32, offset: vec2<f32>) -> f32 {
  return dot(slopes[pixel], offset) + depth * DEPTH_TOLERANCE;
}

fn feature_distance(p: u32, q: u32, offset: vec2<i32>) -> f32 {
  let guide = guides[2u * p];
  let other = guides[2u * q];
  let albedo = guide.xyz - other.xyz;
  let normal = guides[2u * p + 1u].xyz - guides[2u * q + 1u].xyz;
  let steps = vec2<f32>(abs(offset));
  let z = (guide.w - other.w) / min(tolerance(p, guide.w, steps), tolerance(q, other.w, steps));
  return max(max(dot(albedo, albedo), dot(normal, normal)), z * z);
}

// (1 - x/8)^8, which is close to exp(-x)
fn weight_of(x: f32) -> f32 {
  let base = max(1.0 - x * 0.125, 0.0);
  let square = base * base;
  let fourth = square * square;
  return fourth * fourth;
}

// Sums over the window of a pixel for both halves: weighted differences of colour and coverage, and weights.
struct Sums { even: vec4<f32>, odd: vec4<f32>, weights: vec2<f32> }

fn add_pair(sums: ptr<function, Sums>, p: u32, q: u32, offset: vec2<i32>, local: vec2<u32>) {
  let feature = feature_distance(p, q, offset);
  let colors = patch_distance(local);
  // The even half has the weights of the odd one, and conversely
  let weights = vec2<f32>(
    weight_of(max(max(colors.y, colors.x * OWN_PART), feature)),
    weight_of(max(max(colors.x, colors.y * OWN_PART), feature)),
  );
  (*sums).even += weights.x * (halves[2u * q] - halves[2u * p]);
  (*sums).odd += weights.y * (halves[2u * q + 1u] - halves[2u * p + 1u]);
  (*sums).weights += weights;
}

// The picture with the change of a pixel.
fn changed(pixel: u32, sums: Sums) -> vec4<f32> {
  let color = mean_of(pixel);
  if (!is_usable(pixel)) { return color; }
  // The pixel itself has weight 1
  let parts = vec2<f32>(denoise.even, denoise.odd) / (1.0 + sums.weights);
  let change = sums.even * parts.x + sums.odd * parts.y;
  let guide = guides[2u * pixel];
  // Coverage by surfaces is exact
  let is_background = denoise.is_transparent == 1u && !is_depth(guide.w);
  let covered = select(0.0, change.w, is_background);
  let coverage = select(color.a, clamp(color.a + covered, 0.0, 1.0), covered != 0.0);
  let filtered = color.rgb + divisor(guide.xyz * ALBEDO_TOLERANCE, guide.w) * change.xyz + covered;
  return vec4<f32>(max(filtered, min(color.rgb, vec3<f32>(0.0))), coverage);
}

@compute @workgroup_size(TILE, TILE)
fn filter_pixels(
  @builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>,
  @builtin(local_invocation_index) number: u32,
) {
  let corner = vec2<i32>(group.xy * TILE);
  let at = corner + vec2<i32>(local.xy);
  let p = number_of(at);
  var sums = Sums();
  for (var dy = -denoise.search; dy <= denoise.search; dy++) {
    for (var dx = -denoise.search; dx <= denoise.search; dx++) {
      let offset = vec2<i32>(dx, dy);
      if (dx == 0 && dy == 0) { continue; }
      // Compare the pixels of the tile and around it
      for (var cell = number; cell < WIDE_TILE * WIDE_TILE; cell += TILE * TILE) {
        let compared_at = corner + vec2<i32>(vec2<u32>(cell % WIDE_TILE, cell / WIDE_TILE)) - 1;
        distances[cell] = distance_of(compared_at, compared_at + offset);
      }
      workgroupBarrier();
      if (is_inside(at + offset)) { add_pair(&sums, p, number_of(at + offset), offset, local.xy); }
      workgroupBarrier();
    }
  }
  if (is_inside(at)) { clean[p] = changed(p, sums); }
}
