//! What a sampled frame takes, from which the memory of other frames is predicted.

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};
use spherule_formats::{Positions, Radius, RawParticles, choose_origin, find_radius, is_near};
use spherule_surface::whitewater::{Flow, drop_counts};
use spherule_surface::{SurfaceSettings, SurfaceSize};
use spherule_tree::math::narrow;

use super::packing::Spacing;
use super::robust::{median, robust_bounds, robust_largest};
use super::{RadiusQuestion, velocity_of};

/// Speeds for which drops of whitewater are counted, in speeds of the fastest particles of a frame.
const SPEED_STEPS: [f32; 8] = [1.0, 1.3, 1.7, 2.2, 3.0, 5.0, 10.0, 30.0];

/// Maximum number of frames whose surface is surveyed.
const MAX_SURFACES: usize = 6;

/// Sizes and counts of a frame that was read, from which those of other frames are estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct FrameWeight {
    /// Particle count, including particles that are not finite.
    pub particles: u64,
    /// Total size of its files in bytes, after decompression of gzip.
    pub stored: u64,
    /// Size of its largest file in bytes, uncompressed.
    pub content: u64,
    /// Size of the numbers in its files, bytes.
    pub raw: u64,
    /// Size of the positions among them, bytes.
    pub positions: u64,
    /// Number of files.
    pub files: u64,
    /// Whether it has a radius per particle.
    pub own_radii: bool,
    /// Whether it has ids.
    pub ids: bool,
    /// Whether it has velocities.
    pub velocities: bool,
    /// Whether it is a native frame relative to the origin of the sequence, so that it can be traced in place.
    #[serde(default)]
    pub in_place: bool,
}

/// What a job needs to know about its surface, if that has a grid or spray.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceQuestion {
    /// The surface.
    pub settings: SurfaceSettings,
    /// The radius of all particles, if the user gives one.
    pub radius: Option<f32>,
}

/// The size of the surface of a frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SurfaceWeight {
    /// Index of the frame in the sequence.
    pub index: usize,
    /// Its particle count, including particles that are not drawn.
    pub particles: u64,
    /// The radius of all particles; None if the frame has radii.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius: Option<f32>,
    /// Edge of a voxel in particle radii.
    pub voxel: f32,
    /// The size, without drops of whitewater.
    pub size: SurfaceSize,
    /// Numbers of drops of whitewater, by rising speeds. Jobs without whitewater have none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub whitewater: Vec<DropCount>,
}

/// The number of drops of whitewater in a frame at some speed of violent water.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DropCount {
    /// The speed, scene units per unit of time.
    pub speed: f32,
    /// The number.
    pub drops: u64,
}

impl SurfaceWeight {
    /// The size of the surface of `frame`, with its index and its number of particles before the selection. None if
    /// there is no radius.
    pub(super) fn of(
        frame: &RawParticles,
        (index, particles): (usize, u64),
        spacing: Option<Spacing>,
        question: SurfaceQuestion,
        radii: RadiusQuestion<'_>,
    ) -> Option<Self> {
        let estimated = || spacing.map(|spacing| spacing.packed.unwrap_or(spacing.touching));
        let own = match question.radius {
            Some(_) => None,
            None => own_radius(frame, radii),
        };
        let common = question.radius.or_else(|| if own.is_some() { None } else { estimated() });
        let radius = own.or(common).filter(|radius| *radius > 0.0 && radius.is_finite())?;
        Some(Self {
            index,
            particles,
            radius: common,
            voxel: question.settings.voxel,
            size: SurfaceSize::of(&centers(&frame.positions)?, radius, &question.settings),
            whitewater: whitewater_of(frame, radius, &question.settings).unwrap_or_default(),
        })
    }

    /// The size of the surface of a frame with `particles` particles, in voxels with the edge `voxel` in radii. `radius`
    /// is the radius of all particles, if they have one, and `speed` that of violent water, if there is whitewater.
    pub fn scaled(
        &self,
        particles: u64,
        voxel: f32,
        radius: Option<f32>,
        speed: Option<f32>,
    ) -> SurfaceSize {
        let radii = self.radius.zip(radius).map_or(1.0, |(own, other)| other / own);
        let product = u128::from(self.size.particles) * u128::from(particles);
        let drawn = u64::try_from(product / u128::from(self.particles.max(1))).unwrap_or(u64::MAX);
        let size = SurfaceSize { drops: self.drops_at(speed), ..self.size };
        size.scaled(drawn, radii * voxel / self.voxel)
    }

    /// Upper bound of the number of drops of whitewater at a speed of violent water: that of the next lower speed.
    fn drops_at(&self, speed: Option<f32>) -> u64 {
        let lower = |count: &&DropCount| speed.is_some_and(|speed| count.speed <= speed);
        let found = self.whitewater.iter().rfind(lower).or(self.whitewater.first());
        found.filter(|_| speed.is_some()).map_or(0, |count| count.drops)
    }
}

