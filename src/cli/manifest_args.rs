//! Makes a manifest and its sequence from command-line arguments.

use std::path::{Path, PathBuf};

use clap::Args;
use spherule_formats::Sequence;
use spherule_formats::sequence::SequenceError;
use spherule_jobs::{PLAN_FILE, ResumeMode};

use super::CliError;
use super::camera_path::camera_keys;
use super::key_flags::{KeyFlags, KnownWords, over};
use super::numbers::number;
use super::paths::{path_as_typed, text};
use super::shortcuts::Shortcuts;
use crate::job::{JobManifest, RunError};
use crate::manifest::{self, Manifest, ManifestSource, MapName, Override, ScaleKind, draft};
use crate::pipeline::gpu;

/// Options that set keys of the manifest: `--set` for any key, and options for common keys.
#[derive(Debug, Args)]
pub(super) struct ManifestArgs {
    /// A directory, a pattern (dump.#.vtk, frame_%04d.bgeo, *), files, or a manifest (.toml).
    #[arg(required = true)]
    pub(super) input: Vec<PathBuf>,

    #[command(flatten)]
    pub(super) keys: KeyFlags,

    /// Quick preview: 4 samples per pixel, ambient light instead of light between surfaces
    ///
    /// Sets image.samples = 4, render.noise = "off", render.indirect = "ambient" and render.denoise = "auto", whatever the
    /// manifest says;
    /// other options override them.
    #[arg(long, help_heading = "Look", display_order = 0)]
    pub(super) draft: bool,
    /// Attribute to colour by [default: velocity, else the particles' own colours]
    ///
    /// Colours (Cd, color, rgb, bytes) are used unchanged unless --map, --range or --color-scale is given. Vectors are
    /// mapped by their length; velocity.x is a component. x, y, z, height, depth, index and radius need no attribute;
    /// speed, vx, vy and vz are those of the velocity. The word elements stands for the usual colours of chemical elements.
    #[arg(
        long,
        alias = "colour-by",
        conflicts_with = "color",
        value_name = "ATTRIBUTE",
        help_heading = "Look",
        display_order = 0
    )]
    pub(super) color_by: Option<String>,
    /// Colour map of the attribute [default: viridis]
    ///
    /// viridis, turbo, plasma, inferno, magma, cividis, batlow, vik, greys and others, which the manual lists. A name
    /// with _r is the reversed map.
    #[arg(long, visible_alias = "cmap", aliases = ["colormap", "colourmap", "color-map", "colour-map"],
        value_name = "NAME", help_heading = "Look", display_order = 0, value_parser = KnownWords(MapName::all()),
        hide_possible_values = true)]
    pub(super) map: Option<String>,
    /// Values at the ends of the colour map [default: the range of the sequence]
    #[arg(long, num_args = 2, value_names = ["LOW", "HIGH"], allow_negative_numbers = true, value_parser = number,
        help_heading = "Look", display_order = 0)]
    pub(super) range: Option<Vec<f64>>,
    /// Scale of the colour map: linear, log, symlog or categorical [default: linear]
    #[arg(long, alias = "colour-scale", value_name = "SCALE", help_heading = "Look", display_order = 0,
        value_parser = KnownWords(ScaleKind::all()), hide_possible_values = true)]
    pub(super) color_scale: Option<String>,
    /// Turn around one frame, the middle one, in so many pictures
    ///
    /// Sets input.repeat, camera.mode = "turntable" and camera.degrees_per_frame = 360 / PICTURES. A still shows the first
    /// of them.
    #[arg(long, value_name = "PICTURES", value_parser = clap::value_parser!(u32).range(1..=100_000),
        help_heading = "Camera", display_order = 0)]
    pub(super) turntable: Option<u32>,
    #[command(flatten)]
    shortcuts: Shortcuts,
    /// Triangle mesh next to the particles, such as a tank: STL, OBJ, PLY, VTK. May be repeated.
    ///
    /// A name with #### or %04d for the frame number is one mesh per frame. [[mesh]] in a manifest has more settings:
    /// material, colour, unit.
    #[arg(long, value_name = "FILE", help_heading = "Input", display_order = 0)]
    pub(super) mesh: Vec<PathBuf>,
    /// JSON file with keyframes of the camera: a list of objects with frame, eye, look_at, and up and fov if needed
    ///
    /// They replace [[camera.key]]. The job keeps them; later changes of the file have no effect on it.
    #[arg(long, value_name = "FILE", help_heading = "Camera", display_order = 0)]
    pub(super) camera_path: Option<PathBuf>,
    /// The GPU to render on, by its number in `spherule devices` [default: the first one]
    ///
    /// It needs --device gpu. Each worker of a job may have another GPU.
    #[arg(long, value_name = "NUMBER", help_heading = "Job", display_order = 0)]
    pub(super) gpu: Option<usize>,
    /// Any key of the manifest: --set render.ground_pattern=checker. May be repeated.
    ///
    /// `spherule init` prints all keys with their meaning.
    #[arg(long, value_name = "KEY=VALUE", help_heading = "Job", display_order = 0)]
    pub(super) set: Vec<String>,
}

