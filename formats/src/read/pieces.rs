//! Readers as their tests call them: what is read of a whole text must come of it in pieces, too, errors included.

use super::input::TextInput;
use super::{Step, xyz};
use crate::detect::Format;
use crate::{MemoryBudget, ParseError, RawParticles};

/// Bytes of pieces: less than a line, about one, and some; of a long text larger ones, which take less time.
fn pieces(bytes: &[u8]) -> &'static [usize] {
    match bytes.len() {
        0..4000 => &[3, 40, 1000],
        _ => &[5000],
    }
}

/// Whether `bytes` would be read in pieces if there were more of them.
fn is_text(format: Format, bytes: &[u8]) -> bool {
    match format {
        Format::Csv => true,
        Format::Xyz => matches!(xyz::kind(bytes), Ok(xyz::Kind::Molecular | xyz::Kind::Bare)),
        other => other.is_streamed(bytes),
    }
}

#[track_caller]
pub(super) fn steps(format: Format, bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
    let expected = format.steps(bytes);
    if is_text(format, bytes) {
        for &piece in pieces(bytes) {
            let mut text = TextInput::in_pieces(bytes, true, piece);
            let found = format.steps_within(&mut text, MemoryBudget::UNLIMITED);
            assert_eq!(found, expected, "pieces of {piece} bytes");
        }
    }
    expected
}

#[track_caller]
pub(super) fn read(format: Format, bytes: &[u8], step: &Step) -> Result<RawParticles, ParseError> {
    let expected = format.read(bytes, step);
    if is_text(format, bytes) && step.span.end <= bytes.len() && step.span.start <= step.span.end {
        for &piece in pieces(bytes) {
            // With NaN among the numbers they differ from themselves.
            let shown = |read: &Result<RawParticles, ParseError>| format!("{read:?}");
            let read = |is_known| {
                let mut text = TextInput::in_pieces(bytes, is_known, piece);
                let read = format.read_within(&mut text, step, MemoryBudget::UNLIMITED);
                assert!(text.check_source().is_ok());
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
