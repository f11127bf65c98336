//! Unions of spheres along rays against intervals merged in f64.

use super::encode::{OwnedLeaves, Positions, Radii};
use super::*;
use crate::accel::intervals::TreeExit;
use crate::accel::stored::{StoredSettings, StoredTree};
use crate::accel::traverse::TreeHit;

/// The pieces of the line of `ray` inside the union.
struct Exact {
    /// Pieces in ascending order.
    pieces: Vec<(f64, f64)>,
    /// Whether the number of pieces stays the same if rounding to f32 moves their ends a little.
    is_clear: bool,
}

fn merged(scene: &Scene, ray: &Ray, tolerance: f64) -> Exact {
    let mut is_clear = true;
    let mut all = Vec::new();
    for (i, center) in scene.centers.iter().enumerate() {
        let radius = scene.radius(i);
        let (found, graze) = exact(ray, *center, radius);
        let reach = (*center - ray.origin).length() + center.length();
        is_clear &= graze > 1e-5 * f64::from(reach.max(radius)).max(f64::from(radius) * 1e-2);
        if let [near, far] = found[..] {
            all.push((near, far));
        }
    }
    let pieces = united(&all, 0.0);
    is_clear &=
        [-tolerance, tolerance].iter().all(|grown| united(&all, *grown).len() == pieces.len());
    Exact { pieces, is_clear }
}

/// The union of intervals, each extended by `grown` at both ends.
fn united(all: &[(f64, f64)], grown: f64) -> Vec<(f64, f64)> {
    let ends =
        all.iter().map(|(near, far)| (near - grown, far + grown)).filter(|(near, far)| near <= far);
    let mut all: Vec<_> = ends.collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut pieces: Vec<(f64, f64)> = Vec::new();
    for (near, far) in all {
        match pieces.last_mut() {
            Some(last) if near <= last.1 => last.1 = last.1.max(far),
            _ => pieces.push((near, far)),
        }
    }
    pieces
}

/// The distances at which a ray that starts outside changes sides, in order along the line.
fn crossings(tree: &TreeView, ray: &Ray) -> Vec<TreeHit> {
    let mut found = Vec::new();
    let mut rest = *ray;
    while let Some(entry) = tree.entry(&rest) {
        found.push(entry);
        rest.t_min = entry.t;
        match tree.exit(&rest) {
            TreeExit::Here(exit) => {
                assert!(exit.t > entry.t, "{entry:?} {exit:?}");
                found.push(exit);
                rest.t_min = exit.t;
            }
            other => panic!("{ray:?} enters at {entry:?} and does not leave: {other:?}"),
        }
    }
    found
}

/// Returns whether the ray was compared.
#[track_caller]
fn judge(scene: &Scene, tree: &TreeView, ray: &Ray) -> bool {
    let tolerance = 1e-3 * f64::from(scene.typical_radius()).max(1e-3);
    let Exact { pieces, is_clear } = merged(scene, ray, tolerance);
    let starts = pieces.iter().all(|p| p.0 > tolerance || p.1 < -tolerance);
    if !is_clear || !starts {
        return false;
    }
    let expected: Vec<f64> = pieces.iter().filter(|p| p.0 > 0.0).flat_map(|p| [p.0, p.1]).collect();
    let found = crossings(tree, ray);
    let what = format!("{} {ray:?}: {found:?} should be {expected:?}", scene.name);
    assert_eq!(found.len(), expected.len(), "{what}");
    for (hit, t) in found.iter().zip(&expected) {
        assert!((f64::from(hit.t) - t).abs() < 0.1 * tolerance + 1e-5 * t, "{what}");
        // The point lies on the surface of the sphere that was hit.
        let (center, radius) = tree.sphere(hit.slot);
        let (own, _) = exact(ray, center, radius);
        let on = |t: f64| own.iter().any(|own| (own - t).abs() < tolerance + 1e-5 * t);
        assert!(on(*t), "{what}: not a place of {:?}", hit.slot);
    }
    // The midpoint of each piece is inside, and the exit is at its end.
    for (near, far) in pieces.iter().filter(|p| p.0 > 0.0) {
        let t_min = (0.5 * (near + far)) as f32;
        let inside = Ray { t_min, ..*ray };
        assert!(tree.contains(ray.at(t_min)), "{what}: outside at {t_min}");
        let exit = tree.exit(&inside);
        let is_right = matches!(exit, TreeExit::Here(hit) if found.contains(&hit));
        assert!(is_right, "{what}: {exit:?} from {t_min}");
        let t_max = 0.5 * (t_min + *far as f32);
        let short = Ray { t_max, ..inside };
        assert_eq!(tree.exit(&short), TreeExit::Beyond, "{what}");
    }
    true
}

fn nested() -> Scene {
    let centers = random_points(300, 31);
    let mut random = Random(32);
    Scene {
        name: "nested and disjoint",
        centers,
        radii: (0..300).map(|_| 0.01 + 0.4 * random.next().powi(4)).collect(),
    }
}

fn scenes() -> Vec<Scene> {
    vec![
        Scene::common("none", Vec::new(), 0.1),
        Scene::common("one", vec![Vec3::new(0.1, 0.2, 0.3)], 0.5),
        Scene::common("coincident", vec![Vec3::splat(0.25); 100], 0.5),
        Scene::common("body", random_points(2000, 33), 0.12),
        Scene::common("sparse", random_points(500, 34), 0.05),
        nested(),
    ]
}

