use super::*;
use spherule_tree::accel::{BuildSettings, SphereRadius, Spheres, Structure, TreeBuilder};
use spherule_tree::ray::PACKET_SIZE;

/// A small generator: tests must not change with a crate's version.
struct Random(u32);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f32::from(u16::try_from(self.0 >> 16).expect("16 bits")) / 65_535.0
    }

    fn direction(&mut self) -> Vec3 {
        let point = Vec3::new(self.next(), self.next(), self.next()) * 2.0 - 1.0;
        point.normalize_or(Vec3::X)
    }
}

/// A body of overlapping spheres, with isolated spheres around it.
fn body(count: usize) -> (Vec<Vec3>, Vec<f32>) {
    let mut random = Random(5);
    let spheres = (0..count).map(|i| {
        let reach = if i % 10 == 0 { 2.0 } else { 1.0 };
        let center = random.direction() * reach * random.next();
        (center, 0.05 + 0.1 * random.next())
    });
    spheres.unzip()
}

fn each_structure(centers: &[Vec3], radius: SphereRadius, check: impl Fn(UnionSurface)) {
    for structure in Structure::ALL {
        let mut builder = TreeBuilder::new();
        let spheres = Spheres { centers, radius };
        builder.build(&spheres, &BuildSettings::new(structure));
        check(UnionSurface::new(builder.tree().view()));
    }
}

#[test]
fn spheres_inside_the_union_are_not_hit() {
    let centers = [Vec3::ZERO, Vec3::X, 2.0 * Vec3::X, 9.0 * Vec3::X];
    each_structure(&centers, SphereRadius::Common(1.0), |body| {
        let mut ray = Ray::new(Vec3::new(-5.0, 0.0, 0.0), Vec3::X);
        let mut side = Side::Outside;
        let expected = [(4.0, 0, -1.0), (8.0, 2, 1.0), (13.0, 3, -1.0), (15.0, 3, 1.0)];
        for (t, particle, x) in expected {
            let hit = body.crossing(&ray, side).expect("a crossing");
            assert_eq!((hit.t, hit.particle, hit.normal.x), (t, particle, x));
            ray.t_min = hit.t;
            side = side.other();
        }
        assert_eq!(body.crossing(&ray, side), None);
    });
}

/// Rays are refracted at every crossing, and each starts at the origin that the previous hit provides.
#[test]
fn refracted_rays_leave_the_union() {
    let (centers, radii) = body(600);
    each_structure(&centers, SphereRadius::Each(&radii), |body| {
        let mut random = Random(9);
        let mut entered = 0;
        let mut in_creases = 0;
        for _ in 0..4000 {
            let away = random.direction();
            let aim = random.direction() * random.next();
            let ray = Ray::new(aim + 5.0 * away, -away);
            let Some(hit) = body.crossing(&ray, Side::Outside) else {
                continue;
            };
            assert!(hit.normal.dot(ray.direction) <= 1e-3, "{hit:?}");
            let start = hit.anchor - hit.offset * hit.normal;
            assert_eq!(body.side_of(start), Side::Inside, "{hit:?}");
            let mut inwards = random.direction();
            inwards *= -1.0_f32.copysign(inwards.dot(hit.normal));
            let ray = Ray::new(start, inwards);
            let exit =
                body.crossing(&ray, Side::Inside).unwrap_or_else(|| panic!("{ray:?} stays inside"));
            assert!(exit.t > 0.0 && exit.normal.dot(inwards) >= -1e-3, "{exit:?}");
            let outside = exit.anchor + exit.offset * exit.normal;
            in_creases += u32::from(body.side_of(outside) == Side::Inside);
            entered += 1;
        }
        assert!(entered > 1500 && in_creases < 10, "{entered} {in_creases}");
    });
}

#[test]
fn rays_on_the_wrong_side_cross_at_once() {
    each_structure(&[Vec3::ZERO], SphereRadius::Common(1.0), |body| {
        let start = Vec3::new(-0.999_99, 0.0, 0.0);
        let hit = body.crossing(&Ray::new(start, Vec3::X), Side::Outside);
        assert_eq!(hit.map(|hit| (hit.t, hit.normal)), Some((0.0, -Vec3::X)));
        // After the last crossing, the ray is outside.
        assert_eq!(body.crossing(&Ray::new(start, -Vec3::X), Side::Outside), None);
        let start = Vec3::new(-1.000_01, 0.0, 0.0);
        for direction in [Vec3::X, -Vec3::X] {
            let hit = body.crossing(&Ray::new(start, direction), Side::Inside);
            assert_eq!(hit.map(|hit| (hit.t, hit.normal)), Some((0.0, direction)));
        }
        let far = Ray::new(Vec3::new(0.0, 5.0, 0.0), Vec3::X);
        assert_eq!(body.crossing(&far, Side::Inside), None, "nothing to come from");
    });
}

#[test]
fn packets_match_single_rays() {
    let (centers, radii) = body(600);
    each_structure(&centers, SphereRadius::Each(&radii), |body| {
        let mut random = Random(13);
        for origin in [Vec3::new(0.0, 0.0, 4.0), Vec3::new(0.01, 0.02, 0.03)] {
            for _ in 0..100 {
                let aim = random.direction() * random.next();
                let mut packet = RayPacket::default();
                for _ in 0..PACKET_SIZE {
                    let aim = aim + 0.05 * random.direction();
                    packet.push(&Ray::new(origin, (aim - origin).normalize_or(Vec3::X)));
                }
                let single: Vec<_> =
                    packet.rays().map(|ray| body.crossing(&ray, Side::Outside)).collect();
                for coherence in [Coherence::Coherent, Coherence::Incoherent] {
                    let mut hits = Intersections::default();
                    body.intersect(&mut packet.clone(), coherence, 0, &mut hits);
                    assert_eq!(hits.all(packet.len()), single);
                }
            }
        }
    });
}

#[test]
fn points_inside_have_the_attributes_of_the_spheres_around() {
    let centers = [Vec3::ZERO, Vec3::X, 9.0 * Vec3::X];
    each_structure(&centers, SphereRadius::Common(1.0), |body| {
        let found = |x: f32| {
            let mut found = Vec::new();
            body.blend_at(Vec3::new(x, 0.0, 0.0), 0.0, &mut |particle, weight| {
                found.push((particle, (1e4 * weight).round()));
            });
            found
        };
        // Weights are 1 - d^2
        assert_eq!(found(0.5), [(0, 7500.0), (1, 7500.0)]);
        assert_eq!(found(0.2), [(0, 9600.0), (1, 3600.0)]);
        assert_eq!(found(-0.5), [(0, 7500.0)]);
        assert_eq!(found(9.0), [(2, 10_000.0)]);
        assert_eq!(found(5.0), []);
    });
}
