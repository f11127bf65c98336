// Whitted ray tracing of opaque spheres: equation 4.1 of the thesis, as the CPU's integrator.
//
// Each sample of all pixels passes through the kernels depth by depth. `trace_camera` and `trace_reflected` find the
// intersections of the rays of a depth, add what they show without shadows, and append rays to queues: reflected rays to
// that of the next depth, and shadow rays to one for each light, whose light `trace_shadow` adds.
//
// Rays are computed with the operations of the CPU, so that they meet the same spheres; colours are not, so that they
// may differ in the last bits. The order of a queue changes from run to run, but not the picture: in a dispatch, each
// pixel receives at most one contribution.

// Sums over the samples of each pixel: red, green, blue, coverage
@group(0) @binding(6) var<storage, read_write> film: array<vec4<f32>>;
// The nearest sample of each pixel: depth, index of the sphere, normal, position
@group(0) @binding(7) var<storage, read_write> data: array<vec4<u32>>;
// Lengths of the queues of a sample: for each depth, that of the reflected rays, then those of shadow rays by light
@group(0) @binding(8) var<storage, read_write> queued: array<atomic<u32>>;
// Queues of rays: origin and pixel; direction and throughput
@group(0) @binding(9) var<storage, read> rays: array<vec4<f32>>;
@group(0) @binding(10) var<storage, read_write> next_rays: array<vec4<f32>>;
// Queues of shadow rays, one behind the other: start and pixel; radiance
@group(0) @binding(11) var<storage, read_write> shadows: array<vec4<f32>>;
// Base colours of the spheres
@group(0) @binding(12) var<storage, read> colors: array<f32>;
@group(0) @binding(13) var<uniform> stage: Stage;
// The lengths of all queues over all samples, in two words each
@group(0) @binding(14) var<storage, read_write> sums: array<u32>;

// What differs between dispatches. `depth` counts from 1.
struct Stage { sample: u32, depth: u32, light: u32, queues: u32 }

const OFFSET_OF_RADIUS: f32 = 1e-4;
// Eight units in the last place of 1
const OFFSET_OF_ROUNDING: f32 = 9.5367431640625e-7;
const INVERSE_PI: f32 = 0.31830987;

fn background(direction: vec3<f32>) -> vec3<f32> {
  if (view.background_kind == 0u) { return view.background_bottom; }
  let height = clamp(dot(direction, view.background_up), -1.0, 1.0);
  let part = 0.5 + asin(height) * INVERSE_PI;
  return view.background_bottom * (1.0 - part) + view.background_top * part;
}

fn base_color(index: u32) -> vec3<f32> {
  if (view.color_kind == 0u) { return view.color; }
  return vec3<f32>(colors[3u * index], colors[3u * index + 1u], colors[3u * index + 2u]);
}

// The Fresnel reflectance of a ray from outside or inside: Schlick's approximation, or that of a dielectric.
fn fresnel(cosine: f32, is_entering: bool) -> f32 {
  let c = clamp(cosine, 0.0, 1.0);
  let ratio = select(view.ior, 1.0 / view.ior, is_entering);
  let sin2 = ratio * ratio * (1.0 - c * c);
  if (sin2 >= 1.0) { return 1.0; }
  if (view.is_exact_fresnel == 0u) {
    let at_normal = (1.0 - view.ior) / (1.0 + view.ior);
    let r0 = at_normal * at_normal;
    let x = 1.0 - c;
    return r0 + (1.0 - r0) * (x * x * x * x * x);
  }
  let inner = sqrt(1.0 - sin2);
  let parallel = (c - ratio * inner) / (c + ratio * inner);
  let perpendicular = (ratio * c - inner) / (ratio * c + inner);
  return 0.5 * (parallel * parallel + perpendicular * perpendicular);
}

struct Surface { point: vec3<f32>, normal: vec3<f32>, start: vec3<f32>, is_entering: bool }

// The point of an intersection, the normal on the side of the ray, and where rays to other surfaces start.
fn surface_at(ray: Ray, hit: Hit) -> Surface {
  let sphere = spheres[hit.slot];
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
  return Surface(point, facing, point + scaled(facing, offset), is_entering);
}

