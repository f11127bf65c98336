//! The settings of the pictures of a job: everything that is the same for all frames, and the camera path.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use spherule_formats::native::Access;
use spherule_frame::grain_columns::GrainNames;

use super::meshes::MeshThing;
use super::rays::expected_rays;
use super::shutter::{FrameStep, Shutter};
use crate::accel::{BuildSettings, BvhSettings, SbvhSettings, Structure, choose};
use crate::denoise::DenoiseSettings;
use crate::manifest::GrainKind;
use crate::output::{ExrOptions, PreviewBackground, PreviewOptions};
use crate::overlay::Overlay;
use crate::render::{RenderSettings, RendererKind};
use crate::scene::{
    Camera, CameraError, CameraPath, CameraView, ColorMap, Exposure, LensSettings, MaterialId,
    OtherFrame, Projection, RadiusTable, Scene, StereoSettings,
};
use crate::selection::{Division, Selection};
use crate::surface::cut::ConvexRegion;
use crate::surface::grains::GrainMesh;
use crate::surface::rods::Anchor;
use crate::surface::{SurfaceKind, SurfaceSettings};
use crate::survey::{FrameWeight, SurfaceWeight};

/// Source of the radii.
#[derive(Debug, Clone, PartialEq)]
pub enum RadiusRule {
    /// The radii of the frame, or this one if it has none.
    FileOr(f32),
    /// One radius for all particles.
    Common(f32),
    /// A scalar attribute times a factor.
    Attribute {
        /// Name of the attribute.
        name: String,
        /// The factor.
        scale: f32,
    },
    /// By an integer attribute.
    Table {
        /// Name of the attribute.
        name: String,
        /// The radii.
        table: RadiusTable,
        /// Factor on them, for scene units.
        scale: f64,
    },
}

/// Source of the base colours.
#[derive(Debug, Clone)]
pub enum ColorRule {
    /// One colour for all particles, linear RGB.
    Constant(Vec3),
    /// An attribute with colours.
    Rgb {
        /// Its name.
        name: String,
        /// As for [`Self::Attribute`].
        required: bool,
    },
    /// A value of each particle through a map: see [`spherule_frame::values::Value::named`].
    Attribute {
        /// Name of the value.
        name: String,
        /// The map with the range of the whole sequence.
        map: ColorMap,
        /// Whether the user named it, so that a frame without it is an error. Otherwise such
        /// a frame has the default colour.
        required: bool,
        /// Whether the value is computed from positions or radii.
        needs_geometry: bool,
    },
}

impl ColorRule {
    /// Whether particles have individual colours, so that their indices are needed.
    pub const fn is_by_particle(&self) -> bool {
        !matches!(self, Self::Constant(_))
    }

    /// Bytes per decoded particle for its colour.
    pub(super) const fn bytes(&self) -> u64 {
        match self {
            Self::Constant(_) => 0,
            Self::Attribute { .. } => size_of::<f32>() as u64,
            Self::Rgb { .. } => size_of::<Vec3>() as u64,
        }
    }
}

/// How much each sphere covers of what is behind it.
#[derive(Debug, Clone, PartialEq)]
pub enum OpacityRule {
    /// The same for all particles, 0 to 1.
    Constant(f32),
    /// By a value of each particle: see [`spherule_frame::values::Value::named`].
    Value {
        /// Name of the value.
        name: String,
        /// The values with opacity 0 and 1.
        range: [f32; 2],
        /// Whether the value is computed from positions or radii.
        needs_geometry: bool,
    },
}

impl OpacityRule {
    /// Particles cover all that is behind them.
    pub const OPAQUE: Self = Self::Constant(1.0);

    /// Whether particles differ in their opacity, so that their indices are needed.
    pub(super) const fn is_by_particle(&self) -> bool {
        matches!(self, Self::Value { .. })
    }
}

/// How rods are drawn: the simulation cell, arrows, trails or bonds.
#[derive(Debug, Clone)]
pub struct RodLook {
    /// Radius, scene units; of the thickest part if it differs.
    pub radius: f32,
    /// The colours of the particles that they belong to; None if all have that of the material.
    pub color: Option<ColorRule>,
    /// Their material.
    pub material: MaterialId,
}

/// How the arrows of an attribute are drawn.
#[derive(Debug, Clone)]
pub struct ArrowStyle {
    /// Name of the attribute, which has three components.
    pub attribute: String,
    /// Length of an arrow per unit of the attribute, scene units.
    pub scale: f64,
    /// Only particles whose id is a multiple of this have arrows; without ids, it is their place in the file.
    pub every: u32,
    /// The point of an arrow that is at its particle.
    pub anchor: Anchor,
    /// The style whose particles alone have arrows; None: all.
    pub style: Option<usize>,
    /// Their look; the radius is that of the shafts.
    pub look: RodLook,
}

