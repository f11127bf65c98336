//! The manifest of a render job, where its paths begin, and the manifest that the job writes next to its images.

use std::path::{Path, PathBuf};

use serde_json::Value;
use spherule_formats::MemoryBudget;
use spherule_formats::sequence::{Sequence, SequenceInput, SequenceSettings};
use spherule_jobs::{publish, read_regular_text};

use super::placement::placement_of;
use super::{RunError, in_thread};
use crate::manifest::{
    Manifest, ManifestSource, OutputPattern, RebaseError, SCHEMA_FILE, is_marked, job_schema,
    marked, named_place, read_manifest, real_dir,
};
use crate::reading::read_budget;

/// The name of the manifest that is written next to the images.
pub const JOB_FILE: &str = "job.toml";

/// A manifest with all overrides applied.
#[derive(Debug, Clone)]
pub struct JobManifest {
    /// The manifest.
    pub manifest: Manifest,
    /// The directory that its paths are relative to; empty for the current directory.
    pub base: PathBuf,
    /// The file of the manifest, if there is one.
    pub file: Option<PathBuf>,
    /// The manifest in that file without the overrides, if it is valid.
    pub unchanged: Option<Manifest>,
    /// What the manifest was read from, if it may be completed with defaults that follow from the particles.
    pub source: Option<ManifestSource>,
}

/// Budget for reading one file in the job of `manifest`.
pub(super) fn reading_budget(manifest: &Manifest) -> MemoryBudget {
    read_budget(
        manifest.render.memory_limit.map(|limit| limit.0),
        manifest.job.memory_ceiling.map(|limit| limit.0),
    )
}

impl JobManifest {
    /// A manifest that is not in a file. Its paths are relative to `base`.
    pub fn new(manifest: Manifest, base: impl Into<PathBuf>) -> Self {
        Self { manifest, base: base.into(), file: None, unchanged: None, source: None }
    }

    /// Finds the frames of the input.
    ///
    /// # Errors
    /// There are none, or they cannot be listed.
    pub fn open_sequence(&self) -> Result<Sequence, RunError> {
        let input = &self.manifest.input;
        let paths = input.path.iter().map(|p| self.base.join(p)).collect();
        let settings = SequenceSettings {
            budget: reading_budget(&self.manifest),
            follow_links: input.follow_links,
            mesh_points: input.mesh_points,
        };
        let paths = SequenceInput::from_paths(paths);
        let mut sequence = in_thread(|| Sequence::open_with(&paths, settings))?;
        if let Some(topology) = &input.topology {
            let path = self.base.join(topology);
            in_thread(|| sequence.add_topology(&path))?;
        }
        self.keep_parts(&mut sequence, input.parts.as_deref())?;
        let placement = placement_of(&self.manifest.cell, sequence.angstrom());
        sequence.set_placement(placement);
        Ok(sequence)
    }

    /// Keeps only these `parts` of `sequence`, and repeats a frame if the manifest says so.
    pub(super) fn keep_parts(
        &self,
        sequence: &mut Sequence,
        parts: Option<&[String]>,
    ) -> Result<(), RunError> {
        if let Some(parts) = parts {
            sequence.keep_parts(parts)?;
        }
        if let Some(count) = self.manifest.input.repeat {
            sequence.repeat_middle(count);
        }
        Ok(())
    }

    /// The directory that paths are relative to, absolute.
    ///
    /// # Errors
    /// The current directory is unknown.
    pub fn absolute_base(&self) -> Result<PathBuf, RunError> {
        absolute(&self.base)
    }

    /// The file that stops a run which follows its input.
    ///
    /// # Errors
    /// The current directory is unknown.
    pub fn stop_file(&self) -> Result<PathBuf, RunError> {
        let base = self.absolute_base()?;
        let job = &self.manifest.job;
        Ok(match &job.stop_file {
            Some(path) => base.join(path),
            None => job.stop_file_in(&real_dir(&base.join(self.manifest.output.path.dir()))),
        })
    }
}

/// The manifest that a job writes next to its images.
#[derive(Debug, Clone)]
pub(super) struct ManifestFile {
    /// The directory of the images.
    dir: PathBuf,
    /// The file of the given manifest, absolute.
    given: Option<PathBuf>,
    /// The manifest in that file, relative to `dir`; None if it is not valid without overrides.
    unchanged: Option<Manifest>,
}

impl ManifestFile {
    /// Moves `manifest` to the directory of its images.
    pub(super) fn new(requested: JobManifest) -> Result<(Self, Manifest), RunError> {
        let base = requested.absolute_base()?;
        let mut manifest = requested.manifest;
        let dir = real_dir(&base.join(manifest.output.path.dir()));
        move_into(&mut manifest, &base, &dir)?;
        let mut unchanged = requested.unchanged;
        if let Some(manifest) = &mut unchanged {
            move_into(manifest, &base, &dir)?;
        }
        let given = requested.file.as_deref().map(absolute).transpose()?;
        let file = Self { dir, given: given.map(|f| named_place(&f)), unchanged };
        Ok((file, manifest))
    }