// The number of the queue of reflected rays of a depth; those of its shadow rays follow, light by light.
fn queue_of(depth: u32) -> u32 {
  return (depth - 1u) * (1u + view.light_count);
}

// The direction to the light from `start`, and the distance.
fn toward(source: Light, start: vec3<f32>) -> vec4<f32> {
  if (source.kind == 2u) { return vec4<f32>(source.place, FAR); }
  let v = source.place - start;
  let distance = root(dot_in_order(v, v));
  return vec4<f32>(scaled(v, inverse(distance)), distance);
}

// Eq. 4.2: the light that a surface reflects, by the model of Blinn and Phong.
fn blinn_phong(normal: vec3<f32>, out: vec3<f32>, into: vec3<f32>, albedo: vec3<f32>, weight: f32) -> vec3<f32> {
  let cosine = dot_in_order(normal, into);
  if (!(cosine > 0.0)) { return vec3<f32>(0.0); }
  var highlight = 0.0;
  if (view.specular > 0.0) {
    let half_vector = into + out;
    let scale = inverseSqrt(dot(half_vector, half_vector));
    let along = select(1.0, dot(normal, half_vector * scale), scale <= FAR);
    highlight = view.specular * select(pow(clamp(along, 0.0, 1.0), view.shininess), 1.0, view.shininess == 0.0);
  }
  return (view.diffuse * cosine) * albedo + vec3<f32>(highlight * weight);
}

// Adds what a ray sees without shadows, and appends the rays that leave its intersection.
fn follow(is_ray: bool, ray: Ray, throughput: f32, pixel: u32, hit: Hit) {
  var sum = vec4<f32>(0.0);
  var surface: Surface;
  var albedo = vec3<f32>(0.0);
  var reflected = 0.0;
  var direction = vec3<f32>(0.0);
  let is_hit = is_ray && hit.slot != MISS;
  if (is_ray && !is_hit && (stage.depth > 1u || view.transparent == 0u)) {
    sum = vec4<f32>(throughput * background(ray.direction), 0.0);
  }
  if (is_hit) {
    surface = surface_at(ray, hit);
    if (stage.depth == 1u) {
      sum.w = 1.0;
      keep_nearest(ray, hit, surface, pixel);
    }
    // Ambient light
    albedo = throughput * clamp(base_color(hit.index), vec3<f32>(0.0), vec3<f32>(1.0));
    sum += vec4<f32>(albedo * view.ambient, 0.0);
    // The reflected ray, which sees the background beyond the last depth
    if (view.reflection > 0.0) {
      let cosine = -dot_in_order(ray.direction, surface.normal);
      reflected = throughput * (view.reflection * fresnel(cosine, surface.is_entering));
      let mirrored = ray.direction + scaled(surface.normal, 2.0 * cosine);
      direction = scaled(mirrored, inverse(root(dot_in_order(mirrored, mirrored))));
      if (stage.depth >= view.max_depth) {
        sum += vec4<f32>(reflected * background(direction), 0.0);
        reflected = 0.0;
      }
    }
  }
  let queue = queue_of(stage.depth);
  let place = append(queue, reflected > 0.0);
  if (reflected > 0.0) {
    next_rays[2u * place] = vec4<f32>(surface.start, bitcast<f32>(pixel));
    next_rays[2u * place + 1u] = vec4<f32>(direction, reflected);
  }
  // The light of each source, or its shadow ray
  for (var number = 0u; number < view.light_count; number++) {
    let source = view.lights[number];
    var radiance = vec3<f32>(0.0);
    if (is_hit) {
      let into = toward(source, surface.start);
      radiance = source.radiance * blinn_phong(surface.normal, -ray.direction, into.xyz, albedo, throughput);
      if (source.kind == 1u) { radiance /= into.w * into.w; }
    }
    let is_lit = max(max(radiance.x, radiance.y), radiance.z) > 0.0;
    if (source.casts_shadow == 0u) {
      if (is_lit) { sum += vec4<f32>(radiance, 0.0); }
      continue;
    }
    let place = append(queue + 1u + number, is_lit) + number * view.width * view.height;
    if (is_lit) {
      shadows[2u * place] = vec4<f32>(surface.start, bitcast<f32>(pixel));
      shadows[2u * place + 1u] = vec4<f32>(radiance, 0.0);
    }
  }
  if (is_ray) { film[pixel] += sum; }
}

