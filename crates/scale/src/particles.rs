//! The particles of a cell: the box at any count, or a part of a frame of the user.

use spherule_files::memory;
use spherule_formats::generate::{BoxSettings, fill_box, splitmix64};
use spherule_formats::sequence::{Sequence, SequenceInput};
use spherule_formats::{ParticleFrame, Radius, is_radius};
use spherule_frame::reading::read_budget;
use spherule_survey::{Question, RadiusQuestion, Survey};
use spherule_tracer::scene::Bounds;
use spherule_tree::accel::{SphereRadius, Spheres};

use glam::Vec3;
use spherule_tree::math::narrow;

use super::{CellError, CellRequest, FrameSource, Source, Stage};

/// Minimum radius as a fraction of the diagonal of the bounds; smaller ones would be invisible in f32.
const MIN_RADIUS: f64 = 1e-6;
/// Radius if there is no estimate (a single particle, or all in one place), as a fraction of the distance of the
/// framing camera.
const SINGLE_RADIUS: f64 = 0.1;
/// Minimum memory per particle during the build, in bytes: the positions of the input, and those in the tree.
const MIN_BYTES: u64 = 24;

/// Spheres in memory.
#[derive(Debug, Clone, PartialEq)]
pub struct Particles {
    /// Centres relative to the origin of the stage.
    pub centers: Vec<Vec3>,
    /// Radii.
    pub radius: Radius,
}

impl Particles {
    /// Makes or reads the particles of `request`.
    ///
    /// # Errors
    /// They do not fit into memory, or the frame cannot be read.
    pub fn of(request: &CellRequest) -> Result<Self, CellError> {
        let need = MIN_BYTES.saturating_mul(request.particles as u64);
        if let Some(free) = memory::available()
            && need > free
        {
            return Err(CellError::TooManyParticles {
                particles: request.particles,
                need: need >> 20,
                free: free >> 20,
            });
        }
        match &request.source {
            Source::Box => Ok(Self::in_box(request.particles, request.seed)),
            Source::Frame(source) => Self::in_frame(source, request.particles, request.seed),
        }
    }

    /// Particles in the box, with half the mean spacing as their radius, so that it always looks filled.
    fn in_box(count: usize, seed: u64) -> Self {
        let extent = Stage::THESIS.bounds.max - Stage::THESIS.bounds.min;
        let spacing = (extent.element_product() / count.max(1) as f64).cbrt();
        Self {
            centers: fill_box(&BoxSettings::thesis(count, seed)),
            radius: Radius::Common(narrow(0.5 * spacing)),
        }
    }

    fn in_frame(source: &FrameSource, count: usize, seed: u64) -> Result<Self, CellError> {
        // Find and read the frame
        let input = SequenceInput::from_path(&source.path);
        let sequence = Sequence::open_within(&input, read_budget(None, None))?;
        let index =
            sequence.frames().iter().position(|f| f.number == source.frame).ok_or_else(|| {
                CellError::MissingFrame { path: source.path.clone(), frame: source.frame }
            })?;
        let frame = sequence.load(index, source.origin)?;
        let ParticleFrame { positions, radius, .. } = frame;
        // Reduce it to the requested count
        let mut particles =
            Self { radius: radius.unwrap_or(Radius::Common(source.radius)), centers: positions };
        particles.thin(count, seed);
        particles.raise_radii(source.least_radius);
        Ok(particles)
    }

    /// Keeps an even selection of `count` particles in their order, and increases the radii so that the total volume
    /// is unchanged: as with the box, pictures of all counts cover about the same part of the image.
    fn thin(&mut self, count: usize, seed: u64) {
        let all = self.centers.len();
        if count >= all {
            return;
        }
        let growth = narrow((all as f64 / count.max(1) as f64).cbrt());
        retain_random(&mut self.centers, count, seed);
        match &mut self.radius {
            Radius::Common(radius) => *radius *= growth,
            Radius::PerParticle(radii) => {
                retain_random(radii, count, seed);
                radii.iter_mut().for_each(|r| *r *= growth);
            }
        }
    }

    fn raise_radii(&mut self, least: f32) {
        // Written as `!(a >= b)` so that NaN is raised as well.
        let raise = |radius: &mut f32| {
            if !(*radius >= least && is_radius(*radius)) {
                *radius = least;
            }
        };
        match &mut self.radius {
            Radius::Common(radius) => raise(radius),
            Radius::PerParticle(radii) => radii.iter_mut().for_each(raise),
        }
    }

