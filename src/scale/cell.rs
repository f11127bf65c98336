//! Measures one cell in this process.

use std::sync::atomic::AtomicBool;
use std::time::Instant;

use super::motion::spread_place;
use super::peaks::Peaks;
use super::{Budget, CellRequest, Particles};
use crate::accel::{BuildReport, BuildSettings, TreeBuilder};
use crate::render::{Film, ParticleShading, RayCounts, RenderSettings, render};
use crate::report::FrameReport;
use crate::report::memory;
use crate::report::scale::{BuildTimes, CellMeasurement, PerParticle, RayRates, Spread};
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
const LEAST_IMAGES: u32 = 4;

/// Makes or reads the particles, builds, traces.
///
/// The first build is in new memory, the others in that of the one before, as in a sequence. They
/// are repeated up to eleven in all, or until they have taken a quarter of the images' time.
///
/// # Errors
/// In words: what is asked makes no pictures, or would not fit into memory.
pub fn measure(request: &CellRequest) -> Result<CellMeasurement, String> {
    check_image(request)?;
    let peaks = Peaks::default();
    let start = Instant::now();
    let particles = peaks.during(|| Particles::of(request))?;
    let load_seconds = start.elapsed().as_secs_f64();
    let mut builder = TreeBuilder::new();
    let (build, build_seconds) = peaks.during(|| builds(&mut builder, &particles, request));
    // The tree has its own copy; while rays run, only that is needed.
    let count = particles.centers.len() as u64;
    drop(particles);
    let images = trace(&builder, request, &peaks)?;

    let mut summary = FrameReport::default();
    summary.set_build(&build);
    let rates: Vec<f64> = images.seconds.iter().map(|s| s.recip()).collect();
    Ok(CellMeasurement {
        images: images.seconds.len() as u64,
        images_per_second: Spread::of(&rates),
        image_seconds: Spread::of(&images.seconds),
        load_seconds,
        build_seconds,
        bytes_per_particle: PerParticle::of(&summary.bytes, count),
        bytes: summary.bytes,
        build: summary.build,
        rss: peaks.summary(),
        rays: images.rays.into(),
        rays_per_second: RayRates::of(images.rays, images.seconds.iter().sum()),
    })
}

/// Refuses an image that cannot fit, before the system ends the process for it.
fn check_image(request: &CellRequest) -> Result<(), String> {
    let settings = render_settings(request);
    let need = Film::bytes_for(settings.width, settings.height, settings.channels);
    match memory::available() {
        Some(free) if need > free => Err(format!(
            "out of memory: an image of {}x{} needs {} MiB, {} MiB are free",
            settings.width,
            settings.height,
            need >> 20,
            free >> 20
        )),
        _ => Ok(()),
    }
}

fn render_settings(request: &CellRequest) -> RenderSettings {
    RenderSettings {
        samples: request.samples,
        max_depth: request.max_depth,
        ..RenderSettings::new(request.width, request.height)
    }
}

/// The report of the last build, with the highest peak of all.
fn builds(
    builder: &mut TreeBuilder,
    particles: &Particles,
    request: &CellRequest,
) -> (BuildReport, BuildTimes) {
    let settings = BuildSettings {
        // One colour for all: nobody asks which particle a ray has met.
        keep_indices: false,
        ..BuildSettings::new(request.structure)
    };
    let allowed = match request.budget {
        Budget::Seconds(seconds) => BUILD_PART * seconds,
        Budget::Images(_) => BUILD_SECONDS,
    };
    let spheres = particles.spheres();
    let mut report = builder.build(&spheres, &settings);
    let mut seconds = vec![report.total.as_secs_f64()];
    while seconds.len() < BUILDS && seconds.iter().sum::<f64>() < allowed {
        let peak = report.peak_bytes;
        report = builder.build(&spheres, &settings);
        report.peak_bytes = report.peak_bytes.max(peak);
        seconds.push(report.total.as_secs_f64());
    }
    (report, BuildTimes::of(&seconds))
}

/// What images took.
struct Images {
    /// Each one's wall-clock time.
    seconds: Vec<f64>,
    /// All together.
    rays: RayCounts,
}

fn trace(builder: &TreeBuilder, request: &CellRequest, peaks: &Peaks) -> Result<Images, String> {
    let settings = render_settings(request);
    let aspect = f64::from(request.width) / f64::from(request.height);
    let surface = SphereSurface::new(builder.tree().view());
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
            render(&surface, &scene, &shading, &settings, &never).map_err(|e| e.to_string())?;
        let seconds = start.elapsed().as_secs_f64();
        peaks.look();
        drop(film);
        spent += seconds;
        images.seconds.push(seconds);
        images.rays = images.rays + rays;
    }
    Ok(images)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::Structure;
    use crate::scale::{Motion, Representation, Source, Stage};

    fn request(particles: usize, structure: Structure) -> CellRequest {
        CellRequest {
            source: Source::Box,
            particles,
            seed: 1,
            structure,
            motion: Motion::Both,
            representation: Representation::F32,
            stage: Stage::THESIS,
            budget: Budget::Images(3),
            width: 32,
            height: 18,
            samples: 1,
            max_depth: 3,
            threads: 1,
        }
    }

    #[test]
    fn any_count_can_be_measured() {
        for particles in [0, 1, 2, 500] {
            let cell = measure(&request(particles, Structure::default())).unwrap();
            assert_eq!(cell.images, 3);
            assert_eq!(cell.rays.primary, 3 * 32 * 18);
            assert_eq!(cell.bytes_per_particle.is_some(), particles > 0);
            assert_eq!(cell.rays.shadow > 0, particles > 0, "{particles}");
            assert!(cell.build_seconds.first > 0.0 && cell.build_seconds.builds >= 1);
        }
    }

    #[test]
    fn all_structures_trace_the_same_rays() {
        let rays = Structure::ALL.map(|s| measure(&request(2000, s)).unwrap().rays);
        assert!(rays.iter().all(|r| *r == rays[0]), "{rays:?}");
        assert!(rays[0].reflection > 0);
    }

    #[test]
    fn time_ends_a_cell_after_a_few_images_at_least() {
        let mut request = request(10, Structure::default());
        request.budget = Budget::Seconds(1e-9);
        assert_eq!(measure(&request).unwrap().images, u64::from(LEAST_IMAGES));
    }

    #[test]
    fn requests_survive_the_way_to_another_process() {
        let request = request(10, Structure::default());
        let text = serde_json::to_string(&request).unwrap();
        assert_eq!(serde_json::from_str::<CellRequest>(&text).unwrap(), request);
        let unknown = text.replace("lbvh", "lbhv");
        assert!(serde_json::from_str::<CellRequest>(&unknown).is_err());
    }
}
