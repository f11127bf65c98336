//! The surfaces of a frame, as the setup requires: the spheres of its tree, or the additional structures that are
//! built for other surfaces.

use std::sync::Arc;
use std::time::Instant;

use glam::Vec3;
use spherule_formats::Radius;

use super::decoded::DecodedFrame;
use super::meshes::PictureMesh;
use super::setup::Setup;
use crate::accel::view::TreeView;
use crate::accel::{BuildReport, BuildSettings, SphereRadius, Spheres, Structure, TreeBuilder};
use crate::metrics::MemoryUse;
use crate::metrics::memory::available;
use crate::render::{Film, RayCounts, RenderError, ShadeSource, Stop, render_into};
use crate::report::FrameReport;
use crate::scene::Scene;
use crate::surface::mesh::{MeshSurface, MeshTree};
use crate::surface::smooth::{SmoothError, SmoothGrid, SmoothReport};
use crate::surface::spheres::SphereSurface;
use crate::surface::spray::{DROP_RADIUS, SOFT_DROPS, soft_drop, spray_of};
use crate::surface::union::UnionSurface;
use crate::surface::{
    GradientNormals, MaterialId, NormalKind, PcaNormals, ShadingNormals, Shape, SurfaceKind,
    SurfaceSettings,
};

/// Radii with a smaller relative difference count as equal.
const RADIUS_TOLERANCE: f32 = 0.01;

/// Structures for the surfaces of a frame in addition to the tree of its body; memory is reused from frame to frame.
#[derive(Debug, Default)]
pub(super) struct SurfaceBuilder {
    /// Tree of the spray.
    spray: TreeBuilder,
    /// Number of particles in the body; those of the spray follow.
    body: u32,
    /// Number of drops of each particle of the spray.
    drops_per_particle: u32,
    smooth: SmoothGrid,
}

impl SurfaceBuilder {
    /// Builds the structures that `setup` requires before the tree of a frame is built, and adds their cost to
    /// `report`. Spray is removed from the body: its particles are moved to the end of the frame. The tree will be
    /// built in `trees`. A smooth surface needs no tree, so no particles remain for one.
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
        self.clear();
        // Separate the spray
        if setup.picture.surface.spray {
            let built = self.separate_spray(setup, frame, trees);
            report.bytes.surface = built.position_bytes + built.structure_bytes;
        }
        // Build the grid of a smooth surface
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
            Radius::PerParticle(radii) => median_radius(radii, notes),
        };
        let channels = setup.picture.render.channels;
        let is_colored = setup.picture.color.is_by_particle();
        // Keep the particles if attributes are looked up at points of the surface
        let keep = channels.needs_particles() || is_colored;
        let left = memory_left(setup.run.memory_limit);
        let made = self
            .smooth
            .build(&frame.centers, radius, &setup.picture.surface, keep, left)?;
        // Note what the user may not expect
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

    /// Releases everything of the previous frame.
    pub(super) fn clear(&mut self) {
        let nothing = Spheres {
            centers: &[],
            radius: SphereRadius::Common(1.0),
        };
        self.spray.build(&nothing, &BuildSettings::default());
        self.body = u32::MAX;
        self.smooth = SmoothGrid::default();
    }

    fn separate_spray(
        &mut self,
        setup: &Setup,
        frame: &mut DecodedFrame,
        trees: &mut TreeBuilder,
    ) -> BuildReport {
        // Find the spray in the tree that is fastest to build; the result does not depend on the structure
        trees.build(&spheres(frame), &BuildSettings::new(Structure::Lbvh));
        let spray = spray_of(&trees.tree().view(), support(&setup.picture.surface));
        let body = frame.move_to_end(&spray, setup.picture.needs_ids());
        self.body = u32::try_from(body).unwrap_or(u32::MAX);
        // Build the tree of the drops
        let is_soft = setup.picture.scene.is_spray_soft;
        let ids = frame.shading.ids.as_deref().filter(|_| is_soft);
        let plain = match &frame.radius {
            Radius::Common(radius) => Radius::Common(DROP_RADIUS * radius),
            Radius::PerParticle(radii) => {
                Radius::PerParticle(radii[body..].iter().map(|r| DROP_RADIUS * r).collect())
            }
        };
        self.drops_per_particle = if is_soft { SOFT_DROPS } else { 1 };
        let drops = ids.map(|ids| soft_drops(&frame.centers, &frame.radius, body, ids));
        let built = match &drops {
            Some((centers, radii)) => Spheres {
                centers,
                radius: SphereRadius::Each(radii),
            },
            None => Spheres {
                centers: &frame.centers[body..],
                radius: radius_of(&plain),
            },
        };
        let built = self.spray.build(&built, &BuildSettings::default());
        // Keep only the body in the frame
        frame.centers.truncate(body);
        if let Radius::PerParticle(radii) = &mut frame.radius {
            radii.truncate(body);
        }
        built
    }

    /// Renders the surface that `setup` requires over the spheres of `tree`, and `meshes`, to `film`.
    ///
    /// # Errors
    /// Same as [`render_into`].
    #[expect(
        clippy::too_many_arguments,
        reason = "parts of a frame with different owners"
    )]
    pub(super) fn draw(
        &self,
        setup: &Setup,
        tree: TreeView<'_>,
        meshes: &[Arc<MeshTree>],
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
        let spray = SphereSurface::new(self.spray.tree().view())
            .of(MaterialId::SPRAY, self.body)
            .of_particles_with(self.drops_per_particle);
        let mut shapes: Vec<&dyn Shape> = vec![&*body];
        if !self.spray.tree().view().is_empty() {
            shapes.push(&spray);
        }
        let meshes: Vec<MeshSurface<'_>> = mesh_surfaces(&setup.picture.meshes, meshes).collect();
        shapes.extend(meshes.iter().map(|mesh| mesh as &dyn Shape));
        render_into(film, &shapes, scene, source, &setup.picture.render, stop)
    }
}

