//! The moving tree against brute force in f64.

use glam::{DVec3, Vec3};

use super::{MovingTree, bounded};
use crate::accel::TreeHits;
use crate::accel::simd::SimdLevel;
use crate::accel::{BuildSettings, SphereRadius, Spheres, Structure, TreeBuilder};
use crate::ray::{Ray, RayPacket};

/// A number in 0 to 1.
fn unit(seed: u32) -> f32 {
    let mixed = seed.wrapping_mul(0x9e37_79b9) ^ 0x5bd1_e995;
    let mixed = (mixed ^ (mixed >> 15)).wrapping_mul(0x85eb_ca6b);
    ((mixed ^ (mixed >> 13)) >> 8) as f32 / 16_777_216.0
}

fn vector(seed: u32) -> Vec3 {
    Vec3::new(unit(seed), unit(seed + 1), unit(seed + 2)) * 2.0 - 1.0
}

struct Swarm {
    centers: Vec<Vec3>,
    radii: Vec<f32>,
    displacements: Vec<Vec3>,
}

impl Swarm {
    fn new(count: u32) -> Self {
        let mut displacements: Vec<Vec3> = (0..count).map(|i| vector(13 * i + 5)).collect();
        if let Some(first) = displacements.first_mut() {
            *first = Vec3::new(f32::NAN, 1.0, 0.0);
        }
        if let Some(second) = displacements.get_mut(1) {
            *second = Vec3::splat(f32::INFINITY);
        }
        Self {
            centers: (0..count).map(|i| 2.0 * vector(11 * i)).collect(),
            radii: (0..count).map(|i| 0.03 + 0.1 * unit(7 * i + 3)).collect(),
            displacements,
        }
    }

    fn tree(&self, structure: Structure, simd: SimdLevel) -> MovingTree {
        let spheres = Spheres { centers: &self.centers, radius: SphereRadius::Each(&self.radii) };
        let mut builder = TreeBuilder::new();
        let settings = BuildSettings { keep_indices: true, ..BuildSettings::new(structure) };
        builder.build(&spheres, &settings);
        builder.tree_mut().set_simd(simd);
        let mut moving = MovingTree::default();
        moving.build(&builder.tree().view(), &self.displacements);
        moving
    }

    /// Distances of both intersections of `ray` with a sphere at `time`, in f64.
    fn ends(&self, index: usize, ray: &Ray, time: f32) -> [f64; 2] {
        let displacement = bounded(self.displacements[index]).as_dvec3();
        let center = self.centers[index].as_dvec3() + f64::from(time) * displacement;
        let direction: DVec3 = ray.direction.as_dvec3();
        let to_center = center - ray.origin.as_dvec3();
        let middle = to_center.dot(direction);
        let across = (to_center - middle * direction).length_squared();
        let half = (f64::from(self.radii[index]).powi(2) - across).sqrt();
        [middle - half, middle + half]
    }

    /// The first intersection in f64, and how far the nearest sphere is from being touched.
    fn nearest(&self, ray: &Ray, time: f32) -> Option<(usize, f64)> {
        let mut best: Option<(usize, f64)> = None;
        for index in 0..self.centers.len() {
            let within = f64::from(ray.t_min)..f64::from(ray.t_max);
            let ends = self.ends(index, ray, time);
            let t = ends.into_iter().find(|t| within.contains(t));
            if let Some(t) = t.filter(|t| best.is_none_or(|(_, nearest)| *t < nearest)) {
                best = Some((index, t));
            }
        }
        best
    }
}

/// Sixteen rays at different times: from one point if `number` is even, else from anywhere.
fn packet(number: u32) -> RayPacket {
    let mut rays = RayPacket::default();
    for lane in 0..16 {
        let seed = 1000 * number + 17 * lane;
        let origin = match number % 2 {
            0 => 4.0 * vector(1000 * number),
            _ => 3.0 * vector(seed + 3),
        };
        let target = match number % 4 {
            0 => vector(1000 * number + 9) + 0.05 * vector(seed + 9),
            _ => vector(seed + 9),
        };
        let mut ray = Ray::new(origin, (target - origin).normalize());
        if lane == 3 {
            ray.direction = Vec3::X;
        }
        if lane == 5 {
            ray.t_max = 2.0 * unit(seed + 15);
        }
        rays.push(&ray);
        rays.time[lane as usize] = unit(seed + 13) - 0.5;
    }
    rays
}

