//! Bad input, and memory.

use glam::Vec3;

use super::{
    GrainError, GrainMotion, GrainReport, GrainShape, GrainSizes, GrainSurface, GrainTree, Grains,
    Heap, shapes,
};
use crate::{MaterialId, Shape};
use spherule_tree::ray::Ray;

#[test]
fn what_is_wrong_with_grains_is_counted() {
    let mut heap = Heap::random(9, Vec3::ZERO, 10.0, [1.0, 1.0], 1);
    heap.orientations[0] = [0.0; 4];
    heap.orientations[1] = [f32::NAN, 0.0, 0.0, 1.0];
    heap.orientations[2] = [0.0, 0.0, 3.0, 4.0];
    heap.orientations[3] = heap.orientations[3].map(|c| c * 1.0005);
    heap.sizes[4] = [1.0, -1.0, 1.0];
    heap.sizes[5] = [1.0, 0.0, f32::NAN];
    heap.centers[6] = Vec3::new(0.0, f32::INFINITY, 0.0);
    heap.exponents = vec![[2.0, 4.0]; 9];
    heap.exponents[7] = [0.5, 2.0];
    heap.exponents[8] = [2.0, f32::NAN];
    let mut heap = heap.in_motion(0.1, 0.1, 1);
    heap.displacements[7] = Vec3::NAN;
    heap.rotations[8] = Vec3::INFINITY;
    let tree = heap.tree(GrainShape::Superquadric { exponents: [2.0; 2] });
    let expected = GrainReport {
        grains: 6,
        not_normalised: 1,
        no_orientation: 2,
        bad_sizes: 2,
        bad_centers: 1,
        bad_exponents: 2,
        bad_motions: 2,
    };
    assert_eq!((*tree.report(), tree.len()), (expected, 6));
    assert!(!expected.is_clean());
    // Grains keep their indices, and those without an orientation are upright
    let surface = GrainSurface::new(&tree).of(MaterialId::GROUND, 100);
    for grain in [0, 1, 2, 3, 7, 8] {
        let ray = Ray::new(heap.centers[grain] + 1.5 * Vec3::Z, Vec3::NEG_Z);
        let hit = surface.nearest(&ray).expect("a grain");
        assert_eq!(hit.particle as usize, 100 + grain);
        if grain < 2 {
            assert!((hit.t - 0.5).abs() < 1e-5 && hit.normal.z > 0.999);
        }
    }
}

#[test]
fn common_exponents_are_checked_for_each_grain() {
    let heap = Heap::random(5, Vec3::ZERO, 1.0, [1.0, 1.0], 1);
    let tree = heap.tree(GrainShape::Superquadric { exponents: [f32::NAN, 2.0] });
    assert_eq!(tree.report().bad_exponents, 5);
    // Exponents of other shapes do not matter
    let heap = Heap { exponents: vec![[0.0; 2]; 5], ..heap };
    assert!(heap.tree(GrainShape::Cuboid).report().is_clean());
}

#[test]
fn arrays_of_other_lengths_are_refused() {
    let centers = [Vec3::ZERO; 3];
    let grains = Grains::new(&centers, GrainSizes::Common(Vec3::ONE));
    let message = |grains: &Grains<'_>| {
        GrainTree::new(grains, GrainShape::Ellipsoid).map_err(|e: GrainError| e.to_string())
    };
    assert!(message(&grains).is_ok());
    let sizes = Grains { sizes: GrainSizes::Each(&[[1.0; 3]; 2]), ..grains };
    assert_eq!(message(&sizes).expect_err("too few"), "2 sizes for 3 grains");
    let orientations = Grains { orientations: &[[0.0; 4]; 4], ..grains };
    assert_eq!(message(&orientations).expect_err("too many"), "4 orientations for 3 grains");
    let motion = GrainMotion { displacements: &[], rotations: &[Vec3::ZERO] };
    let moving = Grains { motion: Some(motion), ..grains };
    assert_eq!(message(&moving).expect_err("too few"), "1 rotations for 3 grains");
}

#[test]
fn no_grains_are_no_surface() {
    for (shape, _) in shapes() {
        let tree = Heap::default().tree(shape);
        assert!(tree.is_empty() && tree.bounds().is_none() && tree.bytes() == 0);
        assert!(GrainSurface::new(&tree).nearest(&Ray::new(Vec3::ZERO, Vec3::X)).is_none());
    }
    // All in one place
    let mut heap = Heap::random(1000, Vec3::ONE, 0.0, [0.5, 0.5], 3);
    heap.sizes[17] = [0.6; 3];
    let tree = heap.tree(GrainShape::Ellipsoid);
    let hit = GrainSurface::new(&tree).nearest(&Ray::new(Vec3::new(1.0, 1.0, -4.0), Vec3::Z));
    assert_eq!(hit.map(|hit| hit.particle), Some(17));
}

#[test]
fn grains_are_within_their_bounds() {
    for (shape, _) in shapes() {
        let heap = Heap::random(50, Vec3::new(9.0, 0.0, 0.0), 1.0, [0.1, 0.5], 13);
        let [low, high] = heap.tree(shape).bounds().expect("grains");
        let reach = Vec3::splat(1.0 + 3.0_f32.sqrt() * 0.5 + 1e-4);
        let center = Vec3::new(9.0, 0.0, 0.0);
        assert!(low.cmpge(center - reach).all() && high.cmple(center + reach).all());
    }
}

#[test]
fn the_memory_of_grains_is_predicted() {
    for (count, size) in [(1_000, 0.05), (20_000, 0.02), (20_000, 0.3)] {
        let heap = Heap::random(count, Vec3::ZERO, 1.0, [size, size], 5);
        let tree = heap.tree(GrainShape::Capsule);
        let predicted = GrainTree::predicted_bytes(count as u64, false).kept;
        let bytes = tree.bytes() as u64;
        assert!((predicted / 2..=predicted).contains(&bytes), "{bytes} of {predicted}");
        let bytes = heap.tree(GrainShape::Ellipsoid).bytes();
        assert!(bytes < 100 * count, "{} bytes each", bytes / count);
    }
}
