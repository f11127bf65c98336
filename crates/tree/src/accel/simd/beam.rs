//! Beams: bounds of the origins and directions of the rays of a packet. A box or sphere outside the beam is rejected
//! for all rays at once.
//!
//! Boxes are tested by interval arithmetic (Wald, Boulos & Shirley 2007, "Ray tracing deformable scenes using dynamic
//! bounding volume hierarchies", section 4.2), spheres with a cone with a rounded tip around a central ray.

use glam::Vec3;

use super::super::Aabb;
use super::{MIN_DIRECTION, SLAB_SLACK};
use crate::math::{fold, larger, smaller};
use crate::ray::{PACKET_SIZE, RayPacket};

/// One value per ray.
type Lanes = [f32; PACKET_SIZE];

/// Largest angle (as its sine) between a direction and the central one for which a beam is used.
const MAX_SPREAD_SINE: f32 = 0.2;
/// Slack of the cone test as a fraction of its terms: covers the rounding of a ray's own test.
const CONE_SLACK: f32 = 4e-6;

/// Bounds of the rays in some lanes of a packet. Arrays have one element per axis, and a fourth element of zero.
#[derive(Debug, Clone, Copy)]
#[repr(align(16))]
pub(in super::super) struct Beam {
    /// The bound of the origins for which the near planes of boxes are nearest.
    pub(super) origin_near: [f32; 4],
    /// The bound of the origins for which the far planes of boxes are farthest.
    pub(super) origin_far: [f32; 4],
    /// Least and greatest component of the inverse directions.
    pub(super) inverse: [[f32; 3]; 2],
    /// Sign of the directions.
    pub(super) sign: [f32; 4],
    /// Index of the near planes: 1 if directions are negative.
    pub(super) near_side: [usize; 3],
    /// Length by which boxes must be extended on every side.
    pub(super) padding: f32,
    /// The least `t_min` of the rays.
    pub(super) t_min: f32,
    /// Origin of the central ray.
    pub(super) center: Vec3,
    /// Direction of the central ray.
    pub(super) axis: Vec3,
    /// Radius of the spheres, if they have a common one.
    pub(super) radius: f32,
    /// Largest distance of an origin from the central one.
    pub(super) spread: f32,
    /// Increase of the distance to the central ray per unit of length along it.
    pub(super) growth: f32,
}

/// Inverse directions with finite components: [`super::finite_inverse`] for all lanes.
#[inline(always)]
pub(super) fn inverses(directions: &Lanes) -> Lanes {
    let mut inverses = *directions;
    for d in &mut inverses {
        let clamped = if d.abs() < MIN_DIRECTION { MIN_DIRECTION.copysign(*d) } else { *d };
        *d = 1.0 / clamped;
    }
    inverses
}

/// Values of the rays in `lanes`; all other lanes get the value of lane `first`.
#[inline(always)]
fn fill_inactive(values: &Lanes, lanes: u32, first: usize) -> Lanes {
    let replacement = values[first];
    let mut filled = *values;
    for (lane, value) in filled.iter_mut().enumerate() {
        *value = if lanes >> lane & 1 == 1 { *value } else { replacement };
    }
    filled
}

/// Largest distance of the points from `middle`.
#[inline(always)]
fn farthest_from(middle: Vec3, points: &[Lanes; 3]) -> f32 {
    let mut squared = [0.0; PACKET_SIZE];
    for axis in 0..3 {
        for lane in 0..PACKET_SIZE {
            let d = points[axis][lane] - middle[axis];
            squared[lane] += d * d;
        }
    }
    fold(squared, larger).sqrt()
}

/// Lanes of rays with finite origins and directions and without NaN. All other rays hit nothing.
#[inline(always)]
fn finite_lanes(packet: &RayPacket) -> u32 {
    // The product with zero is zero for finite values, and NaN for all others
    let mut rest = [0.0; PACKET_SIZE];
    for axis in 0..3 {
        let (origin, direction) = (&packet.origin[axis], &packet.direction[axis]);
        for (lane, rest) in rest.iter_mut().enumerate() {
            *rest += 0.0 * origin[lane] + 0.0 * direction[lane];
        }
    }
    let mut lanes = 0;
    for (lane, rest) in rest.iter().enumerate() {
        // Keep the rays with a sum of zero and ends that are not NaN
        let has_ends = !packet.t_min[lane].is_nan() && !packet.t_max[lane].is_nan();
        lanes |= u32::from(*rest == 0.0 && has_ends) << lane;
    }
    lanes
}

/// The lanes whose rays enter `bounds`: a superset of the rays that hit anything inside. All of them are valid: no
/// component is NaN, and origins and directions are finite.
#[inline(always)]
pub(in super::super) fn lanes_entering(packet: &RayPacket, bounds: &Aabb) -> u32 {
    // Clip the rays to the slabs of all three axes, with some slack
    let mut near = packet.t_min;
    let mut far = packet.t_max;
    for axis in 0..3 {
        let inverse = inverses(&packet.direction[axis]);
        let (low, high) = (bounds.min[axis], bounds.max[axis]);
        for lane in 0..PACKET_SIZE {
            let a = (low - packet.origin[axis][lane]) * inverse[lane];
            let b = (high - packet.origin[axis][lane]) * inverse[lane];
            let slack = larger(a.abs(), b.abs()) * SLAB_SLACK;
            near[lane] = larger(smaller(a, b) - slack, near[lane]);
            far[lane] = smaller(larger(a, b) + slack, far[lane]);
        }
    }
    let mut lanes = 0;
    for lane in 0..PACKET_SIZE {
        // Written as `!(near > far)` so that NaN (bounds beyond the range of f32) counts as a hit.
        let misses = near[lane] > far[lane];
        lanes |= u32::from(!misses) << lane;
    }
    lanes & finite_lanes(packet) & ((1 << packet.len()) - 1)
}