#[test]
fn rays_find_the_spheres_at_their_time() {
    let swarm = Swarm::new(700);
    let tree = swarm.tree(Structure::Lbvh, SimdLevel::best());
    let (mut hit_count, mut grazing) = (0, 0);
    for number in 0..300 {
        let rays = packet(number);
        let hits = tree.nearest(&rays, 0xffff);
        assert_eq!(tree.occluded(&rays, 0xffff), hits.mask());
        for lane in 0..16 {
            let (ray, time) = (rays.ray(lane), rays.time[lane]);
            let found = match hits.slot[lane] {
                TreeHits::NO_SLOT => None,
                slot => Some(slot),
            };
            match (swarm.nearest(&ray, time), found) {
                (Some((index, t)), Some(slot)) if tree.particle(slot) as usize == index => {
                    let error = (f64::from(hits.t[lane]) - t).abs();
                    assert!(error < 1e-3, "{number} {lane}: {t} {}", hits.t[lane]);
                    let (center, radius) = tree.sphere(slot, time);
                    let expected =
                        swarm.centers[index] + time * bounded(swarm.displacements[index]);
                    assert!((center - expected).length() < 1e-6 && radius == swarm.radii[index]);
                    hit_count += 1;
                }
                (None, None) => {}
                // Rays that touch a sphere may be on either side of it
                _ => grazing += 1,
            }
        }
    }
    assert!(hit_count > 1500 && grazing < 5, "{hit_count} {grazing}");
}

#[test]
fn structures_instruction_sets_and_packets_agree_to_the_bit() {
    for count in [1, 16, 17, 500] {
        let swarm = Swarm::new(count);
        let expected = swarm.tree(Structure::Lbvh, SimdLevel::Portable);
        for structure in [Structure::Lbvh, Structure::Kdtree, Structure::Bvh] {
            for simd in SimdLevel::ALL {
                let tree = swarm.tree(structure, simd);
                for number in 0..40 {
                    let rays = packet(number);
                    let (a, b) = (expected.nearest(&rays, 0xffff), tree.nearest(&rays, 0xffff));
                    let particles = |tree: &MovingTree, hits: &TreeHits| {
                        hits.slot.map(|slot| match slot {
                            TreeHits::NO_SLOT => None,
                            slot => Some(tree.particle(slot)),
                        })
                    };
                    assert_eq!(particles(&expected, &a), particles(&tree, &b));
                    assert_eq!(a.t.map(f32::to_bits), b.t.map(f32::to_bits));
                    // Few rays are traced one by one
                    let alone = tree.nearest(&rays, 0b100_0010);
                    for lane in [1, 6] {
                        assert_eq!(alone.slot[lane], b.slot[lane]);
                    }
                    assert_eq!(tree.occluded(&rays, 0b110), b.mask() & 0b110);
                }
            }
        }
    }
    let nothing = Swarm::new(0).tree(Structure::Lbvh, SimdLevel::best());
    assert_eq!(nothing.nearest(&packet(1), 0xffff).mask(), 0);
}

#[test]
fn chords_are_visited_once() {
    let swarm = Swarm::new(37);
    for structure in [Structure::Lbvh, Structure::Bvh] {
        let tree = swarm.tree(structure, SimdLevel::best());
        for number in 0..100 {
            let rays = packet(number);
            for lane in 0..16 {
                let mut found = Vec::new();
                tree.visit_chords(&rays, lane, |particle, radius, ends| {
                    assert_eq!(radius, swarm.radii[particle as usize]);
                    found.push((ends[0], radius));
                    true
                });
                found.sort_by(|a, b| a.0.total_cmp(&b.0));
                let ray = rays.ray(lane);
                let chords = (0..swarm.centers.len()).map(|i| swarm.ends(i, &ray, rays.time[lane]));
                let is_on_ray = |ends: &[f64; 2]| ends[1] > 1e-4 && ends[0] < f64::from(ray.t_max);
                let mut expected: Vec<f64> = chords.filter(is_on_ray).map(|ends| ends[0]).collect();
                expected.sort_by(f64::total_cmp);
                assert_eq!(found.len(), expected.len(), "{number} {lane}");
                for ((t, _), expected) in found.iter().zip(&expected) {
                    assert!((f64::from(*t) - expected).abs() < 1e-2);
                }
            }
        }
    }
}

#[test]
fn rays_that_are_not_finite_hit_nothing() {
    let tree = Swarm::new(300).tree(Structure::Lbvh, SimdLevel::best());
    let mut rays = packet(1);
    rays.origin[0][2] = f32::NAN;
    rays.direction[1][4] = f32::INFINITY;
    let hits = tree.nearest(&rays, 0xffff);
    assert_eq!(hits.mask() & 0b10100, 0);
    assert_eq!(tree.occluded(&rays, 0b10100), 0);
}
