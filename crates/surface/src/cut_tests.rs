//! Cut spheres against brute force in f64: each sphere, each plane, one ray after the other.

use super::*;
use crate::moving::MovingSpheres;
use crate::spheres::SphereSurface;
use spherule_tree::accel::moving::MovingTree;
use spherule_tree::accel::simd::tested_levels::tested_levels;
use spherule_tree::accel::{BuildSettings, SphereRadius, Spheres, Structure, TreeBuilder};

/// Decisions that are closer than this may differ in f32.
const CLOSE: f64 = 2e-5;

/// A number in 0 to 1.
fn unit(seed: u32) -> f32 {
    let mixed = seed.wrapping_mul(0x9e37_79b9) ^ 0x5bd1_e995;
    let mixed = (mixed ^ (mixed >> 15)).wrapping_mul(0x85eb_ca6b);
    ((mixed ^ (mixed >> 13)) >> 8) as f32 / 16_777_216.0
}

fn vector(seed: u32) -> Vec3 {
    Vec3::new(unit(seed), unit(seed + 1), unit(seed + 2)) * 2.0 - 1.0
}

struct Balls {
    centers: Vec<Vec3>,
    radii: Vec<f32>,
    displacements: Vec<Vec3>,
    /// A point on each plane, and its normal.
    planes: Vec<(DVec3, DVec3)>,
}

/// What a ray hits.
#[derive(Debug, Clone, Copy)]
struct Hit {
    t: f64,
    particle: usize,
    normal: DVec3,
}

impl Balls {
    /// Overlapping balls of different sizes, cut by random planes and, for odd numbers, by a box.
    fn new(number: u32) -> Self {
        let count = 150;
        let seed = 10_000 * number;
        let plane = |i: u32| {
            let normal = vector(seed + 31 * i + 7).as_dvec3().normalize();
            (0.4 * vector(seed + 17 * i + 3).as_dvec3(), normal)
        };
        let mut planes: Vec<_> = (0..number % 3).map(plane).collect();
        if number % 2 == 1 {
            let corner = 0.6 * vector(seed + 5).as_dvec3().abs() + 0.1;
            let faces = DVec3::AXES.into_iter().flat_map(|n| [(corner, n), (-corner, -n)]);
            planes.extend(faces);
        }
        Self {
            centers: (0..count).map(|i| vector(seed + 11 * i)).collect(),
            radii: (0..count).map(|i| 0.05 + 0.25 * unit(seed + 7 * i + 3)).collect(),
            displacements: (0..count).map(|i| 0.5 * vector(seed + 13 * i + 5)).collect(),
            planes,
        }
    }

    fn region(&self) -> ConvexRegion {
        let mut region = ConvexRegion::default();
        for (point, normal) in &self.planes {
            region.cut(*point, *normal);
        }
        region
    }

    /// The first of all surfaces of balls in the region, and of faces in balls, from `ray.t_min` to `ray.t_max`, and
    /// how close the nearest decision was.
    fn nearest(&self, ray: &Ray, time: f32) -> (Option<Hit>, f64) {
        let (o, d) = (ray.origin.as_dvec3(), ray.direction.as_dvec3());
        let (mut span, mut faces) = ([f64::NEG_INFINITY, f64::INFINITY], [DVec3::ZERO; 2]);
        for (point, normal) in &self.planes {
            let t = (*point - o).dot(*normal) / d.dot(*normal);
            if d.dot(*normal) < 0.0 && t > span[0] {
                (span[0], faces[0]) = (t, *normal);
            } else if d.dot(*normal) > 0.0 && t < span[1] {
                (span[1], faces[1]) = (t, *normal);
            }
        }
        let ends = [f64::from(ray.t_min), f64::from(ray.t_max)];
        let mut closeness = (span[0] - span[1]).abs();
        let mut best: Option<Hit> = None;
        let mut powers = [f64::INFINITY; 2];
        let meet = |hit: Hit, best: &mut Option<Hit>, closeness: &mut f64| {
            for end in span.into_iter().chain(ends) {
                let is_itself = hit.t == end;
                *closeness = closeness.min(if is_itself { 1.0 } else { (hit.t - end).abs() });
            }
            let is_in = hit.t >= span[0] && hit.t <= span[1] && hit.t >= ends[0] && hit.t < ends[1];
            if is_in && best.is_none_or(|best| hit.t < best.t) {
                *best = Some(hit);
            }
        };
        for (particle, center) in self.centers.iter().enumerate() {
            let center =
                center.as_dvec3() + f64::from(time) * self.displacements[particle].as_dvec3();
            let radius = f64::from(self.radii[particle]);
            let middle = (center - o).dot(d);
            let across = (center - o - middle * d).length();
            closeness = closeness.min((across - radius).abs());
            if across > radius {
                continue;
            }
            let half = (radius * radius - across * across).sqrt();
            let chord = [middle - half, middle + half];
            for t in chord {
                let normal = (o + t * d - center) / radius;
                meet(Hit { t, particle, normal }, &mut best, &mut closeness);
            }
            for (end, t) in span.into_iter().enumerate() {
                if t <= chord[0] || t >= chord[1] {
                    continue;
                }
                // The ball that it is deepest in
                let power = (t - chord[0]) * (t - chord[1]);
                closeness = closeness.min((power - powers[end]).abs());
                if power < powers[end] {
                    powers[end] = power;
                    let normal = faces[end];
                    let hit = Hit { t, particle, normal };
                    if best.is_some_and(|best| best.t == t) {
                        best = Some(hit);
                    }
                    meet(hit, &mut best, &mut closeness);
                }
            }
        }
        (best, closeness)
    }
}

