// The uniform of path tracing; of Whitted's model only the ground.

struct SceneUniform {
  // Axes of the environment, and the part of the light that a shadow catcher loses at most
  axis_right: vec3<f32>, catcher_strength: f32,
  axis_back: vec3<f32>, reach: f32,
  axis_up: vec3<f32>, bounces: u32,
  // Radiance that a white ground reflects of the environment if nothing is in the way
  catcher_whole: vec3<f32>, is_catcher: u32,
  ground_up: vec3<f32>, ground_height: f32,
  ground_center: vec3<f32>, fade_start: f32,
  ground_base: vec3<f32>, fade_end: f32,
  ground_color: vec3<f32>, ground_kind: u32,
  ground_across: vec3<f32>, ground_tile: f32,
  // Of Whitted's model
  ground_ambient: vec3<f32>, ground_diffuse: f32,
  // Tables of the environment, and of it times the cosine with the ground; without one, the edge is 0
  environment: Table,
  catcher: Table,
  // First pixel of the image of the environment; the largest component of the indirect light along a ray
  image: u32, is_environment_visible: u32, indirect_limit: f32, finish_count: u32,
  // The image at its own resolution: its size, and a factor on its radiance; the light group of the environment
  detail_scale: vec3<f32>, is_ambient: u32,
  detail_size: vec2<u32>, environment_group: u32, zero: u32,
  // Microfacets of rough glass: their width, and the tables of the light that leaves it from outside and from inside
  glass_alpha: f32, glass_table: u32, glass_zero: u32, glass_zero_too: u32,
  // How spheres reflect light, by the first index of each group
  finishes: array<Finish, 65>,
  // Irradiance of the environment
  harmonics: array<vec4<f32>, 9>,
}
@group(0) @binding(15) var<uniform> scene: SceneUniform;

// How spheres from an index on reflect light: the kind, the width of its microfacets, and the place of its table
struct Finish { first: u32, kind: u32, alpha: f32, albedo_table: u32 }

// A table of an environment: its edge in texels, and its places in `texels` and `constants`
struct Table { side: u32, records: u32, ends: u32, zero: u32 }
