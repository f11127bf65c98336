// Path tracing of spheres on a ground, as the CPU's integrator, with the same random numbers.
//
// At each point of a surface, a direction is sampled from the environment and one from the BSDF, weighted by the balance
// heuristic, and each light is sampled. The path goes on in the direction of the BSDF; from the third reflection on it
// ends at random. The sources of shadow rays are the environment, the last segments of paths, and the lights. Clear
// spheres (HAS_GLASS) reflect and refract rays (`glass.wgsl`); light is not sampled there.
//
// A ray that goes on has its direction and density, and its throughput beside its origin; also the diffuse part of that
// if mirrors see the environment through a shadow catcher (HAS_MIRRORS), or where it is in its path if spheres are clear.
// A shadow ray has its direction and length, and its radiance. A shadow ray from a shadow catcher takes light away as far
// as it is blocked, and adds coverage. With layers of light, shadow rays from first surfaces have parts: the diffuse part
// of the reflection (of a catcher: the part of the light that is lost), and the luminance.

const RAY: u32 = 3u + select(0u, 1u, HAS_MIRRORS) + select(0u, 1u, HAS_GLASS);
const SHADOW: u32 = select(3u, 4u, HAS_LAYERS);

// Sources of shadow rays; those of the lights follow, then those of a catcher that mirrors see
const OF_ENVIRONMENT: u32 = 0u;
const OF_LAST: u32 = 1u;
const FIRST_LIGHT: u32 = 2u;

// In place of a coverage, numbers from this one down: the ray adds light if nothing blocks it (`role_at`)
const ADDS: f32 = -1.0;

// Reflections from which on paths end at random, and the largest probability of going on
const ROULETTE_START: u32 = 2u;
const MAX_CONTINUATION: f32 = 0.95;

// The part of the light that arrives at a second surface far away, for ambient light
const MAX_AMBIENT: f32 = 0.8;

// Steps of a unit of radiance in which the light that a clamp takes away is counted, and the largest count
const LOST_STEPS: f32 = 4096.0;
const MAX_LOST: f32 = 1.8e19;

const LUMINANCE: vec3<f32> = vec3<f32>(0.2126, 0.7152, 0.0722);

// A point of an opaque surface
struct Vertex { normal: vec3<f32>, start: vec3<f32>, base: vec3<f32>, out: vec3<f32>, finish: Finish }

// A shadow ray, if it is needed
struct Shadow {
  is_needed: bool, start: vec3<f32>, direction: vec3<f32>, length: f32, radiance: vec3<f32>, coverage: f32,
  parts: vec4<f32>,
}

fn no_shadow() -> Shadow {
  return Shadow(false, vec3<f32>(0.0), vec3<f32>(0.0), 0.0, vec3<f32>(0.0), ADDS, vec4<f32>(0.0));
}

fn push_shadow(source: u32, shadow: Shadow, pixel: u32) {
  let place = append(queue_of(stage.depth) + 1u + source, shadow.is_needed) + first_shadow(source);
  if (shadow.is_needed) {
    next_shadows[SHADOW * place] = vec4<f32>(shadow.start, word_of(pixel));
    next_shadows[SHADOW * place + 1u] = vec4<f32>(shadow.direction, shadow.length);
    next_shadows[SHADOW * place + 2u] = vec4<f32>(shadow.radiance, shadow.coverage);
    if (HAS_LAYERS) { next_shadows[SHADOW * place + 3u] = shadow.parts; }
  }
}

// What rays see beyond the last depth
fn seen_at_end(direction: vec3<f32>) -> vec3<f32> { return environment_along(direction, FAR); }

fn group_at_end() -> u32 { return scene.environment_group; }

// The light of a sample that a surface reflects. `competes`: rays of the BSDF find that light, too.
fn reflected(vertex: Vertex, weight: vec3<f32>, light: LightSample, competes: bool) -> vec3<f32> {
  let value = eval_bsdf(vertex.finish, vertex.base, vertex.normal, vertex.out, light.direction);
  let other = select(0.0, value.w, competes);
  let factor = select(1.0, 1.0 / (light.pdf + other), light.pdf < FAR);
  return weight * (value.xyz * (light.radiance * factor));
}

