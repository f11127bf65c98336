//! Packets with invalid rays, and packets against brute force.

use super::packets::{SHAPES, check_packet, packet};
use super::*;
use crate::accel::{Coherence, TreeHits};
use crate::ray::{PACKET_SIZE, RayPacket};

/// Invalid values for a component of a ray.
const POISON: [f32; 7] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, -1e30, -1.0, 0.0];
/// Invalid values for a direction. Any other value would violate the precondition of unit directions, without which
/// distances to boxes and spheres differ.
const DIRECTION_POISON: [f32; 3] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];

/// `ray` with one component replaced.
fn poisoned(ray: &Ray, random: &mut Random) -> Ray {
    let mut any_of = |poison: &[f32]| poison[(random.next() * poison.len() as f32) as usize];
    let (other, direction) = (any_of(&POISON), any_of(&DIRECTION_POISON));
    let mut ray = *ray;
    match (random.next() * 8.0) as usize {
        axis @ 0..3 => ray.origin[axis] = other,
        axis @ 3..6 => ray.direction[axis - 3] = direction,
        6 => ray.t_min = other,
        _ => ray.t_max = other,
    }
    ray
}

fn packet_of(rays: impl IntoIterator<Item = Ray>) -> RayPacket {
    let mut packet = RayPacket::default();
    rays.into_iter().for_each(|ray| packet.push(&ray));
    packet
}

/// All lanes, poisoned or not, find what they find alone.
#[test]
fn nan_rays_do_not_affect_other_lanes() {
    let structures = [Structure::Kdtree, Structure::Bvh];
    for scene in awkward_scenes() {
        for structure in structures {
            let mut builder = TreeBuilder::new();
            builder.build(&scene.spheres(), &BuildSettings::new(structure));
            for level in tested_levels() {
                builder.tree_mut().set_simd(level);
                let view = builder.tree().view();
                let mut random = Random(23);
                for shape in SHAPES {
                    for turn in 0..12 {
                        let sound = packet(&scene, shape, &mut random);
                        // Poisons a single lane up to most of them.
                        let part = if turn % 2 == 0 { 0.1 } else { 0.6 };
                        let rays: Vec<Ray> = sound
                            .rays()
                            .map(|ray| {
                                if random.next() < part { poisoned(&ray, &mut random) } else { ray }
                            })
                            .collect();
                        let what = format!("{} {structure:?} {level:?} {shape:?}", scene.name);
                        check_packet(&view, &packet_of(rays), &what);
                    }
                }
            }
        }
    }
}

#[test]
fn empty_ray_intervals_hit_nothing() {
    let scene = Scene::common("cloud", random_points(3000, 1), 0.05);
    let mut builder = TreeBuilder::new();
    builder.build(&scene.spheres(), &BuildSettings::default());
    let view = builder.tree().view();
    let ended =
        rays(&scene, PACKET_SIZE, 5).into_iter().map(|ray| Ray { t_min: 4.0, t_max: 3.0, ..ray });
    assert_eq!(check_packet(&view, &packet_of(ended), "ended"), 0);
}

/// Spheres of radius 0, in trees of one block and of many: rays that aim at their centres hit some.
#[test]
fn points_are_hit_as_by_single_rays() {
    for count in [1, 16, 17, 3000] {
        for radii in [vec![0.0], vec![0.0; count]] {
            let centers = random_points(count, 2);
            let scene = Scene {
                name: "points",
                // Whole numbers: rays through them have exact coordinates.
                centers: centers.iter().map(|p| (*p * 8.0).round()).collect(),
                radii,
            };
            let mut hits = 0;
            for settings in all_settings() {
                let mut builder = TreeBuilder::new();
                builder.build(&scene.spheres(), &settings);
                for level in tested_levels() {
                    builder.tree_mut().set_simd(level);
                    let mut random = Random(3);
                    for _ in 0..10 {
                        let through = (0..PACKET_SIZE).map(|lane| {
                            let index = (random.next() * count as f32) as usize;
                            let way = Vec3::new(0.5, 0.5, std::f32::consts::FRAC_1_SQRT_2);
                            let way = [way, Vec3::new(0.6, 0.0, 0.8), Vec3::NEG_Y][lane % 3];
                            Ray::new(scene.centers[index] - way * 16.0, way)
                        });
                        let what = format!("{count} {settings:?} {level:?}");
                        hits += check_packet(&builder.tree().view(), &packet_of(through), &what);
                    }
                }
            }
            assert!(count < 3000 || hits > 0, "{count}: nothing was hit");
        }
    }
}

// 13 scenes under all settings, by each instruction set; each ray meets every particle in f64.
/// Incoherent packets with rays that are far apart.
#[test]
fn incoherent_packets_match_brute_force() {
    for scene in awkward_scenes() {
        for settings in all_settings() {
            let mut builder = TreeBuilder::new();
            builder.build(&scene.spheres(), &settings);
            for level in tested_levels() {
                builder.tree_mut().set_simd(level);
                let view = builder.tree().view();
                let mut judged = 0;
                for chunk in rays(&scene, 80, 29).chunks(PACKET_SIZE) {
                    let what = format!("{} {settings:?} {level:?}", scene.name);
                    judged += check_by_brute_force(&scene, &view, chunk, &what);
                }
                assert!(judged >= 20, "{}: {judged} of 80 judged", scene.name);
            }
        }
    }
}

/// Returns the number of rays that were compared; rays whose result may change by rounding are skipped.
#[track_caller]
fn check_by_brute_force(scene: &Scene, tree: &TreeView, rays: &[Ray], what: &str) -> usize {
    let packet = packet_of(rays.iter().copied());
    let mut hits = TreeHits::default();
    tree.nearest_lanes(&packet, Coherence::Incoherent, &mut hits);
    let occluded = tree.occluded_lanes(&packet, Coherence::Incoherent);
    let mut judged = 0;
    for (lane, ray) in rays.iter().enumerate() {
        let Some(truth) = certain_hit(scene, ray) else {
            continue;
        };
        judged += 1;
        let what = format!("{what} lane {lane} {ray:?}");
        assert_eq!(hits.mask() >> lane & 1 == 1, truth.is_some(), "{what}");
        assert_eq!(occluded >> lane & 1 == 1, truth.is_some(), "{what}");
        if let Some(t) = truth {
            let (_, radius) = tree.sphere(hits.slot[lane]);
            let scale = t.max(f64::from(ray.origin.abs().max_element()) * 0.1);
            let allowed = 1e-3 * scale.min(f64::from(radius)) + 1e-5 * scale;
            assert!((f64::from(hits.t[lane]) - t).abs() < allowed, "{what}: {t}");
        }
    }
    judged
}

/// The distance found by brute force, if any; None if rounding may change the result.
fn certain_hit(scene: &Scene, ray: &Ray) -> Option<Option<f64>> {
    let mut nearest: Option<f64> = None;
    for (i, center) in scene.centers.iter().enumerate() {
        let radius = scene.radius(i);
        let (found, graze) = exact(ray, *center, radius);
        let size = (*center - ray.origin).abs().max_element().max(radius);
        let rounding = f64::from(size) * 1e-6 + f64::from(center.abs().max_element()) * 2e-7;
        if graze < rounding || found.iter().any(|t| t.abs() < 2.0 * rounding) {
            return None;
        }
        let ahead = found.into_iter().filter(|t| *t >= 0.0);
        nearest = ahead.chain(nearest).reduce(f64::min);
    }
    Some(nearest)
}
