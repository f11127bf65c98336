//! `spherule inspect`: the content of particle files as text or JSON.

use std::collections::{BTreeMap, HashSet};
use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;
use spherule_formats::convert::open_source;
use spherule_formats::native::{FORMAT, layout, verify};
use spherule_formats::open::{is_native, notes};
use spherule_formats::sequence::{
    ListSummary, SequenceError, SequenceSettings, Topology, lone_frame_number, stands_for_others,
};
use spherule_formats::stats::FrameStats;
use spherule_formats::{
    FrameError, FrameFile, Labels, Positions, Sequence, SequenceInput, SimulationCell,
};

use super::errors::frame_message;
use super::manifest_args::is_manifest;
use super::print::{self, Reader};
use super::render::parts_text;
use super::{CliError, Outcome};
use crate::reading::read_budget;

mod native;
mod show;
mod steps;

use native::NativeFacts;
use steps::{ALL, StepLines, steps_to_read};

const EXAMPLES: &str = "\
Examples:
  spherule inspect run1/frame_0001.vtk
      Counts, bounds and attributes of one file
  spherule inspect --json run1
      The same for all frames of a directory, as JSON
  spherule inspect --verify run1-native
      Check all frames for damage";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct InspectArgs {
    /// Files, directories or patterns.
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// One JSON object per frame, one per line.
    #[arg(long)]
    json: bool,
    /// Read files outside the directory of a list of files, such as a .pvd, that names them.
    #[arg(long)]
    follow_links: bool,
    /// Read the vertices of meshes (PLY with faces) as particles.
    #[arg(long)]
    mesh_points: bool,
    /// File with the properties of the atoms of a trajectory: .gro, .pdb, .psf or other
    #[arg(long, value_name = "FILE")]
    topology: Option<PathBuf>,
    /// Check everything: all sections of native frames, every number of other files.
    #[arg(long)]
    verify: bool,
}

/// One particle frame of a file.
struct Inspected<'a> {
    file: &'a Path,
    format: &'static str,
    frame: Option<i64>,
    time: Option<f64>,
    /// How positions are stored.
    encoding: &'static str,
    stats: FrameStats,
    /// Bytes of the file per particle; None without particles.
    bytes_per_particle: Option<f64>,
    /// Summary of a native frame.
    native: Option<NativeFacts>,
    cell: Option<SimulationCell>,
    /// Texts behind the numbers of attributes.
    labels: Labels,
    /// Bonds between particles that the files list.
    bond_count: usize,
    /// The file of the topology.
    topology: Option<&'a Path>,
    /// Metadata of the file that is not per particle.
    notes: Vec<String>,
    /// Whether a full verification was requested and done.
    verified: bool,
}

pub(super) fn run(args: &InspectArgs) -> Result<Outcome, CliError> {
    let mut outcome = Outcome::Done;
    // Read the topology once for all files
    let topology = args
        .topology
        .as_ref()
        .map(|path| Topology::open(path, read_budget(None, None)))
        .transpose()
        .map_err(SequenceError::Topology)?;
    let request = Request { args, topology: topology.as_ref() };
    for meant in expand(args) {
        let printed = match &meant {
            Meant::Series(files) => request.print_series(files, &mut outcome)?,
            one => request.print(one, None, &mut outcome)?,
        };
        if printed == Reader::Gone {
            return Ok(outcome);
        }
    }
    Ok(outcome)
}

/// What is printed of each file.
struct Request<'a> {
    args: &'a InspectArgs,
    /// Gives its properties to all particles.
    topology: Option<&'a Topology>,
}