// What a ray that adds light at a surface tells: whether it is indirect light, which a clamp limits, and the first
// interaction of its path.
fn role_at(state: State) -> f32 {
  return ADDS - f32(select(0u, 1u, bounces_of(state) > 0u) + 2u * first_of(state));
}

fn is_indirect(role: f32) -> bool { return (u32(ADDS - role) & 1u) == 1u; }

fn first_in(role: f32) -> u32 { return u32(ADDS - role) >> 1u; }

fn shadow_of(vertex: Vertex, light: LightSample, radiance: vec3<f32>, state: State) -> Shadow {
  let is_needed = largest_of(radiance) > 0.0;
  var parts = vec4<f32>(0.0);
  if (HAS_LAYERS && stage.depth == 1u && is_needed) {
    parts = vec4<f32>(diffuse_along(vertex, light.direction), dot(radiance, LUMINANCE));
  }
  return Shadow(is_needed, vertex.start, light.direction, light.distance, radiance, role_at(state), parts);
}

fn diffuse_along(vertex: Vertex, direction: vec3<f32>) -> vec3<f32> {
  return diffuse_fraction(vertex.finish, vertex.base, vertex.normal, vertex.out, direction);
}

fn sample_source(number: u32, vertex: Vertex, seed: Wide) -> LightSample {
  let light = view.lights[number];
  var u = vec2<f32>(0.0);
  if (has_extent(light)) { u = numbers_2d(seed, LIGHTS + number, sample_number()); }
  return sample_light(light, vertex.start, u);
}

// What a ray sees of lights before a surface at distance `t`, or beyond all: of rays that a BSDF chose, weighted against
// the sampling of the light; a ray that no BSDF chose ends at the nearest visible light, which covers the pixel.
struct Emitted { light: vec3<f32>, ends: bool }

fn emitted_along(is_ray: bool, ray: Ray, path: Path, t: f32) -> Emitted {
  var sum = vec3<f32>(0.0);
  var group = 0u;
  if (!is_ray) { return Emitted(sum, false); }
  var nearest_light = FAR;
  // Behind clear spheres, only shadow rays find lights
  let is_sampled = path.pdf < FAR && !HAS_GLASS;
  var ends = false;
  for (var number = 0u; number < view.light_count; number++) {
    let light = view.lights[number];
    let is_seen = bounces_of(path.state) == 0u && light.is_visible == 1u;
    if (!has_extent(light) || !(is_sampled || is_seen)) { continue; }
    let found = hit_light(light, ray);
    if (!found.is_hit || !(found.t < t || t >= FAR)) { continue; }
    if (is_sampled) {
      let arriving = path.throughput * (balance(path.pdf, found.pdf) * light.radiance);
      sum += arriving;
      add_seen(path.pixel, BY_EMISSION, light.group, arriving, path.state);
    } else if (!ends || found.t < nearest_light) {
      sum = path.throughput * light.radiance;
      group = light.group;
      nearest_light = found.t;
      ends = true;
    }
  }
  if (ends) { add_seen(path.pixel, BY_EMISSION, group, sum, path.state); }
  return Emitted(sum, ends);
}

// What a camera ray sees behind everything
fn seen_behind(ray: Ray, on_film: vec2<f32>) -> vec3<f32> {
  if (view.transparent == 1u) { return vec3<f32>(0.0); }
  if (scene.is_environment_visible == 0u) { return backdrop(ray.direction, on_film); }
  return environment_along(ray.direction, FAR);
}

// The source of the shadow rays of a catcher to the environment (0) and to lights (from 1 on). A glossy reflection of a
// catcher needs its own, because its diffuse part is shaded, too.
fn catcher_source(number: u32) -> u32 {
  if (HAS_MIRRORS) { return FIRST_LIGHT + view.light_count + number; }
  return select(FIRST_LIGHT + number - 1u, OF_ENVIRONMENT, number == 0u);
}

