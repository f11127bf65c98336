//! Every structure against brute force in f64, on random and awkward scenes.
#![expect(clippy::cast_possible_truncation, reason = "test scenes are small")]

use glam::{DVec3, Vec3};
use proptest::prelude::*;

use super::oracle::ParticleTree;
use super::simd::SimdLevel;
use super::simd::tested_levels::tested_levels;
use super::view::TreeView;
use super::{
    BuildSettings, BvhLeaves, BvhPreset, BvhSettings, SbvhSettings, SphereRadius, Spheres,
    Structure, TreeBuilder,
};
use crate::blocks::Node;
use crate::ray::Ray;

mod encode;
mod hybrid;
mod intervals;
mod packets;
mod stored;

/// A scene that owns its data.
#[derive(Debug, Clone)]
struct Scene {
    name: &'static str,
    centers: Vec<Vec3>,
    radii: Vec<f32>,
}

impl Scene {
    fn common(name: &'static str, centers: Vec<Vec3>, radius: f32) -> Self {
        Self { name, centers, radii: vec![radius] }
    }

    fn spheres(&self) -> Spheres<'_> {
        let radius = match self.radii[..] {
            [one] => SphereRadius::Common(one),
            _ => SphereRadius::Each(&self.radii),
        };
        Spheres { centers: &self.centers, radius }
    }

    fn radius(&self, particle: usize) -> f32 {
        if self.radii.len() == 1 { self.radii[0] } else { self.radii[particle] }
    }

    fn typical_radius(&self) -> f32 {
        self.radii.iter().sum::<f32>() / self.radii.len() as f32
    }
}

/// A small generator: tests must not change with a crate's version.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 * (1.0 / 16_777_216.0)
    }

    fn point(&mut self) -> Vec3 {
        Vec3::new(self.next(), self.next(), self.next())
    }
}

fn random_points(count: usize, seed: u64) -> Vec<Vec3> {
    let mut random = Random(seed);
    (0..count).map(|_| random.point() * 2.0 - 1.0).collect()
}

fn awkward_scenes() -> Vec<Scene> {
    let cloud = random_points(3000, 1);
    let far = cloud.iter().map(|p| *p + Vec3::new(1e4, -1e4, 1e4)).collect();
    let flat = cloud.iter().map(|p| p.with_z(0.0)).collect();
    let mut escaped = cloud.clone();
    escaped.push(Vec3::new(1e6, 0.0, 0.0));
    let mut absurd = cloud.clone();
    absurd.push(Vec3::splat(3e37));
    let lattice = (0..4096)
        .map(|i| Vec3::new((i % 16) as f32, (i / 16 % 16) as f32, (i / 256) as f32))
        .collect();
    let mut random = Random(7);
    let radii = (0..3000).map(|_| 10.0_f32.powf(-5.0 + 4.0 * random.next())).collect();
    let mut clustered = random_points(2000, 3);
    clustered.extend(random_points(2000, 4).iter().map(|p| *p * 1e-4 + 0.5));
    vec![
        Scene::common("none", Vec::new(), 0.1),
        Scene::common("one", vec![Vec3::new(0.1, 0.2, 0.3)], 0.5),
        Scene::common("coincident", vec![Vec3::splat(0.25); 100], 0.5),
        Scene::common("flat", flat, 0.02),
        Scene::common("far away", far, 0.05),
        Scene::common("one escaped", escaped, 0.05),
        Scene::common("one absurd", absurd, 0.05),
        Scene::common("lattice", lattice, 0.5),
        Scene::common("overlapping", cloud.clone(), 0.4),
        Scene::common("tiny", cloud.clone(), 1e-4),
        Scene::common("clustered", clustered, 1e-3),
        Scene { name: "radii of their own", centers: cloud, radii },
        Scene {
            name: "tiny next to huge",
            centers: random_points(40, 9),
            radii: (0..40).map(|i| if i % 8 == 0 { 30.0 } else { 1e-3 }).collect(),
        },
    ]
}

