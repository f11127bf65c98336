//! Nodes of the tree, and beams of rays that enter them.

#![expect(clippy::needless_range_loop, reason = "one index for the lanes of many arrays")]

use super::rays::LocalRays;
use spherule_tree::math::{LANES, Lanes, Lanes3, fold, larger, smaller};

/// Children of a node.
pub(super) const WIDTH: usize = 8;

/// Entry distances may be too large, and exit distances too small, by this part.
const ROUNDING: f32 = 8.0 * f32::EPSILON;

/// Least absolute component of a direction in tests of boxes, so that no distance is infinite times zero.
const MIN_COMPONENT: f32 = 1e-18;

/// A node or a leaf: the index of a node, or of a grain.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Code(pub(super) u32);

/// The bit of leaves.
const LEAF: u32 = 1 << 31;

impl Code {
    /// The leaf with the grain in `slot`.
    pub(super) const fn leaf(slot: u32) -> Self {
        Self(LEAF | slot)
    }

    /// The grain of a leaf; None for a node.
    #[inline(always)]
    pub(super) const fn as_leaf(self) -> Option<u32> {
        if self.0 & LEAF == 0 { None } else { Some(self.0 & !LEAF) }
    }

    /// The code with `first` added to the index of a node.
    pub(super) const fn moved_by(self, first: u32) -> Self {
        Self(if self.0 & LEAF == 0 { self.0 + first } else { self.0 })
    }
}

/// Up to eight boxes.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(32))]
pub(super) struct Node {
    /// Planes: low and high, per axis.
    pub(super) planes: [[[f32; WIDTH]; 3]; 2],
    pub(super) children: [Code; WIDTH],
}

impl Node {
    /// A node without children.
    pub(super) const EMPTY: Self = Self {
        planes: [[[f32::INFINITY; WIDTH]; 3], [[f32::NEG_INFINITY; WIDTH]; 3]],
        children: [Code(0); WIDTH],
    };

    /// Sets the child in `slot`, with the lowest and the highest corner of its box.
    pub(super) fn set(&mut self, slot: usize, [low, high]: [[f32; 3]; 2], code: Code) {
        for axis in 0..3 {
            self.planes[0][axis][slot] = low[axis];
            self.planes[1][axis][slot] = high[axis];
        }
        self.children[slot] = code;
    }

    /// Whether there is a child in `slot`.
    #[inline(always)]
    pub(super) fn has_child(&self, slot: usize) -> bool {
        self.planes[0][0][slot] <= self.planes[1][0][slot]
    }

    /// The node with `first` added to the indices of its nodes below.
    pub(super) fn moved_by(mut self, first: u32) -> Self {
        self.children = self.children.map(|code| code.moved_by(first));
        self
    }
}

/// Bounds of some rays whose directions have the same signs: a box that they miss is missed by each of these rays. Boxes
/// are tested by interval arithmetic (Wald, Boulos and Shirley, "Ray tracing deformable scenes using dynamic bounding
/// volume hierarchies", 2007, section 4.2). For a single ray, it is the usual test of slabs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Beam {
    /// The bound of the origins for which near planes are nearest, and that for which far planes are farthest.
    origins: [[f32; 3]; 2],
    /// Least and greatest component of the inverse directions.
    inverses: [[f32; 3]; 2],
    /// Which planes are near: 1 if directions are negative.
    near_side: [usize; 3],
    /// The least distance at which a ray starts.
    start: f32,
}

impl Beam {
    /// The beam around the rays of `lanes`.
    #[inline(always)]
    pub(super) fn around(rays: &LocalRays, lanes: u32) -> Self {
        let mut beam = Self {
            origins: [[0.0; 3]; 2],
            inverses: [[0.0; 3]; 2],
            near_side: [0; 3],
            start: range_of(&rays.from, lanes)[0],
        };
        for axis in 0..3 {
            let mut inverses = rays.direction[axis];
            for component in &mut inverses {
                *component = inverse(*component);
            }
            let [least, most] = range_of(&inverses, lanes);
            let [low, high] = range_of(&rays.origin[axis], lanes);
            let is_negative = usize::from(least < 0.0);
            beam.near_side[axis] = is_negative;
            beam.origins[is_negative][axis] = high;
            beam.origins[1 - is_negative][axis] = low;
            beam.inverses[0][axis] = least;
            beam.inverses[1][axis] = most;
        }
        beam
    }

