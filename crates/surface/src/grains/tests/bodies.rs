//! Single grains against their definitions.

use glam::{DVec3, Vec3};

use super::{
    EXPONENTS, GrainShape, GrainSurface, Heap, Implicit, Random, shapes, superquadric_of, towards,
};
use crate::spheres::SphereSurface;
use crate::{Intersection, Shape, Side};
use spherule_tree::accel::{BuildSettings, SphereRadius, Spheres, TreeBuilder};
use spherule_tree::ray::Ray;

/// The first point in `range` where `f` is 0, and its minimum along the ray: a ray that just touches a body may be seen
/// either way. Along a line, the definitions of bodies are convex functions.
fn brute(f: impl Fn(f64) -> f64, range: [f64; 2]) -> (Option<f64>, f64) {
    let [mut low, mut high] = range;
    for _ in 0..120 {
        let third = (high - low) / 3.0;
        if f(low + third) < f(high - third) { high -= third } else { low += third }
    }
    let middle = 0.5 * (low + high);
    let least = f(middle);
    if least > 0.0 {
        return (None, least);
    }
    // From the start to the minimum if it starts outside, else from there to the end
    let starts_outside = f(range[0]) > 0.0;
    let [mut low, mut high] = if starts_outside { [range[0], middle] } else { [middle, range[1]] };
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if (f(middle) > 0.0) == starts_outside { low = middle } else { high = middle }
    }
    (Some(low), least)
}

/// Compares the intersection of a ray with a grain to its definition `f`.
#[track_caller]
fn check(
    name: &str,
    f: impl Fn(DVec3) -> f64,
    ray: &Ray,
    hit: Option<Intersection>,
    size: f64,
) -> bool {
    let at = |t: f64| ray.origin.as_dvec3() + t * ray.direction.as_dvec3();
    let (expected, least) = brute(|t| f(at(t)), [0.0, 20.0]);
    match (expected, hit) {
        (Some(t), Some(hit)) => {
            let rounding = 2e-6 * (ray.origin.abs().max_element() + 1.0) as f64;
            // Where a ray touches the surface, distances are less exact
            let cosine = hit.normal.as_dvec3().dot(ray.direction.as_dvec3()).abs().max(1e-3);
            let error = (f64::from(hit.t) - t).abs() * cosine;
            assert!(error < 3.0 * rounding, "{name} {ray:?}: {} instead of {t}", hit.t);
            // The point is on the surface, and the normal is the gradient
            let point = hit.point.as_dvec3();
            assert!(f(point).abs() * size < rounding, "{name} {ray:?}: {}", f(point));
            let step = 1e-5 * size;
            let derivative = |axis: usize| {
                let offset = DVec3::AXES[axis] * step;
                f(point + offset) - f(point - offset)
            };
            let gradient = DVec3::new(derivative(0), derivative(1), derivative(2)).normalize();
            let normal = hit.normal.as_dvec3();
            assert!((normal.length() - 1.0).abs() < 1e-6);
            // At edges, differences are not the gradient
            let is_edge =
                f(point + gradient * step) - f(point) < 0.9 * step * slope(&f, point, normal);
            assert!(is_edge || gradient.dot(normal) > 0.999, "{name}: {normal} {gradient}");
            // The offset leaves the grain
            let offset = f64::from(hit.offset);
            assert!(f(point + offset * normal) > 0.0 && f(point - offset * normal) < 0.0, "{name}");
            true
        }
        (None, None) => false,
        _ => {
            assert!(least.abs() < 2e-5, "{name} {ray:?}: {expected:?} {hit:?} {least}");
            false
        }
    }
}

/// The increase of `f` per length along `normal`.
fn slope(f: impl Fn(DVec3) -> f64, point: DVec3, normal: DVec3) -> f64 {
    let step = 1e-6;
    (f(point + step * normal) - f(point)) / step
}

/// Checks single grains around `center` with rays from outside and from inside.
#[track_caller]
fn compare(shape: &GrainShape, implicit: Implicit, center: Vec3, sizes: [f32; 2], seed: u64) {
    let mut random = Random(seed);
    let (mut hits, count) = (0, 120);
    for number in 0..count {
        let heap = Heap::random(1, center, 0.0, sizes, seed + 1000 * number);
        let tree = heap.tree(shape.clone());
        let semi_axes = Vec3::from_array(heap.sizes[0]).as_dvec3();
        let f = |point: DVec3| implicit(heap.own(0, point), semi_axes);
        let target = center + 0.9 * sizes[1] * random.vector();
        let origin = if number % 4 == 0 { target } else { center + 5.0 * random.vector() };
        let aim = center + sizes[1] * random.vector();
        let Some(direction) = (aim - origin).try_normalize() else { continue };
        let ray = Ray::new(origin, direction);
        let hit = GrainSurface::new(&tree).crossing(&ray, Side::Outside);
        hits += u32::from(check(&format!("{shape:?}"), f, &ray, hit, semi_axes.min_element()));
    }
    assert!(hits > 40, "{shape:?}: {hits}");
}

