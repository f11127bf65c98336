//! Estimates the radius of particles that form one body, from the number of neighbours and not from the distance of
//! the nearest one.
//!
//! Half the distance to the nearest neighbour is correct for spheres that touch. Particles of a fluid are disordered,
//! and the nearest of a dozen neighbours is closer than the average one: the radius would be about a fifth too small,
//! and the field of such particles would have holes inside the fluid.

use spherule_tree::math::narrow;

/// Radius within which neighbours are counted, in median distances to the nearest neighbour. In a fluid it contains
/// about 30 particles: enough for a density, and few enough not to extend beyond thin sheets.
const REACH: f32 = 2.5;
/// Quantile of the counts that is used: at least half of the particles of a splash are near its surface, and have
/// fewer neighbours.
const BULK: f64 = 0.75;
/// Enlargement of the estimate: a radius that is too small causes holes, one that is too large only a slightly
/// thicker surface. Tuned on dam breaks, for which the estimates were 0.94 to 1.01 of the radius of the simulation.
const RATHER_LARGE: f64 = 1.05;
/// Maximum radius in half distances to the nearest neighbour, so that particles that are not a body, such as a line
/// or a few particles, do not become too large.
const MAX: f64 = 2.0;

/// Which estimates a survey of some frames needs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct SpacingRequest {
    /// Whether [`Spacing::packed`] is needed.
    pub(super) needs_packed: bool,
    /// Number of surveyed frames, which share the effort.
    pub(super) frames: usize,
}

/// Estimates of the radius from the distances of particles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Spacing {
    /// Half the median distance to the nearest neighbour.
    pub(super) touching: f32,
    /// Half the distance that one of a hundred particles has to its nearest neighbour at most.
    pub(super) closest: f32,
    /// Half the edge of the cube that each particle occupies inside a body, if it was requested.
    pub(super) packed: Option<f32>,
}

/// Radius within which neighbours are to be counted.
pub(super) fn reach(touching: f32) -> f32 {
    REACH * 2.0 * touching
}

/// The radius from the `counts` of particles within [`reach`] of some particles, including themselves.
pub(super) fn packed_radius(touching: f32, mut counts: Vec<u32>) -> Option<f32> {
    counts.sort_unstable();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "hundreds of counts"
    )]
    let place = (BULK * counts.len() as f64) as usize;
    let count = *counts.get(place)?;
    let reach = f64::from(reach(touching));
    let volume = 4.0 / 3.0 * std::f64::consts::PI * reach.powi(3);
    let spacing = libm::cbrt(volume / f64::from(count));
    let most = MAX * f64::from(touching);
    Some(narrow((0.5 * RATHER_LARGE * spacing).min(most)))
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, Vec3};
    use spherule_formats::convert::{BlockSettings, BlockSource, ParticleSource};
    use spherule_formats::sequence::Sequence;
    use spherule_formats::{ParticleFrame, Positions, RawParticles, SequenceInput, native};

    use super::super::robust::spacing_of;
    use super::super::{Question, RadiusQuestion, Survey};
    use super::*;

    fn spacing(positions: &[Vec3]) -> Option<Spacing> {
        let request = SpacingRequest { needs_packed: true, frames: 1 };
        spacing_of(&positions.iter().copied().collect(), request)
    }

    fn packed(positions: &[Vec3]) -> Option<f32> {
        spacing(positions)?.packed
    }

    fn lattice(side: u8) -> Vec<Vec3> {
        let along = || (0..side).map(|i| 0.2 * f32::from(i));
        let plane = |x| along().flat_map(move |y| along().map(move |z| Vec3::new(x, y, z)));
        along().flat_map(plane).collect()
    }

    /// A block of water, with particles of radius 0.1.
    fn block(count: u16) -> Vec<Vec3> {
        let source = BlockSource::new(BlockSettings {
            count: u64::from(count),
            seed: 3,
            radius: Some(0.1),
            has_velocity: false,
        });
        let mut positions = vec![DVec3::ZERO; usize::from(count)];
        source.read_positions(0, &mut positions).expect("there");
        positions.iter().map(|p| p.as_vec3()).collect()
    }

    #[test]
    fn lattice_and_fluid_have_the_same_packed_radius() {
        for (positions, touching) in [(lattice(18), 0.1), (block(6000), 0.085)] {
            let half = spacing(&positions).expect("some").touching;
            assert!((half / touching - 1.0).abs() < 0.1, "{half}");
            let radius = packed(&positions).expect("some");
            assert!((0.96..1.1).contains(&(radius / 0.1)), "{radius}");
        }
    }

    #[test]
    fn packed_radius_is_limited_outside_bodies() {
        assert_eq!(packed(&[]), None);
        assert_eq!(packed(&[Vec3::ONE]), None);
        assert_eq!(packed(&[Vec3::ONE; 100]), None);
        let two = packed(&[Vec3::ZERO, Vec3::X]).expect("a radius");
        assert!((0.5..=1.0).contains(&two), "{two}");
        let line: Vec<Vec3> = (0..100_u8).map(|i| f32::from(i) * Vec3::X).collect();
        let line = packed(&line).expect("a radius");
        assert!((0.5..=1.0).contains(&line), "{line}");
    }

    #[test]
    fn sampled_native_frame_gives_the_radius_of_all_particles() {
        let all = block(u16::MAX);
        let whole = packed(&all).expect("a radius");
        // Three distant blocks, with more particles than the limit for inspecting each.
        let far = (0..3_u8).map(|i| 1e3 * f32::from(i) * Vec3::X);
        let all = far.flat_map(|offset| all.iter().map(move |p| *p + offset)).collect();
        let raw = RawParticles { positions: Positions::F32(all), ..RawParticles::default() };
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("f_1.spf");
        let frame = ParticleFrame::from_raw(raw, DVec3::ZERO);
        native::write(&path, &frame, None).expect("a file");
        let sequence = Sequence::open(&SequenceInput::from_path(&path)).expect("a frame");
        let survey = |radius| {
            Survey::of(&sequence, Question { radius, ..Question::NOTHING }).expect("readable")
        };
        let stored = survey(RadiusQuestion::AutoOfBody);
        let radius = stored.packed_radius.expect("requested");
        assert!((radius / whole - 1.0).abs() < 0.1, "{radius} {whole}");
        let plain = survey(RadiusQuestion::Auto);
        assert_eq!(
            (plain.packed_radius, plain.radius),
            (None, stored.radius),
            "the radius of spheres does not change"
        );
    }
}