#[test]
fn unions_match_intervals_merged_in_f64() {
    for scene in scenes() {
        let rays = rays(&scene, 150, 35);
        for settings in all_settings() {
            let mut builder = TreeBuilder::new();
            builder.build(&scene.spheres(), &settings);
            let mut judged = 0;
            for level in tested_levels() {
                builder.tree_mut().set_simd(level);
                let view = builder.tree().view();
                judged += rays.iter().filter(|ray| judge(&scene, &view, ray)).count();
            }
            assert!(judged >= 60, "{}: {judged} judged", scene.name);
        }
    }
}

#[test]
fn structures_and_kernels_agree_on_unions_to_the_bit() {
    for scene in scenes() {
        let rays = rays(&scene, 200, 36);
        let of_all = |settings: &BuildSettings, level: SimdLevel| {
            let mut builder = TreeBuilder::new();
            let settings = BuildSettings { keep_indices: true, ..*settings };
            builder.build(&scene.spheres(), &settings);
            builder.tree_mut().set_simd(level);
            let view = builder.tree().view();
            let named = |hit: TreeHit| (hit.t.to_bits(), view.particle(hit.slot));
            let found = rays.iter().map(|ray| {
                let found = crossings(&view, ray);
                found.into_iter().map(named).collect::<Vec<_>>()
            });
            found.collect::<Vec<_>>()
        };
        let fused = tested_fused_levels();
        for levels in [&[SimdLevel::Portable][..], &fused] {
            let mut first = None;
            for settings in all_settings() {
                for level in levels {
                    let found = of_all(&settings, *level);
                    let first = first.get_or_insert_with(|| found.clone());
                    assert_eq!(*first, found, "{} {settings:?} {level:?}", scene.name);
                }
            }
        }
    }
}

#[test]
fn stored_spheres_form_a_union_as_stored() {
    let common = Scene::common("body", random_points(3000, 37), 0.1);
    for scene in [common, nested()] {
        let radius = (scene.radii.len() == 1).then(|| scene.radii[0]);
        let radii = radius.map_or(Radii::U8, |_| Radii::None);
        for positions in Positions::ALL {
            let owned = OwnedLeaves::encode(&scene, positions, radii);
            let leaves = owned.leaves();
            let mut tree = StoredTree::new();
            let settings =
                StoredSettings { structure: Structure::Lbvh, radius, keep_indices: true };
            tree.build(&leaves, settings).expect("nodes as they were made");
            let stored = owned.scene(scene.name, radius);
            let rays = rays(&stored, 200, 38);
            let view = tree.view(&leaves);
            let judged = rays.iter().filter(|ray| judge(&stored, &view, ray)).count();
            assert!(judged > 20, "{} {positions:?}: {judged} judged", scene.name);
        }
    }
}

#[test]
fn spheres_that_end_together_go_to_the_lower_index() {
    let scene = Scene::common("coincident", vec![Vec3::ZERO; 40], 1.0);
    for settings in all_settings() {
        let mut builder = TreeBuilder::new();
        builder.build(&scene.spheres(), &BuildSettings { keep_indices: true, ..settings });
        let view = builder.tree().view();
        let found: Vec<u32> = crossings(&view, &Ray::new(Vec3::new(-3.0, 0.1, 0.2), Vec3::X))
            .iter()
            .map(|hit| view.particle(hit.slot))
            .collect();
        assert_eq!(found, [0, 0], "{settings:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn spheres_on_a_line_form_a_union(
        spheres in prop::collection::vec((0_u8..60, 1_u8..20, -3_i8..4), 1..40),
        start in 0_u8..60,
    ) {
        // Whole numbers, so that ends touch and coincide often; all arithmetic except roots is exact.
        let centers = spheres.iter().map(|s| Vec3::new(f32::from(s.0), 0.0, 0.0)).collect();
        let radii: Vec<f32> = spheres.iter().map(|s| f32::from(s.1)).collect();
        let scene = Scene { name: "line", centers, radii };
        let mut pieces: Vec<(f32, f32)> = spheres
            .iter()
            .map(|s| (f32::from(s.0) - f32::from(s.1), f32::from(s.0) + f32::from(s.1)))
            .collect();
        pieces.sort_by(|a, b| a.0.total_cmp(&b.0));
        let origin = f32::from(start) + 0.5;
        let mut end = origin;
        for (near, far) in &pieces {
            if *near <= end {
                end = end.max(*far);
            }
        }
        for settings in all_settings() {
            let mut builder = TreeBuilder::new();
            builder.build(&scene.spheres(), &settings);
            let view = builder.tree().view();
            let ray = Ray::new(Vec3::new(origin, 0.0, 0.0), Vec3::X);
            let is_inside = pieces.iter().any(|p| p.0 <= origin && p.1 >= origin);
            prop_assert_eq!(view.contains(ray.origin), is_inside);
            match view.exit(&ray) {
                TreeExit::Here(hit) => prop_assert_eq!(hit.t, end - origin),
                other => prop_assert_eq!((other, is_inside), (TreeExit::NotInside, false)),
            }
        }
    }
}