/// The numbers of drops of whitewater of `frame`, whose particles have this radius; None if there is none. The speed of
/// violent water of the job is at least that of the frame.
fn whitewater_of(
    frame: &RawParticles,
    radius: f32,
    settings: &SurfaceSettings,
) -> Option<Vec<DropCount>> {
    let velocity = velocity_of(&frame.attributes).filter(|_| settings.whitewater)?;
    let component = |i: usize, c: usize| narrow(velocity.data.get_f64(3 * i + c));
    let origin = origin_of(&frame.positions)?;
    // Leave out those that are too far away
    let place = |i: &usize| (frame.positions.get(*i) - origin).as_vec3();
    let kept: Vec<usize> = (0..frame.positions.len()).filter(|i| is_near(&place(i))).collect();
    let centers: Vec<Vec3> = kept.iter().map(place).collect();
    let velocities: Vec<Vec3> =
        kept.iter().map(|i| Vec3::from([0, 1, 2].map(|c| component(*i, c)))).collect();
    let speeds = match settings.whitewater_speed {
        Some(speed) => vec![speed],
        None => {
            let own = robust_largest(velocities.len(), |i| velocities[i].length());
            SPEED_STEPS.map(|factor| factor * own).to_vec()
        }
    };
    let flow = Flow { centers: &centers, velocities: &velocities, ids: None, radius };
    let counts = drop_counts(flow, &speeds, settings.whitewater_amount);
    let counts = speeds.into_iter().zip(counts);
    Some(counts.map(|(speed, drops)| DropCount { speed, drops }).collect())
}

/// An origin among positions.
fn origin_of(positions: &Positions) -> Option<DVec3> {
    let bounds = robust_bounds(positions, None)?;
    Some(choose_origin(bounds.outer.0, bounds.outer.1))
}

/// The positions relative to an origin among them, without those that are too far away.
fn centers(positions: &Positions) -> Option<Vec<Vec3>> {
    let origin = origin_of(positions)?;
    let relative = (0..positions.len()).map(|i| (positions.get(i) - origin).as_vec3());
    Some(relative.filter(is_near).collect())
}

/// The median of the radii that `frame` has, in its file or by an attribute.
fn own_radius(frame: &RawParticles, radii: RadiusQuestion<'_>) -> Option<f32> {
    if matches!(radii, RadiusQuestion::Attribute(..) | RadiusQuestion::Table(..)) {
        let radius = |i| radii.radius_by_attribute(&frame.attributes, i).map(narrow);
        return median((0..frame.positions.len()).filter_map(radius).collect());
    }
    match find_radius(&frame.attributes)? {
        Radius::Common(radius) => Some(radius),
        Radius::PerParticle(radii) => median(radii),
    }
}

/// The places in a list of `count` sampled frames of those whose surface is surveyed, evenly distributed.
pub(super) fn has_surface(place: usize, count: usize) -> bool {
    let last = count.saturating_sub(1);
    let steps = MAX_SURFACES.min(count).saturating_sub(1).max(1);
    (0..=steps).any(|step| step * last / steps == place)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surfaces_are_surveyed_at_both_ends_and_between() {
        let of = |count: usize| (0..count).filter(|place| has_surface(*place, count)).count();
        assert_eq!([1, 2, 6, 7, 24].map(of), [1, 2, 6, 6, 6]);
        assert!(has_surface(0, 24) && has_surface(23, 24) && has_surface(0, 1));
    }

    #[test]
    fn surface_of_another_frame_follows_its_particles_and_radius() {
        let size = SurfaceSize { particles: 50, spray: 10, ..SurfaceSize::default() };
        let count = |speed, drops| DropCount { speed, drops };
        let weight = SurfaceWeight {
            index: 0,
            particles: 100,
            radius: Some(2.0),
            voxel: 1.0,
            size,
            whitewater: vec![count(2.0, 500), count(4.0, 100)],
        };
        // Half the particles are drawn
        let scaled = weight.scaled(200, 1.0, Some(2.0), None);
        assert_eq!((scaled.particles, scaled.spray, scaled.drops), (100, 20, 0));
        // The next lower speed has more drops
        let drops = |speed| weight.scaled(200, 1.0, None, Some(speed)).drops;
        assert_eq!([1.0, 2.0, 3.9, 4.0, 9.0].map(drops), [1000, 1000, 1000, 200, 200]);
        let grid = spherule_surface::smooth::GridSize {
            particles: 40,
            near: 40,
            bricks: 4000,
            field: 400,
        };
        let size = SurfaceSize { grid: Some(grid), ..size };
        let smooth = SurfaceWeight { size, ..weight };
        let bricks = |voxel, radius| smooth.scaled(100, voxel, radius, None).grid.map(|g| g.bricks);
        assert_eq!(bricks(1.0, Some(2.0)), Some(4000));
        assert_eq!(bricks(1.0, Some(4.0)), Some(1000));
        assert_eq!(bricks(0.5, None), Some(16_000));
    }
}
