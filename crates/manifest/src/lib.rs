//! The manifest: all settings of a job with their types and defaults, read from TOML.
//!
//! ```text
//! job.toml, options -> [manifest] -> Manifest -> spherule: a plan with every setting
//! ```
//!
//! Each key is declared once, in the file of its table, with the macros of `keys.rs`. Reading, the commented file of
//! `spherule init`, the JSON schema ([`job_schema`]), the page of the manual and the options of the command line
//! ([`key_flags`]) all come from these declarations. Rules between keys are declared with the macro of `rule.rs`, from
//! which messages and conditions in the schema follow.
//!
//! - [`Manifest`]: the settings. [`Manifest::settings`] are those that images depend on, which a job stores.
//! - [`ManifestSource`]: a file that can be read again with other defaults. [`Override`]s, such as options of the
//!   command line, replace its values; a [`Look`] is a named set of defaults.
//! - [`ManifestError`]: all problems at once, each with line and column (or the option), key and remedy.
//!
//! This crate opens no file but manifests, and never sees a particle: `spherule::resolve` determines the meaning of
//! "auto" for the given particles.
//!
//! ```
//! use std::path::Path;
//!
//! use spherule_manifest::{Manifest, Override};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let text = "input.path = \"dam-break\"\nimage = { width = 640, height = 360 }\n";
//! let width = Override::parse("image.width=1280")?;
//! let manifest = Manifest::parse_with(text, Path::new("job.toml"), vec![width])?;
//! assert_eq!(manifest.image.size(), [1280, 360]);
//!
//! let error = Manifest::parse("image.widht = 640", Path::new("job.toml")).unwrap_err();
//! assert!(error.to_string().contains("image.widht: unknown key; did you mean `image.width`?"));
//! # Ok(())
//! # }
//! ```
#![deny(unsafe_code)]

use std::fmt::Write as _;
use std::path::Path;

use spherule_images::overlay::Layout;
use spherule_selection::{Condition, Selection};
use spherule_surface::{SprayStyle, SurfaceKind, SurfaceSettings};
use spherule_tracer::render::{DEFAULT_MAX_SAMPLES, FilmPlane, IntegratorKind, NoiseLimit};
use spherule_tracer::scene::Fresnel;

use key::Affects;
use keys::Keys;
use list::Entries;
use problem::{Problem, Problems};
use reader::Section;
use source::lay_over;
use tree::TomlNode;

mod absorption;
mod arrows;
mod bar_ticks;
mod bonds;
mod by_integer;
mod camera;
mod caustics;
mod cell;
mod channel;
mod check;
mod clip;
mod color;
mod color_map;
mod crop;
mod environment;
mod error;
mod field;
mod file;
mod flags;
mod focus;
mod given;
mod grains;
mod ground;
mod inline_table;
mod input;
mod key;
mod keys;
mod light;
mod light_group;
mod list;
mod look;
#[cfg(test)]
mod manual;
mod material;
mod mesh;
mod mist;
mod nearest;
mod opacity;
mod output;
mod overlay;
mod part;
mod pattern;
#[cfg(test)]
mod places_tests;
mod print_size;
mod problem;
mod reader;
mod rebase;
mod render;
mod rule;
mod same;
mod schema;
mod select;
mod source;
mod style;
mod styled;
mod sun;
mod surface;
#[cfg(test)]
mod tests;
mod text_size;
mod trails;
mod tree;
mod value;
mod work;
#[cfg(test)]
mod work_tests;

