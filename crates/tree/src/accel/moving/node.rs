//! Nodes and blocks of moving spheres.

use glam::Vec3;

use crate::blocks::{Aabb, BLOCK_SIZE, WIDTH};

/// Boxes extend beyond their spheres by this part of the largest coordinate, for the rounding of positions in time.
const SLACK: f32 = 8.0 * f32::EPSILON;

/// A box whose planes are linear functions of time: `[low, high]` in the middle of the exposure, and their change
/// from the opening of the shutter to its closing.
#[derive(Debug, Clone, Copy)]
pub(super) struct MovingBounds {
    /// The box when the shutter opens, and when it closes; each is `[low, high]`.
    ends: [[Vec3; 2]; 2],
}

impl MovingBounds {
    pub(super) const EMPTY: Self = Self { ends: [[Vec3::INFINITY, Vec3::NEG_INFINITY]; 2] };

    pub(super) fn union(self, other: Self) -> Self {
        let join = |a: [Vec3; 2], b: [Vec3; 2]| [a[0].min(b[0]), a[1].max(b[1])];
        Self { ends: [join(self.ends[0], other.ends[0]), join(self.ends[1], other.ends[1])] }
    }
}

/// Sixteen moving spheres.
#[derive(Debug, Clone, Copy, Default)]
#[repr(C, align(64))]
pub(super) struct MovingBlock {
    /// Centres in the middle of the exposure.
    pub(super) center: [[f32; BLOCK_SIZE]; 3],
    /// Displacements from the opening of the shutter to its closing.
    pub(super) displacement: [[f32; BLOCK_SIZE]; 3],
    pub(super) radius: [f32; BLOCK_SIZE],
}

impl MovingBlock {
    pub(super) fn set(&mut self, lane: usize, center: Vec3, displacement: Vec3, radius: f32) {
        for axis in 0..3 {
            self.center[axis][lane] = center[axis];
            self.displacement[axis][lane] = displacement[axis];
        }
        self.radius[lane] = radius;
    }

    /// Centre at `time` and radius of the sphere in `lane`.
    pub(super) fn sphere(&self, lane: usize, time: f32) -> (Vec3, f32) {
        let at = |axis: usize| self.center[axis][lane] + time * self.displacement[axis][lane];
        (Vec3::new(at(0), at(1), at(2)), self.radius[lane])
    }

    pub(super) fn bounds(&self) -> MovingBounds {
        let mut bounds = MovingBounds::EMPTY;
        for (end, time) in bounds.ends.iter_mut().zip([-0.5, 0.5]) {
            for lane in 0..BLOCK_SIZE {
                let (center, radius) = self.sphere(lane, time);
                let largest = center.abs().max_element() + radius;
                let reach = Vec3::splat(radius + SLACK * largest);
                *end = [end[0].min(center - reach), end[1].max(center + reach)];
            }
        }
        bounds
    }
}

/// Up to eight moving boxes.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct MovingNode {
    /// Planes in the middle of the exposure: low and high, per axis.
    pub(super) planes: [[[f32; WIDTH]; 3]; 2],
    /// Their change from the opening of the shutter to its closing.
    pub(super) changes: [[[f32; WIDTH]; 3]; 2],
    /// Codes of the children.
    pub(super) children: [u32; WIDTH],
}

impl MovingNode {
    /// A node without children.
    pub(super) const EMPTY: Self = Self {
        planes: [[[f32::INFINITY; WIDTH]; 3], [[f32::NEG_INFINITY; WIDTH]; 3]],
        changes: [[[0.0; WIDTH]; 3]; 2],
        children: [0; WIDTH],
    };

    /// Sets the child in `slot`.
    pub(super) fn set(&mut self, slot: usize, bounds: &MovingBounds, code: u32) {
        for side in 0..2 {
            let [open, close] = [bounds.ends[0][side], bounds.ends[1][side]];
            // Widen the box by the rounding of the two sums
            let slack = SLACK * open.abs().max(close.abs());
            let outwards = if side == 0 { -slack } else { slack };
            let (middle, change) = (0.5 * (open + close) + outwards, close - open);
            for axis in 0..3 {
                self.planes[side][axis][slot] = middle[axis];
                self.changes[side][axis][slot] = change[axis];
            }
        }
        self.children[slot] = code;
    }

    /// The box of all children during the whole exposure.
    pub(super) fn swept_bounds(&self) -> Aabb {
        let mut bounds = Aabb::EMPTY;
        for axis in 0..3 {
            for slot in 0..WIDTH {
                for time in [-0.5, 0.5] {
                    let at = |side: usize| {
                        self.planes[side][axis][slot] + time * self.changes[side][axis][slot]
                    };
                    bounds.min[axis] = bounds.min[axis].min(at(0));
                    bounds.max[axis] = bounds.max[axis].max(at(1));
                }
            }
        }
        bounds.rounded_outwards()
    }

    /// The node with `first` added to the indices of its nodes below.
    pub(super) fn moved_by(mut self, first: u32) -> Self {
        for code in &mut self.children {
            if *code & BLOCK == 0 {
                *code += first;
            }
        }
        self
    }
}

/// The bit that is set in codes of blocks; the other bits are the index of a node or block.
pub(super) const BLOCK: u32 = 1 << 31;
