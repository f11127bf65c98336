//! The shapes of a scene, divided by the way in which rays meet them.

use glam::Vec3;

use super::{bodies::TransmissiveBodies, settings::IntegratorKind, source::ShadeSource};
use crate::scene::{Finish, Material, Owner, Scene};
use spherule_surface::{Intersections, MaterialId, Shape};

/// The interior of what is transmissive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Interior {
    /// Light does not enter.
    Opaque,
    /// Each sphere is a separate transmissive body. The angle between ray and normal shows whether a ray enters or
    /// leaves.
    Spheres,
    /// One connected transmissive body. Each ray stores on which side of the surface it is. The depth counts
    /// crossings of the surface; particles between two crossings do not matter.
    Body,
    /// Several such bodies, or one that is not that of the particles without a style: `SceneShapes::nested`. Each ray
    /// stores which of them it is inside.
    Nested,
}

impl Interior {
    /// The interior of particles of this `material`, without other bodies.
    pub(super) fn of(material: &Material, is_connected: bool) -> Self {
        match (material.transmission > 0.0, is_connected) {
            (false, _) => Self::Opaque,
            (true, false) => Self::Spheres,
            (true, true) => Self::Body,
        }
    }
}

/// The colours of the parts of `shapes`, in the order of the materials of `scene`.
fn part_colors<'a>(scene: &Scene, shapes: &[&'a dyn Shape]) -> Vec<&'a [Vec3]> {
    let mut colors: Vec<&[Vec3]> = vec![&[]; scene.materials.len()];
    for shape in shapes {
        colors[shape.material().index()] = shape.colors();
    }
    colors
}

/// The connected shapes among `shapes` in the order of the materials of `scene`, apart from the body of the particles.
fn bodies<'a>(scene: &Scene, shapes: &[&'a dyn Shape]) -> Vec<Option<&'a dyn Shape>> {
    let mut bodies = vec![None; scene.materials.len()];
    for shape in shapes.iter().filter(|shape| shape.is_connected()) {
        bodies[shape.material().index()] = Some(*shape);
    }
    bodies[MaterialId::PARTICLES.index()] = None;
    bodies
}

/// The shapes of a scene by the way in which rays meet them.
pub(super) struct SceneShapes<'a> {
    /// All that are not among the others, with opaque or transmissive particles; the ground comes first, because it is the
    /// cheapest.
    pub(super) solid: Vec<&'a dyn Shape>,
    /// The colours of their parts, apart from particles, in the order of the materials of the scene.
    pub(super) part_colors: Vec<&'a [Vec3]>,
    /// Connected bodies of particles with a material of their own, in the order of the materials of the scene.
    pub(super) bodies: Vec<Option<&'a dyn Shape>>,
    /// Connected transmissive bodies, if the interior is [`Interior::Nested`].
    pub(super) nested: Option<TransmissiveBodies<'a>>,
    /// Meshes that rays pass.
    pub(super) panes: Vec<&'a dyn Shape>,
    /// Panes behind everything else, which are none of `panes`.
    pub(super) underlays: Vec<&'a dyn Shape>,
    /// Spray whose drops fade out; opaque spray is solid.
    pub(super) soft_spray: Option<&'a dyn Shape>,
    /// Particles that are not fully opaque: separate spheres or grains.
    pub(super) translucent: Vec<&'a dyn Shape>,
    /// The particles, opaque or transmissive; all other shapes are opaque.
    pub(super) particles: Option<&'a dyn Shape>,
    pub(super) interior: Interior,
}

impl<'a> SceneShapes<'a> {
    pub(super) fn new(
        shapes: Vec<&'a dyn Shape>,
        scene: &'a Scene,
        source: &dyn ShadeSource,
        integrator: IntegratorKind,
    ) -> Self {
        let finish = |shape: &&dyn Shape| scene.material(shape.material()).finish;
        let is_soft = |shape: &&dyn Shape| {
            integrator == IntegratorKind::Path && finish(shape) == Finish::Foam
        };
        let (spray, shapes): (Vec<_>, Vec<_>) = shapes.into_iter().partition(is_soft);
        let is_pane = |shape: &&dyn Shape| finish(shape) == Finish::Pane;
        let (panes, shapes): (Vec<_>, Vec<_>) = shapes.into_iter().partition(is_pane);
        let is_underlay = |shape: &&dyn Shape| scene.material(shape.material()).is_underlay;
        let (underlays, panes): (Vec<_>, Vec<_>) = panes.into_iter().partition(is_underlay);
        // Find the particles and the kind of their interior
        let is_particles = |shape: &&&dyn Shape| shape.material() == MaterialId::PARTICLES;
        let particles = shapes.iter().find(is_particles).copied();
        let is_connected = particles.is_some_and(|shape| shape.is_connected());
        let nested = TransmissiveBodies::of(scene, &shapes);
        let interior = match nested {
            Some(_) => Interior::Nested,
            None => Interior::of(scene.particle_material(), is_connected),
        };
        // Only opaque spheres and grains fade out: transmissive ones and connected bodies have an inside
        let has_opacity = source.is_translucent() && interior == Interior::Opaque && !is_connected;
        let is_style = |shape: &&dyn Shape| {
            matches!(scene.material(shape.material()).owner, Owner::Style(_)) && shape.has_opacity()
        };
        let is_translucent = |shape: &&dyn Shape| match shape.material() {
            MaterialId::PARTICLES => has_opacity,
            _ => source.is_translucent() && is_style(shape),
        };
        let (translucent, shapes): (Vec<_>, Vec<_>) = shapes.into_iter().partition(is_translucent);
        Self {
            part_colors: part_colors(scene, &shapes),
            bodies: bodies(scene, &shapes),
            nested,
            solid: shapes,
            panes,
            underlays,
            soft_spray: spray.first().copied(),
            translucent,
            particles,
            interior,
        }
    }

    /// The lanes of intersections with transmissive surfaces, apart from panes.
    pub(super) fn transmissive_lanes(&self, hits: &Intersections) -> u32 {
        match (self.interior, &self.nested) {
            (Interior::Opaque, _) => 0,
            (Interior::Nested, Some(nested)) => nested.lanes_of(hits),
            _ => hits.lanes_of(MaterialId::PARTICLES),
        }
    }

    /// Whether surfaces of `material` are transmissive, apart from panes.
    pub(super) fn is_transmissive(&self, material: MaterialId) -> bool {
        match (self.interior, &self.nested) {
            (Interior::Opaque, _) => false,
            (Interior::Nested, Some(nested)) => nested.with_material(material).is_some(),
            _ => material == MaterialId::PARTICLES,
        }
    }

    /// Whether the medium of a transmissive body scatters light.
    pub(super) fn has_scattering(&self, scene: &Scene) -> bool {
        match (self.interior, &self.nested) {
            (Interior::Opaque, _) => false,
            (_, Some(nested)) => nested.all().iter().any(|body| body.material.scatters()),
            _ => scene.particle_material().scatters(),
        }
    }

    /// The particles, if they bound one connected body.
    pub(super) fn connected_particles(&self) -> Option<&'a dyn Shape> {
        self.particles.filter(|shape| shape.is_connected())
    }
}