/// Rays from outside and from inside the scene, some along the axes, many at particles.
fn rays(scene: &Scene, count: usize, seed: u64) -> Vec<Ray> {
    let mut random = Random(seed);
    let targets = if scene.centers.is_empty() { vec![Vec3::ZERO] } else { scene.centers.clone() };
    let radius = scene.typical_radius();
    (0..count)
        .map(|i| {
            let target = targets[(random.next() * targets.len() as f32) as usize % targets.len()];
            let aim = target + (random.point() * 2.0 - 1.0) * radius * 1.5;
            let reach = if i % 3 == 0 { radius * 4.0 } else { 5.0 };
            let mut away = (random.point() * 2.0 - 1.0).normalize_or(Vec3::X);
            if i % 7 == 0 {
                away = [Vec3::X, -Vec3::Y, Vec3::Z][i / 7 % 3];
            }
            let origin = aim + away * reach;
            Ray::new(origin, (aim - origin).normalize_or(Vec3::X))
        })
        .collect()
}

/// Crossings of one sphere in f64, and the distance of the ray from grazing the sphere.
fn exact(ray: &Ray, center: Vec3, radius: f32) -> (Vec<f64>, f64) {
    let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
    let d = d.normalize();
    let to_center: DVec3 = center.as_dvec3() - o;
    let middle = to_center.dot(d);
    let across = (to_center - d * middle).length();
    let radius = f64::from(radius);
    let graze = (across - radius).abs();
    if across > radius {
        return (Vec::new(), graze);
    }
    let half = (radius * radius - across * across).sqrt();
    (vec![middle - half, middle + half], graze)
}

fn every_bvh() -> impl Iterator<Item = BvhSettings> {
    BvhLeaves::ALL
        .into_iter()
        .flat_map(|leaves| BvhPreset::ALL.map(|preset| BvhSettings { preset, leaves }))
}

/// Default settings, spatial splits wherever they reduce the cost, and no spatial splits.
fn every_sbvh() -> [SbvhSettings; 3] {
    let none = SbvhSettings { budget: 0.0, ..SbvhSettings::DEFAULT };
    [SbvhSettings::DEFAULT, EAGER, none]
}

/// Every structure with all of its settings.
fn all_settings() -> Vec<BuildSettings> {
    let mut all = Vec::new();
    for structure in Structure::ALL {
        let plain = BuildSettings::new(structure);
        match structure {
            Structure::Bvh => all.extend(every_bvh().map(|bvh| BuildSettings { bvh, ..plain })),
            Structure::Sbvh => all.extend(every_sbvh().map(|sbvh| BuildSettings { sbvh, ..plain })),
            Structure::Lbvh | Structure::Kdtree => all.push(plain),
        }
    }
    all
}

/// Spatial splits wherever they reduce the cost.
const EAGER: SbvhSettings = SbvhSettings { alpha: 0.0, budget: 2.0 };

/// Returns the number of rays that were compared; rays whose result may change by rounding are skipped.
#[track_caller]
fn check(scene: &Scene, settings: &BuildSettings, ray_count: usize) -> usize {
    let mut judged = 0;
    for keep_indices in [true, false] {
        let mut builder = TreeBuilder::new();
        let settings = BuildSettings { keep_indices, ..*settings };
        let report = builder.build(&scene.spheres(), &settings);
        assert_eq!(report.particles, scene.centers.len() as u64);
        builder.tree().validate(&scene.spheres()).expect(scene.name);
        for level in tested_levels() {
            builder.tree_mut().set_simd(level);
            for ray in rays(scene, ray_count, 11) {
                let certain = check_ray(scene, &builder.tree().view(), &ray, keep_indices, level);
                judged += usize::from(certain && level == SimdLevel::best() && keep_indices);
            }
        }
    }
    judged
}