/// How the trails of particles over earlier frames are drawn.
#[derive(Debug, Clone)]
pub struct TrailStyle {
    /// Number of earlier frames.
    pub frames: u32,
    /// Only particles whose id is a multiple of this have trails; without ids, it is their place in the file.
    pub every: u32,
    /// The style whose particles alone have trails; None: all.
    pub style: Option<usize>,
    /// Their look; the radius is that at the particles.
    pub look: RodLook,
}

impl TrailStyle {
    /// The radius where the particle was `age` frames ago.
    pub(super) fn radius_at(&self, age: u32) -> f32 {
        self.look.radius * (self.frames - age.min(self.frames)) as f32 / self.frames as f32
    }
}

/// Which particles have a bond.
#[derive(Debug, Clone, PartialEq)]
pub enum BondRule {
    /// Those up to this distance apart, scene units.
    Distance(f32),
    /// Those up to the sum of their covalent radii apart, with a tolerance.
    Covalent {
        /// Name of the attribute with atomic numbers.
        name: String,
        /// Length of an angstrom, scene units.
        angstrom: f64,
    },
    /// Those that the file lists.
    File,
}

/// How bonds between particles are drawn.
#[derive(Debug, Clone)]
pub struct BondStyle {
    /// Which particles have one.
    pub rule: BondRule,
    /// Their look; each half has the colour of its particle.
    pub look: RodLook,
}

/// An attribute with channels in the images.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AttributeChannel {
    /// Its name.
    pub name: String,
    /// Components per particle.
    pub components: usize,
}

/// The settings of a job: its pictures, and the execution of a run.
#[derive(Debug, Clone)]
pub struct Setup {
    /// Settings that all images depend on.
    pub picture: Picture,
    /// Settings that images do not depend on.
    pub run: RunSettings,
}

/// Settings of the pictures of a job.
#[derive(Debug, Clone)]
pub struct Picture {
    /// World position that all coordinates are relative to.
    pub origin: DVec3,
    /// Which particles are drawn, and how.
    pub particles: ParticleRules,
    /// What the camera shows.
    pub view: ViewSettings,
    /// Lights, material, background, ground; with the camera at the start of the path. [`Setup::scene_at`] returns
    /// the scene of a frame.
    pub scene: Scene,
    /// What is drawn beside the particles.
    pub things: Things,
    /// The surface.
    pub surface: SurfaceSettings,
    /// The renderer.
    pub renderer: RendererKind,
    /// Image size, samples, depth, channels.
    pub render: RenderSettings,
    /// How noise is removed from the images, if it is. The settings for rendering then have features.
    pub denoise: Option<DenoiseSettings>,
    /// The next frame, if there is a channel for motion.
    pub step: Option<FrameStep>,
    /// What is written.
    pub files: FileSettings,
}

/// Which particles are drawn, and how.
#[derive(Debug, Clone)]
pub struct ParticleRules {
    /// Which particles are drawn.
    pub selection: Selection,
    /// The region that spheres are cut to.
    pub cut: ConvexRegion,
    /// Minimum radius; smaller ones would be invisible, and are raised to it.
    pub least_radius: f32,
    /// Which particles have which style, by its index.
    pub division: Division,
    /// The styles, at least one. The first is that of [`Picture::surface`]; behind it are first those with spheres, then
    /// those with bodies, then those with neither.
    pub styles: Vec<ParticleStyle>,
}

impl ParticleRules {
    /// The style of the particles that the manifest gives none, unless a clear one takes their place.
    pub fn first(&self) -> &ParticleStyle {
        &self.styles[0]
    }

    /// The other styles.
    pub fn others(&self) -> &[ParticleStyle] {
        &self.styles[1..]
    }

    /// Whether particles are drawn in different ways.
    pub const fn is_divided(&self) -> bool {
        self.styles.len() > 1
    }
}

/// What stands for the particles of a style.
#[derive(Debug, Clone)]
pub enum StyleForm {
    /// A sphere each.
    Spheres,
    /// A union or a smooth surface.
    Body(SurfaceSettings),
    /// A grain each.
    Grains(GrainRules),
    /// Only rods.
    Nothing,
}

