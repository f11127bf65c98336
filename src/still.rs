//! Renders particles in memory to single pictures in memory: no job, and no files except those that the settings name.
//! The bytes are those that the command `spherule still` writes for a file with the same particles.

use std::path::{Path, PathBuf};

use spherule_formats::{Attribute, PositionSlice, RawParticles};
use spherule_jobs::{Panic, catch_panic};

use crate::defaults::{Files, rules};
use crate::job::{RunError, SceneFiles};
use crate::manifest::{Manifest, ManifestError, ManifestSource, Override};
use crate::output::{OutputError, SrgbPixels};
use crate::pipeline::{ImageError, ImageTask, Setup, TracedFrame, trace_particles};
use crate::render::{Film, RenderError, Stop};
use crate::resolve::{Inquiry, ResolveError};
use crate::scene::{Camera, CameraView, Projection};
use crate::survey::{Facts, Survey};

/// The name of particles without a file, in messages and overlays.
const MEMORY: &str = "memory";

/// The settings of pictures of particles in memory.
#[derive(Debug, Clone)]
pub struct StillSettings {
    /// The manifest. Its input is not read.
    pub manifest: Manifest,
    /// The directory that its paths are relative to; empty for the current directory.
    pub base: PathBuf,
    /// Number of the frame, for cameras that move and for names with numbers.
    pub frame: i64,
    /// The name of the particles, in messages and overlays.
    pub name: String,
    /// What the manifest was read from, if it is to be completed with defaults that follow from the particles, as on the
    /// command line.
    pub source: Option<ManifestSource>,
}

impl Default for StillSettings {
    fn default() -> Self {
        Self::new(Manifest::new(MEMORY))
    }
}

impl StillSettings {
    /// The pictures of `manifest`.
    pub fn new(manifest: Manifest) -> Self {
        Self { manifest, base: PathBuf::new(), frame: 0, name: MEMORY.to_owned(), source: None }
    }

    /// Reads a manifest in TOML, without `input.path`. See [the manual](Manifest) for its keys.
    ///
    /// # Errors
    /// It is not TOML, or has unknown keys or invalid values.
    ///
    /// # Panics
    /// Never: the key of the input is valid.
    pub fn parse(toml: &str) -> Result<Self, ManifestError> {
        let input = Override::new("input.path", MEMORY, MEMORY).expect("the key is valid");
        Self::of_source(ManifestSource::new(toml, Path::new("settings"), vec![input]))
    }

    /// The pictures of a manifest, completed with defaults that follow from the particles.
    ///
    /// # Errors
    /// The manifest has unknown keys or invalid values.
    pub fn of_source(source: ManifestSource) -> Result<Self, ManifestError> {
        let (manifest, _) = source.parse()?;
        Ok(Self { source: Some(source), ..Self::new(manifest) })
    }

    /// The manifest with the defaults that follow from `particles`, and a line for each rule that has something to say.
    fn completed(&self, particles: &Particles<'_>) -> Result<(Manifest, Vec<String>), RunError> {
        let Some(source) = &self.source else {
            return Ok((self.manifest.clone(), Vec::new()));
        };
        let facts = Facts::of_particles(&self.name, particles)?;
        let found = rules(&self.manifest, source, &facts, Files::default());
        Ok((source.parse_over(found.settings)?, found.lines))
    }
}

/// Particles in memory: positions that may belong to a caller, in world units, and attributes.
pub type Particles<'a> = RawParticles<PositionSlice<'a>>;

