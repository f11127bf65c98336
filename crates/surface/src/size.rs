//! Estimates what the surface of some particles takes, from which the memory of frames like it is predicted.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::smooth::GridSize;
use super::spray::without_spray;
use super::{SurfaceKind, SurfaceSettings};

/// What depends on the places of particles, and not only on their number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct SurfaceSize {
    /// Number of particles.
    pub particles: u64,
    /// Number of particles that are spray.
    pub spray: u64,
    /// Number of drops of whitewater.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub drops: u64,
    /// The grid of a smooth surface of the others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grid: Option<GridSize>,
}

impl SurfaceSize {
    /// The size of the surface with `settings` of particles with `centers` and one `radius`.
    pub fn of(centers: &[Vec3], radius: f32, settings: &SurfaceSettings) -> Self {
        let own = settings.spray.then(|| without_spray(centers, settings.support() * radius));
        let body = own.as_deref().unwrap_or(centers);
        Self {
            particles: centers.len() as u64,
            spray: (centers.len() - body.len()) as u64,
            drops: 0,
            grid: (settings.kind == SurfaceKind::Smooth)
                .then(|| GridSize::of(body, radius, settings)),
        }
    }

    /// The size with `particles` particles of the same flow, and with bricks whose edge is `edge` times as long.
    #[must_use]
    pub fn scaled(&self, particles: u64, edge: f32) -> Self {
        let part = |count: u64| {
            let product = u128::from(count) * u128::from(particles);
            let part = product / u128::from(self.particles.max(1));
            u64::try_from(part).unwrap_or(u64::MAX)
        };
        let spray = part(self.spray);
        let grid = self.grid.map(|grid| grid.scaled(part(grid.particles), edge));
        Self { particles, spray, drops: part(self.drops), grid }
    }

    /// The larger counts of both.
    #[must_use]
    pub fn larger(self, other: Self) -> Self {
        let building = |size: &Self| size.grid.map_or(0, |grid| grid.bytes(true).building);
        Self {
            particles: self.particles.max(other.particles),
            spray: self.spray.max(other.spray),
            drops: self.drops.max(other.drops),
            grid: if building(&other) > building(&self) { other.grid } else { self.grid },
        }
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes references")]
const fn is_zero(count: &u64) -> bool {
    *count == 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spray::spray_of;
    use spherule_tree::accel::{BuildSettings, SphereRadius, Spheres, Structure, TreeBuilder};

    /// A cube of particles two radii apart, and a line of single ones.
    fn flow() -> Vec<Vec3> {
        let cube = (0..12_u8)
            .flat_map(|z| (0..12_u8).flat_map(move |y| (0..12_u8).map(move |x| [x, y, z])))
            .map(|place| Vec3::from(place.map(f32::from)));
        let line = (1..=200_u8).map(|x| Vec3::new(20.0 * f32::from(x), -3.0, 5.0));
        cube.chain(line).collect()
    }

    #[test]
    fn spray_is_counted_as_it_is_drawn() {
        let centers = flow();
        let settings =
            SurfaceSettings { kind: SurfaceKind::Smooth, spray: true, ..SurfaceSettings::DEFAULT };
        let size = SurfaceSize::of(&centers, 0.5, &settings);
        let mut trees = TreeBuilder::new();
        let spheres = Spheres { centers: &centers, radius: SphereRadius::Common(0.5) };
        trees.build(&spheres, &BuildSettings::new(Structure::Lbvh));
        let drawn = spray_of(&trees.tree().view(), settings.support());
        assert_eq!(size.spray, drawn.len() as u64);
        assert!(drawn.len() >= 200, "{}", drawn.len());
        let grid = size.grid.expect("a smooth surface");
        assert_eq!(grid.particles + size.spray, centers.len() as u64);
        let without = SurfaceSettings { spray: false, ..settings };
        let all = SurfaceSize::of(&centers, 0.5, &without).grid.expect("a smooth surface");
        assert!(all.particles == centers.len() as u64 && all.bricks > 2 * grid.bricks);
    }

    #[test]
    fn scaled_size_has_the_same_part_of_spray() {
        let size = SurfaceSize { particles: 100, spray: 25, drops: 50, grid: None };
        let larger = SurfaceSize { particles: 400, spray: 100, drops: 200, grid: None };
        assert_eq!(size.scaled(400, 1.0), larger);
        assert_eq!(SurfaceSize::default().scaled(7, 1.0).spray, 0);
    }
}
