//! Arrays saved by numpy: NPY (one array) and NPZ (a zip of them).
//!
//! `header` parses the type and shape of an array, `layout` finds its particles, `archive` opens an NPZ;
//! the shared column reader decodes. Nothing is ever unpickled: a pickle is a program. The header
//! parser is our own because `npyz` allocates what a damaged header asks for and brings a parser
//! generator and big integers with it for one dictionary. After NEP 1 and `numpy/lib/format.py`.

mod archive;
mod dtype;
mod header;
mod layout;
mod literal;
mod member;
#[cfg(test)]
mod tests;

use self::header::NpyHeader;
use self::layout::ArrayLayout;
use super::columns::ParticleLayout;
use super::{ByteSource, Step};
use crate::format::Format;
use crate::reader::{Confidence, FileExtent, FormatInfo, Reader};
use spherule_frame::{MemoryBudget, ParseError, RawParticles};

/// One numpy array.
pub const NPY: Format = Format::new(&Npy);

/// A ZIP of numpy arrays.
pub const NPZ: Format = Format::new(&Npz);

struct Npy;

struct Npz;

impl Reader for Npy {
    fn info(&self) -> FormatInfo {
        FormatInfo { may_hold_many_steps: true, ..FormatInfo::new("npy", &["npy"]) }
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        Ok(Confidence::signature_if(head.starts_with(b"\x93NUMPY")))
    }

    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let budget = source.budget();
        steps(source.bytes(), budget)
    }

    fn read(&self, source: &mut ByteSource<'_>, step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        read(source.bytes(), step, budget)
    }

    /// `None` for several steps.
    fn layout(&self, bytes: &[u8]) -> Result<Option<ParticleLayout>, ParseError> {
        let header = NpyHeader::parse(bytes)?;
        header.check_items(bytes.len())?;
        match ArrayLayout::of(&header)?.frames {
            None | Some(1) => array_layout(bytes.len(), &header, 0).map(Some),
            Some(_) => Ok(None),
        }
    }
}

impl Reader for Npz {
    fn info(&self) -> FormatInfo {
        FormatInfo { may_hold_many_steps: true, ..FormatInfo::new("npz", &["npz"]) }
    }

    /// Any ZIP but one of USD files: the reader reports what is missing in it.
    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        let is_npz = archive::is_zip(head) && !is_usdz(head);
        Ok(Confidence::signature_if(is_npz))
    }

    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let budget = source.budget();
        steps(source.bytes(), budget)
    }

    fn read(&self, source: &mut ByteSource<'_>, step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        read(source.bytes(), step, budget)
    }

    /// An array of all steps is decompressed for each of them.
    fn unpacked_arrays_len(&self, _head: &[u8], file: FileExtent, particles: &RawParticles) -> u64 {
        let all_steps = particles.byte_len().saturating_mul(file.step_count);
        if file.byte_len < all_steps {
            particles.largest_array_len().saturating_mul(file.step_count)
        } else {
            0
        }
    }
}

/// True if `head` begins a ZIP of USD files.
pub fn is_usdz(head: &[u8]) -> bool {
    // Local file header: name at 30, its length at 26.
    let length = head.get(26..28).map_or(0, |len| usize::from(len[0]) | usize::from(len[1]) << 8);
    let name = head.get(30..30 + length).unwrap_or_default();
    let is_usd = [&b".usd"[..], b".usda", b".usdc"]
        .iter()
        .any(|end| name.to_ascii_lowercase().ends_with(end));
    head.starts_with(b"PK\x03\x04") && is_usd
}

/// The time steps in `bytes`: as many as the first dimension of (frames, N, 3), else one.
///
/// # Errors
/// [`ParseError::Malformed`] for damaged files; [`ParseError::Unsupported`] for pickled objects and
/// for arrays that are not positions, with what to save instead;
/// [`ParseError::TooLarge`] if the times, a member of an archive, need more than `budget`.
fn steps(bytes: &[u8], budget: MemoryBudget) -> Result<Vec<Step>, ParseError> {
    if archive::is_zip(bytes) {
        return archive::Archive::open(bytes)?.steps(budget);
    }
    let header = NpyHeader::parse(bytes)?;
    header.check_items(bytes.len())?;
    Ok(frame_steps(&ArrayLayout::of(&header)?))
}

/// Reads one of the [`steps`].
///
/// Positions keep their precision; two coordinates lie in the plane z = 0. Numeric fields of a
/// structured array, and numeric members of an archive with one entry a particle, become attributes.
///
/// # Errors
/// As [`steps`]; [`ParseError::Malformed`] if there is no such step.
fn read(bytes: &[u8], step: &Step, budget: MemoryBudget) -> Result<RawParticles, ParseError> {
    let frame = usize::try_from(step.key()).unwrap_or(usize::MAX);
    if archive::is_zip(bytes) {
        return archive::Archive::open(bytes)?.read(frame, budget);
    }
    let header = NpyHeader::parse(bytes)?;
    read_array(bytes, &header, frame)
}

/// The particles of one array in step `frame`.
fn read_array(bytes: &[u8], header: &NpyHeader, frame: usize) -> Result<RawParticles, ParseError> {
    array_layout(bytes.len(), header, frame)?.particles(bytes)
}

/// Layout of the particles in a file of `len` bytes.
fn array_layout(
    len: usize,
    header: &NpyHeader,
    frame: usize,
) -> Result<ParticleLayout, ParseError> {
    header.check_items(len)?;
    let layout = ArrayLayout::of(header)?;
    check_frame(&layout, frame)?;
    layout.columns(header, frame)
}

fn check_frame(layout: &ArrayLayout, frame: usize) -> Result<(), ParseError> {
    let frames = layout.frames.unwrap_or(1);
    if frame < frames {
        return Ok(());
    }
    Err(ParseError::malformed(0, format!("step {frame} is not among the {frames} of the file")))
}

/// One step for each index into the first dimension.
fn frame_steps(layout: &ArrayLayout) -> Vec<Step> {
    let frames = layout.frames.unwrap_or(1);
    (0..frames).map(|index| Step::with_key(index, index as u64)).collect()
}
