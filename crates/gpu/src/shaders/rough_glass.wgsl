// Rays that leave single microfacets of a rough surface, as on the CPU (`interface/rough.rs`).

// Numbers of the table of the light that leaves it from outside; that from inside follows
const GLASS_TABLE: u32 = CELLS + 2u;

// The part of the light that leaves with the cosine `into`, if it has reached a microfacet with the cosine `out`
fn passed(facets: Finish, out: f32, into: f32) -> f32 {
  return shadowing(facets, out, max(into, 1e-6)) * (1.0 + lambda(facets, out));
}

// The rays at a microfacet
fn leave(ray: Ray, surface: Surface, seed: Wide) -> Leaving {
  let u = numbers_2d(seed, BSDF, sample_number());
  let n = surface.normal;
  let ratio = select(view.ior, inverse(view.ior), surface.is_entering);
  let facets = Finish(0u, METAL, scene.glass_alpha, scene.glass_table + select(GLASS_TABLE, 0u, surface.is_entering));
  let along = to_local(-ray.direction, n);
  let out = normalize(vec3<f32>(along.xy, max(along.z, 1e-3)));
  let h = sample_facet(facets, out, u);
  let cosine = max(dot(out, h), 0.0);
  let found = fresnel_of(cosine, ratio);
  let reflected = 2.0 * dot(out, h) * h - out;
  let refracted = (ratio * cosine - sqrt(max(1.0 - found.sine2, 0.0))) * h - ratio * out;
  // A reflected ray that goes down, and a refracted one that goes up, meet another microfacet: more light leaves then
  let of_reflected = select(0.0, found.reflectance, reflected.z > 0.0);
  let of_refracted = select(0.0, 1.0 - found.reflectance, refracted.z < 0.0);
  let more = 1.0 / leaving(facets, out.z);
  return Leaving(
    to_world(reflected, n),
    to_world(refracted, n),
    vec2<f32>(
      view.reflection * of_reflected * passed(facets, out.z, abs(reflected.z)) * more,
      view.transmission * of_refracted * passed(facets, out.z, abs(refracted.z)) * more,
    ),
  );
}
