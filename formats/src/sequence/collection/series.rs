//! File series of ParaView (`.vtk.series`, `.vtu.series`, `.vtp.series`): JSON with files and times.

use serde::Deserialize;
use serde_json::value::RawValue;

use super::entry::{LineCounter, ListEntry, PartLabel};
use crate::ParseError;

/// The key that says what the JSON is.
const VERSION_KEY: &str = "\"file-series-version\"";

const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

#[derive(Deserialize)]
struct Series<'a> {
    #[serde(rename = "file-series-version")]
    version: String,
    /// Not parsed yet, because only the text shows where an entry is.
    #[serde(borrow)]
    files: Vec<&'a RawValue>,
}

#[derive(Deserialize)]
struct SeriesFile {
    name: String,
    time: f64,
}

/// Whether a file that begins with `head` is a file series.
pub(super) fn is_series(head: &[u8]) -> bool {
    let head = head.strip_prefix(BYTE_ORDER_MARK).unwrap_or(head);
    let is_object = head.trim_ascii_start().starts_with(b"{");
    is_object && memchr::memmem::find(head, VERSION_KEY.as_bytes()).is_some()
}

/// The files of a series.
///
/// # Errors
/// [`ParseError`] at the fault in the JSON.
pub(super) fn entries(bytes: &[u8]) -> Result<Vec<ListEntry>, ParseError> {
    let start = if bytes.starts_with(BYTE_ORDER_MARK) { BYTE_ORDER_MARK.len() } else { 0 };
    let json = bytes.get(start..).unwrap_or_default();
    let series: Series<'_> =
        serde_json::from_slice(json).map_err(|error| bad_json(bytes, start, &error))?;
    if !series.version.starts_with("1.") {
        let what = format!("file series of version {}; version 1.0 is read", series.version);
        return Err(ParseError::unsupported(what));
    }
    let mut lines = LineCounter::new(bytes);
    let mut entries = Vec::with_capacity(series.files.len());
    for raw in series.files {
        // A raw value is a part of the text that it was parsed from.
        let at = raw.get().as_ptr() as usize - bytes.as_ptr() as usize;
        let place = lines.place(at);
        let file: SeriesFile =
            serde_json::from_str(raw.get()).map_err(|error| bad_json(bytes, at, &error))?;
        if file.name.is_empty() {
            return Err(place.malformed("a file without a name"));
        }
        entries.push(ListEntry {
            path: file.name,
            time: Some(file.time),
            part: PartLabel::default(),
            place,
        });
    }
    Ok(entries)
}

/// The error for JSON that begins at byte `start` of `bytes`.
fn bad_json(bytes: &[u8], start: usize, error: &serde_json::Error) -> ParseError {
    let json = bytes.get(start..).unwrap_or_default();
    let at = start + offset_of(json, error.line(), error.column());
    let text = error.to_string();
    // The line in the message counts from `start`.
    let what = text.split(" at line ").next().unwrap_or_default();
    let place = LineCounter::new(bytes).place(at);
    if error.is_eof() {
        return place.malformed(format!(
            "the file ends within the list ({what}); it may still be being written"
        ));
    }
    let remedy = "an entry is { \"name\" : \"a_0.vtu\", \"time\" : 0.5 }";
    place.malformed(format!("bad file series: {what}; {remedy}"))
}

/// The byte at a line and column, both from 1.
fn offset_of(bytes: &[u8], line: usize, column: usize) -> usize {
    let lines = bytes.split_inclusive(|b| *b == b'\n');
    let before: usize = lines.take(line.saturating_sub(1)).map(<[u8]>::len).sum();
    (before + column.saturating_sub(1)).min(bytes.len())
}
