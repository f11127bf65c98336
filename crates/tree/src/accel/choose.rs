//! `auto`: chooses the structure that a frame is traced with.
//!
//! A k-d tree takes longer to build than an LBVH, but makes every ray faster. The number of rays per particle decides
//! which of the two is better. The table shows measurements on the thesis's box with radii of half the spacing, on 16
//! cores of an Intel Xeon with AVX-512, as CPU time in ns (wall-clock time times threads): the additional build time
//! of the k-d tree per particle, and the time it saves per ray of an image of 1920x1080 (2.07 million primary rays;
//! 0.6 million each for shadow and reflection).
//!
//! | particles | threads | additional build per particle | saved per ray | break-even, rays per particle |
//! |---|---|---|---|---|
//! | 1e7 | 1 | 75 | 53 | 1.4 |
//! | 1e7 | 2 | 77 | 53 | 1.5 |
//! | 1e7 | 8 | 83 | 53 | 1.6 |
//! | 1e7 | 16 | 109 | 53 | 2.1 |
//! | 1e6 | 2 | 45 | 40 | 1.1 |
//! | 1e6 | 16 | 85 | 40 | 2.1 |
//! | 1e5 | 2 | 44 | 30 | 1.5 |
//!
//! The saving per ray was measured with 16 threads and single rays, and is used in all rows. Camera and shadow rays
//! in packets save less, so the thresholds are a little above the table.
//!
//! For fewer particles the choice does not matter: both trees are built within a few milliseconds.

use super::Structure;

/// Rays per particle above which a k-d tree pays off, with few threads.
const RAYS_PER_PARTICLE: f64 = 1.4;
/// Increase of that threshold per thread: building scales a little worse than tracing.
const MORE_PER_THREAD: f64 = 0.04;
/// Largest number of threads with measurements.
const MEASURED_THREADS: usize = 16;

/// The structure with the least total time for building over `particles` and tracing `expected_rays` on `threads`
/// threads. The choice does not affect the picture.
pub fn choose(particles: usize, expected_rays: f64, threads: usize) -> Structure {
    let threads = threads.min(MEASURED_THREADS);
    let least = RAYS_PER_PARTICLE + MORE_PER_THREAD * threads as f64;
    if expected_rays >= least * particles as f64 { Structure::Kdtree } else { Structure::Lbvh }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_rays_favour_the_better_tree() {
        let full_hd = 3.3e6;
        assert_eq!(choose(100_000, full_hd, 16), Structure::Kdtree);
        assert_eq!(choose(1_000_000, full_hd, 16), Structure::Kdtree);
        assert_eq!(choose(10_000_000, full_hd, 2), Structure::Lbvh);
        assert_eq!(choose(10_000_000, 16.0 * full_hd, 16), Structure::Kdtree);
    }

    #[test]
    fn many_threads_favour_the_build_that_scales() {
        assert_eq!(choose(2_000_000, 3.3e6, 1), Structure::Kdtree);
        assert_eq!(choose(2_000_000, 3.3e6, 16), Structure::Lbvh);
        assert_eq!(choose(0, 0.0, 1), choose(0, 0.0, 1000));
    }
}
