//! Second stage: the tree is built and the image traced.

use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use glam::Vec3;
use spherule_formats::Radius;

use super::ImageTask;
use super::load::LoadedFrame;
use super::setup::{ColorRule, Setup};
use crate::accel::{SphereRadius, Spheres, TreeBuilder};
use crate::render::{Colors, Film, ParticleShading, RayCounts, RenderError, render};
use crate::report::FrameReport;
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

/// A frame whose tree stands in the tracer; what shading needs beside it.
#[derive(Debug)]
pub struct BuiltFrame {
    pub(super) task: ImageTask,
    values: Vec<f32>,
    ids: Option<Vec<u32>>,
    velocities: Option<Vec<Vec3>>,
    time: Option<f64>,
    pub(super) report: FrameReport,
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

    /// Builds the tree over `frame`, whose positions are let go: the tree has its own copy.
    pub fn build(&mut self, setup: &Setup, frame: LoadedFrame) -> BuiltFrame {
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
        let settings = setup.build_settings(frame.centers.len(), !frame.values.is_empty());
        let spheres = Spheres {
            centers: &frame.centers,
            radius,
        };
        let build = self.builder.build(&spheres, &settings);
        report.set_build(&build);
        BuiltFrame {
            task: frame.task,
            values: frame.values,
            ids: frame.ids,
            velocities: frame.velocities,
            time: frame.time,
            report,
        }
    }

    /// Renders `frame`, the one that was built last.
    ///
    /// # Errors
    /// [`RenderError::Interrupted`] once `stop` is set; the others are settings that were checked
    /// before.
    pub fn trace(
        &self,
        setup: &Setup,
        frame: BuiltFrame,
        stop: &AtomicBool,
    ) -> Result<TracedFrame, RenderError> {
        let start = Instant::now();
        let (film, rays) = self.image(setup, &frame, stop)?;
        let BuiltFrame {
            task,
            time,
            mut report,
            ..
        } = frame;
        report.seconds.trace = seconds(start.elapsed());
        report.rays = rays.into();
        Ok(TracedFrame {
            task,
            film,
            time,
            report,
        })
    }

    /// Only the planes of `frame`, the one that was built last.
    ///
    /// # Errors
    /// As [`Self::trace`].
    pub fn image(
        &self,
        setup: &Setup,
        frame: &BuiltFrame,
        stop: &AtomicBool,
    ) -> Result<(Film, RayCounts), RenderError> {
        let values = &frame.values;
        let colors = match &setup.color {
            ColorRule::Constant(color) => Colors::Constant(*color),
            ColorRule::Attribute { .. } if values.is_empty() => Colors::Constant(DEFAULT_COLOR),
            ColorRule::Attribute { map, .. } => Colors::Mapped { values, map },
        };
        let source = ParticleShading {
            colors,
            ids: frame.ids.as_deref(),
            velocities: frame.velocities.as_deref(),
        };
        let surface = SphereSurface::new(self.builder.tree().view());
        render(&surface, &setup.scene, &source, &setup.render, stop)
    }
}

fn seconds(time: Duration) -> f64 {
    time.as_secs_f64()
}
