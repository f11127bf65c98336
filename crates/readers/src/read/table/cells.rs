//! The fields of a line that a single byte separates.

use memchr::memchr;

/// One field of a line that a byte separates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::read) struct Cell<'a> {
    /// Offset of the text from the start of the line.
    pub(in crate::read) at: usize,
    /// The text without blanks and quotes around it.
    pub(in crate::read) text: &'a [u8],
}

/// The fields of `line`. What follows the last separator is a field, too, if empty.
pub(in crate::read) fn cells(line: &[u8], separator: u8) -> Cells<'_> {
    Cells { line, separator, next: Some(0) }
}

/// See [`cells`].
#[derive(Debug)]
pub(in crate::read) struct Cells<'a> {
    line: &'a [u8],
    separator: u8,
    next: Option<usize>,
}

impl<'a> Iterator for Cells<'a> {
    type Item = Cell<'a>;

    fn next(&mut self) -> Option<Cell<'a>> {
        let mut start = self.next?;
        let end_of_cell = |from: usize| {
            let rest = self.line.get(from..).unwrap_or_default();
            memchr(self.separator, rest).map_or(self.line.len(), |separator| from + separator)
        };
        while self.line.get(start).is_some_and(|b| is_blank(*b) && *b != self.separator) {
            start += 1;
        }
        let mut end = end_of_cell(start);
        let mut text_end = end;
        if self.line.get(start) == Some(&b'"')
            && let Some(quote) = closing_quote(self.line, start + 1)
        {
            end = end_of_cell(quote + 1);
            text_end = quote;
            start += 1;
        }
        self.next = (end < self.line.len()).then_some(end + 1);
        let slice = &self.line[start..text_end];
        let trimmed = slice.trim_ascii_start();
        Some(Cell { at: start + (slice.len() - trimmed.len()), text: trimmed.trim_ascii_end() })
    }
}

/// The quote that ends a text begun before `from`; two in a row stand for one inside it.
fn closing_quote(line: &[u8], from: usize) -> Option<usize> {
    let mut from = from;
    loop {
        let quote = from + memchr(b'"', line.get(from..)?)?;
        if line.get(quote + 1) != Some(&b'"') {
            return Some(quote);
        }
        from = quote + 2;
    }
}

/// True for what pads a field.
#[inline]
pub(super) fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\r' | b'\x0b' | b'\x0c')
}
