//! Kernels in AVX2 and AVX-512 intrinsics, and the entry points that enable these instructions.
//!
//! The methods of the kernels are inlined into the functions at the end of this file, which have the target features
//! and are only called if the machine supports them.
#![expect(unsafe_code, reason = "intrinsics; every block says why it is sound")]

use super::{KernelTask, SimdLevel, Supported};

mod avx2;
mod avx2_lanes;
mod avx2_packet;
mod avx512;
mod avx512_packet;
mod beam;
mod decode;
mod lanes;
mod slab;

use avx2::Avx2;
use avx512::Avx512;

/// Defines the function that runs a task with the instructions of a kernel.
macro_rules! compiled {
    ($run:ident, $kernel:expr, $level:path, $features:literal) => {
        /// # Panics
        /// If `proof` is of another level.
        pub(super) fn $run<T: KernelTask>(proof: Supported, task: T) -> T::Output {
            #[target_feature(enable = $features)]
            fn with_features<T: KernelTask>(task: T) -> T::Output {
                task.run($kernel)
            }
            assert_eq!(proof.level(), $level);
            // SAFETY: a `Supported` is constructed only if the machine has the features of its level, and this one
            // has the level of these features.
            unsafe { with_features(task) }
        }
    };
}

compiled!(run_avx2, Avx2, SimdLevel::Avx2, "avx2,fma,popcnt,bmi1");
compiled!(
    run_avx512,
    Avx512,
    SimdLevel::Avx512,
    "avx2,fma,popcnt,bmi1,avx512f,avx512bw,avx512dq,avx512vl"
);