/// Sixteen rays: from one point if `number` is even, else from anywhere; some start inside of balls.
fn packet(number: u32) -> RayPacket {
    let mut rays = RayPacket::default();
    for lane in 0..16 {
        let seed = 1000 * number + 17 * lane;
        let origin = match number % 2 {
            0 => 3.0 * vector(1000 * number),
            _ => 1.5 * vector(seed + 3),
        };
        let target = vector(1000 * number + 9) + 0.3 * vector(seed + 9);
        let mut ray = Ray::new(origin, (target - origin).normalize());
        if lane % 4 == 3 {
            (ray.t_min, ray.t_max) = (0.3 * unit(seed + 11), 4.0 * unit(seed + 15));
        }
        rays.push(&ray);
    }
    rays
}

/// Compares packets, single rays and shadow rays of `shape` with brute force. Returns how many rays hit faces.
fn compare(balls: &Balls, shape: &dyn Shape, time: f32, single: bool) -> usize {
    let (mut faces, mut skipped, packets) = (0, 0, 24);
    for number in 0..packets {
        let mut rays = packet(number);
        rays.time = [time; 16];
        for coherence in [Coherence::Coherent, Coherence::Incoherent] {
            let occluded = shape.occluded(&rays, coherence, 0xff3f);
            assert_eq!(occluded & !0xff3f, 0);
            let (mut traced, mut hits) = (rays, Intersections::default());
            shape.intersect(&mut traced, coherence, 0, &mut hits);
            for (lane, found) in hits.all(16).into_iter().enumerate() {
                let ray = rays.ray(lane);
                let (expected, closeness) = balls.nearest(&ray, time);
                if single {
                    assert_eq!(shape.crossing(&ray, Side::Outside), found, "{ray:?}");
                }
                assert_eq!(traced.t_min[lane], ray.t_min);
                assert_eq!(traced.t_max[lane], found.map_or(ray.t_max, |hit| hit.t));
                if closeness < CLOSE {
                    skipped += 1;
                    continue;
                }
                let what =
                    || format!("{coherence:?} {number} {lane} {ray:?} {found:?} {expected:?}");
                assert_eq!(found.is_some(), expected.is_some(), "{}", what());
                let is_tested = 0xff3f >> lane & 1 == 1;
                assert_eq!(
                    occluded >> lane & 1 == 1,
                    expected.is_some() && is_tested,
                    "{}",
                    what()
                );
                let (Some(found), Some(expected)) = (found, expected) else {
                    continue;
                };
                let point = ray.origin.as_dvec3() + expected.t * ray.direction.as_dvec3();
                assert!((f64::from(found.t) - expected.t).abs() < CLOSE, "{}", what());
                assert!((found.point.as_dvec3() - point).length() < CLOSE, "{}", what());
                assert!((found.normal.as_dvec3() - expected.normal).length() < 1e-3, "{}", what());
                assert_eq!(found.particle as usize, expected.particle, "{}", what());
                assert_eq!(found.radius, balls.radii[expected.particle]);
                faces += usize::from(balls.planes.iter().any(|(_, n)| *n == expected.normal));
            }
        }
    }
    assert!(skipped < packets as usize * 32 / 10, "{skipped} rays are not decided");
    faces
}

