//! Columns of text of molecular files (names of chains, residues and atoms) as numbers with labels.
//!
//! The numbers follow from the texts alone, so that they are the same in all frames ([`label_code`]). Only in the rare
//! case that two long texts of a frame have the same hash, the later one gets the next number.

use std::borrow::Cow;
use std::collections::BTreeMap;

use spherule_files::escape_controls;
use spherule_frame::{Attribute, AttributeData, RawParticles, label_code, next_label_code};

/// Most different texts of a column. Large complexes have some hundreds of names of atoms; more come from a damaged file,
/// or are not names.
const MAX_LABELS: usize = 4096;

/// Length of the longest text, bytes.
const MAX_LEN: usize = 64;

/// Bytes of the text of an atom.
pub(super) const CODE_LEN: usize = size_of::<i32>();

/// Number of recent texts that are found without a search, a power of two.
const RECENT: usize = 64;

/// A column that grows text by text.
#[derive(Debug)]
pub(super) struct TextColumn {
    name: &'static str,
    codes: Vec<i32>,
    labels: BTreeMap<i64, String>,
    /// Short texts by hashes of their [`key`], with their numbers: most atoms have the names of others a few lines before.
    recent: [Option<(u64, i32)>; RECENT],
    /// Whether a text is not empty.
    has_text: bool,
    /// Why the column is left out.
    fault: Option<String>,
}

impl TextColumn {
    pub(super) const fn new(name: &'static str) -> Self {
        Self {
            name,
            codes: Vec::new(),
            labels: BTreeMap::new(),
            recent: [None; RECENT],
            has_text: false,
            fault: None,
        }
    }

    /// Adds the text of an atom, which may be empty.
    pub(super) fn push(&mut self, text: &[u8]) {
        if self.fault.is_some() {
            return;
        }
        let key = key(text);
        let place = key.map(place);
        let known = place.and_then(|place| self.recent[place]);
        if let Some((_, code)) = known.filter(|(known, _)| Some(*known) == key) {
            self.codes.push(code);
            return;
        }
        match self.code(text) {
            Ok(code) => {
                self.codes.push(code);
                if let (Some(key), Some(place)) = (key, place) {
                    self.recent[place] = Some((key, code));
                }
            }
            Err(fault) => {
                self.fault = Some(fault);
                (self.codes, self.labels) = (Vec::new(), BTreeMap::new());
            }
        }
    }

    /// The number of `text`, which gets a label.
    ///
    /// # Errors
    /// What is wrong with the column: it has too many texts, or a text that is too long.
    fn code(&mut self, text: &[u8]) -> Result<i32, String> {
        if text.len() > MAX_LEN {
            return Err(format!("has a text of {} bytes, more than {MAX_LEN}", text.len()));
        }
        self.has_text |= !text.is_empty();
        let text = match String::from_utf8_lossy(text) {
            Cow::Borrowed(text) => escape_controls(text),
            Cow::Owned(text) => Cow::Owned(escape_controls(&text).into_owned()),
        };
        let mut code = label_code(&text);
        loop {
            match self.labels.get(&i64::from(code)) {
                Some(label) if *label == text => return Ok(code),
                Some(_) => code = next_label_code(code),
                None if self.labels.len() == MAX_LABELS => {
                    return Err(format!("has more than {MAX_LABELS} different texts"));
                }
                None => {
                    self.labels.insert(code.into(), text.into_owned());
                    return Ok(code);
                }
            }
        }
    }

    /// Adds the column to `particles`, unless all texts are empty.
    pub(super) fn add_to(self, particles: &mut RawParticles) {
        let Self { name, mut codes, labels, has_text, fault, .. } = self;
        if let Some(fault) = fault {
            particles.notes.push(format!("`{name}` {fault}: left out"));
        } else if has_text {
            codes.shrink_to_fit();
            let data = AttributeData::I32(codes);
            particles.attributes.push(Attribute { name: name.to_owned(), components: 1, data });
            particles.labels.insert(name.to_owned(), labels);
        }
    }
}

/// The bytes of a text of up to eight, if no other one has the same.
fn key(text: &[u8]) -> Option<u64> {
    let mut bytes = [0; 8];
    bytes.get_mut(..text.len())?.copy_from_slice(text);
    (text.last() != Some(&0)).then_some(u64::from_le_bytes(bytes))
}

