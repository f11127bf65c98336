//! Text behind the numbers of columns.

use std::collections::BTreeMap;

/// Names of the values of columns of integers, by the names of the columns.
pub type Labels = BTreeMap<String, BTreeMap<i64, String>>;

/// Letters, digits and primes, which nearly all names of chains, residues and atoms consist of. The number of a character
/// is its place, from 1.
const ALPHABET: &[u8; 63] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789'";

/// Bits of a character.
const BITS: u32 = 6;

/// Length of the longest text that has a number of its own: it needs 24 bits, which f32 holds exactly.
const PACKED: usize = 4;

/// Number of codes for other text, which are below zero.
const HASHES: u32 = 1 << 24;

/// The number of `text` in a column of [`names::TEXTS`](crate::names::TEXTS): the same in every frame of every file.
///
/// No two texts of up to four letters, digits and primes have the same number: that of `A` is 1, that of `B` is 2. Other
/// texts have a hash below zero, which another text may have, too. Case matters.
pub fn label_code(text: &str) -> i32 {
    packed(text.as_bytes()).unwrap_or_else(|| hashed(text.as_bytes()))
}

/// The number of a text if another one of the column has `code`, which is a hash.
pub fn next_label_code(code: i32) -> i32 {
    if code > -HASHES.cast_signed() { code - 1 } else { -1 }
}

fn packed(text: &[u8]) -> Option<i32> {
    if text.len() > PACKED {
        return None;
    }
    let mut code = 0;
    for byte in text.iter().rev() {
        let place = PLACES[usize::from(*byte)];
        if place == 0 {
            return None;
        }
        code = (code << BITS) | i32::from(place);
    }
    Some(code)
}

/// The hash of Fowler, Noll and Vo, 32 bits, as one of the codes below zero.
fn hashed(text: &[u8]) -> i32 {
    let step = |hash: u32, byte: &u8| (hash ^ u32::from(*byte)).wrapping_mul(0x0100_0193);
    let hash = text.iter().fold(0x811c_9dc5, step);
    -1 - (hash % HASHES).cast_signed()
}

/// Places in [`ALPHABET`] by byte, 0 for other bytes.
const PLACES: [u8; 256] = places();

const fn places() -> [u8; 256] {
    let mut table = [0; 256];
    let mut place = 0;
    while place < 63 {
        table[ALPHABET[place as usize] as usize] = place + 1;
        place += 1;
    }
    table
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    #[expect(clippy::cast_precision_loss, clippy::cast_possible_truncation, reason = "tested")]
    fn codes_are_distinct_and_exact_in_single_precision() {
        for (text, code) in [("", 0), ("A", 1), ("B", 2), ("a", 27), ("AA", 65)] {
            assert_eq!(label_code(text), code, "{text}");
        }
        let texts = [
            "A",
            "a",
            "AB",
            "BA",
            "CA",
            "Ca",
            "1HB",
            "HB1",
            "C1'",
            "O5'",
            "HOH",
            "''''",
            "C1*",
            "-",
            "PROA",
            "PROTA",
            "O1P+",
            "\u{e4}",
            "a longer text",
        ];
        let codes: HashSet<i32> = texts.into_iter().map(label_code).collect();
        assert_eq!(codes.len(), texts.len());
        assert!(codes.iter().all(|code| *code as f32 as i32 == *code));
        assert!(label_code("PROTA") < 0 && label_code("C1*") < 0 && label_code("''''") > 0);
        assert_eq!(next_label_code(-5), -6);
        assert_eq!(next_label_code(-HASHES.cast_signed()), -1);
    }
}
