//! Connected transmissive bodies that may overlap: nested dielectrics.
//!
//! Reconstructed surfaces of two liquids overlap by about a particle distance, or leave a gap. Bodies have priorities, and
//! where they overlap, the medium is that of the body with the highest one (Schmidt and Budge, "Simple nested dielectrics
//! in ray traced images", 2002). A surface between equal media is none: rays pass it straight.

use std::cmp::Reverse;

use glam::Vec3;

use super::body_set::{AIR, BodySet, MAX_TRANSMISSIVE_BODIES};
use crate::scene::{Material, Scene};
use spherule_surface::{Intersections, MaterialId, Shape, Side};
use spherule_tree::math::{LANES, lanes_in, lanes_where};

/// Marks materials that are not of a body.
const NO_BODY: u8 = u8::MAX;

/// A connected transmissive body.
#[derive(Clone, Copy)]
pub(super) struct TransmissiveBody<'a> {
    pub(super) shape: &'a dyn Shape,
    pub(super) material: &'a Material,
}

/// Several connected transmissive bodies, by falling priority.
pub(super) struct TransmissiveBodies<'a> {
    bodies: Vec<TransmissiveBody<'a>>,
    /// The body of each material of the scene, or [`NO_BODY`].
    of_material: Vec<u8>,
}

/// The surface of a body that separates two media.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct MediumBoundary {
    /// The body, whose medium is inside.
    pub(super) body: usize,
    /// The body whose medium is outside, or [`AIR`].
    pub(super) outer: usize,
}

/// A surface between equal media that a ray has passed.
#[derive(Debug, Clone, Copy)]
pub(super) struct StraightCrossing {
    pub(super) lane: usize,
    /// Distance along the ray.
    pub(super) t: f32,
    /// The body whose surface it is.
    pub(super) body: BodySet,
}

/// Lanes at the same kind of boundary.
#[derive(Debug, Clone, Copy)]
pub(super) struct BoundaryLanes {
    pub(super) boundary: MediumBoundary,
    pub(super) lanes: u32,
    /// Those of the lanes whose rays are inside the body.
    pub(super) inside: u32,
}

/// Whether `shape` bounds a connected transmissive body.
fn is_transmissive(scene: &Scene, shape: &dyn Shape) -> bool {
    shape.is_connected() && scene.material(shape.material()).transmission > 0.0
}

/// Number of connected transmissive bodies among `shapes`.
pub(super) fn count_bodies(scene: &Scene, shapes: &[&dyn Shape]) -> usize {
    shapes.iter().filter(|shape| is_transmissive(scene, **shape)).count()
}

