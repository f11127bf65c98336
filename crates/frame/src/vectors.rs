//! Scalars that are the components of a vector, as `vx`, `vy` and `vz`.

use crate::names::RECORD_VECTORS;
use crate::{Attribute, AttributeData, MemoryBudget};

/// Components of a velocity in a plane.
const PLANE: (&str, &[&str]) = ("velocity", &["vx", "vy"]);

/// Joins scalars among `attributes` that are known to be the components of a vector: `vx`, `vy` and `vz` become
/// `velocity`, where the first of them was. Components of different types stay as they are, and so do all if the copy
/// of a vector does not fit into `budget`.
pub fn join_vectors(attributes: &mut Vec<Attribute>, budget: MemoryBudget) {
    for (name, components) in RECORD_VECTORS.into_iter().chain([PLANE]) {
        // Find the components, unless there is such a vector already
        let is_free = !attributes.iter().any(|a| a.name.eq_ignore_ascii_case(name));
        let scalar = |component: &&str| {
            let named = |a: &Attribute| a.components == 1 && a.name.eq_ignore_ascii_case(component);
            attributes.iter().position(named)
        };
        // A velocity in space is not one in a plane
        let is_free = is_free && (components != PLANE.1 || scalar(&"vz").is_none());
        let places: Option<Vec<usize>> = components.iter().map(scalar).collect();
        let Some(places) = places.filter(|_| is_free) else { continue };
        // Join them if they fit into memory
        let parts: Vec<&AttributeData> =
            places.iter().map(|place| &attributes[*place].data).collect();
        let bytes: u64 = parts.iter().map(|part| part.byte_len()).sum();
        let Some(data) = (bytes <= budget.bytes()).then(|| interleaved(&parts)).flatten() else {
            continue;
        };
        // The vector takes the place of its first component
        let first = places.iter().copied().min().unwrap_or(0);
        attributes[first] = Attribute { name: name.to_owned(), components: components.len(), data };
        let mut index = 0;
        attributes.retain(|_| {
            let is_kept = index == first || !places.contains(&index);
            index += 1;
            is_kept
        });
    }
}

/// The first numbers of all parts, then the second ones and so on, if the parts are of one type and length.
fn interleaved(parts: &[&AttributeData]) -> Option<AttributeData> {
    macro_rules! of {
        ($($variant:ident)*) => {
            match parts.first()? {
                $(AttributeData::$variant(first) => {
                    let same: Vec<&Vec<_>> = parts.iter().map(|part| match part {
                        AttributeData::$variant(values) if values.len() == first.len() => {
                            Some(values)
                        }
                        _ => None,
                    }).collect::<Option<_>>()?;
                    let row = |index: usize| same.iter().map(move |values| values[index]);
                    AttributeData::$variant((0..first.len()).flat_map(row).collect())
                })*
            }
        };
    }
    Some(of!(I8 U8 I16 U16 I32 U32 I64 U64 F32 F64))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scalar(name: &str, data: AttributeData) -> Attribute {
        Attribute { name: name.to_owned(), components: 1, data }
    }

    fn joined(mut attributes: Vec<Attribute>, budget: u64) -> Vec<(String, usize)> {
        join_vectors(&mut attributes, MemoryBudget::new(budget, "get more"));
        attributes.into_iter().map(|a| (a.name, a.components)).collect()
    }

    #[test]
    fn components_of_one_type_are_joined() {
        let of =
            |name: &str, first: f32| scalar(name, AttributeData::F32(vec![first, first + 1.0]));
        let mut all = vec![of("m", 0.0), of("VX", 1.0), of("vz", 3.0), of("vy", 2.0), of("c", 9.0)];
        assert_eq!(joined(all.clone(), 23).len(), 5);
        join_vectors(&mut all, MemoryBudget::UNLIMITED);
        let names: Vec<&str> = all.iter().map(|a| &*a.name).collect();
        assert_eq!(names, ["m", "velocity", "c"]);
        assert_eq!(all[1].data, AttributeData::F32(vec![1.0, 2.0, 3.0, 2.0, 3.0, 4.0]));
        // In a plane; not of two types or lengths, nor beside a velocity
        assert_eq!(joined(vec![of("vx", 0.0), of("vy", 0.0)], 99), [("velocity".to_owned(), 2)]);
        let double = scalar("vy", AttributeData::F64(vec![0.0; 2]));
        assert_eq!(joined(vec![of("vx", 0.0), double], 99).len(), 2);
        let short = scalar("vy", AttributeData::F32(vec![0.0]));
        assert_eq!(joined(vec![of("vx", 0.0), short], 99).len(), 2);
        assert_eq!(joined(vec![of("vx", 0.0), of("vy", 0.0), of("Velocity", 0.0)], 99).len(), 3);
    }
}
