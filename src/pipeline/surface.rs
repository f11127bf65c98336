//! The surfaces of a frame, as the setup requires: the spheres of its tree, or the additional structures that are
//! built for other surfaces.

use std::borrow::Cow;
use std::sync::Arc;
use std::time::Instant;

use glam::Vec3;
use spherule_formats::Radius;

use super::bodies::{BodyParticles, build_grid, radius_of, shading_normals};
use super::clumps::take_clumps;
use super::decoded::DecodedFrame;
use super::meshes::{MeshSlices, MeshThing};
use super::motion::expose;
use super::rods::FrameRods;
use super::setup::Setup;
use super::styled::StyleSurfaces;
use super::whitewater::FrameDrops;
use crate::accel::moving::MovingTree;
use crate::accel::view::TreeView;
use crate::accel::{BuildReport, BuildSettings, SphereRadius, Spheres, Structure, TreeBuilder};
use crate::render::{Film, RayCounts, RenderError, ShadeSource, Stop, render_into};
use crate::report::FrameReport;
use crate::scene::Scene;
use crate::surface::clumps::{MovingClumps, SurfaceWithClumps};
use crate::surface::cut::{ConvexRegion, CutSpheres};
use crate::surface::mesh::{MeshSurface, MeshTree};
use crate::surface::moving::MovingSpheres;
use crate::surface::slices::{SlicedSurface, slice_times};
use crate::surface::smooth::{SmoothError, SmoothGrid, SmoothReport};
use crate::surface::spheres::SphereSurface;
use crate::surface::spray::{DROP_RADIUS, SOFT_DROPS, soft_drop, spray_of};
use crate::surface::union::UnionSurface;
use crate::surface::{CutShape, MaterialId, Shape, SphereOwners, SurfaceKind};

/// Input for a tree without spheres.
const NOTHING: Spheres<'_> = Spheres { centers: &[], radius: SphereRadius::Common(1.0) };

/// Structures for the surfaces of a frame in addition to the tree of its body; memory is reused from frame to frame.
#[derive(Debug, Default)]
pub(super) struct SurfaceBuilder {
    /// Tree of the spray.
    spray: TreeBuilder,
    /// Number of particles in the body; those of the spray follow.
    body: u32,
    /// Number of drops of each particle of the spray.
    drops_per_particle: u32,
    /// The particle of each drop of whitewater; empty for spray.
    owners: Vec<u32>,
    /// A smooth surface, for each slice of the exposure.
    smooth: Vec<SmoothGrid>,
    /// What flies fast and apart from it, with motion blur.
    clumps: MovingClumps,
    /// Trees of a union, for each slice of the exposure; empty without motion blur.
    unions: Vec<TreeBuilder>,
    /// By how far the spheres of the body move, until their moving tree is built.
    displacements: Vec<Vec3>,
    /// The spheres of the body and of the spray, with motion blur.
    moving: [MovingTree; 2],
    /// Particles with a style that are not in the tree of the body.
    styles: StyleSurfaces,
}

impl SurfaceBuilder {
    /// Builds the structures that `setup` requires before the tree of a frame is built, and adds their cost to
    /// `report`. Spray is removed from the body: its particles are moved to the end of the frame. The tree will be
    /// built in `trees`. Surfaces that need no tree leave no particles for one.
    ///
    /// # Errors
    /// [`SmoothError`] if a smooth surface does not fit.
    pub(super) fn build(
        &mut self,
        setup: &Setup,
        frame: &mut DecodedFrame<'_>,
        trees: &mut TreeBuilder,
        report: &mut FrameReport,
    ) -> Result<Vec<String>, SmoothError> {
        let start = Instant::now();
        self.clear();
        // Separate the styles and the spray, and put all particles in the middle of the exposure
        let mut notes = Vec::new();
        let (styles, style_bytes) = StyleSurfaces::take(setup, frame, &mut notes)?;
        self.styles = styles;
        let has_spray = setup.picture.surface.spray;
        if has_spray {
            self.find_spray(setup, frame, trees);
        }
        let whitewater = setup.picture.surface.whitewater;
        let mut drops = whitewater.then(|| self.find_whitewater(setup, frame, &mut notes));
        if let Some(shutter) = setup.picture.view.shutter {
            self.displacements = expose(setup, shutter, frame);
        }
        if has_spray {
            let built = self.build_spray(setup, frame);
            report.bytes.surface = built.position_bytes + built.structure_bytes;
            report.bytes.surface += self.moving[1].byte_len();
        }
        if let Some(drops) = &mut drops {
            drops.place(&frame.centers, &self.displacements);
            self.leave_body(frame);
        }
        report.bytes.surface += style_bytes;
        // Build a surface that is not made of single spheres
        let kind = setup.picture.surface.kind;
        if kind == SurfaceKind::Smooth {
            let made = self.build_smooth(setup, frame, &mut notes)?;
            report.bytes.surface += made.bytes;
            report.bytes.surface_peak = report.bytes.surface + made.peak_bytes - made.bytes;
        }
        if let Some(drops) = drops {
            let built = self.build_whitewater(drops);
            report.bytes.surface += built;
        }
        let has_unions = kind == SurfaceKind::Union && setup.has_motion();
        if has_unions {
            report.bytes.surface += self.build_unions(setup, frame)?;
        }
        // The surface stands for the particles, which are not needed any more
        if kind == SurfaceKind::Smooth || has_unions {
            frame.centers = Cow::Borrowed(&[]);
            frame.radius = Radius::Common(setup.picture.particles.least_radius);
            self.displacements = Vec::new();
        }
        report.seconds.surface = start.elapsed().as_secs_f64();
        Ok(notes)
    }