impl Beam {
    /// The beam around the rays in `lanes` (at least one) of `packet`, for spheres of a common `radius` (0 for a
    /// radius per sphere) in boxes that must be extended by `padding` on every side. `None` if the directions differ
    /// too much or rays are invalid.
    #[inline(always)]
    pub(in super::super) fn around(
        packet: &RayPacket,
        lanes: u32,
        radius: f32,
        padding: f32,
    ) -> Option<Self> {
        let first_lane = lanes.trailing_zeros() as usize & (PACKET_SIZE - 1);
        let mut beam = Self {
            origin_near: [0.0; 4],
            origin_far: [0.0; 4],
            inverse: [[0.0; 3]; 2],
            sign: [0.0; 4],
            near_side: [0; 3],
            padding,
            t_min: fold(fill_inactive(&packet.t_min, lanes, first_lane), smaller),
            center: Vec3::ZERO,
            axis: Vec3::ZERO,
            radius,
            spread: 0.0,
            growth: 0.0,
        };
        let mut is_valid = beam.t_min >= 0.0;
        let (mut origins, mut directions) = (packet.origin, packet.direction);
        for axis in 0..3 {
            origins[axis] = fill_inactive(&packet.origin[axis], lanes, first_lane);
            directions[axis] = fill_inactive(&packet.direction[axis], lanes, first_lane);
            // Bound the inverse directions, which must have the same sign
            let inverse = inverses(&directions[axis]);
            let (low, high) = (fold(inverse, smaller), fold(inverse, larger));
            is_valid &= low.is_sign_negative() == high.is_sign_negative();
            is_valid &= low.is_finite() && high.is_finite();
            beam.inverse[0][axis] = low;
            beam.inverse[1][axis] = high;
            // Inversion reverses the order, but both ends are averaged.
            beam.axis[axis] = 0.5 * (1.0 / low + 1.0 / high);
            // Bound the origins
            let (first, last) = (fold(origins[axis], smaller), fold(origins[axis], larger));
            is_valid &= first <= last;
            beam.center[axis] = 0.5 * (first + last);
            let backward = high < 0.0;
            beam.near_side[axis] = usize::from(backward);
            beam.sign[axis] = if backward { -1.0 } else { 1.0 };
            let ends = if backward { [first, last] } else { [last, first] };
            [beam.origin_near[axis], beam.origin_far[axis]] = ends;
        }
        if !is_valid {
            return None;
        }
        // Compute the cone around the central ray
        beam.axis = beam.axis.normalize_or_zero();
        let spread_sine = farthest_from(beam.axis, &directions) + CONE_SLACK;
        beam.spread = farthest_from(beam.center, &origins);
        beam.growth = spread_sine / (1.0 - spread_sine);
        // The comparison is also false for NaN.
        (spread_sine < MAX_SPREAD_SINE && beam.spread.is_finite()).then_some(beam)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ray::Ray;

    fn packet(directions: &[Vec3]) -> RayPacket {
        let mut packet = RayPacket::default();
        for direction in directions {
            packet.push(&Ray::new(Vec3::ONE, direction.normalize()));
        }
        packet
    }

    #[test]
    fn rays_of_one_octant_that_point_the_same_way_make_a_beam() {
        let one = Vec3::new(1.0, 1.0, 0.1);
        let other = Vec3::new(1.0, 1.1, 0.2);
        let turned = Vec3::new(1.0, 1.0, -0.1);
        let across = Vec3::new(0.1, 1.0, 0.1);
        let around = |rays: &[Vec3], lanes| Beam::around(&packet(rays), lanes, 0.5, 0.5);
        let beam = around(&[one, other], 0b11).expect("close together");
        assert_eq!(beam.spread, 0.0);
        let apart = one.normalize().distance(other.normalize());
        assert!(beam.growth > 0.5 * apart && beam.growth < apart);
        assert!(around(&[one, turned], 0b11).is_none());
        assert!(around(&[one, across], 0b11).is_none());
        // Inactive lanes do not matter.
        assert!(around(&[turned, one, across, other], 0b1010).is_some());
    }

    #[test]
    fn near_lanes_intersect_the_box() {
        let bounds = Aabb { min: Vec3::splat(2.0), max: Vec3::splat(3.0) };
        let rays = packet(&[Vec3::ONE, -Vec3::ONE, Vec3::X, Vec3::new(1.0, 1.2, 1.1)]);
        assert_eq!(lanes_entering(&rays, &bounds), 0b1001);
        let mut short = RayPacket::default();
        short.push(&Ray { t_max: 1.0, ..rays.ray(0) });
        assert_eq!(lanes_entering(&short, &bounds), 0);
    }
}
