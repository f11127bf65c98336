//! The state that all integrators share: the scene in a form for packets of rays, and the settings. Each stage that
//! integrators have in common is a file with methods of [`RenderContext`]: `generate`, `intersect`, `attributes`,
//! `visibility`.

use glam::Vec3;

use super::{
    interface::Dielectric,
    light_groups::NO_GROUP,
    lights::{Light, light_of},
    sampler::FilmSampler,
    scratch::SEGMENTS,
    settings::{IntegratorKind, RenderSettings},
    shading::{BackgroundLanes, CameraLanes},
    source::ShadeSource,
};
use crate::scene::{Finish, Material, PartMaterials, Scene};
use crate::surface::{MaterialId, Shape, Side};
use spherule_tree::accel::Coherence;
use spherule_tree::math::Supported;

/// Least width of a sample for filtering pictures, in pixels: the noise of many samples is low anyway.
const MIN_SAMPLE_WIDTH: f32 = 0.125;

/// A scene ready to be rendered.
pub(super) struct RenderContext<'a> {
    /// All shapes but panes, soft spray and particles that are not fully opaque; the ground comes first, because it is
    /// the cheapest.
    pub(super) shapes: Vec<&'a dyn Shape>,
    /// Meshes that rays pass.
    pub(super) panes: Vec<&'a dyn Shape>,
    /// The colours of the parts of shapes other than particles, in the order of the materials of the scene.
    pub(super) part_colors: Vec<&'a [Vec3]>,
    /// Materials of parts of the particles, if these are separate spheres and paths are traced.
    pub(super) parts: Option<&'a PartMaterials>,
    /// Spray whose drops fade out; opaque spray is one of the shapes.
    pub(super) soft_spray: Option<&'a dyn Shape>,
    /// Particles that are not fully opaque; they are separate spheres.
    pub(super) translucent: Option<&'a dyn Shape>,
    /// Whether there are meshes that only hide what is behind them.
    pub(super) has_holdouts: bool,
    /// The particles, opaque or transmissive; all other shapes are opaque.
    pub(super) particles: Option<&'a dyn Shape>,
    pub(super) source: &'a dyn ShadeSource,
    pub(super) scene: &'a Scene,
    pub(super) settings: &'a RenderSettings,
    pub(super) simd: Supported,
    pub(super) camera: CameraLanes,
    /// The camera of the next frame, and the time until then.
    pub(super) next_frame: Option<(CameraLanes, f32)>,
    /// The camera when the shutter opens and when it closes, with motion blur.
    pub(super) exposure: Option<[CameraLanes; 2]>,
    pub(super) background: BackgroundLanes,
    pub(super) lights: Vec<Box<dyn Light>>,
    /// Base colour of all particles, if they share one.
    pub(super) color: Option<Vec3>,
    pub(super) interior: Interior,
    /// The interface of the particles, unless they are opaque.
    pub(super) boundary: Dielectric,
    /// Whether the camera is inside a connected body.
    pub(super) is_camera_inside: bool,
    pub(super) sampler: FilmSampler,
    /// Width of a sample of a pixel, in pixels.
    pub(super) sample_width: f32,
    /// Maximum number of path segments of one depth, see [`SEGMENTS`].
    pub(super) max_segments: usize,
}

/// The interior of the particles.
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
}

impl Interior {
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

/// Shapes by the way in which rays meet them.
struct DividedShapes<'a> {
    /// All that are not among the others, with opaque or transmissive particles.
    solid: Vec<&'a dyn Shape>,
    panes: Vec<&'a dyn Shape>,
    soft_spray: Option<&'a dyn Shape>,
    translucent: Option<&'a dyn Shape>,
    particles: Option<&'a dyn Shape>,
    interior: Interior,
}

impl<'a> DividedShapes<'a> {
    fn new(
        shapes: Vec<&'a dyn Shape>,
        scene: &Scene,
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
        // Find the particles and the kind of their interior
        let is_particles = |shape: &&&dyn Shape| shape.material() == MaterialId::PARTICLES;
        let particles = shapes.iter().find(is_particles).copied();
        let is_connected = particles.is_some_and(|shape| shape.is_connected());
        let interior = Interior::of(scene.particle_material(), is_connected);
        // Only opaque spheres fade out: transmissive ones and connected bodies have an inside
        let has_opacity = source.is_translucent() && interior == Interior::Opaque && !is_connected;
        let is_translucent =
            |shape: &&dyn Shape| has_opacity && shape.material() == MaterialId::PARTICLES;
        let (translucent, shapes): (Vec<_>, Vec<_>) = shapes.into_iter().partition(is_translucent);
        Self {
            solid: shapes,
            panes,
            soft_spray: spray.first().copied(),
            translucent: translucent.first().copied(),
            particles,
            interior,
        }
    }
}