#[test]
fn grains_are_those_of_their_equations() {
    for (number, (shape, implicit)) in (0..).zip(shapes()) {
        compare(&shape, implicit, Vec3::ZERO, [0.4, 1.0], 7 + number);
        // Thin ones
        compare(&shape, implicit, Vec3::new(1.0, -2.0, 0.5), [0.05, 1.0], 70 + number);
    }
}

#[test]
fn superquadrics_of_all_exponents_are_those_of_their_equation() {
    let all =
        [[2.0, 2.0], [1.0, 1.0], [1.0, 8.0], [1.5, 2.0], [8.0, 1.0], [20.0, 20.0], [200.0, 3.0]];
    for (seed, exponents) in (500..).zip(all) {
        let mut random = Random(seed);
        for number in 0..60 {
            let mut heap = Heap::random(1, Vec3::ZERO, 0.0, [0.5, 1.0], seed + number);
            heap.exponents = vec![exponents];
            let tree = heap.tree(GrainShape::Superquadric { exponents: EXPONENTS });
            let axes = Vec3::from_array(heap.sizes[0]).as_dvec3();
            let f = |point: DVec3| superquadric_of(heap.own(0, point) / axes, exponents);
            let ray = towards(3.0 * random.vector(), random.vector());
            let hit = GrainSurface::new(&tree).crossing(&ray, Side::Outside);
            let at = |t: f64| ray.origin.as_dvec3() + t * ray.direction.as_dvec3();
            let (expected, least) = brute(|t| f(at(t)), [0.0, 9.0]);
            let is_same = match (expected, hit) {
                (Some(t), Some(hit)) => {
                    f(hit.point.as_dvec3()).abs() < 3e-6 && {
                        let cosine =
                            hit.normal.as_dvec3().dot(ray.direction.as_dvec3()).abs().max(1e-3);
                        (f64::from(hit.t) - t).abs() * cosine < 1e-5
                    }
                }
                (None, None) => true,
                _ => least.abs() < 1e-4,
            };
            assert!(is_same, "{exponents:?} {ray:?} {expected:?} {hit:?} {least}");
        }
    }
}

#[test]
fn sharp_corners_are_not_missed() {
    // Rays that cut off the outermost part of a corner, which is 1e-3 wide
    let mut heap = Heap::random(1, Vec3::ZERO, 0.0, [1.0, 1.0], 1);
    heap.orientations = vec![[0.0, 0.0, 0.0, 1.0]];
    heap.exponents = vec![[1e4, 1e4]];
    let tree = heap.tree(GrainShape::Superquadric { exponents: [2.0; 2] });
    let surface = GrainSurface::new(&tree);
    for part in 1..100 {
        let depth = 1e-2 * part as f32;
        let target = Vec3::splat(1.0 - depth);
        let ray = Ray::new(
            target - 3.0 * Vec3::new(1.0, -1.0, 0.0).normalize(),
            Vec3::new(1.0, -1.0, 0.0).normalize(),
        );
        let hit = surface.crossing(&ray, Side::Outside).expect("the corner");
        let expected = 3.0 - depth * 2.0_f32.sqrt();
        assert!((hit.t - expected).abs() < 2e-3, "{depth}: {} {expected}", hit.t);
    }
}

#[test]
fn equal_semi_axes_are_spheres() {
    let mut heap = Heap::random(300, Vec3::new(3.0, 0.0, -4.0), 1.0, [0.05, 0.2], 5);
    let radii: Vec<f32> = heap.sizes.iter().map(|size| size[0]).collect();
    heap.sizes = radii.iter().map(|radius| [*radius; 3]).collect();
    let tree = heap.tree(GrainShape::Ellipsoid);
    let mut builder = TreeBuilder::new();
    let spheres = Spheres { centers: &heap.centers, radius: SphereRadius::Each(&radii) };
    builder.build(&spheres, &BuildSettings::default());
    let spheres = SphereSurface::new(builder.tree().view());
    let grains = GrainSurface::new(&tree);
    let mut random = Random(9);
    let mut hits = 0;
    for _ in 0..2000 {
        let center = Vec3::new(3.0, 0.0, -4.0);
        let ray = towards(center + 3.0 * random.vector(), center + random.vector());
        let both = [&spheres as &dyn Shape, &grains].map(|s| s.crossing(&ray, Side::Outside));
        let [Some(a), Some(b)] = both else {
            let touched =
                both.into_iter().flatten().all(|hit| hit.normal.dot(ray.direction).abs() < 2e-2);
            assert!(touched, "{ray:?} {both:?}");
            continue;
        };
        hits += 1;
        assert_eq!(a.particle, b.particle);
        let cosine = a.normal.dot(ray.direction).abs().max(1e-3);
        assert!((a.t - b.t).abs() * cosine < 2e-6 && (a.point - b.point).length() * cosine < 3e-6);
        assert!((a.normal - b.normal).length() * cosine < 1e-4);
    }
    assert!(hits > 800, "{hits}");
}

