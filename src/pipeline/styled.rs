//! The structures of particles with a style: spheres in a tree of their own, and bodies.

use std::borrow::Cow;
use std::cmp::Reverse;
use std::ops::Range;

use glam::Vec3;
use spherule_formats::Radius;

use super::bodies::{BodyParticles, build_grid, radius_of, shading_normals};
use super::decoded::DecodedFrame;
use super::grains::{report_notes, unit_note};
use super::motion::displaced;
use super::setup::{OpacityRule, Setup, StyleForm};
use super::styles::StyleParticles;
use crate::accel::moving::MovingTree;
use crate::accel::{BuildReport, Spheres, TreeBuilder};
use crate::surface::grains::{GrainSurface, GrainTree};
use crate::surface::moving::MovingSpheres;
use crate::surface::smooth::{SmoothError, SmoothGrid};
use crate::surface::spheres::SphereSurface;
use crate::surface::union::UnionSurface;
use crate::surface::{MaterialId, OwnedBody, Shape, SphereOwners, SurfaceKind, SurfaceSettings};

/// The structures of the styles of a frame that are not in its tree.
#[derive(Debug, Default)]
pub(super) struct StyleSurfaces {
    spheres: Option<StyleSpheres>,
    bodies: Vec<StyleBody>,
    grains: Vec<StyleGrains>,
    /// Centres of particles of clear styles that have priority over clear particles without a style.
    prior: Vec<Vec3>,
}

/// The grains of a style.
#[derive(Debug)]
struct StyleGrains {
    /// One for each shape.
    trees: Vec<GrainTree>,
    material: MaterialId,
    /// Index in the frame of the first grain.
    first: u32,
    has_opacity: bool,
}

/// The spheres of all styles. Which style a sphere has follows from its particle.
#[derive(Debug)]
struct StyleSpheres {
    tree: TreeBuilder,
    /// The same, with motion blur.
    moving: Option<MovingTree>,
    owners: SphereOwners<'static>,
}

/// The body of a style.
#[derive(Debug)]
struct StyleBody {
    structure: BodyStructure,
    settings: SurfaceSettings,
    material: MaterialId,
    /// Index in the frame of its first particle.
    first: u32,
}

#[derive(Debug)]
enum BodyStructure {
    Union(TreeBuilder),
    Smooth(SmoothGrid),
}

impl StyleSurfaces {
    /// Takes the particles whose style is not drawn in the tree of the frame away from `frame`, and builds their
    /// structures. Returns these with their memory in bytes.
    ///
    /// # Errors
    /// [`SmoothError`] if a smooth surface does not fit.
    pub(super) fn take(
        setup: &Setup,
        frame: &mut DecodedFrame<'_>,
        notes: &mut Vec<String>,
    ) -> Result<(Self, u64), SmoothError> {
        let rules = &setup.picture.particles;
        let mut all = Self::default();
        let mut bytes = 0;
        if !rules.is_divided() {
            return Ok((all, bytes));
        }
        all.prior = prior_centers(setup, frame, MaterialId::PARTICLES);
        // Take the last style first, so that its particles are at the end
        let ranges = &frame.shading.ranges;
        let in_tree = rules.styles_in_tree(setup);
        let spheres = in_tree..rules.sphere_styles();
        let bodies = (spheres.end..rules.styles.len()).rev().map(|i| (i, ranges.of(i).start));
        let firsts: Vec<(usize, usize)> = bodies
            .chain((!spheres.is_empty()).then(|| (spheres.start, ranges.of(spheres.start).start)))
            .collect();
        for style in firsts {
            let own = StyleParticles::split_off(style, &mut frame.centers, &mut frame.radius);
            let rules = &rules.styles[own.style];
            if own.centers.is_empty() {
                continue;
            }
            match &rules.form {
                StyleForm::Spheres => {
                    let (spheres, built) = StyleSpheres::build(setup, frame, own, rules.material);
                    bytes += built;
                    all.spheres = Some(spheres);
                }
                StyleForm::Body(settings) => {
                    let (body, built) =
                        StyleBody::build(setup, frame, own, (*settings, rules.material), notes)?;
                    bytes += built;
                    all.bodies.push(body);
                }
                StyleForm::Grains(grains) => {
                    notes.extend(unit_note(&rules.name, grains, &own.radius));
                    if let Some(grains) = StyleGrains::build(setup, frame, own, notes) {
                        bytes += grains.trees.iter().map(|tree| tree.bytes() as u64).sum::<u64>();
                        all.grains.push(grains);
                    }
                }
                StyleForm::Nothing => {}
            }
        }
        Ok((all, bytes))
    }