/// The distances at which f32 and f64 may differ: the rounding of coordinates of this size, or its square root for a
/// grazing ray.
fn check_ray(scene: &Scene, tree: &TreeView, ray: &Ray, indexed: bool, level: SimdLevel) -> bool {
    let mut nearest: Option<(f64, usize)> = None;
    let mut doubtful = false;
    let mut certain_crossings = 0;
    for (i, center) in scene.centers.iter().enumerate() {
        let radius = scene.radius(i);
        let (found, graze) = exact(ray, *center, radius);
        let size = (*center - ray.origin).abs().max_element().max(radius);
        let rounding = f64::from(size) * 1e-6 + f64::from(center.abs().max_element()) * 2e-7;
        if graze < rounding || found.iter().any(|t| t.abs() < 2.0 * rounding) {
            doubtful = true;
        }
        for t in found.into_iter().filter(|t| *t >= 0.0) {
            certain_crossings += 1;
            if nearest.is_none_or(|(best, _)| t < best) {
                nearest = Some((t, i));
            }
        }
    }
    if doubtful {
        return false;
    }
    let hit = tree.nearest(ray);
    let what = format!("{} {level:?} indexed {indexed} {ray:?}", scene.name);
    assert_eq!(hit.is_some(), nearest.is_some(), "{what}: {hit:?} {nearest:?}");
    assert_eq!(tree.any_hit(ray), nearest.is_some(), "{what}");
    let (Some(hit), Some((t, particle))) = (hit, nearest) else {
        return true;
    };
    let (_, radius) = tree.sphere(hit.slot);
    let scale = t.max(f64::from(radius)).max(f64::from(ray.origin.abs().max_element()) * 0.1);
    assert!(
        (f64::from(hit.t) - t).abs() < 1e-3 * scale.min(f64::from(radius)) + 1e-5 * scale,
        "{what}: {} should be {t}",
        hit.t
    );
    if indexed && scene.name == "coincident" {
        assert_eq!(tree.particle(hit.slot), 0, "{what}: equal distances go to the lower index");
    } else if indexed {
        let found = tree.particle(hit.slot) as usize;
        let (other, _) = exact(ray, scene.centers[found], scene.radius(found));
        assert!(
            found == particle || other.iter().any(|o| (o - t).abs() < 1e-4 * scale),
            "{what}: particle {found} should be {particle}"
        );
    }
    let mut crossings = Vec::new();
    tree.crossings(ray, &mut crossings);
    assert_eq!(crossings.len(), certain_crossings, "{what}");
    assert_eq!(crossings[0].t, hit.t, "{what}");
    assert!(crossings.is_sorted_by(|a, b| a.t <= b.t), "{what}");
    let beyond = Ray { t_max: hit.t, ..*ray };
    assert!(!tree.any_hit(&beyond), "{what}: t_max is exclusive");
    true
}

// 13 scenes under all settings of all structures, by each instruction set; each ray meets every particle in f64.
#[test]
fn awkward_scenes_match_brute_force() {
    for settings in all_settings() {
        for scene in awkward_scenes() {
            let judged = check(&scene, &settings, 80);
            assert!(judged >= 30, "{} {settings:?}: only {judged} of 80 rays judged", scene.name);
        }
    }
}

fn tested_fused_levels() -> Vec<SimdLevel> {
    let mut levels = tested_levels();
    levels.retain(|level| *level != SimdLevel::Portable);
    levels
}

// 2,000 rays at each of 13 scenes under all settings: rounding differs for few rays.
#[test]
fn fma_levels_agree_to_the_bit() {
    let fused = tested_fused_levels();
    for settings in all_settings() {
        for scene in awkward_scenes() {
            let mut builder = TreeBuilder::new();
            builder.build(&scene.spheres(), &settings);
            for ray in rays(&scene, 2000, 5) {
                let mut first = None;
                for level in &fused {
                    builder.tree_mut().set_simd(*level);
                    let hit = builder.tree().view().nearest(&ray);
                    let what = format!("{} {settings:?} {level:?} {ray:?}", scene.name);
                    assert_eq!(*first.get_or_insert(hit), hit, "{what}");
                }
            }
        }
    }
}