    /// The spheres as the input of a builder.
    pub fn spheres(&self) -> Spheres<'_> {
        Spheres {
            centers: &self.centers,
            radius: match &self.radius {
                Radius::Common(radius) => SphereRadius::Common(*radius),
                Radius::PerParticle(radii) => SphereRadius::Each(radii),
            },
        }
    }
}

/// Keeps `count` of `items` in their order; all selections are equally likely (selection sampling, Knuth, The Art of
/// Computer Programming 2, 3.4.2, algorithm S).
fn retain_random<T>(items: &mut Vec<T>, count: usize, seed: u64) {
    let mut unvisited = items.len() as u64;
    let mut remaining = count as u64;
    let mut draw = 0_u64;
    items.retain(|_| {
        draw += 1;
        let below = (u128::from(splitmix64(seed, draw)) * u128::from(unvisited)) >> 64;
        unvisited -= 1;
        let chosen = below < u128::from(remaining);
        remaining -= u64::from(chosen);
        chosen
    });
}

/// Survey of a frame of the user.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameSurvey {
    /// Number of finite particles.
    pub particles: usize,
    /// The source for cells.
    pub source: FrameSource,
    /// The stage for cells.
    pub stage: Stage,
}

impl FrameSurvey {
    /// Surveys frame `index` of `sequence`, which was opened from `path`, for images with `aspect` = width / height.
    ///
    /// # Errors
    /// It cannot be read, or has no particles.
    pub fn of(
        sequence: &Sequence,
        path: &std::path::Path,
        index: usize,
        aspect: f64,
    ) -> Result<Self, CellError> {
        let question = Question { radius: RadiusQuestion::Auto, ..Question::NOTHING };
        let survey = Survey::of_frames(sequence, [index], question)?;
        let frame = sequence.frames()[index].number;
        if survey.most_particles == 0 {
            return Err(CellError::NoParticles { path: path.to_owned(), frame });
        }
        // Frame the spheres, which extend beyond their centres
        let reach = f64::from(survey.radius.unwrap_or(0.0).max(survey.reach));
        let bounds = Bounds { min: survey.min - reach, max: survey.max + reach };
        let stage = Stage::framing(bounds, survey.up, aspect, survey.origin);
        let distance = stage.view.eye.distance(bounds.center());
        Ok(Self {
            particles: survey.most_particles,
            source: FrameSource {
                path: path.to_owned(),
                frame,
                origin: survey.origin,
                radius: survey.radius.unwrap_or(narrow(SINGLE_RADIUS * distance)),
                least_radius: narrow(bounds.diagonal() * MIN_RADIUS).max(f32::MIN_POSITIVE),
            },
            stage,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keeps_the_exact_count_in_order() {
        for (all, count) in [(0, 0), (1, 0), (1, 1), (10, 3), (1000, 999), (1000, 100)] {
            let mut items: Vec<usize> = (0..all).collect();
            retain_random(&mut items, count, 7);
            assert_eq!(items.len(), count);
            assert!(items.is_sorted());
        }
    }

    #[test]
    fn selection_is_uniform_and_seeded() {
        let chosen = |seed| {
            let mut items: Vec<u32> = (0..100_000).collect();
            retain_random(&mut items, 10_000, seed);
            items
        };
        assert_eq!(chosen(1), chosen(1));
        assert_ne!(chosen(1), chosen(2));
        // Expected in the first half: 5000, with a standard deviation of about 47.
        let first_half = chosen(1).iter().filter(|i| **i < 50_000).count();
        assert!((4700..5300).contains(&first_half), "{first_half}");
    }

    #[test]
    fn thinning_keeps_the_total_volume() {
        let mut particles = Particles {
            centers: (0..800_u16).map(|i| Vec3::splat(f32::from(i))).collect(),
            radius: Radius::PerParticle((0..800_u16).map(f32::from).collect()),
        };
        particles.thin(100, 1);
        let Radius::PerParticle(radii) = &particles.radius else { panic!("radii stay one each") };
        for (center, radius) in particles.centers.iter().zip(radii) {
            assert!((radius - 2.0 * center.x).abs() <= 1e-3, "{center} {radius}");
        }
    }
}
