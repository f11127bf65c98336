//! Whitewater of flows whose potentials are known.

use super::drops::{candidate, threshold};
use super::potential::{Motions, SUM_AT_REST};
use super::*;

const RADIUS: f32 = 0.5;
const CALM: WhitewaterSettings = WhitewaterSettings { speed: 10.0, amount: 1.0, size: 1.0 };

/// A lattice of `size` particles that touch each other.
fn block(size: [u8; 3]) -> Vec<Vec3> {
    let [x, y, z] = size;
    let cells = (0..z).flat_map(|z| (0..y).flat_map(move |y| (0..x).map(move |x| [x, y, z])));
    cells.map(|cell| 2.0 * RADIUS * Vec3::from(cell.map(f32::from))).collect()
}

fn flow<'a>(centers: &'a [Vec3], velocities: &'a [Vec3]) -> Flow<'a> {
    Flow { centers, velocities, ids: None, radius: RADIUS }
}

/// The whitewater of `centers` with velocities by a rule.
fn whitewater(centers: &[Vec3], velocity: impl Fn(Vec3) -> Vec3) -> Whitewater {
    let velocities: Vec<Vec3> = centers.iter().map(|center| velocity(*center)).collect();
    Whitewater::of(flow(centers, &velocities), CALM)
}

#[test]
fn sum_at_rest_is_that_of_a_lattice() {
    let centers = block([9, 9, 9]);
    let middle = centers[centers.len() / 2];
    let reach = 4.0 * RADIUS;
    let kernel = |center: &Vec3| (1.0 - center.distance(middle) / reach).max(0.0);
    // Without the particle itself
    let sum = centers.iter().map(kernel).sum::<f32>() - 1.0;
    assert!((sum / SUM_AT_REST - 1.0).abs() < 0.15, "{sum}");
}

#[test]
fn streams_that_collide_trap_air() {
    // Two blocks run into each other at the plane x = 5.75
    let centers = block([12, 10, 10]);
    let towards = |center: Vec3| if center.x < 5.75 { 8.0 * Vec3::X } else { -8.0 * Vec3::X };
    let found = whitewater(&centers, towards);
    assert!(found.drops.len() > 1000, "{}", found.drops.len());
    let near = |drop: &Drop| (centers[drop.particle as usize].x - 5.5).abs() < 4.0 * RADIUS;
    assert!(found.drops.iter().all(near));
    // Apart, they trap about a third of it: neighbours beside the direction of motion count half
    let trapped = |sign: f32| {
        let velocities: Vec<Vec3> = centers.iter().map(|center| sign * towards(*center)).collect();
        Motions::of(&flow(&centers, &velocities)).largest_trapped_air() / CALM.speed
    };
    let [together, apart] = [1.0, -1.0].map(trapped);
    assert!(together > 2.5 * apart && apart > 0.0, "{together} {apart}");
}

#[test]
fn rigid_motion_traps_no_air() {
    let centers = block([12, 12, 12]);
    let count = centers.len();
    let speed = Vec3::new(6.0, -5.0, 4.0);
    let motions = |velocity: &dyn Fn(Vec3) -> Vec3| {
        let velocities: Vec<Vec3> = centers.iter().map(|center| velocity(*center)).collect();
        Motions::of(&flow(&centers, &velocities)).largest_trapped_air() / CALM.speed
    };
    assert_eq!(motions(&|_| speed), 0.0);
    // A rotation whose outermost particles are as fast as violent water
    let middle = Vec3::splat(5.5);
    let turning = motions(&|center| (CALM.speed / 9.5) * Vec3::Z.cross(center - middle));
    let colliding = motions(&|center| -8.0 * (center - middle).normalize_or_zero());
    assert!(turning < 0.2 && colliding > 0.5, "{turning} {colliding}");
    // Water at rest has none, and slow water neither
    assert_eq!(whitewater(&centers, |_| Vec3::ZERO), Whitewater::default());
    let slow = whitewater(&centers, |center| 0.1 * (middle - center));
    assert_eq!((slow.drops.len(), slow.atomized.len()), (0, 0), "of {count}");
}

#[test]
fn crests_move_forward() {
    // A ridge with the normal x at its edge
    let centers = block([3, 20, 3]);
    let forward = whitewater(&centers, |_| 9.0 * Vec3::X).drops;
    let of_front = |drop: &Drop| centers[drop.particle as usize].x > 1.5;
    assert!(!forward.is_empty() && forward.iter().all(of_front));
    // The middle of a large plane is none
    let plane = block([24, 24, 6]);
    let up = whitewater(&plane, |_| 9.0 * Vec3::Z).drops;
    let is_inner = |drop: &&Drop| {
        let center = plane[drop.particle as usize];
        [center.x, center.y].into_iter().all(|x| (4.0..19.0).contains(&x))
    };
    assert_eq!(up.iter().filter(is_inner).count(), 0);
}

