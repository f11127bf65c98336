//! The frame that is shown, with everything that pictures of it need. What a change of settings does not touch is kept:
//! the files of the sequence, what was found in them, pictures and meshes that the settings name, and the tree.

use std::path::{Path, PathBuf};
use std::time::Instant;

use spherule_formats::{RawParticles, Sequence};
use spherule_jobs::catch_panic;

use super::encode::{self, Encoded};
use super::error::{ExploreError, MAX_SETTINGS, MAX_VALUES};
use super::level::Level;
use super::thin::{self, Reading};
use super::wish::{Setting, overrides};
use crate::job::{Findings, JobManifest, RenderJob, RunError, require_one_fits};
use crate::manifest::{Manifest, ManifestSource};
use crate::output::PictureFormat;
use crate::pipeline::{
    BuiltFrame, ColorRule, FrameRenderer, Setup, load_frame, make_image, renderer_of,
};
use crate::render::{Channels, DataWindow, FilmPlane, RendererKind, Stop};
use crate::survey::Survey;

/// Number of photons in pictures that are not the last one: enough to see where caustics are.
const DRAFT_PHOTONS: u32 = 50_000;

/// Beginnings of keys that need no other particles and no other tree.
const SHADING_KEYS: [&str; 29] = [
    "camera.",
    "image.",
    "output.",
    "environment.",
    "light.",
    "overlay.",
    "material.absorption",
    "material.ambient",
    "material.anisotropy",
    "material.color",
    "material.diffuse",
    "material.ior",
    "material.reflection",
    "material.roughness",
    "material.scattering",
    "material.shininess",
    "material.specular",
    "mist.",
    "render.background",
    "render.bounces",
    "render.clamp",
    "render.denoise",
    "render.depth_cue",
    "render.ground",
    "render.haze",
    "render.max_depth",
    "render.noise",
    "render.outline",
    "render.seed",
];

/// Keys with these beginnings that change more than shading.
const OTHER_KEYS: [&str; 2] = ["camera.shutter", "camera.focus"];

/// See the module.
pub(super) struct Stage {
    /// The manifest as the command was given.
    requested: JobManifest,
    sequence: Sequence,
    /// The settings that the sequence was opened with.
    opened_for: Vec<(String, String)>,
    /// The parts that are kept, if some are left out.
    parts: Option<Vec<String>>,
    findings: Findings,
    thinning: Thinning,
    prepared: Option<Prepared>,
    built: Option<Built>,
    /// The particles of a frame as they are in its files, if they were asked for.
    particles: Option<(usize, RawParticles)>,
}

/// A job with all its settings.
pub(super) struct Prepared {
    /// The settings that were chosen.
    chosen: Vec<Setting>,
    job: RenderJob,
    pub(super) source: ManifestSource,
    pub(super) survey: Survey,
    /// The channels of the job.
    channels: Channels,
    /// That of pictures for pages, which have other channels than those of the job.
    pub(super) setup: Setup,
    /// What the rules for defaults and the files say.
    pub(super) lines: Vec<String>,
}

/// What follows from settings and particles.
struct Resolved {
    job: RenderJob,
    survey: Survey,
    setup: Setup,
    lines: Vec<String>,
}

/// Which of the particles are surveyed.
struct Thinning {
    /// One of so many.
    every: u32,
    /// The settings that it was chosen for.
    data: Vec<Setting>,
}

impl Default for Thinning {
    fn default() -> Self {
        Self { every: 1, data: Vec::new() }
    }
}

/// A frame in a renderer.
struct Built {
    /// What it was built for.
    key: String,
    renderer: Box<dyn FrameRenderer>,
    frame: BuiltFrame,
    /// Of so many particles it has one.
    every: u32,
    notes: Vec<String>,
}

/// A picture, and what is under its pixels.
pub(super) struct StagePicture {
    pub(super) encoded: Encoded,
    pub(super) under: Under,
    pub(super) particles: u64,
    /// Of so many particles of the frame it shows one.
    pub(super) every: u32,
    pub(super) time: Option<f64>,
    /// Seconds from the particles in memory to the file.
    pub(super) seconds: f64,
    pub(super) notes: Vec<String>,
}

/// The particle and the point at each pixel of a picture.
#[derive(Debug, Default)]
pub(super) struct Under {
    pub(super) size: [u32; 2],
    pub(super) ids: Vec<u32>,
    pub(super) points: Vec<[f32; 3]>,
}

