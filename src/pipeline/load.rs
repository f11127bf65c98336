//! First stage: reads the files of a frame into the form that tree and shading need.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::path::Path;
use std::time::{Duration, Instant};

use glam::{DVec3, Vec3};
use spherule_files::counted;
use spherule_files::memory::{available, process_room};
use spherule_formats::sequence::Sequence;
use spherule_formats::{FrameError, ParticleFrame, PositionSlice, RawParticles};

use super::arrows::arrows_of;
use super::bonds::bonds_of;
use super::decoded::{DecodedFrame, particle_with_id};
use super::facts::FileFacts;
use super::in_place::{Opened, StoredFrame};
use super::load_error::{LoadError, first_file, unknown_name};
use super::meshes::{MeshSlices, meshes_of};
use super::motion::velocities_to_next;
use super::predict::{FrameSize, MemoryModel};
use super::rods::{FrameRods, rods_of};
use super::setup::RodLook;
use super::setup::{Picture, Setup};
use super::styles::{StyleRanges, in_order_of_styles};
use super::trails::trails_of;
use super::{ImageTask, SharedFrame};
use crate::overlay::Overlay;

/// A frame before its tree is built.
#[derive(Debug)]
pub struct LoadedFrame<'a> {
    /// The image to be made.
    pub task: ImageTask,
    /// Notes for the user.
    pub notes: Vec<String>,
    /// The particles.
    pub particles: LoadedParticles<'a>,
    /// The meshes of the image, one for each of the setup.
    pub meshes: Vec<MeshSlices>,
    /// Rods next to the particles.
    pub rods: Vec<FrameRods>,
    /// What overlays show of the file.
    pub facts: FileFacts,
    /// Simulation time, if known.
    pub time: Option<f64>,
    /// Position of the particle in focus, relative to the origin, if the camera follows one.
    pub focus: Option<Vec3>,
    /// Number of particles in the files.
    pub read: u64,
    /// Number of particles that were dropped because they were not finite.
    pub dropped: u64,
    /// Number of radii raised to the minimum.
    pub clamped_radii: u64,
    /// Time spent on reading.
    pub read_time: Duration,
}

/// The particles of a frame.
#[derive(Debug)]
pub enum LoadedParticles<'a> {
    /// In memory.
    Decoded(DecodedFrame<'a>),
    /// In a native frame, to be traced in place.
    Stored(StoredFrame),
}

impl LoadedParticles<'_> {
    /// Particle count.
    pub fn count(&self) -> u64 {
        match self {
            Self::Decoded(frame) => frame.centers.len() as u64,
            Self::Stored(frame) => frame.particles(),
        }
    }
}

/// Reads the frame of `task`.
///
/// # Errors
/// See [`LoadError`]; other frames are not affected.
pub fn load_frame(
    setup: &Setup,
    sequence: &Sequence,
    task: &ImageTask,
) -> Result<LoadedFrame<'static>, LoadError> {
    let start = Instant::now();
    let mut notes = Vec::new();
    // Trace a native frame in place if possible; otherwise decode the frame
    let opened = StoredFrame::open(setup, sequence, task.index);
    let mut loaded = match opened.map_err(|e| newest(e, sequence, task))? {
        Opened::InPlace(frame, clamped_radii) => LoadedFrame {
            read: frame.particles(),
            rods: rods_of(cell_style(setup), frame.cell(), task.frame, &mut notes),
            facts: frame.facts(setup, without_directory(&first_file(sequence, task.index))),
            time: sequence.listed_time(task.index).or(frame.time()),
            task: task.clone(),
            notes,
            focus: None,
            particles: LoadedParticles::Stored(frame),
            meshes: Vec::new(),
            dropped: 0,
            clamped_radii,
            read_time: Duration::ZERO,
        },
        Opened::Decode(why) => {
            notes.extend(why);
            decode(setup, sequence, task, notes)?
        }
    };
    // Both ways end alike, with meshes and what belongs to this image
    loaded.finish(setup)?;
    loaded.read_time = start.elapsed();
    Ok(loaded)
}