impl<'a> TransmissiveBodies<'a> {
    /// The bodies among `shapes`, unless there is none, or only that of the particles, which needs no sets of bodies.
    /// There are at most [`MAX_TRANSMISSIVE_BODIES`].
    pub(super) fn of(scene: &'a Scene, shapes: &[&'a dyn Shape]) -> Option<Self> {
        let mut found: Vec<&'a dyn Shape> =
            shapes.iter().filter(|shape| is_transmissive(scene, **shape)).copied().collect();
        if found.iter().all(|shape| shape.material() == MaterialId::PARTICLES) {
            return None;
        }
        found.sort_by_key(|shape| {
            (Reverse(scene.material(shape.material()).priority), shape.material())
        });
        found.truncate(MAX_TRANSMISSIVE_BODIES);
        let mut of_material = vec![NO_BODY; scene.materials.len()];
        for (shape, index) in found.iter().zip(0..) {
            of_material[shape.material().index()] = index;
        }
        let body = |shape: &'a dyn Shape| TransmissiveBody {
            shape,
            material: scene.material(shape.material()),
        };
        Some(Self { bodies: found.into_iter().map(body).collect(), of_material })
    }

    /// Their shapes and materials.
    pub(super) fn all(&self) -> &[TransmissiveBody<'a>] {
        &self.bodies
    }

    /// The body with a `material`, if there is one.
    #[inline]
    pub(super) fn with_material(&self, material: MaterialId) -> Option<usize> {
        let body = self.of_material[material.index()];
        (body != NO_BODY).then_some(usize::from(body))
    }

    /// The lanes of intersections with the bodies.
    pub(super) fn lanes_of(&self, hits: &Intersections) -> u32 {
        let is_body = |lane: usize| self.with_material(hits.material[lane]).is_some();
        lanes_in(hits.mask).mask_where(is_body)
    }

    /// The bodies that `point` is inside.
    pub(super) fn at(&self, point: Vec3) -> BodySet {
        let is_inside = |body: &TransmissiveBody<'_>| body.shape.side_of(point) == Side::Inside;
        let bodies = self.bodies.iter().enumerate().filter(|(_, body)| is_inside(body));
        bodies.fold(BodySet::EMPTY, |set, (body, _)| set.across(BodySet::of(body)))
    }

    /// Index of refraction of a medium.
    #[inline]
    pub(super) fn ior(&self, medium: usize) -> f32 {
        self.bodies.get(medium).map_or(1.0, |body| body.material.ior)
    }

    /// The body with a medium that absorbs light.
    pub(super) fn absorbing(&self, medium: usize) -> Option<&TransmissiveBody<'a>> {
        self.bodies.get(medium).filter(|body| body.material.absorbs())
    }

    /// The body whose surface the ray in `lane` hits, as a set; empty for other surfaces.
    #[inline]
    pub(super) fn crossed_at(&self, hits: &Intersections, lane: usize) -> BodySet {
        self.with_material(hits.material[lane]).map_or(BodySet::EMPTY, BodySet::of)
    }

    /// Those of `lanes` whose rays, inside the bodies of `sets`, are at surfaces between equal media.
    pub(super) fn straight_lanes(
        &self,
        hits: &Intersections,
        lanes: u32,
        sets: &[BodySet; LANES],
    ) -> u32 {
        let is_straight = |lane: usize| {
            let body = self.with_material(hits.material[lane]);
            body.is_some_and(|body| self.boundary(body, sets[lane]).is_none())
        };
        lanes_in(lanes).mask_where(is_straight)
    }

    /// The media that the surface of `body` separates where a ray meets it that is inside the bodies of `set`. None if they
    /// are the same, or refract alike.
    #[inline]
    pub(super) fn boundary(&self, body: usize, set: BodySet) -> Option<MediumBoundary> {
        let outer = set.without(body).medium();
        let is_boundary = body < outer && (outer == AIR || self.ior(body) != self.ior(outer));
        is_boundary.then_some(MediumBoundary { body, outer })
    }

    /// The boundaries at intersections of `lanes` with bodies, each with its lanes. The rays are inside the bodies of `sets`.
    pub(super) fn boundaries(
        &self,
        hits: &Intersections,
        lanes: u32,
        sets: &[BodySet; LANES],
    ) -> impl Iterator<Item = BoundaryLanes> + use<> {
        // Find the boundary of each lane
        let mut of_lanes = [None; LANES];
        for lane in lanes_in(lanes) {
            let body = self.with_material(hits.material[lane]);
            of_lanes[lane] = body.and_then(|body| self.boundary(body, sets[lane]));
        }
        let (sets, mut rest) = (*sets, lanes);
        // Collect the lanes of the boundary in the first lane that is left
        std::iter::from_fn(move || {
            let lane = lanes_in(rest).find(|lane| of_lanes[*lane].is_some())?;
            let boundary = of_lanes[lane]?;
            let mut found = BoundaryLanes { boundary, lanes: 0, inside: 0 };
            for lane in lanes_in(rest).filter(|lane| of_lanes[*lane] == Some(boundary)) {
                found.lanes |= 1 << lane;
                found.inside |= u32::from(sets[lane].contains(boundary.body)) << lane;
            }
            rest &= !found.lanes;
            Some(found)
        })
    }
}

/// The lanes whose rays are inside `body`.
pub(super) fn lanes_inside(body: usize, sets: &[BodySet; LANES]) -> u32 {
    lanes_where(|lane| sets[lane].contains(body))
}

/// The lanes whose rays are inside any body.
pub(super) fn lanes_inside_any(sets: &[BodySet; LANES]) -> u32 {
    lanes_where(|lane| !sets[lane].is_empty())
}

/// The media of `lanes`, apart from air, each with its lanes.
pub(super) fn media_of(
    lanes: u32,
    sets: &[BodySet; LANES],
) -> impl Iterator<Item = (usize, u32)> + use<> {
    let media = sets.map(BodySet::medium);
    (0..AIR).filter_map(move |medium| {
        let found = lanes_in(lanes).mask_where(|lane| media[lane] == medium);
        (found != 0).then_some((medium, found))
    })
}
