//! Several files of one step become one set of particles.

use std::collections::{BTreeMap, VecDeque};

use glam::DVec3;

use crate::order::index_u32;
use crate::{Attribute, AttributeData, Bond, Positions, RawParticles, ScalarType};
use spherule_files::one_line;
use spherule_frame::with_values;

/// Name of the attribute that distinguishes the parts: an index into the sequence's part names.
pub const PART_ATTRIBUTE: &str = "part";

/// Puts `parts` (index of the part, its particles) after one another and adds the attribute
/// `part`. If all have the same index and an attribute of this name, they keep it.
///
/// Attributes that all parts with particles have in the same number of components are kept, in
/// a type that holds them all; a part without particles takes none away, because writers drop
/// the attributes then. `notes` reports what is lost.
pub fn merge(parts: Vec<(u32, RawParticles)>, notes: &mut Vec<String>) -> RawParticles {
    // Pieces of one part may have parts of their own.
    let is_one = parts.windows(2).all(|pair| pair[0].0 == pair[1].0);
    let count = parts.iter().map(|(_, p)| p.positions.len()).sum();
    let mut part = Vec::with_capacity(count);
    for (index, particles) in &parts {
        part.resize(part.len() + particles.positions.len(), *index);
    }
    let mut particles: Vec<RawParticles> = parts.into_iter().map(|(_, p)| p).collect();
    let time = particles.iter().find_map(|p| p.time);
    let step = particles.iter().find_map(|p| p.step);
    let cell = particles.iter().find_map(|p| p.cell);
    let bonds = merge_bonds(&particles);
    let mut attributes = merge_attributes(&mut particles, notes);
    let has_own = attributes.iter().any(|a| a.name == PART_ATTRIBUTE);
    if !(is_one && has_own) {
        attributes.retain(|a| a.name != PART_ATTRIBUTE);
        attributes.push(Attribute {
            name: PART_ATTRIBUTE.to_owned(),
            components: 1,
            data: AttributeData::U32(part),
        });
    }
    RawParticles {
        positions: merge_positions(particles.into_iter().map(|p| p.positions).collect()),
        attributes,
        time,
        step,
        cell,
        bonds,
    }
}

/// The bonds of all parts, by the indices that their particles have behind one another.
fn merge_bonds(parts: &[RawParticles]) -> Vec<Bond> {
    let mut bonds = Vec::new();
    let mut first = 0_usize;
    for part in parts {
        let start = index_u32(first);
        let moved = part.bonds.iter().map(|bond| bond.map(|i| i.saturating_add(start)));
        bonds.extend(moved);
        first += part.positions.len();
    }
    bonds
}

fn merge_positions(parts: Vec<Positions>) -> Positions {
    if parts.iter().all(|p| matches!(p, Positions::F32(_))) {
        let mut all = Vec::with_capacity(parts.iter().map(Positions::len).sum());
        for part in parts {
            if let Positions::F32(v) = part {
                all.extend(v);
            }
        }
        return Positions::F32(all);
    }
    let mut all: Vec<DVec3> = Vec::with_capacity(parts.iter().map(Positions::len).sum());
    for part in parts {
        match part {
            Positions::F32(v) => all.extend(v.iter().map(|p| p.as_dvec3())),
            Positions::F64(v) => all.extend(v),
        }
    }
    Positions::F64(all)
}

fn merge_attributes(parts: &mut [RawParticles], notes: &mut Vec<String>) -> Vec<Attribute> {
    let mut filled: Vec<&mut RawParticles> =
        parts.iter_mut().filter(|p| !p.positions.is_empty()).collect();
    let Some((first, others)) = filled.split_first_mut() else {
        // No particles at all: the longest list of names has the most information.
        let fullest = parts.iter_mut().max_by_key(|p| p.attributes.len());
        return fullest.map_or(Vec::new(), |p| std::mem::take(&mut p.attributes));
    };
    // Each is looked up, never searched for: there may be very many.
    let mut others: Vec<ByKind> = others.iter_mut().map(|other| by_kind(other)).collect();
    let mut merged = Vec::new();
    let mut lost: Vec<String> = Vec::new();
    for mut attribute in std::mem::take(&mut first.attributes) {
        let kind = (attribute.name, attribute.components);
        let same: Vec<AttributeData> =
            others.iter_mut().filter_map(|other| other.get_mut(&kind)?.pop_front()).collect();
        attribute.name = kind.0;
        if same.len() == others.len() {
            attribute.data = join(attribute.data, same);
            merged.push(attribute);
        } else {
            lost.push(attribute.name);
        }
    }
    for other in others {
        let left = other.into_iter().filter(|(_, data)| !data.is_empty());
        lost.extend(left.map(|((name, _), _)| name));
    }
    lost.sort();
    lost.dedup();
    if !lost.is_empty() {
        notes.push(one_line(format!("not in all parts, so left out: {}", lost.join(", "))));
    }
    merged
}

/// Attributes by name and components, those alike in their order.
type ByKind = BTreeMap<(String, usize), VecDeque<AttributeData>>;

/// Takes the attributes of a part.
fn by_kind(part: &mut RawParticles) -> ByKind {
    let mut attributes = ByKind::new();
    for attribute in std::mem::take(&mut part.attributes) {
        let kind = (attribute.name, attribute.components);
        attributes.entry(kind).or_default().push_back(attribute.data);
    }
    attributes
}