// The shadow rays of a shadow catcher: what is blocked darkens what is `behind` by its part of the whole light, and by
// `darkness` at most.
fn catch_shadows(
  is_caught: bool, ground: GroundHit, ray: Ray, behind: vec3<f32>, darkness: f32, pixel: u32, seed: Wide,
) {
  let white = Vertex(scene.ground_up, above_ground(ground), vec3<f32>(1.0), -ray.direction, OF_GROUND);
  let covers = select(vec3<f32>(0.0), LUMINANCE, stage.depth == 1u);
  // The light that arrives if nothing is in the way
  var whole = scene.catcher_whole;
  if (is_caught) {
    for (var number = 0u; number < view.light_count; number++) {
      whole += reflected(white, vec3<f32>(1.0), sample_source(number, white, seed), false);
    }
  }
  if (is_caught) { add_arrival(pixel, dot(whole, LUMINANCE), dot(whole, LUMINANCE)); }
  let part = select(vec3<f32>(0.0), darkness / whole, whole > vec3<f32>(0.0));
  // A ray to each source
  var shadow = no_shadow();
  if (is_caught && scene.catcher.side > 0u) {
    let sample = sample_table(scene.catcher, numbers_2d(seed, ENVIRONMENT, sample_number()));
    let light = sample.radiance * (INVERSE_PI / sample.pdf);
    let is_above = dot(sample.direction, white.normal) > 0.0;
    let parts = vec4<f32>(light * part, dot(light, LUMINANCE));
    let lost = parts.xyz;
    shadow = Shadow(is_above, white.start, sample.direction, FAR, -lost * behind, dot(lost, covers), parts);
  }
  push_shadow(catcher_source(0u), shadow, pixel);
  for (var number = 0u; number < view.light_count; number++) {
    shadow = no_shadow();
    if (is_caught && view.lights[number].casts_shadow == 1u) {
      let light = sample_source(number, white, seed);
      let arriving = reflected(white, vec3<f32>(1.0), light, false);
      let parts = vec4<f32>(arriving * part, dot(arriving, LUMINANCE));
      let lost = parts.xyz;
      let is_needed = largest_of(lost) > 0.0;
      shadow = Shadow(is_needed, white.start, light.direction, light.distance, -lost * behind, dot(lost, covers), parts);
    }
    push_shadow(catcher_source(1u + number), shadow, pixel);
  }
}

// The light of a second surface at a distance from the first, where the path ends: an estimate (`path/ambient.rs`).
fn ambient_light(vertex: Vertex, weight: vec3<f32>, t: f32, seed: Wide, pixel: u32, role: f32) -> vec3<f32> {
  let arriving = weight * (MAX_AMBIENT * (t / (t + scene.reach)));
  var sum = vec3<f32>(0.0);
  if (scene.environment.side > 0u) {
    sum = arriving * vertex.base * irradiance_at(vertex.normal) * INVERSE_PI;
    add_arriving(pixel, scene.environment_group, sum, vec3<f32>(1.0), role);
  }
  for (var number = 0u; number < view.light_count; number++) {
    let light = reflected(vertex, arriving, sample_source(number, vertex, seed), false);
    sum += light;
    add_arriving(pixel, view.lights[number].group, light, vec3<f32>(1.0), role);
  }
  return sum;
}

fn next_ray(vertex: Vertex, weight: vec3<f32>, seed: Wide, state: State) -> Next {
  let sample = sample_bsdf(vertex.finish, vertex.base, vertex.normal, vertex.out, numbers_2d(seed, BSDF, sample_number()));
  let is_ray = sample.pdf > 0.0;
  return Next(is_ray, sample.direction, weight * sample.weight, sample.pdf, bounced(state, vertex.start));
}