impl StyleForm {
    /// What a surface makes of particles.
    pub const fn of(surface: SurfaceSettings) -> Self {
        match surface.kind {
            SurfaceKind::Spheres => Self::Spheres,
            SurfaceKind::Union | SurfaceKind::Smooth => Self::Body(surface),
        }
    }
}

/// How grains are drawn.
#[derive(Debug, Clone)]
pub struct GrainRules {
    /// Their shape; None: those of the types if the file has them, superquadrics if the frame has exponents, else
    /// ellipsoids.
    pub kind: Option<GrainKind>,
    /// Their mesh, which has precedence.
    pub mesh: Option<Arc<GrainMesh>>,
    /// The columns that are named; others have the usual names.
    pub names: GrainNames,
    /// Semi-axes of all grains, scene units; or factors on the mesh, which is 1 without any.
    pub size: Option<Vec3>,
    /// Exponents of all superquadrics.
    pub exponents: Option<[f32; 2]>,
}

/// How some of the particles are drawn.
#[derive(Debug, Clone)]
pub struct ParticleStyle {
    /// Name in legends and messages.
    pub name: String,
    /// Whether the user named it, so that legends have it.
    pub is_named: bool,
    /// Whether it is that of particles without a style, beside a clear one.
    pub is_of_rest: bool,
    /// Whether they have one scale of colours with the particles without a style.
    pub shares_colors: bool,
    /// What stands for them.
    pub form: StyleForm,
    /// Source of the radii.
    pub radius: RadiusRule,
    /// Factor on the radii.
    pub radius_factor: f32,
    /// Source of the colours.
    pub color: ColorRule,
    /// How much each sphere covers of what is behind it.
    pub opacity: OpacityRule,
    /// The material.
    pub material: MaterialId,
    /// Their bonds, if these are drawn.
    pub bonds: Option<BondStyle>,
}

/// What the camera shows.
#[derive(Debug, Clone)]
pub struct ViewSettings {
    /// The up direction, unit vector.
    pub up: DVec3,
    /// The camera path, in world units.
    pub path: CameraPath,
    /// The projection of the camera.
    pub projection: Projection,
    /// The eyes, if images are stereo pairs.
    pub stereo: Option<StereoSettings>,
    /// Number of particles of a frame, about, that are far from the others and that an automatic camera may leave out.
    pub unframed: u64,
    /// The lens of the camera; without one, it is a pinhole.
    pub lens: Option<LensSettings>,
    /// Motion blur, if there is any.
    pub shutter: Option<Shutter>,
    /// Width of the image of an eye divided by its height; also used if fewer pixels are traced in a trial.
    pub aspect: f64,
}

/// What is drawn beside the particles. Each has a material of the scene.
#[derive(Debug, Clone)]
pub struct Things {
    /// The meshes.
    pub meshes: Vec<MeshThing>,
    /// How the simulation cell is drawn, if it is.
    pub cell: Option<RodLook>,
    /// Arrows of vector attributes.
    pub arrows: Vec<ArrowStyle>,
    /// Trails over earlier frames.
    pub trails: Vec<TrailStyle>,
}

/// What is written of a picture.
#[derive(Debug, Clone)]
pub struct FileSettings {
    /// Attributes with channels, in the order of their floats in the film.
    pub attributes: Vec<AttributeChannel>,
    /// Options of the EXR; the camera is added for each frame.
    pub exr: ExrOptions,
    /// What is drawn over previews.
    pub overlays: Vec<Overlay>,
    /// The place of each of them in the list of the manifest, which may have overlays that show nothing.
    pub overlay_entries: Vec<usize>,
    /// Names of the values whose ranges overlays show.
    pub overlay_values: Vec<String>,
    /// Options of the PNG; [`Setup::preview_from`] adds the background of jobs of earlier versions.
    pub preview: PreviewOptions,
    /// Whether previews of images without background have one, as in jobs of earlier versions.
    pub has_opaque_previews: bool,
}

/// Execution options of a run.
#[derive(Debug, Clone)]
pub struct RunSettings {
    /// Memory limit of the job, bytes; by default the free memory.
    pub memory_limit: Option<u64>,
    /// The structure of the tree; by default it is chosen for each frame.
    pub accelerator: Option<Structure>,
    /// Settings of `bvh`.
    pub bvh: BvhSettings,
    /// Settings of `sbvh`.
    pub sbvh: SbvhSettings,
    /// How native frames are accessed.
    pub access: Access,
    /// Whether all data in use of native frames are verified with their checksums, or only the nodes; by default it
    /// depends on their size.
    pub verify: Option<bool>,
    /// Size of the heaviest frame, if known.
    pub weight: Option<FrameWeight>,
    /// Sizes of the surfaces of some frames, by their index.
    pub surfaces: Vec<SurfaceWeight>,
    /// Why a job that may be rendered on a GPU is not, if there is something to say.
    pub why_cpu: Option<String>,
}

