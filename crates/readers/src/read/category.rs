//! Names in a column of text (chemical elements, species) as numbers that are the same in every frame.
//!
//! Elements have their atomic numbers. Any other name has a number from its own characters alone: what else a
//! frame or a file holds cannot change it.

use std::collections::BTreeMap;

use super::text;
use crate::reader::ValueNames;

/// Symbols by atomic number, from 1.
const SYMBOLS: [&str; 118] = [
    "H", "He", "Li", "Be", "B", "C", "N", "O", "F", "Ne", "Na", "Mg", "Al", "Si", "P", "S", "Cl",
    "Ar", "K", "Ca", "Sc", "Ti", "V", "Cr", "Mn", "Fe", "Co", "Ni", "Cu", "Zn", "Ga", "Ge", "As",
    "Se", "Br", "Kr", "Rb", "Sr", "Y", "Zr", "Nb", "Mo", "Tc", "Ru", "Rh", "Pd", "Ag", "Cd", "In",
    "Sn", "Sb", "Te", "I", "Xe", "Cs", "Ba", "La", "Ce", "Pr", "Nd", "Pm", "Sm", "Eu", "Gd", "Tb",
    "Dy", "Ho", "Er", "Tm", "Yb", "Lu", "Hf", "Ta", "W", "Re", "Os", "Ir", "Pt", "Au", "Hg", "Tl",
    "Pb", "Bi", "Po", "At", "Rn", "Fr", "Ra", "Ac", "Th", "Pa", "U", "Np", "Pu", "Am", "Cm", "Bk",
    "Cf", "Es", "Fm", "Md", "No", "Lr", "Rf", "Db", "Sg", "Bh", "Hs", "Mt", "Ds", "Rg", "Cn", "Nh",
    "Fl", "Mc", "Lv", "Ts", "Og",
];

/// Letters of the alphabet, and none for symbols of one letter.
const SECOND: usize = 27;

/// Atomic numbers by first and second letter; 0 where there is no such symbol.
const NUMBERS: [u8; 26 * SECOND] = numbers();

/// The first number of a name that is not an element.
const FIRST_OTHER: u32 = 1000;
/// How many numbers there are for them: all are whole numbers in f32.
const OTHERS: u32 = 16_000_000;

/// Most names that a note lists.
const LISTED: usize = 12;

#[expect(clippy::cast_possible_truncation, reason = "118 symbols")]
const fn numbers() -> [u8; 26 * SECOND] {
    let mut table = [0; 26 * SECOND];
    let mut i = 0;
    while i < SYMBOLS.len() {
        if let Some(place) = place(SYMBOLS[i].as_bytes()) {
            table[place] = i as u8 + 1;
        }
        i += 1;
    }
    table
}

/// The symbol of the chemical element with an atomic number, if there is one.
pub fn element_symbol(number: i64) -> Option<&'static str> {
    let index = usize::try_from(number.checked_sub(1)?).ok()?;
    SYMBOLS.get(index).copied()
}

/// Where in [`NUMBERS`] a symbol is, in whatever case.
const fn place(symbol: &[u8]) -> Option<usize> {
    match symbol {
        [first] if first.is_ascii_alphabetic() => Some(letter(*first) * SECOND),
        [first, second] if first.is_ascii_alphabetic() && second.is_ascii_alphabetic() => {
            Some(letter(*first) * SECOND + letter(*second) + 1)
        }
        _ => None,
    }
}

const fn letter(byte: u8) -> usize {
    (byte.to_ascii_lowercase() - b'a') as usize
}

/// Whether `name` is the symbol of deuterium or tritium.
pub(in crate::read) fn is_isotope(name: &[u8]) -> bool {
    matches!(name, b"D" | b"T")
}

/// The number of `name`. Isotopes of hydrogen are hydrogen.
pub(in crate::read) fn code(name: &[u8]) -> i64 {
    if is_isotope(name) {
        return 1;
    }
    let element = place(name).and_then(|place| NUMBERS.get(place));
    match element {
        Some(0) | None => i64::from(FIRST_OTHER + fnv1a(name) % OTHERS),
        Some(number) => i64::from(*number),
    }
}