/// The result of the kernels with fused multiply-add as one number, which is the same on every machine.
#[test]
fn fused_kernels_of_all_processors_agree_to_the_bit() {
    const EXPECTED: u64 = 0x2bde_12a7_9f9a_49b3;
    let scene = Scene::common("cloud", random_points(5000, 21), 0.05);
    let mut builder = TreeBuilder::new();
    builder.build(&scene.spheres(), &BuildSettings::default());
    for level in tested_fused_levels() {
        builder.tree_mut().set_simd(level);
        let mut hash = 0xcbf2_9ce4_8422_2325_u64;
        let mut crossings = Vec::new();
        for ray in rays(&scene, 2000, 22) {
            builder.tree().view().crossings(&ray, &mut crossings);
            let nearest = builder.tree().view().nearest(&ray).map_or(0, |hit| hit.t.to_bits());
            let all = crossings.iter().map(|c| c.t.to_bits());
            for bits in all.chain([nearest]) {
                // FNV-1a by words.
                hash = (hash ^ u64::from(bits)).wrapping_mul(0x0100_0000_01b3);
            }
        }
        assert_eq!(hash, EXPECTED, "{level:?}: {hash:#x}");
    }
}

// Large scenes under all settings, each built three times: work on small trees is not shared by threads.
#[test]
fn trees_do_not_depend_on_threads() {
    let lattice = (0..40_000)
        .map(|i| Vec3::new((i % 40) as f32, (i / 40 % 40) as f32, (i / 1600) as f32))
        .collect();
    for scene in [
        Scene::common("cloud", random_points(100_000, 2), 0.01),
        // Many equal distances and areas.
        Scene::common("lattice", lattice, 0.5),
    ] {
        for settings in all_settings() {
            let one = tree_by_threads(&scene, &settings, 1);
            for threads in [2, 7] {
                let other = tree_by_threads(&scene, &settings, threads);
                assert!(one == other, "{} {settings:?} {threads}", scene.name);
            }
        }
    }
}

// 70,000 particles, built three times: all threads work together on large sets only.
/// Spheres are cut by all threads together.
#[test]
fn cuts_do_not_depend_on_threads() {
    let scene = large_among_small(70_000);
    let settings = BuildSettings { sbvh: EAGER, ..BuildSettings::new(Structure::Sbvh) };
    let one = tree_by_threads(&scene, &settings, 1);
    for threads in [2, 8] {
        assert!(one == tree_by_threads(&scene, &settings, threads), "{threads}");
    }
}

/// Nodes, indices and SAH cost.
fn tree_by_threads(
    scene: &Scene,
    settings: &BuildSettings,
    threads: usize,
) -> (Vec<Node>, Vec<u32>, u64) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    pool.install(|| {
        let mut builder = TreeBuilder::new();
        let report = builder.build(&scene.spheres(), settings);
        let tree = builder.tree();
        (tree.nodes.clone(), tree.indices.clone(), report.sah_cost.to_bits())
    })
}

/// Also if the last frame was built with another structure.
#[test]
fn builder_keeps_no_state_between_frames() {
    let mut builder = TreeBuilder::new();
    for scene in awkward_scenes() {
        for settings in all_settings() {
            builder.build(&scene.spheres(), &settings);
            builder.tree().validate(&scene.spheres()).expect(scene.name);
            let fresh = {
                let mut fresh = TreeBuilder::new();
                fresh.build(&scene.spheres(), &settings);
                fresh.tree().nodes.clone()
            };
            assert!(builder.tree().nodes == fresh, "{} {settings:?}", scene.name);
        }
    }
}

/// Large spheres among small ones: the case that spatial splits are for.
fn large_among_small(count: usize) -> Scene {
    let radii = (0..count).map(|i| if i % 7 == 0 { 0.2 } else { 1e-3 });
    Scene { name: "large among small", centers: random_points(count, 13), radii: radii.collect() }
}

