//! The finished pictures of a job, for the commands that show them: `movie`, `sheet` and `view`.

use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use spherule_jobs::{FrameRange, FrameState, Interrupt, Job, JobState, PLAN_FILE, WORK_DIR};

use super::CliError;
use super::job::{job_directory, list, no_job, selected_frames};
use super::paths::absolute;
use super::signals::SignalMessages;
use crate::job::KIND;
use crate::movie::Observer;
use crate::output::PictureFormat;
use crate::output::view::{DisplayView, ViewTransform};
use crate::picture::{Picture, is_own_file};
use crate::report::job::{HTML_FILE, JSON_FILE};

/// The job, and the frames to show.
#[derive(Debug, Args)]
pub(super) struct PicturesArgs {
    /// A render job: the directory of its images, or its manifest (job.toml).
    pub(super) job: PathBuf,
    /// Frames to show: 7 | 1-10 | 1-10x2 | 1-5,8.
    #[arg(long, value_name = "RANGE", allow_hyphen_values = true)]
    pub(super) frames: Option<FrameRange>,
}

/// A finished frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct JobPicture {
    pub(super) number: i64,
    /// The preview, or the image if there is none.
    pub(super) picture: PathBuf,
    pub(super) image: PathBuf,
}

/// The finished pictures of a job.
pub(super) struct JobPictures {
    pub(super) state: JobState,
    /// Ascending by number.
    pub(super) pictures: Vec<JobPicture>,
    /// All selected frames, finished or not.
    pub(super) selected: Vec<i64>,
    /// Selected frames that are not finished.
    pub(super) missing: Vec<i64>,
    /// Whether a worker is at work.
    pub(super) is_running: bool,
    /// Whether pictures are PNG files.
    pub(super) has_previews: bool,
    /// Exposure of previews, stops.
    pub(super) view: DisplayView,
}

/// How the pictures of a job show light, by its settings.
fn view_of<'a>(find: impl Fn(&str) -> Option<&'a String>) -> DisplayView {
    let exposure = find("output.preview_exposure").and_then(|stops| stops.parse().ok());
    let name = find("output.view_transform").map(|name| name.trim_matches('"'));
    DisplayView {
        exposure: exposure.unwrap_or(0.0),
        transform: name.and_then(ViewTransform::of_name).unwrap_or_default(),
    }
}

impl JobPictures {
    /// Whether previews are larger than images, because overlays are beside the pictures.
    pub(super) fn have_strips(&self) -> bool {
        let both = self.pictures.iter().find(|picture| picture.picture != picture.image);
        let size = |path: &Path| Picture::read(path, self.view).ok().map(|picture| picture.size());
        may_have_strips(self.state.plan().settings())
            && both.is_some_and(|both| size(&both.picture) != size(&both.image))
    }

    /// Reads the state of the job.
    pub(super) fn read(args: &PicturesArgs) -> Result<Self, CliError> {
        let dir = job_directory(&args.job)?;
        // Before the ledger, so that no frame finishes in between
        let workers = Job::workers(&dir)?;
        let Some(state) = Job::read(&dir)? else {
            return Err(no_job(&dir));
        };
        // Refuse jobs without pictures
        let settings = state.plan().settings();
        let find =
            |name: &str| settings.iter().find(|(key, _)| key == name).map(|(_, value)| value);
        if find(KIND).is_some() {
            return Err(CliError::other(format!(
                "{}: this job has native frames, no pictures; render them first",
                dir.display()
            )));
        }
        // Find out how pictures are made from images without previews
        let view = view_of(find);
        let mut frames = state.plan().frames().iter();
        let has_previews = frames.any(|frame| frame.outputs.iter().any(is_png));
        let is_transparent = find("output.transparent").is_some_and(|value| value == "true");
        if is_transparent && !has_previews {
            return Err(CliError::other(format!(
                "{}: this job has no previews, and its images have no background; render it with --set \
                 output.preview=true",
                dir.display()
            )));
        }
        // Select the finished frames
        let selected = selected_frames(&state, args.frames.as_ref())?;
        let is_done = |frame: &i64| state.frame_state(*frame) == Some(FrameState::Done);
        let (done, missing): (Vec<i64>, Vec<i64>) =
            selected.iter().partition(|frame| is_done(frame));
        let pictures = done.iter().filter_map(|frame| picture(&state, *frame)).collect();
        Ok(Self {
            pictures,
            selected,
            missing,
            is_running: workers.iter().any(|worker| !worker.has_ended),
            has_previews,
            view,
            state,
        })
    }

    /// The state of an unfinished job; None if all frames are done.
    pub(super) fn gaps(&self) -> Option<String> {
        if self.missing.is_empty() {
            return None;
        }
        let running = if self.is_running { "; a worker is at work" } else { "" };
        Some(format!(
            "{}: {} of {} frames are done, missing: {}{running}",
            self.state.dir().display(),
            self.pictures.len(),
            self.selected.len(),
            list(&self.missing)
        ))
    }

    /// Refuses a job without finished frames.
    pub(super) fn require_any(&self) -> Result<(), CliError> {
        match self.gaps().filter(|_| self.pictures.is_empty()) {
            None => Ok(()),
            Some(gaps) => Err(CliError::other(format!("{gaps}; there is nothing to show yet"))),
        }
    }

