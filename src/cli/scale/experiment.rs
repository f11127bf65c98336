//! From arguments to the cells of the experiment.

use std::collections::HashSet;
use std::hash::Hash;
use std::path::Path;

use spherule_formats::sequence::{Sequence, SequenceInput};

use super::ScaleArgs;
use crate::accel::Structure;
use crate::cli::CliError;
use crate::cli::job::useful_threads;
use crate::cli::paths::absolute;
use crate::scale::report::{InputSummary, ScaleSettings};
use crate::scale::{Budget, CellRequest, FrameSurvey, Motion, Representation, Source, Stage};

/// Default seconds per cell, as in the thesis.
const SECONDS: f64 = 60.0;

/// The settings and the survey of an experiment.
pub(super) struct Experiment {
    /// As in the report.
    pub(super) settings: ScaleSettings,
    structures: Vec<Structure>,
    source: Source,
    stage: Stage,
}

impl Experiment {
    /// Checks the arguments, and surveys the input if there is one.
    pub(super) fn settle(args: &ScaleArgs) -> Result<Self, CliError> {
        // Collect the settings, with defaults in place of what is missing
        let structures = each_once(&args.structures, &Structure::ALL);
        let mut settings = ScaleSettings {
            input: None,
            particles: each_once(&args.particles, &[]),
            structures: structures.iter().map(|s| s.name().to_owned()).collect(),
            motions: each_once(&args.motions, &Motion::ALL),
            representations: each_once(&args.representations, default_representations(args)),
            budget: match (args.seconds, args.images) {
                (_, Some(images)) => Budget::Images(images),
                (seconds, None) => Budget::Seconds(seconds.unwrap_or(SECONDS)),
            },
            width: args.width,
            height: args.height,
            samples: args.samples,
            max_depth: args.max_depth,
            seed: args.seed,
            threads: match args.threads.and_then(|count| usize::try_from(count).ok()) {
                Some(count) => useful_threads(count),
                None => rayon::current_num_threads(),
            },
        };
        // Refuse combinations that have no cell
        check_pairs(&structures, &settings.representations)?;
        // Measure the frame of a file in place of generated particles
        let mut source = Source::Box;
        let mut stage = Stage::THESIS;
        if let Some(path) = &args.input {
            let survey = survey_input(path, args)?;
            settings.input = Some(InputSummary {
                path: path.display().to_string(),
                frame: survey.source.frame,
                particles: survey.particles,
            });
            settings.particles = at_most(survey.particles, &settings.particles);
            source = Source::Frame(survey.source);
            stage = survey.stage;
        }
        Ok(Self { settings, structures, source, stage })
    }

    /// The cells in the order in which they run: the slowest ones last.
    pub(super) fn cells(&self) -> Vec<CellRequest> {
        let s = &self.settings;
        let mut cells = Vec::new();
        for &particles in &s.particles {
            for &structure in &self.structures {
                let together = |r: &&Representation| r.goes_with(structure);
                for &representation in s.representations.iter().filter(together) {
                    for &motion in &s.motions {
                        cells.push(CellRequest {
                            source: self.source.clone(),
                            particles,
                            seed: s.seed,
                            structure,
                            motion,
                            representation,
                            stage: self.stage,
                            budget: s.budget,
                            width: s.width,
                            height: s.height,
                            samples: s.samples,
                            max_depth: s.max_depth,
                            threads: s.threads,
                        });
                    }
                }
            }
        }
        cells
    }
}

/// The representations if none is named.
fn default_representations(args: &ScaleArgs) -> &'static [Representation] {
    match args.device.as_deref() {
        Some("gpu") => &[Representation::Memory, Representation::Gpu],
        _ => &[Representation::Memory],
    }
}

/// Checks that every representation has a structure, and reports combinations that are skipped.
fn check_pairs(
    structures: &[Structure],
    representations: &[Representation],
) -> Result<(), CliError> {
    if representations.contains(&Representation::Gpu) && !structures.contains(&Structure::Lbvh) {
        return Err(CliError::other(
            "a GPU builds lbvh only; add lbvh to --structures, or measure the CPU",
        ));
    }
    let in_place: Vec<&Representation> =
        representations.iter().filter(|r| r.encoding().is_some()).collect();
    let goes = |s: &Structure| in_place.iter().all(|r| r.goes_with(*s));
    let names = in_place.iter().map(|r| r.name()).collect::<Vec<_>>().join(", ");
    if in_place.is_empty() || structures.iter().all(goes) {
        return Ok(());
    }
    if !structures.contains(&Structure::Kdtree) {
        return Err(CliError::other(format!(
            "--representations {names}: native frames can only be traced with kdtree; add kdtree to \
             --structures, or use --representations memory"
        )));
    }
    note!("native frames ({names}) are traced in place, with kdtree only");
    Ok(())
}

/// The requested items without duplicates; all items if none were requested.
fn each_once<T: Copy + Eq + Hash>(requested: &[T], all: &[T]) -> Vec<T> {
    let mut known = HashSet::new();
    let items = if requested.is_empty() { all } else { requested };
    items.iter().copied().filter(|t| known.insert(*t)).collect()
}

fn survey_input(path: &Path, args: &ScaleArgs) -> Result<FrameSurvey, CliError> {
    // The processes of cells may have another working directory.
    let path = absolute(path)?;
    let sequence = Sequence::open(&SequenceInput::from_path(&path))?;
    for note in sequence.notes() {
        note!("{note}");
    }
    // Find the frame
    let numbers: Vec<i64> = sequence.frames().iter().map(|f| f.number).collect();
    let index = match args.frame {
        None => 0,
        Some(frame) => numbers.iter().position(|n| *n == frame).ok_or_else(|| {
            CliError::other(format!(
                "--frame {frame}: {} has no such frame; it has {}",
                path.display(),
                spherule_jobs::FrameRange::from_frames(numbers.iter().copied())
                    .map_or_else(String::new, |r| r.to_string())
            ))
        })?,
    };
    if args.frame.is_none() && numbers.len() > 1 {
        note!(
            "{} has {} frames; measuring frame {} (--frame selects another)",
            path.display(),
            numbers.len(),
            numbers[index]
        );
    }
    // Survey it for a camera of the images' aspect
    let aspect = f64::from(args.width) / f64::from(args.height);
    FrameSurvey::of(&sequence, &path, index, aspect).map_err(|e| CliError::other(e.to_string()))
}

/// The `requested` counts up to `available`; larger ones are replaced by one cell with all particles.
fn at_most(available: usize, requested: &[usize]) -> Vec<usize> {
    let (mut fit, above): (Vec<_>, Vec<_>) =
        requested.iter().partition(|count| **count <= available);
    if !above.is_empty() {
        let above: Vec<String> = above.iter().map(usize::to_string).collect();
        note!("the input has {available} particles, which replace {}", above.join(", "));
        if !fit.contains(&available) {
            fit.push(available);
        }
    }
    fit
}
