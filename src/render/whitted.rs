//! Whitted's recursion with the intensities of the thesis:
//! `I = ambient + sum of lights + reflection*r*S + transmission*(1-r)*T` (eq. 4.1), Blinn-Phong per
//! light (4.2, program 3.1), `r` by Schlick (4.3). Both weights 1 give 4.1 to the letter.
//!
//! Normals face the ray that sees them, as the thesis's `faceforward` does, so a surface seen from
//! inside is lit from inside. Under total internal reflection `r` is 1. A transmissive body dims a
//! shadow ray by `transmission*(1-r)` at each crossing of its surface instead of blocking it; that
//! ray goes straight on, so there are no caustics.

use glam::{Vec2, Vec3};

use super::{
    RayCounts, RenderSettings, ShadeSource,
    aov::{DataSample, NO_ID},
};
use crate::{
    ray::{PACKET_SIZE, Ray, RayPacket},
    scene::{
        Ground, Scene, ground,
        light::Incident,
        material::{reflect, refract, schlick},
    },
    surface::{Surface, SurfaceHit},
};

/// What a tile's rays leave behind: counts, and memory for the next ray.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    pub(super) counts: RayCounts,
    /// For each light, the rays of a packet whose places it reaches.
    lit: Vec<u32>,
}

/// One sample of a pixel.
#[derive(Debug, Clone, Copy)]
pub(super) struct PixelSample {
    pub(super) color: Vec3,
    pub(super) coverage: f32,
    pub(super) data: DataSample,
}

/// Follows rays through a scene.
pub(super) struct Tracer<'a, S, C> {
    surface: &'a S,
    scene: &'a Scene,
    source: &'a C,
    max_depth: u32,
    min_weight: f32,
    transparent_background: bool,
    r0: f32,
}

/// What a ray meets first.
enum Met {
    Particle(SurfaceHit),
    Ground(GroundHit),
    Nothing,
}

/// What a packet of camera rays meets.
#[derive(Default)]
struct Seen {
    /// Up to the floor.
    rays: RayPacket,
    floors: [Option<GroundHit>; PACKET_SIZE],
    hits: [Option<SurfaceHit>; PACKET_SIZE],
}

/// Which lights reach the place that a ray of a packet met.
#[derive(Clone, Copy)]
struct Lit<'a> {
    /// The ray's lane.
    lane: usize,
    /// For each light, a bit for each lane that it reaches.
    lights: &'a [u32],
}

/// A visible piece of floor.
#[derive(Clone, Copy)]
struct GroundHit {
    ground: Ground,
    t: f32,
    point: Vec3,
    presence: f32,
}

/// The side of a surface that a ray sees.
struct Face {
    /// Unit normal against the ray.
    normal: Vec3,
    /// Unit vector back along the ray.
    to_viewer: Vec3,
    /// A point just off the surface on the viewer's side, where secondary rays start.
    start: Vec3,
    base: Vec3,
}

/// Where a ray stands in the recursion.
#[derive(Clone, Copy)]
struct Level {
    /// 1 for rays from the camera.
    depth: u32,
    /// Part of the sample that this ray decides.
    weight: f32,
}

impl<'a, S: Surface, C: ShadeSource> Tracer<'a, S, C> {
    pub(super) fn new(
        surface: &'a S,
        scene: &'a Scene,
        source: &'a C,
        settings: &RenderSettings,
    ) -> Self {
        Self {
            surface,
            scene,
            source,
            max_depth: settings.max_depth,
            min_weight: settings.min_weight,
            transparent_background: settings.transparent_background,
            r0: scene.material.r0(),
        }
    }