impl Request<'_> {
    /// Prints what is in `files` of a sequence: the first, the last, and what differs.
    fn print_series(&self, files: &[Meant], outcome: &mut Outcome) -> Result<Reader, CliError> {
        let bytes = files.iter().map(Meant::stored_len).fold(0, u64::saturating_add);
        let mut lines = StepLines::new("file", files.len());
        for index in steps_to_read(files.len(), bytes) {
            let printed = match files.get(index) {
                Some(file) => self.print(file, Some((&mut lines, index)), outcome)?,
                None => Reader::Listening,
            };
            if printed == Reader::Gone {
                return Ok(Reader::Gone);
            }
        }
        lines.finish()
    }

    /// Prints what is in a file, which may be one of a series.
    fn print(
        &self,
        meant: &Meant,
        series: Option<(&mut StepLines, usize)>,
        outcome: &mut Outcome,
    ) -> Result<Reader, CliError> {
        let (file, error) = match meant {
            Meant::List(list) => return list.print(self.args.json),
            Meant::Series(files) => return self.print_series(files, outcome),
            Meant::Nothing(argument, why) => (argument, why.clone()),
            Meant::File(file, place) => match self.inspect(file, *place, series) {
                Ok(printed) => return printed,
                Err(error) => (file, frame_message(&error)),
            },
        };
        // Print the errors of files among the results, so that every file has one
        *outcome = Outcome::SomeFailed;
        if self.args.json {
            return print::json(&json!({"file": file.display().to_string(), "error": error}));
        }
        error!("{error}");
        Ok(Reader::Listening)
    }

    /// Inspects one file. The outer error is of the file, the inner one of the output.
    fn inspect(
        &self,
        path: &Path,
        place: FramePlace,
        series: Option<(&mut StepLines, usize)>,
    ) -> Result<Result<Reader, CliError>, FrameError> {
        let Request { args, topology } = *self;
        // The index of a native frame has most of what is printed
        if topology.is_none() && is_native(path)? {
            let mut inspected = native::inspect(path, place.number, args.verify)?;
            inspected.time = place.time.or(inspected.time);
            return Ok(match series {
                Some((lines, index)) => lines.print(index, &inspected),
                None => inspected.print(args.json),
            });
        }
        let file = FrameFile::open_mapped(path, read_budget(None, None))?;
        let file = file.with_mesh_points(args.mesh_points);
        let count = file.steps().len();
        // For several steps, the metadata come from the first one.
        let mut of_file = notes(path);
        let mut lines = StepLines::new("step", count);
        let (lines, in_series) = match series {
            Some((lines, index)) => (lines, Some(index)),
            None => (&mut lines, None),
        };
        let reads_all = args.json || args.verify;
        let bytes = if reads_all { 0 } else { file.unpacked_len() };
        for index in steps_to_read(count, bytes) {
            let mut inspected = read(&file, index, place.number, topology)?;
            inspected.time = place.time.or(inspected.time);
            inspected.notes.retain(|note| !of_file.contains(note));
            inspected.notes.splice(..0, of_file.drain(..));
            if args.verify && inspected.native.is_some() {
                verify(file.bytes()).map_err(|e| e.in_file(path))?;
            }
            inspected.verified = args.verify;
            let printed = if args.json {
                inspected.print(true)
            } else {
                lines.print(in_series.unwrap_or(index), &inspected)
            };
            match printed {
                Ok(Reader::Listening) => {}
                ended => return Ok(ended),
            }
        }
        let ends = in_series.is_none() && !args.json;
        Ok(if ends { lines.finish() } else { Ok(Reader::Listening) })
    }
}

/// The file that an argument refers to.
enum Meant {
    /// A list of files.
    List(InspectedList),
    /// A file, with its frame.
    File(PathBuf, FramePlace),
    /// The files of a part of a long sequence.
    Series(Vec<Self>),
    /// An error.
    Nothing(PathBuf, String),
}

impl Meant {
    /// Bytes on the disk.
    fn stored_len(&self) -> u64 {
        match self {
            Self::File(path, _) => fs::metadata(path).map_or(0, |meta| meta.len()),
            Self::Series(_) | Self::List(_) | Self::Nothing(..) => 0,
        }
    }
}

/// The frame of a file, as far as it is known without reading the file.
#[derive(Debug, Clone, Copy)]
struct FramePlace {
    /// The number in the name if the file belongs to a sequence.
    number: Option<i64>,
    /// The simulation time that a list of files states.
    time: Option<f64>,
}

