//! GROMACS `.xtc` trajectories: positions alone, as integers of a chosen precision, compressed.
//!
//! A frame is a header, the box, and the positions: as they are for up to nine atoms, else compressed
//! (`coordinates.rs`). Lengths are nm, times ps. After the description of `xtc` in the GROMACS manual.

use glam::Vec3;

use super::numbers::NumberReader;
use super::xdr::{self, FrameSummary};
use super::{ByteSource, Step, notes};
use crate::format::Format;
use crate::reader::{Confidence, FormatInfo, Reader};
use spherule_frame::{Endian, ParseError, Positions, RawParticles, SimulationCell};

mod bits;
mod coordinates;

/// GROMACS `.xtc` trajectories.
pub const FORMAT: Format = Format::new(&Xtc);

struct Xtc;

/// First number of a frame.
const MAGIC: i32 = 1995;
/// The same since GROMACS 2023, for frames whose compressed positions may have more than 2 GiB.
const MAGIC_LARGE: i32 = 2023;
/// Most atoms whose positions are not compressed.
const FEW: usize = 9;
/// Bytes of three f32.
const TRIPLE: usize = 12;
/// Bytes of the magic number and of the number of atoms: alike in all frames of most files.
const SIGNATURE_LEN: usize = 8;
/// Most atoms in a byte of compressed positions: each has a flag, and a bit if all are in one place.
const ATOMS_PER_BYTE: usize = 4;

impl Reader for Xtc {
    fn info(&self) -> FormatInfo {
        FormatInfo {
            angstrom: 0.1,
            time_unit: Some("ps"),
            ..FormatInfo::molecular("xtc", &["xtc"])
        }
    }

    /// The number of atoms comes twice.
    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        let is_magic =
            [MAGIC, MAGIC_LARGE].iter().any(|magic| head.starts_with(&magic.to_be_bytes()));
        let count = |at: usize| head.get(at..at + 4);
        Ok(if !is_magic {
            Confidence::No
        } else if count(4).is_some() && count(4) == count(52) {
            Confidence::Signature
        } else {
            Confidence::IfNamed
        })
    }

    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let budget = source.budget();
        let bytes = source.bytes();
        let signature = bytes.get(..SIGNATURE_LEN).unwrap_or(bytes);
        let summary = |bytes: &[u8], at| Frame::parse(bytes, at).map(|frame| frame.summary);
        xdr::steps(bytes, signature, summary, budget)
    }

    fn read(&self, source: &mut ByteSource<'_>, step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        let bytes = source.bytes();
        let frame = Frame::parse(bytes, step.start())?;
        let need = (size_of::<Vec3>() as u64).saturating_mul(frame.count as u64);
        budget.check(need, "its numbers in memory are")?;
        let mut stream = NumberReader::new(bytes, frame.data_at, Endian::Big);
        let positions = if frame.count <= FEW {
            let mut positions = Vec::new();
            for _ in 0..frame.count {
                positions.push(Vec3::new(stream.f32()?, stream.f32()?, stream.f32()?));
            }
            positions
        } else {
            coordinates::decompress(&mut stream, frame.count, frame.is_large)?
        };
        Ok(RawParticles {
            positions: Positions::F32(positions),
            time: Some(frame.summary.time),
            step: Some(frame.summary.number.into()),
            cell: frame.cell,
            ..RawParticles::default()
        })
    }

    fn notes(&self, _head: &[u8]) -> Vec<String> {
        vec![notes::units("nm", None, Some("ps")), notes::cell_note(None)]
    }
}

/// The header of a frame.
#[derive(Debug, Clone, Copy)]
struct Frame {
    count: usize,
    summary: FrameSummary,
    cell: Option<SimulationCell>,
    /// Where the positions begin, behind their number.
    data_at: usize,
    is_large: bool,
}

impl Frame {
    /// The frame at byte `at`.
    fn parse(bytes: &[u8], at: usize) -> Result<Self, ParseError> {
        let mut header = NumberReader::new(bytes, at, Endian::Big);
        let magic = header.i32()?;
        if !matches!(magic, MAGIC | MAGIC_LARGE) {
            let what = format!(
                "a frame begins with {MAGIC} or {MAGIC_LARGE}, not {magic}: the file is damaged here"
            );
            return Err(ParseError::malformed(at, what));
        }
        let count = header.count("number of atoms")?;
        let number = header.i32()?;
        let time = header.f32()?;
        let mut components = [0.0; 9];
        for component in &mut components {
            *component = header.f32()?.into();
        }
        let again = header.count("number of positions")?;
        if again != count {
            let what = format!("{again} positions of {count} atoms");
            return Err(ParseError::malformed(header.at() - 4, what));
        }
        let is_large = magic == MAGIC_LARGE;
        let data_at = header.at();
        let end = if count <= FEW {
            data_at + count * TRIPLE
        } else {
            coordinates::end(header, is_large)?
        };
        let most = end.saturating_sub(data_at).saturating_mul(ATOMS_PER_BYTE);
        if count > most {
            let what = format!("{count} atoms in {} bytes", end - data_at);
            return Err(ParseError::malformed(at + 4, what));
        }
        Ok(Self {
            count,
            summary: FrameSummary { end, number, time: time.into(), has_positions: true },
            cell: SimulationCell::from_components(components),
            data_at,
            is_large,
        })
    }
}
