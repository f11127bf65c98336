// Whitted ray tracing of spheres: equation 4.1 of the thesis, as the CPU's integrator.
//
// Rays are computed with the operations of the CPU, so that they meet the same spheres; colours are not, so that they
// may differ in the last bits. The sources of shadow rays are the lights. A ray that goes on has its direction and
// throughput beside its origin, and where it is in its path if spheres are clear; a shadow ray has its radiance beside its
// start.

const RAY: u32 = select(2u, 4u, HAS_GLASS);
const SHADOW: u32 = 2u;

// What rays see beyond the last depth
fn seen_at_end(direction: vec3<f32>) -> vec3<f32> { return background(direction); }

fn group_at_end() -> u32 { return 0u; }

// The direction to the light from `start`, and the distance.
fn toward(source: Light, start: vec3<f32>) -> vec4<f32> {
  if (source.kind == DISTANT) { return vec4<f32>(source.place, FAR); }
  let v = source.place - start;
  let distance = root(dot_in_order(v, v));
  return vec4<f32>(scaled(v, inverse(distance)), distance);
}

// Eq. 4.2: the light that a surface reflects, by the model of Blinn and Phong.
fn blinn_phong(normal: vec3<f32>, out: vec3<f32>, into: vec3<f32>, albedo: vec3<f32>, weight: vec3<f32>) -> vec3<f32> {
  let cosine = dot_in_order(normal, into);
  if (!(cosine > 0.0)) { return vec3<f32>(0.0); }
  var highlight = 0.0;
  if (view.specular > 0.0) {
    let half_vector = into + out;
    let scale = inverseSqrt(dot(half_vector, half_vector));
    let along = select(1.0, dot(normal, half_vector * scale), scale <= FAR);
    highlight = view.specular * select(pow(clamp(along, 0.0, 1.0), view.shininess), 1.0, view.shininess == 0.0);
  }
  return (view.diffuse * cosine) * albedo + highlight * weight;
}

// The ray that an opaque sphere reflects.
fn mirrored(path: Path, ray: Ray, surface: Surface) -> Next {
  let cosine = -dot_in_order(ray.direction, surface.normal);
  let ratio = select(view.ior, inverse(view.ior), surface.is_entering);
  let weight = path.throughput * (view.reflection * fresnel_of(cosine, ratio).reflectance);
  let along = ray.direction + scaled(surface.normal, 2.0 * cosine);
  let direction = scaled(along, inverse(root(dot_in_order(along, along))));
  return Next(weight.x > 0.0, direction, weight, FAR, path.state);
}

// Without glass, the throughput is grey.
fn store_ray(place: u32, start: vec3<f32>, next: Next, pixel: u32) {
  next_rays[RAY * place] = vec4<f32>(start, word_of(pixel));
  next_rays[RAY * place + 1u] = vec4<f32>(next.direction, next.throughput.x);
  if (HAS_GLASS) {
    next_rays[RAY * place + 2u] = vec4<f32>(next.throughput, 0.0);
    store_state(place, pixel, next.state);
  }
}

// The path up to a ray of the depth before
fn stored_path(i: u32) -> Path {
  var throughput = vec3<f32>(rays[RAY * i + 1u].w);
  if (HAS_GLASS) { throughput = rays[RAY * i + 2u].xyz; }
  let pixel = pixel_in(rays[RAY * i].w);
  return Path(throughput, FAR, pixel, vec2<f32>(0.0), vec3<f32>(1.0), stored_state(i));
}

