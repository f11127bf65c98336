//! The data of a pixel beside its colour: depth, normal, place, velocity, particle.
//!
//! Such values have no meaningful mean over a silhouette, so a pixel takes them all from one of its
//! samples: the nearest along the view axis, the first of equal ones.

use glam::Vec3;

/// The `id` of a pixel that shows no particle.
pub const NO_ID: u32 = u32::MAX;

/// What one sample met first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DataSample {
    /// Distance along the view axis; infinite if nothing was met.
    pub z: f32,
    /// Unit normal of the visible side in world space; zero if nothing was met.
    pub normal: Vec3,
    /// The place in world units.
    pub position: Vec3,
    /// The particle's velocity; zero for the ground.
    pub velocity: Vec3,
    /// Base colour before light, linear RGB.
    pub albedo: Vec3,
    /// The particle's id, or [`NO_ID`].
    pub id: u32,
}

impl DataSample {
    /// A sample that met nothing.
    pub const MISS: Self = Self {
        z: f32::INFINITY,
        normal: Vec3::ZERO,
        position: Vec3::ZERO,
        velocity: Vec3::ZERO,
        albedo: Vec3::ZERO,
        id: NO_ID,
    };

    /// Takes what `other` makes, at distance `z` along the view axis, if that is nearer.
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
        let at = |z, id| DataSample {
            z,
            id,
            ..DataSample::MISS
        };
        let mut pixel = DataSample::MISS;
        for sample in [at(f32::INFINITY, 9), at(3.0, 1), at(2.0, 2), at(2.0, 3)] {
            pixel.keep_nearest(sample.z, || sample);
        }
        assert_eq!((pixel.z, pixel.id), (2.0, 2));
    }
}
