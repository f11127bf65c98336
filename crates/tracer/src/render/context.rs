//! The state that all integrators share: the scene in a form for packets of rays, and the settings. Each stage that
//! integrators have in common is a file with methods of [`RenderContext`]: `generate`, `intersect`, `attributes`,
//! `visibility`.

use glam::Vec3;

use super::{
    body_set::BodySet,
    drawing::DepthCue,
    interface::{BoundaryTable, Dielectric},
    light_groups::NO_GROUP,
    lights::{Light, light_of},
    mist::MistLayer,
    sampler::FilmSampler,
    scene_shapes::{Interior, SceneShapes},
    scratch::SEGMENTS,
    settings::{IntegratorKind, RenderSettings},
    shading::{BackgroundLanes, CameraLanes},
    source::ShadeSource,
    stream::SegmentPacket,
};
use crate::scene::{Camera, OtherFrame, Scene};
use spherule_surface::{Shape, Side};
use spherule_tree::accel::Coherence;
use spherule_tree::math::Supported;

/// Least width of a sample for filtering pictures, in pixels: the noise of many samples is low anyway.
const MIN_SAMPLE_WIDTH: f32 = 0.125;

/// A scene ready to be rendered.
pub(super) struct RenderContext<'a> {
    pub(super) shapes: SceneShapes<'a>,
    /// Whether some of the particles have a style with a material of its own.
    pub(super) has_styles: bool,
    /// Mist outside all bodies, along paths.
    pub(super) mist: Option<MistLayer>,
    /// Whether mist, or the medium of a transmissive body, scatters light along paths.
    pub(super) has_scattering: bool,
    /// Whether there are meshes that only hide what is behind them.
    pub(super) has_holdouts: bool,
    pub(super) source: &'a dyn ShadeSource,
    pub(super) scene: &'a Scene,
    pub(super) settings: &'a RenderSettings,
    pub(super) simd: Supported,
    pub(super) cameras: Cameras,
    pub(super) background: BackgroundLanes,
    pub(super) lights: Vec<Box<dyn Light>>,
    /// Base colour of all particles, if they share one.
    pub(super) color: Option<Vec3>,
    /// The interface of the particles, unless they are opaque.
    pub(super) boundary: Dielectric,
    /// The boundaries of several transmissive bodies, for shadow rays.
    pub(super) boundaries: Option<BoundaryTable<Dielectric>>,
    /// Those of several transmissive bodies that the camera is inside.
    pub(super) camera_bodies: BodySet,
    /// Whether the camera is inside the only connected body.
    pub(super) is_camera_inside: bool,
    pub(super) sampler: FilmSampler,
    /// How particles fade with their distance, if they do.
    pub(super) depth_cue: Option<DepthCue>,
    /// Width of a sample of a pixel, in pixels.
    pub(super) sample_width: f32,
    /// Maximum number of path segments of one depth, see [`SEGMENTS`].
    pub(super) max_segments: usize,
}

/// The camera of another frame, and the time from this frame to it.
pub(super) type OtherCamera = (CameraLanes, f32);

/// The cameras of a picture.
pub(super) struct Cameras {
    /// The camera of the frame.
    pub(super) now: CameraLanes,
    /// Those of the next and of the previous frame.
    pub(super) next: Option<OtherCamera>,
    pub(super) previous: Option<OtherCamera>,
    /// The camera when the shutter opens and when it closes, with motion blur.
    pub(super) exposure: Option<[CameraLanes; 2]>,
}

impl Cameras {
    fn new(scene: &Scene, [width, height]: [u32; 2]) -> Self {
        let lanes = |camera: &Camera| CameraLanes::new(camera, width, height);
        let other = |frame: &OtherFrame| (lanes(&frame.camera), frame.time);
        Self {
            now: lanes(&scene.camera),
            next: scene.next_frame.as_ref().map(other),
            previous: scene.previous_frame.as_ref().map(other),
            exposure: scene.exposure.as_ref().map(|e| e.cameras.each_ref().map(lanes)),
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
        let shapes = SceneShapes::new(shapes, scene, source, settings.integrator);
        let eye = scene.camera.eye();
        let contains_eye = |shape: &dyn Shape| shape.side_of(eye) == Side::Inside;
        let is_body = shapes.interior == Interior::Body;
        let nested = shapes.nested.as_ref();
        let mist = MistLayer::of(scene, settings);
        Self {
            has_scattering: settings.integrator == IntegratorKind::Path
                && (mist.is_some() || shapes.has_scattering(scene)),
            mist,
            boundaries: nested.map(BoundaryTable::for_shadow_rays),
            camera_bodies: nested.map(|nested| nested.at(eye)).unwrap_or_default(),
            is_camera_inside: is_body && shapes.particles.is_some_and(contains_eye),
            shapes,
            has_styles: !source.styles().is_empty(),
            has_holdouts: scene.materials.iter().any(|material| material.is_holdout),
            source,
            scene,
            settings,
            simd: Supported::default(),
            cameras: Cameras::new(scene, settings.eye_size(scene.camera.eyes())),
            background: BackgroundLanes::from(&scene.background),
            lights: scene.lights.iter().map(light_of).collect(),
            color: source.constant_color(),
            boundary: Dielectric::new(scene.particle_material()),
            sample_width: (settings.samples as f32).sqrt().recip().max(MIN_SAMPLE_WIDTH),
            depth_cue: DepthCue::new(scene, &settings.drawing),
            sampler: FilmSampler::with_filter(settings.samples, settings.filter, settings.seed),
            max_segments: SEGMENTS,
        }
    }

    /// The index of refraction of the medium in which the ray in `lane` of `segments` is, relative to air.
    pub(super) fn ior_at(&self, segments: &SegmentPacket, lane: usize) -> f32 {
        match &self.shapes.nested {
            Some(nested) => nested.ior(segments.bodies[lane].medium()),
            None if segments.inside >> lane & 1 == 1 => self.scene.particle_material().ior,
            None => 1.0,
        }
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
            1 if !self.cameras.now.has_lens() && self.cameras.exposure.is_none() => {
                Coherence::Coherent
            }
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
