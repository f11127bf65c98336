//! Completes a manifest with the defaults that follow from its particles.

use spherule_formats::sequence::Sequence;
use spherule_jobs::{Job, ResumeMode};

use super::manifest_file::JobManifest;
use super::{Findings, RunError};
use crate::defaults::{Defaults, Files, planned, rules, walls};
use crate::manifest::{Look, ManifestSource, real_dir};

impl JobManifest {
    /// Completes the manifest with the defaults that follow from the particles of `sequence`, from which walls may
    /// be left out; a job that goes on in `mode` keeps those of its plan. Afterwards the manifest has no look. Returns a line for
    /// each rule that has something to say.
    ///
    /// # Errors
    /// The plan of an existing job cannot be read, or the defaults contradict the manifest.
    pub fn complete(
        &mut self,
        sequence: &mut Sequence,
        mode: Option<ResumeMode>,
    ) -> Result<Vec<String>, RunError> {
        self.complete_with(sequence, mode, &mut Findings::default())
    }

    /// [`Self::complete`] with what was found of the sequence before, and what is found now.
    ///
    /// # Errors
    /// Same as [`Self::complete`].
    pub fn complete_with(
        &mut self,
        sequence: &mut Sequence,
        mode: Option<ResumeMode>,
        findings: &mut Findings,
    ) -> Result<Vec<String>, RunError> {
        let Some(source) = self.source.clone() else {
            return Ok(Vec::new());
        };
        if self.manifest.look == Look::None {
            return Ok(Vec::new());
        }
        // A job that goes on keeps the defaults in its plan
        let plan = match mode {
            Some(ResumeMode::Force) | None => None,
            Some(_) => {
                let dir = self.absolute_base()?.join(self.manifest.output.path.dir());
                // That it is a file, or cannot be read, is reported when the job is opened
                match real_dir(&dir) {
                    dir if dir.is_dir() => Job::read_plan(&dir)?,
                    _ => None,
                }
            }
        };
        // Otherwise the particles decide
        let defaults = match plan {
            Some(plan) => {
                Defaults { settings: planned(&source, plan.settings()), lines: Vec::new() }
            }
            None => self.defaults(&source, sequence, findings)?,
        };
        // Apply them below what the user gave
        let mut manifest = source.parse_over(defaults.settings)?;
        if let Some(parts) = manifest.input.parts.as_ref().filter(|_| source.lacks("input.parts")) {
            self.keep_parts(sequence, Some(parts))?;
        }
        manifest.look = Look::None;
        self.manifest = manifest;
        Ok(defaults.lines)
    }

    fn defaults(
        &self,
        source: &ManifestSource,
        sequence: &mut Sequence,
        findings: &mut Findings,
    ) -> Result<Defaults, RunError> {
        // The facts are those of what is drawn. Who has styles says what that is
        let is_open = source.lacks("input.parts")
            && self.manifest.styles.is_empty()
            && self.manifest.look != Look::Whitted;
        let walls = walls(sequence.part_names()).filter(|_| is_open);
        let facts = findings.facts(sequence, walls.as_ref())?;
        // Files are opened for names only where there are numbers to name
        let names = if facts.categories.is_empty() { Vec::new() } else { sequence.value_names() };
        let files = Files {
            parts: sequence.part_names(),
            walls: walls.as_ref(),
            names: &names,
            is_y_up: sequence.is_y_up(),
            is_molecular: sequence.format_info().is_some_and(|format| format.is_molecular),
        };
        Ok(rules(&self.manifest, source, facts, files))
    }
}
