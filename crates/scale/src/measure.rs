//! Repeated builds and images within the budget of a cell.

use std::sync::atomic::AtomicBool;
use std::time::Instant;

use spherule_report::FrameReport;
use spherule_surface::spheres::SphereSurface;
use spherule_tracer::render::{ParticleShading, RayCounts, RenderSettings, render};
use spherule_tracer::scene::Scene;
use spherule_tracer::scene::material::DEFAULT_COLOR;
use spherule_tree::accel::BuildReport;
use spherule_tree::accel::view::TreeView;

use super::motion::path_position;
use super::peaks::Peaks;
use super::{Budget, CellError, CellRequest};
use crate::report::{BuildTimes, CellMeasurement, PerParticle, RayRates, Spread};

/// Maximum number of builds of a cell; an odd number has a median.
const BUILDS: usize = 11;
/// Time for repeated builds as a fraction of the time for images.
const BUILD_TIME_FRACTION: f64 = 0.25;
/// Time for repeated builds if the number of images is given, seconds.
const BUILD_SECONDS: f64 = 2.0;
/// Minimum number of images if their time is given: they are a quarter of the path apart, so a slow cell also covers
/// all directions.
pub(super) const MIN_IMAGES: u32 = 4;

/// Measurements of a cell.
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

/// Measurements of builds.
pub(super) struct Builds {
    /// Report of the last build, with the highest peak of all.
    report: BuildReport,
    /// Wall-clock time of each build, in order.
    seconds: Vec<f64>,
}

impl Builds {
    /// Repeats builds as often as the `budget` of a cell allows.
    ///
    /// # Errors
    /// The first error of `build`.
    pub(super) fn repeat(
        budget: Budget,
        mut build: impl FnMut() -> Result<BuildReport, CellError>,
    ) -> Result<Self, CellError> {
        let allowed = match budget {
            Budget::Seconds(seconds) => BUILD_TIME_FRACTION * seconds,
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

/// Measurements of images.
pub(super) struct Images {
    /// Wall-clock time of each image.
    seconds: Vec<f64>,
    /// Rays of all images.
    rays: RayCounts,
}

/// Traces as many images as the budget of `request` allows.
///
/// # Errors
/// Describes why the camera or an image is invalid.
pub(super) fn trace(
    tree: TreeView<'_>,
    request: &CellRequest,
    peaks: &Peaks,
) -> Result<Images, CellError> {
    let settings = render_settings(request);
    let surface = SphereSurface::new(tree);
    let shading = ParticleShading::constant(DEFAULT_COLOR);
    let never = AtomicBool::new(false);
    Images::repeat(request, |scene| {
        // Measure the time without preparation or release
        let start = Instant::now();
        let (film, rays) = render(&[&surface], scene, &shading, &settings, &never)?;
        let seconds = start.elapsed().as_secs_f64();
        peaks.sample();
        drop(film);
        Ok((seconds, rays))
    })
}

impl Images {
    /// Traces as many images as the budget of `request` allows, along the path of its camera. `trace` returns the seconds
    /// and the rays of one.
    ///
    /// # Errors
    /// If a view is invalid, or the first error of `trace`.
    pub(super) fn repeat(
        request: &CellRequest,
        mut trace: impl FnMut(&Scene) -> Result<(f64, RayCounts), CellError>,
    ) -> Result<Self, CellError> {
        let aspect = f64::from(request.width) / f64::from(request.height);
        let mut images = Self { seconds: Vec::new(), rays: RayCounts::default() };
        let mut spent = 0.0;
        for index in 0.. {
            // Stop if the budget is spent, otherwise choose a position on the path
            let t = match request.budget {
                Budget::Images(count) if index == count => break,
                Budget::Images(count) => f64::from(index) / f64::from(count),
                Budget::Seconds(allowed) if spent >= allowed && index >= MIN_IMAGES => break,
                Budget::Seconds(_) => path_position(index),
            };
            let (seconds, rays) = trace(&request.stage.scene(request.motion, t, aspect)?)?;
            spent += seconds;
            images.seconds.push(seconds);
            images.rays = images.rays + rays;
        }
        Ok(images)
    }
}