// Ends long paths at random, and makes up for it.
fn roulette(next: Next, bounces: u32, seed: Wide) -> Next {
  if (bounces < ROULETTE_START) { return next; }
  let chance = min(largest_of(next.throughput), MAX_CONTINUATION);
  let goes_on = number_1d(seed, CONTINUATION, sample_number()) < chance;
  return Next(next.is_ray && goes_on, next.direction, next.throughput / chance, next.pdf, next.state);
}

// The light group of what is behind everything
fn group_behind() -> u32 {
  return select(scene.environment_group, 0u, stage.depth == 1u && scene.is_environment_visible == 0u);
}

// Adds light of a group that arrives at a surface, to the layers; `diffuse`: the diffuse part of the reflection, if it is
// the first surface.
fn add_arriving(pixel: u32, group: u32, light: vec3<f32>, diffuse: vec3<f32>, role: f32) {
  if (!HAS_LAYERS) { return; }
  let first = first_in(role);
  if (first != NOTHING_FIRST) {
    add_after(first, pixel, group, light, first_reflection(pixel), is_indirect(role));
    return;
  }
  add_after(BOUNCE_FIRST, pixel, group, light, diffuse, false);
  add_to_layer(BY_DIRECT, pixel, light, false);
}

// The light group of a source of shadow rays from surfaces
fn group_of(source: u32) -> u32 {
  if (source < FIRST_LIGHT) { return scene.environment_group; }
  return view.lights[source - FIRST_LIGHT].group;
}

// Adds what a shadow ray brings to the layers; `part` of it. A catcher darkens what is behind it.
fn add_shadow_parts(pixel: u32, light: vec3<f32>, role: f32, part: f32, parts: vec4<f32>) {
  if (role <= ADDS) {
    add_arriving(pixel, group_of(stage.source), light, parts.xyz, role);
    add_arrival(pixel, 0.0, part * parts.w);
    return;
  }
  add_seen(pixel, BY_BACKGROUND, group_behind(), light, camera_state(pixel));
  if (stage.depth == 1u) { add_to_layer(BY_LOSS, pixel, part * parts.xyz, false); }
  add_arrival(pixel, 0.0, -part * parts.w);
}

// Adds the light along a ray. A clamp limits what it brings to its first surface, but `direct`; that stays apart until
// its shadow rays are traced.
fn add_light(pixel: u32, light: vec4<f32>, direct: vec4<f32>, bounces: u32) {
  if (!HAS_CLAMP || bounces == 0u) {
    add_to_film(pixel, light);
    return;
  }
  add_to_film(pixel, direct);
  film[second_place(pixel)] = light - direct;
}

