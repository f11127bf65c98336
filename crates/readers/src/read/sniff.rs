//! What the first bytes of a text without a signature look like.

use crate::reader::HEAD_LEN;

/// What the lines of a text look like.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TextShape {
    /// The first line is a count.
    Counted,
    /// The first line is three or more numbers separated by blanks.
    Numbers,
    /// The first line is three or more numbers with separators between them.
    SeparatedNumbers,
    /// Other lines come first, numbers follow soon.
    TitledNumbers,
}

/// The shape of the text that begins with `head`; `None` for binary content and for text without numbers.
pub fn text_shape(head: &[u8]) -> Option<TextShape> {
    if !is_text(head) {
        return None;
    }
    let text = String::from_utf8_lossy(head);
    let mut lines = text
        .trim_start_matches('\u{feff}')
        .lines()
        .map(str::trim)
        .filter(|l| !l.is_empty() && !l.starts_with('#') && !l.starts_with("//"));
    let first = lines.next()?;
    if is_digits(first) {
        return Some(TextShape::Counted);
    }
    if has_numbers(first) {
        return Some(if first.contains([',', ';', '\t']) {
            TextShape::SeparatedNumbers
        } else {
            TextShape::Numbers
        });
    }
    let numbers_follow = lines.take(8).any(has_numbers);
    numbers_follow.then_some(TextShape::TitledNumbers)
}

/// True if `head` is UTF-8 (except for a character that its end cuts) without control characters.
pub fn is_text(head: &[u8]) -> bool {
    let whole = match std::str::from_utf8(head) {
        Ok(_) => true,
        Err(e) => e.error_len().is_none() && head.len() >= HEAD_LEN - 3,
    };
    whole && head.iter().all(|b| *b >= 32 && *b != 127 || matches!(b, b'\t' | b'\n' | b'\r'))
}

/// True if `text` is decimal digits and nothing else.
pub fn is_digits(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit())
}

/// True if `line` is three or more numbers and nothing else, except for an empty last cell.
fn has_numbers(line: &str) -> bool {
    let cells = || {
        line.split([',', ';', '\t', ' '])
            .map(|cell| cell.trim().trim_matches('"'))
            .filter(|cell| !cell.is_empty())
    };
    cells().all(|cell| cell.parse::<f64>().is_ok()) && cells().nth(2).is_some()
}