impl Picture {
    /// Number of images of eyes beside each other and below each other.
    pub(super) const fn eyes(&self) -> [u32; 2] {
        self.scene.camera.eyes()
    }

    /// Whether ids of particles are needed: for channels, or for the places and sizes of drops.
    pub(super) fn needs_ids(&self) -> bool {
        let has_drops = self.scene.is_spray_soft() || self.surface.whitewater;
        self.render.channels.needs_ids() || has_drops
    }
}

impl Setup {
    /// The camera of `frame`, without its lens.
    ///
    /// # Errors
    /// The view is invalid; [`crate::resolve::check_views`] detects that in advance.
    pub fn camera_at(&self, frame: i64) -> Result<Camera, CameraError> {
        self.camera_with(&self.picture.view.path.view(frame))
    }

    /// The camera at `view`, without its lens.
    fn camera_with(&self, view: &CameraView) -> Result<Camera, CameraError> {
        let picture = &self.picture;
        let camera =
            Camera::projected(view, picture.view.projection, picture.view.aspect, picture.origin)?;
        let stereo = picture.view.stereo.map(|stereo| stereo.stereo(view));
        Ok(camera.with_stereo(stereo.transpose()?))
    }

    /// The scene of `frame`: only the camera moves, lights and everything else are fixed. `focus` is the position of
    /// the particle in focus, relative to the origin.
    ///
    /// # Errors
    /// Same as [`Self::camera_at`], or the focus is not in front of the camera.
    pub fn scene_at(&self, frame: i64, focus: Option<Vec3>) -> Result<Scene, CameraError> {
        let mut camera = self.camera_at(frame)?;
        if let Some(lens) = self.picture.view.lens {
            let view = self.picture.view.path.view(frame);
            let point = focus.map(|point| self.picture.origin + point.as_dvec3());
            camera = camera.with_lens(lens.lens(&view, self.picture.view.aspect, point)?);
        }
        let other = |step: FrameStep| {
            // Only views of frames in the sequence are checked in advance
            let there = self.camera_at(frame.saturating_add(step.numbers));
            let camera = there.or_else(|_| self.camera_at(frame))?;
            Ok(OtherFrame { camera, time: step.time })
        };
        let step = self.picture.step;
        Ok(Scene {
            camera,
            next_frame: step.map(other).transpose()?,
            previous_frame: step.map(FrameStep::back).map(other).transpose()?,
            exposure: self.exposure(frame, &camera),
            ..self.picture.scene.clone()
        })
    }

    /// The exposure of `frame`. `camera` is that of the frame, with its lens.
    fn exposure(&self, frame: i64, camera: &Camera) -> Option<Exposure> {
        let picture = &self.picture;
        let shutter = picture.view.shutter?;
        #[expect(clippy::cast_precision_loss, reason = "frame numbers of neighbours differ little")]
        let numbers = shutter.step.numbers as f64;
        let at = |part: f64| {
            let view = picture.view.path.view_between(frame, part * numbers);
            let moved = self.camera_with(&view);
            // Only views of frames are checked in advance
            moved.map_or(*camera, |moved| match camera.lens() {
                Some(lens) => moved.with_lens(lens),
                None => moved,
            })
        };
        Some(Exposure { cameras: [at(shutter.open), at(shutter.close)], slices: self.slices() })
    }

    /// Options for the PNG of an image from `camera`.
    pub fn preview_from(&self, camera: &Camera) -> PreviewOptions {
        let mut options = self.picture.files.preview;
        if self.picture.files.has_opaque_previews {
            let behind = self.picture.scene.background.color(camera.forward());
            options.background = PreviewBackground::Color(behind);
        }
        options
    }

    /// Settings for the tree of a frame with `particles`, with or without values for colours.
    pub fn build_settings(&self, particles: usize, has_values: bool) -> BuildSettings {
        let structure = match (self.structure_for(particles), self.has_motion()) {
            // A moving sphere must not be stored twice
            (Structure::Sbvh, true) => Structure::Bvh,
            (structure, _) => structure,
        };
        BuildSettings {
            keep_indices: self.needs_indices(has_values) || self.has_motion(),
            bvh: self.run.bvh,
            sbvh: self.run.sbvh,
            ..BuildSettings::new(structure)
        }
    }

