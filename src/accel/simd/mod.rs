//! The tests of nodes and blocks in the instructions that the machine has.
//!
//! The level is found at run time, once per tree, so that a default build is fast everywhere. All
//! levels with fused multiply-add give the same results to the bit; the portable one may differ in
//! the last.

use glam::Vec3;

pub use crate::math::SimdLevel;
pub(super) use crate::math::Supported;
use crate::ray::Ray;
use spherule_formats::blocks::{
    BLOCK_SIZE, Block, BlockFrame, BlockRadii, CompactBlock, Node, Q10Block, Q16Block, WIDTH,
};

mod beam;
mod loop_packet;
#[cfg(target_arch = "aarch64")]
mod neon;
mod packet;
mod portable;
#[cfg(target_arch = "x86_64")]
mod x86;

pub(super) use beam::{Beam, lanes_near};
pub(super) use packet::{EnteredChildren, LaneSlabs, PacketKernel, PacketSphere};

/// Slack of the slab test, as a fraction of the larger terms: covers the rounding of planes,
/// inverses and products (about five roundings of 2^-24), so that no sphere is lost at a box's edge.
pub(super) const SLAB_SLACK: f32 = 1e-6;
/// Bytes of a cache line.
const LINE: usize = 64;
/// Directions are kept this far from zero in the slab test, so that their inverses are finite.
const MIN_DIRECTION: f32 = 1e-7;

/// Inverse direction with every component finite.
pub(super) fn finite_inverse(direction: Vec3) -> Vec3 {
    direction
        .map(|d| {
            if d.abs() < MIN_DIRECTION {
                MIN_DIRECTION.copysign(d)
            } else {
                d
            }
        })
        .recip()
}

/// What a traversal needs of the machine.
pub(super) trait Kernel: Copy {
    /// A ray with what all tests need of it.
    type Ray;
    /// Keys of the children that a ray enters, packed: a key is the bits of the distance of entry,
    /// the low three replaced by the child's slot.
    type Keys: Copy;

    /// Prepares `ray` for spheres of a common `radius` (0 where each has its own) in boxes that lack
    /// `padding` on every side.
    fn prepare(self, ray: &Ray, radius: f32, padding: f32) -> Self::Ray;

    /// Tests the children of `node` up to distance `limit`. Returns how many the ray enters, and
    /// their keys in slot order.
    fn test_node(self, ray: &Self::Ray, node: &Node, limit: f32) -> (usize, Self::Keys);

    /// The first two keys, without a way through memory: most nodes have no more.
    fn first_two(self, keys: Self::Keys) -> [u32; 2];

    /// All keys.
    fn all_keys(self, keys: Self::Keys) -> [u32; WIDTH];

    /// The smallest distance in `t_min..=limit` at which the ray crosses a sphere of `block`, and the
    /// lanes that have it. `radii` where they differ.
    fn nearest_in_block(
        self,
        ray: &Self::Ray,
        block: &Block,
        radii: Option<&BlockRadii>,
        limit: f32,
    ) -> Option<(f32, u32)>;

    /// Whether the ray crosses any sphere of `block` within `t_min..=limit`.
    fn any_in_block(
        self,
        ray: &Self::Ray,
        block: &Block,
        radii: Option<&BlockRadii>,
        limit: f32,
    ) -> bool;

    /// Both crossings of each sphere with the whole line of the ray.
    fn all_in_block(
        self,
        ray: &Self::Ray,
        block: &Block,
        radii: Option<&BlockRadii>,
    ) -> BlockCrossings;

    /// [`CompactBlock::decode`], the same to the bit.
    #[inline(always)]
    fn decode_q10(self, block: &Q10Block, frame: &BlockFrame) -> Block {
        block.decode(frame)
    }

    /// [`CompactBlock::decode`], the same to the bit.
    #[inline(always)]
    fn decode_q16(self, block: &Q16Block, frame: &BlockFrame) -> Block {
        block.decode(frame)
    }

    /// Asks for the memory of a node or block ahead of time.
    fn prefetch<T>(self, value: &T);
}

/// Both crossings of each sphere of a block with the line of a ray.
pub(super) struct BlockCrossings {
    /// Lanes whose sphere the line meets.
    pub(super) lanes: u32,
    /// Distance of the first crossing.
    pub(super) near: [f32; BLOCK_SIZE],
    /// Distance of the second.
    pub(super) far: [f32; BLOCK_SIZE],
}

impl BlockCrossings {
    /// No lane is met.
    const NONE: Self = Self {
        lanes: 0,
        near: [0.0; BLOCK_SIZE],
        far: [0.0; BLOCK_SIZE],
    };
}

/// Something to be done with a kernel, compiled for each level. `run` should be `inline(always)`, so
/// that all of it gets the level's instructions.
pub(super) trait KernelTask {
    /// What comes of it.
    type Output;

    /// Does it.
    fn run<K: PacketKernel>(self, kernel: K) -> Self::Output;
}

/// Runs tasks with the kernel of a level that the machine has.
pub(super) trait RunTask {
    /// Does `task` with the kernel of this level.
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

/// Arithmetic on plain arrays, which the compiler turns into the instructions of each level. `run` and
/// all that it calls should be `inline(always)`. Nothing is contracted into fused operations unless it
/// says so, so every level gives the same bits.
pub(crate) trait ArrayTask {
    /// What comes of it.
    type Output;

    /// Does it.
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

/// Compiles [`ArrayTask`]s for the best level of this machine.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct ArrayLanes(Supported);

impl ArrayLanes {
    /// Does `task`.
    #[inline]
    pub(crate) fn run<T: ArrayTask>(self, task: T) -> T::Output {
        self.0.run(OnArrays(task))
    }
}

#[cfg(test)]
pub(crate) mod tested_levels;
#[cfg(test)]
mod tests;
