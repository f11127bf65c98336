// The uniform of all tracing kernels.

// A light source. Kinds are those of `lights.wgsl`.
struct Light {
  // Position, of the centre if the light has an extent, or the direction to a light at infinite distance
  place: vec3<f32>,
  kind: u32,
  radiance: vec3<f32>,
  casts_shadow: u32,
  // Axes of panels: along their width and height, and in the direction that they shine. `group`: the light group
  across: vec3<f32>,
  is_visible: u32,
  along: vec3<f32>, group: u32,
  normal: vec3<f32>, zero_too: f32,
  // Half the width and height; the radius of spheres; for suns, 1 minus the cosine of half the apparent diameter
  half: vec2<f32>, zeros: vec2<f32>,
}

// Where a camera is, its axes, half the width and height of the film, and whether rays are parallel
struct CameraAt {
  eye: vec3<f32>, zero: f32,
  right: vec3<f32>, half_width: f32,
  up: vec3<f32>, half_height: f32,
  forward: vec3<f32>, is_parallel: u32,
}

struct View {
  camera: CameraAt,
  // Size in pixels of the camera's image
  size: vec2<f32>,
  // Position in it of the first pixel of the film
  corner: vec2<i32>,
  // Pixels of the film, and samples of each
  width: u32, height: u32, samples: u32, max_depth: u32,
  // Levels of nodes, and the first node of each, from the lowest level on
  levels: u32, radius: f32, padding: f32, light_count: u32,
  starts: array<vec4<u32>, 4>,
  // Background: one colour (0), a gradient along `background_up` (1), or the same with a backdrop for camera rays (2)
  background_bottom: vec3<f32>, background_kind: u32,
  background_top: vec3<f32>, transparent: u32,
  background_up: vec3<f32>, color_kind: u32,
  // Radius of the lens and distance of the focus; 0 is a pinhole. Number of sources of shadow rays. Whether every second
  // sample is kept, whether rays can hit lights, and the number of layers of light
  lens_radius: f32, lens_focus: f32, sources: u32, has_odd: u32,
  has_extents: u32, layer_count: u32,
  // Changes the seeds of paths: the lower and the upper half
  sequence: vec2<u32>,
  // Material: ambient light times `Ka`, and the constants of Blinn and Phong
  ambient: vec3<f32>, diffuse: f32,
  color: vec3<f32>, specular: f32,
  shininess: f32, reflection: f32, ior: f32, is_exact_fresnel: u32,
  // Clear spheres: what their medium absorbs, and the weight of the refracted ray. The least weight of a path that both rays
  // continue; the length in a medium after which the colour of its sphere is left, or -1; how many rays a pixel keeps; and
  // the number of queues at each depth
  extinction: vec3<f32>, transmission: f32,
  split_weight: f32, color_length: f32, kept: u32, queues: u32,
  // Number of spheres, and of their blocks that are not coded, if spheres stay coded; where the samples of a batch begin
  sphere_count: u32, wide_count: u32, first_film: u32, first_data: u32,
  // The camera when the shutter opens and when it closes
  open: CameraAt,
  close: CameraAt,
  lights: array<Light, 8>,
}
@group(0) @binding(0) var<uniform> view: View;

fn zero() -> f32 { return view.camera.zero; }
