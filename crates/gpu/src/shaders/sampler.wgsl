// The random numbers of rays: Owen-scrambled Sobol' points from a seed for each vertex of a path. They are those of the
// CPU to the bit, so that both draw the same picture, not one with other noise.

// Numbers of 64 bits as (low, high)
alias Wide = vec2<u32>;

fn add_wide(a: Wide, b: Wide) -> Wide {
  let low = a.x + b.x;
  return Wide(low, a.y + b.y + select(0u, 1u, low < a.x));
}

// The lower half of a product
fn multiply_wide(a: Wide, b: Wide) -> Wide {
  let al = a.x & 0xffffu;
  let ah = a.x >> 16u;
  let bl = b.x & 0xffffu;
  let bh = b.x >> 16u;
  let low = al * bl;
  let first = al * bh;
  let second = ah * bl;
  let middle = (low >> 16u) + (first & 0xffffu) + (second & 0xffffu);
  let carried = ah * bh + (first >> 16u) + (second >> 16u) + (middle >> 16u);
  return Wide((middle << 16u) | (low & 0xffffu), carried + a.x * b.y + a.y * b.x);
}

fn fold_wide(a: Wide, shift: u32) -> Wide {
  return a ^ Wide((a.x >> shift) | (a.y << (32u - shift)), a.y >> shift);
}

// The output of SplitMix64 for a state (Steele, Lea and Flood, 2014).
fn mix_wide(state: Wide) -> Wide {
  var z = add_wide(state, Wide(0x7f4a7c15u, 0x9e3779b9u));
  z = multiply_wide(fold_wide(z, 30u), Wide(0x1ce4e5b9u, 0xbf58476du));
  z = multiply_wide(fold_wide(z, 27u), Wide(0x133111ebu, 0x94d049bbu));
  return fold_wide(z, 31u);
}

// Continuations of a path, and dimensions at one of its vertices or of a segment
const REFLECTED: u32 = 0u;
const REFRACTED: u32 = 1u;
const BOUNCED: u32 = 2u;
const CAMERA: u32 = 3u;
const BRANCH: u32 = 0u;
const CONTINUATION: u32 = 1u;
const BSDF: u32 = 2u;
const ENVIRONMENT: u32 = 3u;
const LIGHTS: u32 = 4u;
const LENS: u32 = 0u;
const TIME: u32 = 1u;
const OPACITY: u32 = 0xfffffffcu;

fn seed_of_pixel(x: u32, y: u32) -> Wide { return mix_wide(Wide(x, y)); }

fn child_of(seed: Wide, branch: u32) -> Wide { return mix_wide(add_wide(seed, Wide(branch + 1u, 0u))); }

fn halves_of(seed: Wide, dimension: u32) -> Wide { return mix_wide(seed ^ mix_wide(Wide(dimension, 0u))); }

// Owen scrambling of a fraction of 2^32 (constants by Vegdahl, "Building a better LK hash", 2021).
fn scramble(fraction: u32, seed: u32) -> u32 {
  var x = reverseBits(fraction);
  x ^= x * 0x3d20adeau;
  x += seed;
  x *= (seed >> 16u) | 1u;
  x ^= x * 0x05526c56u;
  x ^= x * 0x53a22864u;
  return reverseBits(x);
}

// The second coordinate of a point of the Sobol' sequence, as a fraction of 2^32 (Ahmed, "An implementation algorithm of
// 2D Sobol sequence fast, elegant, and compact", 2024).
fn second_coordinate(index: u32) -> u32 {
  var bits = index;
  bits ^= bits >> 16u;
  bits ^= (bits & 0xff00ff00u) >> 8u;
  bits ^= (bits & 0xf0f0f0f0u) >> 4u;
  bits ^= (bits & 0xccccccccu) >> 2u;
  bits ^= (bits & 0xaaaaaaaau) >> 1u;
  return reverseBits(bits);
}

fn unit_number(fraction: u32) -> f32 { return f32(fraction >> 8u) * 5.9604644775390625e-8; }

fn number_1d(seed: Wide, dimension: u32, sample: u32) -> f32 {
  let halves = halves_of(seed, dimension);
  return unit_number(scramble(reverseBits(scramble(sample, halves.x)), halves.y));
}

fn numbers_2d(seed: Wide, dimension: u32, sample: u32) -> vec2<f32> {
  let halves = halves_of(seed, dimension);
  let shuffled = scramble(sample, halves.x ^ halves.y);
  return vec2<f32>(
    unit_number(scramble(reverseBits(shuffled), halves.x)),
    unit_number(scramble(second_coordinate(shuffled), halves.y)),
  );
}

// The seed of the random numbers of a pixel after a number of reflections: to find it again costs less than to keep it
// in queues
fn seed_at(pixel: u32, bounces: u32, branch: u32) -> Wide {
  let x = i32(pixel % view.width) + view.corner.x;
  let y = i32(pixel / view.width) + view.corner.y;
  var seed = seed_of_pixel(u32(x), u32(y)) ^ view.sequence;
  for (var i = 0u; i < bounces; i++) { seed = child_of(seed, branch); }
  return seed;
}

// The number that chooses at which sphere a ray of this depth ends, if they are not opaque
fn number_of_end(pixel: u32, branch: u32) -> f32 {
  if (!HAS_OPACITY) { return 0.0; }
  return number_1d(seed_at(pixel, stage.depth - 1u, branch), OPACITY, sample_number());
}
