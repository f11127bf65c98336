//! The convex hull of a few points.
//!
//! Points are added one after another; each one replaces the triangles that it is in front of by a fan from the edges
//! around them to itself (the incremental algorithm; de Berg et al., *Computational Geometry*, chapter 11). The time
//! grows with the square of the number of points, which are few.

use glam::{DVec3, Vec3};

/// Distance from a plane that counts as rounding, as a fraction of the size of all points.
const TOLERANCE: f64 = 1e-7;

/// The triangles of the convex hull, counterclockwise from outside; None if all points are in a plane.
pub(super) fn triangles(points: &[Vec3]) -> Option<Vec<[u32; 3]>> {
    let points: Vec<DVec3> = points.iter().map(|point| point.as_dvec3()).collect();
    let tolerance = TOLERANCE * size(&points);
    let mut faces = tetrahedron(&points, tolerance)?;
    for index in 0..spherule_tree::order::index_u32(points.len()) {
        add(&points, &mut faces, index, tolerance);
    }
    Some(faces)
}

/// The largest extent of the points along an axis.
fn size(points: &[DVec3]) -> f64 {
    let nothing = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    let [min, max] = points.iter().fold(nothing, |all, p| [all[0].min(*p), all[1].max(*p)]);
    (max - min).max_element().max(0.0)
}

/// The signed distance of `point` from the plane of a triangle.
fn height(points: &[DVec3], face: [u32; 3], point: DVec3) -> f64 {
    let [a, b, c] = face.map(|vertex| points[vertex as usize]);
    (b - a).cross(c - a).normalize_or_zero().dot(point - a)
}

/// The index of the point with the greatest `measure`, if that is above `tolerance`.
fn farthest(points: &[DVec3], tolerance: f64, measure: impl Fn(DVec3) -> f64) -> Option<u32> {
    let all = (0..).zip(points).map(|(index, point)| (measure(*point), index));
    let best = all.reduce(|a, b| if b.0 > a.0 { b } else { a })?;
    (best.0 > tolerance).then_some(best.1)
}

/// Four points far from each other.
fn tetrahedron(points: &[DVec3], tolerance: f64) -> Option<Vec<[u32; 3]>> {
    let at = |index: u32| points[index as usize];
    let a = 0;
    let first = *points.first()?;
    let b = farthest(points, tolerance, |p| p.distance(first))?;
    let axis = (at(b) - first).normalize_or_zero();
    let c = farthest(points, tolerance, |p| (p - first).cross(axis).length())?;
    let d = farthest(points, tolerance, |p| height(points, [a, b, c], p).abs())?;
    // Turn the first triangle away from the fourth point
    let [b, c] = if height(points, [a, b, c], at(d)) > 0.0 { [c, b] } else { [b, c] };
    Some(vec![[a, b, c], [a, d, b], [b, d, c], [c, d, a]])
}

/// Adds a point to the hull, unless it is inside.
fn add(points: &[DVec3], faces: &mut Vec<[u32; 3]>, index: u32, tolerance: f64) {
    let point = points[index as usize];
    let is_visible = |face: &[u32; 3]| height(points, *face, point) > tolerance;
    let visible: Vec<[u32; 3]> = faces.iter().copied().filter(|face| is_visible(face)).collect();
    if visible.is_empty() {
        return;
    }
    // Find the edges whose other triangle is not visible
    let edges = |[a, b, c]: &[u32; 3]| [[*a, *b], [*b, *c], [*c, *a]];
    let all: Vec<[u32; 2]> = visible.iter().flat_map(edges).collect();
    let rim = all.iter().filter(|[a, b]| !all.contains(&[*b, *a]));
    // Replace the visible triangles by a fan
    faces.retain(|face| !is_visible(face));
    faces.extend(rim.map(|[a, b]| [*a, *b, index]));
}
