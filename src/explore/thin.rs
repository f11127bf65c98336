//! Frames that do not fit into memory are shown as drafts, with every n-th particle. This is no setting: jobs and saved
//! pictures have all particles, or fail.

use spherule_formats::Sequence;
use spherule_formats::native::{Access, NativeFile};

use spherule_files::Bytes;

use super::error::ExploreError;
use crate::job::{RenderJob, RunError};
use crate::pipeline::{ImageTask, Setup};
use crate::survey::FrameWeight;

/// The largest n is two to this power.
const MAX_POWER: u32 = 20;

/// How a frame is read.
pub(super) struct Reading {
    /// The setup with the size of what is read.
    pub(super) setup: Setup,
    pub(super) task: ImageTask,
    /// Of so many particles one is read.
    pub(super) every: u32,
    /// What to say about it.
    pub(super) notes: Vec<String>,
}

/// How `frame` is read within the memory limit: with all of its particles if these fit, else with as many as fit. The
/// survey of `setup` has one of `surveyed` particles.
///
/// # Errors
/// There is no such frame, or it does not fit with any number of particles.
pub(super) fn reading(
    (job, setup): (&RenderJob, &Setup),
    sequence: &Sequence,
    frame: i64,
    surveyed: u32,
) -> Result<Reading, ExploreError> {
    let mut setup = setup.clone();
    let mut tasks = job.tasks(sequence, &[frame]);
    job.schedule(sequence, &setup, &mut tasks);
    let mut first = tasks.first().cloned().ok_or(ExploreError::NoFrame { frame })?;
    let Some(why) = first.refused.take() else {
        let notes = if surveyed > 1 { vec![note(surveyed, "")] } else { Vec::new() };
        return Ok(Reading { setup, task: first, every: surveyed, notes });
    };
    let refusal = || RunError::NothingFits { frame, source: why.clone() };
    // Particles of frames that are traced in place need no memory
    let known = setup.run.weight.filter(|own| !(own.in_place && setup.traces_in_place()));
    let known = known.ok_or_else(refusal)?;
    for factor in (1..=MAX_POWER).map(|power| 1 << power) {
        setup.run.weight = Some(if surveyed > 1 {
            thinned_again(&known, factor)
        } else {
            thinned(&known, sequence, first.index, factor)
        });
        tasks[0].refused = None;
        job.schedule(sequence, &setup, &mut tasks);
        if tasks[0].refused.is_none() {
            let every = surveyed.saturating_mul(factor);
            let notes = vec![note(every, &format!(": {why}"))];
            return Ok(Reading { setup, task: first, every, notes });
        }
    }
    Err(refusal().into())
}

fn note(every: u32, why: &str) -> String {
    format!("a draft with 1 of {every} particles, as not all of them fit into memory{why}")
}

/// Part of the memory limit that the numbers of a survey may have.
const PART: u64 = 4;

/// One of how many particles of `sequence` are surveyed within `limit`, if its frames do not fit as a whole; None if that
/// is no help.
pub(super) fn survey_every(sequence: &Sequence, limit: Option<Bytes>) -> Option<u32> {
    let limit = (limit?.0 / PART).max(1);
    let bytes = (0..sequence.frames().len()).map(|index| {
        let file = native(sequence, index)?;
        Some(8 * numbers_of(&file).saturating_mul(file.index().count))
    });
    // Frames of other formats are read as a whole first
    let most = bytes.collect::<Option<Vec<u64>>>()?.into_iter().max()?;
    u32::try_from(most.div_ceil(limit)).ok()?.checked_next_power_of_two().filter(|every| *every > 1)
}

/// The size of a frame of which one of `every` particles is read.
fn thinned(whole: &FrameWeight, sequence: &Sequence, index: usize, every: u32) -> FrameWeight {
    let share = |count: u64| count.div_ceil(u64::from(every));
    let particles = share(whole.particles);
    // Those without ids get some
    let ids = if whole.ids { 0 } else { 4 * particles };
    let thinned = FrameWeight { particles, ids: true, in_place: false, ..*whole };
    match native(sequence, index).map(|file| numbers_of(&file)) {
        // Native frames are mapped, and their numbers read in double precision
        Some(numbers) => FrameWeight {
            content: 0,
            raw: 8 * numbers * particles + ids,
            positions: 24 * particles,
            ..thinned
        },
        // Others are read as a whole first
        None => FrameWeight {
            content: whole.content.saturating_add(whole.raw),
            raw: share(whole.raw) + ids,
            positions: share(whole.positions),
            ..thinned
        },
    }
}

/// The size of a frame of which one of `factor` particles is read that were read before.
fn thinned_again(before: &FrameWeight, factor: u32) -> FrameWeight {
    let share = |count: u64| count.div_ceil(u64::from(factor));
    FrameWeight {
        particles: share(before.particles),
        raw: share(before.raw),
        positions: share(before.positions),
        ..*before
    }
}

/// The file of frame `index`, if it is native.
fn native(sequence: &Sequence, index: usize) -> Option<NativeFile> {
    NativeFile::open(sequence.native_file(index)?, Access::Map).ok()
}

/// Numbers of a particle in a native frame, with a radius.
fn numbers_of(file: &NativeFile) -> u64 {
    let numbers = file.index().attributes.iter().map(|own| u64::from(own.components));
    3 + numbers.sum::<u64>() + 1
}
