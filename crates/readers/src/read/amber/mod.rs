//! AMBER trajectories and restart files: NetCDF classic files with the conventions `AMBER` and `AMBERRESTART`.
//!
//! `netcdf` reads the header of any classic file; here are the variables of the conventions, version 1.0. Lengths are A,
//! velocities A/ps, times ps, unless the variables have other `units`: LAMMPS writes those of the run. Times are
//! converted to ps. Files of other conventions are rejected.

use super::columns::{ComponentStride, ParticleLayout, StridedColumn};
use super::{ByteSource, CUT_SHORT, Step, notes, text};
use crate::format::Format;
use crate::reader::{Confidence, FormatInfo, Reader};
use spherule_frame::{
    AttributeData, Endian, ParseError, Positions, RawParticles, ScalarType, SimulationCell,
};

mod netcdf;

use netcdf::{NetCdf, Variable};

/// AMBER NetCDF files.
pub const FORMAT: Format = Format::new(&Amber);

struct Amber;

impl Reader for Amber {
    fn info(&self) -> FormatInfo {
        FormatInfo {
            time_unit: Some("ps"),
            ..FormatInfo::molecular("amber", &["nc", "ncdf", "ncrst"])
        }
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        let is_netcdf = matches!(head, [b'C', b'D', b'F', 1 | 2 | 5, ..]);
        Ok(Confidence::signature_if(is_netcdf))
    }

    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let budget = source.budget();
        let trajectory = Trajectory::parse(source.bytes())?;
        let mut steps = Vec::new();
        for frame in 0..trajectory.frames {
            Step::push_with_key(&mut steps, frame as u64, budget)?;
        }
        for step in &mut steps {
            step.time = trajectory.time(step.index);
        }
        Ok(steps)
    }

    fn read(&self, source: &mut ByteSource<'_>, step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        let bytes = source.bytes();
        let trajectory = Trajectory::parse(bytes)?;
        let frame = usize::try_from(step.key()).unwrap_or(usize::MAX);
        let layout = trajectory.layout(frame)?;
        budget.check(layout.byte_len(), "its numbers in memory are")?;
        let mut particles = layout.particles(bytes)?;
        trajectory.scale(&mut particles);
        particles.cell = trajectory.cell(frame);
        Ok(particles)
    }

    /// `None` for several frames, and if numbers are stored in another unit.
    fn layout(&self, bytes: &[u8]) -> Result<Option<ParticleLayout>, ParseError> {
        let trajectory = Trajectory::parse(bytes)?;
        let is_scaled = trajectory.columns().any(|(_, variable)| variable.scale_factor.is_some());
        match trajectory.frames {
            1 if !is_scaled => trajectory.layout(0).map(Some),
            _ => Ok(None),
        }
    }

    fn notes(&self, head: &[u8]) -> Vec<String> {
        let mut notes = Vec::new();
        if let Ok(trajectory) = Trajectory::parse(head) {
            notes.push(trajectory.units());
            let file = &trajectory.file;
            notes.push(format!(
                "{} file, NetCDF classic version {}, written by {}",
                text::shown(file.text("Conventions")),
                file.version,
                text::shown(file.text("program"))
            ));
            if file.variable("cell_lengths").is_some() {
                notes.push(notes::cell_note(None));
            }
        }
        notes
    }
}

/// Units of time, by what their names begin with, and their lengths in ps.
const TIMES: [(&str, f64); 7] = [
    ("femtosecond", 1e-3),
    ("picosecond", 1.0),
    ("nanosecond", 1e3),
    ("microsecond", 1e6),
    ("millisecond", 1e9),
    ("second", 1e12),
    ("ps", 1.0),
];

/// The length of the unit of `time` in ps; `None` for units without a length, such as those of Lennard-Jones.
fn picoseconds(time: &Variable) -> Option<f64> {
    let units = String::from_utf8_lossy(&time.units).to_ascii_lowercase();
    let known = TIMES.iter().find(|(name, _)| units.starts_with(name));
    known.map(|(_, len)| *len).or(units.is_empty().then_some(1.0))
}

/// The variables of a file with the conventions.
#[derive(Debug)]
struct Trajectory<'a> {
    file: NetCdf<'a>,
    coordinates: Variable,
    velocities: Option<Variable>,
    forces: Option<Variable>,
    time: Option<Variable>,
    count: usize,
    frames: usize,
    /// Whether the first dimension is that of frames.
    has_frames: bool,
}

impl<'a> Trajectory<'a> {
    fn parse(bytes: &'a [u8]) -> Result<Self, ParseError> {
        let file = NetCdf::parse(bytes)?;
        let conventions = file.text("Conventions");
        let is_amber = text::words(conventions)
            .flat_map(|word| word.split(|b| *b == b','))
            .any(|word| matches!(word, b"AMBER" | b"AMBERRESTART"));
        if !is_amber {
            let what = format!(
                "a NetCDF file with the conventions {}, only those of AMBER are read; export as .vtu or .npy",
                text::shown(conventions)
            );
            return Err(ParseError::unsupported(what));
        }
        let Some(coordinates) = file.variable("coordinates").cloned() else {
            let what = "the file has no variable `coordinates`";
            return Err(ParseError::malformed(bytes.len(), what));
        };
        let has_frames = coordinates.shape.len() == 3;
        let count = match *coordinates.shape.as_slice() {
            [_, count, 3] | [count, 3] => count,
            _ => {
                let what = format!(
                    "coordinates have the shape {:?}, not (frames, atoms, 3) or (atoms, 3)",
                    coordinates.shape
                );
                return Err(ParseError::malformed(coordinates.at, what));
            }
        };
        coordinates.check_real("coordinates")?;
        let alike = |name: &str| {
            let variable = file.variable(name).cloned();
            let variable = variable.filter(|variable| variable.shape == coordinates.shape);
            variable.filter(|variable| variable.check_real(name).is_ok())
        };
        let frames = if has_frames { file.outer_len(&coordinates) } else { 1 };
        Ok(Self {
            velocities: alike("velocities"),
            forces: alike("forces"),
            time: file.variable("time").filter(|time| time.check_real("time").is_ok()).cloned(),
            coordinates,
            count,
            frames,
            has_frames,
            file,
        })
    }

