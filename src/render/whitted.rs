//! Whitted's recursion with the intensities of the thesis:
//! `I = ambient + sum of lights + reflection*r*S + transmission*(1-r)*T` (eq. 4.1), Blinn-Phong per
//! light (4.2, program 3.1), `r` by Schlick (4.3). Both weights 1 give 4.1 to the letter.
//!
//! Normals face the ray that sees them, as the thesis's `faceforward` does, so a surface seen from
//! inside is lit from inside. Under total internal reflection `r` is 1.
//!
//! Followed to the letter, eq. 4.1 doubles the rays at each level. So both branches are followed only while the
//! lesser one has a path weight of at least `min_weight`; below that one of them is drawn (Russian roulette; Arvo
//! and Kirk, "Particle transport and image synthesis", 1990). The path weights of a sample never add up to more
//! than 1, so at most `1 / min_weight` of its paths are alive at any depth.

use glam::Vec3;

use super::{
    RayCounts, ShadeSource,
    body::Path,
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
    fn radiance(&self, ray: &Ray, level: Level, path: Path, scratch: &mut Scratch) -> Vec3 {
        match self.meet(ray) {
            Met::Nothing => self.scene.background.color(ray.direction),
            Met::Particle(hit) => self.shade(ray, &hit, level, path, None, scratch),
            Met::Ground(hit) => self.ground_radiance(ray, &hit, Side::Outside, scratch),
        }
    }

    /// Eq. 4.1 at `hit`; `lit` where that is known.
    pub(super) fn shade(
        &self,
        ray: &Ray,
        hit: &SurfaceHit,
        level: Level,
        path: Path,
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
        // Behind a ray that leaves here lies the way through the sphere.
        let transmittance = if entering {
            Vec3::ONE
        } else {
            self.optics.kept_after(hit.t)
        };
        let path_weight = level.weight * transmittance.max_element();
        let level = Level {
            weight: path_weight,
            ..level
        };
        let weights = [
            material.reflection * r,
            match refracted {
                Some(_) => material.transmission * (1.0 - r),
                None => 0.0,
            },
        ];
        let [mirrored, passed] = self.branch_weights(weights, level, path);
        if mirrored > 0.0 {
            let next = Ray::new(start, reflect(direction, normal));
            let level = level.below(mirrored);
            let traced = |counts: &mut RayCounts| counts.reflection += 1;
            intensity += mirrored * self.secondary(&next, level, path.mirrored(), scratch, traced);
        }
        if let Some(onward) = refracted
            && passed > 0.0
        {
            let next = Ray::new(hit.anchor - hit.offset * normal, onward);
            let level = level.below(passed);
            let traced = |counts: &mut RayCounts| counts.refraction += 1;
            intensity += passed * self.secondary(&next, level, path.passed(), scratch, traced);
        }
        if !entering {
            intensity *= transmittance;
        }
        intensity
    }

    /// The weights with which the reflected and the refracted branch of a hit are followed: their own while the
    /// lesser one has a path weight of at least `min_weight`. Else one branch is drawn with probability
    /// proportional to its weight and has the weight of both, so that the mean stays the same.
    fn branch_weights(&self, weights: [f32; 2], level: Level, path: Path) -> [f32; 2] {
        let [mirrored, passed] = weights;
        let lesser = mirrored.min(passed);
        // Where the recursion ends, both branches see the background without a ray.
        let ends = level.depth >= self.max_depth;
        if lesser <= 0.0 || ends || level.weight * lesser >= self.min_weight {
            return weights;
        }
        let both = mirrored + passed;
        if path.draw() * both < mirrored {
            [both, 0.0]
        } else {
            [0.0, both]
        }
    }

    /// Light along a reflected or refracted ray: the background where the recursion ends.
    fn secondary(
        &self,
        ray: &Ray,
        level: Level,
        path: Path,
        scratch: &mut Scratch,
        traced: impl FnOnce(&mut RayCounts),
    ) -> Vec3 {
        if level.depth > self.max_depth {
            return self.scene.background.color(ray.direction);
        }
        traced(&mut scratch.counts);
        self.radiance(ray, level, path, scratch)
    }
}