impl Stage {
    pub(super) fn new(requested: JobManifest, sequence: Sequence) -> Self {
        Self {
            opened_for: sequence_settings(&requested.manifest),
            requested,
            sequence,
            parts: None,
            findings: Findings::default(),
            thinning: Thinning::default(),
            prepared: None,
            built: None,
            particles: None,
        }
    }

    /// The job with these settings.
    pub(super) fn prepare(&mut self, settings: &[Setting]) -> Result<&Prepared, ExploreError> {
        if settings.len() > MAX_SETTINGS {
            return Err(ExploreError::TooMany);
        }
        let is_known = self.prepared.as_ref().is_some_and(|known| known.chosen == settings);
        if !is_known {
            let prepared = self.prepare_again(settings)?;
            self.prepared = Some(prepared);
        }
        Ok(self.prepared.as_ref().expect("it was prepared"))
    }

    fn prepare_again(&mut self, settings: &[Setting]) -> Result<Prepared, ExploreError> {
        // Read the manifest with the settings over it
        let given = self.requested.source.clone();
        let given = given.unwrap_or_else(|| {
            let text = self.requested.manifest.to_commented_toml();
            ManifestSource::new(text, Path::new("settings"), Vec::new())
        });
        let source = given.with(overrides(settings).map_err(ExploreError::Setting)?);
        let (manifest, warnings) = source.parse()?;
        let requested =
            JobManifest { manifest, source: Some(source.clone()), ..self.requested.clone() };
        // Open the sequence again if they choose other particles or places
        let opened_for = sequence_settings(&requested.manifest);
        if self.opened_for != opened_for {
            self.open(&requested)?;
            self.opened_for = opened_for;
        }
        // Survey every n-th particle if all of them need too much memory
        let data = data_settings(settings);
        if self.thinning.data != data {
            self.thin(Thinning { every: 1, data });
        }
        let resolved = match self.resolve(&requested) {
            Err(error) if error.is_too_large() => {
                let limit = requested.manifest.render.memory_limit;
                let every = thin::survey_every(&self.sequence, limit).ok_or(error)?;
                let data = std::mem::take(&mut self.thinning.data);
                self.thin(Thinning { every, data });
                self.resolve(&requested)?
            }
            resolved => resolved?,
        };
        let Resolved { job, survey, mut setup, mut lines } = resolved;
        lines.extend(warnings);
        let channels = setup.picture.render.channels;
        setup.picture.render.channels = Channels::COLOR.with(&[FilmPlane::Id, FilmPlane::Position]);
        let chosen = settings.to_vec();
        Ok(Prepared { chosen, job, source, survey, channels, setup, lines })
    }

    /// Surveys the sequence, and resolves the automatic settings.
    fn resolve(&mut self, requested: &JobManifest) -> Result<Resolved, ExploreError> {
        let mut requested = requested.clone();
        self.sequence.set_thinning(self.thinning.every);
        let completed = self.complete(&requested)?;
        let has_parts = self.parts.is_none() || completed.1.input.parts == self.parts;
        let (mut lines, manifest) = if has_parts {
            completed
        } else {
            // Parts that were left out before are needed
            self.open(&requested)?;
            self.sequence.set_thinning(self.thinning.every);
            self.complete(&requested)?
        };
        self.parts.clone_from(&manifest.input.parts);
        requested.manifest = manifest;
        let mut job = RenderJob::new(requested, &self.sequence, None)?.keeping_environment();
        if let Some(known) = &self.prepared {
            job = job.with_files_of(&known.job);
        }
        let (survey, setup) = job.survey_with(&self.sequence, &mut self.findings)?;
        lines.extend(job.scene_notes()?);
        Ok(Resolved { job, survey, setup, lines })
    }

    /// Forgets what was found with other particles.
    fn thin(&mut self, thinning: Thinning) {
        if self.thinning.every != thinning.every {
            self.findings = Findings::default();
            self.built = None;
        }
        self.thinning = thinning;
    }

    fn open(&mut self, requested: &JobManifest) -> Result<(), ExploreError> {
        self.built = None;
        self.particles = None;
        self.sequence = requested.open_sequence()?;
        self.findings = Findings::default();
        self.parts = None;
        Ok(())
    }

    /// The manifest with the defaults that follow from the particles, and what the rules say.
    fn complete(
        &mut self,
        requested: &JobManifest,
    ) -> Result<(Vec<String>, Manifest), ExploreError> {
        let mut requested = requested.clone();
        let lines = requested.complete_with(&mut self.sequence, None, &mut self.findings)?;
        Ok((lines, requested.manifest))
    }