    /// Replaces the tree of the body, which was just built in `trees`, by one whose spheres move, with motion blur.
    pub(super) fn set_in_motion(&mut self, trees: &mut TreeBuilder, report: &mut FrameReport) {
        if self.displacements.is_empty() {
            return;
        }
        let start = Instant::now();
        self.moving[0].build(&trees.tree().view(), &self.displacements);
        self.displacements = Vec::new();
        *trees = TreeBuilder::new();
        report.bytes.surface += self.moving[0].byte_len();
        report.seconds.surface += start.elapsed().as_secs_f64();
    }

    /// Calls `build` with the body at the middle of each slice of the exposure; without motion blur, as it is.
    fn build_slices(
        &mut self,
        setup: &Setup,
        frame: &mut DecodedFrame<'_>,
        mut build: impl FnMut(&mut Self, &DecodedFrame<'_>) -> Result<(), SmoothError>,
    ) -> Result<(), SmoothError> {
        // Find the times; without motion there is one
        let times = match setup.picture.view.shutter {
            Some(shutter) => slice_times(shutter.slices).collect(),
            None => vec![0.0],
        };
        // Move the particles on from one time to the next
        let mut now = 0.0;
        for time in times {
            if !self.displacements.is_empty() {
                let centers = frame.centers.to_mut().iter_mut();
                for (center, displacement) in centers.zip(&self.displacements) {
                    *center += (time - now) * *displacement;
                }
            }
            now = time;
            build(self, frame)?;
        }
        Ok(())
    }

    /// Builds a tree for each slice of the exposure, and returns their memory in bytes.
    fn build_unions(
        &mut self,
        setup: &Setup,
        frame: &mut DecodedFrame<'_>,
    ) -> Result<u64, SmoothError> {
        let settings = setup.build_settings(frame.centers.len(), frame.shading.has_colors());
        let mut bytes = 0;
        self.build_slices(setup, frame, |this, frame| {
            let mut trees = TreeBuilder::new();
            let built = trees.build(&spheres(frame), &settings);
            bytes += built.position_bytes + built.structure_bytes;
            this.unions.push(trees);
            Ok(())
        })?;
        Ok(bytes)
    }

    fn build_smooth(
        &mut self,
        setup: &Setup,
        frame: &mut DecodedFrame<'_>,
        notes: &mut Vec<String>,
    ) -> Result<SmoothReport, SmoothError> {
        let settings = &setup.picture.surface;
        // Bodies that touch have one surface, which is not divided
        let (clumps, mut made) = match self.styles.prior() {
            [] => take_clumps(setup, frame, &mut self.displacements)?,
            _ => Default::default(),
        };
        self.clumps = clumps;
        let first_note = notes.len();
        self.build_slices(setup, frame, |this, frame| {
            let mut grid = SmoothGrid::default();
            let mut own_notes = Vec::new();
            let particles = BodyParticles {
                centers: &frame.centers,
                radius: &frame.radius,
                prior: this.styles.prior(),
            };
            let one = build_grid(setup, &mut grid, particles, settings, &mut own_notes)?;
            // Those of the last slice stand for all
            notes.truncate(first_note);
            notes.append(&mut own_notes);
            this.smooth.push(grid);
            made = SmoothReport {
                bytes: made.bytes + one.bytes,
                peak_bytes: made.peak_bytes.max(made.bytes + one.peak_bytes),
                ..one
            };
            Ok(())
        })?;
        Ok(made)
    }

    /// Releases everything of the previous frame.
    pub(super) fn clear(&mut self) {
        self.spray.build(&NOTHING, &BuildSettings::default());
        *self = Self { spray: std::mem::take(&mut self.spray), body: u32::MAX, ..Self::default() };
    }

    /// Moves the particles of the spray behind those of the body.
    fn find_spray(&mut self, setup: &Setup, frame: &mut DecodedFrame<'_>, trees: &mut TreeBuilder) {
        // Use the tree that is fastest to build; the result does not depend on the structure
        trees.build(&spheres(frame), &BuildSettings::new(Structure::Lbvh));
        let spray = spray_of(&trees.tree().view(), setup.picture.surface.support());
        let body = frame.move_to_end(&spray, setup.picture.needs_ids());
        self.body = u32::try_from(body).unwrap_or(u32::MAX);
    }

    /// Builds the tree of the drops, and leaves only the body in `frame`.
    fn build_spray(&mut self, setup: &Setup, frame: &mut DecodedFrame<'_>) -> BuildReport {
        // Find radii and places of the drops
        let body = frame.centers.len().min(self.body as usize);
        let is_soft = setup.picture.scene.is_spray_soft();
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
            Some((centers, radii)) => Spheres { centers, radius: SphereRadius::Each(radii) },
            None => Spheres { centers: &frame.centers[body..], radius: radius_of(&plain) },
        };
        // Build their tree
        let is_moving = !self.displacements.is_empty();
        let settings = BuildSettings {
            // A drop has the attributes of its particle
            keep_indices: is_moving || setup.needs_indices(frame.shading.has_colors()),
            ..BuildSettings::default()
        };
        let built = self.spray.build(&built, &settings);
        // Add their motion
        if is_moving {
            let count = self.drops_per_particle as usize;
            let of_spray = self.displacements[body..].iter();
            let of_drops: Vec<Vec3> = of_spray
                .flat_map(|displacement| std::iter::repeat_n(*displacement, count))
                .collect();
            self.moving[1].build(&self.spray.tree().view(), &of_drops);
        }
        self.leave_body(frame);
        built
    }

