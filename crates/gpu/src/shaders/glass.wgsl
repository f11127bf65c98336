// Paths through glass: spheres reflect and refract rays, as on the CPU (`specular.rs`, `roulette.rs`). Files that include
// this one define how rays leave a surface (`smooth_glass.wgsl`, `rough_glass.wgsl`), what rays see beyond the last
// depth (`fn seen_at_end(direction)`), and the light group of that (`fn group_at_end()`).
//
// Both rays go on while the lesser one has enough weight; below that, one of them is chosen at random. A pixel traces one
// ray at a time: of two rays, the lesser goes on, and the greater is kept until the path of the lesser has ended. So the
// weights halve from one kept ray to the next, and few are kept at once. What a pixel adds up has the same order in every
// run.
//
// A kept ray has its origin, direction and throughput, its depth, and the seed of its random numbers. It has not been
// reflected by the ground, because paths do not split from there on.

// Vectors of a kept ray
const KEPT: u32 = 3u;
@group(0) @binding(23) var<storage, read_write> kept: array<vec4<f32>>;

// Where a ray is in its path: the seed of its random numbers, its depth from 1, the reflections by the ground before, the
// number of rays that its pixel keeps, its first interaction, and whether glass has refracted it; and where the next ray
// starts, which is not in `Next`: the code of an NVIDIA driver (580.159) for opaque spheres would take twice the time
struct State {
  seed: Wide, depth: u32, bounces: u32, kept: u32, first: u32, is_refracted: bool, start: vec3<f32>,
}

fn camera_state(pixel: u32) -> State { return State(seed_at(pixel, 0u, BOUNCED), 1u, 0u, 0u, NOTHING_FIRST, false, vec3<f32>(0.0)); }

fn bounces_of(state: State) -> u32 { return state.bounces; }

fn depth_along(state: State) -> u32 { return state.depth; }

fn first_of(state: State) -> u32 { return state.first; }

fn seed_of(pixel: u32, state: State) -> Wide { return state.seed; }

fn bounced(state: State, start: vec3<f32>) -> State {
  let first = select(state.first, BOUNCE_FIRST, state.first == NOTHING_FIRST);
  return State(child_of(state.seed, BOUNCED), state.depth + 1u, state.bounces + 1u, state.kept, first, false, start);
}

// The state of a stored ray is its last vector.
fn stored_state(i: u32) -> State {
  let words = bitcast<vec4<u32>>(rays[RAY * i + RAY - 1u]);
  let start = vec3<f32>(0.0);
  return State(words.xy, words.z & 0xffffu, words.z >> 16u, words.w & 0xffffu, words.w >> 16u, false, start);
}

fn store_state(place: u32, pixel: u32, state: State) {
  next_rays[RAY * place] = vec4<f32>(state.start, word_of(pixel));
  let words = vec4<u32>(state.seed, state.depth | (state.bounces << 16u), state.kept | (state.first << 16u));
  next_rays[RAY * place + RAY - 1u] = bitcast<vec4<f32>>(words);
}

fn kept_place(pixel: u32, number: u32) -> u32 { return KEPT * (number * view.width * view.height + pixel); }

fn keep(pixel: u32, number: u32, next: Next) {
  let place = kept_place(pixel, number);
  let seed = bitcast<vec2<f32>>(next.state.seed);
  let word = next.state.depth | (next.state.first << 16u) | select(0u, 0x8000u, next.state.is_refracted);
  kept[place] = vec4<f32>(next.state.start, bitcast<f32>(word));
  kept[place + 1u] = vec4<f32>(next.direction, seed.x);
  kept[place + 2u] = vec4<f32>(next.throughput, seed.y);
}

// The ray that was kept last.
fn take_kept(pixel: u32, state: State) -> Next {
  let number = state.kept - 1u;
  let place = kept_place(pixel, number);
  let origin = kept[place];
  let direction = kept[place + 1u];
  let throughput = kept[place + 2u];
  let word = bitcast<u32>(origin.w);
  let seed = bitcast<vec2<u32>>(vec2<f32>(direction.w, throughput.w));
  let taken = State(seed, word & 0x7fffu, 0u, number, word >> 16u, (word & 0x8000u) != 0u, origin.xyz);
  return Next(true, direction.xyz, throughput.xyz, FAR, taken);
}

// Counts a ray that glass has refracted.
fn count_refracted(next: Next) {
  let _place = append(queue_of(stage.depth) + 1u + view.sources, next.is_ray && next.state.is_refracted);
}

// Rays that leave a surface, with their weights.
struct Leaving { reflected: vec3<f32>, refracted: vec3<f32>, weights: vec2<f32> }