    /// The picture of `frame` as `level` says, with the settings that were prepared.
    pub(super) fn picture(
        &mut self,
        frame: i64,
        level: &Level,
        stop: &dyn Stop,
    ) -> Result<StagePicture, ExploreError> {
        self.build(frame)?;
        let prepared = self.prepared.as_ref().expect("settings come first");
        let built = self.built.as_mut().expect("it was built");
        let start = Instant::now();
        let setup = reduced(&prepared.setup, level);
        let traced = catch_panic(|| Ok(built.renderer.render(&setup, &built.frame, stop)?));
        let mut traced = match traced {
            Ok(traced) => traced,
            Err(error) => {
                let error = ExploreError::Image(error);
                // The failure may have left the buffers in an inconsistent state
                if !error.is_interrupted() {
                    self.built = None;
                }
                return Err(error);
            }
        };
        let under = Under::of(&traced.film);
        let encoded = if level.is_last {
            encode::last(&prepared.setup, &traced)?
        } else {
            encode::draft(&prepared.setup, &mut traced)?
        };
        built.renderer.recycle(traced.film);
        Ok(StagePicture {
            encoded,
            under,
            particles: traced.report.particles,
            every: built.every,
            time: traced.time,
            seconds: start.elapsed().as_secs_f64(),
            notes: built.notes.clone(),
        })
    }

    /// Reads `frame` and builds its tree, unless that is there.
    fn build(&mut self, frame: i64) -> Result<(), ExploreError> {
        let prepared = self.prepared.as_ref().expect("settings come first");
        let key = build_key(prepared, frame);
        if self.built.as_ref().is_some_and(|built| built.key == key) {
            return Ok(());
        }
        // One frame at a time is in memory
        let kind = prepared.setup.picture.renderer;
        let mut renderer = match self.built.take() {
            Some(built) if kind == RendererKind::Cpu => built.renderer,
            _ => renderer_of(kind),
        };
        let surveyed = self.thinning.every;
        let reading =
            thin::reading((&prepared.job, &prepared.setup), &self.sequence, frame, surveyed)?;
        let Reading { setup, task, every, mut notes } = reading;
        self.sequence.set_thinning(every);
        let sequence = &self.sequence;
        let frame = catch_panic(|| {
            let mut loaded = load_frame(&setup, sequence, &task)?;
            notes.append(&mut loaded.notes);
            Ok(renderer.prepare(&setup, loaded)?)
        });
        let frame = frame.map_err(ExploreError::Image)?;
        notes.extend(frame.notes().iter().cloned());
        self.built = Some(Built { key, renderer, frame, every, notes });
        Ok(())
    }

    /// The particles of `frame` as they are in its files. They stay in memory until others are asked for.
    pub(super) fn particles(&mut self, frame: i64) -> Result<&RawParticles, ExploreError> {
        let count = self.prepared.as_ref().map_or(0, |own| own.survey.most_particles);
        if count > MAX_VALUES {
            return Err(ExploreError::TooLarge { particles: count });
        }
        let frames = self.sequence.frames();
        let index = frames.iter().position(|own| own.number == frame);
        let index = index.ok_or(ExploreError::NoFrame { frame })?;
        if self.particles.as_ref().is_none_or(|(own, _)| *own != index) {
            self.particles = None;
            self.sequence.set_thinning(1);
            let read = self.sequence.load_raw(index).map_err(RunError::Frame)?;
            self.particles = Some((index, read));
        }
        Ok(&self.particles.as_ref().expect("it was read").1)
    }

    /// The settings that were prepared last.
    pub(super) const fn prepared(&self) -> Option<&Prepared> {
        self.prepared.as_ref()
    }

    /// The directory that paths are relative to.
    pub(super) fn base(&self) -> Result<PathBuf, RunError> {
        self.requested.absolute_base()
    }

    /// Renders the picture of `frame` to the file `path`, with the channels of the job if it is an EXR.
    pub(super) fn write_picture(&mut self, frame: i64, path: &Path) -> Result<(), ExploreError> {
        let prepared = self.prepared.as_ref().expect("settings come first");
        let mut setup = prepared.setup.clone();
        if PictureFormat::of(path) == Some(PictureFormat::Exr) {
            setup.picture.render.channels = prepared.channels;
        }
        let mut tasks = prepared.job.tasks(&self.sequence, &[frame]);
        prepared.job.schedule(&self.sequence, &setup, &mut tasks);
        // A draft with some of the particles is not what a job renders
        require_one_fits(&tasks)?;
        if self.thinning.every > 1 {
            return Err(ExploreError::Draft);
        }
        self.sequence.set_thinning(1);
        let task = tasks.first_mut().ok_or(ExploreError::NoFrame { frame })?;
        path.clone_into(&mut task.image);
        task.preview = None;
        make_image(&setup, &self.sequence, task, |_| {})?;
        Ok(())
    }
}

