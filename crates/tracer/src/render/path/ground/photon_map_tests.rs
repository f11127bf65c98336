use std::f32::consts::PI;

use super::*;
use crate::render::PathSeed;

/// Photons that fall onto the unit square at height 0, with the flux 1 together.
fn on_square(count: u32) -> Vec<Photon> {
    let seed = PathSeed::of_pixel(3, 4);
    let photon = |i| {
        let [x, y] = seed.get_2d(0, i);
        Photon {
            point: Vec3::new(x, y, 0.0),
            normal: Vec3::Z,
            to_light: Vec3::new(0.6, 0.0, 0.8),
            flux: Vec3::splat(1.0 / count as f32),
            group: 0,
        }
    };
    (0..count).map(photon).collect()
}

fn irradiance(map: &PhotonMap, point: Vec3, normal: Vec3) -> f32 {
    let mut sum = 0.0;
    map.each_near(point, normal, f32::INFINITY, &mut Vec::new(), |photon| {
        sum += photon.irradiance.x;
    });
    sum
}

#[test]
fn the_nearest_photons_are_found() {
    // White noise, in a cube, on surfaces of two directions
    let mut photons: Vec<Photon> = on_square(3000);
    for (i, photon) in (0..).zip(&mut photons) {
        photon.point.z = 0.02 * PathSeed::of_pixel(i, 1).get_1d(0, 0);
        photon.normal = if i % 3 == 0 { Vec3::X } else { Vec3::Z };
    }
    let map = PhotonMap::new(photons.clone(), 0.2);
    for i in 0..50 {
        let [x, y] = PathSeed::of_pixel(i, 2).get_2d(1, 0);
        let point = Vec3::new(x, y, 0.01);
        // All that light the point, by a test of each
        let is_near = |photon: &&Photon| {
            let offset = photon.point - point;
            let steep = offset.z.powi(2) > 0.25 * offset.length_squared();
            !steep && photon.normal == Vec3::Z && offset.length() < 0.2
        };
        let mut expected: Vec<f32> = (photons.iter().filter(is_near))
            .map(|photon| photon.point.distance_squared(point))
            .collect();
        expected.sort_by(f32::total_cmp);
        expected.truncate(NEIGHBOURS);
        let mut found = Vec::new();
        map.each_near(point, Vec3::Z, f32::INFINITY, &mut found, |_| {});
        let mut found: Vec<f32> = found.iter().map(|(distance2, _)| *distance2).collect();
        found.sort_by(f32::total_cmp);
        assert_eq!(found, expected, "{point}");
    }
}

#[test]
fn the_mean_of_the_density_is_that_of_the_photons() {
    let map = PhotonMap::new(on_square(20_000), 0.2);
    let points = (0..2000).map(|i| PathSeed::of_pixel(i, 7).get_2d(0, 0));
    let points: Vec<Vec3> =
        points.map(|[x, y]| Vec3::new(0.1 + 0.8 * x, 0.1 + 0.8 * y, 0.0)).collect();
    let all = points.iter().map(|point| irradiance(&map, *point, Vec3::Z)).collect::<Vec<f32>>();
    let mean = all.iter().sum::<f32>() / all.len() as f32;
    let variance = all.iter().map(|e| (e - mean).powi(2)).sum::<f32>() / all.len() as f32;
    assert!((mean - 1.0).abs() < 0.01, "{mean}");
    assert!(variance.sqrt() < 0.2, "{}", variance.sqrt());
    // With few photons, all within the greatest distance count
    let sparse = PhotonMap::new(on_square(200), 0.2);
    let middle = irradiance(&sparse, Vec3::new(0.5, 0.5, 0.0), Vec3::Z);
    assert!((middle - 1.0).abs() < 0.25, "{middle}");
    assert!(200.0 * PI * 0.2 * 0.2 < NEIGHBOURS as f32);
}

#[test]
fn other_sides_and_far_places_are_dark() {
    let map = PhotonMap::new(on_square(20_000), 0.1);
    let middle = Vec3::new(0.5, 0.5, 0.0);
    assert!(irradiance(&map, middle, Vec3::Z) > 0.5);
    for (point, normal) in [
        (middle, Vec3::NEG_Z),
        (middle, Vec3::X),
        (middle + 0.05 * Vec3::Z, Vec3::Z),
        (middle + 0.2 * Vec3::Z, Vec3::Z),
        (3.0 * Vec3::X, Vec3::Z),
        (Vec3::NAN, Vec3::Z),
    ] {
        let light = irradiance(&map, point, normal);
        assert!(light < 0.1, "{point} {normal}: {light}");
    }
    let nothing = PhotonMap::new(Vec::new(), 0.1);
    assert_eq!(irradiance(&nothing, middle, Vec3::Z), 0.0);
    // Photons at one point
    let photons = vec![on_square(1)[0]; 500];
    let point = photons[0].point;
    let light = irradiance(&PhotonMap::new(photons, 0.1), point, Vec3::Z);
    assert!(light.is_finite());
}

#[test]
fn a_full_map_keeps_the_flux() {
    for limit in [7, 64, 1000] {
        let mut collector = Collector::with_limit(limit);
        for photon in on_square(5000) {
            collector.add(&photon);
        }
        let map = collector.into_map(1.0);
        assert!(map.photons.len() < limit, "{limit}");
        let flux: f32 = map.photons.iter().map(|photon| photon.flux.x).sum();
        let error = (flux - 1.0).abs();
        assert!(error < 2.5 / map.photons.len() as f32 + 1e-4, "{limit}: {flux}");
        assert!(map.photons.len() > limit / 3, "{limit}");
    }
}
