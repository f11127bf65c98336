//! The manifest: everything a job is, typed, with the defaults, read from TOML.
//!
//! A manifest may be laid over by options of the command line ([`Override`]). Everything wrong
//! with it is told at once, each with line and column (or the option) and key. What "auto" turns
//! into is left to others.

use std::fmt;
use std::path::Path;

use spherule_jobs::FrameRange;

use crate::render::{MAX_LITERAL_DEPTH, RendererKind};
use crate::surface::{SurfaceKind, SurfaceSettings};

use reader::{Problem, Problems, Section};
use tree::{Node, Place};
use write::Entries;

mod camera;
mod color;
mod file;
mod input;
mod length;
mod light;
mod look;
mod material;
mod output;
mod pattern;
#[cfg(test)]
mod places_tests;
mod preset;
mod reader;
mod rebase;
mod same;
mod schema;
mod surface;
#[cfg(test)]
mod tests;
mod tree;
mod work;
#[cfg(test)]
mod work_tests;
mod write;

pub use camera::{Camera, CameraKey, CameraMode};
pub use color::{Background, ColorMap, ColorSetting};
pub use file::{is_marked, marked, read_manifest};
pub use input::{Input, RadiusSetting, UpAxis};
pub use length::AutoLength;
pub use light::{Falloff, Light, LightKind};
pub use look::{Accelerator, GroundHeight, GroundPattern, Image, Render};
pub use material::{Fresnel, Material};
pub use output::{Channel, Compression, Output};
pub use pattern::OutputPattern;
pub use preset::Look;
pub(crate) use reader::nearest;
pub(crate) use rebase::without_dots;
pub use rebase::{named_place, real_dir};
pub use schema::{SCHEMA_FILE, job_schema};
pub use tree::Override;
pub use work::{MAX_THREADS, ProgressMode, STOP_FILE, Seconds, Work};

/// An enum whose variants have the names that users type.
macro_rules! named {
    ($(#[$meta:meta])* $name:ident { $($(#[$variant_meta:meta])* $variant:ident = $text:literal,)+ }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum $name {
            $($(#[$variant_meta])* $variant,)+
        }

        impl $name {
            /// All, with the names that users type.
            pub const ALL: &[(Self, &'static str)] = &[$((Self::$variant, $text),)+];

            /// As users type it.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $text,)+
                }
            }
        }

        impl $crate::manifest::write::Toml for $name {
            fn toml(&self) -> String {
                $crate::manifest::write::Toml::toml(self.name())
            }
        }

        $crate::manifest::write::described!($name, {
            "enum": $crate::manifest::schema::words(&[], $name::ALL),
        });
    };
}
use named;

/// See the module.
#[derive(Debug, Clone, PartialEq)]
pub struct Manifest {
    /// Which particles.
    pub input: Input,
    /// From where.
    pub camera: Camera,
    /// How large.
    pub image: Image,
    /// How traced.
    pub render: Render,
    /// What rays meet: `render.surface` and `[surface]`.
    pub surface: SurfaceSettings,
    /// Made of what.
    pub material: Material,
    /// In which light; with none, a key light and a soft fill are placed by the camera.
    pub lights: Vec<Light>,
    /// Into which images.
    pub output: Output,
    /// How the work is gone about; no image depends on it.
    pub job: Work,
}

/// Everything that is wrong with a manifest, a line each.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ManifestError {
    lines: Vec<String>,
}

impl ManifestError {
    /// One message for each thing that is wrong, in the order of the file.
    pub fn messages(&self) -> &[String] {
        &self.lines
    }
}

impl fmt::Display for ManifestError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.lines.join("\n"))
    }
}

impl std::error::Error for ManifestError {}

impl Manifest {
    /// The defaults for the particles at `path`.
    pub fn new(path: impl Into<String>) -> Self {
        Self {
            input: Input::new(path),
            camera: Camera::default(),
            image: Image::default(),
            render: Render::default(),
            surface: SurfaceSettings::DEFAULT,
            material: Material::default(),
            lights: Vec::new(),
            output: Output::default(),
            job: Work::default(),
        }
    }