fn join(first: AttributeData, others: Vec<AttributeData>) -> AttributeData {
    let kind = others
        .iter()
        .fold(first.scalar_type(), |kind, other| kind.common_with(other.scalar_type()));
    others.into_iter().fold(convert(first, kind), |all, other| append(all, convert(other, kind)))
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "`ScalarType::common_with` only widens; integers beyond 2^53 round where it says f64"
)]
fn convert(data: AttributeData, kind: ScalarType) -> AttributeData {
    if data.scalar_type() == kind {
        return data;
    }
    macro_rules! cast {
        ($variant:ident, $ty:ty) => {
            AttributeData::$variant(with_values!(data, v => v.into_iter().map(|x| x as $ty).collect()))
        };
    }
    match kind {
        ScalarType::I8 => cast!(I8, i8),
        ScalarType::U8 => cast!(U8, u8),
        ScalarType::I16 => cast!(I16, i16),
        ScalarType::U16 => cast!(U16, u16),
        ScalarType::I32 => cast!(I32, i32),
        ScalarType::U32 => cast!(U32, u32),
        ScalarType::I64 => cast!(I64, i64),
        ScalarType::U64 => cast!(U64, u64),
        ScalarType::F32 => cast!(F32, f32),
        ScalarType::F64 => cast!(F64, f64),
    }
}

/// `all` followed by `more`; both are of one type.
fn append(mut all: AttributeData, more: AttributeData) -> AttributeData {
    macro_rules! append {
        ($($variant:ident),*) => {
            match (&mut all, more) {
                $((AttributeData::$variant(a), AttributeData::$variant(b)) => a.extend(b),)*
                _ => unreachable!("join converts all to one type"),
            }
        };
    }
    append!(I8, U8, I16, U16, I32, U32, I64, U64, F32, F64);
    all
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn particles(count: usize, attributes: Vec<Attribute>) -> RawParticles {
        RawParticles {
            positions: Positions::F32(vec![Vec3::ONE; count]),
            attributes,
            time: None,
            step: None,
            cell: None,
            bonds: Vec::new(),
        }
    }

    fn attribute(name: &str, components: usize, data: AttributeData) -> Attribute {
        Attribute { name: name.into(), components, data }
    }

    #[test]
    fn common_attributes_are_joined_in_a_wide_enough_type() {
        let a = particles(
            1,
            vec![
                attribute("id", 1, AttributeData::U32(vec![u32::MAX])),
                attribute("v", 3, AttributeData::F32(vec![1.0, 2.0, 3.0])),
                attribute("only_a", 1, AttributeData::F32(vec![0.0])),
            ],
        );
        let b = particles(
            2,
            vec![
                attribute("v", 3, AttributeData::F32(vec![4.0; 6])),
                attribute("id", 1, AttributeData::I32(vec![-1, 5])),
                attribute("only_b", 1, AttributeData::F32(vec![0.0; 2])),
            ],
        );
        let mut notes = Vec::new();
        let merged = merge(vec![(0, a), (3, b)], &mut notes);
        assert_eq!(merged.positions.len(), 3);
        let expected = [
            attribute("id", 1, AttributeData::I64(vec![i64::from(u32::MAX), -1, 5])),
            attribute(
                "v",
                3,
                AttributeData::F32(vec![1.0, 2.0, 3.0, 4.0, 4.0, 4.0, 4.0, 4.0, 4.0]),
            ),
            attribute("part", 1, AttributeData::U32(vec![0, 3, 3])),
        ];
        assert_eq!(merged.attributes, expected);
        assert_eq!(notes, ["not in all parts, so left out: only_a, only_b"]);
    }

    #[test]
    fn empty_part_removes_no_attribute() {
        let full = particles(1, vec![attribute("id", 1, AttributeData::U8(vec![7]))]);
        let mut notes = Vec::new();
        let merged = merge(vec![(0, particles(0, vec![])), (1, full)], &mut notes);
        assert_eq!((merged.attributes.len(), notes.len()), (2, 0));
        let none = merge(vec![(0, particles(0, vec![])), (1, particles(0, vec![]))], &mut notes);
        assert!(none.positions.is_empty() && none.attributes.len() == 1);
    }

    #[test]
    fn types_widen_without_loss() {
        use ScalarType::*;
        for (a, b, wide) in [
            (U8, U16, U16),
            (U8, I8, I16),
            (I64, U32, I64),
            (U64, I8, F64),
            (F32, U16, F32),
            (F32, I32, F64),
            (F32, F64, F64),
        ] {
            assert_eq!(a.common_with(b), wide, "{a:?} {b:?}");
            assert_eq!(b.common_with(a), wide, "{b:?} {a:?}");
        }
    }

    #[test]
    fn f64_positions_stay_f64() {
        let double = RawParticles {
            positions: Positions::F64(vec![DVec3::splat(1e9)]),
            ..particles(0, vec![])
        };
        let merged = merge(vec![(0, particles(1, vec![])), (1, double)], &mut Vec::new());
        assert_eq!(merged.positions, Positions::F64(vec![DVec3::ONE, DVec3::splat(1e9)]));
    }
}
