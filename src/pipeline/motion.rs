//! The motion of particles while the shutter is open: from their velocities, or from their places in the next frame.

use std::borrow::Cow;

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use spherule_formats::ParticleFrame;
use spherule_formats::order::index_u32;
use spherule_formats::sequence::Sequence;

use super::decoded::{DecodedFrame, ids};
use super::load_error::{LoadError, first_file, missing};
use super::setup::Setup;
use super::shutter::Shutter;
use super::{ImageTask, SharedFrame};
use crate::accel::moving::bounded;
use crate::math::narrow;

/// Moves the particles of `frame` to their places in the middle of the exposure. Returns by how far each of them moves
/// from the opening of the shutter to its closing. Takes the velocities of the frame unless a channel needs them.
pub(super) fn expose(setup: &Setup, shutter: Shutter, frame: &mut DecodedFrame<'_>) -> Vec<Vec3> {
    let velocities = if setup.picture.render.channels.needs_velocities() {
        frame.shading.velocities.clone()
    } else {
        frame.shading.velocities.take()
    };
    // An empty frame has none
    let mut velocities = velocities.unwrap_or_default();
    velocities.resize(frame.centers.len(), Vec3::ZERO);
    displaced(shutter, &mut frame.centers, velocities)
}

/// Moves particles at `centers` to their places in the middle of the exposure. Returns by how far each of them moves from
/// the opening of the shutter to its closing.
pub(super) fn displaced(
    shutter: Shutter,
    centers: &mut Cow<'_, [Vec3]>,
    velocities: Vec<Vec3>,
) -> Vec<Vec3> {
    let mut displacements = velocities;
    let [middle, length] = shutter.middle_and_length().map(narrow);
    let centers = centers.to_mut().par_iter_mut();
    centers.zip(displacements.par_iter_mut()).for_each(|(center, velocity)| {
        *center += bounded(middle * *velocity);
        *velocity = bounded(length * *velocity);
    });
    displacements
}

/// The velocities that take the particles of `frame`, which was read for `task`, to their places in the next frame;
/// in the last frame, from their places in the one before. Particles that are only in one of the frames, and those that
/// leave a periodic box on one side and return on the other, have none.
///
/// # Errors
/// The other frame cannot be read, or one of them has no ids.
pub(super) fn velocities_to_next(
    setup: &Setup,
    shutter: Shutter,
    sequence: &Sequence,
    task: &ImageTask,
    frame: &SharedFrame<'_>,
) -> Result<Vec<Vec3>, LoadError> {
    // Read the other frame
    let is_last = task.index + 1 >= sequence.frames().len();
    let other_index = match (is_last, task.index) {
        (false, index) => index + 1,
        (true, 0) => return Ok(vec![Vec3::ZERO; frame.positions.len()]),
        (true, index) => index - 1,
    };
    let loaded = sequence.load_measured(other_index).map_err(LoadError::Frame)?;
    let other =
        ParticleFrame::from_raw(loaded.particles, setup.picture.origin).with_positions(Cow::Owned);
    // Determine the time between the frames; files know it best
    let known = frame.time.zip(other.time).map(|(a, b)| b - a);
    let usual = if is_last { -f64::from(shutter.step.time) } else { f64::from(shutter.step.time) };
    let time = known.filter(|time| *time != 0.0).unwrap_or(usual);
    // Find each particle there
    let ids_of = |frame: &SharedFrame<'_>, index: usize| match ids(frame) {
        None if !frame.is_empty() => {
            let file = first_file(sequence, index);
            let has = frame.attributes.iter().map(|a| a.name.as_str());
            Err(missing("id", "motion blur without velocities", &file, has))
        }
        ids => Ok(ids.unwrap_or_default()),
    };
    let (own, others) = (ids_of(frame, task.index)?, ids_of(&other, other_index)?);
    let places = Places::new(&others, &own);
    // Those that are drawn may be few
    let half_extent = if setup.picture.particles.selection.is_all() {
        0.5 * extent(&frame.positions)
    } else {
        0.5 * extent(&other.positions)
    };
    let velocity = |(place, id): (usize, &u32)| {
        let Some(at) = places.find(place, *id) else {
            return Vec3::ZERO;
        };
        let way = other.positions[at].as_dvec3() - frame.positions[place].as_dvec3();
        if way.abs().cmple(half_extent).all() { (way / time).as_vec3() } else { Vec3::ZERO }
    };
    Ok(own.par_iter().enumerate().map(velocity).collect())
}

/// Size of the box around `positions`; infinite along axes without extent.
fn extent(positions: &[Vec3]) -> DVec3 {
    let ends = positions
        .par_iter()
        .map(|p| [*p, *p])
        .reduce(|| [Vec3::INFINITY, Vec3::NEG_INFINITY], |a, b| [a[0].min(b[0]), a[1].max(b[1])]);
    let size = (ends[1] - ends[0]).as_dvec3();
    DVec3::select(size.cmpgt(DVec3::ZERO), size, DVec3::INFINITY)
}

/// The places of particles by their ids.
pub(super) struct Places<'a> {
    ids: &'a [u32],
    /// Ids with their places, ascending; empty if they are not needed.
    sorted: Vec<(u32, u32)>,
}

impl<'a> Places<'a> {
    /// The places in `ids` of the particles with ids `wanted`.
    pub(super) fn new(ids: &'a [u32], wanted: &[u32]) -> Self {
        // Most files have the same order
        if ids.starts_with(wanted) {
            let sorted = Vec::new();
            return Self { ids, sorted };
        }
        let mut sorted: Vec<(u32, u32)> =
            (0..index_u32(ids.len())).zip(ids).map(|(place, id)| (*id, place)).collect();
        sorted.par_sort_unstable();
        Self { ids, sorted }
    }

    /// The place of the particle `id`; `guess` if it is there, else the first of several.
    pub(super) fn find(&self, guess: usize, id: u32) -> Option<usize> {
        if self.ids.get(guess) == Some(&id) {
            return Some(guess);
        }
        let first = self.sorted.partition_point(|(other, _)| *other < id);
        let (found, place) = self.sorted.get(first)?;
        (*found == id).then_some(*place as usize)
    }
}
