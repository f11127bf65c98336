//! Second stage: builds the tree and traces the image.

use std::sync::Arc;
use std::time::{Duration, Instant};

use spherule_files::memory::MemoryUse;

use super::decoded::DecodedFrame;
use super::gpu::GpuRenderer;
use super::in_place::StoredFrame;
use super::load::{LoadedFrame, LoadedParticles};
use super::mattes;
use super::renderer::{BuiltFrame, BuiltParticles, FrameRenderer, TraceError, TracedFrame};
use super::rods::FrameRods;
use super::setup::Setup;
use super::shading::particle_shading;
use super::surface::{self, SurfaceBuilder, spheres};
use crate::accel::stored::{StoredSettings, StoredTree};
use crate::accel::{BuildReport, TreeBuilder};
use crate::render::{Film, RayCounts, RendererKind, Stop};
use crate::report::FrameReport;
use crate::report::frame::{FileBytes, SamplingSummary};
use crate::scene::material::DEFAULT_COLOR;

/// Renders frame after frame in the same buffers, on the threads of the current pool.
#[derive(Debug, Default)]
pub struct CpuRenderer {
    builder: TreeBuilder,
    stored: StoredTree,
    surface: SurfaceBuilder,
    /// Planes for the next image.
    film: Film,
}

impl FrameRenderer for CpuRenderer {
    /// Builds the tree of `frame`. Positions in memory are released, because the tree has its own copy; for a native
    /// frame only the levels above the stored ones are built.
    ///
    /// # Errors
    /// [`TraceError::Stored`] if the nodes of a native frame are damaged, [`TraceError::File`] if it cannot be used.
    fn prepare(&mut self, setup: &Setup, frame: LoadedFrame<'_>) -> Result<BuiltFrame, TraceError> {
        // Begin the report
        let mut report = FrameReport {
            particles: frame.particles.count(),
            particles_read: frame.read,
            dropped: frame.dropped,
            clamped_radii: frame.clamped_radii,
            ..FrameReport::default()
        };
        report.seconds.read = frame.read_time.as_secs_f64();
        // Build surface and tree of decoded particles, or the levels above stored ones
        let mut notes = Vec::new();
        let particles = match frame.particles {
            LoadedParticles::Decoded(mut decoded) => {
                notes = self.surface.build(setup, &mut decoded, &mut self.builder, &mut report)?;
                report.set_build(&self.build_copy(setup, &decoded));
                self.surface.set_in_motion(&mut self.builder, &mut report);
                report.bytes.attributes = decoded.shading.byte_len();
                BuiltParticles::Decoded(decoded.shading)
            }
            LoadedParticles::Stored(stored) => {
                self.surface.clear();
                report.set_build(&self.build_above(setup, &stored)?);
                report.bytes.attributes = stored.attribute_bytes();
                report.bytes.file.attributes = stored.attribute_bytes();
                if !stored.is_mapped() {
                    report.bytes.file = FileBytes::default();
                }
                BuiltParticles::Stored(stored)
            }
        };
        // Hand over what tracing needs
        report.bytes.surface += frame.rods.iter().map(FrameRods::bytes).sum::<u64>();
        Ok(BuiltFrame {
            task: frame.task,
            particles: Arc::new(particles),
            meshes: frame.meshes,
            rods: frame.rods,
            facts: frame.facts,
            time: frame.time,
            focus: frame.focus,
            report,
            notes,
        })
    }

    /// Reuses planes for the next image: new ones cost a page fault per 4 KiB.
    fn recycle(&mut self, film: Film) {
        self.film = film;
    }

