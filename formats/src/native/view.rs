//! A checked view of the bytes of a native frame, with access to its parts in place.

use bytemuck::Pod;

use super::attribute::AttributeView;
use super::layout::{AttributeIndex, Encoding, FrameIndex, RadiiIndex, RadiusIndex, Section};
use super::section_of;
use super::stored::{RadiusCode, StoredType};
use crate::ParseError;
use crate::blocks::{CompactBlocks, StoredBlocks, StoredLeaves, StoredRadii};

/// A checked view of the bytes of a native frame.
#[derive(Debug, Clone, Copy)]
pub struct NativeFrame<'a> {
    bytes: &'a [u8],
    index: &'a FrameIndex,
}

impl<'a> NativeFrame<'a> {
    /// A view of `bytes`; `index` was parsed from them by [`super::layout::parse`].
    pub(super) const fn with_index(bytes: &'a [u8], index: &'a FrameIndex) -> Self {
        Self { bytes, index }
    }

    /// The bytes of the whole file.
    pub(super) const fn bytes(&self) -> &'a [u8] {
        self.bytes
    }

    /// The index of the frame.
    pub const fn index(&self) -> &'a FrameIndex {
        self.index
    }

    /// The particles, in place. Only the lengths of the sections are checked, not their contents.
    ///
    /// # Errors
    /// [`ParseError::Unsupported`] on a big-endian machine, or for bytes that are not aligned to 64 (the bytes
    /// of a [`super::NativeFile`] are).
    pub fn leaves(&self) -> Result<StoredLeaves<'a>, ParseError> {
        let index = self.index;
        Ok(StoredLeaves {
            count: index.count,
            nodes: self.plain(&index.nodes)?,
            blocks: match index.encoding() {
                Encoding::F32 => StoredBlocks::F32(self.plain(&index.positions)?),
                Encoding::Q16 => StoredBlocks::Q16(self.compact()?),
                Encoding::Q10 => StoredBlocks::Q10(self.compact()?),
            },
            radii: match &index.radius {
                RadiusIndex::None | RadiusIndex::Common(_) => StoredRadii::None,
                RadiusIndex::PerParticle(radii) => self.radii(radii)?,
            },
        })
    }

    /// The attribute `name`, in place: an exact match, else one that ignores case.
    pub fn attribute(&self, name: &str) -> Option<AttributeView<'a>> {
        let attributes = &self.index.attributes;
        let exact = attributes.iter().find(|a| a.name == name);
        let alike = || attributes.iter().find(|a| a.name.eq_ignore_ascii_case(name));
        self.view(exact.or_else(alike)?).ok()
    }

    /// All attributes, in place, in the order of the index.
    pub fn attributes(&self) -> Vec<AttributeView<'a>> {
        let views = self.index.attributes.iter().map(|a| self.view(a));
        views.filter_map(Result::ok).collect()
    }

    fn view(&self, attribute: &'a AttributeIndex) -> Result<AttributeView<'a>, ParseError> {
        let stored = StoredType::of_code(attribute.stored)
            .ok_or_else(|| ParseError::unsupported("an attribute type that is not known"))?;
        Ok(AttributeView::new(attribute, stored, section_of(self.bytes, &attribute.section)?))
    }

    fn compact<B: Pod>(&self) -> Result<CompactBlocks<'a, B>, ParseError> {
        Ok(CompactBlocks {
            blocks: self.plain(&self.index.positions)?,
            wide: self.plain(&self.index.wide)?,
        })
    }

    fn radii(&self, radii: &RadiiIndex) -> Result<StoredRadii<'a>, ParseError> {
        let code = RadiusCode::of_code(radii.code)
            .ok_or_else(|| ParseError::unsupported("a type of radii that is not known"))?;
        let (low, step) = (radii.low, code.step(radii.low, radii.high));
        Ok(match code {
            RadiusCode::F32 => StoredRadii::F32(self.plain(&radii.section)?),
            RadiusCode::U16 => StoredRadii::U16 { codes: self.plain(&radii.section)?, low, step },
            RadiusCode::U8 => StoredRadii::U8 { codes: self.plain(&radii.section)?, low, step },
        })
    }

    fn plain<T: Pod>(&self, section: &Section) -> Result<&'a [T], ParseError> {
        let bytes = section_of(self.bytes, section)?;
        let slice =
            (!cfg!(target_endian = "big")).then(|| bytemuck::try_cast_slice(bytes).ok()).flatten();
        slice.ok_or_else(|| {
            ParseError::unsupported(
                "a native frame in memory that is not aligned, or on a big-endian machine",
            )
        })
    }
}
