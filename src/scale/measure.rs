//! Repeated builds, and images, within the budget of a cell.

use std::sync::atomic::AtomicBool;
use std::time::Instant;

use super::motion::spread_place;
use super::peaks::Peaks;
use super::{Budget, CellRequest};
use crate::accel::BuildReport;
use crate::accel::view::TreeView;
use crate::render::{ParticleShading, RayCounts, RenderSettings, render};
use crate::report::FrameReport;
use crate::scale::report::{BuildTimes, CellMeasurement, PerParticle, RayRates, Spread};
use crate::scene::material::DEFAULT_COLOR;
use crate::surface::spheres::SphereSurface;

/// Most builds of a cell; an odd number has a median.
const BUILDS: usize = 11;
/// Builds are repeated for up to this part of the time that images are given.
const BUILD_PART: f64 = 0.25;
/// The same where images are counted and not timed, seconds.
const BUILD_SECONDS: f64 = 2.0;
/// Fewest images where time decides: a quarter of the way apart, so that a slow cell too has seen
/// all sides.
pub(super) const LEAST_IMAGES: u32 = 4;

/// What a cell has come to.
pub(super) struct Measured {
    pub(super) particles: u64,
    pub(super) load_seconds: f64,
    pub(super) builds: Builds,
    pub(super) images: Images,
    pub(super) peaks: Peaks,
}

impl Measured {
    pub(super) fn report(self) -> CellMeasurement {
        let mut summary = FrameReport::default();
        summary.set_build(&self.builds.report);
        let images = self.images;
        let rates: Vec<f64> = images.seconds.iter().map(|s| s.recip()).collect();
        CellMeasurement {
            images: images.seconds.len() as u64,
            images_per_second: Spread::of(&rates),
            image_seconds: Spread::of(&images.seconds),
            load_seconds: self.load_seconds,
            conversion: None,
            build_seconds: BuildTimes::of(&self.builds.seconds),
            bytes_per_particle: PerParticle::of(&summary.bytes, self.particles),
            bytes: summary.bytes,
            build: summary.build,
            rss: self.peaks.summary(),
            rays: images.rays.into(),
            rays_per_second: RayRates::of(images.rays, images.seconds.iter().sum()),
        }
    }
}

pub(super) fn render_settings(request: &CellRequest) -> RenderSettings {
    RenderSettings {
        samples: request.samples,
        max_depth: request.max_depth,
        ..RenderSettings::new(request.width, request.height)
    }
}

/// What builds took.
pub(super) struct Builds {
    /// Of the last one, with the highest peak of all.
    report: BuildReport,
    /// Each one's wall-clock time, in order.
    seconds: Vec<f64>,
}

impl Builds {
    /// Builds as often as a cell of this `budget` does.
    ///
    /// # Errors
    /// That of the first `build` that has one.
    pub(super) fn repeat(
        budget: Budget,
        mut build: impl FnMut() -> Result<BuildReport, String>,
    ) -> Result<Self, String> {
        let allowed = match budget {
            Budget::Seconds(seconds) => BUILD_PART * seconds,
            Budget::Images(_) => BUILD_SECONDS,
        };
        let mut report = build()?;
        let mut seconds = vec![report.total.as_secs_f64()];
        while seconds.len() < BUILDS && seconds.iter().sum::<f64>() < allowed {
            let peak = report.peak_bytes;
            report = build()?;
            report.peak_bytes = report.peak_bytes.max(peak);
            seconds.push(report.total.as_secs_f64());
        }
        Ok(Self { report, seconds })
    }
}

/// What images took.
pub(super) struct Images {
    /// Each one's wall-clock time.
    seconds: Vec<f64>,
    /// All together.
    rays: RayCounts,
}

/// Traces as many images as the budget of `request` allows.
///
/// # Errors
/// In words: the camera or an image is not possible.
pub(super) fn trace(
    tree: TreeView<'_>,
    request: &CellRequest,
    peaks: &Peaks,
) -> Result<Images, String> {
    let settings = render_settings(request);
    let aspect = f64::from(request.width) / f64::from(request.height);
    let surface = SphereSurface::new(tree);
    let shading = ParticleShading::constant(DEFAULT_COLOR);
    let never = AtomicBool::new(false);
    let mut images = Images {
        seconds: Vec::new(),
        rays: RayCounts::default(),
    };
    let mut spent = 0.0;
    for index in 0.. {
        let place = match request.budget {
            Budget::Images(count) if index == count => break,
            Budget::Images(count) => f64::from(index) / f64::from(count),
            Budget::Seconds(allowed) if spent >= allowed && index >= LEAST_IMAGES => break,
            Budget::Seconds(_) => spread_place(index),
        };
        let scene = request
            .stage
            .scene(request.motion, place, aspect)
            .map_err(|e| format!("camera: {e}"))?;
        let start = Instant::now();
        let (film, rays) =
            render(&[&surface], &scene, &shading, &settings, &never).map_err(|e| e.to_string())?;
        let seconds = start.elapsed().as_secs_f64();
        peaks.look();
        drop(film);
        spent += seconds;
        images.seconds.push(seconds);
        images.rays = images.rays + rays;
    }
    Ok(images)
}
