//! Intersection of a ray with a triangle.
//!
//! After Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection" (2013): the vertices are transformed so that
//! the ray is the z axis, and the signs of three edge functions decide. Two triangles compute the same function, up to
//! its sign, for the edge that they share. Everything is in f64, where the differences and products of f32 values
//! lose next to nothing.

use glam::{DVec3, Vec3};

use spherule_tree::ray::Ray;

/// A ray in the form that the test needs.
#[derive(Debug, Clone, Copy)]
pub(super) struct ShearedRay {
    origin: DVec3,
    /// The axes, with the largest component of the direction last.
    axes: [usize; 3],
    shear: DVec3,
}

/// An intersection with a triangle.
#[derive(Debug, Clone, Copy)]
pub(super) struct TriangleHit {
    /// Distance along the ray.
    pub(super) t: f64,
    /// Barycentric coordinates.
    pub(super) weights: [f64; 3],
    /// Whether the ray comes from the side on which the vertices are counterclockwise.
    pub(super) is_front: bool,
}

impl ShearedRay {
    pub(super) fn new(ray: &Ray) -> Self {
        let direction = ray.direction.as_dvec3();
        let size = direction.abs();
        // Choose the axes; the order of the others keeps the orientation of triangles
        let z = if size.x > size.y && size.x > size.z {
            0
        } else if size.y > size.z {
            1
        } else {
            2
        };
        let (mut x, mut y) = ((z + 1) % 3, (z + 2) % 3);
        if direction[z] < 0.0 {
            std::mem::swap(&mut x, &mut y);
        }
        // Shear the direction to the z axis (Woop, Benthin and Wald)
        let scale = 1.0 / direction[z];
        Self {
            origin: ray.origin.as_dvec3(),
            axes: [x, y, z],
            shear: DVec3::new(direction[x] * scale, direction[y] * scale, scale),
        }
    }

    /// `point` relative to the ray: its distance from the ray in two coordinates, and its position along the ray.
    fn transform(&self, point: Vec3) -> DVec3 {
        let [x, y, z] = self.axes;
        let p = point.as_dvec3() - self.origin;
        DVec3::new(p[x] - self.shear.x * p[z], p[y] - self.shear.y * p[z], self.shear.z * p[z])
    }

    /// The intersection of the line of the ray with a triangle, its edges included.
    pub(super) fn intersect(&self, corners: &[Vec3; 3]) -> Option<TriangleHit> {
        let [a, b, c] = corners.map(|corner| self.transform(corner));
        // Compute on which side of each edge the ray passes
        let u = c.x * b.y - c.y * b.x;
        let v = a.x * c.y - a.y * c.x;
        let w = b.x * a.y - b.y * a.x;
        let is_outside = (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0);
        let sum = u + v + w;
        if is_outside || sum == 0.0 {
            return None;
        }
        let weights = [u / sum, v / sum, w / sum];
        let t = weights[0] * a.z + weights[1] * b.z + weights[2] * c.z;
        Some(TriangleHit { t, weights, is_front: sum > 0.0 })
    }
}

/// The unit normal on the side from which the vertices are counterclockwise; None without an area.
pub(super) fn normal(corners: &[Vec3; 3]) -> Option<Vec3> {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3());
    let normal = (b - a).cross(c - a).try_normalize()?;
    Some(normal.as_vec3())
}
