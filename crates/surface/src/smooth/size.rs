//! Estimates the memory of the grid of some particles from a sample of its bricks.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::blocks::{self, Plan};
use super::brick::Brick;
use super::build::{Work, discard_unused};
use super::layout::Layout;
use crate::field::FieldParticles;
use crate::{SurfaceBytes, SurfaceSettings};
use spherule_tree::accel::simd::ArrayLanes;

/// Number of bricks that are made: enough for their mean to be within a few percent.
const MAX_BRICKS: u64 = 2048;

/// Bytes of a particle while all are sorted: its position in the bins, and where it is.
const SORTING_BYTES: u64 = 20;
/// The same with its index.
const INDEX_BYTES: u64 = 4;
/// Bytes of a particle near the surface: its position, its volume, and its share of the bins.
const NEAR_BYTES: u64 = 17;

/// Bytes of the bricks per particle at the surface, for voxels of the size of the radius. Measured on splashing dam
/// breaks of 1e4 and 2e4 particles; a calm block needs a third to a half.
const SPLASH_BRICKS: f64 = 5000.0;
/// The same for the field from which bricks are made.
const SPLASH_FIELD: f64 = 3500.0;
/// Maximum of either: an isolated particle at the common corner of eight bricks.
const MAX_SPLASH: f64 = 22_000.0;

/// What the grid of some particles contains.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct GridSize {
    /// Number of particles.
    pub particles: u64,
    /// Number of particles that affect the surface; all of them for exact intersections.
    pub near: u64,
    /// Bytes of the bricks.
    pub bricks: u64,
    /// Bytes of the field from which the bricks are made.
    pub field: u64,
}

impl GridSize {
    /// The size of the grid of particles with `centers` and one `radius`. Its bricks are selected as for the surface,
    /// but only some of them are made.
    pub fn of(centers: &[Vec3], radius: f32, settings: &SurfaceSettings) -> Self {
        // Sort the particles and select bricks, as a build does
        let layout = Layout::new(settings, radius);
        let mut field = FieldParticles::sorted(centers, layout.support, false);
        let plan = Plan::of(field.bins(), &layout);
        let near = if settings.exact {
            field.bins().points().len() as u64
        } else {
            near(&field, &layout, &plan)
        };
        // Make a sample of the bricks
        let sample = plan.sample(MAX_BRICKS);
        let needed = discard_unused(&mut field, &layout, &sample);
        field.find_volumes(|bin| needed[bin]);
        let work =
            Work { field: &field, layout: &layout, plan: &sample, lanes: ArrayLanes::default() };
        let raw = work.raw();
        let (_, bricks) = work.bricks(&raw);
        let bricks = bricks.len() as u64 * size_of::<Brick>() as u64;
        // Scale the sizes from the sample to all
        Self {
            particles: centers.len() as u64,
            near,
            bricks: scaled(bricks, plan.band_count(), sample.band_count()),
            field: scaled(raw.byte_len(), plan.raw_count(), sample.raw_count()),
        }
    }

    /// The size of the grid of splashing particles, of which nothing else is known. The fraction of the particles that is
    /// at the surface of a body decreases with the cube root of their number. With a radius that is too small, all of
    /// them are at a surface of their own; that is detected and rejected when the grid is planned.
    pub fn of_splash(particles: u64, settings: &SurfaceSettings) -> Self {
        #[expect(clippy::cast_precision_loss, reason = "an estimate")]
        let count = particles as f64;
        let faces = f64::from(settings.voxel).powi(-2) / libm::cbrt(count).max(1.0);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "saturates; not negative"
        )]
        let bytes = |each: f64| (count * (each * faces).min(MAX_SPLASH)) as u64;
        let (bricks, field) = (bytes(SPLASH_BRICKS), bytes(SPLASH_FIELD));
        Self { particles, near: particles, bricks, field }
    }

    /// The size with `particles` particles of the same flow, and with bricks whose edge is `edge` times as long: the
    /// area of the surface is the same for any radius.
    #[must_use]
    pub fn scaled(&self, particles: u64, edge: f32) -> Self {
        let bricks = scaled(self.bricks, particles, self.particles);
        let field = scaled(self.field, particles, self.particles);
        let near = scaled(self.near, particles, self.particles);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            clippy::cast_precision_loss,
            reason = "an estimate; saturates"
        )]
        let with_edge = |bytes: u64| (bytes as f64 / f64::from(edge).powi(2)) as u64;
        Self { particles, near, bricks: with_edge(bricks), field: with_edge(field) }
    }

    /// The memory of the grid. With `keeps_particles`, those near the surface stay for attributes.
    pub fn bytes(&self, keeps_particles: bool) -> SurfaceBytes {
        let index = if keeps_particles { INDEX_BYTES } else { 0 };
        let near = self.near * (NEAR_BYTES + index);
        SurfaceBytes {
            building: (self.particles * (SORTING_BYTES + index))
                .max(near + self.field + self.bricks),
            kept: self.bricks + if keeps_particles { near } else { 0 },
        }
    }
}

