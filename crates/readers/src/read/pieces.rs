//! Readers as their tests call them: what is read of a whole text must come of it in pieces, too, errors included.

use std::ops::Range;

use super::input::TextInput;
use super::{ByteSource, Step, csv, xyz};
use crate::format::Format;
use spherule_frame::{MemoryBudget, ParseError, RawParticles};

/// Bytes of pieces: less than a line, about one, and some; of a long text larger ones, which take less time.
fn pieces(bytes: &[u8]) -> &'static [usize] {
    match bytes.len() {
        0..4000 => &[3, 40, 1000],
        _ => &[5000],
    }
}

/// Whether `bytes` would be read in pieces if there were more of them.
fn is_text(format: Format, bytes: &[u8]) -> bool {
    if format == csv::FORMAT {
        true
    } else if format == xyz::FORMAT {
        matches!(xyz::kind(bytes), Ok(xyz::XyzVariant::Molecular | xyz::XyzVariant::Bare))
    } else {
        format.is_streamed(bytes)
    }
}

#[track_caller]
pub(super) fn steps(format: Format, bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
    let expected = format.steps(bytes);
    if is_text(format, bytes) {
        for &piece in pieces(bytes) {
            let text = TextInput::in_pieces(bytes, true, piece);
            let mut source = ByteSource::from_text(text);
            let found = format.steps_within(&mut source, MemoryBudget::UNLIMITED);
            assert_eq!(found, expected, "pieces of {piece} bytes");
        }
    }
    expected
}

#[track_caller]
pub(super) fn read(format: Format, bytes: &[u8], step: &Step) -> Result<RawParticles, ParseError> {
    let expected = format.read(bytes, step);
    let is_inside = |range: &Range<usize>| range.start <= range.end && range.end <= bytes.len();
    if is_text(format, bytes) && step.byte_range().is_some_and(is_inside) {
        for &piece in pieces(bytes) {
            // With NaN among the numbers they differ from themselves.
            let shown = |read: &Result<RawParticles, ParseError>| format!("{read:?}");
            let read = |is_known| {
                let text = TextInput::in_pieces(bytes, is_known, piece);
                let mut source = ByteSource::from_text(text);
                let read = format.read_within(&mut source, step, MemoryBudget::UNLIMITED);
                assert!(source.text().check_source().is_ok());
                read
            };
            let found = read(true);
            assert_eq!(shown(&found), shown(&expected), "pieces of {piece} bytes");
            // Of a length that is not known, absurd counts are found out at the end.
            let found = read(false);
            assert_eq!(found.is_ok(), expected.is_ok(), "{found:?} {expected:?}");
            if found.is_ok() {
                assert_eq!(shown(&found), shown(&expected), "pieces of {piece} bytes");
            }
        }
    }
    expected
}
