//! Motion blur.

use glam::{DQuat, DVec3, Vec3};

use super::{GrainShape, GrainSurface, Heap, Random, packet, rotation_between, shapes};
use crate::{Intersection, Intersections, Shape, Side};
use spherule_tree::accel::Coherence;
use spherule_tree::ray::{Ray, RayPacket};

/// What a ray at `time` finds.
fn at_time(surface: &GrainSurface<'_>, ray: &Ray, time: f32) -> Option<Intersection> {
    let mut rays = RayPacket::default();
    rays.push(ray);
    rays.time[0] = time;
    let mut hits = Intersections::default();
    surface.intersect(&mut rays, Coherence::Coherent, 0, &mut hits);
    hits.all(1)[0]
}

/// The grains at `time` as grains that do not move.
fn frozen(heap: &Heap, time: f32) -> Heap {
    let mut still = Heap { exponents: heap.exponents.clone(), ..Heap::default() };
    for grain in 0..heap.centers.len() {
        still.centers.push(heap.centers[grain] + time * heap.displacements[grain]);
        still.sizes.push(heap.sizes[grain]);
        let [x, y, z, w] = heap.orientations[grain].map(f64::from);
        let middle = DQuat::from_xyzw(x, y, z, w);
        let rotation = DQuat::from_scaled_axis(f64::from(time) * heap.rotations[grain].as_dvec3());
        let [x, y, z, w] = (rotation * middle).to_array();
        #[expect(clippy::cast_possible_truncation, reason = "components of a unit quaternion")]
        still.orientations.push([x, y, z, w].map(|c| c as f32));
    }
    still
}

#[test]
fn rays_see_grains_at_their_time() {
    // Up to a third of a turn, and up to three turns
    for ((shape, _), angle) in
        shapes().into_iter().flat_map(|shape| [(shape.clone(), 1.2), (shape, 12.0)])
    {
        let heap = Heap::random(150, Vec3::ZERO, 1.0, [0.05, 0.3], 3).in_motion(0.4, angle, 9);
        let tree = heap.tree(shape.clone());
        assert!(tree.is_moving() && tree.report().is_clean());
        for time in [-0.5, -0.2, 0.0, 0.35, 0.5] {
            let still = frozen(&heap, time).tree(shape.clone());
            let mut random = Random(17);
            let (mut hits, mut differing) = (0, 0);
            for _ in 0..200 {
                let ray = super::towards(3.0 * random.vector(), random.vector());
                let found = at_time(&GrainSurface::new(&tree), &ray, time);
                let expected = GrainSurface::new(&still).crossing(&ray, Side::Outside);
                match (found, expected) {
                    (Some(a), Some(b)) if a.particle == b.particle => {
                        hits += 1;
                        let cosine = a.normal.dot(ray.direction).abs().max(1e-3);
                        let error = (a.t - b.t).abs() * cosine;
                        assert!(error < 1e-5, "{shape:?} {time} {} {}", a.t, b.t);
                    }
                    (None, None) => {}
                    _ => differing += 1,
                }
            }
            assert!(hits > 120 && differing <= 3, "{shape:?} {time}: {hits} {differing}");
        }
    }
}

#[test]
fn grains_without_motion_are_grains_at_rest() {
    let heap = Heap::random(100, Vec3::ZERO, 1.0, [0.05, 0.3], 5);
    let resting = heap.tree(GrainShape::Cylinder);
    let moving = heap.in_motion(0.0, 0.0, 1).tree(GrainShape::Cylinder);
    let mut random = Random(2);
    for number in 0..40 {
        let rays = packet(number, &mut random, 1.0);
        for lane in 0..16 {
            let [a, b] = [&resting, &moving]
                .map(|tree| at_time(&GrainSurface::new(tree), &rays.ray(lane), rays.time[lane]));
            assert_eq!(a.map(|hit| hit.particle), b.map(|hit| hit.particle));
        }
    }
}

#[test]
fn a_needle_that_turns_is_seen_where_it_is() {
    // A quarter turn about z, from -45 to 45 degrees
    let mut heap = Heap { centers: vec![Vec3::ZERO], ..Heap::default() };
    heap.orientations = vec![[0.0, 0.0, 0.0, 1.0]];
    heap.sizes = vec![[2.0, 0.05, 0.05]];
    heap.displacements = vec![Vec3::ZERO];
    heap.rotations = vec![std::f32::consts::FRAC_PI_2 * Vec3::Z];
    let tree = heap.tree(GrainShape::Ellipsoid);
    let surface = GrainSurface::new(&tree);
    let is_seen = |x: f32, y: f32, time: f32| {
        at_time(&surface, &Ray::new(Vec3::new(x, y, 5.0), Vec3::NEG_Z), time).is_some()
    };
    let side = 1.2;
    assert!(is_seen(side, -side, -0.5) && !is_seen(side, side, -0.5) && !is_seen(1.7, 0.0, -0.5));
    assert!(is_seen(1.7, 0.0, 0.0) && !is_seen(side, side, 0.0) && !is_seen(side, -side, 0.0));
    assert!(is_seen(side, side, 0.5) && !is_seen(side, -side, 0.5) && !is_seen(1.7, 0.0, 0.5));
}

