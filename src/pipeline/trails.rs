//! Trails of particles over earlier frames of the sequence.

use std::borrow::Cow;

use glam::Vec3;
use spherule_formats::order::index_u32;
use spherule_formats::sequence::Sequence;
use spherule_formats::{Lattice, ParticleFrame, SimulationCell};

use super::arrows::every_nth;
use super::decoded::ids;
use super::load_error::{LoadError, first_file, missing};
use super::motion::Places;
use super::rods::FrameRods;
use super::setup::{Setup, TrailStyle};
use super::styles::StyleRanges;
use super::{ImageTask, SharedFrame};
use crate::surface::rods::{Caps, Rod};
use crate::survey::id_of;

/// The trails of the particles of `frame`, which was read for `task` from files with `read` particles. Passes notes to
/// `notes`.
///
/// # Errors
/// Particles cannot be found in an earlier frame: there are no ids, and their number changes.
pub(super) fn trails_of(
    setup: &Setup,
    sequence: &Sequence,
    task: &ImageTask,
    (frame, ranges, read): (&SharedFrame<'_>, &StyleRanges, u64),
    notes: &mut Vec<String>,
) -> Result<Vec<FrameRods>, LoadError> {
    let styles = setup.picture.things.trails.iter().filter(|_| !frame.is_empty());
    styles
        .map(|style| trails_in(style, setup, sequence, task, (frame, ranges, read), notes))
        .collect()
}

/// The trails of one style.
fn trails_in(
    style: &TrailStyle,
    setup: &Setup,
    sequence: &Sequence,
    task: &ImageTask,
    (frame, ranges, read): (&SharedFrame<'_>, &StyleRanges, u64),
    notes: &mut Vec<String>,
) -> Result<FrameRods, LoadError> {
    // Extend the trails frame by frame into the past
    let file = first_file(sequence, task.index);
    let (has_ids, own) = identities(frame);
    let mut trails = Trails::new(style, (frame, ranges));
    for age in 1..=style.frames.min(index_u32(task.index)) {
        let index = task.index - age as usize;
        let loaded = match sequence.load_measured(index) {
            Ok(loaded) => loaded.particles,
            Err(error) => {
                notes.push(format!(
                    "frame {}: trails pass over a frame that cannot be read: {error}",
                    task.frame
                ));
                continue;
            }
        };
        let count = loaded.positions.len() as u64;
        let earlier =
            ParticleFrame::from_raw(loaded, setup.picture.origin).with_positions(Cow::Owned);
        let (has_others, others) = identities(&earlier);
        // Native frames have an order of their own
        let is_native = [task.index, index].map(|index| sequence.native_file(index).is_some());
        let has_order = count == read && is_native == [false; 2];
        if !(has_ids && has_others || has_order || earlier.is_empty()) {
            return Err(unidentified(frame, &file, is_native));
        }
        let places = Places::new(&others, &own);
        let find = |particle: usize| {
            let place = places.find(particle, own[particle])?;
            Some(earlier.positions[place])
        };
        trails.extend(age, frame.cell.as_ref(), find);
    }
    notes.extend(gap_note(sequence, task, style.frames));
    // Trails have the colours of their particles in the current frame
    let (rods, owners) = ((trails.rods, Caps::Round), trails.owners.into_iter());
    style.look.rods((setup, frame), (task.frame, &file), rods, owners)
}

/// The error of particles that cannot be found in an earlier frame; `is_native` is of this frame and of that one.
fn unidentified(frame: &SharedFrame<'_>, file: &str, is_native: [bool; 2]) -> LoadError {
    let has = frame.attributes.iter().map(|a| a.name.as_str());
    let purpose = match is_native {
        [false, false] => "trails, since the number of particles changes",
        _ => "trails, since native frames have an order of their own",
    };
    missing("id", purpose, file, has)
}

/// Whether particles have ids, and the ids; without them, their places in the file.
fn identities(frame: &SharedFrame<'_>) -> (bool, Vec<u32>) {
    let has_ids = id_of(&frame.attributes).is_some();
    let found = ids(frame).unwrap_or_else(|| (0..index_u32(frame.len())).collect());
    (has_ids, found)
}

/// A note if the frames of a trail are not equally far apart.
fn gap_note(sequence: &Sequence, task: &ImageTask, frames: u32) -> Option<String> {
    let first = task.index.saturating_sub(frames as usize);
    let numbers: Vec<i64> =
        sequence.frames().get(first..=task.index)?.iter().map(|f| f.number).collect();
    let step = |pair: &&[i64]| pair[1].saturating_sub(pair[0]);
    let usual = numbers.windows(2).map(|pair| step(&pair)).min()?;
    let gap = numbers.windows(2).find(|pair| step(pair) > usual)?;
    Some(format!(
        "frame {}: trails cross a gap between the frames {} and {}",
        task.frame, gap[0], gap[1]
    ))
}

/// The trails of a frame.
struct Trails<'a> {
    style: &'a TrailStyle,
    rods: Vec<Rod>,
    /// The particle of each trail.
    owners: Vec<usize>,
    /// The oldest point of each trail with its age in frames; None where the trail has ended.
    ends: Vec<Option<(Vec3, u32)>>,
}

impl<'a> Trails<'a> {
    fn new(style: &'a TrailStyle, (frame, ranges): (&SharedFrame<'_>, &StyleRanges)) -> Self {
        let owners = every_nth((frame, ranges), style.style, style.every);
        let ends = owners.iter().map(|particle| Some((frame.positions[*particle], 0)));
        Self { style, rods: Vec::new(), ends: ends.collect(), owners }
    }

    /// Adds the points that `find` has for particles, `age` frames earlier. Trails of particles without one end. Jumps
    /// over a periodic boundary of `cell` are left out.
    fn extend(
        &mut self,
        age: u32,
        cell: Option<&SimulationCell>,
        find: impl Fn(usize) -> Option<Vec3>,
    ) {
        let lattice = cell.map(Lattice::new);
        // Extend the trail of each particle that was there in the frame after this one
        for ((trail, owner), end) in (0..).zip(&self.owners).zip(&mut self.ends) {
            let Some((newer, newer_age)) = *end else {
                continue;
            };
            let older = find(*owner);
            *end = older.map(|point| (point, age));
            // End it where the particle is missing, and interrupt it where it jumps
            let Some(older) = older else { continue };
            let image = lattice.as_ref().and_then(|lattice| lattice.image(newer - older));
            if image.is_some() {
                continue;
            }
            self.rods.push(Rod {
                ends: [newer, older],
                radii: [newer_age, age].map(|age| self.style.radius_at(age)),
                particles: [trail; 2],
            });
        }
    }
}
