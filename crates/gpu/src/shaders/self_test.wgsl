// Evaluates arithmetic on a table, so that the host can compare bits.

struct Table { zero: f32, count: u32, pad: vec2<u32> }
@group(0) @binding(0) var<uniform> table: Table;
@group(0) @binding(1) var<storage, read> operands: array<vec4<f32>>;
// For each row: fma, product, inverse and quotient; root, dot product
@group(0) @binding(2) var<storage, read_write> results: array<vec4<f32>>;

fn zero() -> f32 { return table.zero; }

@compute @workgroup_size(64)
fn evaluate(@builtin(global_invocation_id) id: vec3<u32>) {
  let row = id.x;
  if (row >= table.count) { return; }
  let v = operands[row];
  // Without a factor in common with `v`, which compilers may take out of the sum
  let other = operands[(row + 1u) % table.count].xyz;
  results[2u * row] = vec4<f32>(fma(v.x, v.y, v.z), mul(v.x, v.y) + v.z, inverse(v.w), quotient(v.x, v.w));
  results[2u * row + 1u] = vec4<f32>(root(v.w), dot_in_order(v.xyz, other), dot_fused(v.xyz, other), 0.0);
}
