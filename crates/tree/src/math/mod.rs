//! Arithmetic on 16 lanes at once: elementary functions for shading, and the compilation of plain loops over lanes
//! for each instruction set.
//!
//! Bodies are plain Rust over arrays of [`LANES`] numbers. `lane_kernel!` compiles a body once for each instruction
//! set, and selects one at run time. No body uses fused multiply-add or the C library, so all instruction sets,
//! compiler back ends and platforms give the same bits.

mod dispatch;
pub mod functions;

pub use dispatch::SimdLevel;
pub use dispatch::{Supported, lane_kernel};

/// Number of lanes, that of a 512-bit register.
pub const LANES: usize = 16;

/// One number per lane.
pub type Lanes = [f32; LANES];

/// A vector or a linear RGB colour per lane, one array per component.
pub type Lanes3 = [Lanes; 3];

/// An integer per lane.
pub type Integers = [i32; LANES];

/// `value` in single precision, in which everything is traced.
#[expect(clippy::cast_possible_truncation, reason = "what is traced is f32")]
pub const fn narrow(value: f64) -> f32 {
    value as f32
}

/// The same number in all lanes.
pub const fn splat(value: f32) -> Lanes {
    [value; LANES]
}

/// The same vector in all lanes.
pub fn splat3(value: glam::Vec3) -> Lanes3 {
    value.to_array().map(splat)
}

/// The vector in `lane`.
///
/// # Panics
/// If the lane does not exist.
#[inline(always)]
pub fn lane3(lanes: &Lanes3, lane: usize) -> glam::Vec3 {
    glam::Vec3::new(lanes[0][lane], lanes[1][lane], lanes[2][lane])
}

/// Stores `value` in `lane`.
///
/// # Panics
/// If the lane does not exist.
#[inline(always)]
pub fn set_lane3(lanes: &mut Lanes3, lane: usize, value: glam::Vec3) {
    for (axis, lanes) in lanes.iter_mut().enumerate() {
        lanes[lane] = value[axis];
    }
}

/// The smaller number, as SIMD instructions compute it: `b` if either is NaN.
#[inline(always)]
pub const fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// The larger number, as SIMD instructions compute it: `b` if either is NaN.
#[inline(always)]
pub const fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// Reduces all lanes to one number by repeatedly combining halves: a fixed order that compilers turn into operations
/// on whole registers.
#[inline(always)]
pub fn fold(mut lanes: Lanes, of: impl Fn(f32, f32) -> f32) -> f32 {
    macro_rules! halve {
        ($($half:literal)*) => {$(
            for lane in 0..$half {
                lanes[lane] = of(lanes[lane], lanes[lane + $half]);
            }
        )*};
    }
    halve!(8 4 2 1);
    lanes[0]
}

/// Indices of the lanes that are set in `mask`, ascending.
#[inline(always)]
pub const fn lanes_in(mask: u32) -> LanesIn {
    LanesIn(mask)
}

/// The iterator of [`lanes_in`]. It is a type and not a closure, because all code of a kernel must be inlined to be
/// compiled with its instructions.
#[derive(Debug, Clone, Copy)]
pub struct LanesIn(u32);

impl LanesIn {
    /// The mask of those lanes for which `holds`.
    #[inline(always)]
    pub fn mask_where(self, holds: impl Fn(usize) -> bool) -> u32 {
        self.fold(0, |mask, lane| mask | u32::from(holds(lane)) << lane)
    }
}

/// The mask of those of all lanes for which `holds`.
#[inline(always)]
pub fn lanes_where(holds: impl Fn(usize) -> bool) -> u32 {
    (0..LANES).fold(0, |mask, lane| mask | u32::from(holds(lane)) << lane)
}

impl Iterator for LanesIn {
    type Item = usize;

    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        if self.0 == 0 {
            return None;
        }
        let lane = self.0.trailing_zeros() as usize & (LANES - 1);
        self.0 &= self.0 - 1;
        Some(lane)
    }
}

/// Bit mask of the first `count` lanes.
#[inline(always)]
pub const fn first_lanes(count: usize) -> u32 {
    debug_assert!(count <= LANES);
    (1_u32 << count) - 1
}
