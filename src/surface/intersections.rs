//! What the rays of a packet meet, one array per component.

use glam::Vec3;

use crate::math::{Lanes, Lanes3, lane3, set_lane3, splat};
use crate::ray::{PACKET_SIZE, RayPacket};

/// Names a material of the scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct MaterialId(pub u8);

impl MaterialId {
    /// What the scene's material says; its base colour comes with the particles.
    pub const PARTICLES: Self = Self(0);
    /// Foam and spray.
    pub const SPRAY: Self = Self(1);
    /// The floor.
    pub const GROUND: Self = Self(2);
    /// Materials that there are.
    pub const COUNT: usize = 3;

    /// Whether its surfaces are those of particles, with attributes.
    pub fn is_of_particles(self) -> bool {
        matches!(self, Self::PARTICLES | Self::SPRAY)
    }
}

/// The intersection of one ray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intersection {
    /// Distance along the ray, scene units.
    pub t: f32,
    /// The point, put back onto the surface so that it is exact to a few units in the last place.
    pub point: Vec3,
    /// Outward geometric unit normal; the ray enters the body if it points against the ray.
    pub normal: Vec3,
    /// Unit normal to shade by, seen from the same side as `normal`; `normal` where nothing smoother is known.
    pub shading: Vec3,
    /// Length along `shading` by which rays to lights start higher, so that what it smooths over casts no
    /// shadow on itself; 0 where it smooths over nothing.
    pub lift: f32,
    /// Index of the particle in the frame.
    pub particle: u32,
    /// Length to step along the normal (either side) so that the next ray does not meet the same
    /// place again.
    pub offset: f32,
    /// Where to step from: `point`, unless that lies on a finer surface than rays meet.
    pub anchor: Vec3,
}

/// The nearest intersection of each ray of a packet. The fields of lanes outside `mask` mean nothing.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub struct Intersections {
    /// Distance along the ray, scene units.
    pub t: Lanes,
    /// The point, put back onto the surface so that it is exact to a few units in the last place.
    pub point: Lanes3,
    /// Outward geometric unit normal.
    pub normal: Lanes3,
    /// Unit normal to shade by, on the same side as `normal`.
    pub shading_normal: Lanes3,
    /// Where the next ray starts, before it steps off the surface: `point`, unless the surface that is shaded is finer
    /// than the one that rays meet.
    pub anchor: Lanes3,
    /// Length to step along the geometric normal, to either side, so that the next ray does not meet the same place.
    pub offset: Lanes,
    /// Length along the shading normal by which rays to lights start higher (see [`Intersection::lift`]).
    pub lift: Lanes,
    /// Part of the surface that is there: 1, less where a floor fades into the background.
    pub opacity: Lanes,
    /// Index in the frame of the particle.
    pub particle: [u32; PACKET_SIZE],
    /// What the surface is made of.
    pub material: [MaterialId; PACKET_SIZE],
    /// Lanes whose rays meet anything.
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
            opacity: splat(1.0),
            particle: [0; PACKET_SIZE],
            material: [MaterialId::PARTICLES; PACKET_SIZE],
            mask: 0,
        }
    }
}

impl Intersections {
    /// Forgets all of them.
    #[inline(always)]
    pub fn clear(&mut self) {
        self.mask = 0;
    }

    /// Puts `hit` with a surface of `material` into `lane`.
    ///
    /// # Panics
    /// If there is no such lane.
    pub fn set(&mut self, lane: usize, hit: &Intersection, material: MaterialId) {
        self.mask |= 1 << lane;
        self.t[lane] = hit.t;
        set_lane3(&mut self.point, lane, hit.point);
        set_lane3(&mut self.normal, lane, hit.normal);
        set_lane3(&mut self.shading_normal, lane, hit.shading);
        set_lane3(&mut self.anchor, lane, hit.anchor);
        self.offset[lane] = hit.offset;
        self.lift[lane] = hit.lift;
        self.opacity[lane] = 1.0;
        self.particle[lane] = hit.particle;
        self.material[lane] = material;
    }

    /// Puts `hit` with a surface of `material` into `lane`, and ends the ray there.
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
    /// If there is no such lane.
    pub fn get(&self, lane: usize) -> Intersection {
        Intersection {
            t: self.t[lane],
            point: lane3(&self.point, lane),
            normal: lane3(&self.normal, lane),
            shading: lane3(&self.shading_normal, lane),
            anchor: lane3(&self.anchor, lane),
            offset: self.offset[lane],
            lift: self.lift[lane],
            particle: self.particle[lane],
        }
    }

    /// What the first `count` rays meet, one by one.
    #[cfg(test)]
    pub(crate) fn all(&self, count: usize) -> Vec<Option<Intersection>> {
        let found = |lane| (self.mask >> lane & 1 == 1).then(|| self.get(lane));
        (0..count).map(found).collect()
    }

    /// The lanes of `material`.
    #[inline(always)]
    pub fn lanes_of(&self, material: MaterialId) -> u32 {
        let mut lanes = 0;
        for lane in 0..PACKET_SIZE {
            lanes |= u32::from(self.material[lane] == material) << lane;
        }
        lanes & self.mask
    }
}