pub use absorption::Absorption;
pub use arrows::Arrows;
pub use bar_ticks::LabelFormat;
pub use bonds::{BondSearch, Bonds};
pub use by_integer::ByInteger;
pub use camera::{
    AxisView, BoxSetting, Camera, CameraKey, CameraMode, ConvergenceSetting, FitSetting,
    ProjectionKind,
};
pub use cell::{Cell, Replicate};
pub use channel::Channel;
pub use clip::{Clip, ClipKind, ClipMode, KeptSide, PlaneNormal};
pub use color::{CategoryColors, CategoryNames, ColorMapping, ColorSetting, ScaleKind};
pub use color_map::{MapName, RangeSetting};
pub use crop::PixelBounds;
pub use environment::{Environment, EnvironmentKind, ExtractSun};
pub use error::ManifestError;
pub use file::{is_marked, marked, read_manifest};
pub use flags::{KeyFlag, key_flags};
pub use focus::FocusSetting;
pub use grains::{GrainKind, GrainNumbers, GrainOrientation};
pub use ground::{GroundImage, GroundKind, GroundSetting};
pub use input::{Input, Paths, RadiusSetting, UpAxis};
pub use key::Flag;
pub use light::{Light, LightKind};
pub use look::{Look, draft};
pub use material::{Material, MaterialKind};
pub use mesh::{Mesh, MeshMaterial, MeshPath, MeshShading};
pub use mist::Mist;
#[doc(hidden)]
pub use nearest::nearest;
pub use opacity::OpacitySetting;
pub use output::Output;
pub use overlay::{Overlay, OverlayKind, OverlayLayout, OverlayText};
pub use part::{Part, PartKind};
pub use pattern::{FramePattern, OutputPattern};
pub use print_size::Side;
#[doc(hidden)]
pub use rebase::without_dots;
pub use rebase::{RebaseError, named_place, real_dir};
pub use render::{DeviceSetting, GroundPattern, GroundReach, Image, IndirectSetting, Render};
pub use schema::{SCHEMA_FILE, job_schema};
pub use select::{Axis, Select, Slab};
pub use source::ManifestSource;
pub use spherule_tracer::render::NamedChannel;
pub use style::{Style, StyleBonds, StyleDraw, StyleMaterial, StyleMaterialKind};
pub use styled::{DrawnStyle, StyleSource, StyledManifest};
pub use sun::Sun;
pub use text_size::{TextSize, points_on_paper};
pub use trails::Trails;
pub use tree::{Override, OverrideError};
pub use value::FlagKind;
pub use work::{MAX_THREADS, ProgressMode, STOP_FILE, Work};

/// Name of a light group.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LightGroup(String);

/// The settings of a job.
#[derive(Debug, Clone, PartialEq)]
pub struct Manifest {
    /// The defaults of the other settings.
    pub look: Look,
    /// Whether looks add a legend.
    pub legend: bool,
    /// The particles.
    pub input: Input,
    /// The particles that are drawn.
    pub select: Select,
    /// How some of the particles are drawn, unlike the others.
    pub styles: Vec<Style>,
    /// Planes and boxes that leave out particles.
    pub clips: Vec<Clip>,
    /// The camera.
    pub camera: Camera,
    /// Size and sampling of the image.
    pub image: Image,
    /// How the image is traced.
    pub render: Render,
    /// The surface: `render.surface` and `[surface]`.
    pub surface: SurfaceSettings,
    /// The material of the particles.
    pub material: Material,
    /// Light from infinitely far away.
    pub environment: Environment,
    /// Mist above the ground.
    pub mist: Mist,
    /// Light sources; without any, whitted has a key light and a soft fill light, placed relative to the camera.
    pub lights: Vec<Light>,
    /// The simulation cell.
    pub cell: Cell,
    /// Meshes next to the particles.
    pub meshes: Vec<Mesh>,
    /// Trails of the particles over earlier frames.
    pub trails: Trails,
    /// Bonds between particles.
    pub bonds: Bonds,
    /// Arrows of vector attributes at the particles.
    pub arrows: Vec<Arrows>,
    /// What is drawn over previews.
    pub overlays: Vec<Overlay>,
    /// The images.
    pub output: Output,
    /// Execution options; no image depends on them.
    pub job: Work,
    /// Whether the PNG of an image without background has one, as in jobs of earlier versions. It has no key.
    pub has_opaque_previews: bool,
}