/// Distances and particles of both shapes along many rays are equal up to `limit`.
#[track_caller]
fn assert_alike(heaps: [&Heap; 2], shapes: [GrainShape; 2], limit: f32, max_differing: u32) {
    let trees = [heaps[0].tree(shapes[0].clone()), heaps[1].tree(shapes[1].clone())];
    let surfaces = [GrainSurface::new(&trees[0]), GrainSurface::new(&trees[1])];
    let mut random = Random(3);
    let (mut hits, mut differing) = (0, 0);
    for _ in 0..1000 {
        let ray = towards(4.0 * random.vector(), random.vector());
        let [a, b] = surfaces.map(|surface| surface.crossing(&ray, Side::Outside));
        match (a, b) {
            (Some(a), Some(b)) if a.particle == b.particle => {
                hits += 1;
                let cosine = a.normal.dot(ray.direction).abs().max(1e-3);
                assert!((a.t - b.t).abs() * cosine < limit, "{ray:?} {} {}", a.t, b.t);
            }
            (None, None) => {}
            _ => differing += 1,
        }
    }
    assert!(hits > 300 && differing <= max_differing, "{hits} {differing}");
}

#[test]
fn shapes_agree_where_they_are_the_same() {
    let heap = Heap::random(20, Vec3::ZERO, 1.0, [0.2, 0.5], 11);
    let superquadric = |n| GrainShape::Superquadric { exponents: [n; 2] };
    assert_alike([&heap; 2], [GrainShape::Ellipsoid, superquadric(2.0)], 4e-6, 2);
    assert_alike([&heap; 2], [GrainShape::Cuboid, superquadric(1000.0)], 2e-3, 5);
    // The extent of a cuboid along its axes is that of exponents of 20, but corners are round
    assert_alike([&heap; 2], [GrainShape::Cuboid, superquadric(20.0)], 0.08, 50);
    // A capsule as long as it is thick, and a short one
    let mut round = heap.clone();
    for size in &mut round.sizes {
        size[2] = 0.9 * size[0];
    }
    assert_alike([&round; 2], [GrainShape::Ellipsoid, GrainShape::Capsule], 4e-6, 2);
}

#[test]
fn rays_leave_the_grain_that_they_start_on() {
    for (number, (shape, _)) in (0..).zip(shapes()) {
        let mut random = Random(90 + number);
        // Thin grains far from the origin, and one that makes the tree large
        let mut heap = Heap::random(40, Vec3::new(50.0, -20.0, 30.0), 4.0, [0.02, 0.5], 81);
        let far = Heap::random(1, Vec3::ZERO, 0.0, [0.5, 0.5], 3);
        heap.centers.extend(far.centers);
        heap.orientations.extend(far.orientations);
        heap.sizes.extend(far.sizes);
        let tree = heap.tree(shape.clone());
        let surface = GrainSurface::new(&tree);
        let mut starts = 0;
        for _ in 0..2000 {
            let target = heap.centers[starts % 40] + 0.1 * random.vector();
            let ray = towards(target + 6.0 * random.vector(), target);
            let Some(hit) = surface.crossing(&ray, Side::Outside) else { continue };
            starts += 1;
            let direction = random.vector().normalize();
            let outward = direction * direction.dot(hit.normal).signum();
            let next = Ray::new(hit.anchor + hit.offset * hit.normal, outward);
            let again = surface.crossing(&next, Side::Outside);
            assert!(again.is_none_or(|next| next.particle != hit.particle), "{shape:?} {hit:?}");
            // Inwards, the ray leaves through the other side, or enters a grain that overlaps
            let next = Ray::new(hit.anchor - hit.offset * hit.normal, -outward);
            let inside = surface.crossing(&next, Side::Outside);
            let is_through = inside.is_some_and(|next| {
                next.particle != hit.particle || next.normal.dot(-outward) > -1e-3
            });
            assert!(is_through || outward.dot(hit.normal) < 0.05, "{shape:?} {hit:?} {inside:?}");
        }
        assert!(starts > 300, "{shape:?}: {starts}");
    }
}