/// Where among the recent texts that with `key` is.
#[expect(clippy::cast_possible_truncation, reason = "a few bits")]
const fn place(key: u64) -> usize {
    // The upper bits of a product with the golden ratio differ where keys do
    (key.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> (64 - RECENT.trailing_zeros())) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::Format;
    use crate::read::{gro, mmcif, pdb, pieces};

    /// The column `name` of each step of a file with this `text`; None if the step has none.
    fn texts_of(format: Format, text: &str, name: &str) -> Vec<Option<Vec<String>>> {
        let steps = pieces::steps(format, text.as_bytes()).expect("steps");
        let step = |step| {
            let particles = pieces::read(format, text.as_bytes(), step).expect("atoms");
            let column = particles.attributes.iter().find(|a| a.name == name)?;
            let AttributeData::I32(codes) = &column.data else { panic!("integers") };
            let label = |code: &i32| particles.labels[name][&i64::from(*code)].clone();
            assert_eq!(codes.len(), particles.positions.len());
            Some(codes.iter().map(label).collect())
        };
        steps.iter().map(step).collect()
    }

    #[test]
    fn pdb_files_have_names() {
        let text = "CRYST1   30.000   25.000   20.000  90.00  90.00  90.00 P 1           1\n\
            ATOM      1  CA  ALA A   1       1.000   2.000   3.000  1.00 16.50      PROA C\n\
            ATOM      2 1HB2 ALA b   1       1.000   2.000   3.000\n\
            HETATM    3  C1' TIP3    1       1.000   2.000   3.000\nEND\n";
        let texts = |name: &str| texts_of(pdb::FORMAT, text, name).remove(0).expect("text");
        assert_eq!(texts("chain"), ["A", "b", ""]);
        assert_eq!(texts("segment"), ["PROA", "", ""]);
        assert_eq!(texts("residue_name"), ["ALA", "ALA", "TIP3"]);
        assert_eq!(texts("atom_name"), ["CA", "1HB2", "C1'"]);
        let without = text.replace("PROA", "    ");
        assert_eq!(texts_of(pdb::FORMAT, &without, "segment"), [None]);
    }

    #[test]
    fn gro_files_have_names() {
        let atoms = "2\n    1SOL     OW    1   0.100   0.200   0.300\n    2LIG    1HB    2   0.100   0.200   0.300\n\
            1.0 1.0 1.0\n";
        let text = format!("one\n{atoms}two\n{}", atoms.replace("LIG", "ABC"));
        let texts = |name: &str| texts_of(gro::FORMAT, &text, name);
        let owned = |texts: [&str; 2]| Some(texts.map(str::to_owned).to_vec());
        assert_eq!(texts("residue_name"), [owned(["SOL", "LIG"]), owned(["SOL", "ABC"])]);
        assert_eq!(texts("atom_name"), [owned(["OW", "1HB"]), owned(["OW", "1HB"])]);
        assert_eq!(texts("chain"), [None, None]);
    }

    #[test]
    fn mmcif_files_have_names() {
        let names = ["x", "y", "z"].map(|axis| format!("_atom_site.Cartn_{axis}\n")).concat();
        let columns =
            "_atom_site.label_atom_id\n_atom_site.label_comp_id\n_atom_site.label_asym_id\n";
        let text = format!(
            "data_a\nloop_\n{names}{columns}_atom_site.auth_asym_id\n\
             1 2 3 \"C1'\" LIG B A\n1 2 3 '1HB' HOH C ?\n"
        );
        let texts = |name: &str| texts_of(mmcif::FORMAT, &text, name).remove(0).expect("text");
        assert_eq!(texts("chain"), ["A", "C"]);
        assert_eq!(texts("residue_name"), ["LIG", "HOH"]);
        assert_eq!(texts("atom_name"), ["C1'", "1HB"]);
        assert_eq!(texts_of(mmcif::FORMAT, &text, "segment"), [None]);
    }

    fn column<T: AsRef<[u8]>>(texts: &[T]) -> RawParticles {
        let mut column = TextColumn::new("atom_name");
        for text in texts {
            column.push(text.as_ref());
        }
        let mut particles = RawParticles::default();
        column.add_to(&mut particles);
        particles
    }

    fn codes(particles: &RawParticles) -> &[i32] {
        match &particles.attributes[0].data {
            AttributeData::I32(codes) => codes,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn texts_are_numbers_with_labels() {
        let particles = column(&["CA", "CA", "", "Ca", "a\x1b"]);
        assert_eq!(codes(&particles)[..3], [label_code("CA"), label_code("CA"), 0]);
        let labels = &particles.labels["atom_name"];
        let texts = codes(&particles).iter().map(|code| labels[&i64::from(*code)].as_str());
        assert_eq!(texts.collect::<Vec<_>>(), ["CA", "CA", "", "Ca", "a\\u{1b}"]);
        assert_eq!(column(&["A", "A\0", "A", "A\0"]).labels["atom_name"].len(), 2);
        // Text that is not UTF-8 has one label
        assert_eq!(column(&[&b"\xe4"[..], b"B", b"\xe4"]).labels["atom_name"].len(), 2);
        let none = RawParticles::default();
        assert_eq!(column(&["", ""]), none);
        assert_eq!(column::<&str>(&[]), none);
    }

    #[test]
    fn texts_with_the_same_hash_have_different_numbers() {
        // 24 bits repeat after some thousands of texts
        let mut before = BTreeMap::new();
        let pair = (0..1_000_000).map(|i| format!("text {i}")).find_map(|text| {
            let first = before.insert(label_code(&text), text.clone());
            first.map(|first| [first, text])
        });
        let pair = pair.expect("a collision");
        let particles = column(&[&pair[0], &pair[1], &pair[0]]);
        let [first, second, third] = codes(&particles) else { panic!("three texts") };
        assert_eq!((first, *second), (third, next_label_code(*first)));
        let labels = &particles.labels["atom_name"];
        assert_eq!([first, second].map(|code| &labels[&i64::from(*code)]), [&pair[0], &pair[1]]);
    }

    #[test]
    fn too_many_and_too_long_texts_are_left_out() {
        let many: Vec<String> = (0..1_000_000).map(|i| i.to_string()).collect();
        let particles = column(&many);
        assert!(particles.attributes.is_empty() && particles.labels.is_empty());
        assert_eq!(particles.notes, ["`atom_name` has more than 4096 different texts: left out"]);
        assert_eq!(column(&many[..4096]).labels["atom_name"].len(), 4096);
        let particles = column(&["A".to_owned(), "A".repeat(65)]);
        let note = "`atom_name` has a text of 65 bytes, more than 64: left out";
        assert_eq!(particles.notes, [note]);
    }
}
