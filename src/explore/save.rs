//! What a page saves: a manifest, a picture, a job in the background. Files have plain names in the directory that the
//! paths of the manifest are relative to, and replace only those that the same program has saved.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::{Mutex, PoisonError};

use serde::Serialize;
use spherule_jobs::{FrameState, Job, JobError, publish};

use super::error::ExploreError;
use super::explorer::Explorer;
use super::wish::{Setting, Wish};
use crate::output::PictureFormat;

/// Longest name of a file, bytes.
const MAX_NAME: usize = 120;

/// Why nothing was saved.
#[derive(Debug, thiserror::Error)]
pub enum SaveError {
    /// The name is none of a file in the directory.
    #[error("{name:?}: {why}")]
    Name {
        /// The name.
        name: String,
        /// What is wrong with it.
        why: &'static str,
    },
    /// There is such a file, which somebody else has made.
    #[error("{}: exists, and was not saved by this page; choose another name", path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// It cannot be written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
    /// The settings are invalid, or the picture cannot be rendered.
    #[error(transparent)]
    Explore(#[from] ExploreError),
    /// The state of the job cannot be read.
    #[error(transparent)]
    Job(#[from] JobError),
    /// The thread that renders has ended.
    #[error("the program is ending")]
    Ended,
}

/// A file that was saved.
#[derive(Debug, Clone, Serialize)]
pub struct Saved {
    /// Its path.
    pub path: PathBuf,
}

/// A job that was started, as far as it is.
#[derive(Debug, Clone, Serialize)]
pub struct JobProgress {
    /// Number of frames that are finished.
    pub done: usize,
    /// Number of frames that failed.
    pub failed: usize,
    /// Number of all frames.
    pub frames: usize,
    /// Whether a process works on it.
    pub is_running: bool,
    /// The directory of its images.
    pub directory: PathBuf,
}

/// Files that were saved, so that they may be replaced.
#[derive(Debug, Default)]
pub struct SavedFiles(Mutex<BTreeSet<PathBuf>>);

impl SavedFiles {
    /// The path of a file called `name` in `dir`, if it may be written.
    fn place(&self, dir: &Path, name: &str, is_known: bool) -> Result<PathBuf, SaveError> {
        let refuse = |why| SaveError::Name { name: name.to_owned(), why };
        if !is_known {
            return Err(refuse("the name must end in .toml, or in .png, .exr, .jpg or .tif"));
        }
        if name.len() > MAX_NAME || name.starts_with('.') {
            return Err(refuse("the name must have at most 120 bytes, and no period at its start"));
        }
        let is_plain = |c: char| !c.is_control() && !['/', '\\', ':', '\0'].contains(&c);
        if !name.chars().all(is_plain) {
            return Err(refuse("a name without directories is needed"));
        }
        let path = dir.join(name);
        let own = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        // A link may lead anywhere
        if !own.contains(&path) && fs::symlink_metadata(&path).is_ok() {
            return Err(SaveError::Exists { path });
        }
        Ok(path)
    }

    fn remember(&self, path: &Path) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).insert(path.to_owned());
    }
}

impl Explorer {
    /// A manifest with what was chosen, and the command that has the same effect, for the program `spherule` and `input`
    /// as it was typed.
    ///
    /// # Errors
    /// The settings are invalid.
    pub fn manifest(&self, settings: Vec<Setting>) -> Result<ManifestTexts, SaveError> {
        let made = self.ask(move |stage| {
            let source = &stage.prepare(&settings)?.source;
            let toml = source.to_toml()?;
            Ok::<_, ExploreError>(ManifestTexts { toml, command: command(&source.assignments()?) })
        });
        Ok(made.ok_or(SaveError::Ended)??)
    }

    /// Saves a manifest with what was chosen as `name`.
    ///
    /// # Errors
    /// See [`SaveError`].
    pub fn save_manifest(
        &self,
        settings: Vec<Setting>,
        name: &str,
        files: &SavedFiles,
    ) -> Result<Saved, SaveError> {
        let path = files.place(&self.directory()?, name, name.ends_with(".toml"))?;
        let text = self.manifest(settings)?.toml;
        let written = publish(&path, text.as_bytes());
        written.map_err(|source| SaveError::Io { path: path.clone(), source })?;
        files.remember(&path);
        Ok(Saved { path })
    }

    /// Renders a picture to a file called `name`, as a job does.
    ///
    /// # Errors
    /// See [`SaveError`].
    pub fn save_picture(
        &self,
        wish: Wish,
        name: &str,
        files: &SavedFiles,
    ) -> Result<Saved, SaveError> {
        let is_known = PictureFormat::of(Path::new(name)).is_some();
        let path = files.place(&self.directory()?, name, is_known)?;
        let own = path.clone();
        let made = self.ask(move |stage| {
            stage.prepare(&wish.settings)?;
            stage.write_picture(wish.frame, &own)
        });
        made.ok_or(SaveError::Ended)??;
        files.remember(&path);
        Ok(Saved { path })
    }

    /// The directory of files that are saved.
    ///
    /// # Errors
    /// The current directory is unknown.
    pub fn directory(&self) -> Result<PathBuf, SaveError> {
        let base = self.ask(|stage| stage.base()).ok_or(SaveError::Ended)?;
        Ok(base.map_err(ExploreError::Job)?)
    }