/// The number that readers give to the name of an element or of another species.
pub fn name_code(name: &str) -> i64 {
    code(name.as_bytes())
}

/// Whether `code` is that of a chemical element.
pub(in crate::read) fn is_element(code: i64) -> bool {
    code < i64::from(FIRST_OTHER)
}

/// The hash of Fowler, Noll and Vo, 32 bits.
fn fnv1a(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0x811c_9dc5, |hash, byte| (hash ^ u32::from(*byte)).wrapping_mul(0x0100_0193))
}

/// The numbers of those of the `names` in `attribute` that are not symbols of elements; none if all are.
pub(in crate::read) fn value_names<'a>(
    attribute: &str,
    names: impl Iterator<Item = &'a [u8]>,
) -> Option<ValueNames> {
    let mut last: &[u8] = b"";
    let mut codes: BTreeMap<i64, &[u8]> = BTreeMap::new();
    for name in names {
        // Neighbours often have the same name
        if name != last && codes.len() <= MAX_NAMES {
            codes.insert(code(name), name);
            last = name;
        }
    }
    let others = codes.into_iter().filter(|(code, _)| !is_element(*code));
    let text = |(code, name): (i64, &[u8])| (code, String::from_utf8_lossy(name).into_owned());
    let names: Vec<(i64, String)> = others.map(text).collect();
    (!names.is_empty()).then(|| ValueNames { attribute: attribute.to_owned(), names })
}

/// Most names of one attribute; legends have fewer.
const MAX_NAMES: usize = 256;

/// What a user should know of the attribute that holds the numbers of `names`; none if there are no names.
pub(in crate::read) fn note<'a>(
    attribute: &str,
    names: impl Iterator<Item = &'a [u8]>,
) -> Option<String> {
    let codes: BTreeMap<i64, &[u8]> = names.map(|name| (code(name), name)).collect();
    if codes.is_empty() {
        return None;
    }
    let shown = |(code, name): (&i64, &&[u8])| format!("{} = {code}", text::shown(name));
    let listed: Vec<String> = codes.iter().take(LISTED).map(shown).collect();
    let more = if codes.len() > LISTED { ", ..." } else { "" };
    Some(format!(
        "attribute `{attribute}` has numbers for names, atomic numbers for chemical elements: {}{more}",
        listed.join(", ")
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_have_their_atomic_numbers() {
        for (symbol, number) in
            [("H", 1), ("O", 8), ("Cu", 29), ("CU", 29), ("u", 92), ("Og", 118), ("D", 1), ("T", 1)]
        {
            assert_eq!(code(symbol.as_bytes()), number, "{symbol}");
        }
        for (number, symbol) in (1..).zip(SYMBOLS) {
            assert_eq!(code(symbol.as_bytes()), number, "{symbol}");
            assert_eq!(element_symbol(number), Some(symbol));
        }
        for number in [i64::MIN, 0, 119, 1000] {
            assert_eq!(element_symbol(number), None);
        }
    }

    #[test]
    fn unknown_names_have_distinct_numbers() {
        let names = ["water", "wall", "Ow", "X", "C1", "", "7", "\u{e4}"];
        let mut codes: Vec<i64> = names.iter().map(|name| code(name.as_bytes())).collect();
        assert!(codes.iter().all(|c| (1000..16_001_000).contains(c)));
        codes.sort_unstable();
        codes.dedup();
        assert_eq!(codes.len(), names.len());
        // Jobs keep ranges of colours by them.
        assert_eq!(code(b"water"), code(b"water"));
    }

    #[test]
    fn notes_list_names_once() {
        let names = [&b"O"[..], b"H", b"O"];
        let note = note("element", names.into_iter()).expect("names");
        assert!(note.ends_with("elements: \"H\" = 1, \"O\" = 8"), "{note}");
        assert_eq!(super::note("element", std::iter::empty()), None);
    }
}