    /// The light and the data that the camera sees at each place of `films`, at most a packet of them.
    /// They are what each would be alone; it is only faster for places close together.
    pub(super) fn samples(
        &self,
        films: &[Vec2],
        scratch: &mut Scratch,
        mut each: impl FnMut(usize, PixelSample),
    ) {
        scratch.counts.primary += films.len() as u64;
        let mut seen = Seen::default();
        for film in films {
            let ray = self.scene.camera.ray(*film);
            let floor = self.floor(&ray);
            let t_max = floor.as_ref().map_or(ray.t_max, |hit| hit.t);
            seen.rays.push(&Ray { t_max, ..ray });
            seen.floors[seen.rays.len() - 1] = floor;
        }
        seen.hits = self.surface.nearest_packet(&seen.rays);
        // Rays through transmissive bodies ask for crossings, one by one.
        let mut lit = std::mem::take(&mut scratch.lit);
        let known = self.scene.material.transmission <= 0.0;
        if known {
            self.light_up(&seen, &mut lit, scratch);
        }
        for lane in 0..films.len() {
            let ray = seen.rays.ray(lane);
            let lit = known.then_some(Lit { lane, lights: &lit });
            let sample = match seen.met(lane) {
                Met::Nothing => self.missed_sample(&ray),
                Met::Ground(hit) => self.ground_sample(&ray, &hit, lit, scratch),
                Met::Particle(hit) => self.particle_sample(&ray, &hit, lit, scratch),
            };
            each(lane, sample);
        }
        scratch.lit = lit;
    }

    /// Finds for each light which of the places that are `seen` it reaches, with packets of shadow rays.
    fn light_up(&self, seen: &Seen, lit: &mut Vec<u32>, scratch: &mut Scratch) {
        let mut places = [None; PACKET_SIZE];
        for (lane, place) in places.iter_mut().enumerate().take(seen.rays.len()) {
            *place = match seen.met(lane) {
                Met::Nothing => None,
                Met::Ground(hit) => Some((hit.start(), hit.ground.up)),
                Met::Particle(hit) => {
                    let normal = facing(hit.normal, seen.rays.ray(lane).direction);
                    Some((hit.point + hit.offset * normal, normal))
                }
            };
        }
        lit.clear();
        for light in &self.scene.lights {
            let mut rays = RayPacket::default();
            let mut lanes = [0; PACKET_SIZE];
            for (lane, place) in places.iter().enumerate() {
                let Some((start, normal)) = *place else {
                    continue;
                };
                let Some(incident) = light.at(start) else {
                    continue;
                };
                if !light.casts_shadow || normal.dot(incident.to_light) <= 0.0 {
                    continue;
                }
                scratch.counts.shadow += 1;
                let ray = shadow_ray(start, &incident);
                if !self.is_under_ground(&ray) {
                    lanes[rays.len()] = lane;
                    rays.push(&ray);
                }
            }
            let occluded = if rays.is_empty() {
                0
            } else {
                self.surface.occluded_packet(&rays)
            };
            let reached = lanes[..rays.len()]
                .iter()
                .enumerate()
                .filter(|(ray, _)| occluded >> ray & 1 == 0);
            lit.push(reached.fold(0, |lit, (_, lane)| lit | 1 << lane));
        }
    }

    fn missed_sample(&self, ray: &Ray) -> PixelSample {
        PixelSample {
            color: if self.transparent_background {
                Vec3::ZERO
            } else {
                self.scene.background.color(ray.direction)
            },
            coverage: 0.0,
            data: DataSample::MISS,
        }
    }

    fn particle_sample(
        &self,
        ray: &Ray,
        hit: &SurfaceHit,
        lit: Option<Lit<'_>>,
        scratch: &mut Scratch,
    ) -> PixelSample {
        const FIRST: Level = Level {
            depth: 1,
            weight: 1.0,
        };
        PixelSample {
            color: self.shade(ray, hit, FIRST, lit, scratch),
            coverage: 1.0,
            data: DataSample {
                z: self.scene.camera.depth(ray, hit.t),
                normal: facing(hit.normal, ray.direction),
                position: self.world(hit.point),
                velocity: self.source.velocity(hit.particle),
                albedo: self.source.color(hit.particle),
                id: self.source.id(hit.particle),
            },
        }
    }

    fn ground_sample(
        &self,
        ray: &Ray,
        hit: &GroundHit,
        lit: Option<Lit<'_>>,
        scratch: &mut Scratch,
    ) -> PixelSample {
        let lit = self.shade_ground(hit, lit, scratch);
        let (color, coverage) = if self.transparent_background {
            (hit.presence * lit, hit.presence)
        } else {
            let background = self.scene.background.color(ray.direction);
            (background.lerp(lit, hit.presence), 1.0)
        };
        PixelSample {
            color,
            coverage,
            data: DataSample {
                z: self.scene.camera.depth(ray, hit.t),
                normal: hit.ground.up,
                position: self.world(hit.point),
                velocity: Vec3::ZERO,
                albedo: hit.ground.color,
                id: NO_ID,
            },
        }
    }

