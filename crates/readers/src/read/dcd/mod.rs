//! DCD trajectories of CHARMM, NAMD, X-PLOR, OpenMM and others: positions in single precision.
//!
//! The file consists of records between their lengths, as Fortran writes them, in either byte order. `header` reads the
//! first three; all frames after them have the same length, except that fixed atoms are in the first frame alone.
//! Lengths are A, times ps. After the description of `dyna.F` in the CHARMM documentation and the plugin page of VMD.

use glam::Vec3;

use super::columns::{ComponentStride, ParticleLayout, StridedColumn};
use super::{ByteSource, CUT_SHORT, Step, notes};
use crate::format::Format;
use crate::reader::{Confidence, FormatInfo, Reader};
use spherule_frame::{ParseError, Positions, RawParticles, ScalarType};

mod header;

use header::DcdHeader;

/// DCD trajectories.
pub const FORMAT: Format = Format::new(&Dcd);

struct Dcd;

/// Bytes of a position in a record.
const F32: usize = 4;

impl Reader for Dcd {
    fn info(&self) -> FormatInfo {
        FormatInfo { time_unit: Some("ps"), ..FormatInfo::molecular("dcd", &["dcd"]) }
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        Ok(Confidence::signature_if(header::records(head).is_some()))
    }

    /// As many frames as the file has room for: a simulation that was killed has not updated their number in the
    /// header.
    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let budget = source.budget();
        let bytes = source.bytes();
        let header = DcdHeader::parse(bytes)?;
        let mut steps = Vec::new();
        let mut at = header.frames_at;
        while at < bytes.len() {
            let end = at.saturating_add(header.frame_len(steps.len())).min(bytes.len());
            Step::push(&mut steps, at..end, budget)?;
            at = end;
        }
        for step in &mut steps {
            step.number = header.number(step.index);
            step.time = header.time(step.index);
        }
        Ok(steps)
    }

    fn read(&self, source: &mut ByteSource<'_>, step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        let bytes = source.bytes();
        let header = DcdHeader::parse(bytes)?;
        let (at, index) = match step.start() {
            0 => (header.frames_at, 0),
            at => (at, step.index),
        };
        let layout = layout(bytes, &header, at, index)?;
        let need = (size_of::<Vec3>() as u64).saturating_mul(header.count as u64);
        budget.check(need, "its numbers in memory are")?;
        let particles = RawParticles {
            cell: header.cell(bytes, at),
            bonds: Vec::new(),
            ..layout.particles(bytes)?
        };
        if index == 0 || header.free.is_none() {
            return Ok(particles);
        }
        // Put the free atoms among the fixed ones, which are in the first frame
        let first = self::layout(bytes, &header, header.frames_at, 0)?.particles(bytes)?;
        let (Positions::F32(mut positions), Positions::F32(moved)) =
            (first.positions, particles.positions)
        else {
            return Err(ParseError::malformed(at, "positions are not in single precision"));
        };
        for (index, position) in header.free_atoms(bytes).zip(moved) {
            if let Some(place) = positions.get_mut(index?) {
                *place = position;
            }
        }
        Ok(RawParticles { positions: Positions::F32(positions), ..particles })
    }

    /// `None` for several frames.
    fn layout(&self, bytes: &[u8]) -> Result<Option<ParticleLayout>, ParseError> {
        let header = DcdHeader::parse(bytes)?;
        if header.frames_at.saturating_add(header.frame_len(0)) < bytes.len() {
            return Ok(None);
        }
        layout(bytes, &header, header.frames_at, 0).map(Some)
    }

    fn notes(&self, head: &[u8]) -> Vec<String> {
        let mut notes = vec![notes::units("angstroms", None, Some("ps"))];
        if let Ok(header) = DcdHeader::parse(head) {
            notes.extend(header.notes());
            notes.extend(header.shows_cell(head).then(|| notes::cell_note(None)));
        }
        notes
    }
}

/// Where the positions of frame `index`, which begins at `at`, are.
fn layout(
    bytes: &[u8],
    header: &DcdHeader,
    at: usize,
    index: usize,
) -> Result<ParticleLayout, ParseError> {
    let mut records = header.records;
    records.at = at;
    if header.has_cell {
        records.expect(bytes, header::CELL_LEN, "unit cell")?;
    }
    let count = header.frame_count(index);
    let mut axes = Vec::new();
    for axis in ["x", "y", "z"] {
        let start = records.expect(bytes, F32.saturating_mul(count), axis)?;
        let first = ComponentStride { start, stride: F32 };
        let scalar = (ScalarType::F32, records.endian);
        axes.push(StridedColumn::interleaved("positions", scalar, 1, first));
    }
    Ok(ParticleLayout {
        time: header.time(index),
        step: header.number(index),
        ..ParticleLayout::new(count, axes, Vec::new())
    })
}

/// The error for bytes that end too early.
fn cut_short(at: usize, what: &str) -> ParseError {
    ParseError::malformed(at, format!("{what}: {CUT_SHORT}"))
}
