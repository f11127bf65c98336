use glam::{DVec3, Vec3};

use super::*;
use crate::SurfaceKind;
use spherule_tree::accel::simd::tested_levels::tested_levels;

const RADIUS: f32 = 0.5;

fn settings(smoothing: f32, exact: bool) -> SurfaceSettings {
    SurfaceSettings { kind: SurfaceKind::Smooth, smoothing, exact, ..SurfaceSettings::DEFAULT }
}

fn grid(centers: &[Vec3], settings: &SurfaceSettings) -> SmoothGrid {
    let mut grid = SmoothGrid::default();
    grid.build(centers, RADIUS, settings, true, None).expect("it fits");
    grid
}

struct Random(u64);

impl Random {
    fn unit(&mut self) -> f32 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / 16_777_216.0
    }

    fn in_cube(&mut self) -> Vec3 {
        2.0 * Vec3::new(self.unit(), self.unit(), self.unit()) - 1.0
    }

    fn on_sphere(&mut self) -> Vec3 {
        loop {
            let v = self.in_cube();
            if v.length_squared() > 0.01 && v.length_squared() < 1.0 {
                return v.normalize();
            }
        }
    }
}

/// Particles two radii apart with a small random offset, at positions for which `is_in` is true.
fn filled(edge: i32, is_in: impl Fn(Vec3) -> bool) -> Vec<Vec3> {
    let mut random = Random(11);
    let mut centers = Vec::new();
    for z in -edge..=edge {
        for y in -edge..=edge {
            for x in -edge..=edge {
                let place = Vec3::new(x as f32, y as f32, z as f32);
                if is_in(place) {
                    centers.push(place + 0.15 * random.in_cube());
                }
            }
        }
    }
    centers
}

fn bodies() -> Vec<(&'static str, Vec<Vec3>)> {
    vec![
        ("one", vec![Vec3::new(0.3, -0.2, 0.1)]),
        ("two", vec![Vec3::new(-0.5, 0.1, 0.0), Vec3::new(0.4, 0.2, 0.3)]),
        ("box", filled(5, |p| p.abs().max_element() < 4.5)),
        ("ball", filled(7, |p| p.length() < 6.0)),
    ]
}

/// Rays towards a body around the origin, from all sides.
fn rays(count: usize, seed: u64, spread: f32) -> impl Iterator<Item = Ray> {
    let mut random = Random(seed);
    (0..count).map(move |_| {
        let from = 30.0 * random.on_sphere();
        let at = spread * random.in_cube();
        Ray::new(from, (at - from).normalize())
    })
}

/// The field and its gradient by their definition, in f64.
fn exact_field(centers: &[Vec3], at: DVec3) -> (f64, DVec3) {
    let support = f64::from(4.0 * RADIUS);
    let weight = |q: f64| match q {
        q if q <= 0.5 => 6.0 * (q * q * q - q * q) + 1.0,
        q if q <= 1.0 => 2.0 * (1.0 - q).powi(3),
        _ => 0.0,
    };
    let slope = |q: f64| match q {
        q if q <= 0.5 => 18.0 * q * q - 12.0 * q,
        q if q <= 1.0 => -6.0 * (1.0 - q).powi(2),
        _ => 0.0,
    };
    let near =
        |a: DVec3| centers.iter().map(|c| c.as_dvec3()).filter(move |c| c.distance(a) < support);
    let mut value = 0.0;
    let mut gradient = DVec3::ZERO;
    for j in near(at) {
        let volume = 1.0 / near(j).map(|k| weight(j.distance(k) / support)).sum::<f64>();
        let (offset, distance) = (at - j, at.distance(j));
        value += volume * weight(distance / support);
        gradient += volume * slope(distance / support) / (support * distance.max(1e-9)) * offset;
    }
    (value, gradient)
}