    /// Centres of particles of clear styles that have priority over clear particles without a style.
    pub(super) fn prior(&self) -> &[Vec3] {
        &self.prior
    }

    /// Adds the surfaces to `shapes`.
    pub(super) fn add_to<'a>(&'a self, shapes: &mut Vec<Box<dyn Shape + 'a>>) {
        if let Some(spheres) = &self.spheres {
            shapes.push(match &spheres.moving {
                Some(moving) => Box::new(MovingSpheres::new(moving).of(spheres.owners)),
                None => Box::new(SphereSurface::new(spheres.tree.tree().view()).of(spheres.owners)),
            });
        }
        shapes.extend(self.bodies.iter().map(StyleBody::shape));
        for StyleGrains { trees, material, first, has_opacity } in &self.grains {
            shapes.extend(trees.iter().map(|tree| {
                let surface = GrainSurface::new(tree).of(*material, *first);
                Box::new(surface.with_opacity(*has_opacity)) as Box<dyn Shape>
            }));
        }
    }
}

impl StyleSpheres {
    /// The tree of `own`, and its memory in bytes.
    fn build(
        setup: &Setup,
        frame: &DecodedFrame<'_>,
        mut own: StyleParticles,
        material: MaterialId,
    ) -> (Self, u64) {
        let displacements = move_to_exposure(setup, frame, &mut own);
        let mut tree = TreeBuilder::new();
        let mut bytes = bytes_of(&build_tree(setup, &own, &mut tree));
        let moving = displacements.map(|displacements| {
            let mut moving = MovingTree::default();
            moving.build(&tree.tree().view(), &displacements);
            bytes += moving.byte_len();
            moving
        });
        (Self { tree, moving, owners: SphereOwners::new(material, own.first) }, bytes)
    }
}

impl StyleGrains {
    /// The grains of `own`; None if they cannot be built, which is noted.
    fn build(
        setup: &Setup,
        frame: &mut DecodedFrame<'_>,
        mut own: StyleParticles,
        notes: &mut Vec<String>,
    ) -> Option<Self> {
        let displacements = move_to_exposure(setup, frame, &mut own);
        let of_frame = &mut frame.shading.grains;
        let place = of_frame.iter().position(|grains| grains.style == own.style)?;
        let mut grains = of_frame.swap_remove(place);
        if let Some(shutter) = setup.picture.view.shutter {
            grains.expose(shutter);
        }
        let rules = &setup.picture.particles.styles[own.style];
        match grains.trees(&own, displacements.as_deref()) {
            Ok(trees) => {
                notes
                    .extend(trees.iter().flat_map(|tree| report_notes(&rules.name, tree.report())));
                let has_opacity = rules.opacity != OpacityRule::OPAQUE;
                Some(Self { trees, material: rules.material, first: own.first, has_opacity })
            }
            Err(error) => {
                notes.push(format!("style `{}` is not drawn: {error}", rules.name));
                None
            }
        }
    }
}