impl Manifest {
    /// Default settings for the particles at `path`.
    pub fn new(path: impl Into<String>) -> Self {
        Self {
            look: Look::Auto,
            legend: true,
            input: Input::new(path),
            select: Select::default(),
            styles: Vec::new(),
            clips: Vec::new(),
            camera: Camera::default(),
            image: Image::default(),
            render: Render::default(),
            surface: SurfaceSettings::DEFAULT,
            material: Material::default(),
            environment: Environment::default(),
            mist: Mist::default(),
            lights: Vec::new(),
            cell: Cell::default(),
            meshes: Vec::new(),
            trails: Trails::default(),
            bonds: Bonds::default(),
            arrows: Vec::new(),
            overlays: Vec::new(),
            output: Output::default(),
            job: Work::default(),
            has_opaque_previews: false,
        }
    }

    /// Reads a manifest. `path` is used for messages only.
    ///
    /// # Errors
    /// It is not TOML, or has unknown keys or invalid values.
    pub fn parse(text: &str, path: &Path) -> Result<Self, ManifestError> {
        Self::parse_with(text, path, Vec::new())
    }

    /// Reads a manifest and applies `overrides` in order. The text may be empty if they contain everything that is
    /// required (`input.path`).
    ///
    /// # Errors
    /// Same as [`Manifest::parse`]; problems of an override are reported under its name.
    pub fn parse_with(
        text: &str,
        path: &Path,
        overrides: Vec<Override>,
    ) -> Result<Self, ManifestError> {
        Self::parse_with_warnings(text, path, overrides).map(|(manifest, _)| manifest)
    }

    /// Same as [`Manifest::parse_with`], with warnings about obsolete forms that are still accepted.
    ///
    /// # Errors
    /// Same as [`Manifest::parse_with`].
    pub fn parse_with_warnings(
        text: &str,
        path: &Path,
        overrides: Vec<Override>,
    ) -> Result<(Self, Vec<String>), ManifestError> {
        let problems = Problems::default();
        let mut tree = TomlNode::parse(text).map_err(|(place, what)| {
            let key = String::new();
            ManifestError::new(vec![Problem { place, key, what }], text, path)
        })?;
        lay_over(&mut tree, text, overrides, |problem| {
            problems.errors.borrow_mut().push(problem);
        });
        // Read all keys, then check dependencies between them
        let mut manifest = Self::new("");
        let mut root = Keys::Read(Section::root(&tree, &problems));
        manifest.keys(&mut root);
        if !tree.has("render.integrator") {
            manifest.select_integrator(&mut root);
        }
        manifest.check(&mut root);
        root.finish();
        let errors = problems.errors.into_inner();
        if errors.is_empty() {
            let warnings = problems.warnings.into_inner();
            Ok((manifest, ManifestError::new(warnings, text, path).into_messages()))
        } else {
            Err(ManifestError::new(errors, text, path))
        }
    }

    /// Selects the integrator for the terms of the thesis's model, if one has another value than its default. A
    /// warning names it.
    fn select_integrator(&mut self, root: &mut Keys<'_>) {
        let Some(term) = self.material.changed_term() else {
            return;
        };
        self.render.integrator = Some(IntegratorKind::Whitted);
        if let Some(root) = root.reading() {
            let what =
                "selects integrator = \"whitted\"; render.integrator = \"path\" keeps path tracing";
            root.section("material").warn(term, what);
        }
    }

