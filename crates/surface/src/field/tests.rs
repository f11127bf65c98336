use glam::{DVec3, Vec3};
use proptest::prelude::*;

use super::*;

fn exact_weight(q: f64) -> f64 {
    match q {
        q if q <= 0.5 => 6.0 * (q * q * q - q * q) + 1.0,
        q if q <= 1.0 => 2.0 * (1.0 - q).powi(3),
        _ => 0.0,
    }
}

/// The field by its definition, summed over all particles.
fn exact_field(centers: &[Vec3], support: f32, at: DVec3) -> f64 {
    let weight = |a: DVec3, b: DVec3| exact_weight(a.distance(b) / f64::from(support));
    centers
        .iter()
        .map(|j| {
            let j = j.as_dvec3();
            let sum: f64 = centers.iter().map(|k| weight(j, k.as_dvec3())).sum();
            weight(at, j) / sum
        })
        .sum()
}

fn cloud(count: usize, seed: u64, edge: f32) -> Vec<Vec3> {
    let mut state = seed;
    let mut unit = move || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / 16_777_216.0
    };
    (0..count).map(|_| edge * Vec3::new(unit(), unit(), unit()) - 0.3 * edge).collect()
}

#[test]
fn is_the_sum_over_all_particles() {
    let centers = cloud(400, 7, 20.0);
    let field = FieldParticles::new(&centers, 4.0);
    for at in cloud(50, 8, 22.0) {
        let sample = field.sample(at);
        let exact = |at: DVec3| exact_field(&centers, 4.0, at);
        let value = exact(at.as_dvec3());
        assert!((f64::from(sample.value) - value).abs() < 2e-5, "{at}");
        let step = 1e-4;
        let gradient = DVec3::from_array([DVec3::X, DVec3::Y, DVec3::Z].map(|axis| {
            let at = at.as_dvec3();
            (exact(at + step * axis) - exact(at - step * axis)) / (2.0 * step)
        }));
        assert!((sample.gradient.as_dvec3() - gradient).length() < 1e-3, "{at}");
    }
}

#[test]
fn isolated_particle_has_full_density_at_its_centre() {
    let field = FieldParticles::new(&[Vec3::new(1e3, 5.0, -7.0)], 4.0);
    let sample = field.sample(Vec3::new(1e3, 5.0, -7.0));
    assert_eq!((sample.value, sample.gradient), (1.0, Vec3::ZERO));
    assert_eq!(field.sample(Vec3::ZERO).value, 0.0);
    assert_eq!(field.nearest(Vec3::new(1e3, 6.0, -7.0)), Some(0));
    assert_eq!(field.nearest(Vec3::ZERO), None);
    assert_eq!(FieldParticles::new(&[], 1.0).nearest(Vec3::ZERO), None);
}

#[test]
fn coincident_particles_have_bounded_density() {
    let centers = vec![Vec3::ONE; 50_000];
    let field = FieldParticles::new(&centers, 1.0);
    assert!(field.volumes().iter().all(|v| *v == 1.0 / 64.0));
    let few = FieldParticles::new(&centers[..5], 1.0);
    assert!((few.sample(Vec3::ONE).value - 1.0).abs() < 1e-6);
}

#[test]
fn escaped_particles_are_cheap_or_dropped() {
    let mut centers = cloud(2000, 3, 30.0);
    centers.push(Vec3::new(4e5, -4e5, 4e5));
    let field = FieldParticles::new(&centers, 4.0);
    assert_eq!(field.bins().left_out(), 0);
    assert!(field.byte_len() < 2_000 * 64, "{}", field.byte_len());
    assert_eq!(field.nearest(Vec3::new(4e5, -4e5, 4e5)), Some(2000));
    centers.push(Vec3::splat(1e30));
    let field = FieldParticles::new(&centers, 4.0);
    assert_eq!(field.bins().left_out(), 1);
    assert_eq!(field.bins().points().len(), 2001);
    assert_eq!(field.nearest(Vec3::splat(1e30)), None);
}

proptest! {
    #[test]
    fn volumes_do_not_depend_on_the_order(seed in 0_u64..1000, swaps in prop::collection::vec((0_usize..300, 0_usize..300), 50)) {
        let centers = cloud(300, seed, 12.0);
        let mut shuffled = centers.clone();
        for (a, b) in swaps {
            shuffled.swap(a, b);
        }
        let (a, b) = (FieldParticles::new(&centers, 3.0), FieldParticles::new(&shuffled, 3.0));
        prop_assert_eq!(a.bins().points(), b.bins().points());
        prop_assert_eq!(a.volumes(), b.volumes());
        let at = Vec3::splat(2.0);
        prop_assert_eq!(a.sample(at), b.sample(at));
        let nearest = |field: &FieldParticles, of: &[Vec3]| field.nearest(at).map(|i| of[i as usize]);
        prop_assert_eq!(nearest(&a, &centers), nearest(&b, &shuffled));
    }
}