    /// Whether the indices of particles at intersections are needed, with or without values for colours.
    pub(super) fn needs_indices(&self, has_values: bool) -> bool {
        self.needs_particles() || has_values
    }

    /// Whether the indices of particles at intersections are needed, apart from their colours.
    pub(super) fn needs_particles(&self) -> bool {
        let picture = &self.picture;
        let is_for_channels = picture.render.channels.needs_particles();
        let rules = &picture.particles;
        let is_for_look = rules.first().opacity.is_by_particle() || rules.is_divided();
        is_for_channels || is_for_look || picture.render.channels.needs_parts()
    }

    /// Whether native frames relative to [`Picture::origin`] are traced in place.
    pub fn traces_in_place(&self) -> bool {
        let is_by_attribute = matches!(
            self.picture.particles.first().radius,
            RadiusRule::Attribute { .. } | RadiusRule::Table { .. }
        );
        self.needs_copy().is_none() && !is_by_attribute
    }

    /// The reason why the particles of a native frame must be copied, whatever radii they have; None if they need not
    /// be.
    pub(super) fn needs_copy(&self) -> Option<String> {
        // Trees over objects need positions in memory
        let structure = self.stored_structure();
        if matches!(structure, Structure::Bvh | Structure::Sbvh) {
            return Some(format!(
                "{structure} builds over a copy of them, 12 bytes per particle and more; lbvh and kdtree do not"
            ));
        }
        // So does everything that chooses, moves or searches particles
        let particles = &self.picture.particles;
        let Things { arrows, trails, .. } = &self.picture.things;
        let reasons = [
            (
                !particles.selection.is_all(),
                "[select] and [[clip]] take those that are drawn from a copy of them, 12 bytes per particle and more",
            ),
            (
                particles.is_divided(),
                "[[style]] and [[material.part]] divide a copy of them, 12 bytes per particle and more",
            ),
            (
                !arrows.is_empty() || !trails.is_empty() || particles.first().bonds.is_some(),
                "arrows, trails and bonds are made from a copy of them, 12 bytes per particle and more",
            ),
            (self.has_motion(), "motion blur moves a copy of them, 40 bytes per particle and more"),
            (
                self.focused_particle().is_some(),
                "camera.focus searches for a particle in a copy of them",
            ),
            (
                self.colors_need_geometry(),
                "their colours or opacities are computed from a copy of them, 16 bytes per particle and more",
            ),
        ];
        if let Some((_, why)) = reasons.into_iter().find(|(needs_copy, _)| *needs_copy) {
            return Some(why.to_owned());
        }
        // So do surfaces that are made from all of them
        let why = match self.picture.surface {
            SurfaceSettings { kind: SurfaceKind::Smooth, .. } => {
                "a smooth surface sorts a copy of them, 12 bytes per particle and more"
            }
            SurfaceSettings { spray: true, .. } => {
                "spray is parted from them, for 12 bytes per particle and more"
            }
            _ => return None,
        };
        Some(why.to_owned())
    }

    /// Whether colours or opacities are computed from more than attributes.
    fn colors_need_geometry(&self) -> bool {
        let ParticleStyle { color, opacity, .. } = self.picture.particles.first();
        matches!(color, ColorRule::Attribute { needs_geometry: true, .. })
            || matches!(opacity, OpacityRule::Value { needs_geometry: true, .. })
    }

    /// Number of slices of the exposure in which surfaces differ.
    pub(super) fn slices(&self) -> u32 {
        let has_moving_meshes =
            self.picture.things.meshes.iter().any(|thing| thing.mesh.tree.is_none());
        let is_continuous = self.picture.surface.kind == SurfaceKind::Spheres && !has_moving_meshes;
        match self.picture.view.shutter {
            Some(shutter) if !is_continuous => shutter.slices,
            _ => 1,
        }
    }

    /// Whether there is motion blur.
    pub(super) const fn has_motion(&self) -> bool {
        self.picture.view.shutter.is_some()
    }

    /// Whether particles move to their places in the next frame, which is read too.
    pub(super) fn moves_to_next_frame(&self) -> bool {
        self.picture.view.shutter.is_some_and(|shutter| !shutter.has_velocities)
    }

    /// The id of the particle in focus.
    pub(super) fn focused_particle(&self) -> Option<u32> {
        self.picture.view.lens.as_ref().and_then(LensSettings::particle)
    }

    /// The structure to report for a native frame in place: its order is that of k-d cells.
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
