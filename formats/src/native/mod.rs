//! The native frame file `.spf`: particles in tree order, in blocks that are traced where they lie.
//!
//! [`layout`] has the bytes, [`FrameWriter`] makes files, [`NativeFile`] maps them. All parsing works on
//! `&[u8]`. Files written by other programs are [`crate::read`]'s.

use rkyv::util::AlignedVec;

use crate::ParseError;
use crate::read::Step;

mod attribute;
mod bound;
mod decode;
mod frame;
pub mod layout;
mod map;
mod quantize;
mod radii;
mod sections;
mod stored;
mod verify;
mod view;
mod write;

pub use attribute::AttributeView;
pub use bound::Bound;
pub(crate) use frame::radius_range;
pub use frame::{StoreSettings, smallest_encoding, store, write};
pub use layout::{Encoding, FrameIndex, MAGIC};
pub(crate) use map::read as read_aligned;
pub use map::{Access, MappedFile, NativeFile};
pub use quantize::arrange;
pub use radii::RadiusRange;
pub use stored::{RadiusCode, StoredType};
pub use view::NativeFrame;
pub use write::{AttributeSpec, FrameSpec, FrameWriter, RadiusSpec, Run, wide_blocks};

use layout::Section;

/// The only step of a native frame.
///
/// # Errors
/// As [`layout::parse`].
pub fn steps(bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
    let index = layout::parse(bytes)?;
    let step = Step {
        number: index.step,
        time: index.time,
        ..Step::whole(bytes.len())
    };
    Ok(vec![step])
}

/// Reads a native frame like any other format, every section verified.
///
/// # Errors
/// As [`layout::parse`] and [`NativeFrame::verify`].
pub fn read(bytes: &[u8], _step: &Step) -> Result<crate::RawParticles, ParseError> {
    with_frame(bytes, |frame| {
        frame.verify()?;
        frame.to_raw()
    })
}

/// Checks everything in the native frame `bytes`.
///
/// # Errors
/// As [`layout::parse`] and [`NativeFrame::verify_all`].
pub fn verify(bytes: &[u8]) -> Result<(), ParseError> {
    with_frame(bytes, |frame| frame.verify_all())
}

/// Looks at the native frame `bytes`, or at a copy of them if they are not aligned as sections are.
fn with_frame<T>(
    bytes: &[u8],
    look: impl FnOnce(&NativeFrame) -> Result<T, ParseError>,
) -> Result<T, ParseError> {
    let index = layout::parse(bytes)?;
    let mut aligned = AlignedVec::<64>::new();
    let bytes = if bytes.as_ptr().align_offset(64) == 0 {
        bytes
    } else {
        aligned.extend_from_slice(bytes);
        &aligned
    };
    look(&NativeFrame::with_index(bytes, &index))
}

/// The bytes of a section of a file of `bytes`.
fn section_of<'a>(bytes: &'a [u8], section: &Section) -> Result<&'a [u8], ParseError> {
    let end = section.offset.checked_add(section.len);
    usize::try_from(section.offset)
        .ok()
        .zip(end.and_then(|end| usize::try_from(end).ok()))
        .and_then(|(start, end)| bytes.get(start..end))
        .ok_or_else(|| ParseError::malformed(0, "a section lies outside the file"))
}

#[cfg(test)]
pub(crate) mod tests;
