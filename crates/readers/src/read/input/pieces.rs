//! Pieces of whole lines, to be parsed in parallel.

use std::borrow::Cow;

use memchr::{memchr_iter, memrchr};

use super::{TextBytes, TextInput};

/// Bytes of a piece of text in memory: large enough to hide the cost of a task.
const WHOLE_PIECE: usize = 1 << 20;

/// Bytes of a piece of a stream: smaller, since all pieces at work are held.
pub(super) const PIECE: usize = 1 << 18;

/// Bytes that are held while a stream is read: the window, which has the end of what was there before a load; and of
/// rows the pieces at work, and what is found in them, as much.
pub fn stream_bytes(is_rows: bool) -> u64 {
    let pieces = if is_rows { pieces_at_once() } else { 0 };
    (2 * PIECE * (pieces + 1)) as u64
}

/// Whole lines.
pub(in crate::read) struct LinePiece<'a> {
    /// Offset of the first byte from the start of the file.
    pub(in crate::read) at: usize,
    /// The lines, with their ends.
    pub(in crate::read) bytes: Cow<'a, [u8]>,
    /// How many they are.
    pub(in crate::read) lines: usize,
    /// Whether the file ends with it.
    pub(in crate::read) ends_file: bool,
}

impl<'a> TextInput<'a> {
    /// Pieces of about as many bytes as are worth a task, together no more than `lines` lines; none at the end.
    pub(in crate::read) fn pieces(&mut self, mut lines: usize) -> Vec<LinePiece<'a>> {
        let mut pieces = Vec::with_capacity(pieces_at_once());
        while pieces.len() < pieces_at_once()
            && lines > 0
            && let Some(piece) = self.piece(lines)
        {
            lines -= piece.lines;
            pieces.push(piece);
        }
        pieces
    }

    /// A piece of up to `lines` lines.
    fn piece(&mut self, lines: usize) -> Option<LinePiece<'a>> {
        let len = match &self.bytes {
            TextBytes::Whole(_) => WHOLE_PIECE,
            TextBytes::Stream(stream) => stream.piece,
        };
        let there = self.want(len);
        if there == 0 {
            return None;
        }
        let near = &self.rest()[..there.min(len)];
        let mut cut = if there <= len && !self.can_load() {
            there
        } else if let Some(newline) = memrchr(b'\n', near) {
            newline + 1
        } else {
            let newline = self.find(b'\n');
            newline.map_or(self.rest().len(), |newline| newline + 1)
        };
        // What ends without a newline is a line, too.
        let count = |bytes: &[u8]| {
            let is_open = bytes.last() != Some(&b'\n');
            memchr_iter(b'\n', bytes).count() + usize::from(is_open)
        };
        let mut found = count(&self.rest()[..cut]);
        if found > lines {
            let last = memchr_iter(b'\n', self.rest()).nth(lines - 1);
            cut = last.map_or(cut, |newline| newline + 1);
            found = lines;
        }
        let at = self.at();
        let (from, to) = (self.next, self.next + cut);
        self.next = to;
        let bytes = match &mut self.bytes {
            TextBytes::Whole(bytes) => Cow::Borrowed(&bytes[from..to]),
            TextBytes::Stream(stream) => {
                let mut piece = stream.spare.pop().unwrap_or_default();
                piece.clear();
                piece.extend_from_slice(&stream.window[from..to]);
                Cow::Owned(piece)
            }
        };
        let is_open = bytes.last() != Some(&b'\n');
        Some(LinePiece { at, bytes, lines: found, ends_file: is_open && self.is_file_end() })
    }

    /// Reuses the memory of `pieces` for later ones.
    pub(in crate::read) fn take_back(&mut self, pieces: Vec<LinePiece<'a>>) {
        if let TextBytes::Stream(stream) = &mut self.bytes {
            let owned = pieces.into_iter().map(|piece| piece.bytes.into_owned());
            stream.spare.extend(owned);
        }
    }
}

/// Pieces that are parsed before their values are put together.
fn pieces_at_once() -> usize {
    2 * rayon::current_num_threads()
}
