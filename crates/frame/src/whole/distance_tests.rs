//! Tests of molecules that are made whole by bonds between atoms near each other.

use super::*;
use crate::{Attribute, AttributeData, Positions};

/// Carbon and hydrogen have bonds of at most 1.5, 1.25 and 1.0; others have none.
fn lengths() -> BondLengths {
    BondLengths::new("element", |number| match number {
        6 => Some(0.75),
        1 => Some(0.5),
        _ => None,
    })
}

/// A tilted cell.
fn cell(periodic: [bool; 3]) -> SimulationCell {
    let edges = [DVec3::X * 9.0, DVec3::new(3.0, 8.0, 0.0), DVec3::new(-2.0, 2.5, 7.0)];
    SimulationCell::new(DVec3::new(1.0, -2.0, 3.0), edges, periodic).unwrap()
}

fn particles(points: Vec<DVec3>, elements: Vec<i32>) -> RawParticles {
    RawParticles {
        positions: Positions::F64(points),
        attributes: vec![Attribute {
            name: "element".to_owned(),
            components: 1,
            data: AttributeData::I32(elements),
        }],
        ..RawParticles::default()
    }
}

fn whole(particles: &mut RawParticles, cell: &SimulationCell) -> Result<Molecules, ParseError> {
    make_whole(particles, cell, Some(&lengths()), MemoryBudget::UNLIMITED)
}

fn positions(particles: &RawParticles) -> Vec<DVec3> {
    (0..particles.positions.len()).map(|i| particles.positions.get(i)).collect()
}

/// The molecules of `points` by brute force: the smallest index in each, found over all images.
fn molecules_by_hand(points: &[DVec3], elements: &[i32], cell: &SimulationCell) -> Vec<usize> {
    let mut of: Vec<usize> = (0..points.len()).collect();
    let images: Vec<DVec3> = (0..343)
        .map(|i| [i % 7 - 3, i / 7 % 7 - 3, i / 49 - 3])
        .filter(|cells| (0..3).all(|edge| cells[edge] == 0 || cell.periodic[edge]))
        .map(|cells| edges(cell, cells))
        .collect();
    let share = |i: usize| lengths().share(f64::from(elements[i]));
    for a in 0..points.len() {
        for b in 0..a {
            let Some((x, y)) = share(a).zip(share(b)) else { continue };
            let is_bond = |image: &DVec3| (points[a] + *image - points[b]).length() <= x + y;
            if images.iter().any(is_bond) && of[a] != of[b] {
                let (low, high) = (of[a].min(of[b]), of[a].max(of[b]));
                of.iter_mut().filter(|of| **of == high).for_each(|of| *of = low);
            }
        }
    }
    of
}

#[test]
fn molecules_are_those_of_brute_force() {
    let mut state = 11_u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / 16_777_216.0
    };
    for periodic in [[false; 3], [true, false, true], [true; 3]] {
        // Few enough that most molecules are small, some of them several cells away
        let cell = cell(periodic);
        let mut place = |_| {
            let cells = if next() < 0.1 { 2.0 } else { 0.0 };
            let [a, b, c] = cell.vectors;
            cell.origin + next() * a + (next() - cells) * b + next() * c
        };
        let points: Vec<DVec3> = (0..90).map(&mut place).collect();
        let elements: Vec<i32> = (0..90).map(|i| [6, 1, 6, 0][i % 4]).collect();
        let mut all = particles(points.clone(), elements.clone());
        let Molecules::Whole { of, .. } = whole(&mut all, &cell).unwrap() else { panic!() };
        let expected = molecules_by_hand(&points, &elements, &cell);
        // The same particles are together; none of the molecules is endless
        assert!(all.notes.len() == 1, "{:?}", all.notes);
        let bonded = expected.iter().enumerate().filter(|(i, of)| i != *of).count();
        assert!(bonded > 10, "{bonded}");
        for a in 0..90 {
            for b in 0..90 {
                assert_eq!(of[a] == of[b], expected[a] == expected[b], "{periodic:?} {a} {b}");
            }
        }
        // Each particle with a bond has one that is not across the boundary, and moved by whole edges
        let moved = positions(&all);
        let inverse = cell.fractions().unwrap();
        for (i, molecule) in expected.iter().enumerate() {
            let edges = inverse * (moved[i] - points[i]);
            assert!((edges - edges.round()).length() < 1e-9, "{edges}");
            let is_near = |j: usize| j != i && moved[j].distance(moved[i]) <= 1.5;
            let is_alone = expected.iter().filter(|of| *of == molecule).count() == 1;
            assert!(is_alone || (0..90).any(is_near), "{periodic:?} {i}");
            assert!(*molecule != i || moved[i] == points[i], "the first one stays");
        }
    }
}

