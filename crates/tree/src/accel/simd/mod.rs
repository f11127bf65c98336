//! Tests of nodes and blocks with the SIMD instructions of the machine.
//!
//! The instruction set is detected at run time, once per tree, so that a default build is fast on all machines. All
//! instruction sets with fused multiply-add give the same results to the bit; the portable kernel may differ in the
//! last bit.

use glam::Vec3;

use crate::blocks::{
    BLOCK_SIZE, Block, BlockFrame, BlockRadii, CompactBlock, Node, Q10Block, Q16Block, WIDTH,
};
pub use crate::math::SimdLevel;
pub(super) use crate::math::Supported;
use crate::ray::Ray;

mod beam;
mod loop_packet;
#[cfg(target_arch = "aarch64")]
mod neon;
mod packet;
mod portable;
#[cfg(target_arch = "x86_64")]
mod x86;

pub(super) use beam::{Beam, lanes_entering};
pub(super) use packet::{EnteredChildren, LaneSlabs, PacketKernel, PacketSphere};

/// Slack of the slab test as a fraction of the larger terms: covers the rounding of planes, inverses and products
/// (about five roundings of 2^-24), so that no sphere is lost at the edge of a box.
pub(super) const SLAB_SLACK: f32 = 1e-6;
/// Bytes of a cache line.
const LINE: usize = 64;
/// Minimum absolute component of a direction in the slab test, so that inverses are finite.
const MIN_DIRECTION: f32 = 1e-7;

/// Inverse direction with finite components.
#[inline(always)]
pub(super) fn finite_inverse(direction: Vec3) -> Vec3 {
    direction.map(|d| if d.abs() < MIN_DIRECTION { MIN_DIRECTION.copysign(d) } else { d }).recip()
}

/// The tests of a traversal, for one instruction set.
pub(super) trait Kernel: Copy {
    /// A ray in the form that all tests need.
    type Ray;
    /// Keys of the children that a ray enters, packed. A key has the bits of the entry distance; its low three bits
    /// are replaced by the slot of the child.
    type Keys: Copy;

    /// Prepares `ray` with its [`finite_inverse`] direction for spheres of a common `radius` (0 for a radius per
    /// sphere) in boxes that must be extended by `padding` on every side.
    fn prepare(self, ray: &Ray, inverse: Vec3, radius: f32, padding: f32) -> Self::Ray;

    /// Tests the children of `node` up to distance `limit`. Returns the number of children that the ray enters, and
    /// their keys in slot order.
    fn test_node(self, ray: &Self::Ray, node: &Node, limit: f32) -> (usize, Self::Keys);

    /// The first two keys, without a store to memory: most nodes have no more.
    fn first_two(self, keys: Self::Keys) -> [u32; 2];

    /// All keys.
    fn all_keys(self, keys: Self::Keys) -> [u32; WIDTH];

    /// The smallest distance in `t_min..=limit` at which the ray intersects a sphere of `block`, and the lanes with
    /// this distance. `radii` is None for a common radius.
    fn nearest_in_block(
        self,
        ray: &Self::Ray,
        block: &Block,
        radii: Option<&BlockRadii>,
        limit: f32,
    ) -> Option<(f32, u32)>;

    /// Whether the ray intersects any sphere of `block` within `t_min..=limit`.
    fn any_in_block(
        self,
        ray: &Self::Ray,
        block: &Block,
        radii: Option<&BlockRadii>,
        limit: f32,
    ) -> bool;

    /// Both intersections of each sphere with the line of the ray.
    fn all_in_block(
        self,
        ray: &Self::Ray,
        block: &Block,
        radii: Option<&BlockRadii>,
    ) -> BlockCrossings;

    /// [`CompactBlock::decode`]; the same result to the bit.
    #[inline(always)]
    fn decode_q10(self, block: &Q10Block, frame: &BlockFrame) -> Block {
        block.decode(frame)
    }

    /// [`CompactBlock::decode`]; the same result to the bit.
    #[inline(always)]
    fn decode_q16(self, block: &Q16Block, frame: &BlockFrame) -> Block {
        block.decode(frame)
    }

    /// Prefetches a node or block.
    fn prefetch<T>(self, value: &T);
}

/// Both intersections of each sphere of a block with the line of a ray.
pub(super) struct BlockCrossings {
    /// Lanes of the spheres that the line intersects.
    pub(super) lanes: u32,
    /// Distance of the first intersection.
    pub(super) near: [f32; BLOCK_SIZE],
    /// Distance of the second intersection.
    pub(super) far: [f32; BLOCK_SIZE],
}

impl BlockCrossings {
    /// No intersections.
    const NONE: Self = Self { lanes: 0, near: [0.0; BLOCK_SIZE], far: [0.0; BLOCK_SIZE] };
}

/// Code that uses a kernel, compiled for each instruction set. `run` should be `inline(always)`, so that all of it is
/// compiled with these instructions.
pub(super) trait KernelTask {
    /// The result.
    type Output;

    /// Runs the task.
    fn run<K: PacketKernel>(self, kernel: K) -> Self::Output;
}

/// Runs tasks with the kernel of an instruction set that the machine supports.
pub(super) trait RunTask {
    /// Runs `task` with the kernel of this instruction set.
    fn run<T: KernelTask>(self, task: T) -> T::Output;
}

impl RunTask for Supported {
    #[inline]
    fn run<T: KernelTask>(self, task: T) -> T::Output {
        match self.level() {
            #[cfg(target_arch = "aarch64")]
            SimdLevel::Neon => task.run(neon::Neon),
            #[cfg(target_arch = "x86_64")]
            SimdLevel::Avx512 => x86::run_avx512(self, task),
            #[cfg(target_arch = "x86_64")]
            SimdLevel::Avx2 => x86::run_avx2(self, task),
            _ => task.run(portable::Portable),
        }
    }
}

/// Arithmetic on plain arrays, which the compiler vectorises for each instruction set. `run` and everything that it
/// calls should be `inline(always)`. Operations are only fused if the code does so explicitly, so all instruction
/// sets give the same bits.
pub trait ArrayTask {
    /// The result.
    type Output;

    /// Runs the task.
    fn run(self) -> Self::Output;
}

struct OnArrays<T>(T);

impl<T: ArrayTask> KernelTask for OnArrays<T> {
    type Output = T::Output;

    #[inline(always)]
    fn run<K: PacketKernel>(self, _: K) -> T::Output {
        self.0.run()
    }
}

/// Compiles [`ArrayTask`]s for the best instruction set of this machine.
#[derive(Debug, Clone, Copy, Default)]
pub struct ArrayLanes(Supported);

impl ArrayLanes {
    /// Runs `task`.
    #[inline]
    pub fn run<T: ArrayTask>(self, task: T) -> T::Output {
        self.0.run(OnArrays(task))
    }
}

#[doc(hidden)]
pub mod tested_levels;
#[cfg(test)]
mod tests;