/// Reads the frame of `task` into memory.
fn decode(
    setup: &Setup,
    sequence: &Sequence,
    task: &ImageTask,
    mut notes: Vec<String>,
) -> Result<LoadedFrame<'static>, LoadError> {
    // Refuse a frame that does not fit, before it is read
    check_memory(setup, sequence, task)?;
    let loaded = sequence
        .load_measured(task.index)
        .map_err(|e| newest(LoadError::Frame(e), sequence, task))?;
    notes.extend(loaded.notes);
    // Select particles
    let file = first_file(sequence, task.index);
    let read = loaded.particles.positions.len() as u64;
    let (frame, ranges) = selected(setup, loaded.particles, &file)?;
    // Read other frames, for motion and for trails
    let moving = match setup.picture.view.shutter {
        Some(shutter) if !shutter.has_velocities => {
            Some(velocities_to_next(setup, shutter, sequence, task, &frame)?)
        }
        _ => None,
    };
    let trails = trails_of(setup, sequence, task, (&frame, &ranges, read), &mut notes)?;
    // Extract what pictures need
    let mut loaded = decoded(setup, task, (frame, ranges), read, &file, notes)?;
    loaded.rods.extend(trails);
    if let (Some(moving), LoadedParticles::Decoded(frame)) = (moving, &mut loaded.particles) {
        frame.shading.velocities = Some(moving);
    }
    Ok(loaded)
}

/// Prepares particles in memory for the image of `task`; `name` stands for their file. There is no next frame, so
/// motion blur needs velocities.
///
/// # Errors
/// Same as [`load_frame`].
pub fn load_particles<'a>(
    setup: &Setup,
    particles: RawParticles<PositionSlice<'a>>,
    name: &str,
    task: &ImageTask,
) -> Result<LoadedFrame<'a>, LoadError> {
    let start = Instant::now();
    let read = particles.positions.len() as u64;
    let rules = &setup.picture.particles;
    let (frame, ranges) = if rules.selection.is_all() && !rules.is_divided() {
        one_range(ParticleFrame::borrowed(particles, setup.picture.origin))
    } else {
        selected(setup, particles.to_owned_particles(), name)?
    };
    let mut loaded = decoded(setup, task, (frame, ranges), read, name, Vec::new())?;
    loaded.finish(setup)?;
    loaded.read_time = start.elapsed();
    Ok(loaded)
}

/// Extracts from `frame`, which was read from `file` with `read` particles, what the image of `task` needs; adds its notes to
/// `notes`.
fn decoded<'a>(
    setup: &Setup,
    task: &ImageTask,
    (frame, ranges): (SharedFrame<'a>, StyleRanges),
    read: u64,
    file: &str,
    mut notes: Vec<String>,
) -> Result<LoadedFrame<'a>, LoadError> {
    // Say why nothing is drawn
    if frame.is_empty() && read > 0 && frame.dropped == 0 {
        notes.push(format!(
            "frame {}: none of {read} particles is selected; see [select] and [[clip]]",
            task.frame
        ));
    }
    let (time, dropped) = (frame.time, frame.dropped);
    // Extract what needs all attributes, before they are dropped
    let focus = focus_point(setup, &frame, file)?;
    let mut rods = rods_of(cell_style(setup), frame.cell.as_ref(), task.frame, &mut notes);
    rods.extend(arrows_of(setup, (&frame, &ranges), (task.frame, file), &mut notes)?);
    rods.extend(bonds_of(setup, (&frame, &ranges), (task.frame, file), &mut notes)?);
    let facts = FileFacts::of_decoded(setup, &frame, without_directory(file));
    // Extract particles and shading
    let (particles, clamped_radii) =
        DecodedFrame::of(setup, (frame, ranges), task.frame, file, &mut notes)?;
    Ok(LoadedFrame {
        task: task.clone(),
        notes,
        particles: LoadedParticles::Decoded(particles),
        meshes: Vec::new(),
        rods,
        facts,
        time,
        focus,
        read,
        dropped,
        clamped_radii,
        read_time: Duration::ZERO,
    })
}

/// How the simulation cell is drawn, if it is, and the origin.
fn cell_style(setup: &Setup) -> (Option<&RodLook>, DVec3) {
    (setup.picture.things.cell.as_ref(), setup.picture.origin)
}

/// The particles that are drawn, in the order of their styles.
fn selected(
    setup: &Setup,
    particles: RawParticles,
    file: &str,
) -> Result<(SharedFrame<'static>, StyleRanges), LoadError> {
    let Picture { particles: rules, origin, .. } = &setup.picture;
    let (selection, division) = (&rules.selection, &rules.division);
    let from_raw = |raw| ParticleFrame::from_raw(raw, *origin).with_positions(Cow::Owned);
    if selection.is_all() && division.is_one() {
        return Ok(one_range(from_raw(particles)));
    }
    let survivors = selection
        .survivors(&particles)
        .map_err(|e| unknown_name(&e, ("select.where", file), &particles.attributes))?;
    if !division.is_one() {
        return in_order_of_styles(setup, particles, &survivors, file);
    }
    Ok(one_range(if survivors.len() == particles.positions.len() {
        from_raw(particles)
    } else {
        ParticleFrame::from_selected(particles, survivors, *origin).with_positions(Cow::Owned)
    }))
}

