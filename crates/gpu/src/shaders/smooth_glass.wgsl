// Rays that leave a smooth surface (eq. 4.1 and 4.3 of the thesis), with the bits of the CPU
fn leave(ray: Ray, surface: Surface, seed: Wide) -> Leaving {
  let cosine = -dot_in_order(ray.direction, surface.normal);
  let ratio = select(view.ior, inverse(view.ior), surface.is_entering);
  let found = fresnel_of(cosine, ratio);
  let is_total = found.sine2 >= 1.0;
  let mirrored = ray.direction + scaled(surface.normal, 2.0 * cosine);
  let along = mul(ratio, cosine) - root(1.0 - select(found.sine2, 1.0, is_total));
  let bent = scaled(ray.direction, ratio) + scaled(surface.normal, along);
  return Leaving(
    scaled(mirrored, inverse(root(dot_in_order(mirrored, mirrored)))),
    scaled(bent, inverse(root(dot_in_order(bent, bent)))),
    vec2<f32>(
      mul(view.reflection, found.reflectance),
      select(mul(view.transmission, 1.0 - found.reflectance), 0.0, is_total),
    ),
  );
}
