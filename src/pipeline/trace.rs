//! Second stage: the tree is built and the image traced.

use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use spherule_formats::Radius;

use super::ImageTask;
use super::load::LoadedFrame;
use super::rays::expected_rays;
use super::setup::{ColorRule, Setup};
use crate::accel::{BuildSettings, SphereRadius, Spheres, TreeBuilder, choose};
use crate::render::{Colors, Film, ParticleShading, RenderError, render};
use crate::report::FrameReport;
use crate::scene::ColorMap;
use crate::scene::material::DEFAULT_COLOR;
use crate::surface::spheres::SphereSurface;

/// An image in memory.
#[derive(Debug)]
pub struct TracedFrame {
    /// What it is.
    pub task: ImageTask,
    /// The planes.
    pub film: Film,
    /// Simulation time, if known.
    pub time: Option<f64>,
    /// The report so far.
    pub report: FrameReport,
}

/// Traces frame after frame in the same buffers.
#[derive(Debug, Default)]
pub struct FrameTracer {
    builder: TreeBuilder,
}

impl FrameTracer {
    /// A tracer without memory yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Builds the tree over `frame` and renders it.
    ///
    /// # Errors
    /// [`RenderError::Interrupted`] once `stop` is set; the others are settings that were checked
    /// before.
    pub fn trace(
        &mut self,
        setup: &Setup,
        frame: LoadedFrame,
        stop: &AtomicBool,
    ) -> Result<TracedFrame, RenderError> {
        let mut report = FrameReport {
            particles: frame.centers.len() as u64,
            dropped: frame.dropped,
            clamped_radii: frame.clamped_radii,
            ..FrameReport::default()
        };
        report.seconds.read = frame.read_time.as_secs_f64();
        let radius = match &frame.radius {
            Radius::Common(radius) => SphereRadius::Common(*radius),
            Radius::PerParticle(radii) => SphereRadius::Each(radii),
        };
        let structure = setup.accelerator.unwrap_or_else(|| {
            let threads = rayon::current_num_threads();
            choose(frame.centers.len(), expected_rays(setup), threads)
        });
        let channels = setup.render.channels;
        let settings = BuildSettings {
            keep_indices: channels.id || channels.velocity || !frame.values.is_empty(),
            bvh: setup.bvh,
            sbvh: setup.sbvh,
            ..BuildSettings::new(structure)
        };
        let spheres = Spheres {
            centers: &frame.centers,
            radius,
        };
        let build = self.builder.build(&spheres, &settings);
        report.set_build(&build);

        let LoadedFrame {
            task,
            centers,
            radius,
            values,
            ids,
            velocities,
            time,
            ..
        } = frame;
        // The tree has its own copy; while rays run, only that is needed.
        drop((centers, radius));
        let colors = match &setup.color {
            ColorRule::Constant(color) => Colors::Constant(*color),
            ColorRule::Attribute { .. } if values.is_empty() => Colors::Constant(DEFAULT_COLOR),
            ColorRule::Attribute { map, .. } => mapped(&values, map),
        };
        let source = ParticleShading {
            colors,
            ids: ids.as_deref(),
            velocities: velocities.as_deref(),
        };
        let start = Instant::now();
        let surface = SphereSurface::new(self.builder.tree());
        let (film, rays) = render(&surface, &setup.scene, &source, &setup.render, stop)?;
        report.seconds.trace = seconds(start.elapsed());
        report.rays = rays.into();
        Ok(TracedFrame {
            task,
            film,
            time,
            report,
        })
    }
}

fn mapped<'a>(values: &'a [f32], map: &'a ColorMap) -> Colors<'a> {
    Colors::Mapped { values, map }
}

fn seconds(time: Duration) -> f64 {
    time.as_secs_f64()
}
