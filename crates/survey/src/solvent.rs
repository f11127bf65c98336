//! Water around other molecules, by the names of residues.

use std::collections::BTreeMap;

use spherule_formats::{Attribute, sample_indices};
use spherule_frame::Labels;
use spherule_frame::names::RESIDUE_NAME;

use super::robust::SAMPLE;

/// Names of water in files of PDB, GROMACS, CHARMM, AMBER and Martini.
const WATER: [&str; 21] = [
    "HOH", "WAT", "H2O", "DOD", "SOL", "TIP", "TIP3", "TIP3P", "TIP4", "TIP4P", "TIP5", "TIP5P",
    "T3P", "T4P", "SPC", "SPCE", "OH2", "W", "WN", "WF", "PW",
];

/// Names of ions, with and without their charges.
const IONS: [&str; 17] = [
    "NA", "SOD", "K", "POT", "CL", "CLA", "BR", "I", "LI", "LIT", "RB", "CS", "MG", "CA", "CAL",
    "ZN", "ION",
];

/// The names of water among the residues of particles with these `attributes`, if there is more of it than of other
/// molecules, which it hides; none without others, which are at least one of a thousand particles.
pub(super) fn hiding_water(attributes: &[Attribute], labels: &Labels) -> Vec<String> {
    let residues = attributes.iter().find(|a| a.name == RESIDUE_NAME);
    let (Some(residues), Some(names)) = (residues, labels.get(RESIDUE_NAME)) else {
        return Vec::new();
    };
    // Count a sample of the particles by their residues
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for index in sample_indices(residues.count(), SAMPLE) {
        #[expect(clippy::cast_possible_truncation, reason = "codes of labels are whole numbers")]
        let code = residues.data.get_f64(index) as i64;
        *counts.entry(names.get(&code).map_or("", String::as_str)).or_default() += 1;
    }
    let is_ion = |name: &str| IONS.contains(&name.trim_end_matches(['+', '-', '1', '2']));
    let water: Vec<&str> = counts.keys().copied().filter(|name| WATER.contains(name)).collect();
    let sum = |of: &dyn Fn(&str) -> bool| -> usize {
        counts.iter().filter(|(name, _)| of(name)).map(|(_, count)| count).sum()
    };
    let others = sum(&|name| !WATER.contains(&name) && !is_ion(name));
    let is_hiding = sum(&|name| WATER.contains(&name)) > others;
    if is_hiding && others * 1000 >= residues.count().min(SAMPLE) {
        water.into_iter().map(str::to_owned).collect()
    } else {
        Vec::new()
    }
}

#[cfg(test)]
mod tests {
    use spherule_formats::AttributeData;

    use super::*;

    fn found(residues: &[(&str, usize)]) -> Vec<String> {
        let names: BTreeMap<i64, String> =
            (0..).zip(residues).map(|(code, (name, _))| (code, (*name).to_owned())).collect();
        let codes = (0..).zip(residues).flat_map(|(code, (_, count))| vec![code; *count]);
        let residues = Attribute {
            name: RESIDUE_NAME.to_owned(),
            components: 1,
            data: AttributeData::I32(codes.collect()),
        };
        hiding_water(&[residues], &Labels::from([(RESIDUE_NAME.to_owned(), names)]))
    }

    #[test]
    fn water_hides_what_it_is_more_than() {
        assert_eq!(found(&[("ALA", 100), ("SOL", 900), ("NA+", 5)]), ["SOL"]);
        assert_eq!(found(&[("ALA", 100), ("HOH", 60), ("WAT", 60)]), ["HOH", "WAT"]);
        // A few molecules in a crystal, water alone, a salt solution, and no water
        for others in [
            &[("ALA", 100), ("HOH", 20)][..],
            &[("SOL", 900)],
            &[("SOL", 900), ("NA", 20), ("CL-", 20)],
            &[("ALA", 100)],
        ] {
            assert!(found(others).is_empty(), "{others:?}");
        }
        assert!(hiding_water(&[], &Labels::new()).is_empty());
    }
}
