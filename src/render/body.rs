//! Light in one body of one medium. A ray is on one side of its surface; where it crosses to the other it is split
//! by Fresnel's equations, and what it loses inside is Beer's and Lambert's law. `max_depth` counts crossings: the
//! way between them costs nothing, whatever particles lie there.
//!
//! Both children of a crossing are followed while the lesser weighs enough in its sample. Else one of them is, drawn
//! by their weights (Russian roulette; Arvo and Kirk, "Particle transport and image synthesis", 1990); at the first
//! crossing the lesser more often, beside the greater. The mean stays what it was, and so does the sum of weights.
//! Draws come of the place on the film and the path since, so that they do not depend on threads.

use glam::{Vec2, Vec3};

use super::{
    RenderSettings, ShadeSource,
    lights::{DARK, Face, Known, Place},
    sampler::mix,
    tracer::{Level, Scratch, Tracer},
};
use crate::{
    ray::Ray,
    scene::{Scene, ground, material::reflect},
    surface::{Side, Substance, Surface, SurfaceHit},
};

/// Least cosine between a ray and a normal: interpolated normals may turn away from rays that graze.
const GRAZING: f32 = 1e-3;

/// Weight of a child from which on both are followed, times the samples of a pixel: noise that few samples
/// do not even out costs fewer rays than it is worth. Bounded by [`SPLIT_LEAST`] for few samples.
const SPLIT: f32 = 1.0 / 80.0;

/// At the first crossing the lesser child is drawn with this chance where it weighs as much as is split, else in
/// proportion.
const FIRST_CHANCE: f32 = 2.0;

/// A child that weighs this is seen in an image of one sample a pixel.
const SPLIT_LEAST: f32 = 0.02;

/// What is the same for all rays in a body.
pub(super) struct Optics {
    extinction: Vec3,
    is_clear: bool,
    /// A ray whose lesser child weighs this is split.
    pub(super) split: f32,
    /// Cosine below which a highlight is dark.
    highlight: f32,
    /// Whether the surface scatters, so that its colour matters.
    scatters: bool,
    pub(super) wants_albedo: bool,
    /// Whether it matters which particle is seen.
    pub(super) wants_particle: bool,
}

/// The way that a ray came, as a number to draw from.
#[derive(Clone, Copy)]
pub(super) struct Path(u64);

/// A ray on its way.
struct Leg {
    ray: Ray,
    side: Side,
    level: Level,
    path: Path,
}

/// What becomes of a ray at a crossing.
struct Crossing {
    mirrored: Child,
    passed: Child,
}

/// One of the two rays that leave a crossing.
struct Child {
    /// Part of the ray's radiance that comes this way.
    weight: f32,
    ray: Ray,
    side: Side,
    passes: bool,
}

impl Optics {
    pub(super) fn new(scene: &Scene, settings: &RenderSettings) -> Self {
        let material = &scene.material;
        Self {
            extinction: material.extinction,
            is_clear: material.extinction == Vec3::ZERO,
            split: (SPLIT * settings.samples as f32).clamp(SPLIT_LEAST, 1.0),
            highlight: if material.specular > 0.0 {
                DARK.powf(1.0 / material.shininess.max(f32::MIN_POSITIVE))
            } else {
                f32::INFINITY
            },
            scatters: material.ambient > 0.0 || material.diffuse > 0.0,
            wants_albedo: settings.channels.albedo,
            wants_particle: settings.channels.id || settings.channels.velocity,
        }
    }

    /// What is left of white light after a `length` inside.
    #[inline]
    pub(super) fn kept_after(&self, length: f32) -> Vec3 {
        if self.is_clear {
            return Vec3::ONE;
        }
        (-length.max(0.0) * self.extinction).exp()
    }
}

impl Path {
    pub(super) fn from_film(film: Vec2) -> Self {
        Self(mix(
            u64::from(film.x.to_bits()) << 32 | u64::from(film.y.to_bits())
        ))
    }

    pub(super) fn mirrored(self) -> Self {
        Self(mix(self.0.wrapping_add(1)))
    }

    pub(super) fn passed(self) -> Self {
        Self(mix(self.0.wrapping_add(2)))
    }

    /// 0..1 in steps of 2^-24.
    pub(super) fn draw(self) -> f32 {
        (mix(self.0) >> 40) as f32 * (1.0 / 16_777_216.0)
    }
}

