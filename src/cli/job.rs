//! From arguments to a manifest and its sequence: what `render` and `init` share.

use std::env;
use std::io;
use std::panic;
use std::path::{Path, PathBuf};
use std::thread;

use clap::Args;
use spherule_formats::sequence::{Sequence, SequenceError, SequenceInput};

use super::CliError;
use super::job_args::JobArgs;
use super::numbers::{number, pixels, whole};
use crate::manifest::{self, Look, Manifest, Override};
use crate::metrics::Bytes;
use crate::reading::read_budget;

/// What can be said on the command line about the pictures. Every key of the manifest has
/// `--set`; the usual ones have a flag.
#[derive(Debug, Args)]
pub(super) struct ManifestArgs {
    /// A directory, a pattern (dump.#.vtk, frame_%04d.bgeo, *), files, or a manifest (.toml).
    #[arg(required = true)]
    pub(super) input: Vec<PathBuf>,

    /// Frames to render: 7 | 1-10 | 1-10x2 | 1-5,8 [default: all]
    #[arg(
        long,
        value_name = "RANGE",
        allow_hyphen_values = true,
        help_heading = "Input"
    )]
    pub(super) frames: Option<String>,
    /// Particle radius: a length, or auto [default: auto]
    ///
    /// `auto` takes the radius of the files, else half the usual distance of neighbours.
    #[arg(long, allow_negative_numbers = true, help_heading = "Input")]
    pub(super) radius: Option<String>,
    /// Parts of a step to keep where it has several files: fluid,oil.
    ///
    /// Case does not matter, and part of a name will do.
    #[arg(
        long,
        value_delimiter = ',',
        value_name = "LIST",
        help_heading = "Input"
    )]
    pub(super) parts: Option<Vec<String>>,
    /// Read native frames instead of mapping them.
    ///
    /// For places where files may be cut short while they are used.
    #[arg(long, help_heading = "Input")]
    pub(super) no_mmap: bool,

    /// Axis that points up: x, y, z, -x, -y, -z, or auto [default: auto]
    ///
    /// `auto` is y for BGEO files and those of SPlisHSPlasH, else z. Everything else about the camera is set by
    /// --set: camera.eye, camera.look_at, camera.fov, camera.mode.
    #[arg(long, allow_hyphen_values = true, help_heading = "Camera")]
    pub(super) up: Option<String>,

    /// Image width in pixels [default: 1920]
    #[arg(long, allow_negative_numbers = true, value_parser = pixels, help_heading = "Image")]
    pub(super) width: Option<i64>,
    /// Image height in pixels [default: 1080]
    #[arg(long, allow_negative_numbers = true, value_parser = pixels, help_heading = "Image")]
    pub(super) height: Option<i64>,
    /// Samples per pixel [default: 16]
    #[arg(long, allow_negative_numbers = true, value_parser = whole, help_heading = "Image")]
    pub(super) samples: Option<i64>,

    /// A look, for everything that is not set otherwise: water.
    #[arg(long, value_name = "NAME", help_heading = "Look")]
    pub(super) look: Option<String>,
    /// Attribute to colour by [default: velocity, else the particles' own colours]
    ///
    /// Colours (Cd, color, rgb, bytes) are taken as they are unless --map or --range is given; vectors count by
    /// their length.
    #[arg(long, value_name = "ATTRIBUTE", help_heading = "Look")]
    pub(super) color_by: Option<String>,
    /// Colour map of the attribute [default: viridis]
    ///
    /// viridis, turbo, plasma, inferno, magma, cividis, red-blue or greys.
    #[arg(long, value_name = "NAME", help_heading = "Look")]
    pub(super) map: Option<String>,
    /// Values at the ends of the colour map [default: what the sequence has]
    #[arg(long, num_args = 2, value_names = ["LOW", "HIGH"], allow_negative_numbers = true, value_parser = number,
        help_heading = "Look")]
    pub(super) range: Option<Vec<f64>>,
    /// What rays meet: spheres, medium or smooth [default: spheres]
    ///
    /// medium: overlapping spheres as one body; smooth: the surface of the SPH field.
    #[arg(long, value_name = "NAME", help_heading = "Look")]
    pub(super) surface: Option<String>,
    /// How much a smooth surface is smoothed, 0 to 1 [default: 0.75]
    ///
    /// 0: every particle shows; 1: calm water.
    #[arg(long, value_name = "NUMBER", allow_negative_numbers = true, value_parser = number, help_heading = "Look")]
    pub(super) smoothing: Option<f64>,
    /// The exact surface of the SPH field, without smoothing.
    #[arg(long, help_heading = "Look")]
    pub(super) exact_surface: bool,
    /// Particles with few neighbours are small white spheres beside the surface.
    #[arg(long, help_heading = "Look")]
    pub(super) spray: bool,
    /// A ground plane under the particles.
    #[arg(long, help_heading = "Look")]
    pub(super) ground: bool,
    /// Reflections and refractions followed; 1 is direct light only [default: 3]
    #[arg(long, allow_negative_numbers = true, value_parser = whole, help_heading = "Look")]
    pub(super) max_depth: Option<i64>,

    /// Images to write [default: out/frame.####.exr]
    ///
    /// #### or %04d is the frame number, with as many digits at least.
    #[arg(short, long, value_name = "PATTERN", help_heading = "Output")]
    pub(super) output: Option<String>,
    /// Channels of the images: RGBA,Z,N,id,P,V,albedo [default: RGBA,Z,N,id]
    #[arg(
        long,
        value_delimiter = ',',
        value_name = "LIST",
        help_heading = "Output"
    )]
    pub(super) channels: Option<Vec<String>>,

    /// Any key of the manifest: --set render.ground_pattern=checker. May be repeated.
    ///
    /// `spherule init` prints all keys with what they mean.
    #[arg(long, value_name = "KEY=VALUE", help_heading = "Job")]
    pub(super) set: Vec<String>,
    /// Acceleration structure: auto, lbvh, kdtree, bvh or sbvh [default: auto]
    ///
    /// lbvh is the fastest to build, kdtree the fastest to trace. The picture is the same; auto goes by the rays for
    /// each particle.
    #[arg(long, value_name = "NAME", help_heading = "Job")]
    pub(super) accelerator: Option<String>,
    /// Most memory to take: 4GiB, 512MiB [default: what is free]
    ///
    /// Frames that need more fail, the rest goes on.
    #[arg(
        long,
        value_name = "SIZE",
        allow_hyphen_values = true,
        help_heading = "Job"
    )]
    pub(super) memory_limit: Option<String>,
    #[command(flatten)]
    pub(super) job: JobArgs,
}

