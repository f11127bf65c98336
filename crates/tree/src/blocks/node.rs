//! The 64-byte node: eight child boxes in one cache line, with planes quantised to 8 bits relative to the
//! node's origin (after Ylitie, Karras & Laine 2017, without their child pointers).

use bytemuck::{Pod, Zeroable};

use super::Aabb;

/// Children of a node.
pub const WIDTH: usize = 8;

/// Largest absolute position of the planes of stored boxes, scene units: sums and differences of two planes
/// stay finite.
pub const FARTHEST_PLANE: f64 = f32::MAX as f64 / 4.0;

/// Eight quantised child boxes. Plane `q` of axis `a` lies at `origin[a] + q * 2^(exponent[a]-127)`.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C, align(64))]
pub struct Node {
    /// Lower corner of the node's box.
    pub origin: [f32; 3],
    /// Biased exponent of the quantisation step (a power of two), per axis.
    pub exponent: [u8; 3],
    /// A bit for each child in use; the children in use come first.
    pub child_mask: u8,
    /// Per axis: the eight lower planes, then the eight upper ones.
    pub planes: [[[u8; WIDTH]; 2]; 3],
}

impl Node {
    /// Number of children in use.
    #[inline]
    pub fn child_count(&self) -> usize {
        self.child_mask.count_ones() as usize
    }

    /// A node around up to eight `children`; every quantised box contains its child.
    #[inline]
    pub fn enclosing(children: &[Aabb]) -> Self {
        debug_assert!(!children.is_empty() && children.len() <= WIDTH);
        let own = children.iter().fold(Aabb::EMPTY, |b, c| b.union(*c));
        let mut node = Self::zeroed();
        node.origin = own.min.to_array();
        #[expect(clippy::cast_possible_truncation, reason = "at most eight children")]
        {
            node.child_mask = ((1_u32 << children.len()) - 1) as u8;
        }
        for axis in 0..3 {
            let exponent = step_exponent(own.min[axis], own.max[axis]);
            node.exponent[axis] = exponent;
            // The step is a power of two, so that its inverse is exact.
            let step = decode_step(exponent);
            let inverse = 1.0 / step;
            for (slot, child) in children.iter().enumerate() {
                let [lower, upper] = &mut node.planes[axis];
                lower[slot] = plane_below(own.min[axis], step, inverse, child.min[axis]);
                upper[slot] = plane_above(own.min[axis], step, inverse, child.max[axis]);
            }
        }
        node
    }

    /// Exact positions of the lower and the upper plane of child `slot` on `axis`.
    #[inline]
    pub fn interval(&self, slot: usize, axis: usize) -> [f64; 2] {
        let step = decode_step(self.exponent[axis]);
        [0, 1].map(|side| plane_at(self.origin[axis], step, self.planes[axis][side][slot]))
    }

    /// Whether `bounds` is inside the quantised box of child `slot`.
    #[inline]
    pub fn child_holds(&self, slot: usize, bounds: &Aabb) -> bool {
        (0..3).all(|axis| {
            let [lower, upper] = self.interval(slot, axis);
            lower <= f64::from(bounds.min[axis]) && f64::from(bounds.max[axis]) <= upper
        })
    }
}

/// The quantisation step for a stored exponent.
fn decode_step(exponent: u8) -> f64 {
    f64::from(f32::from_bits(u32::from(exponent) << 23))
}

/// The position of a plane. f64 is exact except for absurd extents; ray tests, which use f32, allow for their
/// own rounding.
fn plane_at(origin: f32, step: f64, plane: u8) -> f64 {
    f64::from(origin) + f64::from(plane) * step
}

/// The exponent of the smallest power of two whose 255th multiple reaches from `min` to `max`.
fn step_exponent(min: f32, max: f32) -> u8 {
    let step = (f64::from(max) - f64::from(min)) / 255.0;
    let bits = step.to_bits();
    let has_fraction = i64::from(bits & ((1 << 52) - 1) != 0);
    let biased = (bits >> 52) as i64 - 1023 + 127 + has_fraction;
    // Exponent 1 is the smallest normal number, which also serves a box without extent.
    let mut exponent = biased.clamp(1, 254) as u8;
    while exponent < 254 && plane_at(min, decode_step(exponent), 255) < f64::from(max) {
        exponent += 1;
    }
    exponent
}

/// The highest plane at or below `value`; `value` must be at or above `origin`.
#[expect(
    clippy::cast_possible_truncation,
    reason = "truncation is the floor of a number that is not negative; saturates at 255"
)]
fn plane_below(origin: f32, step: f64, inverse_step: f64, value: f32) -> u8 {
    let plane = ((f64::from(value) - f64::from(origin)) * inverse_step) as u8;
    // For absurd extents, the difference above is rounded.
    let is_above = plane_at(origin, step, plane) > f64::from(value);
    plane.saturating_sub(u8::from(is_above))
}

/// The lowest plane at or above `value`; `value` must be at or above `origin`.
fn plane_above(origin: f32, step: f64, inverse_step: f64, value: f32) -> u8 {
    let below = plane_below(origin, step, inverse_step, value);
    let is_below = plane_at(origin, step, below) < f64::from(value);
    below.saturating_add(u8::from(is_below))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use glam::Vec3;

    use super::*;

    #[test]
    fn a_node_is_one_cache_line() {
        assert_eq!(size_of::<Node>(), 64);
        assert_eq!(align_of::<Node>(), 64);
    }

    #[test]
    fn empty_extents_are_quantised_exactly() {
        let point = Aabb { min: Vec3::splat(1e4), max: Vec3::splat(1e4) };
        let node = Node::enclosing(&[point; 8]);
        assert!(node.child_holds(7, &point));
        let [lower, upper] = node.interval(7, 0);
        assert!(upper - lower < 1e-30, "{lower} {upper}");
    }

    #[test]
    fn huge_boxes_contain_their_children() {
        // The differences of these values are rounded in f64.
        let values = [-147_573_952_589_676_412_928.0, -8.27, -1e-38, 0.0, 8.27, 3.0e19];
        for low in 0..values.len() {
            for high in low..values.len() {
                let child = Aabb { min: Vec3::splat(values[low]), max: Vec3::splat(values[high]) };
                let all = Aabb {
                    min: Vec3::splat(values[0]),
                    max: Vec3::splat(values[values.len() - 1]),
                };
                let node = Node::enclosing(&[child, all]);
                assert!(node.child_holds(0, &child), "{child:?}");
            }
        }
    }

    proptest! {
        #[test]
        fn every_quantised_box_contains_its_child(
            corners in prop::collection::vec(
                (prop::array::uniform3(-1e4_f32..1e4), prop::array::uniform3(0.0_f32..100.0)),
                1..=8,
            ),
            scale in prop::sample::select(vec![1e-20_f32, 1e-4, 1.0, 1e4, 1e20]),
        ) {
            let boxes: Vec<Aabb> = corners
                .iter()
                .map(|(min, size)| {
                    let min = Vec3::from_array(*min) * scale;
                    Aabb { min, max: min + Vec3::from_array(*size) * scale }
                })
                .collect();
            let node = Node::enclosing(&boxes);
            for (slot, child) in boxes.iter().enumerate() {
                prop_assert!(
                    node.child_holds(slot, child),
                    "child {slot} {child:?} sticks out of {:?}",
                    [0, 1, 2].map(|axis| node.interval(slot, axis))
                );
            }
        }
    }
}