    /// Visits all keys, in the order of the commented file. No other place knows the tables.
    fn keys(&mut self, keys: &mut Keys<'_>) {
        look::keys(&mut self.look, &mut self.legend, keys);
        keys.section("input", Input::ABOUT, |keys| self.input.keys(keys));
        keys.section("select", select::ABOUT, |keys| self.select.keys(keys));
        keys.section("camera", Camera::ABOUT, |keys| self.camera.all_keys(keys));
        keys.section("image", Image::ABOUT, |keys| self.image.all_keys(keys));
        keys.section("render", Render::ABOUT, |keys| {
            surface::kind_key(&mut self.surface, keys);
            self.render.keys(keys);
        });
        keys.section("surface", surface::ABOUT, |keys| {
            surface::all_keys(&mut self.surface, keys);
        });
        keys.section("material", material::ABOUT, |keys| {
            self.material.all_keys(keys);
        });
        keys.section("environment", environment::ABOUT, |keys| {
            self.environment.keys(keys);
        });
        keys.section("mist", Mist::ABOUT, |keys| self.mist.keys(keys));
        keys.section("cell", Cell::ABOUT, |keys| self.cell.keys(keys));
        keys.section("trails", Trails::ABOUT, |keys| self.trails.keys(keys));
        keys.section("bonds", Bonds::ABOUT, |keys| self.bonds.keys(keys));
        keys.section("output", Output::ABOUT, |keys| self.output.keys(keys));
        keys.section("job", Work::ABOUT, |keys| self.job.all_keys(keys));
        keys.list("style", "style", style::ABOUT, &mut self.styles, Style::keys);
        keys.list("clip", "clip", clip::ABOUT, &mut self.clips, Clip::keys);
        keys.list("light", "light", light::ABOUT, &mut self.lights, Light::keys);
        keys.list("mesh", "mesh", mesh::ABOUT, &mut self.meshes, Mesh::keys);
        let arrows = &mut self.arrows;
        keys.list("arrows", "arrows", arrows::ABOUT, arrows, Arrows::keys);
        let overlays = &mut self.overlays;
        keys.list("overlay", "overlay", overlay::ABOUT, overlays, Overlay::keys);
    }

    /// Where an overlay is: over the picture, or beside it.
    pub fn layout_of(&self, overlay: &Overlay) -> Layout {
        match overlay.layout {
            Some(OverlayLayout::Beside) => Layout::Beside,
            Some(OverlayLayout::Over) => Layout::Over,
            Some(OverlayLayout::Auto) | None => self.image.layout,
        }
    }

    /// Whether the picture is smaller than the image, because overlays are beside it.
    pub fn has_strips(&self) -> bool {
        self.overlays.iter().any(|overlay| self.layout_of(overlay) == Layout::Beside)
    }

