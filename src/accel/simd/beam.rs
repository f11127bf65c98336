//! What the rays of a packet have in common: bounds of their origins and directions, so that a box or
//! a sphere that none of them meets is put aside for all at once.
//!
//! Boxes are tested by interval arithmetic (Wald, Boulos & Shirley 2007, "Ray tracing deformable
//! scenes using dynamic bounding volume hierarchies", section 4.2), spheres against a cone with a
//! rounded tip around a middle ray.

use glam::Vec3;

use super::super::Aabb;
use super::{MIN_DIRECTION, SLAB_SLACK};
use crate::math::{fold, larger, smaller};
use crate::ray::{PACKET_SIZE, RayPacket};

/// A value for each ray.
type Lanes = [f32; PACKET_SIZE];

/// Directions farther apart than this (sine of the angle to the middle) make no beam.
const WIDEST: f32 = 0.2;
/// Slack of the cone test as a fraction of its terms: covers the rounding of a ray's own test.
const CONE_SLACK: f32 = 4e-6;

/// Bounds of the rays in some lanes of a packet. Per axis, with a fourth lane of zero.
#[derive(Debug, Clone, Copy)]
#[repr(align(16))]
pub(in super::super) struct Beam {
    /// The origins' bound that puts the first planes of boxes nearest.
    pub(super) origin_near: [f32; 4],
    /// The origins' bound that puts the second planes farthest.
    pub(super) origin_far: [f32; 4],
    /// Least and greatest inverse of the directions' components.
    pub(super) inverse: [[f32; 3]; 2],
    /// Sign of the directions.
    pub(super) sign: [f32; 4],
    /// Which side's planes come first: 1 where directions are negative.
    pub(super) near_side: [usize; 3],
    /// Distance that boxes lack on every side.
    pub(super) padding: f32,
    /// Where the first ray starts to count.
    pub(super) t_min: f32,
    /// Start of the middle ray.
    pub(super) center: Vec3,
    /// Direction of the middle ray.
    pub(super) axis: Vec3,
    /// Radius of the spheres, if common.
    pub(super) radius: f32,
    /// Distance of origins from the middle one.
    pub(super) spread: f32,
    /// How much farther rays get from the middle ray with every unit along it.
    pub(super) growth: f32,
}

/// Inverse directions with every component finite: [`super::finite_inverse`] of all lanes.
#[inline(always)]
pub(super) fn inverses(directions: &Lanes) -> Lanes {
    let mut inverses = *directions;
    for d in &mut inverses {
        let kept = if d.abs() < MIN_DIRECTION {
            MIN_DIRECTION.copysign(*d)
        } else {
            *d
        };
        *d = 1.0 / kept;
    }
    inverses
}

/// Values of the rays in `lanes`; lanes out of use stand in for the one in `first`.
#[inline(always)]
fn used(values: &Lanes, lanes: u32, first: usize) -> Lanes {
    let stand_in = values[first];
    let mut used = *values;
    for (lane, value) in used.iter_mut().enumerate() {
        *value = if lanes >> lane & 1 == 1 {
            *value
        } else {
            stand_in
        };
    }
    used
}

/// The greatest distance of any of the points from `middle`.
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

/// The lanes of rays that are all numbers, with finite origins and directions: no other hits anything.
#[inline(always)]
fn sound_lanes(packet: &RayPacket) -> u32 {
    // A product with zero is zero of what is finite, and NaN of all else.
    let mut rest = [0.0; PACKET_SIZE];
    for axis in 0..3 {
        let (origin, direction) = (&packet.origin[axis], &packet.direction[axis]);
        for (lane, rest) in rest.iter_mut().enumerate() {
            *rest += 0.0 * origin[lane] + 0.0 * direction[lane];
        }
    }
    let mut lanes = 0;
    for (lane, rest) in rest.iter().enumerate() {
        let has_ends = !packet.t_min[lane].is_nan() && !packet.t_max[lane].is_nan();
        lanes |= u32::from(*rest == 0.0 && has_ends) << lane;
    }
    lanes
}

/// The lanes whose rays come near `bounds`; a superset of those that meet anything inside. All of them
/// are sound: no component is NaN, origins and directions are finite.
#[inline(always)]
pub(in super::super) fn lanes_near(packet: &RayPacket, bounds: &Aabb) -> u32 {
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
        // Said so that NaN (bounds beyond the range of f32) counts as met.
        let misses = near[lane] > far[lane];
        lanes |= u32::from(!misses) << lane;
    }
    lanes & sound_lanes(packet) & ((1 << packet.len()) - 1)
}

impl Beam {
    /// Around the rays in `lanes` (at least one) of `packet`, for spheres of a common `radius` (0 where
    /// each has its own) in boxes that lack `padding` on every side. `None` if the rays point too far
    /// apart or are no proper rays.
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
            t_min: fold(used(&packet.t_min, lanes, first_lane), smaller),
            center: Vec3::ZERO,
            axis: Vec3::ZERO,
            radius,
            spread: 0.0,
            growth: 0.0,
        };
        let mut sound = beam.t_min >= 0.0;
        let (mut origins, mut directions) = (packet.origin, packet.direction);
        for axis in 0..3 {
            origins[axis] = used(&packet.origin[axis], lanes, first_lane);
            directions[axis] = used(&packet.direction[axis], lanes, first_lane);
            let inverse = inverses(&directions[axis]);
            let (low, high) = (fold(inverse, smaller), fold(inverse, larger));
            sound &= low.is_sign_negative() == high.is_sign_negative();
            sound &= low.is_finite() && high.is_finite();
            beam.inverse[0][axis] = low;
            beam.inverse[1][axis] = high;
            // Inverses order the other way round.
            beam.axis[axis] = 0.5 * (1.0 / low + 1.0 / high);
            let (first, last) = (fold(origins[axis], smaller), fold(origins[axis], larger));
            sound &= first <= last;
            beam.center[axis] = 0.5 * (first + last);
            let backward = high < 0.0;
            beam.near_side[axis] = usize::from(backward);
            beam.sign[axis] = if backward { -1.0 } else { 1.0 };
            let ends = if backward {
                [first, last]
            } else {
                [last, first]
            };
            [beam.origin_near[axis], beam.origin_far[axis]] = ends;
        }
        if !sound {
            return None;
        }
        beam.axis = beam.axis.normalize_or_zero();
        let turn = farthest_from(beam.axis, &directions) + CONE_SLACK;
        beam.spread = farthest_from(beam.center, &origins);
        beam.growth = turn / (1.0 - turn);
        // Also false for NaN.
        (turn < WIDEST && beam.spread.is_finite()).then_some(beam)
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
        // Lanes out of use do not count.
        assert!(around(&[turned, one, across, other], 0b1010).is_some());
    }

    #[test]
    fn lanes_near_are_those_that_meet_the_box() {
        let bounds = Aabb {
            min: Vec3::splat(2.0),
            max: Vec3::splat(3.0),
        };
        let rays = packet(&[Vec3::ONE, -Vec3::ONE, Vec3::X, Vec3::new(1.0, 1.2, 1.1)]);
        assert_eq!(lanes_near(&rays, &bounds), 0b1001);
        let mut short = RayPacket::default();
        short.push(&Ray {
            t_max: 1.0,
            ..rays.ray(0)
        });
        assert_eq!(lanes_near(&short, &bounds), 0);
    }
}