#[test]
fn clipped_spheres_are_hit_once() {
    let scene = large_among_small(3000);
    let settings =
        every_sbvh().map(|sbvh| BuildSettings { sbvh, ..BuildSettings::new(Structure::Sbvh) });
    let [usual, eager, none] = settings.map(|settings| {
        let judged = check(&scene, &settings, 300);
        assert!(judged >= 120, "{settings:?}: only {judged} of 300 rays judged");
        let report = TreeBuilder::new().build(&scene.spheres(), &settings);
        report.references
    });
    assert_eq!(none, 3000, "nothing may be cut without a budget");
    assert!(usual > 4000 && usual <= 6000, "{usual} with the usual budget");
    assert!(eager > usual && eager <= 9000, "{eager} with twice the budget");
}

// Only cells of more than 2^18 particles are sorted by all threads.
#[test]
fn a_crowded_cell_is_sorted_by_all_threads() {
    let mut centers = random_points(300_000, 8);
    centers.iter_mut().skip(10).for_each(|p| *p *= 1e-3);
    let scene = Scene::common("crowded", centers, 1e-5);
    for settings in all_settings() {
        let mut builder = TreeBuilder::new();
        builder.build(&scene.spheres(), &settings);
        builder.tree().validate(&scene.spheres()).expect("sound");
    }
}

// Four scenes of 40,000 particles under all settings, and 1,000 rays at each.
/// Scenes that are too large for brute force: uniform, crowded, and on few planes, so that most coordinates equal
/// many others.
#[test]
fn large_scenes_match_a_particle_tree() {
    let cloud = random_points(40_000, 21);
    let crowded = cloud.iter().enumerate().map(|(i, p)| if i % 3 == 0 { *p } else { *p * 1e-2 });
    let planes = cloud.iter().map(|p| (*p * 8.0).round() / 8.0 + p.with_x(0.0) * 1e-3);
    let scenes = [
        Scene::common("cloud", cloud.clone(), 5e-3),
        Scene::common("crowded cloud", crowded.collect(), 1e-3),
        Scene::common("planes", planes.collect(), 2e-3),
        Scene::common("all coincident", vec![Vec3::splat(0.25); 40_000], 0.1),
    ];
    for scene in &scenes {
        let oracle = ParticleTree::new(&scene.centers, scene.radii[0]);
        let rays = rays(scene, 1000, 17);
        let truth: Vec<_> = rays.iter().map(|ray| oracle.nearest(ray)).collect();
        for settings in all_settings() {
            let mut builder = TreeBuilder::new();
            builder.build(&scene.spheres(), &settings);
            let mut judged = 0;
            for (ray, (nearest, closeness)) in rays.iter().zip(&truth) {
                if *closeness < 1e-5 {
                    continue;
                }
                judged += 1;
                let what = format!("{} {settings:?} {ray:?}", scene.name);
                let hit = builder.tree().view().nearest(ray);
                assert_eq!(hit.is_some(), nearest.is_some(), "{what}");
                assert_eq!(builder.tree().view().any_hit(ray), nearest.is_some(), "{what}");
                if let (Some(hit), Some((t, _))) = (hit, nearest) {
                    assert!((f64::from(hit.t) - t).abs() < 1e-4, "{what}: {} {t}", hit.t);
                }
            }
            assert!(judged >= 300, "{}: {judged} rays judged", scene.name);
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn random_scenes_match_brute_force(
        count in 0_usize..200,
        seed in any::<u64>(),
        radius in prop::sample::select(vec![1e-3_f32, 0.05, 0.3]),
        scale in prop::sample::select(vec![1e-4_f32, 1.0, 1e4]),
        own in any::<bool>(),
    ) {
        let centers: Vec<Vec3> = random_points(count, seed).iter().map(|p| *p * scale).collect();
        let mut random = Random(seed ^ 1);
        let radii = if own && count > 1 {
            (0..count).map(|_| radius * scale * (0.1 + random.next())).collect()
        } else {
            vec![radius * scale]
        };
        let scene = Scene { name: "random", centers, radii };
        for settings in all_settings() {
            check(&scene, &settings, 20);
        }
    }
}