    /// The ray in `lane`.
    #[inline(always)]
    pub(super) fn of(rays: &LocalRays, lane: usize) -> Self {
        let origin = [rays.origin[0][lane], rays.origin[1][lane], rays.origin[2][lane]];
        let mut inverses = [0.0; 3];
        let mut near_side = [0; 3];
        for axis in 0..3 {
            inverses[axis] = inverse(rays.direction[axis][lane]);
            near_side[axis] = usize::from(inverses[axis] < 0.0);
        }
        Self { origins: [origin; 2], inverses: [inverses; 2], near_side, start: rays.from[lane] }
    }

    /// Distances at which the first ray enters the boxes of `node`; infinite for boxes that no ray enters before
    /// `limit`. `IS_RAY`: the beam is a single ray.
    #[inline(always)]
    pub(super) fn entries<const IS_RAY: bool>(&self, node: &Node, limit: f32) -> [f32; WIDTH] {
        let (mut enter, mut exit) = ([self.start; WIDTH], [limit; WIDTH]);
        for axis in 0..3 {
            let near = &node.planes[self.near_side[axis]][axis];
            let far = &node.planes[1 - self.near_side[axis]][axis];
            let [near_origin, far_origin] = [self.origins[0][axis], self.origins[1][axis]];
            let [least, most] = [self.inverses[0][axis], self.inverses[1][axis]];
            for i in 0..WIDTH {
                let (a, b) = (near[i] - near_origin, far[i] - far_origin);
                let [first, last] = if IS_RAY {
                    [a * least, b * least]
                } else {
                    [smaller(a * least, a * most), larger(b * least, b * most)]
                };
                enter[i] = larger(first, enter[i]);
                exit[i] = smaller(last, exit[i]);
            }
        }
        for i in 0..WIDTH {
            let is_entered = enter[i] * (1.0 - ROUNDING) <= exit[i] * (1.0 + ROUNDING);
            enter[i] = if is_entered { enter[i] } else { f32::INFINITY };
        }
        enter
    }
}

/// The inverse directions of all rays.
#[inline(always)]
pub(super) fn inverses(rays: &LocalRays) -> Lanes3 {
    let mut inverses = rays.direction;
    for component in inverses.iter_mut().flatten() {
        *component = inverse(*component);
    }
    inverses
}

/// The least distance at which a ray enters the box of `child`, and the rays that enter it before their `limits`. A
/// ray does so exactly if [`Beam::entries`] says so for it alone.
#[inline(always)]
pub(super) fn lanes_entering(
    node: &Node,
    child: usize,
    rays: &LocalRays,
    inverses: &Lanes3,
    limits: &Lanes,
) -> (f32, u32) {
    let (mut enter, mut exit) = (rays.from, *limits);
    for axis in 0..3 {
        let (low, high) = (node.planes[0][axis][child], node.planes[1][axis][child]);
        for l in 0..LANES {
            let (origin, inverse) = (rays.origin[axis][l], inverses[axis][l]);
            let (a, b) = ((low - origin) * inverse, (high - origin) * inverse);
            let is_forward = inverse > 0.0;
            enter[l] = larger(if is_forward { a } else { b }, enter[l]);
            exit[l] = smaller(if is_forward { b } else { a }, exit[l]);
        }
    }
    let mut lanes = 0;
    for l in 0..LANES {
        let is_entered = enter[l] * (1.0 - ROUNDING) <= exit[l] * (1.0 + ROUNDING);
        lanes |= u32::from(is_entered) << l;
        enter[l] = if is_entered { enter[l] } else { f32::INFINITY };
    }
    (fold(enter, smaller), lanes)
}

/// The least and the greatest of the values of `lanes`.
#[inline(always)]
fn range_of(values: &Lanes, lanes: u32) -> [f32; 2] {
    let (mut low, mut high) = ([f32::INFINITY; LANES], [f32::NEG_INFINITY; LANES]);
    for l in 0..LANES {
        let is_member = lanes >> l & 1 == 1;
        low[l] = if is_member { values[l] } else { low[l] };
        high[l] = if is_member { values[l] } else { high[l] };
    }
    [fold(low, smaller), fold(high, larger)]
}

/// Whether a box that is entered at distance `enter` may be entered before `limit`.
#[inline(always)]
pub(super) fn is_before(enter: f32, limit: f32) -> bool {
    enter * (1.0 - ROUNDING) <= limit * (1.0 + ROUNDING)
}

/// The inverse of a component of a direction. Its sign is that of the component, also for zeros.
#[inline(always)]
fn inverse(component: f32) -> f32 {
    let is_small = component.abs() < MIN_COMPONENT;
    1.0 / if is_small { MIN_COMPONENT.copysign(component) } else { component }
}
