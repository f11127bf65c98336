// Arithmetic with the bits of the CPU's kernels, whatever the compiler of the driver does.
//
// A compiler may fuse `a * b + c`, and its quotients and roots may differ by a few units in the last place. `fma` with
// a zero that the compiler does not know rounds a product alone. One step of Newton's method with `fma` rounds
// quotients and roots correctly (Markstein, "Computation of elementary functions on the IBM RISC System/6000
// processor", 1990). FUSED is false on devices whose `fma` rounds twice: there, plain operations follow IEEE 754, and
// the step would make them worse. The self-test of the device decides.
//
// Files that include this one define `fn zero() -> f32`, which returns 0 from a uniform.

fn mul(a: f32, b: f32) -> f32 {
  if (FUSED) { return fma(a, b, zero()); }
  return a * b;
}

fn scaled(a: vec3<f32>, b: f32) -> vec3<f32> {
  return vec3<f32>(mul(a.x, b), mul(a.y, b), mul(a.z, b));
}

fn inverse(x: f32) -> f32 {
  let y = 1.0 / x;
  if (FUSED) { return fma(y, fma(-x, y, 1.0), y); }
  return y;
}

fn quotient(a: f32, b: f32) -> f32 {
  if (FUSED) {
    let y = inverse(b);
    let q = mul(a, y);
    return fma(fma(-b, q, a), y, q);
  }
  return a / b;
}

fn root(x: f32) -> f32 {
  let s = sqrt(x);
  if (FUSED) {
    let corrected = fma(fma(-s, s, x), 0.5 / s, s);
    // Nothing to correct at 0, and NaN below
    return select(corrected, s, s == 0.0 || x != x);
  }
  return s;
}

// Sums in the order x, y, z, each product rounded: as plain code on the CPU.
fn dot_in_order(a: vec3<f32>, b: vec3<f32>) -> f32 {
  return (mul(a.x, b.x) + mul(a.y, b.y)) + mul(a.z, b.z);
}

// The dot product of the sphere test, which is fused in the CPU's kernels with AVX2, AVX-512 and NEON.
fn dot_fused(a: vec3<f32>, b: vec3<f32>) -> f32 {
  if (FUSED) { return fma(a.z, b.z, fma(a.y, b.y, mul(a.x, b.x))); }
  return (a.x * b.x + a.y * b.y) + a.z * b.z;
}

// `o - m * d`, fused as in `dot_fused`.
fn minus_fused(o: vec3<f32>, m: f32, d: vec3<f32>) -> vec3<f32> {
  if (FUSED) { return fma(vec3<f32>(-m), d, o); }
  return o - d * m;
}