#[test]
fn cut_spheres_are_those_of_brute_force() {
    let mut faces = 0;
    for number in 1..7 {
        let balls = Balls::new(number);
        let region = balls.region();
        let spheres = Spheres { centers: &balls.centers, radius: SphereRadius::Each(&balls.radii) };
        for structure in Structure::ALL {
            let mut builder = TreeBuilder::new();
            builder.build(&spheres, &BuildSettings::new(structure));
            for simd in tested_levels() {
                builder.tree_mut().set_simd(simd);
                let shape = SphereSurface::new(builder.tree().view());
                let cut = CutSpheres::new(shape, &region);
                // Packets and single rays may differ between levels, never within one
                faces += compare(&balls, &cut, 0.0, true);
            }
        }
    }
    assert!(faces > 500, "{faces}");
}

#[test]
fn moving_spheres_are_cut_at_the_time_of_a_ray() {
    let balls = Balls::new(4);
    let region = balls.region();
    let spheres = Spheres { centers: &balls.centers, radius: SphereRadius::Each(&balls.radii) };
    let mut builder = TreeBuilder::new();
    let settings = BuildSettings { keep_indices: true, ..BuildSettings::default() };
    builder.build(&spheres, &settings);
    let mut tree = MovingTree::default();
    tree.build(&builder.tree().view(), &balls.displacements);
    for time in [-0.5, 0.1, 0.4] {
        let cut = CutSpheres::new(MovingSpheres::new(&tree), &region);
        assert!(compare(&balls, &cut, time, false) > 20);
    }
}

/// A ball of glass without its upper half: a ray from above crosses the face, and then the ball.
#[test]
fn light_passes_a_half_ball() {
    let mut builder = TreeBuilder::new();
    let spheres = Spheres { centers: &[Vec3::ZERO], radius: SphereRadius::Common(1.0) };
    builder.build(&spheres, &BuildSettings::default());
    let mut region = ConvexRegion::default();
    region.cut(DVec3::ZERO, DVec3::Z);
    let cut = CutSpheres::new(SphereSurface::new(builder.tree().view()), &region);
    for (height, direction, expected) in
        [(3.0, -1.0, [(3.0, 1.0), (4.0, -1.0)]), (-3.0, 1.0, [(2.0, -1.0), (3.0, 1.0)])]
    {
        let origin = Vec3::new(0.0, 0.0, height);
        let mut ray = Ray::new(origin, Vec3::new(0.0, 0.0, direction));
        for (t, z) in expected {
            let hit = cut.nearest(&ray).expect("a crossing");
            assert_eq!((hit.t, hit.normal), (t, Vec3::new(0.0, 0.0, z)));
            assert_eq!((hit.particle, hit.radius), (0, 1.0));
            ray.t_min = hit.t + hit.offset;
        }
        assert_eq!(cut.nearest(&ray), None);
        let mut rays = RayPacket::default();
        rays.push(&Ray::new(origin, ray.direction));
        let mut transmittance = splat(1.0);
        cut.transmittance(&rays, 1, &|_, _| 0.5, &mut transmittance);
        assert_eq!(transmittance[0], 0.25);
    }
    // Shadow rays from the face see no sphere
    let hit = cut.nearest(&Ray::new(Vec3::new(0.3, 0.2, 5.0), -Vec3::Z)).expect("the face");
    for i in 0..50 {
        let direction = vector(3 * i).with_z(unit(i) + 1e-3).normalize();
        let origin = hit.anchor + hit.offset * hit.normal;
        assert_eq!(cut.nearest(&Ray::new(origin, direction)), None);
    }
}

#[test]
fn without_planes_nothing_is_cut() {
    assert!(ConvexRegion::default().is_everywhere());
    let mut region = ConvexRegion::default();
    region.cut(DVec3::X, DVec3::X);
    region.cut(-DVec3::X, -DVec3::X);
    let span = |origin, direction| region.span(&Ray::new(origin, direction)).ends;
    assert_eq!(span(Vec3::ZERO, Vec3::X), [-1.0, 1.0]);
    assert_eq!(span(Vec3::X, Vec3::Y), [f32::NEG_INFINITY, f32::INFINITY]);
    let [enter, leave] = span(2.0 * Vec3::X, Vec3::Y);
    assert!(enter > leave);
}