/// The part of a quarter turn, from -45 to 45 degrees, in which an ellipse with the semi-axes `a` > `b` covers a point
/// at the distance `r` from its centre and the polar angle `phi`, radians.
fn coverage(r: f64, phi: f64, [a, b]: [f64; 2]) -> f64 {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};
    if r >= a {
        return 0.0;
    }
    // It covers the point while its long axis is less than `width` away
    let squared = (r.powi(-2) - b.powi(-2)) / (a.powi(-2) - b.powi(-2));
    let width = squared.max(0.0).sqrt().acos();
    let overlap = |center: f64| {
        let (low, high) = ((center - width).max(-FRAC_PI_4), (center + width).min(FRAC_PI_4));
        (high - low).max(0.0)
    };
    [phi - PI, phi, phi + PI].map(overlap).iter().sum::<f64>() / FRAC_PI_2
}

#[test]
fn a_turning_ellipsoid_covers_each_point_for_the_computed_time() {
    let mut heap = Heap { centers: vec![Vec3::ZERO], ..Heap::default() };
    heap.orientations = vec![[0.0, 0.0, 0.0, 1.0]];
    heap.sizes = vec![[2.0, 0.5, 0.7]];
    heap.displacements = vec![Vec3::ZERO];
    heap.rotations = vec![std::f32::consts::FRAC_PI_2 * Vec3::Z];
    let tree = heap.tree(GrainShape::Ellipsoid);
    let surface = GrainSurface::new(&tree);
    const TIMES: u16 = 1000;
    let mut partly = 0;
    for number in 0..240_u8 {
        let (r, phi) = (0.1 * f64::from(number % 24) + 0.03, 0.7 * f64::from(number / 24) - 3.1);
        let point = glam::DVec2::from_angle(phi) * r;
        let ray = Ray::new(point.extend(5.0).as_vec3(), Vec3::NEG_Z);
        let covered = (0..TIMES).filter(|time| {
            let time = (f32::from(*time) + 0.5) / f32::from(TIMES) - 0.5;
            at_time(&surface, &ray, time).is_some()
        });
        let found = covered.count() as f64 / f64::from(TIMES);
        let expected = coverage(r, phi, [2.0, 0.5]);
        assert!((found - expected).abs() < 2.5 / f64::from(TIMES), "{r} {phi}: {found} {expected}");
        partly += u32::from((0.05..0.95).contains(&expected));
    }
    assert!(partly > 50, "{partly}");
}

#[test]
fn rotations_lie_between_orientations() {
    let mut random = Random(3);
    for _ in 0..100 {
        let axis = random.vector().normalize().as_dvec3();
        let angle = 3.0 * f64::from(random.next());
        let from = random.orientation();
        let [x, y, z, w] = from.map(f64::from);
        let to = DQuat::from_axis_angle(axis, angle) * DQuat::from_xyzw(x, y, z, w);
        let to: [f64; 4] = to.to_array();
        let sign = f64::from(random.next().signum());
        #[expect(clippy::cast_possible_truncation, reason = "components of a unit quaternion")]
        let to = to.map(|c| (sign * c) as f32);
        let found = rotation_between(from, to, 0.5).as_dvec3();
        let expected: DVec3 = 0.5 * angle * axis;
        assert!((found - expected).length() < 1e-5, "{found} {expected}");
    }
    let nothing = [[f32::NAN, 0.0, 0.0, 1.0], [0.0; 4], [0.0, 0.0, 0.0, 1.0]];
    for from in nothing {
        assert_eq!(rotation_between(from, [0.0, 0.0, 0.0, 1.0], 1.0), Vec3::ZERO);
    }
}

#[test]
fn light_passes_transmissive_grains_at_their_time() {
    // A slab that moves by ten times its thickness
    let mut heap = Heap { centers: vec![Vec3::ZERO], ..Heap::default() };
    heap.orientations = vec![[0.0, 0.0, 0.0, 1.0]];
    heap.sizes = vec![[0.1, 1.0, 1.0]];
    heap.displacements = vec![2.0 * Vec3::X];
    let tree = heap.tree(GrainShape::Cuboid);
    let mut rays = RayPacket::default();
    for (lane, time) in [-0.5, 0.0, 0.5].into_iter().enumerate() {
        rays.push(&Ray::new(Vec3::new(time * 2.0, 0.1, 5.0), Vec3::NEG_Z));
        rays.time[lane] = if lane == 1 { 0.5 } else { time };
    }
    let mut found = [0.0; 16];
    let half = |cosine: f32, particle: u32| {
        assert_eq!((cosine, particle), (1.0, 0));
        0.5
    };
    GrainSurface::new(&tree).transmittance(&rays, 0b111, &half, &mut found);
    // Both sides of the slab, and nothing where it was earlier
    assert_eq!(found[..3], [0.25, 1.0, 0.25]);
}
