//! The floor: where rays meet it, and what it looks like there.

use glam::Vec3;

use super::{
    ShadeSource,
    aov::{DataSample, NO_ID},
    lights::{Known, Place},
    tracer::{PixelSample, Scratch, Tracer},
};
use crate::{
    ray::Ray,
    scene::{Ground, ground},
    surface::{Side, Surface},
};

/// A visible piece of floor.
#[derive(Clone, Copy)]
pub(super) struct GroundHit<'a> {
    pub(super) ground: &'a Ground,
    pub(super) t: f32,
    point: Vec3,
    /// How much of the floor is left here.
    presence: f32,
}

impl<'a, S: Surface, C: ShadeSource> Tracer<'a, S, C> {
    /// The floor where `ray` meets it, if anything is left of it there.
    pub(super) fn floor(&self, ray: &Ray) -> Option<GroundHit<'a>> {
        let ground = self.scene.ground.as_ref()?;
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

    /// What the camera sees of the floor, from `side` of one body.
    pub(super) fn ground_sample(
        &self,
        ray: &Ray,
        hit: &GroundHit<'_>,
        side: Side,
        lit: Option<Known<'_>>,
        scratch: &mut Scratch,
    ) -> PixelSample {
        let mut lit = self.shade_ground(hit, side, lit, scratch);
        if side == Side::Inside {
            lit *= self.optics.kept_after(hit.t);
        }
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
                albedo: hit.ground.color_at(hit.point),
                id: NO_ID,
            },
        }
    }

    /// Light that comes back along `ray` from the floor, and through it where it fades.
    pub(super) fn ground_radiance(
        &self,
        ray: &Ray,
        hit: &GroundHit<'_>,
        side: Side,
        scratch: &mut Scratch,
    ) -> Vec3 {
        let background = self.scene.background.color(ray.direction);
        background.lerp(self.shade_ground(hit, side, None, scratch), hit.presence)
    }

    fn shade_ground(
        &self,
        hit: &GroundHit<'_>,
        side: Side,
        lit: Option<Known<'_>>,
        scratch: &mut Scratch,
    ) -> Vec3 {
        let place = hit.place(side);
        let mut light_sum = ground::AMBIENT * self.scene.ambient_light;
        for (light, cosine, visible) in self.lights(place, lit, scratch) {
            light_sum += ground::DIFFUSE * cosine * visible * light.radiance;
        }
        hit.ground.color_at(hit.point) * light_sum
    }

    /// Whether the floor stands in the way of `ray`.
    pub(super) fn is_under_ground(&self, ray: &Ray) -> bool {
        let ground = self.scene.ground.as_ref();
        ground.is_some_and(|g| g.hit(ray).is_some())
    }
}

impl GroundHit<'_> {
    /// A point just off the floor, where shadow rays start.
    pub(super) fn place(&self, side: Side) -> Place {
        let up = self.ground.up;
        Place {
            start: self.point + self.ground.offset(self.point, self.t) * up,
            normal: up,
            side,
        }
    }
}