/// A manifest as asked for, and where its paths begin.
#[derive(Clone)]
pub(super) struct Asked {
    /// With all options laid over it.
    pub(super) manifest: Manifest,
    /// The directory that its paths are relative to; empty for the current one.
    pub(super) base: PathBuf,
    /// The manifest's own file, if there is one.
    pub(super) file: Option<PathBuf>,
    /// What that file says without the options, if it can stand alone.
    pub(super) unchanged: Option<Manifest>,
}

impl ManifestArgs {
    /// Reads the manifest, or makes one of the arguments.
    pub(super) fn manifest(&self) -> Result<Asked, CliError> {
        let mut overrides = Vec::new();
        let file = self.manifest_file()?;
        let (text, base) = match &file {
            Some(path) => {
                let text = read_manifest(path)?;
                (
                    text,
                    path.parent().map_or_else(PathBuf::new, Path::to_owned),
                )
            }
            None => {
                overrides.push(self.input_override()?);
                (String::new(), PathBuf::new())
            }
        };
        self.add_overrides(&mut overrides, file.is_some())?;
        let shown = file
            .clone()
            .unwrap_or_else(|| PathBuf::from("command line"));
        let manifest = Manifest::parse_with(&text, &shown, overrides)?;
        let unchanged = file
            .as_ref()
            .and_then(|path| Manifest::parse(&text, path).ok());
        Ok(Asked {
            manifest,
            base,
            file,
            unchanged,
        })
    }

    fn manifest_file(&self) -> Result<Option<PathBuf>, CliError> {
        match self.input.iter().find(|path| is_manifest(path)) {
            None => Ok(None),
            Some(path) if self.input.len() == 1 => Ok(Some(path.clone())),
            Some(path) => Err(CliError::other(format!(
                "{}: a manifest stands alone; its input.path names the particles",
                path.display()
            ))),
        }
    }

    fn input_override(&self) -> Result<Override, CliError> {
        let paths = self
            .input
            .iter()
            .map(|p| text(p))
            .collect::<Result<Vec<_>, _>>()?;
        let value = match <[String; 1]>::try_from(paths) {
            Ok([one]) => toml::Value::from(one),
            Err(many) => toml::Value::from(many),
        };
        over("input.path", value, "INPUT")
    }

