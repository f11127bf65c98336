// Coordinates of the centres of a frame: one after the other (ENCODING 0), or in the blocks of native frames (1).
@group(0) @binding(1) var<storage, read> centers: array<f32>;

fn center(i: u32) -> vec3<f32> {
  if (ENCODING == 1u) {
    // Blocks of 16 centres: all x, all y, all z
    let x = 48u * (i >> 4u) + (i & 15u);
    return vec3<f32>(centers[x], centers[x + 16u], centers[x + 32u]);
  }
  return vec3<f32>(centers[3u * i], centers[3u * i + 1u], centers[3u * i + 2u]);
}
