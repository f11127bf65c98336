//! Writes to standard output and standard error. Nothing else does, except clap's help and the progress bar.
//!
//! File names, attribute names, manifest keys and the messages that quote them are untrusted. They could control
//! the terminal, forge a line, or reorder the text around them. So this module escapes whole lines: callers pass
//! text line by line and escape nothing. JSON uses the escapes of JSON.

use std::fmt::Write as _;
use std::io::{self, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use serde_json::Value;
use spherule_formats::{escape_controls, is_control};

use super::CliError;

/// Whether standard output is still being read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Reader {
    Listening,
    /// The reader has closed the pipe. This is not an error.
    Gone,
}

/// Whether the stages, rays and memory of pictures are printed.
static IS_VERBOSE: AtomicBool = AtomicBool::new(false);

/// Prints the stages, rays and memory of pictures from now on.
pub(super) fn set_verbose() {
    IS_VERBOSE.store(true, Ordering::Relaxed);
}

/// Whether the stages, rays and memory of pictures are printed.
pub(super) fn is_verbose() -> bool {
    IS_VERBOSE.load(Ordering::Relaxed)
}

/// Whether only errors are printed to standard error.
static IS_QUIET: AtomicBool = AtomicBool::new(false);

/// Prints only errors to standard error from now on.
pub(super) fn silence() {
    IS_QUIET.store(true, Ordering::Relaxed);
}

/// Whether only errors are printed to standard error.
pub(super) fn is_quiet() -> bool {
    IS_QUIET.load(Ordering::Relaxed)
}

/// Prints one line to standard error, unless only errors are printed. Ignores errors: a closed pipe or a full disk must
/// not stop a job.
pub(super) fn message(text: &str) {
    if !is_quiet() {
        to_stderr(text);
    }
}

/// Prints an error as one line to standard error.
pub(super) fn error(text: &str) {
    to_stderr(&format!("error: {text}"));
}

fn to_stderr(text: &str) {
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

/// Clears the terminal and prints lines to standard output.
///
/// # Errors
/// They cannot be written.
pub(super) fn lines_afresh(
    lines: impl IntoIterator<Item = impl AsRef<str>>,
) -> Result<Reader, CliError> {
    // Move to the first line and column, and clear everything below
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
    // Strings in JSON contain no line breaks
    lines(format!("{value:#}").lines().map(escape_json))
}

/// Prints the content of a file to standard output unchanged.
///
/// # Errors
/// It cannot be written.
pub(super) fn file(content: &str) -> Result<Reader, CliError> {
    write(content)
}

/// Writes and flushes `text` to standard output. Text that stays in a buffer at exit would be lost without an error.
fn write(text: &str) -> Result<Reader, CliError> {
    // A single write, so that lines of several threads or processes do not mix
    let mut out = io::stdout().lock();
    let written = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    written_to_stdout(written)
}

/// Converts the result of a write to standard output.
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

/// JSON on one line without control characters.
pub(super) fn json_line(value: &Value) -> String {
    escape_json(&value.to_string())
}

/// Escapes control characters in `json`, which must be one line, so that they can only be in strings.
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
    fn lines_stay_single_lines() {
        assert_eq!(line("a.xyz: 3 particles"), "a.xyz: 3 particles\n");
        assert_eq!(line("a\nerror: b\u{1b}[31m\u{202e}"), "a\\nerror: b\\u{1b}[31m\\u{202e}\n");
    }

    #[test]
    fn json_keeps_its_meaning() {
        let value = serde_json::json!({"name\u{9b}": "a\n\u{1b}\u{7f}\u{202e}\u{61c} ä"});
        let text = json_line(&value);
        assert!(!text.contains(is_control), "{text}");
        assert_eq!(serde_json::from_str::<Value>(&text).unwrap(), value);
    }
}