// Adds what a ray sees without shadows, and appends the rays that leave its intersection.
fn follow(is_ray: bool, ray: Ray, path: Path, ground: GroundHit, hit: Hit) {
  var sum = vec4<f32>(0.0);
  let is_first = stage.depth == 1u;
  let bounces = bounces_of(path.state);
  let t = select(ground.t, hit.t, hit.slot != MISS);
  // Lights, which may end the ray
  let emitted = emitted_along(is_ray, ray, path, t);
  sum += vec4<f32>(emitted.light, select(0.0, 1.0, emitted.ends && is_first));
  let is_open = is_ray && !emitted.ends;
  let is_sphere = is_open && hit.slot != MISS;
  let is_ground = is_open && hit.slot == MISS && ground.t < FAR;
  var seed = Wide(0u);
  if (is_sphere || is_ground) { seed = seed_of(path.pixel, path.state); }
  // A catcher shows its shadows only
  let is_caught = is_first && is_ground && scene.is_catcher == 1u;
  // Before the light: behind it, the compiler of an NVIDIA driver (580.159) loses the light of spheres
  if (is_ray) {
    let of_ground = object_of_ground(select(1.0, ground.opacity, view.transparent == 1u));
    keep_object(path.pixel, select(select(MISS, of_ground, is_ground && !is_caught), hit.index, is_sphere));
  }
  // What is behind all surfaces, and behind a ground that fades out
  let uncovered = select(1.0, 1.0 - ground.opacity, is_ground && !is_caught);
  if (is_open && !is_sphere && uncovered > 0.0) {
    var seen: vec3<f32>;
    if (is_first) {
      seen = uncovered * seen_behind(ray, path.on_film);
    } else {
      let pdf = select(path.pdf, FAR, is_ground);
      seen = uncovered * path.throughput * environment_along(ray.direction, pdf);
    }
    sum += vec4<f32>(seen, 0.0);
    add_seen(path.pixel, BY_BACKGROUND, group_behind(), seen, path.state);
  }
  // A glossy reflection sees the environment through a catcher
  var weight = path.throughput;
  var behind = vec3<f32>(0.0);
  let is_passed = HAS_MIRRORS && is_ground && !is_first && any(path.diffuse != vec3<f32>(1.0));
  if (is_passed) {
    behind = ground.opacity * weight * (1.0 - path.diffuse) * environment_along(ray.direction, FAR);
    sum += vec4<f32>(behind, 0.0);
    add_seen(path.pixel, BY_BACKGROUND, scene.environment_group, behind, path.state);
    weight *= path.diffuse;
  }
  // The first surface reflects this light, which has no limit
  let direct = select(vec4<f32>(0.0), sum, bounces == 1u);
  // The point of the surface
  var vertex: Vertex;
  var surface: Surface;
  if (is_sphere) {
    surface = surface_at(ray, hit);
    vertex = Vertex(surface.normal, surface.start, base_color(hit.index), -ray.direction, finish_of(hit.index));
    if (is_first) { keep_surface(depth_of(ray, hit.t), hit.index, surface.normal, surface.point, path.pixel); }
  } else if (is_ground) {
    vertex = Vertex(scene.ground_up, above_ground(ground), ground_color(ground.point), -ray.direction, OF_GROUND);
    weight *= ground.opacity;
    if (is_first && !is_caught) {
      keep_surface(depth_of(ray, ground.t), GROUND, scene.ground_up, ground.point, path.pixel);
    }
  }
  vertex.base = clamp(vertex.base, vec3<f32>(0.0), vec3<f32>(1.0));
  if (is_first && (is_sphere || (is_ground && !is_caught))) {
    sum.w += select(1.0, ground.opacity, view.transparent == 1u && is_ground);
  }
  if (scene.is_catcher == 1u && (is_first || HAS_MIRRORS)) {
    if (is_first) { behind = seen_behind(ray, path.on_film); }
    let darkness = scene.catcher_strength * select(1.0, ground.opacity, is_first);
    catch_shadows(is_caught || is_passed, ground, ray, behind, darkness, path.pixel, seed);
  }
  let is_mirror = is_passed && largest_of(path.diffuse) == 0.0;
  let is_opaque = (is_sphere && !HAS_GLASS) || is_ground;
  var is_shaded = is_opaque && !is_caught && !is_mirror && bounces <= scene.bounces;
  if (is_shaded && scene.is_ambient == 1u && bounces > 0u) {
    sum += vec4<f32>(ambient_light(vertex, weight, t, seed, path.pixel, role_at(path.state)), 0.0);
    is_shaded = false;
  }
  // Light of the environment
  var shadow = no_shadow();
  if (is_shaded && scene.environment.side > 0u) {
    let sample = sample_table(scene.environment, numbers_2d(seed, ENVIRONMENT, sample_number()));
    let light = LightSample(sample.direction, FAR, sample.radiance, sample.pdf);
    shadow = shadow_of(vertex, light, reflected(vertex, weight, light, true), path.state);
  }
  push_shadow(OF_ENVIRONMENT, shadow, path.pixel);
  // Luminance of direct light: if nothing is in the way, and what arrives without a shadow ray
  var whole = shadow.parts.w;
  var unshadowed = 0.0;
  // Light of each source
  for (var number = 0u; number < view.light_count; number++) {
    shadow = no_shadow();
    if (is_shaded) {
      let source = view.lights[number];
      let light = sample_source(number, vertex, seed);
      let radiance = reflected(vertex, weight, light, has_extent(source) && !HAS_GLASS);
      shadow = shadow_of(vertex, light, radiance, path.state);
      whole += shadow.parts.w;
      if (shadow.is_needed && source.casts_shadow == 0u) {
        sum += vec4<f32>(radiance, 0.0);
        add_arriving(path.pixel, source.group, radiance, shadow.parts.xyz, shadow.coverage);
        unshadowed += shadow.parts.w;
        shadow.is_needed = false;
      }
    }
    push_shadow(FIRST_LIGHT + number, shadow, path.pixel);
  }
  if (is_shaded) { add_arrival(path.pixel, whole, unshadowed); }
  // Go on in a direction of the BSDF; the last segment may be a shadow ray to the environment
  var next = no_ray(path.state);
  shadow = no_shadow();
  if (is_shaded) {
    next = next_ray(vertex, weight, seed, path.state);
    next.is_ray = next.is_ray && largest_of(next.throughput) > 0.0;
    var diffuse = vec3<f32>(1.0);
    if (HAS_LAYERS && is_first && next.is_ray) { diffuse = diffuse_along(vertex, next.direction); }
    keep_first_reflection(path.pixel, diffuse);
    if (!HAS_GLASS && bounces == scene.bounces && view.has_extents == 0u) {
      let radiance = next.throughput * environment_along(next.direction, next.pdf);
      let is_needed = next.is_ray && largest_of(radiance) > 0.0;
      let role = role_at(path.state);
      shadow = Shadow(is_needed, vertex.start, next.direction, FAR, radiance, role, vec4<f32>(diffuse, 0.0));
      next.is_ray = false;
    } else {
      next = roulette(next, bounces, seed);
    }
  }
  push_shadow(OF_LAST, shadow, path.pixel);
  go_on(is_sphere, path, absorbed(path, ray, hit, surface), ray, surface, &next, &sum);
  count_refracted(next);
  let place = append(queue_of(stage.depth), next.is_ray);
  if (next.is_ray) {
    next_rays[RAY * place] = vec4<f32>(vertex.start, word_of(path.pixel));
    next_rays[RAY * place + 1u] = vec4<f32>(next.direction, next.pdf);
    next_rays[RAY * place + 2u] = vec4<f32>(next.throughput, 0.0);
    if (HAS_MIRRORS) {
      next_rays[RAY * place + 3u] = vec4<f32>(diffuse_along(vertex, next.direction), 0.0);
    }
    store_state(place, path.pixel, next.state);
  }
  if (is_ray) {
    add_light(path.pixel, sum, direct, bounces);
  }
}