    /// Leaves only the body in `frame`, apart from what belongs to its shading.
    fn leave_body(&mut self, frame: &mut DecodedFrame<'_>) {
        let body = frame.centers.len().min(self.body as usize);
        match &mut frame.centers {
            Cow::Borrowed(all) => *all = &all[..body],
            Cow::Owned(all) => all.truncate(body),
        }
        self.displacements.truncate(body);
        if let Radius::PerParticle(radii) = &mut frame.radius {
            radii.truncate(body);
        }
    }

    /// Finds the whitewater of `frame`, and moves the particles that are nothing but spray behind those of the body.
    fn find_whitewater(
        &mut self,
        setup: &Setup,
        frame: &mut DecodedFrame<'_>,
        notes: &mut Vec<String>,
    ) -> FrameDrops {
        let (drops, body) = FrameDrops::find(setup, frame, notes);
        self.body = u32::try_from(body).unwrap_or(u32::MAX);
        drops
    }

    /// Builds the tree of `drops` on the smooth surface, and returns its memory in bytes.
    fn build_whitewater(&mut self, mut drops: FrameDrops) -> u64 {
        if let Some(grid) = self.smooth.get(self.smooth.len() / 2) {
            drops.float(&grid.surface());
        }
        let (built, owners) = drops.build(&mut self.spray, &mut self.moving[1]);
        self.owners = owners;
        let owners = size_of_val(&self.owners[..]) as u64;
        built.position_bytes + built.structure_bytes + self.moving[1].byte_len() + owners
    }