/// Number of particles that affect the surface.
fn near(field: &FieldParticles, layout: &Layout, plan: &Plan) -> u64 {
    let bins = field.bins();
    let is_near = blocks::bins_near(bins, layout, &plan.blocks, 2.0 * layout.support);
    let near = (0..bins.bin_count()).filter(|bin| is_near[*bin]);
    near.map(|bin| bins.particles_in(bin..bin + 1).len() as u64).sum()
}

/// `value` times `of` / `part`.
fn scaled(value: u64, of: u64, part: u64) -> u64 {
    let product = u128::from(value) * u128::from(of) / u128::from(part.max(1));
    u64::try_from(product).unwrap_or(u64::MAX)
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use spherule_formats::convert::{BlockSettings, BlockSource, ParticleSource};
    use spherule_formats::{Sequence, SequenceInput};

    use super::super::SmoothGrid;
    use super::*;
    use crate::SurfaceKind;

    const RADIUS: f32 = 0.01;

    fn block(count: usize) -> Vec<Vec3> {
        let source = BlockSource::new(BlockSettings {
            count: count as u64,
            seed: 1,
            radius: Some(RADIUS),
            has_velocity: false,
        });
        let mut positions = vec![DVec3::ZERO; count];
        source.read_positions(0, &mut positions).expect("there");
        positions.iter().map(|p| p.as_vec3()).collect()
    }

    /// Compares the estimate with the cost of the surface: within a tenth of what tracing needs, and a seventh of what
    /// the build needs.
    #[track_caller]
    fn compare(centers: &[Vec3], radius: f32, settings: &SurfaceSettings, keeps: bool) {
        let size = GridSize::of(centers, radius, settings);
        let mut grid = SmoothGrid::default();
        let report = grid.build(centers, radius, settings, keeps, None).expect("it fits");
        let predicted = size.bytes(keeps);
        let part = |predicted: u64, bytes: u64| predicted as f64 / bytes as f64;
        let kept = part(predicted.kept, report.bytes);
        assert!((0.9..1.1).contains(&kept), "{kept}: {predicted:?} {report:?}");
        let building = part(predicted.building, report.peak_bytes);
        assert!((0.9..1.15).contains(&building), "{building}: {predicted:?} {report:?}");
    }

    // Builds ten grids of up to 50,000 particles, to compare each with its estimate.
    #[test]
    fn estimate_matches_calm_and_splashing_particles() {
        let smooth = SurfaceSettings { kind: SurfaceKind::Smooth, ..SurfaceSettings::DEFAULT };
        let water = SurfaceSettings { smoothing: 1.0, voxel: 0.75, ..smooth };
        let sharp = SurfaceSettings { smoothing: 0.0, ..smooth };
        compare(&block(50_000), RADIUS, &smooth, false);
        compare(&block(30_000), RADIUS, &water, true);
        // Pulled apart, until each particle has a surface of its own
        let apart = |factor: f32| block(15_000).into_iter().map(move |p| factor * p).collect();
        for centers in [apart(1.5), apart(3.0)] as [Vec<Vec3>; 2] {
            compare(&centers, RADIUS, &smooth, true);
            compare(&centers, RADIUS, &sharp, false);
        }
        let directory = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/dam-break");
        let frames = Sequence::open(&SequenceInput::from_path(directory)).expect("frames");
        for index in [0, 8] {
            let frame = frames.load(index, DVec3::ZERO).expect("readable");
            compare(&frame.positions, 0.02, &smooth, false);
            compare(&frame.positions, 0.02, &water, true);
        }
    }

    #[test]
    fn exact_surfaces_keep_all_particles() {
        let exact =
            SurfaceSettings { kind: SurfaceKind::Smooth, exact: true, ..SurfaceSettings::DEFAULT };
        compare(&block(100_000), RADIUS, &exact, true);
        assert_eq!(GridSize::of(&[], RADIUS, &exact), GridSize::default());
    }

    #[test]
    fn size_grows_with_particles_and_shrinks_with_the_area_of_a_face() {
        let size = GridSize { particles: 100, near: 50, bricks: 4000, field: 2000 };
        let scaled = size.scaled(200, 2.0);
        assert_eq!(scaled, GridSize { particles: 200, near: 100, bricks: 2000, field: 1000 });
        assert_eq!(size.scaled(0, 1.0).bytes(true), SurfaceBytes::default());
    }
}