// Adds what a ray sees without shadows, and appends the rays that leave its intersection.
fn follow(is_ray: bool, ray: Ray, path: Path, ground: GroundHit, hit: Hit) {
  var sum = vec4<f32>(0.0);
  var surface: Surface;
  var albedo = vec3<f32>(0.0);
  var throughput = path.throughput;
  var next = no_ray(path.state);
  let pixel = path.pixel;
  let is_hit = is_ray && hit.slot != MISS;
  let is_ground = is_ray && !is_hit && ground.t < FAR;
  let uncovered = select(1.0, 1.0 - ground.opacity, is_ground);
  if (is_ray && !is_hit && stage.depth > 1u) {
    sum = vec4<f32>(uncovered * path.throughput * background(ray.direction), 0.0);
  } else if (is_ray && !is_hit && view.transparent == 0u) {
    sum = vec4<f32>(uncovered * backdrop(ray.direction, path.on_film), 0.0);
  }
  if (is_hit) {
    surface = surface_at(ray, hit);
    if (stage.depth == 1u) {
      sum.w = 1.0;
      film[second_place(pixel)] = vec4<f32>(0.0);
      keep_surface(depth_of(ray, hit.t), hit.index, surface.normal, surface.point, pixel);
    }
    throughput = absorbed(path, ray, hit, surface);
    // Ambient light
    albedo = throughput * clamp(base_color(hit.index), vec3<f32>(0.0), vec3<f32>(1.0));
    sum += vec4<f32>(albedo * view.ambient, 0.0);
    // The rays that leave it
    if (!HAS_GLASS && view.reflection > 0.0) {
      next = mirrored(path, ray, surface);
      if (stage.depth >= view.max_depth) {
        sum += vec4<f32>(next.throughput * background(next.direction), 0.0);
        next.is_ray = false;
      }
    }
  }
  if (is_ground) {
    surface.normal = ground_normal();
    surface.start = above_ground(ground);
    if (stage.depth == 1u) {
      sum.w = select(1.0, ground.opacity, view.transparent == 1u);
      film[second_place(pixel)] = vec4<f32>(0.0);
      keep_surface(depth_of(ray, ground.t), GROUND, surface.normal, ground.point, pixel);
    }
    albedo = ground.opacity * throughput * clamp(ground_color(ground.point), vec3<f32>(0.0), vec3<f32>(1.0));
    sum += vec4<f32>(albedo * ground_ambient(), 0.0);
  }
  go_on(is_hit, path, throughput, ray, surface, &next, &sum);
  let queue = queue_of(stage.depth);
  count_refracted(next);
  let place = append(queue, next.is_ray);
  if (next.is_ray) { store_ray(place, surface.start, next, pixel); }
  // The light of each source, or its shadow ray
  for (var number = 0u; number < view.light_count; number++) {
    let source = view.lights[number];
    var radiance = vec3<f32>(0.0);
    if (is_hit || is_ground) {
      let into = toward(source, surface.start);
      if (is_hit) {
        radiance = source.radiance * blinn_phong(surface.normal, -ray.direction, into.xyz, albedo, throughput);
      } else {
        radiance = source.radiance * (ground_diffuse() * max(dot_in_order(surface.normal, into.xyz), 0.0)) * albedo;
      }
      if (source.kind == POINT_WITH_FALLOFF) { radiance /= into.w * into.w; }
    }
    let is_lit = max(max(radiance.x, radiance.y), radiance.z) > 0.0;
    if (source.casts_shadow == 0u) {
      if (is_lit) { sum += vec4<f32>(radiance, 0.0); }
      continue;
    }
    let place = append(queue + 1u + number, is_lit) + first_shadow(number);
    if (is_lit) {
      next_shadows[SHADOW * place] = vec4<f32>(surface.start, word_of(pixel));
      next_shadows[SHADOW * place + 1u] = vec4<f32>(radiance, 0.0);
    }
  }
  if (is_ray) {
    add_to_film(pixel, sum);
    let of_ground = object_of_ground(select(1.0, ground.opacity, view.transparent == 1u));
    keep_object(pixel, select(select(MISS, of_ground, is_ground), hit.index, is_hit));
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
  var ray: Ray;
  var ground = GroundHit(FAR, 0.0, vec3<f32>(0.0));
  var hit = Hit(0.0, MISS, MISS);
  var path = camera_path(pixel, vec2<f32>(0.0));
  if (is_ray) {
    ray = start_sample(pixel, at, &path);
    ground = hit_ground(ray);
    hit = nearest(ray, ground.t, number_of_end(pixel, REFLECTED));
  }
  follow(is_ray, ray, path, ground, hit);
}

// Adds the light that arrives along a shadow ray.
fn follow_shadow(i: u32) {
  let place = SHADOW * (i + first_shadow(stage.source));
  let start = shadows[place];
  let into = toward(view.lights[stage.source], start.xyz);
  let pixel = pixel_in(start.w);
  let ray = Ray(start.xyz, into.xyz, time_of(pixel));
  if (is_below_ground(ray, into.w)) { return; }
  let passing = transmittance(ray, into.w, true);
  if (passing > 0.0) {
    film[second_place(pixel)] += vec4<f32>(passing * shadows[place + 1u].xyz, 0.0);
  }
}

// A ray that was reflected at the depth before.
fn follow_next(i: u32, is_ray: bool) {
  var ray: Ray;
  var path = camera_path(0u, vec2<f32>(0.0));
  var ground = GroundHit(FAR, 0.0, vec3<f32>(0.0));
  var hit = Hit(0.0, MISS, MISS);
  if (is_ray) {
    path = stored_path(i);
    ray = Ray(rays[RAY * i].xyz, rays[RAY * i + 1u].xyz, time_of(path.pixel));
    ground = hit_ground(ray);
    hit = nearest(ray, ground.t, number_of_end(path.pixel, REFLECTED));
  }
  follow(is_ray, ray, path, ground, hit);
}

// The rays that were reflected at the depth before, then the shadow rays of a source from there, in workgroups of their own.
@compute @workgroup_size(GROUP)
fn trace_next(
  @builtin(workgroup_id) group: vec3<u32>,
  @builtin(num_workgroups) groups: vec3<u32>,
  @builtin(local_invocation_index) local: u32,
) {
  let count = count_next(stage.depth - 1u);
  let first_of_shadows = padded(count);
  var end = first_of_shadows;
  if (view.light_count > 0u) { end += count_shadows(stage.depth - 1u); }
  for (var i = linear_index(group, groups, local, GROUP); i < end; i += size_of(groups)) {
    if (i >= first_of_shadows) {
      follow_shadow(i - first_of_shadows);
    } else {
      follow_next(i, i < count);
    }
  }
}