#[test]
fn classes_follow_from_the_number_of_neighbours() {
    // Two deep blocks collide, and one fast particle is above them
    let mut centers = block([16, 12, 12]);
    centers.push(Vec3::new(8.0, 6.0, 40.0));
    let velocity = |center: Vec3| match center {
        Vec3 { z, .. } if z > 30.0 => 20.0 * Vec3::Z,
        Vec3 { x, .. } if x < 7.75 => 9.0 * Vec3::X,
        _ => -9.0 * Vec3::X,
    };
    let found = whitewater(&centers, velocity);
    let last = u32::try_from(centers.len() - 1).unwrap();
    assert_eq!(found.atomized, [last]);
    let mut counts = [0; 3];
    for drop in &found.drops {
        let point = centers[drop.particle as usize] + drop.offset;
        let depth = [11.0 - point.z, point.z, 11.0 - point.y, point.y];
        let depth = depth.into_iter().fold(f32::INFINITY, f32::min);
        match drop.class {
            DropClass::Spray => {
                counts[0] += 1;
                assert!(depth < 0.0, "{drop:?}");
            }
            DropClass::Foam { up } => {
                counts[1] += 1;
                assert!(depth.abs() < 1.5 && (up.length() - 1.0).abs() < 1e-3, "{depth} {up}");
            }
            DropClass::Bubble => {
                counts[2] += 1;
                assert!(depth > -RADIUS, "{drop:?}");
            }
        }
    }
    assert!(counts.iter().all(|count| *count > 20), "{counts:?}");
    let of_last = found.drops.iter().filter(|drop| drop.particle == last);
    assert_eq!(of_last.count(), 160);
}

#[test]
fn drops_stay_with_their_particles() {
    let centers = block([12, 8, 8]);
    let towards = |center: Vec3| if center.x < 5.75 { 6.0 * Vec3::X } else { -6.0 * Vec3::X };
    let velocities: Vec<Vec3> = centers.iter().map(|center| towards(*center)).collect();
    let count = u32::try_from(centers.len()).unwrap();
    let ids: Vec<u32> = (0..count).map(|index| 1000 + 7 * index).collect();
    let now = Whitewater::of(Flow { ids: Some(&ids), ..flow(&centers, &velocities) }, CALM);
    // The same particles elsewhere, a little faster and in another order
    let shift = Vec3::new(32.0, -16.0, 8.0);
    let moved: Vec<Vec3> = centers.iter().rev().map(|center| *center + shift).collect();
    let faster: Vec<Vec3> = velocities.iter().rev().map(|velocity| 1.1 * *velocity).collect();
    let turned: Vec<u32> = ids.iter().rev().copied().collect();
    let next = Whitewater::of(Flow { ids: Some(&turned), ..flow(&moved, &faster) }, CALM);
    let places = |found: &Whitewater, ids: &[u32]| {
        let key =
            |drop: &Drop| (ids[drop.particle as usize], drop.offset.to_array().map(f32::to_bits));
        found.drops.iter().map(key).collect::<std::collections::BTreeSet<_>>()
    };
    let (before, after) = (places(&now, &ids), places(&next, &turned));
    assert!(before.len() > 500 && before.is_subset(&after), "{} {}", before.len(), after.len());
    assert!(after.len() > before.len());
    // Other ids have other drops
    assert!(places(&next, &ids).is_disjoint(&after));
}

#[test]
fn small_drops_are_more_than_large_ones() {
    let all: Vec<_> =
        (0..200).flat_map(|id| (0..160).map(move |k| candidate(id, k, false))).collect();
    let part_above = |radius: f32, of: &dyn Fn(&drops::Candidate) -> f32| {
        all.iter().filter(|one| of(one) > radius).count() as f32 / all.len() as f32
    };
    // An exponential falls by e with each mean, a power by 2^(7/3) with each doubling
    let spray = |one: &drops::Candidate| one.spray_radius();
    let ratio = part_above(0.012 + 0.028, &spray) / part_above(0.012 + 0.056, &spray);
    assert!((ratio / std::f32::consts::E - 1.0).abs() < 0.1, "{ratio}");
    let bubble = |one: &drops::Candidate| one.bubble_radius();
    let ratio = part_above(0.06, &bubble) / part_above(0.12, &bubble);
    assert!((ratio / 5.04 - 1.0).abs() < 0.2, "{ratio}");
    for one in &all {
        assert!((0.012..=0.2).contains(&spray(one)) && (0.045..0.2501).contains(&bubble(one)));
        assert!(one.offset.length() <= 2.2001);
    }
}

