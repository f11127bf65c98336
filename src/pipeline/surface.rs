//! What rays meet in a frame: the spheres of its tree as the setup asks for them, and what is made for that
//! beside the tree.

use std::time::Instant;

use spherule_formats::Radius;

use super::decoded::DecodedFrame;
use super::setup::Setup;
use crate::accel::view::TreeView;
use crate::accel::{BuildReport, BuildSettings, SphereRadius, Spheres, Structure, TreeBuilder};
use crate::metrics::MemoryUse;
use crate::metrics::memory::available;
use crate::render::{Film, RayCounts, RenderError, ShadeSource, Stop, render_into};
use crate::report::FrameReport;
use crate::scene::Scene;
use crate::surface::smooth::{SmoothError, SmoothGrid, SmoothReport};
use crate::surface::spheres::SphereSurface;
use crate::surface::spray::{DROP_RADIUS, spray_of};
use crate::surface::union::UnionSurface;
use crate::surface::{
    GradientNormals, MaterialId, NormalKind, PcaNormals, ShadingNormals, Shape, SurfaceKind,
    SurfaceSettings,
};

/// Radii that differ by no more than this part are the same.
const SAME_RADIUS: f32 = 0.01;

/// What a frame's surface has beside the tree over its body; its memory lives on from frame to frame.
#[derive(Debug, Default)]
pub(super) struct SurfaceBuilder {
    /// Over the spray.
    spray: TreeBuilder,
    /// Particles of the body, which come before those of the spray.
    body: u32,
    smooth: SmoothGrid,
}

impl SurfaceBuilder {
    /// Makes what `setup` asks for of a frame that a tree is to be built over, and says in `report` what that
    /// took. Spray is taken out of the body: its particles become the frame's last. `trees` is where the tree
    /// will be. A smooth surface needs no tree: none of its particles are left for one.
    ///
    /// # Errors
    /// [`SmoothError`] if a smooth surface does not fit.
    pub(super) fn build(
        &mut self,
        setup: &Setup,
        frame: &mut DecodedFrame,
        trees: &mut TreeBuilder,
        report: &mut FrameReport,
    ) -> Result<Vec<String>, SmoothError> {
        let start = Instant::now();
        self.forget();
        if setup.picture.surface.spray {
            let built = self.part_spray(setup, frame, trees);
            report.bytes.surface = built.position_bytes + built.structure_bytes;
        }
        let mut notes = Vec::new();
        if setup.picture.surface.kind == SurfaceKind::Smooth {
            let made = self.build_smooth(setup, frame, &mut notes)?;
            report.bytes.surface += made.bytes;
            report.bytes.surface_peak = report.bytes.surface + made.peak_bytes - made.bytes;
            frame.centers = Vec::new();
            frame.radius = Radius::Common(setup.picture.least_radius);
        }
        report.seconds.surface = start.elapsed().as_secs_f64();
        Ok(notes)
    }

    fn build_smooth(
        &mut self,
        setup: &Setup,
        frame: &DecodedFrame,
        notes: &mut Vec<String>,
    ) -> Result<SmoothReport, SmoothError> {
        let radius = match &frame.radius {
            Radius::Common(radius) => *radius,
            Radius::PerParticle(radii) => usual_radius(radii, notes),
        };
        let channels = setup.picture.render.channels;
        let is_colored = setup.picture.color.is_by_particle();
        // Whoever is asked for by a place on the surface.
        let keep = channels.id || channels.velocity || is_colored;
        let left = memory_left(setup.run.memory_limit);
        let made = self
            .smooth
            .build(&frame.centers, radius, &setup.picture.surface, keep, left)?;
        if made.left_out > 0 {
            notes.push(format!(
                "{} particles are too far from all others for the smooth surface and left out",
                made.left_out
            ));
        }
        if made.is_empty {
            notes.push(format!(
                "the smooth surface is empty: with radius {radius} the field of the particles nowhere gets to \
                 surface.threshold = {}",
                setup.picture.surface.threshold
            ));
        }
        Ok(made)
    }

    /// Nothing is left of the last frame.
    pub(super) fn forget(&mut self) {
        let nothing = Spheres {
            centers: &[],
            radius: SphereRadius::Common(1.0),
        };
        self.spray.build(&nothing, &BuildSettings::default());
        self.body = u32::MAX;
        self.smooth = SmoothGrid::default();
    }

