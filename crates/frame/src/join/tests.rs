use glam::{DVec3, Vec3};

use super::*;
use crate::ScalarType;

fn attribute(name: &str, components: usize, data: impl Into<AttributeData>) -> Attribute {
    Attribute { name: name.into(), components, data: data.into() }
}

fn part(number: u32, name: &str, count: usize, attributes: Vec<Attribute>) -> Part {
    let positions = Positions::F32(vec![Vec3::ONE; count]);
    let particles = RawParticles { positions, attributes, ..RawParticles::default() };
    Part { number, name: name.to_owned(), particles }
}

fn joined(parts: Vec<Part>) -> RawParticles {
    join(parts, MemoryBudget::UNLIMITED).expect("no limit")
}

/// The numbers of a column, with 7 for NaN.
fn numbers(particles: &RawParticles, name: &str) -> (ScalarType, Vec<f64>) {
    let found = particles.attributes.iter().find(|a| a.name == name).expect(name);
    let number = |i: usize| found.data.get_f64(i);
    let number = |i: usize| if number(i).is_nan() { 7.0 } else { number(i) };
    (found.data.scalar_type(), (0..found.data.len()).map(number).collect())
}

#[test]
fn columns_are_joined_in_a_wide_enough_type() {
    let a = vec![
        attribute("n", 1, vec![u32::MAX]),
        attribute("v", 3, vec![1_f32, 2.0, 3.0]),
        attribute("rho", 1, vec![0.5_f32]),
    ];
    let b = vec![
        attribute("v", 3, vec![4_f32; 6]),
        attribute("rho", 1, vec![0.1_f64, 0.2]),
        attribute("n", 1, vec![-1_i32, 5]),
    ];
    let all = join_numbered(vec![part(0, "a", 1, a), part(3, "b", 2, b)], MemoryBudget::UNLIMITED);
    let all = all.expect("no limit");
    assert_eq!(all.positions.len(), 3);
    let expected = [
        attribute("n", 1, vec![i64::from(u32::MAX), -1, 5]),
        attribute("v", 3, vec![1_f32, 2.0, 3.0, 4.0, 4.0, 4.0, 4.0, 4.0, 4.0]),
        attribute("rho", 1, vec![0.5_f64, 0.1, 0.2]),
        attribute(PART, 1, vec![0_u32, 3, 3]),
    ];
    assert_eq!(all.attributes, expected);
    assert_eq!(all.notes, Vec::<String>::new());
    let names = [(0, "a".to_owned()), (3, "b".to_owned())];
    assert_eq!(all.labels[PART], names.into_iter().collect());
}

#[test]
fn parts_have_nan_in_columns_that_they_lack() {
    let a = vec![attribute("Vel", 2, vec![1_f32, 2.0]), attribute("kind", 1, vec![3_u8])];
    let b = vec![attribute("big", 1, vec![9_i32, 8])];
    let all =
        joined(vec![part(0, "fluid", 1, a), part(1, "wall", 2, b), part(2, "none", 0, vec![])]);
    assert_eq!(numbers(&all, "Vel"), (ScalarType::F32, vec![1.0, 2.0, 7.0, 7.0, 7.0, 7.0]));
    assert_eq!(numbers(&all, "kind"), (ScalarType::F32, vec![3.0, 7.0, 7.0]));
    assert_eq!(numbers(&all, "big"), (ScalarType::F64, vec![7.0, 9.0, 8.0]));
    assert_eq!(
        all.notes,
        ["part `wall` without `Vel`, `kind`: NaN there", "part `fluid` without `big`: NaN there"]
    );
}

#[test]
fn radii_ids_and_other_components_are_left_out() {
    let a = vec![
        attribute("radius", 1, vec![1_f32]),
        attribute("id", 1, vec![1_u32]),
        attribute("v", 3, vec![0_f32; 3]),
    ];
    let b = vec![attribute("v", 2, vec![0_f32; 2])];
    let all = joined(vec![part(0, "a", 1, a), part(1, "b", 1, b)]);
    assert!(all.attributes.is_empty());
    let notes = [
        "part `b` without `radius`, `id`: left out",
        "`v` with different numbers of components in parts `a`, `b`: left out",
    ];
    assert_eq!(all.notes, notes);
}

#[test]
fn the_first_of_two_columns_of_one_name_is_used() {
    let twice = || vec![attribute("a", 1, vec![1_u8]), attribute("a", 1, vec![2_u8])];
    for others in [vec![], vec![part(1, "q", 1, vec![attribute("a", 1, vec![1_u8])])]] {
        let mut parts = vec![part(0, "p", 1, twice())];
        parts.extend(others);
        let all = joined(parts);
        assert_eq!(all.attributes.len(), 1);
        assert_eq!(all.attributes[0].data.get_f64(0), 1.0);
        assert_eq!(all.notes, ["several columns `a` in part `p`: the first is used"]);
    }
}

#[test]
fn columns_of_another_length_are_left_out() {
    let ragged = vec![attribute("a", 1, vec![1_u8, 2]), attribute("v", 3, vec![0_f32; 3])];
    let all = joined(vec![part(0, "p", 1, ragged)]);
    assert_eq!((all.attributes.len(), all.attributes[0].name.as_str()), (1, "v"));
    assert_eq!(all.notes, ["`a` of part `p` has 2 numbers, and 1 particles need 1: left out"]);
}

#[test]
fn empty_part_removes_no_column() {
    let full = part(1, "b", 1, vec![attribute("id", 1, vec![7_u8])]);
    let all = joined(vec![part(0, "a", 0, vec![]), full]);
    assert_eq!((all.attributes.len(), all.notes.len()), (1, 0));
    let none = joined(vec![
        part(0, "a", 0, vec![]),
        part(1, "b", 0, vec![attribute("id", 1, vec![0_u8; 0])]),
    ]);
    assert!(none.positions.is_empty() && none.attributes.len() == 1 && none.notes.is_empty());
}

#[test]
fn thousands_of_columns_give_few_notes() {
    let many = |prefix: &str| {
        (0..10_000).map(|i| attribute(&format!("{prefix}{i}"), 1, vec![7_u8])).collect()
    };
    let parts = || vec![part(0, "a", 1, many("a")), part(1, "b", 1, many("b"))];
    let all = joined(parts());
    assert_eq!(all.attributes.len(), 20_000);
    let note =
        "part `a` without `b0`, `b1`, `b2`, `b3`, `b4`, `b5`, `b6`, `b7` and 9992 more: NaN there";
    assert_eq!((all.notes.len(), all.notes[1].as_str()), (2, note));
    // A column of its own in each of many parts must not fill the memory
    let little = MemoryBudget::new(100_000, "free some memory");
    assert!(matches!(join(parts(), little), Err(ParseError::TooLarge { .. })));
    let alone =
        |i: u32| part(i, &format!("{i}"), 1, vec![attribute(&format!("c{i}"), 1, vec![1_u8])]);
    assert_eq!(joined((0..100).map(alone).collect()).notes.len(), 9);
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
fn f64_positions_and_bonds_are_kept() {
    let mut double = part(1, "b", 0, vec![]);
    double.particles.positions = Positions::F64(vec![DVec3::splat(1e9); 2]);
    double.particles.bonds = vec![[0, 1]];
    let all = joined(vec![part(0, "a", 1, vec![]), double]);
    let expected = vec![DVec3::ONE, DVec3::splat(1e9), DVec3::splat(1e9)];
    assert_eq!((all.positions, all.bonds), (Positions::F64(expected), vec![[1, 2]]));
}