    /// Reads a manifest. `path` is for messages only.
    ///
    /// # Errors
    /// It is no TOML, or has unknown keys or values that will not do.
    pub fn parse(text: &str, path: &Path) -> Result<Self, ManifestError> {
        Self::parse_with(text, path, Vec::new())
    }

    /// Reads a manifest with `overrides` laid over it in order. The text may be empty if they
    /// give all that is needed (`input.path`).
    ///
    /// # Errors
    /// As [`Manifest::parse`]; what comes from an override is told by its name.
    pub fn parse_with(
        text: &str,
        path: &Path,
        overrides: Vec<Override>,
    ) -> Result<Self, ManifestError> {
        let problems = Problems::default();
        let mut tree = Node::parse(text).map_err(|(place, what)| {
            let key = String::new();
            told(vec![Problem { place, key, what }], text, path)
        })?;
        // What lies under everything fills the gaps that are left.
        let (under, over): (Vec<_>, Vec<_>) = overrides.into_iter().partition(Override::is_under);
        for overlay in over.into_iter().chain(under) {
            if let Err(problem) = tree.lay_over(overlay) {
                problems.borrow_mut().push(problem);
            }
        }
        let manifest = Self::read(Section::root(&tree, &problems));
        let problems = problems.into_inner();
        if problems.is_empty() {
            Ok(manifest)
        } else {
            Err(told(problems, text, path))
        }
    }

    fn read(mut root: Section<'_>) -> Self {
        let mut render = root.section("render");
        let surface = surface::kind(&mut render);
        let manifest = Self {
            input: Input::read(root.section("input")),
            camera: Camera::read(root.section("camera")),
            image: Image::read(root.section("image")),
            surface: surface::read(root.section("surface"), surface),
            render: Render::read(render),
            material: Material::read(root.section("material")),
            lights: root
                .sections("light")
                .into_iter()
                .filter_map(Light::read)
                .collect(),
            output: Output::read(root.section("output")),
            job: Work::read(root.section("job")),
        };
        if manifest.doubles_rays_too_often() {
            let depth = manifest.render.max_depth;
            root.section("render").wrong(
                "min_weight",
                &format!(
                    "0 follows both branches at transmissive spheres, which doubles the rays at each level; with \
                     max_depth = {depth} choose at least 1e-5, or a max_depth of at most {MAX_LITERAL_DEPTH}"
                ),
            );
        }
        root.finish();
        manifest
    }

    /// Whether both branches at transmissive spheres are to be followed deeper than rays can be counted.
    fn doubles_rays_too_often(&self) -> bool {
        self.branches_at_spheres()
            && self.render.min_weight == 0.0
            && self.render.max_depth > MAX_LITERAL_DEPTH
    }

    /// Whether rays go on in two directions where they meet a sphere: `render.min_weight` is for these pictures alone.
    fn branches_at_spheres(&self) -> bool {
        self.surface.kind == SurfaceKind::Spheres
            && self.material.reflection > 0.0
            && self.material.transmission > 0.0
    }

    /// Whether each of `frame_count` frames gets an image of its own.
    ///
    /// # Errors
    /// There are several frames, or more may come, but the output's name has no number.
    pub fn check_frame_count(&self, frame_count: usize) -> Result<(), ManifestError> {
        let range = self.input.frames.as_ref();
        let more_may_come = self.job.follow && range.is_none_or(FrameRange::has_several);
        if self.output.path.has_number() || (frame_count <= 1 && !more_may_come) {
            return Ok(());
        }
        let count = match frame_count {
            several @ 2.. => format!("{several} frames"),
            _ => "all frames that come".to_owned(),
        };
        Err(ManifestError {
            lines: vec![format!(
                "output.path: {} for {count}: {NEEDS_NUMBER}, or choose one frame with --frames",
                self.output.path
            )],
        })
    }