impl<'a> RenderContext<'a> {
    pub(super) fn new(
        shapes: Vec<&'a dyn Shape>,
        scene: &'a Scene,
        source: &'a dyn ShadeSource,
        settings: &'a RenderSettings,
    ) -> Self {
        let divided = DividedShapes::new(shapes, scene, source, settings.integrator);
        let DividedShapes { solid: shapes, panes, particles, interior, .. } = divided;
        let is_connected = particles.is_some_and(|shape| shape.is_connected());
        // Prepare camera, background and lights for packets
        let eye = scene.camera.eye();
        let [width, height] = settings.eye_size(scene.camera.eyes());
        let contains_eye = |shape: &dyn Shape| shape.side_of(eye) == Side::Inside;
        Self {
            part_colors: part_colors(scene, &shapes),
            is_camera_inside: interior == Interior::Body && particles.is_some_and(contains_eye),
            shapes,
            panes,
            parts: Some(&scene.parts)
                .filter(|parts| !parts.is_empty() && !is_connected)
                .filter(|_| settings.integrator == IntegratorKind::Path),
            soft_spray: divided.soft_spray,
            translucent: divided.translucent,
            has_holdouts: scene.materials.iter().any(|material| material.is_holdout),
            particles,
            source,
            scene,
            settings,
            simd: Supported::default(),
            camera: CameraLanes::new(&scene.camera, width, height),
            next_frame: (scene.next_frame.as_ref())
                .map(|next| (CameraLanes::new(&next.camera, width, height), next.time)),
            exposure: (scene.exposure.as_ref())
                .map(|e| e.cameras.map(|camera| CameraLanes::new(&camera, width, height))),
            background: BackgroundLanes::from(&scene.background),
            lights: scene.lights.iter().map(light_of).collect(),
            color: source.constant_color(),
            interior,
            boundary: Dielectric::new(scene.particle_material()),
            sample_width: (settings.samples as f32).sqrt().recip().max(MIN_SAMPLE_WIDTH),
            sampler: FilmSampler::with_filter(settings.samples, settings.filter),
            max_segments: SEGMENTS,
        }
    }

    /// The material of `particle`.
    #[inline]
    pub(super) fn material_of(&self, parts: &PartMaterials, particle: u32) -> MaterialId {
        let part = self.source.part(particle);
        part.and_then(|(_, part)| parts.of(part)).unwrap_or(MaterialId::PARTICLES)
    }

    /// The particles, if they bound one connected body.
    pub(super) fn connected_particles(&self) -> Option<&'a dyn Shape> {
        self.particles.filter(|shape| shape.is_connected())
    }

    /// Whether camera rays see nothing but shadows on the ground.
    pub(super) fn catches_shadows(&self) -> bool {
        let ground = self.scene.ground.as_ref();
        ground.is_some_and(|ground| ground.shadow_catcher.is_some())
    }

    /// The coherence of a packet at `depth`. Camera rays from a lens or from a camera in motion have no common origin,
    /// so beams around them are wide.
    pub(super) const fn coherence(&self, depth: u32) -> Coherence {
        match depth {
            1 if !self.camera.has_lens() && self.exposure.is_none() => Coherence::Coherent,
            _ => Coherence::Incoherent,
        }
    }

    /// The group of light source `index`.
    pub(super) fn light_group(&self, index: usize) -> usize {
        usize::from(self.scene.lights[index].group)
    }

    /// The group of the environment.
    pub(super) fn environment_group(&self) -> usize {
        usize::from(self.scene.environment_group)
    }

    /// The group of what camera rays see infinitely far away.
    pub(super) fn background_group(&self) -> usize {
        match self.settings.integrator {
            IntegratorKind::Path if self.scene.is_environment_visible => self.environment_group(),
            IntegratorKind::Path | IntegratorKind::Whitted => NO_GROUP,
        }
    }
}