/// Centres and radii of the soft drops of the particles from number `body` on.
fn soft_drops(
    centers: &[Vec3],
    radius: &Radius,
    body: usize,
    ids: &[u32],
) -> (Vec<Vec3>, Vec<f32>) {
    let radius_of = |particle: usize| match radius {
        Radius::Common(radius) => *radius,
        Radius::PerParticle(radii) => radii[particle],
    };
    let drops = (body..centers.len()).flat_map(|particle| {
        let (center, radius) = (centers[particle], radius_of(particle));
        (0..SOFT_DROPS).map(move |number| {
            let drop = soft_drop(ids[particle], number);
            (center + radius * drop.offset, radius * drop.radius)
        })
    });
    drops.unzip()
}

/// The shapes of `trees`, which are `meshes` of a picture.
fn mesh_surfaces<'a>(
    meshes: &'a [PictureMesh],
    trees: &'a [Arc<MeshTree>],
) -> impl Iterator<Item = MeshSurface<'a>> {
    let meshes = meshes.iter().zip(trees).enumerate();
    meshes.filter_map(|(index, (mesh, tree))| {
        let material = MaterialId::of_mesh(index)?;
        Some(MeshSurface::new(tree, mesh.settings.faces, material))
    })
}

/// The spheres of a frame as the input of a builder.
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

/// The median of `radii`, because the field needs a common radius.
fn median_radius(radii: &[f32], notes: &mut Vec<String>) -> f32 {
    let mut sorted = radii.to_vec();
    let middle = sorted.len() / 2;
    if sorted.is_empty() {
        return 1.0;
    }
    let (_, median, _) = sorted.select_nth_unstable_by(middle, f32::total_cmp);
    let median = *median;
    if radii
        .iter()
        .any(|radius| (radius - median).abs() > RADIUS_TOLERANCE * median)
    {
        notes.push(format!(
            "radii differ; a smooth surface has one for all, here their median {median} (input.radius sets another)"
        ));
    }
    median
}

/// Bytes that a surface may use: within the limit of the job, and free.
fn memory_left(limit: Option<u64>) -> Option<u64> {
    let used = MemoryUse::now().anonymous;
    let of_limit = limit.map(|limit| limit.saturating_sub(used));
    match (of_limit, available()) {
        (Some(limit), Some(free)) => Some(limit.min(free)),
        (limit, free) => limit.or(free),
    }
}

/// Support of the SPH kernel in particle radii.
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