    /// Renders the surface that `setup` requires over the spheres of `tree`, and the shapes `others`, to `film`.
    ///
    /// # Errors
    /// Same as [`render_into`].
    #[expect(clippy::too_many_arguments, reason = "parts of a frame with different owners")]
    pub(super) fn draw(
        &self,
        setup: &Setup,
        tree: TreeView<'_>,
        others: &[Box<dyn Shape + '_>],
        scene: &Scene,
        source: &dyn ShadeSource,
        film: &mut Film,
        stop: &dyn Stop,
    ) -> Result<RayCounts, RenderError> {
        let body = self.body(setup, tree);
        let owners = if self.owners.is_empty() {
            SphereOwners::new(MaterialId::SPRAY, self.body).with_spheres(self.drops_per_particle)
        } else {
            SphereOwners::listed(MaterialId::SPRAY, &self.owners)
        };
        let spray: Box<dyn Shape> = if setup.has_motion() {
            Box::new(MovingSpheres::new(&self.moving[1]).of(owners))
        } else {
            Box::new(SphereSurface::new(self.spray.tree().view()).of(owners))
        };
        let mut styles = Vec::new();
        self.styles.add_to(&mut styles);
        let mut shapes: Vec<&dyn Shape> = vec![&*body];
        shapes.extend(styles.iter().map(|shape| &**shape));
        if !self.spray.tree().view().is_empty() {
            shapes.push(&*spray);
        }
        shapes.extend(others.iter().map(|shape| &**shape));
        render_into(film, &shapes, scene, source, &setup.picture.render, stop)
    }
}

impl SurfaceBuilder {
    /// The surface of the body, over the spheres of `tree` unless it has its own structures.
    fn body<'a>(&'a self, setup: &'a Setup, tree: TreeView<'a>) -> Box<dyn Shape + 'a> {
        let region = &setup.picture.particles.cut;
        let normals = shading_normals(&setup.picture.surface);
        let union = |tree| UnionSurface::new(tree).with_normals(normals);
        match (setup.picture.surface.kind, setup.has_motion()) {
            (SurfaceKind::Spheres, false) => {
                cut(SphereSurface::new(tree).with_normals(normals), region)
            }
            (SurfaceKind::Spheres, true) => cut(MovingSpheres::new(&self.moving[0]), region),
            (SurfaceKind::Union, false) => Box::new(union(tree)),
            (SurfaceKind::Union, true) => {
                let trees = self.unions.iter().map(|trees| union(trees.tree().view()));
                Box::new(SlicedSurface::new(trees.collect(), false))
            }
            (SurfaceKind::Smooth, false) => Box::new(self.smooth[0].surface()),
            (SurfaceKind::Smooth, true) => {
                let surfaces = self.smooth.iter().map(SmoothGrid::surface);
                let slices = SlicedSurface::new(surfaces.collect(), true);
                if self.clumps.is_empty() {
                    Box::new(slices)
                } else {
                    Box::new(SurfaceWithClumps::new(slices, &self.clumps))
                }
            }
        }
    }
}

/// The part of `spheres` in `region`.
fn cut<'a, S: CutShape + 'a>(spheres: S, region: &'a ConvexRegion) -> Box<dyn Shape + 'a> {
    if region.is_everywhere() {
        Box::new(spheres)
    } else {
        Box::new(CutSpheres::new(spheres, region))
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
    // Their number is known, but the iterator does not tell it
    let count = (centers.len() - body) * SOFT_DROPS as usize;
    let mut drops = (Vec::with_capacity(count), Vec::with_capacity(count));
    drops.extend((body..centers.len()).flat_map(|particle| {
        let (center, radius) = (centers[particle], radius_of(particle));
        (0..SOFT_DROPS).map(move |number| {
            let drop = soft_drop(ids[particle], number);
            (center + radius * drop.offset, radius * drop.radius)
        })
    }));
    drops
}

/// The shapes of `trees`, which are `meshes` of a picture, and of `rods`.
pub(super) fn others<'a>(
    meshes: &'a [MeshThing],
    trees: &'a [MeshSlices],
    rods: &'a [FrameRods],
) -> Vec<Box<dyn Shape + 'a>> {
    let meshes = meshes.iter().zip(trees).map(|(thing, slices)| {
        let faces = thing.mesh.settings.faces;
        let surface = |tree: &'a Arc<MeshTree>| MeshSurface::new(tree, faces, thing.material);
        match &slices[..] {
            [tree] => Box::new(surface(tree)) as Box<dyn Shape>,
            _ => Box::new(SlicedSurface::new(slices.iter().map(surface).collect(), false)),
        }
    });
    meshes.chain(rods.iter().map(FrameRods::surface)).collect()
}

/// The spheres of a frame as the input of a builder.
pub(super) fn spheres<'a>(frame: &'a DecodedFrame<'_>) -> Spheres<'a> {
    Spheres { centers: &frame.centers, radius: radius_of(&frame.radius) }
}

#[cfg(test)]
#[path = "surface_tests.rs"]
mod tests;
