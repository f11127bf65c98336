//! Writing to standard output and standard error. Nothing else does, except clap's help and the progress bar.
//!
//! File names, attribute names, manifest keys and the messages that quote them come from outside. They could
//! control the terminal, forge a line of ours, or reorder the text around them. So a line is escaped here, as a
//! whole: whoever makes text for people hands over its lines one by one and escapes nothing. JSON keeps its
//! meaning: its strings get JSON's own escapes.

use std::fmt::Write as _;
use std::io::{self, Write};
use std::path::Path;

use serde_json::Value;
use spherule_formats::{escape_controls, is_control};

use super::CliError;

/// Whether somebody still reads standard output.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Reader {
    Listening,
    /// The reader has closed the pipe: it has what it needs. This is no error.
    Gone,
}

/// Prints one line to standard error. A reader that has gone away, or a log on a full disk, is no reason to stop
/// work.
pub(super) fn message(text: &str) {
    let _ = io::stderr().write_all(line(text).as_bytes());
}

/// Prints lines of a result to standard output.
///
/// # Errors
/// They cannot be written.
pub(super) fn lines(lines: impl IntoIterator<Item = impl AsRef<str>>) -> Result<Reader, CliError> {
    let text: String = lines.into_iter().map(|text| line(text.as_ref())).collect();
    write(&text)
}

/// The same on a terminal that shows nothing else afterwards.
///
/// # Errors
/// They cannot be written.
pub(super) fn lines_afresh(
    lines: impl IntoIterator<Item = impl AsRef<str>>,
) -> Result<Reader, CliError> {
    // To the first line and column, with everything below cleared away.
    write("\x1b[H\x1b[J")?;
    self::lines(lines)
}

/// Prints a result for scripts to standard output, as one line.
///
/// # Errors
/// It cannot be written.
pub(super) fn json(value: &Value) -> Result<Reader, CliError> {
    lines([json_line(value)])
}

/// Prints a result for scripts to standard output, indented.
///
/// # Errors
/// It cannot be written.
pub(super) fn pretty_json(value: &Value) -> Result<Reader, CliError> {
    // Line breaks are between its parts alone.
    lines(format!("{value:#}").lines().map(escape_json))
}

/// Prints the content of a file to standard output, as it is.
///
/// # Errors
/// It cannot be written.
pub(super) fn file(content: &str) -> Result<Reader, CliError> {
    write(content)
}

/// Puts `text` on standard output. It is flushed: what stays in a buffer is lost without an error at the end.
fn write(text: &str) -> Result<Reader, CliError> {
    // One piece, so that lines of several threads or processes do not mix.
    let mut out = io::stdout().lock();
    let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    written_to_stdout(written)
}

/// What came of writing to standard output.
///
/// # Errors
/// It cannot be written.
pub(super) fn written_to_stdout(written: io::Result<()>) -> Result<Reader, CliError> {
    match written {
        Ok(()) => Ok(Reader::Listening),
        Err(e) if e.kind() == io::ErrorKind::BrokenPipe => Ok(Reader::Gone),
        Err(e) => Err(CliError::io(Path::new("standard output"))(e)),
    }
}

/// A whole line.
fn line(text: &str) -> String {
    escape_controls(text).into_owned() + "\n"
}

/// JSON on one line in which nothing controls a terminal.
pub(super) fn json_line(value: &Value) -> String {
    escape_json(&value.to_string())
}

/// `json` without line breaks between its parts: what controls a terminal can only be in its strings.
fn escape_json(json: &str) -> String {
    let mut text = String::with_capacity(json.len());
    for c in json.chars() {
        if is_control(c) {
            // Writing to a string cannot fail.
            let _ = write!(text, "\\u{:04x}", u32::from(c));
        } else {
            text.push(c);
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_stays_one_line() {
        assert_eq!(line("a.xyz: 3 particles"), "a.xyz: 3 particles\n");
        assert_eq!(
            line("a\nerror: b\u{1b}[31m\u{202e}"),
            "a\\nerror: b\\u{1b}[31m\\u{202e}\n"
        );
    }

    #[test]
    fn json_keeps_its_meaning() {
        let value = serde_json::json!({"name\u{9b}": "a\n\u{1b}\u{7f}\u{202e}\u{61c} ä"});
        let text = json_line(&value);
        assert!(!text.contains(is_control), "{text}");
        assert_eq!(serde_json::from_str::<Value>(&text).unwrap(), value);
    }
}