#[test]
fn exact_places_and_normals_are_those_of_the_field() {
    for (name, centers) in bodies() {
        let settings = settings(0.0, true);
        let grid = grid(&centers, &settings);
        let surface = grid.surface();
        let (mut hits, mut degrees) = (0, 0.0_f64);
        let spread = if centers.len() < 3 { 0.8 } else { 5.0 };
        for ray in rays(300, 5, spread) {
            let Some(hit) = surface.nearest(&ray) else {
                continue;
            };
            hits += 1;
            let (value, gradient) = exact_field(&centers, hit.point.as_dvec3());
            let distance = (value - f64::from(settings.threshold)) / gradient.length();
            assert!(distance.abs() < 0.02 * f64::from(RADIUS), "{name}: {distance}");
            let cosine = -gradient.normalize().dot(hit.normal.as_dvec3());
            degrees = degrees.max(cosine.min(1.0).acos().to_degrees());
        }
        assert!(hits > 100, "{name}: {hits}");
        assert!(degrees < 1.0, "{name}: {degrees}");
    }
}

#[test]
fn fine_grid_converges_to_the_field() {
    for (name, centers) in bodies() {
        let settings = SurfaceSettings { voxel: 0.25, ..settings(0.0, false) };
        let grid = grid(&centers, &settings);
        let mut hits = 0;
        for ray in rays(100, 6, 0.8) {
            let Some(hit) = grid.surface().nearest(&ray) else {
                continue;
            };
            hits += 1;
            let (value, gradient) = exact_field(&centers, hit.point.as_dvec3());
            let distance = (value - f64::from(settings.threshold)) / gradient.length();
            assert!(distance.abs() < 0.02 * f64::from(RADIUS), "{name}: {distance}");
            let cosine = -gradient.normalize().dot(hit.normal.as_dvec3());
            assert!(cosine > 3_f64.to_radians().cos(), "{name}: {cosine}");
        }
        assert!(hits > 30, "{name}: {hits}");
    }
}

/// Traces rays through a body from crossing to crossing: they end outside, and the sides between crossings are correct.
fn assert_pairs(surface: &SmoothSurface, rays: impl Iterator<Item = Ray>) -> usize {
    let mut all = 0;
    for ray in rays {
        let (mut rest, mut side, mut crossings) = (ray, Side::Outside, 0);
        while let Some(hit) = surface.crossing(&rest, side) {
            side = side.other();
            crossings += 1;
            assert!(hit.t >= rest.t_min, "{ray:?}");
            rest.t_min = hit.t + hit.offset;
            assert!(crossings < 100, "{ray:?}");
        }
        assert_eq!(side, Side::Outside, "{ray:?}: {crossings}");
        all += crossings;
    }
    all
}

#[test]
fn rays_enter_and_leave_in_pairs() {
    for (name, centers) in bodies() {
        for smoothing in [0.0, 0.75] {
            let grid = grid(&centers, &settings(smoothing, false));
            let crossings = assert_pairs(&grid.surface(), rays(5000, 1, 8.0));
            assert!(centers.len() < 3 || crossings > 2000, "{name}: {crossings}");
        }
    }
}

// 150,000 rays through each of two grids: few rays meet the cases that are difficult.
#[test]
fn many_rays_enter_and_leave_in_pairs() {
    check_pairs(150_000);
}

#[test]
#[ignore = "takes a minute; a smaller number is in the usual run"]
fn a_million_rays_enter_and_leave_in_pairs() {
    check_pairs(1_000_000);
}

#[track_caller]
fn check_pairs(count: usize) {
    let (_, centers) = bodies().remove(3);
    for smoothing in [0.0, 0.75] {
        let grid = grid(&centers, &settings(smoothing, false));
        assert!(assert_pairs(&grid.surface(), rays(count, 2, 8.0)) > 2 * count / 5);
    }
}

#[test]
fn sides_are_those_of_the_field() {
    let (_, centers) = bodies().remove(3);
    let grid = grid(&centers, &settings(0.0, false));
    let mut random = Random(3);
    for _ in 0..2000 {
        let point = 9.0 * random.in_cube();
        let (value, _) = exact_field(&centers, point.as_dvec3());
        // Skip points where the resolution of the grid may matter.
        if (value - 0.6).abs() > 0.15 {
            let expected = if value > 0.6 { Side::Inside } else { Side::Outside };
            assert_eq!(grid.surface().side_of(point), expected, "{point}: {value}");
        }
    }
}

