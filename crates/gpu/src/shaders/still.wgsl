// Without motion blur: the counterparts of `moving.wgsl`.

fn sphere_at(slot: u32, time: f32) -> vec4<f32> { return stored_sphere(slot); }

fn time_of(pixel: u32) -> f32 { return 0.0; }

fn camera_line(at: vec2<f32>, time: f32) -> Line { return line_of(view.camera, at); }

fn seen_on_film(at: vec2<f32>, time: f32) -> vec2<f32> { return at; }

// Arithmetic of the sphere test
fn test_dot(a: vec3<f32>, b: vec3<f32>) -> f32 { return dot_fused(a, b); }

fn test_minus(o: vec3<f32>, m: f32, d: vec3<f32>) -> vec3<f32> { return minus_fused(o, m, d); }