    /// Variables with three numbers an atom, positions first.
    fn columns(&self) -> impl Iterator<Item = (&'static str, &Variable)> {
        let attributes = [("velocity", &self.velocities), ("force", &self.forces)].into_iter();
        std::iter::once(("positions", &self.coordinates))
            .chain(attributes.filter_map(|(name, variable)| Some((name, variable.as_ref()?))))
    }

    /// Where the numbers of a frame are.
    fn layout(&self, frame: usize) -> Result<ParticleLayout, ParseError> {
        let len = self.file.bytes.len();
        let mut columns = Vec::new();
        for (name, variable) in self.columns() {
            let scalar = variable.scalar.unwrap_or(ScalarType::F32);
            let stride = 3 * scalar.size();
            let start = if self.has_frames {
                self.file.outer_start(variable, frame)
            } else {
                variable.begin
            };
            let end = start.saturating_add(stride.saturating_mul(self.count));
            if end > len {
                let what = format!("the {name} of frame {frame} end at {end}: {CUT_SHORT}");
                return Err(ParseError::malformed(len, what));
            }
            let first = ComponentStride { start, stride };
            columns.push(StridedColumn::interleaved(name, (scalar, Endian::Big), 3, first));
        }
        let axes = columns.drain(..1).collect();
        Ok(ParticleLayout {
            time: self.time(frame),
            ..ParticleLayout::new(self.count, axes, columns)
        })
    }

    /// The time of a frame, ps.
    fn time(&self, frame: usize) -> Option<f64> {
        let time = self.time.as_ref()?;
        let at = match time.shape.as_slice() {
            [] => time.begin,
            _ => self.file.outer_start(time, frame),
        };
        let factor = time.scale_factor.unwrap_or(1.0) * picoseconds(time).unwrap_or(1.0);
        // A product with 1 is the same number
        Some(self.file.real(time, at)? * factor)
    }

    /// The note on units.
    fn units(&self) -> String {
        let units_of = |variable: &Variable, default: &str| {
            let own = String::from_utf8_lossy(&variable.units).into_owned();
            if own.is_empty() { default.to_owned() } else { own }
        };
        let velocities = self.velocities.as_ref();
        let velocities = velocities.map(|velocities| units_of(velocities, "angstrom/picosecond"));
        let times = self.time.as_ref().map(|time| {
            let own = units_of(time, "picosecond");
            match picoseconds(time) {
                Some(1.0) => "ps".to_owned(),
                Some(_) => format!("ps (the file has {own})"),
                None => own,
            }
        });
        let lengths = units_of(&self.coordinates, "angstrom");
        notes::units(&lengths, velocities.as_deref(), times.as_deref())
    }

    /// The cell of a frame: lengths, and angles in degrees.
    fn cell(&self, frame: usize) -> Option<SimulationCell> {
        let triple = |name: &str| {
            let variable = self.file.variable(name)?;
            variable.check_real(name).ok()?;
            let start = match (self.has_frames, variable.shape.as_slice()) {
                (true, [_, 3]) => self.file.outer_start(variable, frame),
                (false, [3]) => variable.begin,
                _ => return None,
            };
            let factor = variable.scale_factor.unwrap_or(1.0);
            let size = variable.scalar?.size();
            let mut numbers = [0.0; 3];
            for (axis, number) in numbers.iter_mut().enumerate() {
                *number = factor * self.file.real(variable, start.checked_add(axis * size)?)?;
            }
            Some(numbers)
        };
        let are_radians = self
            .file
            .variable("cell_angles")
            .is_some_and(|angles| angles.units.starts_with(b"radian"));
        let angles = triple("cell_angles")?;
        let degrees = if are_radians { angles.map(f64::to_degrees) } else { angles };
        SimulationCell::from_angles(triple("cell_lengths")?, degrees)
    }

    /// Multiplies by the factors of the variables, in the precision of the file.
    fn scale(&self, particles: &mut RawParticles) {
        for (name, variable) in self.columns() {
            let Some(factor) = variable.scale_factor else {
                continue;
            };
            match particles.attributes.iter_mut().find(|a| a.name == name) {
                Some(attribute) => scale_data(&mut attribute.data, factor),
                None => scale_positions(&mut particles.positions, factor),
            }
        }
    }
}

#[expect(clippy::cast_possible_truncation, reason = "rounded to the precision of the file")]
fn scale_data(data: &mut AttributeData, factor: f64) {
    match data {
        AttributeData::F32(v) => v.iter_mut().for_each(|n| *n = (f64::from(*n) * factor) as f32),
        AttributeData::F64(v) => v.iter_mut().for_each(|n| *n *= factor),
        _ => {}
    }
}

fn scale_positions(positions: &mut Positions, factor: f64) {
    match positions {
        Positions::F32(v) => v.iter_mut().for_each(|p| *p = (p.as_dvec3() * factor).as_vec3()),
        Positions::F64(v) => v.iter_mut().for_each(|p| *p *= factor),
    }
}

#[cfg(test)]
mod tests;
