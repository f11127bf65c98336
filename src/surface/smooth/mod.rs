//! The isosurface of the particles' SPH colour field, cast without a mesh.
//!
//! The field is sampled where the surface passes: in bricks of 8x8x8 voxels that lie at multiples of their edge,
//! so that it does not swim from frame to frame. Particles in company are blurred on that grid, lonely ones are
//! left as they are, so that bumps go and drops stay. Rays step through a sparse tree of bricks and solve
//! for the crossing in the voxel. Exactly, crossing and normal are then taken from the particles.

use glam::Vec3;

use super::field::FieldParticles;
use super::{Intersection, Intersections, MaterialId, Shape, Side, SurfaceSettings};
use crate::accel::Coherence;
use crate::accel::simd::{ArrayLanes, ArrayTask};
use crate::math::lanes_in;
use crate::ray::{Ray, RayPacket};

mod blocks;
mod blur;
mod brick;
mod build;
mod exact;
mod layout;
mod near;
mod raw;
mod root;
mod tree;

use build::Built;
pub use build::{SmoothError, SmoothReport};
use tree::Meeting;

/// Step off the surface in voxels: beyond the rounding of places in it.
const OFFSET: f32 = 0.01;
/// Step off the surface in units of the rounding of the largest coordinate involved.
const OFFSET_OF_ROUNDING: f32 = 16.0 * f32::EPSILON;

/// The surface of a frame. Its memory is let go for the next one.
#[derive(Debug, Default)]
pub struct SmoothGrid {
    built: Built,
}

impl SmoothGrid {
    /// Builds the surface of particles with `centers` and one `radius`. With `keep_particles` it can tell which
    /// particles are near a place. `memory_left` bytes may be taken.
    ///
    /// # Errors
    /// [`SmoothError::TooLarge`] before anything large is made.
    pub fn build(
        &mut self,
        centers: &[Vec3],
        radius: f32,
        settings: &SurfaceSettings,
        keep_particles: bool,
        memory_left: Option<u64>,
    ) -> Result<SmoothReport, SmoothError> {
        // Before the next one is made.
        self.built = Built::default();
        let (made, report) = build::build(centers, radius, settings, keep_particles, memory_left)?;
        self.built = made;
        Ok(report)
    }

    /// As rays see it.
    pub fn surface(&self) -> SmoothSurface<'_> {
        SmoothSurface {
            built: &self.built,
            lanes: ArrayLanes::default(),
        }
    }
}

/// See the module.
#[derive(Debug, Clone, Copy)]
pub struct SmoothSurface<'a> {
    built: &'a Built,
    lanes: ArrayLanes,
}

/// A crossing, compiled for the machine.
struct Cross<'a> {
    surface: &'a SmoothSurface<'a>,
    ray: &'a Ray,
    from: Side,
}

impl ArrayTask for Cross<'_> {
    type Output = Option<Intersection>;

    #[inline(always)]
    fn run(self) -> Option<Intersection> {
        let tree = &self.surface.built.tree;
        let meeting = tree.first_crossing(self.ray, self.from)?;
        Some(self.surface.hit(self.ray, &meeting, self.from))
    }
}

/// The first crossing of each ray of a packet.
struct CrossPacket<'a> {
    surface: &'a SmoothSurface<'a>,
    rays: &'a mut RayPacket,
    inside: u32,
    coherence: Coherence,
    hits: &'a mut Intersections,
}

impl ArrayTask for CrossPacket<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let built = self.surface.built;
        let is_together = self.coherence == Coherence::Coherent && self.inside == 0;
        let free = if is_together {
            built.near.free_way(self.rays)
        } else {
            f32::NEG_INFINITY
        };
        for lane in 0..self.rays.len() {
            let Some(ray) = near::rest_of(&self.rays.ray(lane), free) else {
                continue;
            };
            let from = Side::of_lane(self.inside, lane);
            if let Some(meeting) = built.tree.first_crossing(&ray, from) {
                let hit = self.surface.hit(&ray, &meeting, from);
                self.hits.set(lane, &hit, MaterialId::PARTICLES);
                self.rays.t_max[lane] = hit.t;
            }
        }
    }
}

/// Which rays of a packet meet anything.
struct OccludePacket<'a> {
    surface: &'a SmoothSurface<'a>,
    rays: &'a RayPacket,
    coherence: Coherence,
    lanes: u32,
}

impl ArrayTask for OccludePacket<'_> {
    type Output = u32;

    #[inline(always)]
    fn run(self) -> u32 {
        let built = self.surface.built;
        let free = match self.coherence {
            Coherence::Coherent => built.near.free_way(self.rays),
            Coherence::Incoherent => f32::NEG_INFINITY,
        };
        lanes_in(self.lanes).fold(0, |occluded, lane| {
            let rest = near::rest_of(&self.rays.ray(lane), free);
            let met = rest.and_then(|ray| built.tree.first_crossing(&ray, Side::Outside));
            occluded | u32::from(met.is_some()) << lane
        })
    }
}

impl SmoothSurface<'_> {
    #[inline(always)]
    fn hit(&self, ray: &Ray, meeting: &Meeting, from: Side) -> Intersection {
        let tree = &self.built.tree;
        let point = ray.at(meeting.t);
        let against = match from {
            Side::Outside => -ray.direction,
            Side::Inside => ray.direction,
        };
        let gradient = meeting
            .brick
            .map(|(brick, place)| tree.bricks[brick as usize].gradient(place));
        let normal = gradient
            .and_then(|gradient| (-gradient).try_normalize())
            .unwrap_or(against);
        let largest = point.abs().max(ray.origin.abs()).max_element();
        let hit = Intersection {
            t: meeting.t,
            point,
            normal,
            shading: normal,
            lift: 0.0,
            particle: 0,
            offset: (OFFSET * tree.voxel()).max(OFFSET_OF_ROUNDING * largest),
            anchor: point,
        };
        match (&self.built.field, &self.built.exact) {
            (Some(field), Some(layout)) => exact::refined(field, layout, ray, hit),
            _ => hit,
        }
    }

    fn field(&self) -> Option<&FieldParticles> {
        self.built.field.as_ref()
    }
}

impl Shape for SmoothSurface<'_> {
    fn crossing(&self, ray: &Ray, side: Side) -> Option<Intersection> {
        self.lanes.run(Cross {
            surface: self,
            ray,
            from: side,
        })
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
        coherence: Coherence,
        inside: u32,
        hits: &mut Intersections,
    ) {
        if !rays.is_empty() {
            self.lanes.run(CrossPacket {
                surface: self,
                rays,
                inside,
                coherence,
                hits,
            });
        }
    }

    fn occluded(&self, rays: &RayPacket, coherence: Coherence, lanes: u32) -> u32 {
        if lanes == 0 {
            return 0;
        }
        self.lanes.run(OccludePacket {
            surface: self,
            rays,
            coherence,
            lanes,
        })
    }

    fn particle_at(&self, hit: &Intersection) -> u32 {
        let nearest = self.field().and_then(|field| field.nearest(hit.point));
        nearest.unwrap_or(hit.particle)
    }

    fn blend(&self, hit: &Intersection, each: &mut dyn FnMut(u32, f32)) {
        let mut found = false;
        if let Some(field) = self.field() {
            field.neighbours(hit.point, &mut |index, part| {
                found = true;
                each(index, part);
            });
        }
        if !found {
            each(hit.particle, 1.0);
        }
    }
}

#[cfg(test)]
mod tests;
