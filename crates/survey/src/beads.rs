//! Coarse-grained beads, whose names are like those of elements: they are farther apart than atoms.

use spherule_formats::Attribute;
use spherule_tracer::scene::RadiusTable;

use super::robust::{SAMPLE, sorted_sample};

/// How many times the distance of bonded atoms that of neighbours is in coarse-grained models; it is at most 1.2 in metals.
const APART: f64 = 1.3;

/// Whether particles with these elements are too far apart for atoms: `touching` is half the distance of neighbours in
/// angstroms. Noble gases have no bonds.
pub(super) fn are_beads(elements: &Attribute, touching: f64) -> bool {
    let is_noble = |element: f64| NOBLE.iter().any(|noble| f64::from(*noble) == element);
    let bonded = sorted_sample(elements.count(), |i| {
        let element = elements.data.get_f64(i);
        let radius = RadiusTable::Covalent.radius(element).filter(|_| !is_noble(element));
        radius.unwrap_or(f64::NAN)
    });
    let is_most = 2 * bonded.len() > elements.count().min(SAMPLE);
    // Hydrogen is bonded to larger atoms
    let large = bonded.get(bonded.len() * 9 / 10);
    is_most && large.is_some_and(|large| touching > APART * large)
}

/// Atomic numbers of the noble gases.
const NOBLE: [u8; 6] = [2, 10, 18, 36, 54, 86];

#[cfg(test)]
mod tests {
    use spherule_formats::AttributeData;

    use super::*;

    #[test]
    fn atoms_are_near_each_other_and_beads_are_not() {
        let of = |elements: &[i32], touching: f64| {
            let data = AttributeData::I32(elements.to_vec());
            are_beads(&Attribute { name: "element".to_owned(), components: 1, data }, touching)
        };
        // Beads called C1A and SC1, methane, water, copper, caesium, argon
        assert!(of(&[6, 6, 6, 16], 2.1));
        assert!(!of(&[6, 1, 1, 1, 1], 0.55));
        assert!(!of(&[8, 1, 1], 0.48));
        assert!(!of(&[29; 4], 1.28) && !of(&[55; 4], 2.62) && !of(&[18; 4], 1.9));
    }
}
