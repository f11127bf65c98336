//! GROMACS `.trr` trajectories: positions, velocities and forces in single or double precision.
//!
//! A frame is a header with the lengths of its blocks in bytes, and the blocks. Frames without positions are passed
//! over. Lengths are nm, velocities nm/ps, forces kJ/(mol nm), times ps. After the description of `trr` in the GROMACS
//! manual.

use super::columns::{ComponentStride, ParticleLayout, StridedColumn, check_room};
use super::numbers::NumberReader;
use super::xdr::{self, FrameSummary};
use super::{ByteSource, Step, notes};
use crate::format::Format;
use crate::reader::{Confidence, FormatInfo, Reader};
use spherule_frame::{Endian, MemoryBudget, ParseError, RawParticles, ScalarType, SimulationCell};

/// GROMACS `.trr` trajectories.
pub const FORMAT: Format = Format::new(&Trr);

struct Trr;

/// What each frame begins with: a magic number (1993), the length of a text with its end, the text.
const SIGNATURE: &[u8] = b"\0\0\x07\xc9\0\0\0\x0d\0\0\0\x0cGMX_trn_file";

impl Reader for Trr {
    fn info(&self) -> FormatInfo {
        FormatInfo {
            angstrom: 0.1,
            time_unit: Some("ps"),
            ..FormatInfo::molecular("trr", &["trr"])
        }
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        Ok(Confidence::signature_if(head.starts_with(SIGNATURE)))
    }

    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let budget = source.budget();
        let summary = |bytes: &[u8], at| Frame::parse(bytes, at).map(|frame| frame.summary);
        xdr::steps(source.bytes(), SIGNATURE, summary, budget)
    }

    fn read(&self, source: &mut ByteSource<'_>, step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        let bytes = source.bytes();
        let frame = Frame::parse(bytes, step.start())?;
        let layout = frame.layout(bytes)?;
        budget.check(layout.byte_len(), "its numbers in memory are")?;
        Ok(RawParticles { cell: frame.cell(bytes), bonds: Vec::new(), ..layout.particles(bytes)? })
    }

    /// `None` for several frames.
    fn layout(&self, bytes: &[u8]) -> Result<Option<ParticleLayout>, ParseError> {
        let summary = |bytes: &[u8], at| Frame::parse(bytes, at).map(|frame| frame.summary);
        let steps = xdr::steps(bytes, SIGNATURE, summary, MemoryBudget::UNLIMITED)?;
        match steps.as_slice() {
            [step] => Frame::parse(bytes, step.start())?.layout(bytes).map(Some),
            _ => Ok(None),
        }
    }

    fn notes(&self, head: &[u8]) -> Vec<String> {
        let precision = Frame::parse(head, 0).map(|frame| frame.scalar);
        let mut notes = vec![notes::units("nm", Some("nm/ps"), Some("ps"))];
        if precision == Ok(ScalarType::F64) {
            notes.push("positions have double precision".to_owned());
        }
        notes.push(notes::cell_note(None));
        notes
    }
}

/// The header of a frame.
#[derive(Debug, Clone, Copy)]
struct Frame {
    count: usize,
    scalar: ScalarType,
    summary: FrameSummary,
    /// Where the box begins, if the frame has one.
    box_at: Option<usize>,
    /// Where positions, velocities and forces begin, if the frame has them.
    blocks: [Option<usize>; 3],
}

/// The lengths in a header, in bytes, in their order.
const LENGTHS: [&str; 10] = [
    "input record",
    "energies",
    "box",
    "virial",
    "pressure",
    "topology",
    "symbol table",
    "positions",
    "velocities",
    "forces",
];

impl Frame {
    /// The frame at byte `at`.
    fn parse(bytes: &[u8], at: usize) -> Result<Self, ParseError> {
        let rest = bytes.get(at..).unwrap_or_default();
        if !rest.starts_with(SIGNATURE) && rest.len() >= SIGNATURE.len() {
            let what =
                "a frame does not begin with 1993 and GMX_trn_file: the file is damaged here";
            return Err(ParseError::malformed(at, what));
        }
        let mut header = NumberReader::new(bytes, at, Endian::Big);
        header.take(SIGNATURE.len())?;
        let lengths_at = header.at();
        let mut lengths = [0; LENGTHS.len()];
        for (length, name) in lengths.iter_mut().zip(LENGTHS) {
            *length = header.count(&format!("length of the {name}"))?;
        }
        let count = header.count("number of atoms")?;
        let number = header.i32()?;
        header.i32()?;
        let [_, _, box_len, .., x, v, f] = lengths;
        let scalar = scalar(box_len, [x, v, f], count).ok_or_else(|| {
            let what = format!(
                "the box has {box_len} bytes and the positions, velocities and forces of {count} atoms {x}, {v} and \
                 {f}: neither single nor double precision"
            );
            ParseError::malformed(lengths_at, what)
        })?;
        let time = match scalar {
            ScalarType::F64 => header.f64()?,
            _ => header.f32()?.into(),
        };
        // A parameter of free energies
        header.take(scalar.size())?;
        let mut end = header.at();
        let mut starts = [0; LENGTHS.len()];
        for (start, length) in starts.iter_mut().zip(lengths) {
            *start = end;
            end += length;
        }
        let [_, _, box_at, .., x_at, v_at, f_at] = starts;
        let block = |length: usize, start| (length > 0).then_some(start);
        Ok(Self {
            count,
            scalar,
            summary: FrameSummary { end, number, time, has_positions: x > 0 || count == 0 },
            box_at: block(box_len, box_at),
            blocks: [block(x, x_at), block(v, v_at), block(f, f_at)],
        })
    }

    /// The cell, if the frame has one.
    fn cell(&self, bytes: &[u8]) -> Option<SimulationCell> {
        let mut numbers = NumberReader::new(bytes, self.box_at?, Endian::Big);
        let mut components = [0.0; 9];
        for component in &mut components {
            *component = match self.scalar {
                ScalarType::F64 => numbers.f64().ok()?,
                _ => numbers.f32().ok()?.into(),
            };
        }
        SimulationCell::from_components(components)
    }

    /// Where the numbers are.
    fn layout(&self, bytes: &[u8]) -> Result<ParticleLayout, ParseError> {
        let stride = 3 * self.scalar.size();
        let names = ["positions", "velocity", "force"];
        let mut columns = Vec::new();
        for (name, start) in names.into_iter().zip(self.blocks) {
            let Some(start) = start else { continue };
            check_room(start, self.count, stride, bytes.len())
                .map_err(|e| e.map_message(|what| format!("{what}: {}", super::CUT_SHORT)))?;
            let first = ComponentStride { start, stride };
            let scalar = (self.scalar, Endian::Big);
            columns.push(StridedColumn::interleaved(name, scalar, 3, first));
        }
        let axes = columns.drain(..usize::from(self.blocks[0].is_some())).collect();
        Ok(ParticleLayout {
            time: Some(self.summary.time),
            step: Some(self.summary.number.into()),
            ..ParticleLayout::new(self.count, axes, columns)
        })
    }
}

/// The type of the numbers, by the lengths of the box and of the blocks of `count` atoms.
fn scalar(box_len: usize, blocks: [usize; 3], count: usize) -> Option<ScalarType> {
    [ScalarType::F32, ScalarType::F64].into_iter().find(|scalar| {
        let block = 3 * scalar.size() * count;
        (box_len == 0 || box_len == 9 * scalar.size())
            && blocks.iter().all(|length| *length == 0 || *length == block)
    })
}