    /// A point in world units.
    fn world(&self, point: Vec3) -> Vec3 {
        (self.scene.origin + point.as_dvec3()).as_vec3()
    }

    /// The floor where `ray` meets it, if anything is left of it there.
    fn floor(&self, ray: &Ray) -> Option<GroundHit> {
        let ground = self.scene.ground?;
        let t = ground.hit(ray)?;
        let point = ray.at(t);
        let presence = ground.presence(point);
        (presence > 0.0).then_some(GroundHit {
            ground,
            t,
            point,
            presence,
        })
    }

    fn meet(&self, ray: &Ray) -> Met {
        let floor = self.floor(ray);
        let t_max = floor.as_ref().map_or(ray.t_max, |hit| hit.t);
        Met::nearer(self.surface.nearest(&Ray { t_max, ..*ray }), floor)
    }

    /// Light that comes back along `ray`.
    fn radiance(&self, ray: &Ray, level: Level, scratch: &mut Scratch) -> Vec3 {
        match self.meet(ray) {
            Met::Nothing => self.scene.background.color(ray.direction),
            Met::Particle(hit) => self.shade(ray, &hit, level, None, scratch),
            Met::Ground(hit) => {
                let background = self.scene.background.color(ray.direction);
                background.lerp(self.shade_ground(&hit, None, scratch), hit.presence)
            }
        }
    }

    /// Eq. 4.1 at `hit`; `lit` where that is known.
    fn shade(
        &self,
        ray: &Ray,
        hit: &SurfaceHit,
        level: Level,
        lit: Option<Lit<'_>>,
        scratch: &mut Scratch,
    ) -> Vec3 {
        let material = &self.scene.material;
        let direction = ray.direction;
        let entering = direction.dot(hit.normal) < 0.0;
        let normal = facing(hit.normal, direction);
        let face = Face {
            normal,
            to_viewer: -direction,
            start: hit.point + hit.offset * normal,
            base: self.source.color(hit.particle),
        };
        let mut intensity = self.direct(&face, lit, scratch);

        let ratio = if entering {
            1.0 / material.ior
        } else {
            material.ior
        };
        let refracted = refract(direction, normal, ratio);
        let r = match refracted {
            Some(_) => schlick(self.r0, -direction.dot(normal)),
            None => 1.0,
        };
        let mirrored = material.reflection * r;
        if mirrored > 0.0 {
            let next = Ray::new(face.start, reflect(direction, normal));
            let level = level.below(mirrored);
            let traced = |counts: &mut RayCounts| counts.reflection += 1;
            intensity += mirrored * self.secondary(&next, level, scratch, traced);
        }
        let passed = material.transmission * (1.0 - r);
        if let Some(onward) = refracted
            && passed > 0.0
        {
            let next = Ray::new(hit.point - hit.offset * normal, onward);
            let level = level.below(passed);
            let traced = |counts: &mut RayCounts| counts.refraction += 1;
            intensity += passed * self.secondary(&next, level, scratch, traced);
        }
        intensity
    }

    /// Light along a reflected or refracted ray: the background where the recursion ends.
    fn secondary(
        &self,
        ray: &Ray,
        level: Level,
        scratch: &mut Scratch,
        traced: impl FnOnce(&mut RayCounts),
    ) -> Vec3 {
        if level.depth > self.max_depth || level.weight < self.min_weight {
            return self.scene.background.color(ray.direction);
        }
        traced(&mut scratch.counts);
        self.radiance(ray, level, scratch)
    }