    fn add_overrides(&self, list: &mut Vec<Override>, from_file: bool) -> Result<(), CliError> {
        if let Some(output) = &self.output {
            let path = path_as_typed(output, from_file)?;
            list.push(over("output.path", path, "--output")?);
        }
        if let Some(frames) = &self.frames {
            list.push(over("input.frames", frames.clone(), "--frames")?);
        }
        for (key, value, shown) in [
            ("image.width", self.width, "--width"),
            ("image.height", self.height, "--height"),
            ("image.samples", self.samples, "--samples"),
            ("render.max_depth", self.max_depth, "--max-depth"),
        ] {
            if let Some(value) = value {
                list.push(over(key, value, shown)?);
            }
        }
        for (key, value, shown) in [
            ("input.up", &self.up, "--up"),
            ("render.accelerator", &self.accelerator, "--accelerator"),
            ("render.surface", &self.surface, "--surface"),
        ] {
            if let Some(value) = value {
                list.push(over(key, value.clone(), shown)?);
            }
        }
        if let Some(limit) = &self.memory_limit {
            list.push(over(
                "render.memory_limit",
                limit.clone(),
                "--memory-limit",
            )?);
        }
        if let Some(radius) = &self.radius {
            let value = radius.parse().map_or_else(
                |_| toml::Value::from(radius.clone()),
                |number: f64| toml::Value::from(number),
            );
            list.push(over("input.radius", value, "--radius")?);
        }
        if let Some(attribute) = &self.color_by {
            let mut table = toml::Table::new();
            table.insert("attribute".to_owned(), attribute.clone().into());
            list.push(over("material.color", table, "--color-by")?);
        }
        if let Some(map) = &self.map {
            list.push(over("material.color.map", map.clone(), "--map")?);
        }
        if let Some(range) = &self.range {
            list.push(over("material.color.range", range.clone(), "--range")?);
        }
        for (key, value, shown) in [
            ("output.channels", &self.channels, "--channels"),
            ("input.parts", &self.parts, "--parts"),
        ] {
            if let Some(value) = value {
                list.push(over(key, value.clone(), shown)?);
            }
        }
        if let Some(smoothing) = self.smoothing {
            list.push(over("surface.smoothing", smoothing, "--smoothing")?);
        }
        for (asked, key, value, shown) in [
            (self.ground, "render.ground", true, "--ground"),
            (self.exact_surface, "surface.exact", true, "--exact-surface"),
            (self.spray, "surface.spray", true, "--spray"),
            (self.no_mmap, "input.mmap", false, "--no-mmap"),
        ] {
            if asked {
                list.push(over(key, value, shown)?);
            }
        }
        if let Some(look) = &self.look {
            list.extend(Look::named(look).map_err(CliError::Other)?.settings());
        }
        self.job.add_overrides(list, from_file)?;
        for assignment in &self.set {
            list.push(Override::parse(assignment).map_err(CliError::Other)?);
        }
        Ok(())
    }
}

impl Asked {
    /// Finds the frames.
    pub(super) fn sequence(&self) -> Result<Sequence, CliError> {
        let input = &self.manifest.input;
        let paths = input.path.iter().map(|p| self.base.join(p)).collect();
        let limit = |size: &Option<Bytes>| size.as_ref().map(|size| size.0);
        let limits = &self.manifest;
        let budget = read_budget(
            limit(&limits.render.memory_limit),
            limit(&limits.job.memory_ceiling),
        );
        let paths = SequenceInput::from_paths(paths);
        let mut sequence = apart(|| Sequence::open_within(&paths, budget))?;
        if let Some(parts) = &input.parts {
            sequence.keep_parts(parts)?;
        }
        Ok(sequence)
    }

    /// The directory that paths begin at, absolute.
    pub(super) fn absolute_base(&self) -> Result<PathBuf, CliError> {
        absolute(&self.base)
    }
}

/// The text of the manifest `path`.
pub(super) fn read_manifest(path: &Path) -> Result<String, CliError> {
    manifest::read_manifest(path).map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => SequenceError::missing(path).into(),
        _ => CliError::io(path)(error),
    })
}

/// Whether the name is that of a manifest.
pub(super) fn is_manifest(path: &Path) -> bool {
    path.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("toml"))
}

/// Does `work` in a thread of its own. Allocators keep what a thread has freed for the next thread
/// that comes: that will be the one that reads frames, and needs as much. Freed by the main thread,
/// it would lie there unused.
pub(super) fn apart<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    thread::scope(|scope| {
        let worker = scope.spawn(work);
        worker
            .join()
            .unwrap_or_else(|fault| panic::resume_unwind(fault))
    })
}

/// As typed, `path` is relative to here; laid over a manifest from a file it would be relative to that.
pub(super) fn path_as_typed(path: &str, from_file: bool) -> Result<String, CliError> {
    if from_file {
        text(&absolute(Path::new(path))?)
    } else {
        Ok(path.to_owned())
    }
}

pub(super) fn over(
    key: &str,
    value: impl Into<toml::Value>,
    shown: &str,
) -> Result<Override, CliError> {
    Override::new(key, value, shown).map_err(CliError::Other)
}

/// `path` from the root, without looking at what is there.
pub(super) fn absolute(path: &Path) -> Result<PathBuf, CliError> {
    if path.as_os_str().is_empty() {
        return env::current_dir().map_err(CliError::io(Path::new(".")));
    }
    std::path::absolute(path).map_err(CliError::io(path))
}

fn text(path: &Path) -> Result<String, CliError> {
    let text = path.to_str().map(str::to_owned);
    text.ok_or_else(|| CliError::other(format!("{}: the path is not UTF-8", path.display())))
}
