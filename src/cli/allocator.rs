//! What the allocator does with memory that is freed.
//!
//! By default glibc learns from what is freed to keep pieces of up to 32 MiB, and keeps them for each thread
//! that has ever had some: how much a job holds then depends on which thread did what, up to twice what its
//! frames need, and nobody can foresee it.
#![cfg_attr(
    all(target_os = "linux", target_env = "gnu"),
    expect(unsafe_code, reason = "a setting of the C library; it says why it is sound")
)]

/// Pieces from this size on have pages of their own, which go back to the system when they are freed.
/// `pipeline/predict` counts on it.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const RETURNED: std::ffi::c_int = 1 << 20;

/// Free bytes at the end of a thread's memory that are kept for the next small pieces.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const KEPT: std::ffi::c_int = 2 << 20;

/// Lets large pieces go back to the system as soon as they are freed. Before there are other threads.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
pub(super) fn return_large_pieces() {
    use std::ffi::c_int;

    /// `M_TRIM_THRESHOLD` and `M_MMAP_THRESHOLD` of `malloc.h`.
    const TRIM_THRESHOLD: c_int = -1;
    const MMAP_THRESHOLD: c_int = -3;

    // SAFETY: this is the prototype in `malloc.h` of glibc, which this is only built for.
    unsafe extern "C" {
        fn mallopt(parameter: c_int, value: c_int) -> c_int;
    }
    for (parameter, value) in [(MMAP_THRESHOLD, RETURNED), (TRIM_THRESHOLD, KEPT)] {
        // SAFETY: `mallopt` takes any two integers, and any time; what it refuses stays as it is.
        let _ = unsafe { mallopt(parameter, value) };
    }
}

/// Other allocators keep less, as a rule.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(super) const fn return_large_pieces() {}