    /// The directory of the images of a job with these settings.
    fn output_directory(&self, settings: Vec<Setting>) -> Result<PathBuf, SaveError> {
        let found =
            self.ask(move |stage| Ok::<_, ExploreError>(stage.prepare(&settings)?.directory()));
        Ok(found.ok_or(SaveError::Ended)??)
    }

    /// Saves a manifest as `name` and starts its job with `program`, which goes on when this process ends.
    ///
    /// # Errors
    /// See [`SaveError`].
    pub fn start_job(
        &self,
        settings: Vec<Setting>,
        name: &str,
        files: &SavedFiles,
        program: &Path,
    ) -> Result<Saved, SaveError> {
        // The log, too, replaces no file of others
        let log = Path::new(name).with_extension("log");
        let log = files.place(&self.directory()?, &log.to_string_lossy(), true)?;
        let saved = self.save_manifest(settings, name, files)?;
        let failed = |path: &Path| {
            let path = path.to_owned();
            move |source| SaveError::Io { path, source }
        };
        let out = fs::File::create(&log).map_err(failed(&log))?;
        files.remember(&log);
        let errors = out.try_clone().map_err(failed(&log))?;
        let mut command = Command::new(program);
        command.arg("render").arg(&saved.path).args(["--progress", "plain"]);
        command.stdin(Stdio::null()).stdout(out).stderr(errors);
        // Ctrl-C in the terminal of this process is not for the job
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn().map_err(failed(program))?;
        // It is waited for, so that it does not remain as a zombie
        std::thread::spawn(move || child.wait());
        Ok(saved)
    }

    /// How far the job with these settings is; None if there is none.
    ///
    /// # Errors
    /// The job cannot be read.
    pub fn job_progress(&self, settings: Vec<Setting>) -> Result<Option<JobProgress>, SaveError> {
        let directory = self.output_directory(settings)?;
        let workers = Job::workers(&directory)?;
        let Some(state) = Job::read(&directory)? else {
            return Ok(None);
        };
        let numbers = state.plan().frames().iter().map(|frame| frame.number);
        let count = |of| {
            let own = numbers.clone().filter(|frame| state.frame_state(*frame) == Some(of));
            own.count()
        };
        Ok(Some(JobProgress {
            done: count(FrameState::Done),
            failed: count(FrameState::Failed),
            frames: state.plan().frames().len(),
            is_running: workers.iter().any(|worker| !worker.has_ended),
            directory,
        }))
    }
}

/// What was chosen, as texts.
#[derive(Debug, Clone, Serialize)]
pub struct ManifestTexts {
    /// A manifest.
    pub toml: String,
    /// A command for a shell.
    pub command: String,
}

/// The command that renders a job with these assignments.
fn command(assignments: &[(String, String)]) -> String {
    let mut input = String::new();
    let mut text = String::new();
    for (key, value) in assignments {
        if key == "input.path" {
            input = paths(value).iter().map(|path| format!(" {}", quoted(path))).collect();
        } else {
            text += &format!(" \\\n  --set {}", quoted(&format!("{key}={value}")));
        }
    }
    format!("spherule render{input}{text}")
}

/// The paths in a TOML value.
fn paths(value: &str) -> Vec<String> {
    let table = toml::from_str::<toml::Table>(&format!("path = {value}")).unwrap_or_default();
    match table.get("path") {
        Some(toml::Value::String(path)) => vec![path.clone()],
        Some(toml::Value::Array(list)) => {
            list.iter().filter_map(|path| path.as_str().map(str::to_owned)).collect()
        }
        _ => Vec::new(),
    }
}

/// `text` for a shell.
fn quoted(text: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_./=,:".contains(c);
    if !text.is_empty() && text.chars().all(is_plain) {
        return text.to_owned();
    }
    format!("'{}'", text.replace('\'', "'\\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_have_plain_names_and_replace_no_others() {
        let dir = tempfile::tempdir().expect("a directory");
        let files = SavedFiles::default();
        for name in ["../a.toml", "a/b.toml", "/a.toml", ".a.toml", "a\n.toml", "c:a.toml", ""] {
            let refused = files.place(dir.path(), name, name.ends_with(".toml"));
            assert!(matches!(refused, Err(SaveError::Name { .. })), "{name:?}: {refused:?}");
        }
        let path = files.place(dir.path(), "job.toml", true).expect("a place");
        fs::write(&path, "mine").expect("a file");
        let refused = files.place(dir.path(), "job.toml", true);
        assert!(matches!(refused, Err(SaveError::Exists { .. })));
        files.remember(&path);
        assert!(files.place(dir.path(), "job.toml", true).is_ok());
    }

    #[test]
    fn commands_are_quoted() {
        let set = |key: &str, value: &str| (key.to_owned(), value.to_owned());
        let text = command(&[
            set("input.path", "\"my run\""),
            set("material.color", "{ attribute = \"it's\" }"),
            set("camera.zoom", "2.0"),
        ]);
        let expected = "spherule render 'my run' \\\n  --set 'material.color={ attribute = \"it'\\''s\" }' \\\n  --set camera.zoom=2.0";
        assert_eq!(text, expected);
        assert_eq!(paths("[\"a\", \"b\"]"), ["a", "b"]);
    }
}