    /// Ambient light and Blinn-Phong for every light that gets through.
    fn direct(&self, face: &Face, lit: Option<Lit<'_>>, scratch: &mut Scratch) -> Vec3 {
        let material = &self.scene.material;
        let mut sum = material.ambient * self.scene.ambient_light * face.base;
        for (light, cosine, visible) in self.lights(face.start, face.normal, lit, scratch) {
            let half = (light.to_light + face.to_viewer).normalize_or(face.normal);
            let highlight = face.normal.dot(half).max(0.0).powf(material.shininess);
            let reflected = material.diffuse * cosine * face.base + material.specular * highlight;
            sum += visible * light.radiance * reflected;
        }
        sum
    }

    fn shade_ground(&self, hit: &GroundHit, lit: Option<Lit<'_>>, scratch: &mut Scratch) -> Vec3 {
        let up = hit.ground.up;
        let mut light_sum = ground::AMBIENT * self.scene.ambient_light;
        for (light, cosine, visible) in self.lights(hit.start(), up, lit, scratch) {
            light_sum += ground::DIFFUSE * cosine * visible * light.radiance;
        }
        hit.ground.color * light_sum
    }

    /// The lights that reach `start` on the side of `normal`, with cosine and the part let through.
    fn lights(
        &self,
        start: Vec3,
        normal: Vec3,
        lit: Option<Lit<'_>>,
        scratch: &mut Scratch,
    ) -> impl Iterator<Item = (Incident, f32, f32)> {
        let lights = self.scene.lights.iter().enumerate();
        lights.filter_map(move |(number, light)| {
            let incident = light.at(start)?;
            let cosine = normal.dot(incident.to_light);
            if cosine <= 0.0 {
                return None;
            }
            let visible = match lit {
                _ if !light.casts_shadow => 1.0,
                Some(lit) => lit.by(number),
                None => self.visibility(start, &incident, scratch),
            };
            (visible > 0.0).then_some((incident, cosine, visible))
        })
    }

    /// Part of a light's radiance that gets to `start`.
    fn visibility(&self, start: Vec3, light: &Incident, scratch: &mut Scratch) -> f32 {
        let ray = shadow_ray(start, light);
        scratch.counts.shadow += 1;
        if self.is_under_ground(&ray) {
            return 0.0;
        }
        let transmission = self.scene.material.transmission;
        if transmission <= 0.0 {
            return if self.surface.occluded(&ray) {
                0.0
            } else {
                1.0
            };
        }
        let kept = |cosine: f32| transmission * (1.0 - schlick(self.r0, cosine));
        self.surface.transmittance(&ray, kept)
    }

    /// Whether the floor stands in the way of `ray`.
    fn is_under_ground(&self, ray: &Ray) -> bool {
        self.scene.ground.is_some_and(|g| g.hit(ray).is_some())
    }
}

/// The ray from `start` to a light.
fn shadow_ray(start: Vec3, light: &Incident) -> Ray {
    Ray {
        t_max: light.distance,
        ..Ray::new(start, light.to_light)
    }
}

impl Met {
    /// A particle, which was looked for only before the floor, or else the floor.
    fn nearer(hit: Option<SurfaceHit>, floor: Option<GroundHit>) -> Self {
        match (hit, floor) {
            (Some(hit), _) => Self::Particle(hit),
            (None, Some(floor)) => Self::Ground(floor),
            (None, None) => Self::Nothing,
        }
    }
}

impl GroundHit {
    /// A point just off the floor, where shadow rays start.
    fn start(&self) -> Vec3 {
        self.point + self.ground.offset(self.point, self.t) * self.ground.up
    }
}

impl Seen {
    /// What the ray in `lane` meets first.
    fn met(&self, lane: usize) -> Met {
        Met::nearer(self.hits[lane], self.floors[lane])
    }
}

impl Lit<'_> {
    /// Part of light `number` that gets here.
    fn by(self, number: usize) -> f32 {
        if self.lights[number] >> self.lane & 1 == 1 {
            1.0
        } else {
            0.0
        }
    }
}

impl Level {
    /// One level further, for a ray of `weight` in its parent.
    fn below(self, weight: f32) -> Self {
        Self {
            depth: self.depth + 1,
            weight: self.weight * weight,
        }
    }
}

/// `normal` turned against `direction`.
fn facing(normal: Vec3, direction: Vec3) -> Vec3 {
    if direction.dot(normal) < 0.0 {
        normal
    } else {
        -normal
    }
}
