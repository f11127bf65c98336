//! Instruction sets, and functions compiled for each of them.
#![allow(
    unsafe_code,
    reason = "calls of functions compiled for instructions that the machine was found to have"
)]

/// Instruction sets that code is compiled for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SimdLevel {
    /// Plain loops, without assumptions about the instruction set.
    Portable,
    /// 128-bit NEON, which every 64-bit Arm processor has.
    Neon,
    /// 256-bit AVX2 with fused multiply-add.
    Avx2,
    /// 512-bit AVX-512 F, BW, DQ, VL.
    Avx512,
}

impl Default for SimdLevel {
    fn default() -> Self {
        Self::best()
    }
}

impl SimdLevel {
    /// All instruction sets, slowest first.
    pub const ALL: [Self; 4] = [Self::Portable, Self::Neon, Self::Avx2, Self::Avx512];

    /// The best instruction set of this machine.
    pub fn best() -> Self {
        Self::ALL.into_iter().rev().find(|level| level.is_supported()).unwrap_or(Self::Portable)
    }

    /// Whether this machine supports it.
    pub fn is_supported(self) -> bool {
        match self {
            Self::Portable => true,
            Self::Neon => cfg!(target_arch = "aarch64"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => has_avx2(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => has_avx512(),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx2 | Self::Avx512 => false,
        }
    }

    /// Itself if it is supported, otherwise the best instruction set.
    #[must_use]
    pub fn or_best(self) -> Self {
        if self.is_supported() { self } else { Self::best() }
    }

    /// The name in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Portable => "portable",
            Self::Neon => "neon",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }
}

#[cfg(target_arch = "x86_64")]
fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("fma")
        && is_x86_feature_detected!("popcnt")
        && is_x86_feature_detected!("bmi1")
}

#[cfg(target_arch = "x86_64")]
fn has_avx512() -> bool {
    has_avx2()
        && is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl")
}

/// An instruction set that this machine is known to support: proof that code compiled for it may run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Supported(SimdLevel);

impl Supported {
    /// `level` if it is supported, otherwise the best instruction set.
    pub fn or_best(level: SimdLevel) -> Self {
        Self(level.or_best())
    }

    /// The instruction set.
    pub fn level(self) -> SimdLevel {
        self.0
    }
}

/// Defines a function from a body over lanes: `fn name(args) = body;` compiles the `#[inline(always)]` function
/// `body` once per instruction set. The first argument of the new function is the instruction set ([`Supported`]).
/// With `fn name<T: Trait>(args) = body;`, that happens for each type for which it is used.
///
/// Slices and references should be separate parameters, not fields of a structure: the compiler knows that parameters
/// do not overlap, but stops vectorising if it would have to check many fields. Everything that the body calls must
/// be `#[inline(always)]` too, including closures, otherwise it is compiled without these instructions.
#[macro_export]
macro_rules! lane_kernel {
    ($(#[$meta:meta])* $vis:vis fn $name:ident $(<$generic:ident: $bound:path>)? ($($arg:ident: $type:ty),* $(,)?) $(-> $output:ty)? = $body:path;) => {
        $(#[$meta])*
        #[allow(unsafe_code, clippy::too_many_arguments, reason = "see `math::lane_kernel`")]
        #[inline]
        $vis fn $name $(<$generic: $bound>)? (level: $crate::math::Supported, $($arg: $type),*) $(-> $output)? {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2,fma,popcnt,bmi1,avx512f,avx512bw,avx512dq,avx512vl")]
                fn avx512 $(<$generic: $bound>)? ($($arg: $type),*) $(-> $output)? {
                    $body($($arg),*)
                }
                #[target_feature(enable = "avx2,fma,popcnt,bmi1")]
                fn avx2 $(<$generic: $bound>)? ($($arg: $type),*) $(-> $output)? {
                    $body($($arg),*)
                }
                match level.level() {
                    // SAFETY: `Supported` guarantees that the machine has the instructions of its level.
                    $crate::math::SimdLevel::Avx512 => return unsafe { avx512($($arg),*) },
                    // SAFETY: as above.
                    $crate::math::SimdLevel::Avx2 => return unsafe { avx2($($arg),*) },
                    $crate::math::SimdLevel::Portable | $crate::math::SimdLevel::Neon => {}
                }
            }
            #[cfg(not(target_arch = "x86_64"))]
            let _ = level;
            $body($($arg),*)
        }
    };
}
#[doc(inline)]
pub use lane_kernel;
