//! Which parts of the particles have a material of their own, by the value of an attribute.

use super::MaterialId;

/// The materials of parts of the particles.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct PartMaterials {
    /// Parts in ascending order, with their material.
    by_part: Vec<(i32, MaterialId)>,
}

impl PartMaterials {
    /// Gives `parts` a material, unless they have one.
    pub(super) fn insert(&mut self, parts: &[i32], material: MaterialId) {
        for part in parts {
            if let Err(place) = self.place_of(*part) {
                self.by_part.insert(place, (*part, material));
            }
        }
    }

    /// Whether all particles have the same material.
    pub const fn is_empty(&self) -> bool {
        self.by_part.is_empty()
    }

    /// The parts with a material of their own that are not among `parts`.
    pub fn absent(&self, parts: impl Iterator<Item = i32>) -> Vec<(i32, MaterialId)> {
        let mut is_absent = vec![true; self.by_part.len()];
        let mut count = is_absent.len();
        for part in parts {
            // Stop at the first particle by which all are found
            if count == 0 {
                break;
            }
            if let Ok(found) = self.place_of(part) {
                count -= usize::from(std::mem::take(&mut is_absent[found]));
            }
        }
        let known = self.by_part.iter().zip(is_absent);
        known.filter_map(|(part, is_absent)| is_absent.then_some(*part)).collect()
    }

    /// The material of `part`; None if it has that of all other particles.
    #[inline]
    pub fn of(&self, part: i32) -> Option<MaterialId> {
        self.place_of(part).ok().map(|place| self.by_part[place].1)
    }

    /// The place of a part, or the one where it belongs.
    #[inline]
    fn place_of(&self, part: i32) -> Result<usize, usize> {
        self.by_part.binary_search_by_key(&part, |(p, _)| *p)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_have_the_material_that_names_them_first() {
        let ids = [3, 4].map(|index| MaterialId::at(index).unwrap());
        let mut parts = PartMaterials::default();
        parts.insert(&[7, -3], ids[0]);
        parts.insert(&[0, 7, i32::MAX], ids[1]);
        for (part, material) in [
            (7, Some(ids[0])),
            (-3, Some(ids[0])),
            (0, Some(ids[1])),
            (i32::MAX, Some(ids[1])),
            (1, None),
        ] {
            assert_eq!(parts.of(part), material, "{part}");
        }
        assert_eq!(parts.absent([0, 7, 0, 2].into_iter()), [(-3, ids[0]), (i32::MAX, ids[1])]);
        assert!(PartMaterials::default().is_empty());
    }
}