// Camera rays: a tile of pixels in each workgroup.
@compute @workgroup_size(GROUP)
fn trace_camera(
  @builtin(workgroup_id) group: vec3<u32>,
  @builtin(local_invocation_index) local: u32,
) {
  let at = camera_pixel(group, local);
  let is_ray = at.x < view.width && at.y < view.height && sample_number() < view.samples;
  let pixel = at.y * view.width + at.x;
  var path = camera_path(pixel, vec2<f32>(0.0));
  var ray: Ray;
  var ground = GroundHit(FAR, 0.0, vec3<f32>(0.0));
  var hit = Hit(0.0, MISS, MISS);
  if (is_ray) {
    ray = start_sample(pixel, at, &path);
    ground = hit_ground(ray);
    hit = nearest(ray, ground.t, number_of_end(pixel, BOUNCED));
  }
  follow(is_ray, ray, path, ground, hit);
}

// A ray that goes on from the depth before.
fn follow_next(i: u32, is_ray: bool) {
  var path = camera_path(0u, vec2<f32>(0.0));
  var ray: Ray;
  var ground = GroundHit(FAR, 0.0, vec3<f32>(0.0));
  var hit = Hit(0.0, MISS, MISS);
  if (is_ray) {
    let origin = rays[RAY * i];
    let direction = rays[RAY * i + 1u];
    let throughput = rays[RAY * i + 2u].xyz;
    let pixel = pixel_in(origin.w);
    path = Path(throughput, direction.w, pixel, vec2<f32>(0.0), vec3<f32>(1.0), stored_state(i));
    ray = Ray(origin.xyz, direction.xyz, time_of(path.pixel));
    if (HAS_MIRRORS) { path.diffuse = rays[RAY * i + 3u].xyz; }
    ground = hit_ground(ray);
    hit = nearest(ray, ground.t, number_of_end(path.pixel, BOUNCED));
  }
  follow(is_ray, ray, path, ground, hit);
}