    /// Adds how to get previews to an error of reading images.
    pub(super) fn explain(&self, error: &dyn std::fmt::Display) -> CliError {
        let remedy = if self.has_previews {
            ""
        } else {
            "; this job has no previews: render it with --set output.preview=true"
        };
        CliError::other(format!("{error}{remedy}"))
    }

    /// Refuses an output that is a file of the job, that is not a file, or that another program has written.
    pub(super) fn guard(&self, output: &Path, force: bool) -> Result<(), CliError> {
        // Refuse what no command may replace
        guard(output, force)?;
        let wanted = real(output)?;
        let (dir, name) = (wanted.parent(), wanted.file_name());
        // Inputs are compared by name only if the output is in their directory
        let plan = self.state.plan();
        let is_in =
            |input_dir: &Path| dir.is_some() && input_dir.canonicalize().ok().as_deref() == dir;
        let may_be_input = plan.input_dirs().iter().any(|dir| is_in(Path::new(dir)));
        // Refuse files of the job
        for frame in plan.frames() {
            let mut inputs = frame.inputs.iter().map(|input| Path::new(&input.path));
            let is_input = may_be_input && inputs.any(|input| input.file_name() == name);
            let mut outputs = frame.outputs.iter().map(Path::new);
            let output_of_name = outputs.find(|output| output.file_name() == name);
            let is_output = match output_of_name {
                Some(path) => real(&self.state.dir().join(path))? == wanted,
                None => false,
            };
            if is_input || is_output {
                let why = "is an image or an input of the job; choose another name";
                return Err(refused(output, why));
            }
        }
        Ok(())
    }
}

/// Refuses an output that is not a file, that belongs to the records of a job, or that another program has written. Makes
/// its directory.
pub(super) fn guard(output: &Path, force: bool) -> Result<(), CliError> {
    if is_job_file(&real(output)?) {
        let why = "belongs to the records of a job; choose another name";
        return Err(refused(output, why));
    }
    if let Ok(existing) = fs::metadata(output) {
        if !existing.is_file() {
            return Err(refused(output, "is not a file; choose another name"));
        }
        if !force && !is_own_file(output) {
            let why = "already exists and was not made by this command; choose another name, or replace it \
                       with --force";
            return Err(refused(output, why));
        }
    }
    match absolute(output)?.parent() {
        Some(dir) => fs::create_dir_all(dir).map_err(CliError::io(dir)),
        None => Ok(()),
    }
}

/// Whether `path` is in the directory of a job and has the name of one of its records: plan, ledgers, manifest, schema,
/// reports.
fn is_job_file(path: &Path) -> bool {
    let (Some(dir), Some(name)) = (path.parent(), path.file_name()) else {
        return false;
    };
    let is_in_work = dir.file_name().is_some_and(|name| name == WORK_DIR);
    let name = name.to_string_lossy();
    let is_record = name.starts_with("job.") || [JSON_FILE, HTML_FILE].contains(&&*name);
    is_in_work || (is_record && dir.join(PLAN_FILE).exists())
}

fn refused(output: &Path, why: &str) -> CliError {
    CliError::other(format!("{}: {why}", output.display()))
}

/// The path with a directory without links, whether or not the file exists.
fn real(path: &Path) -> Result<PathBuf, CliError> {
    let path = absolute(path)?;
    let (Some(dir), Some(name)) = (path.parent(), path.file_name()) else {
        return Ok(path);
    };
    Ok(dir.canonicalize().unwrap_or_else(|_| dir.to_owned()).join(name))
}

/// Whether the settings of a plan may put overlays beside the pictures, so that previews are larger than images.
pub(super) fn may_have_strips(settings: &[(String, String)]) -> bool {
    settings.iter().any(|(key, value)| {
        let is_layout =
            key == "image.layout" || (key.starts_with("overlay.") && key.ends_with(".layout"));
        is_layout && ["\"beside\"", "\"auto\""].contains(&&**value)
    })
}

fn is_png(path: &String) -> bool {
    PictureFormat::of(Path::new(path)) == Some(PictureFormat::Png)
}

fn picture(state: &JobState, frame: i64) -> Option<JobPicture> {
    let outputs = &state.plan().frame(frame)?.outputs;
    let dir = if state.dir().as_os_str().is_empty() { Path::new(".") } else { state.dir() };
    let image = dir.join(outputs.first()?);
    let preview = outputs.iter().find(|path| is_png(path)).map(|path| dir.join(path));
    Some(JobPicture { number: frame, picture: preview.unwrap_or_else(|| image.clone()), image })
}

/// Stops when a signal has come.
pub(super) struct Watch<'a>(pub(super) &'a Interrupt);

impl Observer for Watch<'_> {
    fn stops(&self) -> bool {
        self.0.is_raised()
    }

    fn on_picture(&self, _: usize) {}
}

/// Messages after a signal.
pub(super) const SIGNAL_MESSAGES: SignalMessages =
    SignalMessages { stopping: "stopping", stopped: "stopped; no file was written" };