    /// A setting that does not go with overlays beside the picture, if one is given.
    pub fn against_strips(&self) -> Option<&'static str> {
        let image = &self.image;
        let others = [
            ("image.crop", image.crop.is_some()),
            ("image.overscan", image.overscan > 0),
            ("camera.stereo", self.camera.stereo),
        ];
        others.into_iter().find(|(_, is_given)| *is_given).map(|(key, _)| key)
    }

    /// Shows the particles of one frame, the first that is rendered, unless the manifest says what is in the picture.
    pub fn show_own_frame(&mut self) {
        let camera = &mut self.camera;
        if matches!(camera.mode, CameraMode::Auto | CameraMode::Turntable) {
            camera.fit.get_or_insert(FitSetting::This);
        }
    }

    /// The image with those of both eyes of a stereo pair.
    pub fn picture(&self) -> Image {
        self.image.of_eyes(self.camera.eyes())
    }

    /// The particles that are drawn.
    pub fn selection(&self) -> Selection {
        let slab = self.select.slab.iter().map(Slab::region);
        let of_mode = |mode| {
            let clips = self.clips.iter().filter(move |clip| clip.mode == mode);
            clips.map(|clip| clip.kind.region())
        };
        Selection {
            condition: self.drawn_condition(),
            ids: self.select.ids.clone(),
            every: self.select.every,
            regions: slab.chain(of_mode(ClipMode::Particles)).collect(),
            cuts: of_mode(ClipMode::Cut).collect(),
            // With "auto", that of the files
            up: None,
        }
    }

    /// The condition on particles that are drawn.
    fn drawn_condition(&self) -> Option<Condition> {
        match (self.select.condition.clone(), self.shown_condition()) {
            (Some(selected), Some(shown)) => Some(selected.and(shown)),
            (selected, shown) => selected.or(shown),
        }
    }

    /// The picture on the ground.
    pub fn ground_image(&self) -> Option<&GroundImage> {
        self.render.ground.as_ref()?.image.as_ref()
    }

    /// The integrator of the images.
    pub fn integrator(&self) -> IntegratorKind {
        self.render.integrator.unwrap_or(IntegratorKind::Path)
    }

    /// The limit of noise, if there is one.
    pub fn noise_limit(&self) -> Option<NoiseLimit> {
        let max_samples = self.image.max_samples.unwrap_or(DEFAULT_MAX_SAMPLES);
        self.render.noise.map(|noise| NoiseLimit { noise, max_samples })
    }

    /// Whether rays at spheres split into reflected and refracted ones; `render.min_weight` has no effect otherwise.
    fn branches_at_spheres(&self) -> bool {
        self.surface.kind == SurfaceKind::Spheres
            && self.material.resolved(Fresnel::Schlick).branches()
    }

    /// Whether a union or a smooth surface is path traced.
    pub fn has_path_traced_body(&self) -> bool {
        self.surface.kind != SurfaceKind::Spheres && self.integrator() == IntegratorKind::Path
    }

    /// Whether foam, spray or whitewater is path traced.
    fn has_path_traced_spray(&self) -> bool {
        (self.surface.spray || self.has_whitewater()) && self.has_path_traced_body()
    }

    /// Whether there is whitewater, which only smooth surfaces have.
    pub fn has_whitewater(&self) -> bool {
        self.surface.whitewater && self.surface.kind == SurfaceKind::Smooth
    }

    /// Whether foam, spray and whitewater are drops that fade out.
    pub fn draws_soft_spray(&self) -> bool {
        self.has_path_traced_spray() && self.surface.spray_style == SprayStyle::Soft
    }

    /// Whether images of this manifest depend on keys with this `affects`.
    fn depends_on(&self, affects: Affects) -> bool {
        match affects {
            Affects::Images => true,
            Affects::Nothing => false,
            Affects::SmoothSurfaces => self.surface.kind == SurfaceKind::Smooth,
            Affects::Bodies => self.surface.kind != SurfaceKind::Spheres,
            Affects::PathTracedBodies => self.has_path_traced_body(),
            Affects::Spray => self.has_path_traced_spray(),
            Affects::Whitewater => self.has_whitewater(),
            Affects::BranchingSpheres => self.branches_at_spheres(),
            Affects::PathTracing => self.integrator() == IntegratorKind::Path,
            Affects::Sky => self.has_environment(EnvironmentKind::Sky),
            Affects::EnvironmentImage => self.has_environment(EnvironmentKind::Image),
            Affects::Mist => self.mist.visibility.is_some(),
            Affects::NoiseLimit => self.render.noise.is_some(),
            Affects::LightGroups => {
                let channel = Channel::plane(FilmPlane::LightGroups);
                self.output.channels.contains(&channel)
            }
        }
    }

    /// All settings that images depend on, as dotted key and TOML value, in a fixed order. Excludes keys that do not
    /// affect images, or not those of this manifest (see `Affects`), and the directory of the images. Input files are
    /// identified by separate fingerprints.
    pub fn settings(&self) -> Vec<(String, String)> {
        let mut settings = self.entries().settings(|affects| self.depends_on(affects));
        let renderer = format!("{:?}", self.render.device.renderer().name());
        settings.push((same::RENDERER.to_owned(), renderer));
        if let Some(image) = self.ground_image() {
            settings.push((GROUND_IMAGE.to_owned(), format!("{:?}", image.path)));
        }
        // Versions without rough interfaces had the same keys, and other images
        let is_rough = self.material.resolved(Fresnel::Exact).interface_roughness > 0.0;
        if is_rough && self.integrator() == IntegratorKind::Path {
            settings.push((same::ROUGH_INTERFACE.to_owned(), "true".to_owned()));
        }
        // Versions whose previews showed the background had the same keys
        if self.has_transparent_previews() {
            settings.push((same::PREVIEW_ALPHA.to_owned(), "true".to_owned()));
        }
        settings
    }

    /// Whether an environment of this kind lights the scene.
    pub fn has_environment(&self, kind: EnvironmentKind) -> bool {
        self.integrator() == IntegratorKind::Path && self.environment.kind == kind
    }

    /// Whether the PNG of an image has alpha.
    fn has_transparent_previews(&self) -> bool {
        let has_png = self.output.preview || self.output.path.is_png();
        self.output.transparent && has_png && !self.has_opaque_previews
    }

    /// A complete manifest with every key and comments; reading it gives an equal manifest.
    pub fn to_commented_toml(&self) -> String {
        // Editors that know the first line complete and check the following lines, and ignore it if that file is
        // missing.
        let mut text = format!("#:schema ./{SCHEMA_FILE}\n# {ABOUT}\n");
        text.push_str(&self.entries().file());
        let examples = Self::examples().entries();
        for (list, comment, is_empty) in [
            ("camera.key", NO_KEYS, self.camera.keys.is_empty()),
            ("material.part", NO_PARTS, self.material.parts.is_empty()),
            ("style", NO_STYLES, self.styles.is_empty()),
            ("clip", NO_CLIPS, self.clips.is_empty()),
            ("light", AUTO_LIGHTS, self.lights.is_empty()),
            ("mesh", NO_MESHES, self.meshes.is_empty()),
            ("arrows", NO_ARROWS, self.arrows.is_empty()),
            ("overlay", NO_OVERLAYS, self.overlays.is_empty()),
        ] {
            if is_empty {
                let _ = write!(text, "\n# {comment}\n{}", examples.commented_out(list));
            }
        }
        text
    }

    /// All keys with their values.
    fn entries(&self) -> Entries {
        let mut entries = Entries::default();
        // The visitor needs a mutable manifest for reading; listing does not change it.
        self.clone().keys(&mut Keys::List(&mut entries));
        entries
    }

    /// A manifest with one item of each kind in each list.
    fn examples() -> Self {
        let mut manifest = Self::new("");
        manifest.camera.keys = vec![CameraKey::default()];
        manifest.material.parts = vec![Part::default()];
        manifest.styles = vec![Style::default()];
        manifest.clips = Clip::examples();
        manifest.lights = Light::examples();
        manifest.meshes = vec![Mesh::default()];
        manifest.arrows = vec![Arrows::default()];
        manifest.overlays = Overlay::examples();
        manifest
    }
}

