//! Measures one cell in this process.

use std::path::Path;
use std::time::Instant;

use spherule_files::memory;
use spherule_tracer::render::Film;
use spherule_tree::accel::{BuildSettings, TreeBuilder};

use super::measure::{Builds, Measured, render_settings, trace};
use super::peaks::Peaks;
use super::{CellError, CellRequest, Particles, Representation, stored};
use crate::report::CellMeasurement;

/// Makes or reads the particles, builds the tree, and traces images; or traces in place the native frame `file`,
/// which [`super::convert::convert`] has made.
///
/// The first build allocates its memory, the others reuse it, as in a sequence. Builds are repeated up to eleven
/// times in total, or until they have taken a quarter of the time for images.
///
/// # Errors
/// Describes why the settings are invalid, the cell does not fit into memory, or the file cannot be traced.
pub fn measure(request: &CellRequest, file: Option<&Path>) -> Result<CellMeasurement, CellError> {
    check_image(request)?;
    let measured = match file {
        None if request.representation == Representation::Gpu => on_gpu(request)?,
        None => build_and_trace(request)?,
        Some(path) => stored::trace_in_place(request, path)?,
    };
    Ok(measured.report())
}

fn build_and_trace(request: &CellRequest) -> Result<Measured, CellError> {
    let peaks = Peaks::default();
    let start = Instant::now();
    let particles = peaks.during(|| Particles::of(request))?;
    let load_seconds = start.elapsed().as_secs_f64();
    let mut builder = TreeBuilder::new();
    let settings = BuildSettings {
        // All particles have the same colour, so indices are not needed.
        keep_indices: false,
        ..BuildSettings::new(request.structure)
    };
    let spheres = particles.spheres();
    let builds = peaks
        .during(|| Builds::repeat(request.budget, || Ok(builder.build(&spheres, &settings))))?;
    // Free the input: the tree has its own copy, and rays need nothing else.
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

#[cfg(feature = "gpu")]
use super::gpu::build_and_trace as on_gpu;

#[cfg(not(feature = "gpu"))]
fn on_gpu(_request: &CellRequest) -> Result<Measured, CellError> {
    Err(CellError::Gpu("this program was built without the renderer for GPUs".to_owned()))
}

/// Rejects an image that cannot fit into memory, before the system kills the process.
fn check_image(request: &CellRequest) -> Result<(), CellError> {
    let settings = render_settings(request);
    let need = Film::bytes_for(settings.width, settings.height, settings.channels, false);
    match memory::available() {
        Some(free) if need > free => Err(CellError::ImageTooLarge {
            width: settings.width,
            height: settings.height,
            need: need >> 20,
            free: free >> 20,
        }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::MIN_IMAGES;
    use crate::{Budget, Motion, Representation, Source, Stage, convert};
    use spherule_tree::accel::Structure;

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
    fn measures_any_particle_count() {
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

    /// Measures the same cell in a native frame.
    fn in_place(request: &CellRequest, representation: Representation) -> CellMeasurement {
        let request = CellRequest { representation, ..request.clone() };
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
    fn tracing_in_place_matches_tracing_in_memory() {
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
                // Only the levels built above the stored nodes are in memory.
                let built = coded.bytes.structure - coded.bytes.file.structure;
                assert_eq!(coded.bytes.anonymous(), built);
            }
        }
    }

    #[test]
    fn error_names_a_file_that_is_not_a_frame() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("particles.spf");
        std::fs::write(&path, "no frame").unwrap();
        let result = measure(&request(10, Structure::Kdtree), Some(&path));
        let message = result.unwrap_err().to_string();
        assert!(message.contains("particles.spf"), "{message}");
    }

    #[test]
    fn short_budget_gives_the_minimum_number_of_images() {
        let mut request = request(10, Structure::default());
        request.budget = Budget::Seconds(1e-9);
        assert_eq!(measure(&request, None).unwrap().images, u64::from(MIN_IMAGES));
    }

    #[test]
    fn requests_round_trip_as_json() {
        let request = request(10, Structure::default());
        let text = serde_json::to_string(&request).unwrap();
        assert_eq!(serde_json::from_str::<CellRequest>(&text).unwrap(), request);
        let unknown = text.replace("lbvh", "lbhv");
        assert!(serde_json::from_str::<CellRequest>(&unknown).is_err());
    }
}
