//! Rays: where, which way, how far.

use glam::Vec3;

/// A half-open piece of a line. Lengths are scene units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Start, relative to the sequence's origin.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// Nearest distance that counts.
    pub t_min: f32,
    /// Farthest distance that counts.
    pub t_max: f32,
}

impl Ray {
    /// A ray from `origin` along the unit vector `direction` without an end.
    pub const fn new(origin: Vec3, direction: Vec3) -> Self {
        Self {
            origin,
            direction,
            t_min: 0.0,
            t_max: f32::INFINITY,
        }
    }

    /// The point at distance `t`.
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + self.direction * t
    }
}

/// Rays of a packet: as many as a 512-bit register has lanes.
pub const PACKET_SIZE: usize = 16;

/// Up to 16 rays to be traced together, one array per component. [`Coherence`] tells how they lie: close
/// together and nearly the same way is fastest, any others are just as right.
///
/// [`Coherence`]: crate::accel::Coherence
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(64))]
pub struct RayPacket {
    pub(crate) origin: [[f32; PACKET_SIZE]; 3],
    pub(crate) direction: [[f32; PACKET_SIZE]; 3],
    pub(crate) t_min: [f32; PACKET_SIZE],
    pub(crate) t_max: [f32; PACKET_SIZE],
    len: usize,
}

impl Default for RayPacket {
    fn default() -> Self {
        Self {
            origin: [[0.0; PACKET_SIZE]; 3],
            direction: [[0.0; PACKET_SIZE]; 3],
            t_min: [0.0; PACKET_SIZE],
            t_max: [0.0; PACKET_SIZE],
            len: 0,
        }
    }
}

impl RayPacket {
    /// Adds a ray.
    ///
    /// # Panics
    /// If there are 16 already.
    #[inline]
    pub fn push(&mut self, ray: &Ray) {
        let lane = self.len;
        assert!(lane < PACKET_SIZE, "a packet holds 16 rays");
        for axis in 0..3 {
            self.origin[axis][lane] = ray.origin[axis];
            self.direction[axis][lane] = ray.direction[axis];
        }
        self.t_min[lane] = ray.t_min;
        self.t_max[lane] = ray.t_max;
        self.len += 1;
    }

    /// Makes it a packet of `len` rays, whose components are set one by one.
    #[inline(always)]
    pub(crate) fn set_len(&mut self, len: usize) {
        debug_assert!(len <= PACKET_SIZE);
        self.len = len;
    }

    /// Rays to be filled in: without an end, and none of them counts yet.
    #[inline(always)]
    pub(crate) fn reset(&mut self) {
        self.t_min = [0.0; PACKET_SIZE];
        self.t_max = [f32::INFINITY; PACKET_SIZE];
        self.len = 0;
    }

    /// Removes all rays.
    pub fn clear(&mut self) {
        self.len = 0;
    }

    /// Rays in the packet.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there is no ray.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Whether there is no room for another ray.
    pub fn is_full(&self) -> bool {
        self.len == PACKET_SIZE
    }

    /// The ray in `lane`.
    ///
    /// # Panics
    /// If there are not as many.
    #[inline]
    pub fn ray(&self, lane: usize) -> Ray {
        assert!(lane < self.len, "the packet has fewer rays");
        let vector = |v: &[[f32; PACKET_SIZE]; 3]| Vec3::new(v[0][lane], v[1][lane], v[2][lane]);
        Ray {
            origin: vector(&self.origin),
            direction: vector(&self.direction),
            t_min: self.t_min[lane],
            t_max: self.t_max[lane],
        }
    }

    /// All rays in order.
    pub fn rays(&self) -> impl Iterator<Item = Ray> + '_ {
        (0..self.len).map(|lane| self.ray(lane))
    }
}