    fn part_spray(
        &mut self,
        setup: &Setup,
        frame: &mut DecodedFrame,
        trees: &mut TreeBuilder,
    ) -> BuildReport {
        // Whatever is asked for: this one is the soonest built, and lonely particles are the same in all.
        trees.build(&spheres(frame), &BuildSettings::new(Structure::Lbvh));
        let spray = spray_of(&trees.tree().view(), support(&setup.picture.surface));
        let body = frame.put_last(&spray, setup.picture.render.channels.id);
        self.body = u32::try_from(body).unwrap_or(u32::MAX);
        let drops = match &frame.radius {
            Radius::Common(radius) => Radius::Common(DROP_RADIUS * radius),
            Radius::PerParticle(radii) => {
                Radius::PerParticle(radii[body..].iter().map(|r| DROP_RADIUS * r).collect())
            }
        };
        let built = Spheres {
            centers: &frame.centers[body..],
            radius: radius_of(&drops),
        };
        let built = self.spray.build(&built, &BuildSettings::default());
        frame.centers.truncate(body);
        if let Radius::PerParticle(radii) = &mut frame.radius {
            radii.truncate(body);
        }
        built
    }

    /// Draws the surface that `setup` asks for over the spheres of `tree` into `film`.
    ///
    /// # Errors
    /// As [`render_into`].
    pub(super) fn draw(
        &self,
        setup: &Setup,
        tree: TreeView<'_>,
        scene: &Scene,
        source: &dyn ShadeSource,
        film: &mut Film,
        stop: &dyn Stop,
    ) -> Result<RayCounts, RenderError> {
        let normals = shading_normals(&setup.picture.surface);
        let body: Box<dyn Shape + '_> = match setup.picture.surface.kind {
            SurfaceKind::Spheres => Box::new(SphereSurface::new(tree).with_normals(normals)),
            SurfaceKind::Union => Box::new(UnionSurface::new(tree).with_normals(normals)),
            SurfaceKind::Smooth => Box::new(self.smooth.surface()),
        };
        let spray = SphereSurface::new(self.spray.tree().view()).of(MaterialId::SPRAY, self.body);
        let mut shapes: Vec<&dyn Shape> = vec![&*body];
        if !self.spray.tree().view().is_empty() {
            shapes.push(&spray);
        }
        render_into(film, &shapes, scene, source, &setup.picture.render, stop)
    }
}

/// The spheres of a frame as builders take them.
pub(super) fn spheres(frame: &DecodedFrame) -> Spheres<'_> {
    Spheres {
        centers: &frame.centers,
        radius: radius_of(&frame.radius),
    }
}

fn radius_of(radius: &Radius) -> SphereRadius<'_> {
    match radius {
        Radius::Common(radius) => SphereRadius::Common(*radius),
        Radius::PerParticle(radii) => SphereRadius::Each(radii),
    }
}

/// The radius that half of `radii` are not above: the field has one for all.
fn usual_radius(radii: &[f32], notes: &mut Vec<String>) -> f32 {
    let mut sorted = radii.to_vec();
    let middle = sorted.len() / 2;
    if sorted.is_empty() {
        return 1.0;
    }
    let (_, median, _) = sorted.select_nth_unstable_by(middle, f32::total_cmp);
    let median = *median;
    if radii
        .iter()
        .any(|radius| (radius - median).abs() > SAME_RADIUS * median)
    {
        notes.push(format!(
            "radii differ; a smooth surface has one for all, here their median {median} (--radius gives another)"
        ));
    }
    median
}

/// Bytes that a surface may take: what is left of the job's limit, and free.
fn memory_left(limit: Option<u64>) -> Option<u64> {
    let used = MemoryUse::now().anonymous;
    let of_limit = limit.map(|limit| limit.saturating_sub(used));
    match (of_limit, available()) {
        (Some(limit), Some(free)) => Some(limit.min(free)),
        (limit, free) => limit.or(free),
    }
}

/// Reach of the SPH kernel, particle radii.
fn support(surface: &SurfaceSettings) -> f32 {
    2.0 * surface.smoothing_length
}

fn shading_normals(surface: &SurfaceSettings) -> ShadingNormals {
    match surface.normals {
        NormalKind::Auto | NormalKind::Sphere => ShadingNormals::Sphere,
        NormalKind::Field => ShadingNormals::Gradient(GradientNormals::new(support(surface))),
        NormalKind::Pca => ShadingNormals::Pca(PcaNormals::new(support(surface))),
    }
}

#[cfg(test)]
#[path = "surface_tests.rs"]
mod tests;