// The rays that go on from the depth before.
@compute @workgroup_size(GROUP)
fn trace_next(
  @builtin(workgroup_id) group: vec3<u32>,
  @builtin(num_workgroups) groups: vec3<u32>,
  @builtin(local_invocation_index) local: u32,
) {
  let count = count_next(stage.depth - 1u);
  for (var i = linear_index(group, groups, local, GROUP); i < padded(count); i += size_of(groups)) {
    follow_next(i, i < count);
  }
}

// Adds the light that arrives along a shadow ray, or takes away that which does not arrive.
fn follow_shadow(i: u32) {
  let place = SHADOW * (i + first_shadow(stage.source));
  let start = shadows[place];
  let into = shadows[place + 1u];
  let light = shadows[place + 2u];
  let pixel = pixel_in(start.w);
  let ray = Ray(start.xyz, into.xyz, time_of(pixel));
  var passing = 0.0;
  let adds = light.w <= ADDS;
  // Light of the environment that reaches a surface through glass is found by its paths
  let is_straight = !(adds && stage.source < FIRST_LIGHT);
  if (!is_below_ground(ray, into.w)) { passing = transmittance(ray, into.w, is_straight); }
  let part = select(1.0 - passing, passing, adds);
  if (part == 0.0) { return; }
  let coverage = part * select(0.0, light.w, !adds && view.transparent == 1u);
  if (HAS_LAYERS) { add_shadow_parts(pixel, part * light.xyz, light.w, part, shadows[place + 3u]); }
  // What the first surface reflects of a catcher has no limit
  if (HAS_CLAMP && ((adds && is_indirect(light.w)) || (!adds && stage.depth > 2u))) {
    film[second_place(pixel)] += vec4<f32>(part * light.xyz, 0.0);
  } else {
    add_to_film(pixel, vec4<f32>(part * light.xyz, coverage));
  }
}

// Counts light that a clamp takes away.
fn count_lost(radiance: vec3<f32>) {
  let steps = clamp((radiance.x + radiance.y + radiance.z) * LOST_STEPS, 0.0, MAX_LOST);
  let upper = u32(steps / 4294967296.0);
  let lower = u32(steps - f32(upper) * 4294967296.0);
  let before = atomicAdd(&queued[stage.counters - 2u], lower);
  atomicAdd(&queued[stage.counters - 1u], upper + select(0u, 1u, before + lower < lower));
}

// Adds the indirect light of the rays of a depth, up to the limit.
@compute @workgroup_size(GROUP)
fn clamp_indirect(
  @builtin(workgroup_id) group: vec3<u32>,
  @builtin(num_workgroups) groups: vec3<u32>,
  @builtin(local_invocation_index) local: u32,
) {
  let i = linear_index(group, groups, local, GROUP);
  if (i >= count_next(stage.depth - 1u)) { return; }
  if (bounces_of(stored_state(i)) == 0u) { return; }
  let pixel = pixel_in(rays[RAY * i].w);
  let light = film[second_place(pixel)];
  let largest = largest_of(light.xyz);
  // What is not finite stays, so that faults are visible
  var part = 1.0;
  if (largest > scene.indirect_limit && largest < FAR) {
    part = scene.indirect_limit / largest;
    count_lost(light.xyz * (1.0 - part));
  }
  add_to_film(pixel, light * part);
  add_limited_layers(pixel, part);
}
