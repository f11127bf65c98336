//! The results of the thesis (tables 2 to 5): i7-7700HQ at 2.8 GHz, 16 GB, GeForce GTX 1050 Ti with 4 GB, OptiX; the
//! same box, camera and depth as here, 1920x1080.

use spherule_report::THESIS_BYTES_PER_PARTICLE;

use crate::Motion;

/// The machine and settings of the thesis.
pub const MACHINE: &str = "GeForce GTX 1050 Ti 4 GB, OptiX (i7-7700HQ); 1920x1080, depth 3, 60 s";

/// Frames per second at 1e7 particles: mean and standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrameRate {
    /// Name of the structure.
    pub structure: &'static str,
    /// Motion of the camera.
    pub motion: Motion,
    /// Mean of the frames per second.
    pub mean: f64,
    /// Their standard deviation.
    pub sd: f64,
}

/// A value for a structure and a particle count.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Figure {
    /// Name of the structure.
    pub structure: &'static str,
    /// Particle count.
    pub particles: usize,
    /// The value.
    pub value: f64,
}

/// Particle count of tables 2 to 4.
pub const RATE_PARTICLES: usize = 10_000_000;

const fn rate(structure: &'static str, motion: Motion, mean: f64, sd: f64) -> FrameRate {
    FrameRate { structure, motion, mean, sd }
}

const fn figure(structure: &'static str, particles: usize, value: f64) -> Figure {
    Figure { structure, particles, value }
}

/// Tables 2 to 4.
pub const RATES: [FrameRate; 12] = [
    rate("lbvh", Motion::Rotation, 13.39, 2.78),
    rate("bvh", Motion::Rotation, 13.06, 2.73),
    rate("sbvh", Motion::Rotation, 13.23, 2.92),
    rate("kdtree", Motion::Rotation, 12.46, 2.63),
    rate("lbvh", Motion::Translation, 36.20, 23.21),
    rate("bvh", Motion::Translation, 37.52, 22.65),
    rate("sbvh", Motion::Translation, 34.51, 24.15),
    rate("kdtree", Motion::Translation, 38.38, 24.77),
    rate("lbvh", Motion::Both, 17.88, 9.27),
    rate("bvh", Motion::Both, 15.06, 8.36),
    rate("sbvh", Motion::Both, 23.62, 18.51),
    rate("kdtree", Motion::Both, 17.91, 10.55),
];

/// Build times in seconds, from the text: "about 2.5", and for sbvh "more than 80".
pub const BUILD_SECONDS: [Figure; 3] = [
    figure("lbvh", 10_000_000, 2.5),
    figure("kdtree", 10_000_000, 2.5),
    figure("sbvh", 10_000_000, 80.0),
];

/// Bytes per particle by structure.
pub const BYTES_PER_PARTICLE: [Figure; 4] = [
    figure("lbvh", 10_000_000, THESIS_BYTES_PER_PARTICLE),
    figure("kdtree", 10_000_000, THESIS_BYTES_PER_PARTICLE),
    figure("bvh", 10_000_000, THESIS_BYTES_PER_PARTICLE),
    figure("sbvh", 10_000_000, THESIS_BYTES_PER_PARTICLE),
];

/// Table 5: peak memory. Its "MB" are 1024 x 1024 bytes, because the large values are multiples of tenths of 1024.
pub const PEAK_MIB: [Figure; 12] = [
    figure("lbvh", 100_000, 524.4),
    figure("lbvh", 1_000_000, 808.0),
    figure("lbvh", 10_000_000, 3481.6),
    figure("bvh", 100_000, 531.7),
    figure("bvh", 1_000_000, 799.7),
    figure("bvh", 10_000_000, 3584.0),
    figure("sbvh", 100_000, 542.6),
    figure("sbvh", 1_000_000, 900.3),
    figure("sbvh", 10_000_000, 4403.2),
    figure("kdtree", 100_000, 529.1),
    figure("kdtree", 1_000_000, 759.1),
    figure("kdtree", 10_000_000, 3481.6),
];
