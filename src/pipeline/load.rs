//! First stage: a frame's files become positions, radii and the few numbers that shading needs.

use std::time::{Duration, Instant};

use glam::Vec3;
use rayon::prelude::*;
use spherule_formats::sequence::Sequence;
use spherule_formats::{Attribute, AttributeData, FrameError, ParticleFrame, Radius};

use super::ImageTask;
use super::predict::{FrameSize, MemoryModel};
use super::setup::{ColorRule, RadiusRule, Setup};
use crate::report::memory::available;
use crate::survey::{id_of, velocity_of};

/// Why a frame cannot be drawn.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// Its files cannot be read.
    #[error(transparent)]
    Frame(FrameError),
    /// The same for the last frame of the sequence, which a simulation may be at.
    #[error("{0}; it is the newest frame, perhaps still being written: render again later")]
    Newest(FrameError),
    /// It would not fit.
    #[error("{file}: the frame needs about {need} MiB, {available} MiB of memory are free")]
    TooLarge {
        /// The frame's first file.
        file: String,
        /// What reading needs, estimated.
        need: u64,
        /// What there is.
        available: u64,
    },
    /// It lacks an attribute that the job needs.
    #[error("{file}: no attribute `{name}` for {purpose}; it has {has}")]
    MissingAttribute {
        /// The frame's first file.
        file: String,
        /// What was looked for.
        name: String,
        /// What for.
        purpose: &'static str,
        /// What there is.
        has: String,
    },
}

/// A frame in memory, ready for the tree.
#[derive(Debug)]
pub struct LoadedFrame {
    /// The image that it is for.
    pub task: ImageTask,
    /// What the user should know of it.
    pub notes: Vec<String>,
    /// Centres relative to the origin.
    pub centers: Vec<Vec3>,
    /// Radii.
    pub radius: Radius,
    /// Numbers for the colour map, one a particle; empty with a constant colour, and in a frame
    /// that lacks an attribute which nobody asked for.
    pub values: Vec<f32>,
    /// Numbers for the `id` channel; None if the particle's index serves.
    pub ids: Option<Vec<u32>>,
    /// Velocities for the `V` channel.
    pub velocities: Option<Vec<Vec3>>,
    /// Simulation time, if known.
    pub time: Option<f64>,
    /// Particles left out because they were not finite.
    pub dropped: u64,
    /// Radii raised to the least.
    pub clamped_radii: u64,
    /// Time that reading took.
    pub read_time: Duration,
}

/// Reads the frame of `task`.
///
/// # Errors
/// See [`LoadError`]; the other frames are not concerned.
pub fn load_frame(
    setup: &Setup,
    sequence: &Sequence,
    task: &ImageTask,
) -> Result<LoadedFrame, LoadError> {
    let start = Instant::now();
    check_memory(setup, sequence, task)?;
    let is_newest = task.index + 1 == sequence.frames().len();
    let loaded = sequence.load_measured(task.index).map_err(|error| {
        let is_damage = matches!(error, FrameError::Malformed { .. });
        if is_newest && is_damage && !error.to_string().contains("being written") {
            LoadError::Newest(error)
        } else {
            LoadError::Frame(error)
        }
    })?;
    let mut notes = loaded.notes;
    let frame = ParticleFrame::from_raw(loaded.particles, setup.origin);
    let file = || {
        let inputs = sequence.inputs(task.index);
        inputs
            .first()
            .map_or_else(String::new, |p| p.display().to_string())
    };
    let (radius, clamped_radii) = radii(setup, &frame, &file)?;
    for (count, what) in [
        (
            frame.dropped,
            "particles left out: a coordinate is not finite",
        ),
        (
            clamped_radii,
            "radii raised: too small to be seen, or no number",
        ),
    ] {
        if count > 0 {
            notes.push(format!("frame {}: {count} {what}", task.frame));
        }
    }
    let values = match &setup.color {
        ColorRule::Constant(_) => Vec::new(),
        ColorRule::Attribute { name, required, .. } => {
            let found = if *required {
                attribute(&frame, name, "colour", &file)?
            } else {
                frame.attribute(name)
            };
            found.map_or_else(Vec::new, |attribute| magnitudes(attribute, 1.0))
        }
    };
    let channels = setup.render.channels;
    let ids = if channels.id { ids(&frame) } else { None };
    let velocities = if channels.velocity {
        velocity_of(&frame.attributes).map(vectors)
    } else {
        None
    };
    Ok(LoadedFrame {
        task: task.clone(),
        notes,
        radius,
        values,
        ids,
        velocities,
        time: frame.time,
        dropped: frame.dropped,
        clamped_radii,
        centers: frame.positions,
        read_time: start.elapsed(),
    })
}

