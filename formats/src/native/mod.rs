//! The native frame file `.spf`: particles in tree order, in blocks that are traced in place.
//!
//! [`layout`] defines the bytes, [`FrameWriter`] writes files, [`NativeFile`] maps them. All parsing works on
//! `&[u8]`. [`crate::read`] reads the files of other programs.

use rkyv::util::AlignedVec;

use crate::read::ByteSource;
use crate::{ParseError, RawParticles};
use spherule_readers::Format;
use spherule_readers::Step;
use spherule_readers::{Confidence, FormatInfo, Reader};

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
pub use layout::{Encoding, FrameDetails, FrameIndex, MAGIC};
pub(crate) use map::read as read_aligned;
pub use map::{Access, MappedFile, NativeFile};
pub use quantize::arrange;
pub use radii::RadiusRange;
pub use stored::{RadiusCode, StoredType};
pub use view::NativeFrame;
pub use write::{AttributeSpec, FrameSpec, FrameWriter, RadiusSpec, Run, wide_blocks};

use layout::Section;

/// The native frame file.
pub const FORMAT: Format = Format::new(&Spf);

struct Spf;

impl Reader for Spf {
    fn info(&self) -> FormatInfo {
        FormatInfo::new("spf", &["spf"])
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        Ok(Confidence::signature_if(head.starts_with(MAGIC)))
    }

    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let index = layout::parse(source.bytes())?;
        let mut step = Step::whole(source.bytes().len());
        (step.number, step.time) = (index.step, index.time);
        Ok(vec![step])
    }

    /// Verifies every section.
    fn read(&self, source: &mut ByteSource<'_>, _step: &Step) -> Result<RawParticles, ParseError> {
        with_frame(source.bytes(), |frame| {
            frame.verify()?;
            frame.to_raw()
        })
    }
}

/// Checks all contents of the native frame `bytes`.
///
/// # Errors
/// As [`layout::parse`] and [`NativeFrame::verify_all`].
pub fn verify(bytes: &[u8]) -> Result<(), ParseError> {
    with_frame(bytes, |frame| frame.verify_all())
}

/// Calls the function with the native frame `bytes`, or with an aligned copy if they are not aligned like sections.
fn with_frame<T>(
    bytes: &[u8],
    visit: impl FnOnce(&NativeFrame) -> Result<T, ParseError>,
) -> Result<T, ParseError> {
    let index = layout::parse(bytes)?;
    let mut aligned = AlignedVec::<64>::new();
    let bytes = if bytes.as_ptr().align_offset(64) == 0 {
        bytes
    } else {
        aligned.extend_from_slice(bytes);
        &aligned
    };
    visit(&NativeFrame::with_index(bytes, &index))
}

/// The bytes of a section; `bytes` is the whole file.
fn section_of<'a>(bytes: &'a [u8], section: &Section) -> Result<&'a [u8], ParseError> {
    let end = section.offset.checked_add(section.len);
    usize::try_from(section.offset)
        .ok()
        .zip(end.and_then(|end| usize::try_from(end).ok()))
        .and_then(|(start, end)| bytes.get(start..end))
        .ok_or_else(|| ParseError::malformed(0, "a section is outside the file"))
}

#[cfg(test)]
pub(crate) mod tests;