#[test]
fn order_and_threads_change_nothing() {
    let centers = filled(8, |p| p.length() < 7.0 && p.x.sin() > -0.7);
    let mut reversed = centers.clone();
    reversed.reverse();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().expect("threads");
    for settings in [settings(0.75, false), settings(0.0, true)] {
        let (a, b) = (grid(&centers, &settings), pool.install(|| grid(&reversed, &settings)));
        for ray in rays(2000, 9, 6.0) {
            assert_eq!(a.surface().nearest(&ray), b.surface().nearest(&ray));
            let inside = Ray { t_min: 28.0, ..ray };
            let leave = |grid: &SmoothGrid| grid.surface().crossing(&inside, Side::Inside);
            assert_eq!(leave(&a), leave(&b));
        }
    }
}

#[test]
fn grid_is_fixed_in_world_space() {
    // Move everything by whole bricks, and by distances that do not change the rounding.
    let centers: Vec<Vec3> =
        filled(4, |p| p.length() < 3.5).iter().map(|c| (c * 1024.0).round() / 1024.0).collect();
    let shift = Vec3::new(8.0, -16.0, 4.0);
    let moved: Vec<Vec3> = centers.iter().map(|c| *c + shift).collect();
    let settings = settings(0.75, false);
    let (a, b) = (grid(&centers, &settings), grid(&moved, &settings));
    assert_eq!(a.built.tree.bricks.len(), b.built.tree.bricks.len());
    for ray in rays(200, 4, 3.0) {
        let there = Ray { origin: ray.origin + shift, ..ray };
        let (Some(p), Some(q)) = (a.surface().nearest(&ray), b.surface().nearest(&there)) else {
            continue;
        };
        assert!(p.normal.distance(q.normal) < 1e-3, "{ray:?}");
        assert!((p.t - q.t).abs() < 1e-4, "{ray:?}");
    }
}

#[test]
fn unusual_input_gives_a_surface_or_none() {
    let ray = Ray::new(Vec3::new(0.0, 0.0, 9.0), Vec3::NEG_Z);
    let build = |centers: &[Vec3], settings: &SurfaceSettings| {
        let mut grid = SmoothGrid::default();
        let report = grid.build(centers, RADIUS, settings, false, None).expect("it fits");
        (grid.surface().nearest(&ray), report)
    };
    let default = settings(0.75, false);
    let (hit, report) = build(&[], &default);
    assert_eq!((hit, report.bytes, report.is_empty), (None, 0, false));
    let (hit, _) = build(&[Vec3::ZERO], &default);
    // An isolated particle is a ball of about 1.3 radii, whatever the smoothing.
    assert!((hit.expect("a drop").t - (9.0 - 1.3 * RADIUS)).abs() < 0.15 * RADIUS);
    let (hit, _) = build(&vec![Vec3::ZERO; 20_000], &default);
    assert!(hit.is_some());
    let unreachable = SurfaceSettings { threshold: 3.0, ..default };
    let (hit, report) = build(&filled(3, |_| true), &unreachable);
    assert_eq!((hit, report.is_empty), (None, true));
    let mut escaped = filled(3, |_| true);
    escaped.push(Vec3::new(1e5, 2e5, -3e5));
    escaped.push(Vec3::new(1e25, 0.0, 0.0));
    let (hit, report) = build(&escaped, &default);
    assert!(hit.is_some());
    assert_eq!(report.left_out, 1);
    assert!(report.bytes < 8 << 20, "{}", report.bytes);
    let at_escaped = Ray::new(Vec3::new(1e5, 2e5, -3e5) + 3.0 * Vec3::Y, Vec3::NEG_Y);
    let mut grid = SmoothGrid::default();
    grid.build(&escaped, RADIUS, &default, false, None).expect("it fits");
    assert!(grid.surface().nearest(&at_escaped).is_some());
}

#[test]
fn grid_beyond_memory_is_rejected() {
    let lonely: Vec<Vec3> = filled(6, |_| true).iter().map(|c| 40.0 * c).collect();
    let mut grid = SmoothGrid::default();
    let refused = grid.build(&lonely, RADIUS, &settings(0.75, false), false, Some(1 << 20));
    let message = refused.expect_err("it cannot fit").to_string();
    assert!(message.contains("radius 0.5 in voxels of 0.5"), "{message}");
}