/// A list of files, such as a `.pvd`.
struct InspectedList {
    path: PathBuf,
    summary: ListSummary,
    parts: Vec<String>,
    /// Simulation time of each step.
    times: Vec<Option<f64>>,
}

impl InspectedList {
    /// The list at `path`, which `sequence` was made of; `None` if it was made of files of particles.
    fn of(path: &Path, sequence: &Sequence) -> Option<Self> {
        let steps = 0..sequence.frames().len();
        let parts = sequence.part_names();
        Some(Self {
            path: path.to_owned(),
            summary: sequence.list_summary()?.clone(),
            parts: parts.iter().filter(|part| !part.is_empty()).cloned().collect(),
            times: steps.map(|index| sequence.listed_time(index)).collect(),
        })
    }
}

/// The files of all arguments. An invalid argument does not affect the others.
fn expand(args: &InspectArgs) -> Vec<Meant> {
    let mut all = Vec::new();
    let mut known = HashSet::new();
    let settings = SequenceSettings {
        budget: read_budget(None, None),
        follow_links: args.follow_links,
        mesh_points: args.mesh_points,
    };
    for argument in &args.files {
        // A manifest is often given by mistake
        if is_manifest(argument) && argument.is_file() {
            let why = format!(
                "{}: a manifest, not particles; check it with: spherule check {0}",
                argument.display()
            );
            all.push(Meant::Nothing(argument.clone(), why));
            continue;
        }
        // Files stand for themselves; lists, directories and patterns are opened as a sequence
        match SequenceInput::from_path(argument) {
            SequenceInput::Files(listed) if !listed.iter().any(|file| stands_for_others(file)) => {
                for file in listed {
                    let place = FramePlace { number: lone_frame_number(&file), time: None };
                    known.insert(file.clone());
                    all.push(Meant::File(file, place));
                }
            }
            input => match Sequence::open_with(&input, settings) {
                Err(error) => all.push(Meant::Nothing(argument.clone(), error.to_string())),
                Ok(sequence) => {
                    let is_long = !args.json && !args.verify && is_long(&sequence);
                    add_list(argument, &sequence, &mut all);
                    let files = sequence_files(&sequence, &mut known);
                    if is_long {
                        all.extend(by_part(files));
                    } else {
                        all.extend(files.into_iter().map(|(_, file)| file));
                    }
                }
            },
        }
    }
    all
}

/// Adds the list that `argument` is, or prints the parts of the files that it stands for.
fn add_list(argument: &Path, sequence: &Sequence, all: &mut Vec<Meant>) {
    if let Some(list) = InspectedList::of(argument, sequence) {
        all.push(Meant::List(list));
    } else if let Some(parts) = parts_text(sequence) {
        message!("{}: {parts}", argument.display());
    }
}

/// The files of `sequence` that are not `known` yet, with the numbers of their parts.
fn sequence_files(sequence: &Sequence, known: &mut HashSet<PathBuf>) -> Vec<(u32, Meant)> {
    let mut files = Vec::new();
    for (index, frame) in sequence.frames().iter().enumerate() {
        let place = FramePlace { number: Some(frame.number), time: sequence.listed_time(index) };
        // A file with many steps is in many frames.
        for part in &frame.parts {
            if !known.insert(part.path.clone()) {
                continue;
            }
            let path = part.path.clone();
            let file = match sequence.check_listed(part) {
                Ok(()) => Meant::File(path, place),
                Err(error) => Meant::Nothing(path, error.to_string()),
            };
            files.push((part.part, file));
        }
    }
    files
}

/// Whether a part of `sequence` has many files, each of one step.
fn is_long(sequence: &Sequence) -> bool {
    let frames = sequence.frames();
    let has_one_each = frames.iter().all(|frame| {
        let parts = frame.parts.as_slice();
        parts.iter().all(|part| part.step.is_none())
            && parts.windows(2).all(|pair| pair[0].part != pair[1].part)
    });
    frames.len() > ALL && has_one_each
}

