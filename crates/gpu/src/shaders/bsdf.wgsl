// How opaque surfaces reflect light: matte, plastic (a matte base under a coat) and metal, as on the CPU. Directions are
// in the frame of the surface, whose z axis is the normal, and lead away from it.

const MATTE: u32 = 0u;
const PLASTIC: u32 = 1u;
const METAL: u32 = 2u;

// How a ground reflects light
const OF_GROUND: Finish = Finish(0u, MATTE, 1.0, 0u);

// Reflectance of the coat of plastic at normal incidence
const COAT: f32 = 0.02;
const MIN_COSINE: f32 = 1e-4;
const BELOW_ONE: f32 = 0.99999994;
// Cells of the table of the light that leaves a rough surface
const CELLS: u32 = 64u;

// How the sphere with this index reflects light: as the last group that begins before it
fn finish_of(index: u32) -> Finish {
  var group = 0u;
  for (var other = 1u; other < scene.finish_count; other++) {
    if (scene.finishes[other].first <= index) { group = other; }
  }
  return scene.finishes[group];
}

// The fraction of light that leaves a rough surface, for a direction with this cosine
fn leaving(finish: Finish, cosine: f32) -> f32 {
  let x = clamp(cosine, 0.0, 1.0) * f32(CELLS);
  let cell = min(u32(x), CELLS - 1u);
  let at = finish.albedo_table + cell;
  let a = constants[at];
  return a + (constants[at + 1u] - a) * (x - f32(cell));
}

// Density of microfacets (GGX), by the cosine of their normal
fn facet_density(finish: Finish, cosine: f32) -> f32 {
  let alpha2 = finish.alpha * finish.alpha;
  let x = cosine * cosine * (alpha2 - 1.0) + 1.0;
  return alpha2 * INVERSE_PI / (x * x);
}

// Smith's auxiliary function
fn lambda(finish: Finish, cosine: f32) -> f32 {
  let c2 = cosine * cosine;
  let tan2 = max(1.0 - c2, 0.0) / c2;
  return 0.5 * (sqrt(1.0 + finish.alpha * finish.alpha * tan2) - 1.0);
}

fn shadowing(finish: Finish, a: f32, b: f32) -> f32 {
  return 1.0 / (1.0 + lambda(finish, a) + lambda(finish, b));
}

fn facet_pdf(finish: Finish, normal: f32, out: f32) -> f32 {
  return facet_density(finish, normal) / ((1.0 + lambda(finish, out)) * 4.0 * out);
}

// A visible microfacet normal
fn sample_facet(finish: Finish, out: vec3<f32>, u: vec2<f32>) -> vec3<f32> {
  let v = normalize(vec3<f32>(out.xy * finish.alpha, out.z));
  let turned = sine_cosine(2.0 * PI * u.x);
  let z = (1.0 - u.y) * (1.0 + v.z) - v.z;
  let level = sqrt(max(1.0 - z * z, 0.0));
  let h = vec3<f32>(level * turned.y + v.x, level * turned.x + v.y, z + v.z);
  return normalize(vec3<f32>(h.xy * finish.alpha, max(h.z, 1e-7)));
}

fn schlick_rise(cosine: f32) -> f32 {
  let x = 1.0 - clamp(cosine, 0.0, 1.0);
  let x2 = x * x;
  return x2 * x2 * x;
}

// The probability with which a direction of the base of plastic, or one for light of several reflections of metal, is
// sampled
fn diffuse_part(finish: Finish, base: vec3<f32>, out: f32) -> f32 {
  if (finish.kind == METAL) { return max(1.0 - leaving(finish, out), 0.0); }
  let coat = leaving(finish, out);
  let matte = (1.0 - coat) * largest_of(base);
  return matte / (matte + coat);
}

