// Light by parts (HAS_LAYERS): by its first interaction and by light group, and what arrives of direct light. As the CPU's
// `light_split.rs` and `light_groups.rs`.

// Sums over the samples of each pixel, plane by plane; then, with a clamp, the parts of the indirect light of the ray that is
// being traced
@group(0) @binding(21) var<storage, read_write> layers: array<vec4<f32>>;

// By the first interaction
const BY_DIFFUSE: u32 = 0u;
const BY_SPECULAR: u32 = 1u;
const BY_EMISSION: u32 = 2u;
const BY_BACKGROUND: u32 = 3u;
// After one interaction at most
const BY_DIRECT: u32 = 4u;
// Luminance of direct light: if nothing is in the way, and what arrives
const BY_ARRIVAL: u32 = 5u;
// The part that a shadow catcher lacks
const BY_LOSS: u32 = 6u;
// The diffuse part of the reflection at the first surface of the path that is being traced
const FIRST_REFLECTION: u32 = 7u;
// By the first interaction again: of glass
const BY_REFLECTION: u32 = 8u;
const BY_REFRACTION: u32 = 9u;
// By group
const FIRST_GROUP: u32 = 10u;

// First interactions of paths: none yet, glass reflects or refracts the camera ray, or an opaque surface reflects it
const NOTHING_FIRST: u32 = 0u;
const REFLECTION_FIRST: u32 = 1u;
const REFRACTION_FIRST: u32 = 2u;
const BOUNCE_FIRST: u32 = 3u;

fn layer_place(layer: u32, pixel: u32) -> u32 { return layer * view.width * view.height + pixel; }

// Empties the layers of a pixel before its first sample.
fn clear_layers(pixel: u32) {
  if (!HAS_LAYERS) { return; }
  let count = select(view.layer_count, 2u * view.layer_count, HAS_CLAMP);
  for (var layer = 0u; layer < count; layer++) { layers[layer_place(layer, pixel)] = vec4<f32>(0.0); }
}

// Adds light to a layer of a pixel, or, if a clamp limits it, to what is added when the ray is known.
fn add_to_layer(layer: u32, pixel: u32, light: vec3<f32>, is_limited: bool) {
  if (layer < view.layer_count && any(light != vec3<f32>(0.0))) {
    let target_layer = layer + select(0u, view.layer_count, HAS_CLAMP && is_limited);
    layers[layer_place(target_layer, pixel)] += vec4<f32>(light, 0.0);
  }
}

// Adds a part of the indirect light of a ray to the layers.
fn add_limited_layers(pixel: u32, part: f32) {
  if (!HAS_LAYERS) { return; }
  for (var layer = 0u; layer < view.layer_count; layer++) {
    let limited = layer_place(view.layer_count + layer, pixel);
    layers[layer_place(layer, pixel)] += part * layers[limited];
    layers[limited] = vec4<f32>(0.0);
  }
}

// Adds light of a group that the first surface reflects or refracts; `diffuse`: the diffuse part if it is opaque.
fn add_after(first: u32, pixel: u32, group: u32, light: vec3<f32>, diffuse: vec3<f32>, is_limited: bool) {
  if (!HAS_LAYERS) { return; }
  if (first == REFLECTION_FIRST) {
    add_to_layer(BY_REFLECTION, pixel, light, is_limited);
  } else if (first == REFRACTION_FIRST) {
    add_to_layer(BY_REFRACTION, pixel, light, is_limited);
  } else {
    add_to_layer(BY_DIFFUSE, pixel, diffuse * light, is_limited);
    add_to_layer(BY_SPECULAR, pixel, light - diffuse * light, is_limited);
  }
  add_to_layer(FIRST_GROUP + group, pixel, light, is_limited);
}

// Adds light of a group that a ray sees, not that of a surface. `of_camera`: its layer if that is a camera ray.
fn add_seen(pixel: u32, of_camera: u32, group: u32, light: vec3<f32>, state: State) {
  if (!HAS_LAYERS) { return; }
  let depth = depth_along(state);
  if (depth == 1u) {
    add_to_layer(of_camera, pixel, light, false);
    add_to_layer(FIRST_GROUP + group, pixel, light, false);
  } else {
    add_after(first_of(state), pixel, group, light, first_reflection(pixel), bounces_of(state) > 1u);
  }
  if (depth <= 2u) { add_to_layer(BY_DIRECT, pixel, light, false); }
}

fn first_reflection(pixel: u32) -> vec3<f32> { return layers[layer_place(FIRST_REFLECTION, pixel)].xyz; }

fn keep_first_reflection(pixel: u32, diffuse: vec3<f32>) {
  if (HAS_LAYERS && stage.depth == 1u) { layers[layer_place(FIRST_REFLECTION, pixel)] = vec4<f32>(diffuse, 0.0); }
}

// Adds direct light of camera rays: its luminance if nothing is in the way, and what arrives.
fn add_arrival(pixel: u32, whole: f32, arriving: f32) {
  if (HAS_LAYERS && stage.depth == 1u) { layers[layer_place(BY_ARRIVAL, pixel)] += vec4<f32>(whole, arriving, 0.0, 0.0); }
}
