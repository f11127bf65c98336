//! Everything about a job's pictures that is the same for every frame.

use glam::{DVec3, Vec3};
use spherule_formats::native::Access;

use super::rays::expected_rays;
use crate::accel::{BuildSettings, BvhSettings, SbvhSettings, Structure, choose};
use crate::output::{ExrOptions, PreviewOptions};
use crate::render::RenderSettings;
use crate::scene::{CameraView, ColorMap, Scene};
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

/// The pictures of a job.
#[derive(Debug, Clone)]
pub struct Setup {
    /// World position that all coordinates are relative to.
    pub origin: DVec3,
    /// Radii under this cannot be told from nothing and are raised to it.
    pub least_radius: f32,
    /// Where radii come from.
    pub radius: RadiusRule,
    /// Where colours come from.
    pub color: ColorRule,
    /// Where the scene's camera stands, world units.
    pub view: CameraView,
    /// Camera, lights, material, background, ground.
    pub scene: Scene,
    /// Image size, samples, depth, channels.
    pub render: RenderSettings,
    /// Who builds the tree; None chooses by the frame.
    pub accelerator: Option<Structure>,
    /// What `bvh` is told.
    pub bvh: BvhSettings,
    /// What `sbvh` is told.
    pub sbvh: SbvhSettings,
    /// How the EXR is written.
    pub exr: ExrOptions,
    /// How the PNG is made.
    pub preview: PreviewOptions,
    /// How the bytes of native frames come into memory.
    pub access: Access,
    /// Whether all that is used of native frames is compared with its checksums, or no more than nodes;
    /// None goes by their size.
    pub verify: Option<bool>,
    /// What frames weigh, as far as is known.
    pub weight: Option<FrameWeight>,
}

impl Setup {
    /// How the tree over a frame of so many particles is built, with or without values to colour
    /// them by.
    pub fn build_settings(&self, particles: usize, has_values: bool) -> BuildSettings {
        let channels = self.render.channels;
        let structure = self.structure_for(particles);
        BuildSettings {
            keep_indices: channels.id || channels.velocity || has_values,
            bvh: self.bvh,
            sbvh: self.sbvh,
            ..BuildSettings::new(structure)
        }
    }

    /// Whether native frames relative to [`Self::origin`] are traced where they lie.
    pub fn traces_in_place(&self) -> bool {
        let in_order = matches!(self.stored_structure(), Structure::Lbvh | Structure::Kdtree);
        in_order && !matches!(self.radius, RadiusRule::Attribute { .. })
    }

    /// Whose tree a native frame in place is said to be: its order is that of k-d cells.
    pub fn stored_structure(&self) -> Structure {
        self.accelerator.unwrap_or(Structure::Kdtree)
    }

    fn structure_for(&self, particles: usize) -> Structure {
        self.accelerator.unwrap_or_else(|| {
            let threads = rayon::current_num_threads();
            choose(particles, expected_rays(self), threads)
        })
    }
}
