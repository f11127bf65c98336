//! Intersections of the rays of a packet, one array per component.

use glam::Vec3;

use crate::MaterialId;
use spherule_tree::math::{Lanes, Lanes3, lane3, lanes_in, set_lane3, splat};
use spherule_tree::ray::{PACKET_SIZE, RayPacket};

/// The intersection of one ray with a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intersection {
    /// Distance along the ray, scene units.
    pub t: f32,
    /// The point, projected onto the surface so that it is exact to a few units in the last place.
    pub point: Vec3,
    /// Outward geometric unit normal. A ray that points against it enters the body.
    pub normal: Vec3,
    /// Unit shading normal, on the same side as `normal` as seen by the ray; equal to `normal` if there is no
    /// smoother one.
    pub shading: Vec3,
    /// Length along `shading` by which shadow rays start higher, so that bumps that `shading` smooths over do not
    /// cast shadows onto each other; 0 without smoothing.
    pub lift: f32,
    /// Radius of the sphere that the surface is part of, scene units; infinite if it is not part of one.
    pub radius: f32,
    /// Index of the particle in the frame.
    pub particle: u32,
    /// Length to step along the normal, to either side, so that the next ray does not hit the same point again.
    pub offset: f32,
    /// Origin of the next ray before the step: `point`, unless the shaded surface is finer than the surface that rays
    /// are traced against.
    pub anchor: Vec3,
}

/// The nearest intersection of each ray of a packet. The fields of lanes outside `mask` are unspecified.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub struct Intersections {
    /// Distance along the ray, scene units.
    pub t: Lanes,
    /// The point, projected onto the surface so that it is exact to a few units in the last place.
    pub point: Lanes3,
    /// Outward geometric unit normal.
    pub normal: Lanes3,
    /// Unit shading normal, on the same side as `normal`.
    pub shading_normal: Lanes3,
    /// Origin of the next ray before it steps off the surface: `point`, unless the shaded surface is finer than the
    /// surface that rays are traced against.
    pub anchor: Lanes3,
    /// Length to step along the geometric normal, to either side, so that the next ray does not hit the same point
    /// again.
    pub offset: Lanes,
    /// Length along the shading normal by which shadow rays start higher (see [`Intersection::lift`]).
    pub lift: Lanes,
    /// Radius of the sphere that the surface is part of (see [`Intersection::radius`]).
    pub radius: Lanes,
    /// Opacity of the surface: 1, or less where a floor fades into the background.
    pub opacity: Lanes,
    /// Index of the particle in the frame.
    pub particle: [u32; PACKET_SIZE],
    /// Material of the surface.
    pub material: [MaterialId; PACKET_SIZE],
    /// Lanes with an intersection.
    pub mask: u32,
}

impl Default for Intersections {
    fn default() -> Self {
        Self {
            t: splat(0.0),
            point: [splat(0.0); 3],
            normal: [splat(0.0); 3],
            shading_normal: [splat(0.0); 3],
            anchor: [splat(0.0); 3],
            offset: splat(0.0),
            lift: splat(0.0),
            radius: splat(f32::INFINITY),
            opacity: splat(1.0),
            particle: [0; PACKET_SIZE],
            material: [MaterialId::PARTICLES; PACKET_SIZE],
            mask: 0,
        }
    }
}

impl Intersections {
    /// Removes all intersections.
    #[inline(always)]
    pub fn clear(&mut self) {
        self.mask = 0;
    }

    /// Stores `hit` with a surface of `material` in `lane`.
    ///
    /// # Panics
    /// If the lane does not exist.
    #[inline]
    pub fn set(&mut self, lane: usize, hit: &Intersection, material: MaterialId) {
        self.mask |= 1 << lane;
        self.t[lane] = hit.t;
        set_lane3(&mut self.point, lane, hit.point);
        set_lane3(&mut self.normal, lane, hit.normal);
        set_lane3(&mut self.shading_normal, lane, hit.shading);
        set_lane3(&mut self.anchor, lane, hit.anchor);
        self.offset[lane] = hit.offset;
        self.lift[lane] = hit.lift;
        self.radius[lane] = hit.radius;
        self.opacity[lane] = 1.0;
        self.particle[lane] = hit.particle;
        self.material[lane] = material;
    }

    /// Stores `hit` with a surface of `material` in `lane`, and ends the ray there.
    pub(super) fn end_ray(
        &mut self,
        rays: &mut RayPacket,
        lane: usize,
        hit: &Intersection,
        material: MaterialId,
    ) {
        self.set(lane, hit, material);
        rays.t_max[lane] = hit.t;
    }

    /// The intersection in `lane`.
    ///
    /// # Panics
    /// If the lane does not exist.
    #[inline]
    pub fn get(&self, lane: usize) -> Intersection {
        Intersection {
            t: self.t[lane],
            point: lane3(&self.point, lane),
            normal: lane3(&self.normal, lane),
            shading: lane3(&self.shading_normal, lane),
            anchor: lane3(&self.anchor, lane),
            offset: self.offset[lane],
            lift: self.lift[lane],
            radius: self.radius[lane],
            particle: self.particle[lane],
        }
    }

    /// The intersections of the first `count` rays.
    #[cfg(test)]
    pub(crate) fn all(&self, count: usize) -> Vec<Option<Intersection>> {
        let found = |lane| (self.mask >> lane & 1 == 1).then(|| self.get(lane));
        (0..count).map(found).collect()
    }

    /// The materials of `lanes`, each with its lanes.
    #[inline(always)]
    pub fn materials_of(&self, lanes: u32) -> impl Iterator<Item = (MaterialId, u32)> + use<> {
        let (materials, mut rest) = (self.material, lanes & self.mask);
        std::iter::from_fn(move || {
            let first = (rest != 0).then(|| rest.trailing_zeros() as usize)?;
            let found = lanes_with(&materials, materials[first]) & rest;
            rest &= !found;
            Some((materials[first], found))
        })
    }

    /// Lets `rays` of `lanes` go on behind their intersections, to their ends `far`.
    #[inline]
    pub fn continue_rays(&self, rays: &mut RayPacket, lanes: u32, far: &Lanes) {
        for lane in lanes_in(lanes) {
            rays.t_min[lane] = self.t[lane] + self.offset[lane];
            rays.t_max[lane] = far[lane];
        }
    }

    /// The lanes of `material`.
    #[inline(always)]
    pub fn lanes_of(&self, material: MaterialId) -> u32 {
        lanes_with(&self.material, material) & self.mask
    }
}

/// The lanes that have `material` among `materials`.
#[inline(always)]
fn lanes_with(materials: &[MaterialId; PACKET_SIZE], material: MaterialId) -> u32 {
    let mut lanes = 0;
    for (lane, found) in materials.iter().enumerate() {
        lanes |= u32::from(*found == material) << lane;
    }
    lanes
}
