// Blocks of spheres that stay coded, in the order of their frame: kernels that trace rays decode them. They have a common
// radius, which rays add to boxes.

// Boxes of the centres of blocks, a part of all blocks in each dispatch
@compute @workgroup_size(256)
fn block_boxes(
  @builtin(workgroup_id) group: vec3<u32>,
  @builtin(num_workgroups) groups: vec3<u32>,
  @builtin(local_invocation_index) local: u32,
) {
  let block = linear_index(group, groups, local, 256u);
  if (block >= build.children) { return; }
  let first = (build.blocks_before + block) * BLOCK;
  var low = vec3<f32>(LARGEST);
  var high = vec3<f32>(-LARGEST);
  for (var i = first; i < min(first + BLOCK, build.count); i++) {
    let at = center(i);
    low = min(low, at);
    high = max(high, at);
  }
  write_box(block, low, high);
}