impl<S: Surface, C: ShadeSource> Tracer<'_, S, C> {
    /// Light that comes back along a camera `ray`, which starts on `side` and meets the surface at `hit`.
    pub(super) fn through(
        &self,
        ray: &Ray,
        hit: &SurfaceHit,
        side: Side,
        path: Path,
        scratch: &mut Scratch,
    ) -> Vec3 {
        let level = Level {
            depth: 1,
            weight: 1.0,
        };
        let leg = Leg {
            ray: *ray,
            side,
            level,
            path,
        };
        self.follow(leg, Some(*hit), scratch)
    }

    /// Light that comes back along `leg`; `first` is what it meets, where that is known.
    fn follow(&self, mut leg: Leg, mut first: Option<SurfaceHit>, scratch: &mut Scratch) -> Vec3 {
        let mut sum = Vec3::ZERO;
        // Part of the radiance still ahead that belongs to the sum.
        let mut kept = Vec3::ONE;
        loop {
            let ray = &leg.ray;
            let mut floor = None;
            let hit = first.take().or_else(|| {
                floor = self.floor(ray);
                let t_max = floor.as_ref().map_or(ray.t_max, |hit| hit.t);
                self.surface.crossing(&Ray { t_max, ..*ray }, leg.side)
            });
            let Some(hit) = hit else {
                return sum + kept * self.beyond(&leg, floor, scratch);
            };
            if leg.side == Side::Inside {
                kept *= self.optics.kept_after(hit.t);
            }
            if hit.substance == Substance::Spray {
                return sum + kept * self.spray(&leg, &hit, scratch);
            }
            if leg.side == Side::Outside {
                sum += kept * self.gloss(&leg, &hit, scratch);
            }
            let crossing = self.cross(&leg, &hit);
            let Some(next) = self.choose(&leg, crossing, &mut kept, &mut sum, scratch) else {
                return sum;
            };
            leg = next;
        }
    }

    /// Light from where a ray meets no surface any more: the floor, wet where the ray is inside, or the background.
    fn beyond(
        &self,
        leg: &Leg,
        floor: Option<super::floor::GroundHit<'_>>,
        scratch: &mut Scratch,
    ) -> Vec3 {
        match floor {
            // Inside, that is a crack in the surface.
            None => self.scene.background.color(leg.ray.direction),
            Some(hit) => {
                let seen = self.ground_radiance(&leg.ray, &hit, leg.side, scratch);
                match leg.side {
                    Side::Outside => seen,
                    Side::Inside => self.optics.kept_after(hit.t) * seen,
                }
            }
        }
    }

    /// Goes on with one child of a crossing, after the other was added to the `sum` if it weighs enough; None
    /// where the path ends.
    fn choose(
        &self,
        leg: &Leg,
        crossing: Crossing,
        kept: &mut Vec3,
        sum: &mut Vec3,
        scratch: &mut Scratch,
    ) -> Option<Leg> {
        let weight = leg.level.weight;
        let Crossing { mirrored, passed } = crossing;
        let both = mirrored.weight + passed.weight;
        let seen = weight * kept.max_element();
        if leg.level.depth >= self.max_depth {
            for child in [mirrored, passed] {
                *sum += *kept * child.weight * self.scene.background.color(child.ray.direction);
            }
            return None;
        }
        let is_mirror_lesser = mirrored.weight < passed.weight;
        let lesser = mirrored.weight.min(passed.weight);
        let splits = lesser > 0.0 && seen * lesser >= self.optics.split;
        // What the camera sees first is seen best, so the lesser child is drawn more often there, with less
        // weight. Together the two always weigh the same.
        let is_first = leg.level.depth == 1;
        let share = lesser / both.max(f32::MIN_POSITIVE);
        let chance = match (splits, is_first) {
            (true, _) => 1.0,
            (false, true) => {
                let often = FIRST_CHANCE * seen * lesser / self.optics.split;
                often.min(1.0).max(share)
            }
            (false, false) => share,
        };
        let (greater, other) = if is_mirror_lesser {
            (passed, mirrored)
        } else {
            (mirrored, passed)
        };
        let is_drawn = lesser > 0.0 && leg.path.draw() < chance;
        let (taken, part) = if !is_drawn {
            (greater, both)
        } else if splits || is_first {
            let part = lesser / chance;
            let level = Level {
                depth: leg.level.depth + 1,
                weight: seen * part,
            };
            let other = other.leg(leg.path, level, scratch);
            *sum += *kept * part * self.follow(other, None, scratch);
            (greater, both - part)
        } else {
            (other, both)
        };
        if part <= 0.0 {
            return None;
        }
        *kept *= part;
        let level = Level {
            depth: leg.level.depth + 1,
            weight,
        };
        Some(taken.leg(leg.path, level, scratch))
    }

    /// Splits a ray where it crosses the surface.
    fn cross(&self, leg: &Leg, hit: &SurfaceHit) -> Crossing {
        let material = &self.scene.material;
        let direction = leg.ray.direction;
        // Light is bent by the normal to shade by, and goes on from off the surface that rays meet.
        let (outward, shading, ratio) = match leg.side {
            Side::Outside => (hit.normal, hit.shading, 1.0 / material.ior),
            Side::Inside => (-hit.normal, -hit.shading, material.ior),
        };
        let normal = against(shading, direction);
        let cosine = -direction.dot(normal);
        let r = material.mirrored(cosine, ratio);
        let sin2_out = ratio * ratio * (1.0 - cosine * cosine).max(0.0);
        let r = if sin2_out < 1.0 { r } else { 1.0 };
        let along_normal = ratio * cosine - (1.0 - sin2_out).max(0.0).sqrt();
        let onward = (ratio * direction + along_normal * normal).normalize_or(direction);
        let step = hit.offset * outward;
        Crossing {
            mirrored: Child {
                weight: material.reflection * r,
                ray: Ray::new(hit.anchor + step, reflect(direction, normal)),
                side: leg.side,
                passes: false,
            },
            passed: Child {
                weight: material.transmission * (1.0 - r),
                ray: Ray::new(hit.anchor - step, onward),
                side: leg.side.other(),
                passes: true,
            },
        }
    }

    /// What the surface itself sends back, seen from outside: ambient and scattered light, highlights.
    fn gloss(&self, leg: &Leg, hit: &SurfaceHit, scratch: &mut Scratch) -> Vec3 {
        let optics = &self.optics;
        if optics.scatters {
            let face = self.face(leg, hit, scratch);
            return self.direct(&face, None, scratch);
        }
        if optics.highlight > 1.0 {
            return Vec3::ZERO;
        }
        let material = &self.scene.material;
        let mut sum = Vec3::ZERO;
        let place = place(leg, hit);
        for light in &self.scene.lights {
            let Some(incident) = light.at(place.start) else {
                continue;
            };
            let half = incident.to_light - leg.ray.direction;
            let cosine = place.normal.dot(half) / half.length();
            // Most are dark, and need no shadow ray.
            let is_bright = place.normal.dot(incident.to_light) > 0.0 && cosine > optics.highlight;
            if !is_bright {
                continue;
            }
            let highlight = material.specular * cosine.powf(material.shininess);
            let visible = match light.casts_shadow {
                true => self.visibility(place, &incident, scratch),
                false => Vec3::ONE,
            };
            sum += highlight * visible * incident.radiance;
        }
        sum
    }

    /// A white ball of spray.
    fn spray(&self, leg: &Leg, hit: &SurfaceHit, scratch: &mut Scratch) -> Vec3 {
        let face = self.face(leg, hit, scratch);
        self.scattered(&face, None, scratch)
    }

    /// Light that an opaque white surface scatters.
    pub(super) fn scattered(
        &self,
        face: &Face,
        lit: Option<Known<'_>>,
        scratch: &mut Scratch,
    ) -> Vec3 {
        let mut sum = ground::AMBIENT * self.scene.ambient_light;
        for (light, cosine, visible) in self.lights(face.place, lit, scratch) {
            sum += ground::DIFFUSE * cosine * visible * light.radiance;
        }
        sum * face.base
    }

    fn face(&self, leg: &Leg, hit: &SurfaceHit, scratch: &mut Scratch) -> Face {
        Face {
            place: place(leg, hit),
            to_viewer: -leg.ray.direction,
            base: self.base(hit, scratch),
        }
    }
}

impl Child {
    fn leg(self, path: Path, level: Level, scratch: &mut Scratch) -> Leg {
        let path = if self.passes {
            scratch.counts.refraction += 1;
            path.passed()
        } else {
            scratch.counts.reflection += 1;
            path.mirrored()
        };
        Leg {
            ray: self.ray,
            side: self.side,
            level,
            path,
        }
    }
}

/// Where `leg` meets the surface, or spray, on its side of it.
fn place(leg: &Leg, hit: &SurfaceHit) -> Place {
    // Spray has its own normals, the body those of its outside.
    let (outward, shading) = match (hit.substance, leg.side) {
        (Substance::Body, Side::Inside) => (-hit.normal, -hit.shading),
        _ => (hit.normal, hit.shading),
    };
    Place {
        start: hit.anchor + hit.offset * outward,
        normal: against(shading, leg.ray.direction),
        side: leg.side,
    }
}

/// `normal`, turned against `direction` as little as it takes.
fn against(normal: Vec3, direction: Vec3) -> Vec3 {
    let along = direction.dot(normal);
    if along <= -GRAZING {
        return normal;
    }
    (normal - (along + GRAZING) * direction).normalize_or(-direction)
}
