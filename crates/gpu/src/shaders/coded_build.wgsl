// The arrays of coded centres for kernels that build a tree.
@group(0) @binding(1) var<storage, read> centers: array<u32>;
@group(0) @binding(17) var<storage, read> more_centers: array<u32>;
@group(0) @binding(15) var<storage, read> grids: array<f32>;
@group(0) @binding(16) var<storage, read> wide: array<f32>;

fn wide_count() -> u32 { return build.wide_count; }

fn zero() -> f32 { return f32(build.zero); }
