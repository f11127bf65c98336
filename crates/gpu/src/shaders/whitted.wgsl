// Whitted ray tracing of spheres: equation 4.1 of the thesis, as the CPU's integrator.
//
// Rays are computed with the operations of the CPU, so that they meet the same spheres; colours are not, so that they
// may differ in the last bits. The sources of shadow rays are the lights. A ray that goes on has its direction and
// throughput beside its origin; a shadow ray has its radiance beside its start.

const RAY: u32 = 2u;
const SHADOW: u32 = 2u;

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

// The direction to the light from `start`, and the distance.
fn toward(source: Light, start: vec3<f32>) -> vec4<f32> {
  if (source.kind == DISTANT) { return vec4<f32>(source.place, FAR); }
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
fn follow(is_ray: bool, ray: Ray, throughput: f32, pixel: u32, hit: Hit, on_film: vec2<f32>) {
  var sum = vec4<f32>(0.0);
  var surface: Surface;
  var albedo = vec3<f32>(0.0);
  var reflected = 0.0;
  var direction = vec3<f32>(0.0);
  let is_hit = is_ray && hit.slot != MISS;
  if (is_ray && !is_hit && stage.depth > 1u) {
    sum = vec4<f32>(throughput * background(ray.direction), 0.0);
  } else if (is_ray && !is_hit && view.transparent == 0u) {
    sum = vec4<f32>(backdrop(ray.direction, on_film), 0.0);
  }
  if (is_hit) {
    surface = surface_at(ray, hit);
    if (stage.depth == 1u) {
      sum.w = 1.0;
      keep_nearest(depth_of(ray, hit.t), hit.index, surface.normal, surface.point, pixel);
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
    next_rays[RAY * place] = vec4<f32>(surface.start, bitcast<f32>(pixel));
    next_rays[RAY * place + 1u] = vec4<f32>(direction, reflected);
  }
  // The light of each source, or its shadow ray
  for (var number = 0u; number < view.light_count; number++) {
    let source = view.lights[number];
    var radiance = vec3<f32>(0.0);
    if (is_hit) {
      let into = toward(source, surface.start);
      radiance = source.radiance * blinn_phong(surface.normal, -ray.direction, into.xyz, albedo, throughput);
      if (source.kind == POINT_WITH_FALLOFF) { radiance /= into.w * into.w; }
    }
    let is_lit = max(max(radiance.x, radiance.y), radiance.z) > 0.0;
    if (source.casts_shadow == 0u) {
      if (is_lit) { sum += vec4<f32>(radiance, 0.0); }
      continue;
    }
    let place = append(queue + 1u + number, is_lit) + first_shadow(number);
    if (is_lit) {
      shadows[SHADOW * place] = vec4<f32>(surface.start, bitcast<f32>(pixel));
      shadows[SHADOW * place + 1u] = vec4<f32>(radiance, 0.0);
    }
  }
  if (is_ray) {
    add_to_film(pixel, sum);
    keep_object(pixel, select(MISS, hit.index, is_hit));
  }
}

// Camera rays, in squares of 8x8 pixels.
@compute @workgroup_size(8, 8)
fn trace_camera(@builtin(global_invocation_id) id: vec3<u32>) {
  let is_ray = id.x < view.width && id.y < view.height;
  let pixel = id.y * view.width + id.x;
  var ray: Ray;
  var hit = Hit(0.0, MISS, MISS);
  var on_film = vec2<f32>(0.0);
  if (is_ray) {
    if (current.sample == 0u) { clear_pixel(pixel); }
    on_film = film_position(id.x, id.y, current.sample);
    ray = camera_ray(on_film, time_of(pixel));
    on_film = seen_on_film(on_film, ray.time);
    hit = nearest(ray, FAR, number_of_end(pixel, REFLECTED));
  }
  follow(is_ray, ray, 1.0, pixel, hit, on_film);
}

// The rays that were reflected at the depth before.
@compute @workgroup_size(GROUP)
fn trace_next(
  @builtin(workgroup_id) group: vec3<u32>,
  @builtin(num_workgroups) groups: vec3<u32>,
  @builtin(local_invocation_index) local: u32,
) {
  let i = linear_index(group, groups, local, GROUP);
  let is_ray = i < atomicLoad(&queued[queue_of(stage.depth - 1u)]);
  var ray: Ray;
  var throughput = 0.0;
  var pixel = 0u;
  var hit = Hit(0.0, MISS, MISS);
  if (is_ray) {
    let origin = rays[RAY * i];
    let direction = rays[RAY * i + 1u];
    throughput = direction.w;
    pixel = bitcast<u32>(origin.w);
    ray = Ray(origin.xyz, direction.xyz, time_of(pixel));
    hit = nearest(ray, FAR, number_of_end(pixel, REFLECTED));
  }
  follow(is_ray, ray, throughput, pixel, hit, vec2<f32>(0.0));
}

// Adds the light of a source that arrives at the surfaces of a depth.
@compute @workgroup_size(GROUP)
fn trace_shadow(
  @builtin(workgroup_id) group: vec3<u32>,
  @builtin(num_workgroups) groups: vec3<u32>,
  @builtin(local_invocation_index) local: u32,
) {
  let i = linear_index(group, groups, local, GROUP);
  if (i >= atomicLoad(&queued[queue_of(stage.depth) + 1u + stage.source])) { return; }
  let place = i + first_shadow(stage.source);
  let start = shadows[SHADOW * place];
  let into = toward(view.lights[stage.source], start.xyz);
  let pixel = bitcast<u32>(start.w);
  let passing = transmittance(Ray(start.xyz, into.xyz, time_of(pixel)), into.w);
  if (passing > 0.0) {
    add_to_film(pixel, vec4<f32>(passing * shadows[SHADOW * place + 1u].xyz, 0.0));
  }
}