    pub(super) fn dir(&self) -> &Path {
        &self.dir
    }

    pub(super) fn path(&self) -> PathBuf {
        self.dir.join(JOB_FILE)
    }

    /// Whether the given manifest is the file that the job would write.
    fn is_given(&self) -> bool {
        self.given.as_deref() == Some(&self.path())
    }

    /// Whether the job may write its manifest: no file of a user is in its place.
    pub(super) fn is_free(&self) -> bool {
        let path = self.path();
        let is_ours = || read_manifest(&path).is_ok_and(|text| is_marked(&text));
        self.is_given() || !path.exists() || is_ours()
    }

    /// Writes `manifest` and its schema, unless the file is the given manifest or is up to date. If it is the given
    /// manifest, overrides are added to it only if `resolves_again` is set. A file that a user wrote or edited is not
    /// changed. Returns notes for the user.
    pub(super) fn write(
        &self,
        manifest: &Manifest,
        resolves_again: bool,
    ) -> Result<Vec<String>, RunError> {
        let path = self.path();
        let mut manifest = manifest.clone();
        if let Some(unchanged) = &self.unchanged {
            // The frame selection and execution options of one worker are not properties of the job
            manifest.input.frames = unchanged.input.frames.clone();
            manifest.job = unchanged.job.clone();
            manifest.render.memory_limit = unchanged.render.memory_limit;
        }
        // The given manifest is left alone unless options have changed it
        if self.is_given() && (!resolves_again || self.unchanged.as_ref() == Some(&manifest)) {
            return Ok(Vec::new());
        }
        // So is a file that somebody edited
        if path.exists() {
            let text = read_manifest(&path).unwrap_or_default();
            if !is_marked(&text) {
                let is_same = Manifest::parse(&text, &path).is_ok_and(|found| found == manifest);
                let note = format!(
                    "{}: not written by spherule, or edited since, so it is not changed; the settings of this job \
                     differ from it: give the same options again, or add them to the file",
                    path.display()
                );
                return Ok(if is_same { Vec::new() } else { vec![note] });
            }
        }
        // Write it, with its schema
        write_if_changed(&path, &marked(&manifest.to_commented_toml()))?;
        Ok(self.write_schema().into_iter().collect())
    }

    /// Writes the schema that the first line of the manifest refers to. Only editors use it, so an error is a note.
    fn write_schema(&self) -> Option<String> {
        let path = self.dir.join(SCHEMA_FILE);
        if path.exists() && !is_schema(&path) {
            return None;
        }
        let error = write_if_changed(&path, &schema_text()).err()?;
        Some(format!("{error}; editors will not have a schema"))
    }
}

/// Makes the paths in `manifest` relative to `dir`, the directory of its images.
fn move_into(manifest: &mut Manifest, base: &Path, dir: &Path) -> Result<(), RebaseError> {
    manifest.rebase(base, dir)?;
    // Store only the file name, so that the directory can be moved with its manifest
    if real_dir(&dir.join(manifest.output.path.dir())) == dir {
        let name = manifest.output.path.file_name();
        manifest.output.path = OutputPattern::parse(name)
            .map_err(|reason| RebaseError::Output { path: name.to_owned(), reason })?;
    }
    Ok(())
}

fn write_if_changed(path: &Path, text: &str) -> Result<(), RunError> {
    if read_regular_text(path, text.len() as u64).is_ok_and(|old| old == text) {
        return Ok(());
    }
    publish(path, text.as_bytes()).map_err(RunError::file(path, "cannot be written"))
}

/// `path` from the root. The file need not exist.
fn absolute(path: &Path) -> Result<PathBuf, RunError> {
    if path.as_os_str().is_empty() {
        return std::env::current_dir().map_err(RunError::file(Path::new("."), "cannot be found"));
    }
    std::path::absolute(path).map_err(RunError::file(path, "cannot be made absolute"))
}

/// The JSON schema of manifests, as the text of a file.
pub fn schema_text() -> String {
    format!("{:#}\n", job_schema())
}

/// Whether the file at `path` is a schema of manifests, of this version or another.
pub fn is_schema(path: &Path) -> bool {
    let text = read_regular_text(path, MAX_SCHEMA_BYTES).unwrap_or_default();
    let title = |text: &str| -> Option<Value> {
        let schema: Value = serde_json::from_str(text).ok()?;
        schema.get("title").cloned()
    };
    title(&text).is_some_and(|found| job_schema().get("title") == Some(&found))
}

/// Many times the length of a schema.
const MAX_SCHEMA_BYTES: u64 = 16 << 20;

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn the_schema_in_the_repository_is_up_to_date() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/job.schema.json");
        assert_eq!(
            fs::read_to_string(path).unwrap_or_default(),
            schema_text(),
            "after a change: cargo run -- schema > docs/job.schema.json"
        );
    }
}
