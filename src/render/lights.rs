//! Light that comes straight from lights, and what stands in its way.
//!
//! Shadow rays go straight on through transmissive bodies, so there are no caustics. They are dimmed by
//! `transmission*(1-r)` at each crossing of a surface, with `r` for the angle outside on both sides of it (a ray
//! that was bent there would have come from such an angle, and is never reflected totally), and by what
//! one body absorbs.

use glam::Vec3;

use super::{
    ShadeSource,
    tracer::{Met, Scratch, Seen, Tracer, facing},
};
use crate::{
    ray::{PACKET_SIZE, Ray, RayPacket},
    scene::light::Incident,
    surface::{Side, Substance, Surface, SurfaceHit},
};

/// Most crossings of one body that a shadow ray is followed through.
const MAX_CROSSINGS: u32 = 64;

/// Light below this part is dark.
pub(super) const DARK: f32 = 1.0 / 4096.0;

/// Which lights reach the places that a packet of rays met.
#[derive(Debug, Default)]
pub(super) struct Lit {
    /// For each light, a bit for each lane that it reaches.
    whole: Vec<u32>,
    /// For each light, what of it reaches the other lanes; may be missing if that is nothing.
    dimmed: Vec<[Vec3; PACKET_SIZE]>,
}

/// The lights that reach the place that one ray of a packet met.
#[derive(Clone, Copy)]
pub(super) struct Known<'a> {
    /// The ray's lane.
    pub(super) lane: usize,
    pub(super) lit: &'a Lit,
}

/// A place that light comes to.
#[derive(Clone, Copy)]
pub(super) struct Place {
    /// Where shadow rays start.
    pub(super) start: Vec3,
    /// Unit normal on the side that is lit.
    pub(super) normal: Vec3,
    /// Where it is of one body.
    pub(super) side: Side,
}

impl Place {
    /// The place of `hit` that a ray along `direction` sees: lit as the normal says that it is shaded by, from
    /// off the surface.
    pub(super) fn of(hit: &SurfaceHit, direction: Vec3, side: Side) -> Self {
        let shading = facing(hit.shading, direction);
        let off = hit.anchor + hit.offset * facing(hit.normal, direction);
        Self {
            start: off + hit.lift * shading,
            normal: shading,
            side,
        }
    }
}

/// The side of a surface that a ray sees.
pub(super) struct Face {
    pub(super) place: Place,
    /// Unit vector back along the ray.
    pub(super) to_viewer: Vec3,
    pub(super) base: Vec3,
}