/// Refuses a frame that cannot fit, before the system ends the whole job for it.
fn check_memory(setup: &Setup, sequence: &Sequence, task: &ImageTask) -> Result<(), LoadError> {
    let size = FrameSize::of(sequence, task.index, setup.weight.as_ref());
    let need = MemoryModel::new(setup).reading(&size);
    match available() {
        Some(available) if need > available => {
            let inputs = sequence.inputs(task.index);
            Err(LoadError::TooLarge {
                file: inputs
                    .first()
                    .map_or_else(String::new, |p| p.display().to_string()),
                need: need >> 20,
                available: available >> 20,
            })
        }
        _ => Ok(()),
    }
}

/// The attribute `name`; None in a frame without particles, which need not declare any.
fn attribute<'a>(
    frame: &'a ParticleFrame,
    name: &str,
    purpose: &'static str,
    file: &dyn Fn() -> String,
) -> Result<Option<&'a Attribute>, LoadError> {
    let found = frame.attribute(name);
    if found.is_none() && !frame.is_empty() {
        return Err(LoadError::MissingAttribute {
            file: file(),
            name: name.to_owned(),
            purpose,
            has: attribute_list(frame.attributes.iter().map(|a| a.name.as_str())),
        });
    }
    Ok(found)
}

/// Names for a message.
pub(crate) fn attribute_list<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let names: Vec<String> = names.map(|n| format!("`{n}`")).collect();
    if names.is_empty() {
        "none".to_owned()
    } else {
        names.join(", ")
    }
}

/// The radii of a frame and how many had to be raised.
fn radii(
    setup: &Setup,
    frame: &ParticleFrame,
    file: &dyn Fn() -> String,
) -> Result<(Radius, u64), LoadError> {
    let mut radius = match &setup.radius {
        RadiusRule::Common(radius) => Radius::Common(*radius),
        RadiusRule::FileOr(radius) => frame.radius.clone().unwrap_or(Radius::Common(*radius)),
        RadiusRule::Attribute { name, scale } => {
            match attribute(frame, name, "the radius", file)? {
                Some(attribute) => Radius::PerParticle(magnitudes(attribute, f64::from(*scale))),
                None => Radius::Common(setup.least_radius),
            }
        }
    };
    if frame.is_empty() {
        return Ok((radius, 0));
    }
    let least = setup.least_radius;
    let mut clamped = 0;
    let mut raise = |radius: &mut f32| {
        // Also true for NaN.
        if !(*radius >= least && radius.is_finite()) {
            *radius = least;
            clamped += 1;
        }
    };
    match &mut radius {
        Radius::Common(radius) => raise(radius),
        Radius::PerParticle(radii) => radii.iter_mut().for_each(raise),
    }
    Ok((radius, clamped))
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "colours need no more than f32"
)]
fn magnitudes(attribute: &Attribute, scale: f64) -> Vec<f32> {
    (0..attribute.count())
        .into_par_iter()
        .map(|i| (attribute.magnitude(i) * scale) as f32)
        .collect()
}

#[expect(clippy::cast_possible_truncation, reason = "the channel is f32")]
fn vectors(attribute: &Attribute) -> Vec<Vec3> {
    let value = |i: usize| attribute.data.get_f64(i) as f32;
    (0..attribute.count())
        .into_par_iter()
        .map(|i| Vec3::new(value(3 * i), value(3 * i + 1), value(3 * i + 2)))
        .collect()
}

/// The particles' ids, or the place in the file of particles that others were dropped between.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the channel has 32 bits; larger ids keep their low ones"
)]
fn ids(frame: &ParticleFrame) -> Option<Vec<u32>> {
    Some(match id_of(&frame.attributes).map(|a| &a.data) {
        Some(AttributeData::U32(v)) => v.clone(),
        Some(AttributeData::I32(v)) => v.iter().map(|id| id.cast_unsigned()).collect(),
        Some(AttributeData::U64(v)) => v.iter().map(|id| *id as u32).collect(),
        Some(AttributeData::I64(v)) => v.iter().map(|id| *id as u32).collect(),
        Some(AttributeData::U16(v)) => v.iter().map(|id| u32::from(*id)).collect(),
        _ => return frame.file_index.clone(),
    })
}