// The BSDF times the cosine, and the density of the direction
fn rough_value(finish: Finish, base: vec3<f32>, out: vec3<f32>, into: vec3<f32>) -> vec4<f32> {
  let h = normalize(out + into);
  let single = facet_density(finish, h.z) * shadowing(finish, out.z, into.z) / (4.0 * out.z);
  let rise = schlick_rise(dot(out, h));
  let part = diffuse_part(finish, base, out.z);
  let pdf = part * into.z * INVERSE_PI + (1.0 - part) * facet_pdf(finish, h.z, out.z);
  let mean = constants[finish.albedo_table + CELLS + 1u];
  if (finish.kind == PLASTIC) {
    let coat = (COAT + (1.0 - COAT) * rise) * single;
    let passing = (1.0 - leaving(finish, out.z)) * (1.0 - leaving(finish, into.z));
    let matte = into.z * INVERSE_PI * passing / (1.0 - mean);
    return vec4<f32>(base * matte + coat, pdf);
  }
  let several = part * max(1.0 - leaving(finish, into.z), 0.0) * into.z * INVERSE_PI / max(1.0 - mean, 1e-6);
  let fresnel = base + (1.0 - base) * rise;
  let average = (20.0 * base + 1.0) / 21.0;
  let tint = average * average * mean / (1.0 - average * (1.0 - mean));
  return vec4<f32>(fresnel * single + tint * several, pdf);
}

fn rough_direction(finish: Finish, base: vec3<f32>, out: vec3<f32>, u: vec2<f32>) -> vec3<f32> {
  // Choose a lobe, and use the number once more in it
  let part = diffuse_part(finish, base, out.z);
  let is_diffuse = u.x < part;
  let rest = select(u.x - part, u.x, is_diffuse) / max(select(1.0 - part, part, is_diffuse), 1e-9);
  let again = vec2<f32>(min(rest, BELOW_ONE), u.y);
  if (is_diffuse) { return cosine_direction(again); }
  let h = sample_facet(finish, out, again);
  return 2.0 * dot(out, h) * h - out;
}

fn cosine_direction(u: vec2<f32>) -> vec3<f32> {
  let at = on_disc(u);
  return vec3<f32>(at, root(max((1.0 - mul(at.x, at.x)) - mul(at.y, at.y), 0.0)));
}

// The directions of light that leaves and arrives, in the frame of a surface
fn to_local(direction: vec3<f32>, n: vec3<f32>) -> vec3<f32> {
  let frame = tangents_of(n);
  return vec3<f32>(dot(direction, frame.s), dot(direction, frame.t), dot(direction, n));
}

fn leaving_along(out: vec3<f32>, n: vec3<f32>) -> vec3<f32> {
  let local = to_local(out, n);
  return vec3<f32>(local.xy, max(local.z, MIN_COSINE));
}

// The BSDF times the cosine for light from `into`, and the density with which `sample_bsdf` chooses that direction.
fn eval_bsdf(finish: Finish, base: vec3<f32>, n: vec3<f32>, out: vec3<f32>, into: vec3<f32>) -> vec4<f32> {
  let cosine = dot(n, into);
  if (!(cosine > 0.0)) { return vec4<f32>(0.0); }
  if (finish.kind == MATTE) { return vec4<f32>(base, 1.0) * (cosine * INVERSE_PI); }
  return rough_value(finish, base, leaving_along(out, n), to_local(into, n));
}

// The part of the reflected light that the matte base of a surface reflects
fn diffuse_fraction(finish: Finish, base: vec3<f32>, n: vec3<f32>, out: vec3<f32>, into: vec3<f32>) -> vec3<f32> {
  if (finish.kind != PLASTIC) { return vec3<f32>(select(1.0, 0.0, finish.kind == METAL)); }
  let along = leaving_along(out, n);
  let local = to_local(into, n);
  let value = rough_value(finish, base, along, local).xyz;
  let coat = rough_value(finish, vec3<f32>(0.0), along, local).x;
  return select(vec3<f32>(1.0), (value - coat) / value, value > vec3<f32>(0.0));
}

struct BsdfSample { direction: vec3<f32>, weight: vec3<f32>, pdf: f32 }

// A direction from which light may arrive; its weight is the BSDF times the cosine over the density.
fn sample_bsdf(finish: Finish, base: vec3<f32>, n: vec3<f32>, out: vec3<f32>, u: vec2<f32>) -> BsdfSample {
  if (finish.kind == MATTE) {
    let local = cosine_direction(u);
    return BsdfSample(to_world(local, n), base, local.z * INVERSE_PI);
  }
  let along = leaving_along(out, n);
  let local = rough_direction(finish, base, along, u);
  let value = rough_value(finish, base, along, local);
  if (!(local.z > 0.0 && value.w > 0.0)) { return BsdfSample(n, vec3<f32>(0.0), 0.0); }
  return BsdfSample(to_world(local, n), value.xyz / value.w, value.w);
}
