// The surface and the medium of clear spheres, as on the CPU (`interface/dielectric.rs`).

// The reflectance of a surface for unpolarised light, and the squared sine of the refracted ray: 1 or more if the light
// is totally reflected. `ratio` is the index of refraction on the side of the ray over that on the other side.
struct Fresnel { reflectance: f32, sine2: f32 }

fn fresnel_of(cosine: f32, ratio: f32) -> Fresnel {
  let sine2 = mul(mul(ratio, ratio), max(1.0 - mul(cosine, cosine), 0.0));
  return Fresnel(select(reflectance(cosine, ratio), 1.0, sine2 >= 1.0), sine2);
}

// That of a dielectric, or Schlick's approximation
fn reflectance(cosine: f32, ratio: f32) -> f32 {
  let c = clamp(cosine, 0.0, 1.0);
  if (view.is_exact_fresnel == 0u) {
    let at_normal = quotient(1.0 - view.ior, 1.0 + view.ior);
    let r0 = mul(at_normal, at_normal);
    let x = clamp(1.0 - cosine, 0.0, 1.0);
    let x2 = mul(x, x);
    return r0 + mul(1.0 - r0, mul(mul(x2, x2), x));
  }
  let sine2 = mul(mul(ratio, ratio), 1.0 - mul(c, c));
  if (sine2 >= 1.0) { return 1.0; }
  let inner = root(1.0 - sine2);
  let across = mul(ratio, c);
  let bent = mul(ratio, inner);
  let s = quotient(across - inner, across + inner);
  let p = quotient(c - bent, c + bent);
  return 0.5 * (mul(s, s) + mul(p, p));
}

// Transmittance of a shadow ray that crosses a surface without refraction
fn straight_transmittance(cosine: f32) -> f32 {
  return view.transmission * (1.0 - reflectance(cosine, inverse(view.ior)));
}

// Extinction of the medium of a sphere, per unit of length. What is left after `color_length` may have its own colour, too.
fn extinction_of(index: u32) -> vec3<f32> {
  if (view.color_length < 0.0) { return view.extinction; }
  let loss = -log(clamp(base_color(index), vec3<f32>(1e-6), vec3<f32>(1.0))) / view.color_length;
  return view.extinction + clamp(loss, vec3<f32>(0.0), vec3<f32>(FAR));
}
