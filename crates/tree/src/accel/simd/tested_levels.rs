//! The SIMD levels that the tests of all crates use.

use std::cell::Cell;

use super::SimdLevel;

/// All levels of this machine, slowest first. Prints them once per thread; each test has its own thread unless the
/// harness runs on a single one.
///
/// # Panics
/// If the levels that the crate supports are not those of the machine, so that a test would skip one.
#[expect(clippy::print_stdout, reason = "test output shows which levels were tested")]
#[track_caller]
pub fn tested_levels() -> Vec<SimdLevel> {
    thread_local!(static IS_PRINTED: Cell<bool> = const { Cell::new(false) });
    let detected = detected_levels();
    let is_supported = |level: &SimdLevel| level.is_supported();
    let (offered, others): (Vec<_>, Vec<_>) = SimdLevel::ALL.into_iter().partition(is_supported);
    assert_eq!(offered, detected, "levels of the crate (left) and of the machine (right) differ");
    if !IS_PRINTED.replace(true) {
        let names =
            |levels: &[SimdLevel]| levels.iter().map(|l| l.name()).collect::<Vec<_>>().join(", ");
        println!(
            "SIMD levels tested: {}; not on this machine: {}",
            names(&offered),
            names(&others)
        );
    }
    offered
}

/// The levels of the machine, detected independently of the crate.
fn detected_levels() -> Vec<SimdLevel> {
    let mut levels = vec![SimdLevel::Portable];
    #[cfg(target_arch = "aarch64")]
    if std::arch::is_aarch64_feature_detected!("neon") {
        levels.push(SimdLevel::Neon);
    }
    #[cfg(target_arch = "x86_64")]
    {
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            levels.push(SimdLevel::Avx2);
        }
        let has_avx512 = is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512bw")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512vl");
        if has_avx512 {
            levels.push(SimdLevel::Avx512);
        }
    }
    levels
}