impl Prepared {
    /// The manifest with all values but those that follow from a survey.
    pub(super) const fn manifest(&self) -> &Manifest {
        self.job.manifest()
    }

    /// The directory of the images of the job.
    pub(super) fn directory(&self) -> PathBuf {
        self.job.dir().to_owned()
    }
}

impl Under {
    fn of(film: &crate::render::Film) -> Self {
        let ids = film.plane::<u32>(FilmPlane::Id).unwrap_or_default().to_vec();
        let points = film.plane::<[f32; 3]>(FilmPlane::Position).unwrap_or_default().to_vec();
        Self { size: [film.width, film.height], ids, points }
    }
}

/// The settings that decide which files a sequence has, and where its particles are.
fn sequence_settings(manifest: &Manifest) -> Vec<(String, String)> {
    let is_of_sequence =
        |key: &str| key.starts_with("cell.") || key.starts_with("input.") && key != "input.up";
    let all = manifest.values().into_iter();
    all.filter(|(key, _)| is_of_sequence(key))
        .map(|(key, value)| (key, value.unwrap_or_default()))
        .collect()
}

/// What a frame is built for: its number, the settings that need other particles or another tree, and what follows
/// from the survey.
fn build_key(prepared: &Prepared, frame: i64) -> String {
    let picture = &prepared.setup.picture;
    let settings = prepared.manifest().settings();
    let others: Vec<_> = settings.into_iter().filter(|(key, _)| !is_shading(key)).collect();
    format!(
        "{frame} {:?} {:?} {:?} {:?} {:?} {:?} {others:?}",
        picture.origin,
        picture.renderer,
        picture.particles.first().radius,
        picture.files.overlay_values,
        prepared.manifest().render.memory_limit,
        picture
            .particles
            .styles
            .iter()
            .map(|style| colored_by(&style.color, picture.renderer))
            .collect::<Vec<_>>(),
    )
}

/// Whether a key needs no other particles and no other tree.
fn is_shading(key: &str) -> bool {
    // Lists have no more in their keys
    let is_in = |own: &&str| key.starts_with(*own) || own.strip_suffix('.') == Some(key);
    SHADING_KEYS.iter().any(is_in) && !OTHER_KEYS.iter().any(is_in)
}

/// The settings that need other particles or another tree.
fn data_settings(settings: &[Setting]) -> Vec<Setting> {
    settings.iter().filter(|own| !is_shading(&own.key)).cloned().collect()
}

/// What a frame has for its colours. On the CPU, maps are applied to its values when they are shaded.
fn colored_by(rule: &ColorRule, renderer: RendererKind) -> String {
    match (renderer, rule) {
        (RendererKind::Cpu, ColorRule::Constant(_)) => String::new(),
        (RendererKind::Cpu, ColorRule::Attribute { name, .. }) => name.clone(),
        (_, rule) => format!("{rule:?}"),
    }
}

/// `setup` for a picture of this `level`.
fn reduced(setup: &Setup, level: &Level) -> Setup {
    let mut setup = setup.clone();
    let render = &mut setup.picture.render;
    if !level.is_last {
        render.photons = render.photons.min(DRAFT_PHOTONS);
    }
    let scale = f64::from(level.size[0]) / f64::from(render.width);
    render.window = render.window.map(|window| scaled(window, scale));
    [render.width, render.height] = level.size;
    render.samples = level.samples;
    // The picture is refined level by level, all of it alike
    render.noise = None;
    // The noise of one sample cannot be measured
    if level.samples == 1 {
        render.has_features = false;
        setup.picture.denoise = None;
    }
    setup
}

/// The window of a film that is smaller or larger by this factor.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "sizes of pictures, made smaller"
)]
fn scaled(window: DataWindow, scale: f64) -> DataWindow {
    let at = |place: i32| (f64::from(place) * scale).round() as i32;
    let side = |side: u32| (f64::from(side) * scale).round().max(1.0) as u32;
    DataWindow { left: at(window.left), top: at(window.top), image: window.image.map(side) }
}
