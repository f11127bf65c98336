//! The content of a file as its reader sees it.

use super::input::TextInput;

/// The uncompressed content of a file.
///
/// All of it is in memory: mapped, read or decompressed. Only if [`crate::reader::Reader::stream_unit`] reports
/// that a file can be read in pieces, it may be a stream; [`Self::text`] then holds a window of it.
#[derive(Debug)]
pub(crate) struct ByteSource<'a> {
    text: TextInput<'a>,
}

impl<'a> ByteSource<'a> {
    /// Content that is in memory.
    pub(crate) fn whole(bytes: &'a [u8]) -> Self {
        Self::from_text(TextInput::whole(bytes))
    }

    /// Content that is read through `text`.
    pub(crate) const fn from_text(text: TextInput<'a>) -> Self {
        Self { text }
    }

    /// All bytes if they are in memory.
    pub(crate) const fn as_whole(&self) -> Option<&'a [u8]> {
        self.text.as_whole()
    }

    /// All bytes; none of a stream.
    pub(crate) fn bytes(&self) -> &'a [u8] {
        self.as_whole().unwrap_or_default()
    }

    /// The content as text from front to back.
    pub(crate) const fn text(&mut self) -> &mut TextInput<'a> {
        &mut self.text
    }
}