#[test]
fn thresholds_are_spread_evenly() {
    let all = (0..500).flat_map(|id| (0..160).map(move |number| threshold(id, number)));
    let below = |limit: f32| all.clone().filter(|value| *value < limit).count() as f32 / 80_000.0;
    for limit in [0.1, 0.5, 0.9] {
        assert!((below(limit) - limit).abs() < 0.01, "{limit}");
    }
}

#[test]
fn hostile_flows_do_not_panic() {
    // All in one place, velocities that are no numbers, places that are far away
    let same = vec![Vec3::ONE; 3000];
    let odd = [f32::NAN, f32::INFINITY, 3e38, 1e20, -1e14, 0.0];
    let velocity = |index: usize| Vec3::new(odd[index % 6], odd[index / 6 % 6], 5.0);
    let velocities: Vec<Vec3> = (0..same.len()).map(velocity).collect();
    let found = Whitewater::of(flow(&same, &velocities), CALM);
    assert!(found.drops.iter().all(|drop| drop.offset.is_finite() && drop.radius > 0.0));
    let far: Vec<Vec3> = (0..3000_u16).map(|i| Vec3::splat(f32::from(i) * 1e30)).collect();
    for speed in [1e-40, 1.0, 1e38, 0.0, -1.0, f32::NAN] {
        let settings = WhitewaterSettings { speed, amount: 2.0, size: 1.0 };
        let found = Whitewater::of(flow(&far, &velocities), settings);
        assert!(found.drops.iter().all(|drop| drop.radius.is_finite()));
    }
    assert_eq!(Whitewater::of(flow(&[], &[]), CALM), Whitewater::default());
    // Without a speed there is nothing to compare with
    let none = WhitewaterSettings { speed: f32::NAN, amount: 1.0, size: 1.0 };
    assert_eq!(Whitewater::of(flow(&same, &velocities), none), Whitewater::default());
}

#[test]
fn number_of_drops_is_limited() {
    // Each particle is spray
    let centers: Vec<Vec3> = (0..500_u16).map(|i| 4.0 * f32::from(i) * Vec3::X).collect();
    let velocities = vec![20.0 * Vec3::X; centers.len()];
    let settings = WhitewaterSettings { amount: 2.0, ..CALM };
    let all = Whitewater::of(flow(&centers, &velocities), settings);
    assert_eq!((all.drops.len(), all.left_out), (500 * 320, 0));
    let some = Whitewater::at_most(40_000, flow(&centers, &velocities), settings);
    assert_eq!(some.drops.len() as u64 + some.left_out, 500 * 320);
    assert!(some.drops.len().abs_diff(40_000) < 1000, "{}", some.drops.len());
    assert!(some.drops.iter().step_by(400).all(|drop| all.drops.contains(drop)));
    assert_eq!(some.atomized, all.atomized);
}

#[test]
fn drops_are_counted_as_they_are_made() {
    let centers = block([12, 8, 8]);
    let velocity = |center: &Vec3| if center.x < 5.75 { 6.0 * Vec3::X } else { -6.0 * Vec3::X };
    let velocities: Vec<Vec3> = centers.iter().map(velocity).collect();
    let speeds = [0.0, 8.0, 10.0, 40.0];
    let made = speeds.map(|speed| {
        let settings = WhitewaterSettings { speed, amount: 0.5, size: 1.0 };
        Whitewater::of(flow(&centers, &velocities), settings).drops.len() as u64
    });
    assert_eq!(drop_counts(flow(&centers, &velocities), &speeds, 0.5), made);
    assert!(made[0] == 0 && made[1] > made[2] && made[2] > made[3], "{made:?}");
}

#[test]
fn violent_speed_is_that_of_the_fastest_unless_all_are_slow() {
    assert_eq!(violent_speed(5.0, 1.0), 5.0);
    // A pool of a metre that sloshes
    let slow = violent_speed(0.2, 1.0);
    assert!((slow - 0.4 * (2.0_f32 * 9.81).sqrt()).abs() < 1e-5, "{slow}");
    assert_eq!(violent_speed(1.0, -3.0), 1.0);
}