impl ManifestArgs {
    /// Reads the manifest, or makes one from the arguments.
    pub(super) fn manifest(&self) -> Result<JobManifest, CliError> {
        if let Some(number) = self.gpu {
            gpu::choose(number);
        }
        let mut overrides = Vec::new();
        // Read the manifest, or start from the input
        let file = self.manifest_file()?;
        let (text, base) = match &file {
            Some(path) => {
                let text = read_manifest(path)?;
                (text, path.parent().map_or_else(PathBuf::new, Path::to_owned))
            }
            None => {
                overrides.push(self.input_override()?);
                (String::new(), PathBuf::new())
            }
        };
        // Apply the options over it
        self.add_overrides(&mut overrides, file.is_some())?;
        let shown = file.clone().unwrap_or_else(|| PathBuf::from("command line"));
        let source = ManifestSource::new(text.clone(), &shown, overrides);
        let (manifest, warnings) = source.parse()?;
        for warning in warnings {
            note!("{warning}");
        }
        // Keep the manifest without options, which the job file has
        let unchanged = file.as_ref().and_then(|path| Manifest::parse(&text, path).ok());
        Ok(JobManifest { manifest, base, file, unchanged, source: Some(source) })
    }

    fn manifest_file(&self) -> Result<Option<PathBuf>, CliError> {
        match self.input.iter().find(|path| is_manifest(path)) {
            None => Ok(None),
            Some(path) if self.input.len() == 1 => Ok(Some(path.clone())),
            Some(path) => Err(CliError::other(format!(
                "{}: a manifest must be the only input; its input.path names the particles",
                path.display()
            ))),
        }
    }

    fn input_override(&self) -> Result<Override, CliError> {
        let paths = self.input.iter().map(|p| text(p)).collect::<Result<Vec<_>, _>>()?;
        let value = match <[String; 1]>::try_from(paths) {
            Ok([one]) => toml::Value::from(one),
            Err(many) => toml::Value::from(many),
        };
        over("input.path", value, "INPUT")
    }

    /// Adds the options for colours.
    fn add_colors(&self, list: &mut Vec<Override>) -> Result<(), CliError> {
        if let Some(attribute) = &self.color_by {
            let mut table = toml::Table::new();
            table.insert("attribute".to_owned(), attribute.clone().into());
            let value = match attribute.as_str() {
                "elements" => attribute.clone().into(),
                _ => toml::Value::Table(table),
            };
            list.push(over("material.color", value, "--color-by")?);
        }
        if let Some(map) = &self.map {
            list.push(over("material.color.map", map.clone(), "--map")?);
        }
        if let Some(range) = &self.range {
            list.push(over("material.color.range", range.clone(), "--range")?);
        }
        if let Some(scale) = &self.color_scale {
            let value = scale.clone();
            list.push(over("material.color.scale", value, "--color-scale")?);
        }
        Ok(())
    }

    fn add_overrides(&self, list: &mut Vec<Override>, from_file: bool) -> Result<(), CliError> {
        // Presets first, so that other options replace their values
        if self.draft {
            list.extend(draft("--draft"));
        }
        self.keys.add_overrides(list, from_file)?;
        self.add_colors(list)?;
        // Add options for the camera
        if let Some(count) = self.turntable {
            let shown = format!("--turntable {count}");
            list.push(over("input.repeat", i64::from(count), &shown)?);
            list.push(over("camera.mode", "turntable", &shown)?);
            let each = 360.0 / f64::from(count);
            list.push(over("camera.degrees_per_frame", each, &shown)?);
        }
        self.shortcuts.add_overrides(list, from_file)?;
        if let Some(path) = &self.camera_path {
            let keys = camera_keys(path)?;
            let shown = format!("--camera-path {}", path.display());
            list.push(over("camera.key", keys, &shown)?);
        }
        // Add meshes, behind those of the manifest
        for mesh in &self.mesh {
            let mut table = toml::Table::new();
            let path = path_as_typed(&text(mesh)?, from_file)?;
            table.insert("path".to_owned(), path.into());
            let append = Override::append("mesh", table, "--mesh");
            list.push(append.map_err(|e| CliError::other(e.to_string()))?);
        }
        // Assignments last: they replace everything else
        for assignment in &self.set {
            list.push(Override::parse(assignment).map_err(|e| CliError::other(e.to_string()))?);
        }
        Ok(())
    }
}

/// Reads the text of the manifest `path`.
pub(super) fn read_manifest(path: &Path) -> Result<String, CliError> {
    manifest::read_manifest(path).map_err(CliError::io(path))
}

/// Finds the frames of the input of `requested`. Paths from a manifest are reported with its name.
pub(super) fn open_sequence(requested: &JobManifest) -> Result<Sequence, CliError> {
    requested.open_sequence().map_err(|error| {
        let (Some(file), RunError::Sequence(SequenceError::Missing { .. })) =
            (&requested.file, &error)
        else {
            return error.into();
        };
        let mut text = format!("{}: input.path: {error}", file.display());
        let output = requested.base.join(requested.manifest.output.path.dir());
        if output.join(PLAN_FILE).is_file() {
            let output = requested.base.join(requested.manifest.output.path.to_string());
            text += &format!(
                "; if the files have moved: spherule render NEW_PLACE -o {}",
                output.display()
            );
        }
        CliError::other(text)
    })
}

/// Completes `requested` with the defaults that follow from the particles, and says which; see [`JobManifest::complete`].
pub(super) fn complete(
    requested: &mut JobManifest,
    sequence: &mut Sequence,
    mode: Option<ResumeMode>,
) -> Result<(), CliError> {
    for line in requested.complete(sequence, mode)? {
        message!("{line}");
    }
    Ok(())
}

/// Whether the file name is that of a manifest.
pub(super) fn is_manifest(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"))
}
