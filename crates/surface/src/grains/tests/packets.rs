//! Packets against single rays and all grains.

use glam::Vec3;

use super::{GrainShape, GrainSurface, GrainTree, Heap, Random, meshes, packet, shapes};
use crate::{Intersections, MaterialId, Shape, Side};
use spherule_tree::accel::Coherence;
use spherule_tree::math::{SimdLevel, Supported};
use spherule_tree::ray::RayPacket;

/// What the rays of a packet find, as bits.
fn traced(
    surface: &GrainSurface<'_>,
    rays: &RayPacket,
    coherence: Coherence,
) -> Vec<Option<[u32; 9]>> {
    let (mut rays, mut hits) = (*rays, Intersections::default());
    let before = rays;
    surface.intersect(&mut rays, coherence, 0, &mut hits);
    let occluded = surface.occluded(&before, coherence, 0xffff);
    assert_eq!(occluded, hits.mask, "{coherence:?}");
    let bits = |hit: crate::Intersection| {
        let [x, y, z] = hit.point.to_array().map(f32::to_bits);
        let [a, b, c] = hit.normal.to_array().map(f32::to_bits);
        [hit.t.to_bits(), hit.particle, x, y, z, a, b, c, hit.offset.to_bits()]
    };
    hits.all(16).into_iter().map(|hit| hit.map(bits)).collect()
}

/// The lanes of `rays` one by one, each in a packet of its own.
fn alone(surface: &GrainSurface<'_>, rays: &RayPacket) -> Vec<Option<[u32; 9]>> {
    let one = |lane: usize| {
        let mut single = RayPacket::default();
        single.push(&rays.ray(lane));
        single.time[0] = rays.time[lane];
        traced(surface, &single, Coherence::Coherent)[0]
    };
    (0..16).map(one).collect()
}

#[track_caller]
fn compare(tree: &GrainTree, seed: u64) {
    let surface = GrainSurface::new(tree);
    let mut random = Random(seed);
    let mut hits = 0;
    for number in 0..60 {
        let rays = packet(number, &mut random, 1.0);
        let expected = alone(&surface, &rays);
        hits += expected.iter().flatten().count();
        for coherence in [Coherence::Coherent, Coherence::Incoherent] {
            assert_eq!(traced(&surface, &rays, coherence), expected, "{tree:?} {number}");
        }
        let levels = SimdLevel::ALL.into_iter().filter(|level| level.is_supported());
        for level in levels {
            let other = surface.with_simd(Supported::or_best(level));
            assert_eq!(traced(&other, &rays, Coherence::Coherent), expected, "{level:?}");
        }
    }
    assert!(hits > 200, "{tree:?}: {hits}");
}

#[test]
fn packets_and_instruction_sets_find_what_single_rays_find() {
    for (shape, _) in shapes() {
        let heap = Heap::random(300, Vec3::ZERO, 1.0, [0.05, 0.2], 21);
        compare(&heap.tree(shape.clone()), 3);
        compare(&heap.in_motion(0.3, 9.0, 4).tree(shape), 4);
    }
    let heap = Heap::random(60, Vec3::ZERO, 1.0, [0.1, 0.3], 22);
    compare(&heap.tree(meshes::tetrahedron()), 5);
}

