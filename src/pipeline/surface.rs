//! What rays meet in a frame: the spheres of its tree as the setup asks for them, and what is made for that
//! beside the tree.

use std::sync::atomic::AtomicBool;
use std::time::Instant;

use spherule_formats::Radius;

use super::decoded::DecodedFrame;
use super::setup::Setup;
use crate::accel::view::TreeView;
use crate::accel::{BuildReport, BuildSettings, SphereRadius, Spheres, Structure, TreeBuilder};
use crate::render::{Film, RayCounts, RenderError, ShadeSource, render};
use crate::report::FrameReport;
use crate::scene::Scene;
use crate::surface::medium::MediumSurface;
use crate::surface::spheres::SphereSurface;
use crate::surface::spray::{DROP_RADIUS, Drops, WithSpray, spray_of};
use crate::surface::{
    NormalKind, PcaNormals, ShadingNormals, Surface, SurfaceKind, SurfaceSettings,
};

/// What a frame's surface has beside the tree over its body; its memory lives on from frame to frame.
#[derive(Debug, Default)]
pub(super) struct SurfaceBuilder {
    /// Over the spray.
    spray: TreeBuilder,
    /// Particles of the body, which come before those of the spray.
    body: u32,
}

impl SurfaceBuilder {
    /// Makes what `setup` asks for of a frame that a tree is to be built over, and says in `report` what that
    /// took. Spray is taken out of the body: its particles become the frame's last. `trees` is where the tree
    /// will be.
    pub(super) fn build(
        &mut self,
        setup: &Setup,
        frame: &mut DecodedFrame,
        trees: &mut TreeBuilder,
        report: &mut FrameReport,
    ) {
        let start = Instant::now();
        self.forget();
        if setup.surface.spray {
            let built = self.part_spray(setup, frame, trees);
            report.bytes.surface = built.position_bytes + built.structure_bytes;
        }
        report.seconds.surface = start.elapsed().as_secs_f64();
    }

    /// Nothing is left of the last frame.
    pub(super) fn forget(&mut self) {
        let nothing = Spheres {
            centers: &[],
            radius: SphereRadius::Common(1.0),
        };
        self.spray.build(&nothing, &BuildSettings::default());
        self.body = u32::MAX;
    }

    fn part_spray(
        &mut self,
        setup: &Setup,
        frame: &mut DecodedFrame,
        trees: &mut TreeBuilder,
    ) -> BuildReport {
        // Whatever is asked for: this one is the soonest built, and lonely particles are the same in all.
        trees.build(&spheres(frame), &BuildSettings::new(Structure::Lbvh));
        let spray = spray_of(&trees.tree().view(), support(&setup.surface));
        let body = frame.put_last(&spray, setup.render.channels.id);
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

    fn drops(&self) -> Option<Drops<'_>> {
        let tree = self.spray.tree().view();
        (!tree.is_empty()).then(|| Drops::new(tree, self.body))
    }

    /// The image of the surface that `setup` asks for over the spheres of `tree`.
    ///
    /// # Errors
    /// As [`render`].
    pub(super) fn draw<C: ShadeSource>(
        &self,
        setup: &Setup,
        tree: TreeView<'_>,
        scene: &Scene,
        source: &C,
        stop: &AtomicBool,
    ) -> Result<(Film, RayCounts), RenderError> {
        let normals = shading_normals(&setup.surface);
        match setup.surface.kind {
            SurfaceKind::Spheres => {
                let body = SphereSurface::new(tree).shaded_by(normals);
                self.draw_body(body, setup, scene, source, stop)
            }
            // Until there is an isosurface, the body that it lies in.
            SurfaceKind::Medium | SurfaceKind::Smooth => {
                let body = MediumSurface::new(tree).shaded_by(normals);
                self.draw_body(body, setup, scene, source, stop)
            }
        }
    }

    fn draw_body<S: Surface, C: ShadeSource>(
        &self,
        body: S,
        setup: &Setup,
        scene: &Scene,
        source: &C,
        stop: &AtomicBool,
    ) -> Result<(Film, RayCounts), RenderError> {
        let surface = WithSpray::new(body, self.drops());
        render(&surface, scene, source, &setup.render, stop)
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

/// Reach of the SPH kernel, particle radii.
fn support(surface: &SurfaceSettings) -> f32 {
    2.0 * surface.smoothing_length
}

fn shading_normals(surface: &SurfaceSettings) -> ShadingNormals {
    match surface.normals {
        NormalKind::Auto | NormalKind::Sphere | NormalKind::Field => ShadingNormals::Sphere,
        NormalKind::Pca => ShadingNormals::Pca(PcaNormals::new(support(surface))),
    }
}

#[cfg(test)]
#[path = "surface_tests.rs"]
mod tests;
