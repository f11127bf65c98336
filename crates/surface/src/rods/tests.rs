//! Rods against definitions of their bodies in f64 that share nothing with the code: a capsule is the union of all
//! spheres between its ends, a cylinder or cone the points near its axis. The distance to such a body is a convex
//! function along a ray, so that its interval is found by halving.

use glam::{DVec3, Vec3};

use super::*;
use crate::{Intersections, MaterialId, Shape, Side};
use spherule_tree::accel::Coherence;
use spherule_tree::ray::{Ray, RayPacket};

/// Numbers in -1..1.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1 << 23) as f32 - 1.0
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.next(), self.next(), self.next())
    }

    fn rod(&mut self, center: Vec3, length: f32, radius: f32) -> Rod {
        let mut end = || center + length * self.vector();
        let ends = [end(), end()];
        let mut size = || radius * (0.5 + 0.5 * self.next());
        Rod { ends, radii: [size(), size()], particles: [1, 2] }
    }
}

/// The minimum of a convex function and where it is.
fn minimum(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> (f64, f64) {
    for _ in 0..60 {
        let third = (high - low) / 3.0;
        if f(low + third) < f(high - third) { high -= third } else { low += third }
    }
    let middle = 0.5 * (low + high);
    (middle, f(middle))
}

/// The root of a function that changes its sign between `outside`, where it is positive, and `inside`.
fn root(f: impl Fn(f64) -> f64, mut outside: f64, mut inside: f64) -> f64 {
    for _ in 0..60 {
        let middle = 0.5 * (outside + inside);
        if f(middle) > 0.0 { outside = middle } else { inside = middle }
    }
    0.5 * (outside + inside)
}

/// Up to two crossings of a ray within `range`, and the least distance to the body along it: a ray that just touches
/// it may be seen either way.
fn brute(rod: &Rod, caps: Caps, ray: &Ray, range: [f64; 2]) -> ([Option<f64>; 2], f64) {
    let [a, b] = rod.ends.map(double);
    let [ra, rb] = rod.radii.map(f64::from);
    let (o, d) = (double(ray.origin), double(ray.direction));
    let axis = b - a;
    let length = axis.length();
    let height = |p: DVec3| (p - a).dot(axis) / length;
    let beside = |p: DVec3| {
        let s = height(p);
        (p - a - s * axis / length).length() - (ra + (rb - ra) * s / length)
    };
    let distance = |t: f64| {
        let p = o + t * d;
        match caps {
            Caps::Round => {
                minimum(|h| (p - a - h * axis).length() - ra - h * (rb - ra), 0.0, 1.0).1
            }
            Caps::Flat => beside(p).max(-height(p)).max(height(p) - length),
            Caps::Open => beside(p),
        }
    };
    // An open rod is only there between the planes of its ends
    let range = match caps {
        Caps::Open => {
            let rise = d.dot(axis) / length;
            let planes = [-height(o) / rise, (length - height(o)) / rise];
            let [low, high] = [planes[0].min(planes[1]), planes[0].max(planes[1])];
            [range[0].max(low), range[1].min(high)]
        }
        Caps::Flat | Caps::Round => range,
    };
    if range[0] >= range[1] {
        return ([None; 2], 1.0);
    }
    let (middle, least) = minimum(distance, range[0], range[1]);
    if least > 0.0 {
        return ([None; 2], least);
    }
    let end = |end: f64| (distance(end) > 0.0).then(|| root(distance, end, middle));
    (range.map(end), least)
}

/// Compares rods around `center` with brute force.
#[track_caller]
fn compare(caps: Caps, center: Vec3, radius: f32, seed: u64) {
    let mut random = Random(seed);
    let mut hits = 0;
    for _ in 0..200 {
        let rod = random.rod(center, 1.0, radius);
        let tree = RodTree::new(vec![rod], caps);
        let surface = RodSurface::new(&tree, MaterialId::PARTICLES);
        // Aim at a point near the rod, from far away or from within its box
        let part = 0.5 + 0.6 * random.next();
        let target = rod.ends[0] + part * (rod.ends[1] - rod.ends[0]) + radius * random.vector();
        let distance = if random.next() > 0.0 { 8.0 } else { 0.7 };
        let origin = target + distance * random.vector();
        let Some(direction) = (target - origin).try_normalize() else {
            continue;
        };
        let ray = Ray::new(origin, direction);
        let (expected, least) = brute(&rod, caps, &ray, [-30.0, 30.0]);
        if least.abs() < 1e-9 {
            continue;
        }
        let expected = expected.into_iter().flatten().find(|t| *t >= 0.0);
        let found = surface.crossing(&ray, Side::Outside);
        let exact = expected.filter(|t| *t > 1e-6);
        assert_eq!(found.is_some(), expected.is_some(), "{caps:?} {rod:?} {ray:?} {expected:?}");
        let Some((hit, t)) = found.zip(exact) else {
            continue;
        };
        hits += 1;
        // Rounding to single precision is the only error
        let rounding = f64::from(f32::EPSILON);
        assert!((f64::from(hit.t) - t).abs() <= rounding * t, "{caps:?} {rod:?} {ray:?} {t}");
        let point = double(ray.origin) + t * double(ray.direction);
        let near = rounding * (point.abs().max_element() + 1e-3);
        assert!((double(hit.point) - point).abs().max_element() <= near);
        // The point is on the surface: a step along the normal leaves the body, and back enters it
        let step = 1e-4 * f64::from(radius);
        let outside = probe(&rod, caps, point + step * double(hit.normal));
        let inside = probe(&rod, caps, point - step * double(hit.normal));
        assert!((outside - step).abs() < 0.2 * step, "{caps:?} {rod:?}: {outside} {step}");
        assert!(inside < 0.0 && (hit.normal.length() - 1.0).abs() < 1e-6);
    }
    assert!(hits > 50, "{caps:?}: {hits} hits");
}

/// Distance of a point close to the surface from the body.
fn probe(rod: &Rod, caps: Caps, point: DVec3) -> f64 {
    let [a, b] = rod.ends.map(double);
    let [ra, rb] = rod.radii.map(f64::from);
    let axis = (b - a).normalize();
    let length = (b - a).length();
    if caps == Caps::Round {
        let sphere = |h: f64| (point - a - h * (b - a)).length() - ra - h * (rb - ra);
        return minimum(sphere, 0.0, 1.0).1;
    }
    let s = (point - a).dot(axis);
    let slope = (rb - ra) / length;
    // Across the side, whose distance is shorter than that across the axis
    let side = ((point - a - s * axis).length() - ra - slope * s) / (1.0 + slope * slope).sqrt();
    match caps {
        Caps::Open => side,
        _ => side.max(-s).max(s - length),
    }
}

// 1,800 rods: brute force searches for the interval of each by halving, in f64.
#[test]
fn one_rod_is_that_of_brute_force() {
    for (caps, seed) in [(Caps::Round, 1), (Caps::Flat, 2), (Caps::Open, 3)] {
        compare(caps, Vec3::ZERO, 0.3, seed);
        compare(caps, Vec3::ZERO, 0.004, seed + 10);
        // Far from the origin, where coordinates have steps of 1/128
        compare(caps, Vec3::new(7e4, -9e4, 5e4), 0.3, seed + 20);
    }
}

/// The crossing of the ray from `origin` along `direction`: distance and normal.
fn cross(rod: Rod, caps: Caps, origin: [f32; 3], direction: [f32; 3]) -> Option<(f32, Vec3)> {
    let tree = RodTree::new(vec![rod], caps);
    let ray = Ray::new(origin.into(), direction.into());
    let hit = RodSurface::new(&tree, MaterialId::GROUND).crossing(&ray, Side::Outside);
    hit.map(|hit| (hit.t, hit.normal))
}

#[test]
fn special_rods_are_those_computed_by_hand() {
    let pipe = Rod::line([Vec3::ZERO, 2.0 * Vec3::Z], 1.0);
    let cone = Rod { radii: [1.0, 0.0], ..pipe };
    let ball = Rod { ends: [Vec3::ZERO; 2], radii: [1.0, 0.5], ..pipe };
    let (x, z) = ([-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]);
    // Along the axis: the cap, nothing, the sphere
    assert_eq!(cross(pipe, Caps::Flat, [0.0, 0.0, 5.0], z), Some((3.0, Vec3::Z)));
    assert_eq!(cross(pipe, Caps::Open, [0.0, 0.0, 5.0], z), None);
    assert_eq!(cross(pipe, Caps::Round, [0.0, 0.0, 5.0], z), Some((2.0, Vec3::Z)));
    // From the side, and from inside
    for caps in [Caps::Flat, Caps::Open, Caps::Round] {
        assert_eq!(cross(pipe, caps, [5.0, 0.0, 1.0], x), Some((4.0, Vec3::X)));
        assert_eq!(cross(pipe, caps, [0.0, 0.0, 1.0], x), Some((1.0, Vec3::NEG_X)));
        assert_eq!(cross(pipe, caps, [5.0, 0.0, 3.5], x), None);
    }
    // A cone of slope 1/2: at half its height, its radius is 1/2
    let (t, normal) = cross(cone, Caps::Flat, [5.0, 0.0, 1.0], x).expect("the side");
    assert_eq!(t, 4.5);
    assert!((normal - Vec3::new(2.0, 0.0, 1.0).normalize()).length() < 1e-7);
    let (t, _) = cross(cone, Caps::Flat, [0.0, 0.0, 5.0], z).expect("the apex");
    assert_eq!(t, 3.0);
    assert_eq!(cross(cone, Caps::Flat, [0.5, 0.0, 5.0], z).map(|(t, _)| t), Some(4.0));
    // One sphere contains the other
    assert_eq!(cross(ball, Caps::Round, [5.0, 0.0, 0.0], x), Some((4.0, Vec3::X)));
    assert_eq!(cross(ball, Caps::Flat, [5.0, 0.0, 0.0], x), None);
}

#[test]
fn impossible_rods_are_left_out() {
    let good = Rod::line([Vec3::ZERO, Vec3::Z], 0.1);
    let mut bad = [good; 5];
    bad[0].ends[1].x = f32::NAN;
    bad[1].radii = [-1.0, 0.1];
    bad[2].radii = [0.0; 2];
    bad[3].radii[1] = f32::INFINITY;
    bad[4].ends[1] = Vec3::ZERO;
    assert!(RodTree::new(bad.to_vec(), Caps::Flat).is_empty());
    assert_eq!(RodTree::new(bad.to_vec(), Caps::Round).len(), 1);
    let tree = RodTree::new(Vec::new(), Caps::Round);
    assert_eq!(tree.bounds(), None);
    let ray = Ray::new(Vec3::ZERO, Vec3::Z);
    assert!(RodSurface::new(&tree, MaterialId::GROUND).nearest(&ray).is_none());
    // Rays that are not finite find nothing
    let tree = RodTree::new(vec![good], Caps::Round);
    for ray in
        [Ray::new(Vec3::splat(f32::NAN), Vec3::Z), Ray::new(Vec3::Z, Vec3::splat(f32::INFINITY))]
    {
        assert!(RodSurface::new(&tree, MaterialId::GROUND).nearest(&ray).is_none());
    }
}

#[test]
fn many_rods_are_those_of_brute_force() {
    let mut random = Random(5);
    let rods: Vec<Rod> = (0..400)
        .map(|number| {
            let center = random.vector();
            Rod { particles: [2 * number, 2 * number + 1], ..random.rod(center, 0.2, 0.03) }
        })
        // Each rod twice: the first one wins
        .flat_map(|rod| [rod; 2])
        .collect();
    let tree = RodTree::new(rods, Caps::Round);
    let surface = RodSurface::new(&tree, MaterialId::PARTICLES);
    let mut hits = 0;
    for _ in 0..60 {
        let mut packet = RayPacket::default();
        let mut expected = Vec::new();
        for _ in 0..16 {
            let origin = 2.0 * random.vector();
            let ray = Ray {
                t_max: 3.0,
                ..Ray::new(origin, (0.6 * random.vector() - origin).normalize())
            };
            packet.push(&ray);
            let all = (0..800).filter_map(|rod| {
                let body = tree.body(rod);
                let mut crossings =
                    body.crossings(double(ray.origin), double(ray.direction)).into_iter().flatten();
                let hit = crossings.find(|hit| hit.t >= 0.0 && hit.t < 3.0)?;
                let point = double(ray.origin) + hit.t * double(ray.direction);
                let half = u32::from(body.half_of(point) == 1);
                Some((hit.t, rod, 2 * (rod / 2) + half))
            });
            expected.push(all.min_by(|a, b| (a.0, a.1).partial_cmp(&(b.0, b.1)).expect("numbers")));
        }
        let before = packet;
        let mut found = Intersections::default();
        surface.intersect(&mut packet, Coherence::Incoherent, 0, &mut found);
        let occluded = surface.occluded(&before, Coherence::Incoherent, 0xffff);
        assert_eq!(occluded, found.mask);
        for (hit, expected) in found.all(16).into_iter().zip(expected) {
            let found = hit.map(|hit| (f64::from(hit.t), hit.particle));
            assert_eq!(found.map(|(_, p)| p), expected.map(|(_, _, particle)| particle));
            if let (Some((t, _)), Some((exact, ..))) = (found, expected) {
                hits += 1;
                assert!((t - exact).abs() <= f64::from(f32::EPSILON) * exact);
            }
        }
    }
    assert!(hits > 150, "{hits} hits");
}

#[test]
fn the_memory_of_many_rods_is_predicted() {
    for count in [1_000_u32, 20_000] {
        // Short rods in all directions, as of arrows
        let mut random = Random(5);
        let rods = (0..count).map(|_| {
            let start = 100.0 * random.vector();
            Rod::line([start, start + random.vector()], 0.1)
        });
        let colors = vec![Vec3::ONE; count as usize];
        let tree = RodTree::new(rods.collect(), Caps::Flat).with_colors(colors);
        let [_, predicted] = RodTree::predicted_bytes(count.into(), count.into());
        let bytes = tree.bytes() as u64;
        assert!((predicted / 3..=predicted).contains(&bytes), "{bytes} of {predicted}");
    }
}
