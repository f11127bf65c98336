//! The materials of parts of the particles: opaque ones, by the value of an attribute.

use glam::Vec3;

use super::Finish;

/// The material of some parts of the particles.
#[derive(Debug, Clone, PartialEq)]
pub struct PartMaterial {
    /// The values of the attribute.
    pub parts: Vec<i32>,
    /// How the surface reflects light.
    pub finish: Finish,
    /// Base colour, linear RGB; by default that of each particle.
    pub color: Option<Vec3>,
}

/// The materials of parts of the particles.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PartMaterials {
    materials: Vec<PartMaterial>,
    /// Parts in ascending order, with the index of their material.
    by_part: Vec<(i32, usize)>,
}

impl PartMaterials {
    /// A part that several materials name has the first of them.
    pub fn new(materials: Vec<PartMaterial>) -> Self {
        let named = materials
            .iter()
            .enumerate()
            .flat_map(|(index, m)| m.parts.iter().map(move |part| (*part, index)));
        let mut by_part: Vec<(i32, usize)> = named.collect();
        by_part.sort_unstable();
        by_part.dedup_by_key(|(part, _)| *part);
        Self { materials, by_part }
    }

    /// Whether all particles have the same material.
    pub fn is_empty(&self) -> bool {
        self.by_part.is_empty()
    }

    /// The materials.
    pub fn materials(&self) -> &[PartMaterial] {
        &self.materials
    }

    /// The parts with a material, and its index, that are not among `parts`.
    pub fn absent(&self, parts: impl Iterator<Item = i32>) -> Vec<(i32, usize)> {
        let mut is_absent = vec![true; self.by_part.len()];
        let mut count = is_absent.len();
        for part in parts {
            // Stop at the first particle by which all are found
            if count == 0 {
                break;
            }
            if let Ok(found) = self.by_part.binary_search_by_key(&part, |(p, _)| *p) {
                count -= usize::from(std::mem::take(&mut is_absent[found]));
            }
        }
        let known = self.by_part.iter().zip(is_absent);
        known.filter_map(|(part, is_absent)| is_absent.then_some(*part)).collect()
    }

    /// The index of the material of `part`; None if it has that of all other particles.
    #[inline]
    pub fn index_of(&self, part: i32) -> Option<usize> {
        let found = self.by_part.binary_search_by_key(&part, |(p, _)| *p).ok()?;
        Some(self.by_part[found].1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(parts: &[i32]) -> PartMaterial {
        PartMaterial { parts: parts.to_vec(), finish: Finish::Matte, color: None }
    }

    #[test]
    fn parts_have_the_material_that_names_them() {
        let parts = PartMaterials::new(vec![of(&[7, -3]), of(&[0, 7, i32::MAX])]);
        for (part, index) in
            [(7, Some(0)), (-3, Some(0)), (0, Some(1)), (i32::MAX, Some(1)), (1, None)]
        {
            assert_eq!(parts.index_of(part), index, "{part}");
        }
        assert_eq!(parts.absent([0, 7, 0, 2].into_iter()), [(-3, 0), (i32::MAX, 1)]);
        assert!(
            PartMaterials::default().is_empty() && PartMaterials::new(vec![of(&[])]).is_empty()
        );
    }
}