impl StyleBody {
    /// The body of `own`, and its memory in bytes.
    fn build(
        setup: &Setup,
        frame: &DecodedFrame<'_>,
        mut own: StyleParticles,
        (settings, material): (SurfaceSettings, MaterialId),
        notes: &mut Vec<String>,
    ) -> Result<(Self, u64), SmoothError> {
        // With motion blur, it is sharp, in the middle of the exposure
        move_to_exposure(setup, frame, &mut own);
        let (structure, bytes) = if settings.kind == SurfaceKind::Smooth {
            let mut grid = SmoothGrid::default();
            let prior = prior_centers(setup, frame, material);
            let particles =
                BodyParticles { centers: &own.centers, radius: &own.radius, prior: &prior };
            let made = build_grid(setup, &mut grid, particles, &settings, notes)?;
            (BodyStructure::Smooth(grid), made.bytes)
        } else {
            let mut tree = TreeBuilder::new();
            let built = build_tree(setup, &own, &mut tree);
            (BodyStructure::Union(tree), bytes_of(&built))
        };
        Ok((Self { structure, settings, material, first: own.first }, bytes))
    }

    fn shape(&self) -> Box<dyn Shape + '_> {
        let body: Box<dyn Shape> = match &self.structure {
            BodyStructure::Smooth(grid) => Box::new(grid.surface()),
            BodyStructure::Union(tree) => {
                let normals = shading_normals(&self.settings);
                Box::new(UnionSurface::new(tree.tree().view()).with_normals(normals))
            }
        };
        Box::new(OwnedBody::new(body, self.material, self.first))
    }
}

fn bytes_of(built: &BuildReport) -> u64 {
    built.position_bytes + built.structure_bytes
}

/// Builds the tree of the spheres of `own`.
fn build_tree(setup: &Setup, own: &StyleParticles, tree: &mut TreeBuilder) -> BuildReport {
    let spheres = Spheres { centers: &own.centers, radius: radius_of(&own.radius) };
    tree.build(&spheres, &setup.build_settings(own.centers.len(), true))
}

/// Centres of the particles of `frame`, in the middle of the exposure, of clear bodies that have priority over the clear body
/// of a `material`.
fn prior_centers(setup: &Setup, frame: &DecodedFrame<'_>, material: MaterialId) -> Vec<Vec3> {
    let (scene, rules) = (&setup.picture.scene, &setup.picture.particles);
    let is_clear = |id: MaterialId| scene.material(id).transmission > 0.0;
    let rank = |id: MaterialId| (Reverse(scene.material(id).priority), id);
    if !is_clear(material) {
        return Vec::new();
    }
    let ranges = &frame.shading.ranges;
    (rules.styles.iter().enumerate())
        .filter(|(index, style)| *index == 0 || matches!(style.form, StyleForm::Body(_)))
        .filter(|(_, style)| is_clear(style.material) && rank(style.material) < rank(material))
        .flat_map(|(index, _)| exposed_centers(setup, frame, ranges.of(index)))
        .collect()
}

/// Centres of the particles in a `range` of `frame` in the middle of the exposure.
fn exposed_centers(setup: &Setup, frame: &DecodedFrame<'_>, range: Range<usize>) -> Vec<Vec3> {
    let mut particles = StyleParticles {
        style: 0,
        first: u32::try_from(range.start).unwrap_or(u32::MAX),
        centers: frame.centers.get(range).unwrap_or_default().to_vec(),
        radius: Radius::Common(0.0),
    };
    move_to_exposure(setup, frame, &mut particles);
    particles.centers
}

/// Moves particles to their places in the middle of the exposure. Returns by how far they move while the shutter is open;
/// None without motion blur.
fn move_to_exposure(
    setup: &Setup,
    frame: &DecodedFrame<'_>,
    own: &mut StyleParticles,
) -> Option<Vec<Vec3>> {
    let shutter = setup.picture.view.shutter?;
    let velocities = frame.shading.velocities.as_deref().unwrap_or_default();
    let first = (own.first as usize).min(velocities.len());
    let mut velocities = velocities[first..].to_vec();
    velocities.resize(own.centers.len(), Vec3::ZERO);
    let mut centers = Cow::Borrowed(&own.centers[..]);
    let displacements = displaced(shutter, &mut centers, velocities);
    own.centers = centers.into_owned();
    Some(displacements)
}

#[cfg(test)]
#[path = "styled_tests.rs"]
mod tests;