#[test]
fn a_chain_goes_over_a_corner() {
    // From the last corner of the cell along its diagonal, wrapped
    let cell = cell([true; 3]);
    let [a, b, c] = cell.vectors;
    let step = (a + b + c).normalize();
    let start = cell.origin + a + b + c - 2.5 * step;
    let chain: Vec<DVec3> = (0..6).map(|i| start + f64::from(i) * step).collect();
    let mut points = chain.clone();
    points[3..].iter_mut().for_each(|point| *point -= a + b + c);
    // A particle without a place, and one far away without bonds
    points.extend([DVec3::NAN, cell.origin + 0.5 * a]);
    let mut all = particles(points.clone(), vec![6, 6, 6, 6, 6, 6, 6, 6]);
    whole(&mut all, &cell).unwrap();
    let found = positions(&all);
    for (found, expected) in found.iter().zip(&chain) {
        assert!(found.distance(*expected) < 1e-12, "{found} {expected}");
    }
    assert!(found[6].is_nan());
    assert_eq!(found[7], points[7]);
    assert!(all.notes[0].ends_with("made whole: 1"), "{:?}", all.notes);
    // Where the cell does not repeat, the chain stays cut
    let mut all = particles(points.clone(), vec![6; 8]);
    whole(&mut all, &self::cell([true, true, false])).unwrap();
    assert_eq!(positions(&all)[..6], points[..6]);
    assert!(all.notes[0].ends_with("made whole: 0"), "{:?}", all.notes);
}

#[test]
fn a_ring_through_the_boundary_is_left_alone() {
    // Eight atoms along the edge of length 9, next to a cut pair
    let cell = cell([true; 3]);
    let [a, b, _] = cell.vectors;
    let ring = (0..8).map(|i| cell.origin + f64::from(i) / 8.0 * a);
    let pair = [0.02, 0.95].map(|at| cell.origin + 0.5 * b + at * a);
    let points: Vec<DVec3> = ring.chain(pair).collect();
    let mut all = particles(points.clone(), vec![6; 10]);
    let molecules = whole(&mut all, &cell).unwrap();
    let found = positions(&all);
    assert_eq!(found[..9], points[..9]);
    assert!(found[9].distance(points[9] - a) < 1e-12);
    // Each of its particles may be wrapped by itself
    let of = vec![0, 1, 2, 3, 4, 5, 6, 7, 8, 8];
    let Molecules::Whole { of: mut found, count } = molecules else { panic!() };
    found[..8].sort_unstable();
    assert_eq!((found, count), (of, 9));
    assert!(all.notes[1].ends_with("stay as they are: 1"), "{:?}", all.notes);
    // An atom whose own image is near
    let edges = [DVec3::X * 1.2, DVec3::Y * 9.0, DVec3::Z * 9.0];
    let thin = SimulationCell::new(DVec3::ZERO, edges, [true; 3]).unwrap();
    let mut one = particles(vec![DVec3::ONE], vec![6]);
    whole(&mut one, &thin).unwrap();
    assert_eq!(one.notes.len(), 2);
}

#[test]
fn what_cannot_be_found_is_an_error() {
    let cell = cell([true; 3]);
    let fails = |elements, at: DVec3| {
        let mut all = particles(vec![at; 2000], vec![elements; 2000]);
        whole(&mut all, &cell).unwrap_err().to_string()
    };
    // Too many bonds, and none at all
    assert!(fails(6, DVec3::ONE).contains("more than 8 for each of 2000"));
    assert!(fails(0, DVec3::ONE).contains("nor elements"));
    assert!(fails(6, DVec3::NAN).contains("nor elements"));
    // A limit of memory is kept
    let mut all = particles(vec![DVec3::ONE; 10], vec![6; 10]);
    let budget = MemoryBudget::new(900, "raise it");
    let error = make_whole(&mut all, &cell, Some(&lengths()), budget).unwrap_err();
    assert!(error.to_string().contains("bonds by distance"), "{error}");
    // Nothing is no error
    assert!(whole(&mut particles(Vec::new(), Vec::new()), &cell).is_ok());
}
