//! A cell whose tree is built and traced by a GPU. Times are those of its own clock, without copies from and to it.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use spherule_gpu::{Checks, Device, SceneError, SceneRenderer, adapters, ray_counts};
use spherule_tracer::render::ParticleShading;
use spherule_tracer::scene::material::DEFAULT_COLOR;
use spherule_tree::accel::BuildReport;

use super::measure::{Builds, Images, Measured, render_settings};
use super::peaks::Peaks;
use super::{CellError, CellRequest, Particles};

/// Makes or reads the particles, copies them to the first GPU, builds the tree there, and traces images.
///
/// # Errors
/// There is no GPU, or the cell does not fit into its memory.
pub(super) fn build_and_trace(request: &CellRequest) -> Result<Measured, CellError> {
    let peaks = Peaks::default();
    let settings = render_settings(request);
    let never = AtomicBool::new(false);
    let mut renderer = SceneRenderer::new(Arc::new(first_gpu()?));
    // Copy the particles to the device
    let start = Instant::now();
    let particles = peaks.during(|| Particles::of(request))?;
    let shading = ParticleShading::constant(DEFAULT_COLOR);
    renderer
        .prepare(&particles.spheres(), None, &shading, false)
        .map_err(|e| CellError::Gpu(e.to_string()))?;
    let load_seconds = start.elapsed().as_secs_f64();
    let count = particles.centers.len() as u64;
    drop(particles);
    // Each image builds the tree once more
    let still = request.stage.scene(request.motion, 0.0, aspect(request))?;
    let builds = Builds::repeat(request.budget, || {
        let cost = renderer.measure(&still, &settings, None, &never).map_err(failed)?;
        Ok(BuildReport {
            structure: request.structure,
            order: "hilbert",
            total: Duration::from_secs_f64(cost.build_seconds),
            phases: Vec::new(),
            particles: count,
            references: count,
            nodes: 0,
            leaves: count.div_ceil(8),
            depth: 0,
            sah_cost: 0.0,
            position_bytes: 0,
            structure_bytes: cost.tree_bytes,
            file_bytes: 0,
            peak_bytes: cost.tree_bytes,
            simd: "gpu",
        })
    })?;
    let images = Images::repeat(request, |scene| {
        let cost = renderer.measure(scene, &settings, None, &never).map_err(failed)?;
        peaks.sample();
        Ok((cost.trace_seconds, ray_counts(&cost)))
    })?;
    Ok(Measured { particles: count, load_seconds, builds, images, peaks })
}

fn aspect(request: &CellRequest) -> f64 {
    f64::from(request.width) / f64::from(request.height)
}

/// The first adapter that is not a program on the CPU, if there is one.
fn first_gpu() -> Result<Device, CellError> {
    let hardware = adapters().iter().position(|adapter| !adapter.is_software);
    Device::open(hardware.unwrap_or(0), Checks::Off).map_err(|e| CellError::Gpu(e.to_string()))
}

fn failed(error: SceneError) -> CellError {
    match error {
        SceneError::Render(error) => CellError::Render(error),
        SceneError::Denoise(_) | SceneError::Device(_) => CellError::Gpu(error.to_string()),
    }
}
