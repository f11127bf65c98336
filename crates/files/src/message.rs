//! Makes text from files fit for a one-line message.

use std::borrow::Cow;

/// Characters that are kept at the start of a long message.
const START: usize = 560;
/// Characters that are kept at its end, where the remedy is.
const END: usize = 240;
/// Messages of up to this many characters are not shortened. A shortened message, including its note about the
/// gap, is not longer.
const MAX: usize = START + END + 60;

/// `text` as one line of bounded length that is safe to show in a terminal: characters that control the
/// terminal, break the line or change its direction become escapes.
pub fn one_line(text: String) -> String {
    match escape_controls(&text) {
        Cow::Borrowed(_) => shortened(text),
        Cow::Owned(line) => shortened(line),
    }
}

/// `text` with every [control character](is_control) replaced by an escape: one line that is safe to show in a
/// terminal. Escaping it again changes nothing.
///
/// ```
/// assert_eq!(spherule_files::escape_controls("a\u{1b}[2J\n"), "a\\u{1b}[2J\\n");
/// ```
pub fn escape_controls(text: &str) -> Cow<'_, str> {
    if !text.contains(is_control) {
        return Cow::Borrowed(text);
    }
    let mut line = String::with_capacity(text.len());
    for c in text.chars() {
        if is_control(c) {
            line.extend(c.escape_default());
        } else {
            line.push(c);
        }
    }
    Cow::Owned(line)
}

/// Whether `c` affects a terminal or the text around it: control characters (C0, DEL, C1), line and paragraph
/// separators, and characters that reorder text.
pub fn is_control(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

fn shortened(text: String) -> String {
    if text.len() <= MAX {
        return text;
    }
    let count = text.chars().count();
    if count <= MAX {
        return text;
    }
    let gap = format!(" [{} characters left out] ", count - START - END);
    let start = text.chars().take(START);
    let end = text.chars().skip(count - END);
    start.chain(gap.chars()).chain(end).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn shown(text: &str, expected: &str) {
        let once = one_line(text.to_owned());
        assert_eq!(once, expected);
        assert_eq!(one_line(once.clone()), once);
    }

    #[test]
    fn terminal_control_characters_are_escaped() {
        shown("a `b\\c` d", "a `b\\c` d");
        shown("größe \u{3b1}", "größe \u{3b1}");
        shown("a\nb\r\tc", "a\\nb\\r\\tc");
        shown("\u{1b}[2Jx\0\u{7f}\u{9b}", "\\u{1b}[2Jx\\u{0}\\u{7f}\\u{9b}");
        shown("a\u{202e}b\u{2028}c", "a\\u{202e}b\\u{2028}c");
        shown("a\u{61c}b", "a\\u{61c}b");
    }

    #[test]
    fn long_messages_keep_start_and_remedy() {
        let text = format!("start {}; remedy", "\u{3b1}\n".repeat(400));
        let line = one_line(text);
        assert!(line.starts_with("start \u{3b1}\\n") && line.ends_with("\\n; remedy"));
        assert!(line.contains("414 characters left out"), "{line}");
        assert!(line.chars().count() < MAX);
        shown(&line, &line);
        let fits = "\u{3b1}".repeat(MAX);
        shown(&fits, &fits);
    }
}
