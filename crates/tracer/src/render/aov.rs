//! The data channels of a pixel: depth, normal, position, velocity, particle.
//!
//! The mean of such values over a silhouette is meaningless, so all of them come from one sample of the pixel: the
//! nearest along the view axis, and the first in a tie.

use glam::Vec3;

/// The `id` of a pixel without a particle.
pub const NO_ID: u32 = u32::MAX;

/// The first intersection of a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DataSample {
    /// Distance along the view axis; infinite without an intersection.
    pub z: f32,
    /// Unit normal of the visible side in world space; zero without an intersection.
    pub normal: Vec3,
    /// The point in world units.
    pub position: Vec3,
    /// Velocity of the particle; zero for the ground.
    pub velocity: Vec3,
    /// Base colour without lighting, linear RGB.
    pub albedo: Vec3,
    /// The id of the particle, or [`NO_ID`].
    pub id: u32,
    /// Index of the particle in the frame, if it was looked up for a channel.
    pub particle: Option<u32>,
    /// Motion on the film to the next frame, pixels; x to the right, y up.
    pub motion: [f32; 2],
    /// Motion on the film back to the previous frame, pixels; x to the right, y up.
    pub motion_back: [f32; 2],
}

impl DataSample {
    /// A sample without an intersection.
    pub const MISS: Self = Self {
        z: f32::INFINITY,
        normal: Vec3::ZERO,
        position: Vec3::ZERO,
        velocity: Vec3::ZERO,
        albedo: Vec3::ZERO,
        id: NO_ID,
        particle: None,
        motion: [0.0; 2],
        motion_back: [0.0; 2],
    };

    /// Replaces the sample by the result of `other`, at distance `z` along the view axis, if that is nearer.
    pub fn keep_nearest(&mut self, z: f32, other: impl FnOnce() -> Self) {
        if z < self.z {
            *self = other();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_wins_and_the_first_of_equals() {
        let at = |z, id| DataSample { z, id, ..DataSample::MISS };
        let mut pixel = DataSample::MISS;
        for sample in [at(f32::INFINITY, 9), at(3.0, 1), at(2.0, 2), at(2.0, 3)] {
            pixel.keep_nearest(sample.z, || sample);
        }
        assert_eq!((pixel.z, pixel.id), (2.0, 2));
    }
}
