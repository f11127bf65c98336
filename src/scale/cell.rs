//! Measures one cell in this process.

use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use super::motion::spread_place;
use super::peaks::Peaks;
use super::{Budget, CellRequest, Particles, stored};
use crate::accel::view::TreeView;
use crate::accel::{BuildReport, BuildSettings, TreeBuilder};
use crate::metrics::memory;
use crate::render::{Film, ParticleShading, RayCounts, RenderSettings, render};
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
const LEAST_IMAGES: u32 = 4;

/// Makes or reads the particles, builds, traces; or does so in place, in the native frame `file` that
/// [`super::convert::convert`] has made.
///
/// The first build is in new memory, the others in that of the one before, as in a sequence. They
/// are repeated up to eleven in all, or until they have taken a quarter of the images' time.
///
/// # Errors
/// In words: what is asked makes no pictures, would not fit into memory, or the file cannot be traced.
pub fn measure(request: &CellRequest, file: Option<&Path>) -> Result<CellMeasurement, String> {
    check_image(request)?;
    let measured = match file {
        None => build_and_trace(request)?,
        Some(path) => stored::trace_in_place(request, path)?,
    };
    Ok(measured.report())
}

/// What a cell has come to.
pub(super) struct Measured {
    pub(super) particles: u64,
    pub(super) load_seconds: f64,
    pub(super) builds: Builds,
    pub(super) images: Images,
    pub(super) peaks: Peaks,
}

impl Measured {
    fn report(self) -> CellMeasurement {
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

fn build_and_trace(request: &CellRequest) -> Result<Measured, String> {
    let peaks = Peaks::default();
    let start = Instant::now();
    let particles = peaks.during(|| Particles::of(request))?;
    let load_seconds = start.elapsed().as_secs_f64();
    let mut builder = TreeBuilder::new();
    let settings = BuildSettings {
        // One colour for all: nobody asks which particle a ray has met.
        keep_indices: false,
        ..BuildSettings::new(request.structure)
    };
    let spheres = particles.spheres();
    let builds = peaks
        .during(|| Builds::repeat(request.budget, || Ok(builder.build(&spheres, &settings))))?;
    // The tree has its own copy; while rays run, only that is needed.
    let count = particles.centers.len() as u64;
    drop(particles);
    Ok(Measured {
        particles: count,
        load_seconds,
        builds,
        images: trace(builder.tree().view(), request, &peaks)?,
        peaks,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::Structure;
    use crate::scale::{Motion, Representation, Source, Stage, convert};

    fn request(particles: usize, structure: Structure) -> CellRequest {
        CellRequest {
            source: Source::Box,
            particles,
            seed: 1,
            structure,
            motion: Motion::Both,
            representation: Representation::Memory,
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
            let cell = measure(&request(particles, Structure::default()), None).unwrap();
            assert_eq!(cell.images, 3);
            assert_eq!(cell.rays.primary, 3 * 32 * 18);
            assert_eq!(cell.bytes_per_particle.is_some(), particles > 0);
            assert_eq!(cell.rays.shadow > 0, particles > 0, "{particles}");
            assert!(cell.build_seconds.first > 0.0 && cell.build_seconds.builds >= 1);
        }
    }

    #[test]
    fn all_structures_trace_the_same_rays() {
        let rays = Structure::ALL.map(|s| measure(&request(2000, s), None).unwrap().rays);
        assert!(rays.iter().all(|r| *r == rays[0]), "{rays:?}");
        assert!(rays[0].reflection > 0);
    }

    /// The cell of the same particles in a native frame.
    fn in_place(request: &CellRequest, representation: Representation) -> CellMeasurement {
        let request = CellRequest {
            representation,
            ..request.clone()
        };
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("particles.spf");
        let conversion = convert::convert(&request, &path).unwrap();
        let length = path.metadata().unwrap().len();
        assert_eq!(conversion.file_bytes, length);
        let error = conversion.max_error_of_radius.unwrap();
        assert!((0.0..=0.02).contains(&error), "{error}");
        assert_eq!(error > 0.0, conversion.max_error > 0.0);
        measure(&request, Some(&path)).unwrap()
    }

    #[test]
    fn frames_in_place_trace_as_in_memory() {
        for particles in [0, 1, 2000] {
            let request = request(particles, Structure::Kdtree);
            let memory = measure(&request, None).unwrap();
            assert_eq!(memory.bytes.file.total(), 0);
            let exact = in_place(&request, Representation::F32);
            assert_eq!(exact.rays, memory.rays);
            for representation in [Representation::Q16, Representation::Q10] {
                let coded = in_place(&request, representation);
                assert_eq!(coded.rays.primary, memory.rays.primary);
                let near = memory.rays.shadow / 20;
                assert!(coded.rays.shadow.abs_diff(memory.rays.shadow) <= near);
                assert!(coded.bytes.positions <= exact.bytes.positions);
                assert_eq!(coded.bytes.file.positions, coded.bytes.positions);
                // All that lies in memory is what was built above the stored nodes.
                let built = coded.bytes.structure - coded.bytes.file.structure;
                assert_eq!(coded.bytes.anonymous(), built);
            }
        }
    }

    #[test]
    fn a_file_that_is_no_frame_is_told() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("particles.spf");
        std::fs::write(&path, "no frame").unwrap();
        let told = measure(&request(10, Structure::Kdtree), Some(&path)).unwrap_err();
        assert!(told.contains("particles.spf"), "{told}");
    }

    #[test]
    fn time_ends_a_cell_after_a_few_images_at_least() {
        let mut request = request(10, Structure::default());
        request.budget = Budget::Seconds(1e-9);
        assert_eq!(
            measure(&request, None).unwrap().images,
            u64::from(LEAST_IMAGES)
        );
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
