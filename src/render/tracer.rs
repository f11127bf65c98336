//! From places on the film to samples: camera rays in packets, and what is known of the first thing
//! that each meets. The light that comes from there is `whitted`'s business, or `body`'s.

use glam::{Vec2, Vec3};

use super::{
    RayCounts, RenderSettings, ShadeSource,
    aov::DataSample,
    body::{Optics, Path},
    floor::GroundHit,
    integrator::SPRAY,
    lights::{Known, Lit},
};
use crate::{
    ray::{PACKET_SIZE, Ray, RayPacket},
    scene::Scene,
    surface::{Side, Substance, Surface, SurfaceHit},
};

/// What a tile's rays leave behind: counts, and memory for the next ray.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    pub(super) counts: RayCounts,
    /// Which lights reach the places that a packet met.
    pub(super) lit: Lit,
    /// Particles that a place between them takes its colour from.
    parts: Vec<(u32, f32)>,
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
    pub(super) surface: &'a S,
    pub(super) scene: &'a Scene,
    pub(super) source: &'a C,
    pub(super) max_depth: u32,
    pub(super) min_weight: f32,
    pub(super) transparent_background: bool,
    pub(super) optics: Optics,
    /// Base colour of everything, if it is one.
    color: Option<Vec3>,
    /// Whether the camera is in the open.
    eye: Side,
}

/// What a ray meets first.
pub(super) enum Met<'a> {
    Particle(SurfaceHit),
    Ground(GroundHit<'a>),
    Nothing,
}

/// What a packet of camera rays meets.
#[derive(Default)]
pub(super) struct Seen<'a> {
    /// Up to the floor.
    pub(super) rays: RayPacket,
    floors: [Option<GroundHit<'a>>; PACKET_SIZE],
    hits: [Option<SurfaceHit>; PACKET_SIZE],
}

/// Where a ray stands in the recursion.
#[derive(Clone, Copy)]
pub(super) struct Level {
    /// 1 for rays from the camera.
    pub(super) depth: u32,
    /// Part of the sample that this ray decides.
    pub(super) weight: f32,
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
            optics: Optics::new(scene, settings),
            color: source.constant_color(),
            eye: if S::ONE_BODY {
                surface.side_of(scene.camera.eye())
            } else {
                Side::Outside
            },
        }
    }

    /// Whether rays go through one body, not through spheres.
    pub(super) fn is_one_medium(&self) -> bool {
        S::ONE_BODY && self.scene.material.transmission > 0.0
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
        seen.hits = self.first_hits(&seen.rays);
        let mut lit = std::mem::take(&mut scratch.lit);
        let known = self.light_up(&seen, self.eye, &mut lit, scratch);
        for (lane, film) in films.iter().enumerate() {
            let ray = seen.rays.ray(lane);
            let lit = known.then_some(Known { lane, lit: &lit });
            let sample = match seen.met(lane) {
                Met::Nothing => self.missed_sample(&ray),
                Met::Ground(hit) => self.ground_sample(&ray, &hit, self.eye, lit, scratch),
                Met::Particle(hit) => self.particle_sample(&ray, &hit, *film, lit, scratch),
            };
            each(lane, sample);
        }
        scratch.lit = lit;
    }

    /// What camera rays meet of the surface.
    fn first_hits(&self, rays: &RayPacket) -> [Option<SurfaceHit>; PACKET_SIZE] {
        if !self.is_one_medium() || self.eye == Side::Outside {
            return self.surface.nearest_packet(rays);
        }
        let mut hits = [None; PACKET_SIZE];
        for (hit, ray) in hits.iter_mut().zip(rays.rays()) {
            *hit = self.surface.crossing(&ray, self.eye);
        }
        hits
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
        film: Vec2,
        lit: Option<Known<'_>>,
        scratch: &mut Scratch,
    ) -> PixelSample {
        const FIRST: Level = Level {
            depth: 1,
            weight: 1.0,
        };
        let path = Path::from_film(film);
        let color = if self.is_one_medium() {
            self.through(ray, hit, self.eye, path, scratch)
        } else {
            self.shade(ray, hit, FIRST, path, lit, scratch)
        };
        let particle = if self.optics.wants_particle {
            self.surface.particle_at(hit)
        } else {
            hit.particle
        };
        PixelSample {
            color,
            coverage: 1.0,
            data: DataSample {
                z: self.scene.camera.depth(ray, hit.t),
                normal: facing(hit.normal, ray.direction),
                position: self.world(hit.point),
                velocity: self.source.velocity(particle),
                albedo: if S::ONE_BODY && !self.optics.wants_albedo {
                    Vec3::ZERO
                } else {
                    self.base(hit, scratch)
                },
                id: self.source.id(particle),
            },
        }
    }

    /// Base colour where a ray meets the surface.
    pub(super) fn base(&self, hit: &SurfaceHit, scratch: &mut Scratch) -> Vec3 {
        if hit.substance == Substance::Spray {
            return SPRAY;
        }
        if let Some(color) = self.color {
            return color;
        }
        if !S::ONE_BODY {
            return self.source.color(hit.particle);
        }
        let parts = &mut scratch.parts;
        parts.clear();
        self.surface
            .blend(hit, &mut |particle, weight| parts.push((particle, weight)));
        self.source.blended_color(parts)
    }

    /// A point in world units.
    pub(super) fn world(&self, point: Vec3) -> Vec3 {
        (self.scene.origin + point.as_dvec3()).as_vec3()
    }
}

impl<'a> Met<'a> {
    /// A particle, which was looked for only before the floor, or else the floor.
    pub(super) fn nearer(hit: Option<SurfaceHit>, floor: Option<GroundHit<'a>>) -> Self {
        match (hit, floor) {
            (Some(hit), _) => Self::Particle(hit),
            (None, Some(floor)) => Self::Ground(floor),
            (None, None) => Self::Nothing,
        }
    }
}

impl<'a> Seen<'a> {
    /// What the ray in `lane` meets first.
    pub(super) fn met(&self, lane: usize) -> Met<'a> {
        Met::nearer(self.hits[lane], self.floors[lane])
    }
}

impl Level {
    /// One level further, for a ray of `weight` in its parent.
    pub(super) fn below(self, weight: f32) -> Self {
        Self {
            depth: self.depth + 1,
            weight: self.weight * weight,
        }
    }
}

/// `normal` turned against `direction`.
pub(super) fn facing(normal: Vec3, direction: Vec3) -> Vec3 {
    if direction.dot(normal) < 0.0 {
        normal
    } else {
        -normal
    }
}
