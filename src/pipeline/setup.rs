//! Everything about a job's pictures: what is the same for every frame, and where the camera is at each.

use glam::{DVec3, Vec3};
use spherule_formats::native::Access;

use super::rays::expected_rays;
use crate::accel::{BuildSettings, BvhSettings, SbvhSettings, Structure, choose};
use crate::output::{ExrOptions, PreviewOptions};
use crate::render::{RenderSettings, RendererKind};
use crate::scene::{Camera, CameraError, CameraPath, ColorMap, Scene};
use crate::surface::{SurfaceKind, SurfaceSettings};
use crate::survey::FrameWeight;

/// Where radii come from.
#[derive(Debug, Clone, PartialEq)]
pub enum RadiusRule {
    /// What the frame brings, or this where it brings none.
    FileOr(f32),
    /// One for all.
    Common(f32),
    /// A scalar attribute times a factor.
    Attribute {
        /// Its name.
        name: String,
        /// The factor.
        scale: f32,
    },
}

/// Where base colours come from.
#[derive(Debug, Clone)]
pub enum ColorRule {
    /// One for all, linear RGB.
    Constant(Vec3),
    /// An attribute whose values are colours.
    Rgb {
        /// Its name.
        name: String,
        /// As for [`Self::Attribute`].
        required: bool,
    },
    /// An attribute through a map; vectors by magnitude.
    Attribute {
        /// Its name.
        name: String,
        /// The map with the range of the whole sequence.
        map: ColorMap,
        /// Whether it was asked for by name, so that a frame without it is an error. Otherwise such
        /// a frame has the default colour.
        required: bool,
    },
}

impl ColorRule {
    /// Whether particles have colours of their own, so that they must be told apart.
    pub const fn is_by_particle(&self) -> bool {
        !matches!(self, Self::Constant(_))
    }

    /// Bytes that a decoded particle has for its colour.
    pub(super) const fn bytes(&self) -> u64 {
        match self {
            Self::Constant(_) => 0,
            Self::Attribute { .. } => size_of::<f32>() as u64,
            Self::Rgb { .. } => size_of::<Vec3>() as u64,
        }
    }
}

/// A job: what is drawn, and how the run goes.
#[derive(Debug, Clone)]
pub struct Setup {
    /// What every image depends on.
    pub picture: Picture,
    /// What images do not depend on.
    pub run: RunSettings,
}

/// The pictures of a job.
#[derive(Debug, Clone)]
pub struct Picture {
    /// World position that all coordinates are relative to.
    pub origin: DVec3,
    /// Radii under this cannot be told from nothing and are raised to it.
    pub least_radius: f32,
    /// Where radii come from.
    pub radius: RadiusRule,
    /// Where colours come from.
    pub color: ColorRule,
    /// Where the camera is at each frame, world units.
    pub path: CameraPath,
    /// Width over height of the images, also where fewer pixels are traced on trial.
    pub aspect: f64,
    /// Lights, material, background, ground; its camera is that of the path's start. What a frame is traced
    /// in is [`Setup::scene_at`].
    pub scene: Scene,
    /// Who renders.
    pub renderer: RendererKind,
    /// Image size, samples, depth, channels.
    pub render: RenderSettings,
    /// What rays meet.
    pub surface: SurfaceSettings,
    /// How the EXR is written; the camera comes with the frame.
    pub exr: ExrOptions,
    /// How the PNG is made; [`Setup::preview_from`] adds what lies behind.
    pub preview: PreviewOptions,
}

/// How a run goes about its pictures.
#[derive(Debug, Clone)]
pub struct RunSettings {
    /// Most memory that the job may take, bytes; None is what is free.
    pub memory_limit: Option<u64>,
    /// Who builds the tree; None chooses by the frame.
    pub accelerator: Option<Structure>,
    /// What `bvh` is told.
    pub bvh: BvhSettings,
    /// What `sbvh` is told.
    pub sbvh: SbvhSettings,
    /// How the bytes of native frames come into memory.
    pub access: Access,
    /// Whether all that is used of native frames is compared with its checksums, or no more than nodes;
    /// None goes by their size.
    pub verify: Option<bool>,
    /// What frames weigh, as far as is known.
    pub weight: Option<FrameWeight>,
}

impl Setup {
    /// The camera of `frame`.
    ///
    /// # Errors
    /// There is no picture from there; [`crate::resolve::check_views`] finds out before.
    pub fn camera_at(&self, frame: i64) -> Result<Camera, CameraError> {
        Camera::new(
            &self.picture.path.view(frame),
            self.picture.aspect,
            self.picture.origin,
        )
    }

    /// What `frame` is traced in: lights and everything else stay where they are when the camera moves.
    ///
    /// # Errors
    /// As [`Self::camera_at`].
    pub fn scene_at(&self, frame: i64) -> Result<Scene, CameraError> {
        Ok(Scene {
            camera: self.camera_at(frame)?,
            ..self.picture.scene.clone()
        })
    }

    /// How the PNG of an image from `camera` is made: a film without background gets one behind it.
    pub fn preview_from(&self, camera: &Camera) -> PreviewOptions {
        let behind = || self.picture.scene.background.color(camera.forward());
        PreviewOptions {
            backdrop: self.picture.render.transparent_background.then(behind),
            ..self.picture.preview
        }
    }

    /// How the tree over a frame of so many particles is built, with or without values to colour
    /// them by.
    pub fn build_settings(&self, particles: usize, has_values: bool) -> BuildSettings {
        let channels = self.picture.render.channels;
        let structure = self.structure_for(particles);
        BuildSettings {
            keep_indices: channels.id || channels.velocity || has_values,
            bvh: self.run.bvh,
            sbvh: self.run.sbvh,
            ..BuildSettings::new(structure)
        }
    }

    /// Whether native frames relative to [`Picture::origin`] are traced where they lie.
    pub fn traces_in_place(&self) -> bool {
        self.needs_copy().is_none() && !matches!(self.picture.radius, RadiusRule::Attribute { .. })
    }

    /// Why the particles of a native frame are copied whatever radii they have, if they are.
    pub(super) fn needs_copy(&self) -> Option<String> {
        let structure = self.stored_structure();
        if matches!(structure, Structure::Bvh | Structure::Sbvh) {
            return Some(format!(
                "{structure} builds over a copy of them, 12 bytes a particle and more; lbvh and kdtree do not"
            ));
        }
        let why = match self.picture.surface {
            SurfaceSettings {
                kind: SurfaceKind::Smooth,
                ..
            } => "a smooth surface sorts a copy of them, 12 bytes a particle and more",
            SurfaceSettings { spray: true, .. } => {
                "spray is parted from them, for 12 bytes a particle and more"
            }
            _ => return None,
        };
        Some(why.to_owned())
    }

    /// Whose tree a native frame in place is said to be: its order is that of k-d cells.
    pub fn stored_structure(&self) -> Structure {
        self.run.accelerator.unwrap_or(Structure::Kdtree)
    }

    fn structure_for(&self, particles: usize) -> Structure {
        self.run.accelerator.unwrap_or_else(|| {
            let threads = rayon::current_num_threads();
            let rays = expected_rays(&self.picture.render, &self.picture.scene);
            choose(particles, rays, threads)
        })
    }
}
