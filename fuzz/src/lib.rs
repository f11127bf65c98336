//! What the fuzz targets do with their bytes, and what must hold of whatever comes out.
//!
//! One function a target. Ordinary tests replay the corpus through the same functions with the stable
//! toolchain: `formats/tests/corpus` includes `readers`, `tests/suite/corpus.rs` includes `program`.

use std::borrow::Cow;

pub mod program;
pub mod readers;

pub use readers::Target;

/// Every target by the name of its folder in `corpus`.
pub fn targets() -> impl Iterator<Item = (&'static str, Target)> {
    readers::TARGETS.into_iter().chain(program::TARGETS)
}

/// Set in a choice: it is one of the places where lines, words and tags begin or end, not any byte.
const AT_CUT: u16 = 0x8000;

/// Stands for the number of the copy in a part that is repeated.
const COUNTER: u8 = 0x01;

/// `bytes` as an input of about `size` bytes: a part of them, which the last four bytes choose, is repeated. libFuzzer
/// alone seldom makes large inputs, and only those show what takes more than linear time or memory. Where the part
/// has a `COUNTER`, each copy has its number there, so that names differ.
pub fn repeated(bytes: &[u8], size: usize) -> Cow<'_, [u8]> {
    let Some((rest, choice)) = bytes.split_last_chunk::<4>() else {
        return Cow::Borrowed(bytes);
    };
    let [start, end] = [[choice[0], choice[1]], [choice[2], choice[3]]].map(u16::from_le_bytes);
    let start = place(rest, 0, start);
    let end = place(rest, start, end);
    let (before, part, after) = (&rest[..start], &rest[start..end], &rest[end..]);
    if part.is_empty() {
        return Cow::Borrowed(rest);
    }
    let mut all = before.to_vec();
    let mut number = 0_u32;
    while number == 0 || all.len() + part.len() + after.len() < size {
        push_numbered(&mut all, part, number);
        number += 1;
    }
    all.extend_from_slice(after);
    Cow::Owned(all)
}

fn push_numbered(to: &mut Vec<u8>, part: &[u8], number: u32) {
    let mut pieces = part.split(|byte| *byte == COUNTER);
    to.extend_from_slice(pieces.next().unwrap_or_default());
    for piece in pieces {
        to.extend_from_slice(number.to_string().as_bytes());
        to.extend_from_slice(piece);
    }
}

/// The place in `bytes` from `least` on that `choice` stands for.
fn place(bytes: &[u8], least: usize, choice: u16) -> usize {
    let number = usize::from(choice & !AT_CUT);
    let is_cut = |at: &usize| {
        let before = at.checked_sub(1).and_then(|before| bytes.get(before));
        matches!(bytes.get(*at), None | Some(b'<')) || before.is_none_or(|b| b"\n,;> }".contains(b))
    };
    if choice & AT_CUT == 0 {
        return least + number % (bytes.len() - least + 1);
    }
    let cuts: Vec<usize> = (least..=bytes.len()).filter(is_cut).collect();
    // The end is one.
    cuts[number % cuts.len()]
}
