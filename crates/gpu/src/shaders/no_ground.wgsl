// Without a ground: the counterparts of `ground.wgsl`.

struct GroundHit { t: f32, opacity: f32, point: vec3<f32> }

fn hit_ground(ray: Ray) -> GroundHit { return GroundHit(FAR, 0.0, vec3<f32>(0.0)); }

fn is_below_ground(ray: Ray, limit: f32) -> bool { return false; }

fn above_ground(ground: GroundHit) -> vec3<f32> { return vec3<f32>(0.0); }

fn ground_normal() -> vec3<f32> { return vec3<f32>(0.0); }

fn ground_ambient() -> vec3<f32> { return vec3<f32>(0.0); }

fn ground_diffuse() -> f32 { return 0.0; }

fn ground_color(point: vec3<f32>) -> vec3<f32> { return vec3<f32>(0.0); }
