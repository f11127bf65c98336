use super::*;
use crate::accel::{BuildSettings, SbvhSettings, SphereRadius, Spheres, Structure, TreeBuilder};
use crate::surface::medium::MediumSurface;

fn built(centers: &[Vec3], radius: f32, settings: &BuildSettings) -> TreeBuilder {
    let mut builder = TreeBuilder::new();
    let radius = SphereRadius::Common(radius);
    builder.build(&Spheres { centers, radius }, settings);
    builder
}

/// A block of particles, two pairs far from it, and one that touches it.
fn splash() -> Vec<Vec3> {
    let mut centers: Vec<Vec3> = (0..1000_i16)
        .map(|i| {
            [i % 10, i / 10 % 10, i / 100]
                .map(|c| 2.0 * f32::from(c))
                .into()
        })
        .collect();
    for far in [30.0, 50.0] {
        centers.insert(500, Vec3::new(far, 1.0, 0.0));
        centers.push(Vec3::new(far, 1.0, 2.0));
    }
    centers.push(Vec3::new(9.0, 9.0, 20.0));
    centers
}

/// As [`spray_of`], by looking at every pair.
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
    let eager = SbvhSettings {
        alpha: 0.0,
        budget: 2.0,
    };
    for support in [1.0, 2.5, 4.0] {
        let expected = by_pairs(&centers, support);
        assert!(!expected.is_empty() && expected.len() < 1010);
        for structure in Structure::ALL {
            let settings = BuildSettings {
                sbvh: eager,
                ..BuildSettings::new(structure)
            };
            let builder = built(&centers, 1.0, &settings);
            let spray = spray_of(&builder.tree().view(), support);
            assert_eq!(spray, expected, "{structure} {support}");
        }
    }
    let nothing = built(&[], 1.0, &BuildSettings::default());
    assert!(spray_of(&nothing.tree().view(), 4.0).is_empty());
}

#[test]
fn drops_are_met_beside_and_before_a_body() {
    let body = built(&[Vec3::ZERO, Vec3::X], 1.0, &BuildSettings::default());
    let drops = [
        Vec3::new(-4.0, 0.0, 0.0),
        Vec3::new(0.5, 0.0, 0.0),
        Vec3::new(0.0, 5.0, 0.0),
    ];
    let spray = built(&drops, 0.25, &BuildSettings::default());
    let medium = MediumSurface::new(body.tree().view());
    let alone = WithSpray::new(medium, None);
    let surface = WithSpray::new(medium, Some(Drops::new(spray.tree().view(), 2)));
    let along = |y: f32| Ray::new(Vec3::new(-10.0, y, 0.0), Vec3::X);

    let drop = surface
        .crossing(&along(0.0), Side::Outside)
        .expect("a drop");
    assert_eq!(
        (drop.t, drop.particle, drop.substance),
        (5.75, 2, Substance::Spray)
    );
    assert_eq!(surface.nearest(&along(0.0)), Some(drop));
    let entry = surface
        .crossing(&along(0.5), Side::Outside)
        .expect("the body");
    assert_eq!((entry.particle, entry.substance), (0, Substance::Body));
    assert_eq!(alone.crossing(&along(0.5), Side::Outside), Some(entry));
    let inside = Ray::new(Vec3::ZERO, Vec3::X);
    let drop = surface
        .crossing(&inside, Side::Inside)
        .expect("a drop in the body");
    assert_eq!((drop.t, drop.particle), (0.25, 3));
    let exit = alone.crossing(&inside, Side::Inside).expect("out");
    assert_eq!((exit.t, exit.particle), (2.0, 1));

    assert!(surface.occluded(&along(5.0)) && !alone.occluded(&along(5.0)));
    assert_eq!(surface.transmittance(&along(5.0), |_| 0.5), 0.0);
    assert_eq!(surface.transmittance(&along(0.5), |_| 0.5), 0.25);
    assert_eq!(surface.side_of(Vec3::ZERO), Side::Inside);
    assert_eq!(surface.side_of(drops[0]), Side::Outside);

    let mut packet = RayPacket::default();
    let rays: Vec<Ray> = (0..16_i16).map(|i| along(0.35 * f32::from(i))).collect();
    rays.iter().for_each(|ray| packet.push(ray));
    let single: Vec<_> = rays.iter().map(|ray| surface.nearest(ray)).collect();
    assert_eq!(surface.nearest_packet(&packet)[..], single);
    assert!(single.iter().filter(|hit| hit.is_some()).count() > 3);
    let occluded = surface.occluded_packet(&packet);
    let expected = (0..)
        .zip(&rays)
        .map(|(i, ray)| u32::from(surface.occluded(ray)) << i);
    assert_eq!(occluded, expected.sum::<u32>());
}