// The weights with which the reflected and the refracted ray go on; 0 for a ray that does not. `arriving` is the weight of
// the ray before.
fn split_weights(weights: vec2<f32>, arriving: f32, state: State) -> vec2<f32> {
  let lesser = min(weights.x, weights.y);
  let splits = mul(arriving, lesser) >= view.split_weight && state.kept < view.kept;
  if (lesser <= 0.0 || splits) { return weights; }
  let both = weights.x + weights.y;
  let is_lesser = number_1d(state.seed, BRANCH, sample_number()) < quotient(lesser, both);
  let takes_reflected = (weights.x < weights.y) == is_lesser;
  return select(vec2<f32>(0.0, both), vec2<f32>(both, 0.0), takes_reflected);
}

// The throughput of a ray at its intersection: the medium of a sphere that it leaves has absorbed light.
fn absorbed(path: Path, ray: Ray, hit: Hit, surface: Surface) -> vec3<f32> {
  if (surface.is_entering) { return path.throughput; }
  return path.throughput * exp(-hit.t * extinction_of(hit.index));
}

// What a ray sees that is not traced further. `own`: the first interaction if this is it.
fn see_at_end(path: Path, direction: vec3<f32>, weight: vec3<f32>, own: u32) -> vec3<f32> {
  if (all(weight <= vec3<f32>(0.0))) { return vec3<f32>(0.0); }
  let seen = weight * seen_at_end(direction);
  let is_first = path.state.depth == 1u;
  let first = select(path.state.first, own, is_first);
  add_after(first, path.pixel, group_at_end(), seen, first_reflection(path.pixel), path.state.bounces > 0u);
  if (is_first) { add_to_layer(BY_DIRECT, path.pixel, seen, false); }
  return seen;
}

// What is seen along rays that are not traced further, and the ray that goes on.
struct Scattered { seen: vec3<f32>, next: Next }

// Reflects and refracts a ray at a sphere.
fn scatter(path: Path, throughput: vec3<f32>, ray: Ray, surface: Surface) -> Scattered {
  let state = path.state;
  let found = leave(ray, surface, state.seed);
  var result = Scattered(vec3<f32>(0.0), no_ray(state));
  // Rays beyond the last depth are not traced
  if (state.depth >= view.max_depth + state.bounces) {
    let reflected = see_at_end(path, found.reflected, throughput * found.weights.x, REFLECTION_FIRST);
    result.seen = reflected + see_at_end(path, found.refracted, throughput * found.weights.y, REFRACTION_FIRST);
    return result;
  }
  // Reflected paths that have met the ground do not split
  let arriving = select(0.0, largest_of(throughput), state.bounces == 0u);
  let weights = split_weights(found.weights, arriving, state);
  let after = State(state.seed, state.depth + 1u, state.bounces, state.kept, state.first, false, surface.start);
  var reflected = Next(weights.x > 0.0, found.reflected, throughput * weights.x, FAR, after);
  reflected.state.seed = child_of(state.seed, REFLECTED);
  var refracted = Next(weights.y > 0.0, found.refracted, throughput * weights.y, FAR, after);
  refracted.state.seed = child_of(state.seed, REFRACTED);
  refracted.state.is_refracted = true;
  refracted.state.start = surface.inner;
  if (state.first == NOTHING_FIRST) {
    reflected.state.first = REFLECTION_FIRST;
    refracted.state.first = REFRACTION_FIRST;
  }
  if (reflected.is_ray && refracted.is_ray) {
    let goes_first = weights.x <= weights.y;
    if (goes_first) { keep(path.pixel, state.kept, refracted); } else { keep(path.pixel, state.kept, reflected); }
    result.next = refracted;
    if (goes_first) { result.next = reflected; }
    result.next.state.kept = state.kept + 1u;
    return result;
  }
  result.next = reflected;
  if (refracted.is_ray) { result.next = refracted; }
  return result;
}

// Reflects and refracts a ray if it hits a sphere: adds what is seen to `sum`. Where a path ends, a ray that was kept goes
// on. A path that is none keeps nothing.
fn go_on(
  is_hit: bool, path: Path, throughput: vec3<f32>, ray: Ray, surface: Surface, next: ptr<function, Next>,
  sum: ptr<function, vec4<f32>>,
) {
  if (is_hit) {
    let scattered = scatter(path, throughput, ray, surface);
    *sum += vec4<f32>(scattered.seen, 0.0);
    *next = scattered.next;
  }
  if (!(*next).is_ray && path.state.kept > 0u) { *next = take_kept(path.pixel, path.state); }
}