impl<S: Surface, C: ShadeSource> Tracer<'_, S, C> {
    /// Finds for each light which of the places that are `seen` it reaches, with packets of shadow rays. Returns
    /// whether they are worth it: rays through transmissive spheres ask for crossings, one by one.
    pub(super) fn light_up(
        &self,
        seen: &Seen<'_>,
        side: Side,
        lit: &mut Lit,
        scratch: &mut Scratch,
    ) -> bool {
        let is_opaque = self.scene.material.transmission <= 0.0;
        if !is_opaque && (!S::ONE_BODY || side == Side::Inside) {
            return false;
        }
        let mut places = [None; PACKET_SIZE];
        for (lane, place) in places.iter_mut().enumerate().take(seen.rays.len()) {
            *place = match seen.met(lane) {
                Met::Ground(hit) => Some(hit.place(side)),
                Met::Particle(hit) if is_opaque => {
                    Some(Place::of(&hit, seen.rays.ray(lane).direction, side))
                }
                // What is seen through a surface is not known yet.
                Met::Particle(_) | Met::Nothing => None,
            };
        }
        lit.whole.clear();
        lit.dimmed.clear();
        for light in &self.scene.lights {
            let mut rays = RayPacket::default();
            let mut lanes = [0; PACKET_SIZE];
            for (lane, place) in places.iter().enumerate() {
                let Some(place) = *place else {
                    continue;
                };
                let Some(incident) = light.at(place.start) else {
                    continue;
                };
                if !light.casts_shadow || place.normal.dot(incident.to_light) <= 0.0 {
                    continue;
                }
                scratch.counts.shadow += 1;
                let ray = shadow_ray(place.start, &incident);
                if !self.is_under_ground(&ray) {
                    lanes[rays.len()] = lane;
                    rays.push(&ray);
                }
            }
            let lanes = &lanes[..rays.len()];
            let blocked = match (rays.is_empty(), is_opaque) {
                (true, _) => 0,
                (false, true) => self.surface.occluded_packet(&rays),
                (false, false) => self.dim(&rays, lanes, lit),
            };
            let reached = lanes.iter().enumerate();
            let reached = reached.filter(|(ray, _)| blocked >> ray & 1 == 0);
            lit.whole
                .push(reached.fold(0, |lit, (_, lane)| lit | 1 << lane));
            // Also of lights that no ray goes to.
            if !is_opaque && lit.dimmed.len() < lit.whole.len() {
                lit.dimmed.push([Vec3::ZERO; PACKET_SIZE]);
            }
        }
        true
    }

    /// Follows `rays`, which start in the open, through one body: what is left of each goes to its lane of
    /// another light in `lit`. Returns a bit for each ray that meets the body at all.
    fn dim(&self, rays: &RayPacket, lanes: &[usize], lit: &mut Lit) -> u32 {
        let hits = self.surface.nearest_packet(rays);
        let mut kept = [Vec3::ZERO; PACKET_SIZE];
        let mut met = 0;
        for (ray, lane) in lanes.iter().enumerate() {
            if let Some(hit) = hits[ray] {
                met |= 1 << ray;
                kept[*lane] = self.kept_from(&rays.ray(ray), Side::Outside, Some(hit));
            }
        }
        lit.dimmed.push(kept);
        met
    }

    /// Ambient light and Blinn-Phong for every light that gets through.
    pub(super) fn direct(
        &self,
        face: &Face,
        lit: Option<Known<'_>>,
        scratch: &mut Scratch,
    ) -> Vec3 {
        let material = &self.scene.material;
        let normal = face.place.normal;
        let mut sum = material.ambient * self.scene.ambient_light * face.base;
        for (light, cosine, visible) in self.lights(face.place, lit, scratch) {
            let half = (light.to_light + face.to_viewer).normalize_or(normal);
            let highlight = normal.dot(half).max(0.0).powf(material.shininess);
            let reflected = material.diffuse * cosine * face.base + material.specular * highlight;
            sum += visible * light.radiance * reflected;
        }
        sum
    }

    /// The lights that reach `place`, with cosine and the part let through.
    pub(super) fn lights(
        &self,
        place: Place,
        lit: Option<Known<'_>>,
        scratch: &mut Scratch,
    ) -> impl Iterator<Item = (Incident, f32, Vec3)> {
        let lights = self.scene.lights.iter().enumerate();
        lights.filter_map(move |(number, light)| {
            let incident = light.at(place.start)?;
            let cosine = place.normal.dot(incident.to_light);
            if cosine <= 0.0 {
                return None;
            }
            let visible = match lit {
                _ if !light.casts_shadow => Vec3::ONE,
                Some(lit) => lit.by(number),
                None => self.visibility(place, &incident, scratch),
            };
            (visible != Vec3::ZERO).then_some((incident, cosine, visible))
        })
    }

    /// Part of a light's radiance that gets to `place`.
    pub(super) fn visibility(&self, place: Place, light: &Incident, scratch: &mut Scratch) -> Vec3 {
        let ray = shadow_ray(place.start, light);
        scratch.counts.shadow += 1;
        if self.is_under_ground(&ray) {
            return Vec3::ZERO;
        }
        let material = &self.scene.material;
        if material.transmission <= 0.0 {
            return if self.surface.occluded(&ray) {
                Vec3::ZERO
            } else {
                Vec3::ONE
            };
        }
        if S::ONE_BODY {
            return self.kept_from(&ray, place.side, None);
        }
        let kept = |cosine: f32| self.passed(cosine);
        Vec3::splat(self.surface.transmittance(&ray, kept))
    }

    /// What a shadow ray keeps at a crossing at the absolute `cosine` with the normal.
    fn passed(&self, cosine: f32) -> f32 {
        let material = &self.scene.material;
        material.transmission * (1.0 - material.mirrored(cosine, 1.0 / material.ior))
    }

    /// What is left of light that comes along `ray`, a shadow ray that starts on `side` of one body. `first`
    /// is its first crossing, where that is known.
    fn kept_from(&self, ray: &Ray, mut side: Side, mut first: Option<SurfaceHit>) -> Vec3 {
        let mut kept = Vec3::ONE;
        let mut ahead = *ray;
        let mut from = ray.t_min;
        for _ in 0..MAX_CROSSINGS {
            let hit = match first.take() {
                Some(hit) => Some(hit),
                None => self.surface.crossing(&ahead, side),
            };
            // A way inside that has no end is a crack in the surface, and its length unknown.
            let end = hit.map_or(ray.t_max, |hit| hit.t);
            if side == Side::Inside && end.is_finite() {
                kept *= self.optics.kept_after(end - from);
            }
            let Some(hit) = hit else {
                return kept;
            };
            if hit.substance == Substance::Spray {
                return Vec3::ZERO;
            }
            kept *= self.passed(hit.normal.dot(ray.direction).abs());
            if kept.max_element() < DARK {
                return Vec3::ZERO;
            }
            from = hit.t;
            ahead.t_min = hit.t + hit.offset;
            side = side.other();
        }
        kept
    }
}

impl Known<'_> {
    /// Part of light `number` that gets here.
    fn by(self, number: usize) -> Vec3 {
        if self.lit.whole[number] >> self.lane & 1 == 1 {
            Vec3::ONE
        } else {
            let dimmed = self.lit.dimmed.get(number);
            dimmed.map_or(Vec3::ZERO, |dimmed| dimmed[self.lane])
        }
    }
}

/// The ray from `start` to a light.
fn shadow_ray(start: Vec3, light: &Incident) -> Ray {
    Ray {
        t_max: light.distance,
        ..Ray::new(start, light.to_light)
    }
}
