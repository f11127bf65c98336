//! The isosurface of the SPH colour field of the particles, ray traced without a mesh.
//!
//! The field is sampled near the surface, in bricks of 8x8x8 voxels at multiples of their edge, so that the grid does
//! not move from frame to frame. Crowded particles are blurred on that grid, isolated ones are not, so that bumps
//! disappear and drops remain. Rays traverse a sparse tree of bricks and solve for the intersection in a voxel. In
//! exact mode, intersection and normal are then refined with the particles.

use glam::Vec3;

use super::field::FieldParticles;
use super::shape::crossing_of_packet;
use super::{Intersection, Intersections, Shape, Side, SurfaceSettings};
use spherule_tree::accel::Coherence;
use spherule_tree::math::{Supported, first_lanes, lanes_in};
use spherule_tree::ray::{Ray, RayPacket};

mod blocks;
mod blur;
mod brick;
mod build;
mod exact;
mod layout;
mod raw;
mod root;
mod size;
mod steps;
mod traversal;
mod tree;

use build::Built;
pub use build::{SmoothError, SmoothReport};
pub use size::GridSize;
use traversal::Crossings;

/// Step off the surface in voxels, larger than the rounding of positions in a voxel.
const OFFSET: f32 = 0.01;
/// Step off the surface in units of the rounding of the largest coordinate involved.
const OFFSET_OF_ROUNDING: f32 = 16.0 * f32::EPSILON;

/// The surface of a frame. Building the next one releases its memory.
#[derive(Debug, Default)]
pub struct SmoothGrid {
    built: Built,
}

impl SmoothGrid {
    /// Builds the surface of particles with `centers` and one `radius`. With `keep_particles`, particles near a point
    /// can be queried. The build may use `memory_left` bytes.
    ///
    /// # Errors
    /// [`SmoothError::TooLarge`] before any large allocation.
    pub fn build(
        &mut self,
        centers: &[Vec3],
        radius: f32,
        settings: &SurfaceSettings,
        keep_particles: bool,
        memory_left: Option<u64>,
    ) -> Result<SmoothReport, SmoothError> {
        // Release the memory of the previous surface first.
        self.built = Built::default();
        let (made, report) = build::build(centers, radius, settings, keep_particles, memory_left)?;
        self.built = made;
        Ok(report)
    }

    /// Leaves the attributes of points to the first `count` particles; the others only shape the surface.
    pub fn set_own_particles(&mut self, count: u32) {
        self.built.own = Some(count);
    }

    /// The surface as a shape.
    pub fn surface(&self) -> SmoothSurface<'_> {
        SmoothSurface { built: &self.built, simd: Supported::default() }
    }
}

/// The surface as a shape, see the module.
#[derive(Debug, Clone, Copy)]
pub struct SmoothSurface<'a> {
    built: &'a Built,
    simd: Supported,
}

impl SmoothSurface<'_> {
    #[inline(always)]
    fn hit(&self, ray: &Ray, crossings: &Crossings, lane: usize, from: Side) -> Intersection {
        // Find the point, and the direction against the ray
        let tree = &self.built.tree;
        let t = crossings.t[lane];
        let point = ray.at(t);
        let against = match from {
            Side::Outside => -ray.direction,
            Side::Inside => ray.direction,
        };
        // Compute the normal from the gradient of the field; without one, it points against the ray
        let brick = crossings.brick(lane);
        let gradient =
            brick.map(|(brick, position)| tree.bricks[brick as usize].gradient(position));
        let normal = gradient.and_then(|gradient| (-gradient).try_normalize()).unwrap_or(against);
        // Compute an offset above the rounding of the point
        let largest = point.abs().max(ray.origin.abs()).max_element();
        let hit = Intersection {
            t,
            point,
            normal,
            shading: normal,
            lift: 0.0,
            radius: f32::INFINITY,
            particle: 0,
            offset: (OFFSET * tree.voxel()).max(OFFSET_OF_ROUNDING * largest),
            anchor: point,
        };
        // Refine point and normal with the exact field, if it is kept
        match (&self.built.field, &self.built.exact) {
            (Some(field), Some(layout)) => exact::refine(field, layout, ray, hit),
            _ => hit,
        }
    }

    fn field(&self) -> Option<&FieldParticles> {
        self.built.field.as_ref()
    }

    /// The particle nearest to `point`, if particles are kept and one is within the support.
    pub(crate) fn nearest_particle(&self, point: Vec3) -> Option<u32> {
        let field = self.field()?;
        match self.built.own {
            Some(count) => field.nearest_of(point, count),
            None => field.nearest(point),
        }
    }
}

impl Shape for SmoothSurface<'_> {
    fn crossing(&self, ray: &Ray, side: Side) -> Option<Intersection> {
        crossing_of_packet(self, ray, side)
    }

    fn is_connected(&self) -> bool {
        true
    }

    fn side_of(&self, point: Vec3) -> Side {
        self.built.tree.side_of(point)
    }

    fn intersect(
        &self,
        rays: &mut RayPacket,
        _coherence: Coherence,
        inside: u32,
        hits: &mut Intersections,
    ) {
        let lanes = first_lanes(rays.len());
        let tree = &self.built.tree;
        let mut crossings = Crossings::default();
        tree.first_crossings(self.simd, rays, lanes, inside, &mut crossings);
        for lane in lanes_in(crossings.mask) {
            let from = Side::of_lane(inside, lane);
            let hit = self.hit(&rays.ray(lane), &crossings, lane, from);
            hits.end_ray(rays, lane, &hit, self.material());
        }
    }

    fn occluded(&self, rays: &RayPacket, _coherence: Coherence, lanes: u32) -> u32 {
        if lanes == 0 {
            return 0;
        }
        let tree = &self.built.tree;
        let mut crossings = Crossings::default();
        tree.first_crossings(self.simd, rays, lanes, 0, &mut crossings);
        crossings.mask
    }

    fn particle_at(&self, hit: &Intersection) -> u32 {
        self.nearest_particle(hit.point).unwrap_or(hit.particle)
    }

    fn blend(&self, hit: &Intersection, each: &mut dyn FnMut(u32, f32)) {
        let mut found = false;
        self.blend_at(hit.point, 0.0, &mut |index, part| {
            found = true;
            each(index, part);
        });
        if !found {
            each(hit.particle, 1.0);
        }
    }

    fn blend_at(&self, point: Vec3, _time: f32, each: &mut dyn FnMut(u32, f32)) {
        if let Some(field) = self.field() {
            field.neighbours(point, &mut |index, part| {
                if self.built.own.is_none_or(|count| index < count) {
                    each(index, part);
                }
            });
        }
    }
}

#[cfg(test)]
mod tests;