/// The files of each part as a series.
fn by_part(files: Vec<(u32, Meant)>) -> impl Iterator<Item = Meant> {
    let mut parts = BTreeMap::<u32, Vec<Meant>>::new();
    for (part, file) in files {
        parts.entry(part).or_default().push(file);
    }
    parts.into_values().map(Meant::Series)
}

/// What is in a step of a file.
struct Contents {
    stats: FrameStats,
    time: Option<f64>,
    cell: Option<SimulationCell>,
    encoding: &'static str,
    notes: Vec<String>,
    labels: Labels,
    bond_count: usize,
}

impl Contents {
    /// The only step of the file at `path`, with a part of its particles in memory at a time; `None` if its format
    /// does not allow it.
    fn in_blocks(path: &Path) -> Result<Option<Self>, FrameError> {
        let Some(source) = open_source(path)? else {
            return Ok(None);
        };
        let contents = Self {
            stats: FrameStats::of_source(&*source)?,
            time: source.time(),
            cell: source.cell(),
            notes: source.notes().to_vec(),
            labels: source.labels(),
            // Formats with bonds are not read in blocks
            bond_count: 0,
            encoding: match source.position_len() {
                Some(12) => "f32",
                _ => "f64",
            },
        };
        Ok(Some(contents))
    }

    /// Step `index` of `file`, with the properties of `topology`.
    fn at_once(
        file: &FrameFile,
        index: usize,
        topology: Option<&Topology>,
    ) -> Result<Self, FrameError> {
        let mut raw = file.read(index)?;
        if let Some(topology) = topology {
            topology.add_to(&mut raw, file.path())?;
        }
        Ok(Self {
            stats: FrameStats::of(&raw),
            notes: raw.notes,
            labels: raw.labels,
            bond_count: raw.bonds.len(),
            time: raw.time,
            cell: raw.cell,
            encoding: match raw.positions {
                Positions::F32(_) => "f32",
                Positions::F64(_) => "f64",
            },
        })
    }
}

/// Reads step `index` of `file`.
fn read<'a>(
    file: &'a FrameFile,
    index: usize,
    number: Option<i64>,
    topology: Option<&'a Topology>,
) -> Result<Inspected<'a>, FrameError> {
    // Large files are read in blocks; a topology and meshes need all particles at once
    let in_blocks = match topology {
        None if file.steps().len() == 1 && !file.has_mesh_points() => {
            Contents::in_blocks(file.path())?
        }
        _ => None,
    };
    let contents = match in_blocks {
        Some(contents) => contents,
        None => Contents::at_once(file, index, topology)?,
    };
    let mut stats = contents.stats;
    // Number the frame
    let step = &file.steps()[index];
    let running = i64::try_from(index).ok();
    let number = if file.steps().len() > 1 { running } else { number };
    // A native frame comes here packed by gzip.
    let native = (file.format() == FORMAT).then(|| layout::parse(file.bytes()).ok()).flatten();
    let all = stats.count + stats.dropped;
    stats.dropped += native.as_ref().map_or(0, |index| index.dropped);
    // Share the bytes of the file among its steps
    let share = match file.steps().len() {
        1 => 1.0,
        _ => step
            .byte_range()
            .map_or(1.0, |range| range.len() as f64 / file.unpacked_len().max(1) as f64),
    };
    let stored = file.stored_len() as f64 * share;
    Ok(Inspected {
        file: file.path(),
        format: file.format().name(),
        frame: step.number.or(number),
        time: contents.time,
        encoding: match &native {
            Some(index) => index.encoding().name(),
            None => contents.encoding,
        },
        stats,
        bytes_per_particle: (all > 0).then(|| stored / all as f64),
        native: native.map(|index| NativeFacts::new(index, file.bytes().len() as u64, None)),
        cell: contents.cell,
        labels: contents.labels,
        bond_count: contents.bond_count,
        topology: topology.map(Topology::path),
        notes: contents.notes,
        verified: false,
    })
}
