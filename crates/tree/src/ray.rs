//! Rays and packets of rays.

use glam::Vec3;

/// A ray with a half-open range of distances. Lengths are in scene units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Origin, relative to the origin of the sequence.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// Lower end of the range, inclusive.
    pub t_min: f32,
    /// Upper end of the range, exclusive.
    pub t_max: f32,
}

impl Ray {
    /// An unbounded ray from `origin` along the unit vector `direction`.
    pub const fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, direction, t_min: 0.0, t_max: f32::INFINITY }
    }

    /// The point at distance `t`.
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + self.direction * t
    }
}

/// Rays per packet, the number of lanes of a 512-bit register.
pub const PACKET_SIZE: usize = 16;

/// Up to 16 rays to be traced together, one array per component. Their [`Coherence`] affects speed only: rays that
/// are close together and in nearly the same direction are fastest.
///
/// [`Coherence`]: crate::accel::Coherence
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(64))]
pub struct RayPacket {
    /// Origins.
    pub origin: [[f32; PACKET_SIZE]; 3],
    /// Directions.
    pub direction: [[f32; PACKET_SIZE]; 3],
    /// Where the rays begin, in multiples of the directions.
    pub t_min: [f32; PACKET_SIZE],
    /// Where the rays end.
    pub t_max: [f32; PACKET_SIZE],
    /// Time of each ray: -1/2 when the shutter opens, 1/2 when it closes.
    pub time: [f32; PACKET_SIZE],
    len: usize,
}

impl Default for RayPacket {
    fn default() -> Self {
        Self {
            origin: [[0.0; PACKET_SIZE]; 3],
            direction: [[0.0; PACKET_SIZE]; 3],
            t_min: [0.0; PACKET_SIZE],
            t_max: [0.0; PACKET_SIZE],
            time: [0.0; PACKET_SIZE],
            len: 0,
        }
    }
}

impl RayPacket {
    /// Adds a ray in the middle of the exposure.
    ///
    /// # Panics
    /// If the packet is full.
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
        self.time[lane] = 0.0;
        self.len += 1;
    }

    /// Sets the number of rays; the caller sets their components.
    #[inline(always)]
    pub fn set_len(&mut self, len: usize) {
        debug_assert!(len <= PACKET_SIZE);
        self.len = len;
    }

    /// Disables all rays but those of `lanes`: rays that end before they start hit nothing.
    #[inline(always)]
    pub fn keep_only(&mut self, lanes: u32) {
        for (lane, end) in self.t_max[..self.len].iter_mut().enumerate() {
            if lanes >> lane & 1 == 0 {
                *end = -1.0;
            }
        }
    }

    /// Prepares an empty packet for rays that are added component by component: all lanes get an unbounded range.
    #[inline(always)]
    pub fn reset(&mut self) {
        self.t_min = [0.0; PACKET_SIZE];
        self.t_max = [f32::INFINITY; PACKET_SIZE];
        self.len = 0;
    }

    /// Removes all rays.
    pub fn clear(&mut self) {
        self.len = 0;
    }

    /// Number of rays in the packet.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether the packet has no rays.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Whether all lanes are in use.
    pub fn is_full(&self) -> bool {
        self.len == PACKET_SIZE
    }

    /// The ray in `lane`.
    ///
    /// # Panics
    /// If `lane` is not below [`RayPacket::len`].
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
