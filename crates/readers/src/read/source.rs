//! The content of a file as its reader sees it.

use super::input::TextInput;
use crate::shared::SharedBytes;
use spherule_frame::MemoryBudget;

/// The uncompressed content of a file.
///
/// All of it is in memory: mapped, read or decompressed. Only if [`crate::reader::Reader::stream_unit`] reports
/// that a file can be read in pieces, it may be a stream; [`Self::text`] then holds a window of it.
#[derive(Debug)]
pub struct ByteSource<'a> {
    text: TextInput<'a>,
    budget: MemoryBudget,
    has_mesh_points: bool,
    /// The owner of all bytes, if there is one that can be shared.
    shared: Option<&'a SharedBytes>,
}

impl<'a> ByteSource<'a> {
    /// Content that is in memory.
    pub fn whole(bytes: &'a [u8]) -> Self {
        Self::from_text(TextInput::whole(bytes))
    }

    /// Content that is in memory or mapped, and can be shared.
    pub fn shared(bytes: &'a SharedBytes) -> Self {
        Self { shared: Some(bytes), ..Self::whole(bytes) }
    }

    /// Content that is read through `text`.
    pub const fn from_text(text: TextInput<'a>) -> Self {
        let budget = MemoryBudget::UNLIMITED;
        Self { text, budget, has_mesh_points: false, shared: None }
    }

    /// Limits what is read from here, except the bytes themselves.
    pub const fn limit(&mut self, budget: MemoryBudget) {
        self.budget = budget;
    }

    /// Says whether the vertices of a mesh are particles; otherwise a mesh is refused.
    pub const fn set_mesh_points(&mut self, are_particles: bool) {
        self.has_mesh_points = are_particles;
    }

    /// Whether the vertices of a mesh are particles.
    pub const fn has_mesh_points(&self) -> bool {
        self.has_mesh_points
    }

    /// How much memory all that is read from here may take.
    pub const fn budget(&self) -> MemoryBudget {
        self.budget
    }

    /// All bytes with their owner. Copies them if they have none that can be shared.
    pub fn to_shared(&self) -> SharedBytes {
        let shared = self.shared.cloned();
        shared.unwrap_or_else(|| SharedBytes::copy(self.bytes()))
    }

    /// All bytes if they are in memory.
    pub const fn as_whole(&self) -> Option<&'a [u8]> {
        self.text.as_whole()
    }

    /// All bytes; none of a stream.
    pub fn bytes(&self) -> &'a [u8] {
        self.as_whole().unwrap_or_default()
    }

    /// The content as text from front to back.
    pub const fn text(&mut self) -> &mut TextInput<'a> {
        &mut self.text
    }
}