// Keeps the data of the nearest sample of a pixel, the first of equals.
fn keep_nearest(ray: Ray, hit: Hit, surface: Surface, pixel: u32) {
  let depth = depth_of(ray, hit.t);
  if (depth < bitcast<f32>(data[2u * pixel].x)) {
    data[2u * pixel] = vec4<u32>(bitcast<u32>(depth), hit.index, bitcast<vec2<u32>>(surface.normal.xy));
    data[2u * pixel + 1u] = vec4<u32>(bitcast<u32>(surface.normal.z), bitcast<vec3<u32>>(surface.point));
  }
}

// Camera rays, in squares of 8x8 pixels.
@compute @workgroup_size(8, 8)
fn trace_camera(@builtin(global_invocation_id) id: vec3<u32>) {
  let is_ray = id.x < view.width && id.y < view.height;
  let pixel = id.y * view.width + id.x;
  var ray: Ray;
  var hit = Hit(0.0, MISS, MISS);
  if (is_ray) {
    if (stage.sample == 0u) {
      film[pixel] = vec4<f32>(0.0);
      data[2u * pixel] = vec4<u32>(bitcast<u32>(FAR), MISS, 0u, 0u);
      data[2u * pixel + 1u] = vec4<u32>(0u);
    }
    ray = camera_ray(id.x, id.y, stage.sample);
    hit = nearest(ray, FAR);
  }
  follow(is_ray, ray, 1.0, pixel, hit);
}

fn linear_index(group: vec3<u32>, groups: vec3<u32>, local: u32) -> u32 {
  return (group.y * groups.x + group.x) * 64u + local;
}

// The rays that were reflected at the depth before.
@compute @workgroup_size(64)
fn trace_reflected(
  @builtin(workgroup_id) group: vec3<u32>,
  @builtin(num_workgroups) groups: vec3<u32>,
  @builtin(local_invocation_index) local: u32,
) {
  let i = linear_index(group, groups, local);
  let is_ray = i < atomicLoad(&queued[queue_of(stage.depth - 1u)]);
  var ray: Ray;
  var throughput = 0.0;
  var pixel = 0u;
  var hit = Hit(0.0, MISS, MISS);
  if (is_ray) {
    let origin = rays[2u * i];
    let direction = rays[2u * i + 1u];
    ray = Ray(origin.xyz, direction.xyz);
    throughput = direction.w;
    pixel = bitcast<u32>(origin.w);
    hit = nearest(ray, FAR);
  }
  follow(is_ray, ray, throughput, pixel, hit);
}

// Adds the light of a source that arrives at the surfaces of a depth.
@compute @workgroup_size(64)
fn trace_shadow(
  @builtin(workgroup_id) group: vec3<u32>,
  @builtin(num_workgroups) groups: vec3<u32>,
  @builtin(local_invocation_index) local: u32,
) {
  let i = linear_index(group, groups, local);
  if (i >= atomicLoad(&queued[queue_of(stage.depth) + 1u + stage.light])) { return; }
  let place = i + stage.light * view.width * view.height;
  let start = shadows[2u * place];
  let into = toward(view.lights[stage.light], start.xyz);
  if (!is_occluded(Ray(start.xyz, into.xyz), into.w)) {
    film[bitcast<u32>(start.w)] += vec4<f32>(shadows[2u * place + 1u].xyz, 0.0);
  }
}

// Empties all queues before a sample, and adds up their lengths.
@compute @workgroup_size(64)
fn empty_queues(@builtin(global_invocation_id) id: vec3<u32>) {
  let queue = id.x;
  if (queue >= stage.queues) { return; }
  let length = atomicExchange(&queued[queue], 0u);
  let sum = sums[2u * queue] + length;
  sums[2u * queue + 1u] += select(0u, 1u, sum < length);
  sums[2u * queue] = sum;
}