/// The key of the picture on the ground in the settings that images depend on.
pub const GROUND_IMAGE: &str = "render.ground.image";

/// Description of a manifest.
const ABOUT: &str = "A spherule job. Paths are relative to this file; lengths are in the unit of the particle files.";

const NO_KEYS: &str = "In mode \"keys\" the camera moves smoothly through these views, and stands still before the \
                       first and after the last.";

const NO_PARTS: &str =
    "Parts of the particles (attribute part, type or phase) may have materials of their own.";

const NO_STYLES: &str = "Styles draw some of the particles in their own way; the first whose condition holds takes a \
                         particle.";

const NO_CLIPS: &str = "Planes and boxes leave out particles.";

const AUTO_LIGHTS: &str = "Without [[light]], a key light and a soft fill light are placed relative to the camera. A \
                           directional light has a direction instead of position and falloff.";

const NO_MESHES: &str = "Tanks, obstacles and other bodies that are not particles.";

const NO_ARROWS: &str = "Arrows show attributes with three components at the particles.";

const NO_OVERLAYS: &str = "Colour bars, text, scale bars and axes are drawn over previews.";

/// All keys that are not in lists.
fn known_keys() -> Vec<String> {
    let entries = Manifest::new("").entries();
    entries.list().iter().map(|e| e.key.clone()).collect()
}

/// The dotted keys that are not in lists and have this name, with or without their table, however its words are joined:
/// `f_stop`, `f-stop`, `camera-fstop`.
#[doc(hidden)]
pub fn keys_called(name: &str) -> Vec<String> {
    let joined = |text: &str| text.replace(['-', '_', '.'], "").to_ascii_lowercase();
    let name = joined(name);
    let mut all = known_keys();
    all.retain(|key| {
        let (_, last) = key.rsplit_once('.').unwrap_or_default();
        joined(last) == name || joined(key) == name
    });
    all
}