    /// Renders `frame`, which must be the one built last, and leaves its noise.
    ///
    /// # Errors
    /// [`crate::render::RenderError::Interrupted`] if `stop` is raised, [`TraceError::File`] if a native frame
    /// changed in the meantime. All other errors are of settings that are checked in advance.
    fn trace(
        &mut self,
        setup: &Setup,
        frame: &BuiltFrame,
        stop: &dyn Stop,
    ) -> Result<TracedFrame, TraceError> {
        // Trace the image
        let start = Instant::now();
        let mut film = std::mem::take(&mut self.film);
        let rays = self.draw(setup, frame, &mut film, stop)?;
        let memory = MemoryUse::now();
        // Name its objects while the particles are there
        let texts = mattes::attributes_of(setup, frame);
        // Complete the report
        let mut report = frame.report.clone();
        report.seconds.trace = seconds(start.elapsed());
        report.clamped_light = rays.lost.part(&film.color, setup.picture.render.samples);
        report.sampling = sampling(&film, setup, &rays);
        report.rays = rays.into();
        Ok(TracedFrame {
            camera: setup.camera_at(frame.task.frame)?,
            task: frame.task.clone(),
            film,
            rest: None,
            texts,
            facts: frame.facts.clone(),
            time: frame.time,
            report,
            memory,
        })
    }

    /// Renders only the planes of `frame`, which must be the one built last.
    ///
    /// # Errors
    /// Same as [`Self::trace`].
    fn image(
        &self,
        setup: &Setup,
        frame: &BuiltFrame,
        stop: &dyn Stop,
    ) -> Result<(Film, RayCounts), TraceError> {
        let mut film = Film::default();
        let rays = self.draw(setup, frame, &mut film, stop)?;
        Ok((film, rays))
    }
}

impl CpuRenderer {
    fn build_copy(&mut self, setup: &Setup, frame: &DecodedFrame<'_>) -> BuildReport {
        let has_values = frame.shading.has_colors();
        let settings = setup.build_settings(frame.centers.len(), has_values);
        self.builder.build(&spheres(frame), &settings)
    }

    fn build_above(
        &mut self,
        setup: &Setup,
        frame: &StoredFrame,
    ) -> Result<BuildReport, TraceError> {
        let settings = StoredSettings {
            structure: frame.structure(),
            radius: frame.radius(),
            keep_indices: frame.needs_indices(setup),
        };
        let built = self.stored.build(&frame.leaves()?, settings);
        built.map_err(|fault| TraceError::Stored { path: frame.path().to_owned(), fault })
    }

    fn draw(
        &self,
        setup: &Setup,
        frame: &BuiltFrame,
        film: &mut Film,
        stop: &dyn Stop,
    ) -> Result<RayCounts, TraceError> {
        let scene = setup.scene_at(frame.task.frame, frame.focus)?;
        let surface = &self.surface;
        let others = surface::others(&setup.picture.things.meshes, &frame.meshes, &frame.rods);
        match &*frame.particles {
            BuiltParticles::Decoded(shading) => {
                let source = particle_shading(&setup.picture, shading);
                let tree = self.builder.tree().view();
                Ok(surface.draw(setup, tree, &others, &scene, &source, film, stop)?)
            }
            BuiltParticles::Stored(stored) => {
                let leaves = stored.leaves()?;
                let source = stored.shading(&setup.picture, DEFAULT_COLOR);
                let tree = self.stored.view(&leaves);
                let rays = surface.draw(setup, tree, &others, &scene, &source, film, stop)?;
                // Reject the image if the file has changed meanwhile.
                stored.check()?;
                Ok(rays)
            }
        }
    }
}

/// The samples of `film`, if its noise is limited.
fn sampling(film: &Film, setup: &Setup, rays: &RayCounts) -> Option<SamplingSummary> {
    let pixels = film.color.len() as f64;
    let part = |of: u64| if pixels > 0.0 { of as f64 / pixels } else { 0.0 };
    let summary = SamplingSummary { samples: part(rays.samples), noisy: part(rays.noisy_pixels) };
    setup.picture.render.noise.map(|_| summary)
}

fn seconds(time: Duration) -> f64 {
    time.as_secs_f64()
}

/// A renderer of the given kind that has not allocated memory yet.
pub fn renderer_of(kind: RendererKind) -> Box<dyn FrameRenderer> {
    match kind {
        RendererKind::Cpu => Box::new(CpuRenderer::default()),
        RendererKind::Gpu => Box::new(GpuRenderer::default()),
    }
}