/// A frame without styles.
fn one_range(frame: SharedFrame<'_>) -> (SharedFrame<'_>, StyleRanges) {
    let ranges = StyleRanges::whole(frame.len());
    (frame, ranges)
}

/// A note on the characters that the font of overlays does not have.
fn missing_glyphs(setup: &Setup) -> Option<String> {
    let overlays = setup.picture.files.overlays.iter();
    let missing: BTreeSet<char> = overlays.flat_map(Overlay::missing_glyphs).collect();
    let shown: Vec<String> = missing.iter().map(|c| format!("`{c}`")).collect();
    (!shown.is_empty()).then(|| {
        let all = shown.join(", ");
        format!(
            "overlay: the font, which has Latin, Greek and mathematical signs, has no glyph for {all}; boxes are \
             drawn"
        )
    })
}

/// The name of `file` without its directory.
fn without_directory(file: &str) -> String {
    let name = Path::new(file).file_name();
    name.map_or(file.to_owned(), |name| name.to_string_lossy().into_owned())
}

/// The position of the particle in focus, relative to the origin; None if the camera does not follow one.
fn focus_point(
    setup: &Setup,
    frame: &SharedFrame<'_>,
    file: &str,
) -> Result<Option<Vec3>, LoadError> {
    let Some(id) = setup.focused_particle() else {
        return Ok(None);
    };
    match particle_with_id(frame, id) {
        Some(index) => Ok(Some(frame.positions[index])),
        None => Err(LoadError::NoFocus { file: file.to_owned(), id }),
    }
}

impl LoadedFrame<'_> {
    /// Adds notes for the user, and reads the meshes.
    fn finish(&mut self, setup: &Setup) -> Result<(), LoadError> {
        self.note_count(self.dropped, "left out: a coordinate is not finite or too far away");
        self.note_count(
            self.clamped_radii,
            "with a raised radius: it was too small to be seen, or no number",
        );
        self.note_absent_styles(setup);
        self.notes.extend(missing_glyphs(setup));
        self.meshes = meshes_of(
            &setup.picture.things.meshes,
            setup.picture.view.shutter,
            &self.task,
            &mut self.notes,
        )?;
        Ok(())
    }

    /// Notes styles that no particle has.
    fn note_absent_styles(&mut self, setup: &Setup) {
        let LoadedParticles::Decoded(frame) = &self.particles else {
            return;
        };
        let styles = setup.picture.particles.styles.iter().enumerate();
        let absent = styles.filter(|(index, style)| {
            !style.is_of_rest && frame.shading.ranges.of(*index).is_empty()
        });
        let is_empty = frame.centers.is_empty();
        let notes = absent.filter(|_| !is_empty).map(|(_, style)| {
            format!("frame {}: no particle is of style `{}`", self.task.frame, style.name)
        });
        self.notes.extend(notes.collect::<Vec<_>>());
    }

    /// Notes what has been done with `count` particles.
    fn note_count(&mut self, count: u64, what: &str) {
        if count > 0 {
            let note = format!("frame {}: {} {what}", self.task.frame, counted(count, "particle"));
            self.notes.push(note);
        }
    }
}

/// Marks errors of the last frame of a sequence, which may still be growing.
fn newest(error: LoadError, sequence: &Sequence, task: &ImageTask) -> LoadError {
    match error {
        LoadError::Frame(error @ FrameError::Malformed { .. })
            if task.index + 1 == sequence.frames().len() =>
        {
            LoadError::Newest(error)
        }
        other => other,
    }
}

/// Rejects a frame that cannot fit into memory, before the system kills the whole job.
fn check_memory(setup: &Setup, sequence: &Sequence, task: &ImageTask) -> Result<(), LoadError> {
    let size = FrameSize::of_task(sequence, task, setup);
    let need = MemoryModel::new(setup).decoding(&size);
    match available().into_iter().chain(process_room()).min() {
        Some(available) if need > available => Err(LoadError::TooLarge {
            file: first_file(sequence, task.index),
            need: need >> 20,
            available: available >> 20,
        }),
        _ => Ok(()),
    }
}