#[test]
fn smoothing_removes_bumps() {
    let centers = filled(6, |p| p.abs().max_element() < 6.1);
    let roughness = |smoothing: f32| {
        let grid = grid(&centers, &settings(smoothing, false));
        let mut sum = 0.0_f32;
        for i in 0..400 {
            let (x, y) = ((i % 20) as f32, (i / 20) as f32);
            let from = Vec3::new(0.3 * (x - 10.0), 0.3 * (y - 10.0), 20.0);
            let hit = grid.surface().nearest(&Ray::new(from, Vec3::NEG_Z)).expect("the lid");
            sum += hit.normal.angle_between(Vec3::Z).to_degrees();
        }
        sum / 400.0
    };
    let (raw, smooth) = (roughness(0.0), roughness(0.75));
    assert!(smooth < 0.6 * raw, "{raw} {smooth}");
}

/// The direction of a ray behind a glass ball around the origin, by two applications of Snell's law in f64.
fn bent_by_ball(ray: &Ray, radius: f64, ior: f64) -> Option<DVec3> {
    let bend = |direction: DVec3, normal: DVec3, ratio: f64| {
        let cosine = -direction.dot(normal);
        let rest = 1.0 - ratio * ratio * (1.0 - cosine * cosine);
        (rest > 0.0)
            .then(|| (ratio * direction + (ratio * cosine - rest.sqrt()) * normal).normalize())
    };
    let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3().normalize());
    let middle = -origin.dot(direction);
    let half2 = radius * radius - (origin + middle * direction).length_squared();
    let entry = origin + (middle - (half2 > 0.0).then(|| half2.sqrt())?) * direction;
    let inside = bend(direction, entry / radius, 1.0 / ior)?;
    let exit = entry - 2.0 * entry.dot(inside) * inside;
    bend(inside, -exit / radius, ior)
}

/// A ball of particles two radii apart: shells with particles along a spiral (Vogel 1979).
fn shells(count: u8) -> Vec<Vec3> {
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let shell = |number: u8| {
        let radius = f64::from(number) + 0.5;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "thousands")]
        let places = (4.0 * std::f64::consts::PI * radius * radius) as u32;
        (0..places).map(move |i| {
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(places);
            let (sin, cos) = (golden * f64::from(i)).sin_cos();
            let across = (1.0 - z * z).sqrt();
            (radius * DVec3::new(across * cos, across * sin, z)).as_vec3()
        })
    };
    (0..count).flat_map(shell).collect()
}