/// Particles without attributes.
pub fn particles(positions: PositionSlice<'_>) -> Particles<'_> {
    RawParticles { positions, ..RawParticles::default() }
}

/// A scalar attribute, such as `radius`.
pub fn scalar(name: impl Into<String>, values: Vec<f32>) -> Attribute {
    Attribute {
        name: name.into(),
        components: 1,
        data: spherule_formats::AttributeData::F32(values),
    }
}

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum StillError {
    /// The settings and the particles do not go together, or a file that they name cannot be read.
    #[error(transparent)]
    Setup(#[from] RunError),
    /// The picture cannot be rendered.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// A bug.
    #[error(transparent)]
    Panic(#[from] Panic),
}

impl StillError {
    /// Whether rendering was stopped.
    pub fn is_interrupted(&self) -> bool {
        use crate::pipeline::TraceError::Render;
        matches!(self, Self::Image(ImageError::Trace(Render(RenderError::Interrupted))))
    }
}

/// A picture in memory.
#[derive(Debug)]
pub struct StillImage {
    setup: Setup,
    survey: Survey,
    frame: TracedFrame,
    notes: Vec<String>,
}

/// Renders `particles`, on the threads of the current pool. Positions that are in single precision, near zero and
/// finite are not copied; the tree takes 18 bytes per particle for 1e7 of them, and more for fewer.
///
/// # Errors
/// See [`StillError`]; [`StillError::is_interrupted`] if `stop` is raised.
pub fn render(
    settings: &StillSettings,
    particles: Particles<'_>,
    stop: &dyn Stop,
) -> Result<StillImage, StillError> {
    let StillSettings { base, frame, name, .. } = settings;
    let (manifest, lines) = settings.completed(&particles)?;
    let manifest = &manifest;
    if !manifest.cell.images().is_none() {
        let what =
            "particles in memory are neither copied nor wrapped; do so before they are rendered";
        return Err(StillError::Setup(RunError::from(ResolveError::Unsupported {
            key: "cell.replicate, cell.wrap, cell.unwrap",
            what: what.to_owned(),
        })));
    }
    let base = std::path::absolute(Path::new(".").join(base))
        .map_err(RunError::file(Path::new("."), "cannot be found"))?;
    let files = SceneFiles::new(base);
    // Determine the automatic settings
    let (survey, setup) = catch_panic(|| -> Result<_, StillError> {
        let inquiry = Inquiry::of(manifest);
        let styles = inquiry.styles();
        let question = inquiry.question(styles.as_ref());
        let survey = Survey::of_particles(name, &particles, question).map_err(RunError::from)?;
        let setup = files.setup(manifest, &survey, std::iter::once(*frame))?;
        Ok((survey, setup))
    })?;
    let mut notes = lines;
    notes.extend(files.notes(manifest)?);
    // Render
    let task = ImageTask {
        frame: *frame,
        index: 0,
        image: PathBuf::new(),
        preview: None,
        meshes: files.frame_meshes(manifest, *frame),
        next_meshes: None,
        refused: None,
    };
    let traced = trace_particles(&setup, particles, name, &task, stop, |note| {
        notes.push(note);
    })?;
    Ok(StillImage { setup, survey, frame: traced, notes })
}

impl StillImage {
    /// The planes.
    pub const fn film(&self) -> &Film {
        &self.frame.film
    }

    /// The view and the projection of the picture, from which another one can be made.
    pub fn view(&self) -> (CameraView, Projection) {
        let picture = &self.setup.picture;
        (picture.view.path.view(self.frame.task.frame), picture.view.projection)
    }

    /// The camera.
    pub const fn camera(&self) -> &Camera {
        &self.frame.camera
    }

    /// The values of automatic settings.
    pub const fn survey(&self) -> &Survey {
        &self.survey
    }

    /// The settings of the picture, with all automatic values.
    pub const fn setup(&self) -> &Setup {
        &self.setup
    }

    /// The picture with its report.
    pub const fn traced(&self) -> &TracedFrame {
        &self.frame
    }

    /// Notes for the user: what was left out or changed.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The picture as an OpenEXR file.
    ///
    /// # Errors
    /// The encoder fails.
    pub fn to_exr(&self) -> Result<Vec<u8>, OutputError> {
        self.frame.to_exr(&self.setup)
    }

    /// The picture as a PNG file.
    ///
    /// # Errors
    /// The encoder fails.
    pub fn to_png(&self) -> Result<Vec<u8>, OutputError> {
        self.frame.to_png(&self.setup)
    }

    /// The pixels of the PNG file.
    ///
    /// # Errors
    /// The encoder fails.
    pub fn to_srgb(&self) -> Result<SrgbPixels, OutputError> {
        // Whatever viewers of the file show
        SrgbPixels::decode(&self.to_png()?)
    }
}