/// Each grain in a tree of its own, and the nearest of all.
#[test]
fn trees_find_the_nearest_of_all_grains() {
    for (shape, _) in shapes() {
        let heap = Heap::random(60, Vec3::new(20.0, 0.0, 5.0), 1.0, [0.05, 0.4], 31);
        let tree = heap.tree(shape.clone());
        let trees: Vec<GrainTree> = (0..60)
            .map(|grain| {
                let one = Heap {
                    centers: vec![heap.centers[grain]],
                    orientations: vec![heap.orientations[grain]],
                    sizes: vec![heap.sizes[grain]],
                    ..Heap::default()
                };
                one.tree(shape.clone())
            })
            .collect();
        let mut random = Random(6);
        let (mut hits, mut differing) = (0, 0);
        for _ in 0..400 {
            let target = Vec3::new(20.0, 0.0, 5.0) + random.vector();
            let ray = super::towards(target + 4.0 * random.vector(), target);
            let found = GrainSurface::new(&tree).crossing(&ray, Side::Outside);
            let all = (0..60_u16).zip(&trees).filter_map(|(grain, tree)| {
                let surface = GrainSurface::new(tree).of(MaterialId::PARTICLES, grain.into());
                surface.crossing(&ray, Side::Outside)
            });
            let expected = all.min_by(|a, b| a.t.total_cmp(&b.t));
            match (found, expected) {
                (Some(a), Some(b)) if a.particle == b.particle => {
                    hits += 1;
                    let cosine = a.normal.dot(ray.direction).abs().max(1e-3);
                    assert!((a.t - b.t).abs() * cosine < 2e-5, "{shape:?} {} {}", a.t, b.t);
                }
                (None, None) => {}
                _ => differing += 1,
            }
        }
        assert!(hits > 300 && differing <= 2, "{shape:?}: {hits} {differing}");
    }
}

#[test]
fn the_lower_index_wins_ties() {
    // Each grain three times
    let heap = Heap::random(40, Vec3::ZERO, 1.0, [0.1, 0.3], 41);
    let thrice = |values: &[[f32; 4]]| values.iter().flat_map(|v| [*v; 3]).collect();
    let copies = Heap {
        centers: heap.centers.iter().flat_map(|v| [*v; 3]).collect(),
        orientations: thrice(&heap.orientations),
        sizes: heap.sizes.iter().flat_map(|v| [*v; 3]).collect(),
        ..Heap::default()
    };
    let tree = copies.tree(GrainShape::Ellipsoid);
    let surface = GrainSurface::new(&tree);
    let mut random = Random(8);
    for number in 0..60 {
        let rays = packet(number, &mut random, 1.0);
        for hit in traced(&surface, &rays, Coherence::Coherent).into_iter().flatten() {
            assert_eq!(hit[1] % 3, 0);
        }
    }
}

#[test]
fn a_distant_camera_sees_the_same_shapes() {
    let heap = Heap::random(200, Vec3::ZERO, 1.0, [0.05, 0.2], 51);
    for (shape, _) in shapes() {
        let tree = heap.tree(shape);
        let surface = GrainSurface::new(&tree);
        let mut random = Random(12);
        let mut same = 0;
        for _ in 0..300 {
            // Powers of two along an axis, so that both rays are the same line
            let target = Vec3::new(0.0, random.next(), random.next());
            let near = surface.nearest(&super::Ray::new(target - 2.0 * Vec3::X, Vec3::X));
            let far = surface.nearest(&super::Ray::new(target - 1_048_576.0 * Vec3::X, Vec3::X));
            assert_eq!(near.map(|hit| hit.particle), far.map(|hit| hit.particle));
            if let (Some(near), Some(far)) = (near, far) {
                same += 1;
                let cosine = near.normal.x.abs().max(1e-3);
                assert!((near.point - far.point).length() * cosine < 1e-5);
                assert!((near.offset / far.offset - 1.0).abs() * cosine < 1e-3);
            }
        }
        assert!(same > 100, "{same}");
    }
}

#[test]
fn rays_that_are_not_finite_hit_nothing() {
    let heap = Heap::random(100, Vec3::ZERO, 1.0, [0.2, 0.5], 61);
    for (shape, _) in shapes() {
        let tree = heap.tree(shape);
        let surface = GrainSurface::new(&tree);
        let mut rays = packet(0, &mut Random(1), 1.0);
        rays.origin[0][2] = f32::NAN;
        rays.direction[1][4] = f32::INFINITY;
        rays.t_max[8] = -1.0;
        rays.t_min[9] = f32::NAN;
        for lane in [10, 11] {
            for axis in 0..3 {
                rays.direction[axis][lane] = 0.0;
            }
        }
        let found = traced(&surface, &rays, Coherence::Coherent);
        assert!([2, 4, 8, 9, 10, 11].iter().all(|lane| found[*lane].is_none()));
    }
}
