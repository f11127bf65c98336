//! Whitted's recursion with the intensities of the thesis:
//! `I = ambient + sum of lights + reflection*r*S + transmission*(1-r)*T` (eq. 4.1), Blinn-Phong per
//! light (4.2, program 3.1), `r` by Schlick (4.3). Both weights 1 give 4.1 to the letter.
//!
//! Normals face the ray that sees them, as the thesis's `faceforward` does, so a surface seen from
//! inside is lit from inside. Under total internal reflection `r` is 1.

use glam::Vec3;

use super::{
    RayCounts, ShadeSource,
    lights::{Face, Known, Place},
    tracer::{Level, Met, Scratch, Tracer, facing},
};
use crate::{
    ray::Ray,
    scene::material::{reflect, refract},
    surface::{Side, Substance, Surface, SurfaceHit},
};

impl<'a, S: Surface, C: ShadeSource> Tracer<'a, S, C> {
    fn meet(&self, ray: &Ray) -> Met<'a> {
        let floor = self.floor(ray);
        let t_max = floor.as_ref().map_or(ray.t_max, |hit| hit.t);
        Met::nearer(self.surface.nearest(&Ray { t_max, ..*ray }), floor)
    }

    /// Light that comes back along `ray`.
    fn radiance(&self, ray: &Ray, level: Level, scratch: &mut Scratch) -> Vec3 {
        match self.meet(ray) {
            Met::Nothing => self.scene.background.color(ray.direction),
            Met::Particle(hit) => self.shade(ray, &hit, level, None, scratch),
            Met::Ground(hit) => self.ground_radiance(ray, &hit, Side::Outside, scratch),
        }
    }

    /// Eq. 4.1 at `hit`; `lit` where that is known.
    pub(super) fn shade(
        &self,
        ray: &Ray,
        hit: &SurfaceHit,
        level: Level,
        lit: Option<Known<'_>>,
        scratch: &mut Scratch,
    ) -> Vec3 {
        let material = &self.scene.material;
        let direction = ray.direction;
        let entering = direction.dot(hit.normal) < 0.0;
        let normal = facing(hit.normal, direction);
        let start = hit.anchor + hit.offset * normal;
        let face = Face {
            place: Place::of(hit, direction, Side::Outside),
            to_viewer: -direction,
            base: self.base(hit, scratch),
        };
        if hit.substance == Substance::Spray {
            return self.scattered(&face, lit, scratch);
        }
        let mut intensity = self.direct(&face, lit, scratch);

        let ratio = if entering {
            1.0 / material.ior
        } else {
            material.ior
        };
        let refracted = refract(direction, normal, ratio);
        let r = match refracted {
            Some(_) => material.mirrored(-direction.dot(normal), ratio),
            None => 1.0,
        };
        let mirrored = material.reflection * r;
        if mirrored > 0.0 {
            let next = Ray::new(start, reflect(direction, normal));
            let level = level.below(mirrored);
            let traced = |counts: &mut RayCounts| counts.reflection += 1;
            intensity += mirrored * self.secondary(&next, level, scratch, traced);
        }
        let passed = material.transmission * (1.0 - r);
        if let Some(onward) = refracted
            && passed > 0.0
        {
            let next = Ray::new(hit.anchor - hit.offset * normal, onward);
            let level = level.below(passed);
            let traced = |counts: &mut RayCounts| counts.refraction += 1;
            intensity += passed * self.secondary(&next, level, scratch, traced);
        }
        if !entering {
            // The ray came through the sphere that it leaves here.
            intensity *= self.optics.kept_after(hit.t);
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
}