    /// What images depend on besides the particles, as dotted key and TOML value, in a fixed
    /// order. Left out: `input.path` and frames, which are told by the files themselves, the
    /// accelerator, what no ray of these pictures meets (`render.min_weight` for opaque spheres), the
    /// directory of the images, and all of `[job]`.
    pub fn settings(&self) -> Vec<(String, String)> {
        let mut settings = self.entries().settings();
        let renderer = format!("{:?}", RendererKind::default().name());
        settings.push((same::RENDERER.to_owned(), renderer));
        settings
    }

    /// A complete manifest with every key, commented, that reads back equal.
    pub fn to_commented_toml(&self) -> String {
        // Editors that know the first line complete and check what is written below it, and pass over it where
        // that file is missing.
        let mut text = format!("#:schema ./{SCHEMA_FILE}\n# {ABOUT}\n");
        text.push_str(&self.entries().file());
        if self.camera.keys.is_empty() {
            text.push_str(camera::NO_KEYS);
        }
        if self.lights.is_empty() {
            text.push_str(AUTO_LIGHTS);
        }
        text
    }

    fn entries(&self) -> Entries {
        let mut out = Entries::default();
        self.input.entries(&mut out);
        self.camera.entries(&mut out);
        self.image.entries(&mut out);
        let branches = self.branches_at_spheres();
        self.render.entries(self.surface.kind, branches, &mut out);
        surface::entries(&self.surface, &mut out);
        self.material.entries(&mut out);
        self.output.entries(&mut out);
        self.job.entries(&mut out);
        for (index, light) in self.lights.iter().enumerate() {
            light.entries(index, &mut out);
        }
        out
    }
}

/// What a manifest is.
const ABOUT: &str =
    "A spherule job. Paths are relative to this file; lengths are those of the simulation.";

const NEEDS_NUMBER: &str =
    "several frames would get the same name; put #### into it, as in frame.####.exr";

const AUTO_LIGHTS: &str = r#"
# Without [[light]], a key light and a soft fill are placed by the camera.
# [[light]]
# type = "point"                          # point | directional
# position = [0.0, 0.0, 10.0]             # directional: direction = [0.0, 0.0, -1.0], the way it travels
# falloff = "none"                        # none | inverse-square
# color = [1.0, 1.0, 1.0]                 # linear RGB
# intensity = 1.0                         # factor on the colour
"#;

/// Every key outside lists.
fn known_keys() -> Vec<String> {
    Manifest::new("").entries().keys()
}

/// Problems that are told at once.
const MOST_TOLD: usize = 50;

/// In the order of the file; options come first, as what is asked for last.
fn told(mut problems: Vec<Problem>, text: &str, path: &Path) -> ManifestError {
    problems.sort_by_key(|p| match p.place {
        Place::Option(_) => 0,
        Place::Byte(at) => at + 1,
        Place::Nowhere => usize::MAX,
    });
    let told = |problem: &Problem| {
        let place = match &problem.place {
            Place::Option(shown) => shown.clone(),
            Place::Nowhere => path.display().to_string(),
            Place::Byte(at) => {
                let before = text.get(..*at).unwrap_or(text);
                let line = before.matches('\n').count() + 1;
                let column = before.rsplit('\n').next().map_or(0, |l| l.chars().count()) + 1;
                format!("{}: line {line}, column {column}", path.display())
            }
        };
        if problem.key.is_empty() {
            format!("{place}: {}", problem.what)
        } else {
            format!("{place}: {}: {}", problem.key, problem.what)
        }
    };
    // Work grows with the text alone, however much is wrong with it.
    let mut lines: Vec<String> = problems.iter().take(MOST_TOLD).map(told).collect();
    if problems.len() > MOST_TOLD {
        lines.push(format!("{}: and more like these", path.display()));
    }
    ManifestError { lines }
}