#[test]
fn ball_of_particles_refracts_as_a_glass_ball() {
    let grid = grid(&shells(12), &settings(1.0, false));
    let surface = grid.surface();
    // The size of the ball, measured by rays through its centre, agrees with the volume of the particles.
    let chords: Vec<f32> = rays(200, 40, 0.01)
        .filter_map(|ray| {
            let enters = surface.nearest(&ray)?;
            let inside = Ray { t_min: enters.t + enters.offset, ..ray };
            Some(surface.crossing(&inside, Side::Inside)?.t - enters.t)
        })
        .collect();
    assert_eq!(chords.len(), 200);
    let radius = f64::from(0.5 * chords.iter().sum::<f32>() / 200.0);
    let (mut degrees, mut straight) = (Vec::new(), Vec::new());
    for ray in rays(400, 41, 4.0) {
        let ior = 1.333;
        let enters = surface.nearest(&ray).expect("towards the middle");
        let inwards = ray.direction.refract(enters.normal, 1.0 / ior).normalize();
        let inside = Ray::new(enters.anchor - enters.offset * enters.normal, inwards);
        let leaves = surface.crossing(&inside, Side::Inside).expect("a way out");
        let (Some(out), Some(expected)) = (
            // Zero under total internal reflection
            inside.direction.refract(-leaves.normal, ior).try_normalize(),
            bent_by_ball(&ray, radius, f64::from(ior)),
        ) else {
            continue;
        };
        degrees.push(expected.angle_between(out.as_dvec3()).to_degrees());
        straight.push(expected.angle_between(ray.direction.as_dvec3()).to_degrees());
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    assert!(degrees.len() > 380);
    assert!(mean(&straight) > 5.0, "{}", mean(&straight));
    assert!(mean(&degrees) < 2.5, "{}", mean(&degrees));
}

/// Packets of rays from all sides in random order; every third ray starts inside the body.
fn packets(count: usize) -> Vec<(RayPacket, u32)> {
    let rays: Vec<Ray> = rays(16 * count, 13, 7.0).collect();
    let packet = |rays: &[Ray]| {
        let mut packet = RayPacket::default();
        let mut inside = 0;
        for (lane, ray) in rays.iter().enumerate() {
            let is_inside = lane % 3 == 1;
            let t_min = if is_inside { 28.0 } else { 0.0 };
            packet.push(&Ray { t_min, ..*ray });
            inside |= u32::from(is_inside) << lane;
        }
        (packet, inside)
    };
    rays.chunks(16).map(packet).collect()
}

#[test]
fn packets_match_single_rays() {
    let (_, centers) = bodies().remove(3);
    let grid = grid(&centers, &settings(0.75, false));
    for level in tested_levels() {
        let surface = SmoothSurface { built: &grid.built, simd: Supported::or_best(level) };
        let mut found = 0;
        for (mut packet, inside) in packets(500) {
            let rays: Vec<Ray> = packet.rays().collect();
            let all = first_lanes(16);
            let occluded = surface.occluded(&packet, Coherence::Incoherent, all & !inside);
            let mut hits = Intersections::default();
            surface.intersect(&mut packet, Coherence::Incoherent, inside, &mut hits);
            assert_eq!(occluded, hits.mask & !inside, "{level:?}");
            for (lane, ray) in rays.iter().enumerate() {
                let side = Side::of_lane(inside, lane);
                let hit = grid.surface().crossing(ray, side);
                assert_eq!(hits.all(16)[lane], hit, "{level:?} {ray:?}");
                let t_max = hit.map_or(ray.t_max, |hit| hit.t);
                assert_eq!(packet.t_max[lane], t_max, "{level:?} {ray:?}");
                found += usize::from(hit.is_some());
            }
        }
        assert!(found > 2000, "{level:?}: {found}");
    }
}

#[test]
fn crossings_are_where_the_side_changes() {
    let mut centers = filled(7, |p| p.length() < 6.0);
    centers.extend(filled(9, |p| p.x > 8.5 && p.y > 8.5));
    let grid = grid(&centers, &settings(0.75, false));
    let tree = &grid.built.tree;
    let mut found = 0;
    for (mut packet, _) in packets(40) {
        packet.t_min = [0.0; 16];
        let mut hits = Intersections::default();
        let rays: Vec<Ray> = packet.rays().collect();
        grid.surface().intersect(&mut packet, Coherence::Incoherent, 0, &mut hits);
        for (ray, hit) in rays.iter().zip(hits.all(16)) {
            let close = 0.05 * tree.voxel();
            let end = hit.map_or(60.0, |hit| hit.t - close);
            for step in 0..4000 {
                let at = ray.at(end * step as f32 / 4000.0);
                assert_eq!(tree.side_of(at), Side::Outside, "{ray:?} {hit:?} {at}");
            }
            if let Some(hit) = hit {
                let is_grazing = hit.normal.dot(ray.direction).abs() < 0.2;
                let behind = tree.side_of(ray.at(hit.t + close));
                assert!(is_grazing || behind == Side::Inside, "{ray:?} {hit:?}");
                found += 1;
            }
        }
    }
    assert!(found > 200, "{found}");
}

#[test]
fn nan_rays_hit_nothing_and_do_not_affect_others() {
    let (_, centers) = bodies().remove(3);
    let grid = grid(&centers, &settings(0.75, false));
    let surface = grid.surface();
    for (packet, inside) in packets(50) {
        for poison in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX] {
            for axis in 0..3 {
                let mut poisoned = packet;
                poisoned.origin[axis][2] = poison;
                poisoned.direction[(axis + 1) % 3][6] = poison;
                poisoned.t_min[11] = poison.abs();
                poisoned.t_max[15] = f32::NAN;
                let lanes = [2, 6, 11, 15];
                let (mut of_all, mut of_sound) =
                    (Intersections::default(), Intersections::default());
                surface.intersect(&mut poisoned, Coherence::Coherent, inside, &mut of_all);
                let mut sound = packet;
                surface.intersect(&mut sound, Coherence::Coherent, inside, &mut of_sound);
                for (lane, (a, b)) in of_all.all(16).iter().zip(of_sound.all(16)).enumerate() {
                    let expected = if lanes.contains(&lane) { None } else { b };
                    assert_eq!(*a, expected, "{poison} {axis} {lane}");
                }
            }
        }
    }
}
