use glam::Vec3;

use super::*;
use crate::spheres::SphereSurface;
use crate::union::UnionSurface;
use crate::{Intersections, MaterialId, Shape, Side, SphereOwners};
use spherule_tree::accel::Coherence;
use spherule_tree::accel::{
    BuildSettings, SbvhSettings, SphereRadius, Spheres, Structure, TreeBuilder,
};
use spherule_tree::ray::{Ray, RayPacket};

fn built(centers: &[Vec3], radius: f32, settings: &BuildSettings) -> TreeBuilder {
    let mut builder = TreeBuilder::new();
    let radius = SphereRadius::Common(radius);
    builder.build(&Spheres { centers, radius }, settings);
    builder
}

/// A block of particles, two pairs far from it, and one that touches it.
fn splash() -> Vec<Vec3> {
    let mut centers: Vec<Vec3> = (0..1000_i16)
        .map(|i| [i % 10, i / 10 % 10, i / 100].map(|c| 2.0 * f32::from(c)).into())
        .collect();
    for far in [30.0, 50.0] {
        centers.insert(500, Vec3::new(far, 1.0, 0.0));
        centers.push(Vec3::new(far, 1.0, 2.0));
    }
    centers.push(Vec3::new(9.0, 9.0, 20.0));
    centers
}

/// [`spray_of`] by a test of every pair.
fn by_pairs(centers: &[Vec3], reach: f32) -> Vec<u32> {
    let others = |i: usize| {
        let near = |p: &&Vec3| p.distance_squared(centers[i]) <= reach * reach;
        centers.iter().filter(near).count() - 1
    };
    let is_spray = |i: &u32| others(*i as usize) < ENOUGH_NEIGHBOURS;
    let count = u32::try_from(centers.len()).expect("few");
    (0..count).filter(is_spray).collect()
}

#[test]
fn spray_has_few_neighbours_in_every_structure() {
    let centers = splash();
    let eager = SbvhSettings { alpha: 0.0, budget: 2.0 };
    for support in [1.0, 2.5, 4.0] {
        let expected = by_pairs(&centers, support);
        assert!(!expected.is_empty() && expected.len() < 1010);
        for structure in Structure::ALL {
            let settings = BuildSettings { sbvh: eager, ..BuildSettings::new(structure) };
            let builder = built(&centers, 1.0, &settings);
            let spray = spray_of(&builder.tree().view(), support);
            assert_eq!(spray, expected, "{structure} {support}");
        }
    }
    let nothing = built(&[], 1.0, &BuildSettings::default());
    assert!(spray_of(&nothing.tree().view(), 4.0).is_empty());
}

#[test]
fn a_particle_has_many_soft_drops_of_different_sizes() {
    let drops: Vec<SoftDrop> =
        (0..500).flat_map(|id| (0..SOFT_DROPS).map(move |number| soft_drop(id, number))).collect();
    let count = drops.len() as f32;
    let in_range = |drop: &SoftDrop| {
        drop.offset.length() <= SOFT_SPREAD + 1e-5
            && (SOFT_RADII[0]..SOFT_RADII[1]).contains(&drop.radius)
    };
    assert!(drops.iter().all(in_range));
    // Around the particle, and a third of the way between the sizes, because of the square
    let middle = drops.iter().map(|drop| drop.offset).sum::<Vec3>() / count;
    assert!(middle.length() < 0.05, "{middle}");
    let radius = drops.iter().map(|drop| drop.radius).sum::<f32>() / count;
    let expected = SOFT_RADII[0] + (SOFT_RADII[1] - SOFT_RADII[0]) / 3.0;
    assert!((radius - expected).abs() < 0.01, "{radius}");
    let near = drops.iter().filter(|drop| drop.offset.length() < 0.5 * SOFT_SPREAD);
    assert!(near.count() as f32 > 0.25 * count);
    for pair in drops.windows(2) {
        assert_ne!(pair[0], pair[1]);
    }
    assert_eq!(soft_drop(7, 3), soft_drop(7, 3));
}

#[test]
fn all_spheres_of_a_particle_have_its_index() {
    let centers: Vec<Vec3> = (0..6_u8).map(|i| f32::from(i) * 3.0 * Vec3::X).collect();
    let tree = built(&centers, 1.0, &BuildSettings::default());
    let spheres =
        SphereSurface::new(tree.tree().view())
            .of(SphereOwners::new(MaterialId::SPRAY, 10).with_spheres(3));
    let mut rays = RayPacket::default();
    for center in &centers {
        rays.push(&Ray::new(*center - 5.0 * Vec3::Z, Vec3::Z));
    }
    let mut hits = Intersections::default();
    spheres.intersect(&mut rays, Coherence::Coherent, 0, &mut hits);
    assert_eq!(hits.particle[..6], [10, 10, 10, 11, 11, 11]);
    let single = spheres.nearest(&Ray::new(centers[5] - 5.0 * Vec3::Z, Vec3::Z));
    assert_eq!(single.map(|hit| hit.particle), Some(11));
}

#[test]
fn spray_is_hit_beside_and_before_a_body() {
    let body = built(&[Vec3::ZERO, Vec3::X], 1.0, &BuildSettings::default());
    let drops = [Vec3::new(-4.0, 0.0, 0.0), Vec3::new(0.5, 0.0, 0.0), Vec3::new(0.0, 5.0, 0.0)];
    let spray = built(&drops, 0.25, &BuildSettings::default());
    let medium = UnionSurface::new(body.tree().view());
    let drops = SphereSurface::new(spray.tree().view()).of(SphereOwners::new(MaterialId::SPRAY, 2));
    let shapes: [&dyn Shape; 2] = [&medium, &drops];
    let along = |y: f32| Ray::new(Vec3::new(-10.0, y, 0.0), Vec3::X);
    let inside = Ray::new(Vec3::ZERO, Vec3::X);
    let mut rays = RayPacket::default();
    for ray in [along(0.0), along(0.5), along(5.0), inside] {
        rays.push(&ray);
    }
    for order in [[0, 1], [1, 0]] {
        for coherence in [Coherence::Coherent, Coherence::Incoherent] {
            let (mut ahead, mut hits) = (rays, Intersections::default());
            for shape in order {
                shapes[shape].intersect(&mut ahead, coherence, 0b1000, &mut hits);
            }
            let found = |lane: usize| (hits.t[lane], hits.particle[lane], hits.material[lane]);
            assert_eq!(hits.mask, 0b1111);
            assert_eq!(found(0), (5.75, 2, MaterialId::SPRAY));
            assert_eq!(found(1), (hits.t[1], 0, MaterialId::PARTICLES));
            assert_eq!(found(2).1, 4);
            assert_eq!(found(3), (0.25, 3, MaterialId::SPRAY));
            assert_eq!(ahead.t_max[..4], hits.t[..4]);
        }
    }
    let occluded = drops.occluded(&rays, Coherence::Incoherent, 0b1111);
    assert_eq!(occluded, 0b1101);
    assert_eq!(drops.occluded(&rays, Coherence::Coherent, 0b0110), 0b0100);
    assert_eq!(medium.side_of(Vec3::ZERO), Side::Inside);
}
