//! Intersection of a ray with one grain, in f64 and in the unit coordinates of its shape. There, a grain is centred at
//! the origin, its axes are those of the coordinates, and its semi-axes are 1 (those of caps for capsules).

use glam::DVec3;

use super::GrainMesh;

mod mesh;
mod quadric;
mod slab;
mod superquadric;

/// A body in unit coordinates.
#[derive(Clone, Copy)]
pub(super) enum Body<'a> {
    Ellipsoid,
    /// Exponents n1 and n2.
    Superquadric([f64; 2]),
    /// Half the length between the centres of the caps.
    Capsule(f64),
    Cylinder,
    Cuboid,
    Mesh(&'a GrainMesh),
}

/// A point where a ray crosses the surface of a body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Hit {
    /// Distance, in multiples of the direction.
    pub(super) t: f64,
    /// Outward vector perpendicular to the surface, in unit coordinates: the gradient of its equation.
    pub(super) gradient: DVec3,
    /// The same for the shading normal.
    pub(super) shading: DVec3,
}

impl Hit {
    fn new(t: f64, gradient: DVec3) -> Self {
        Self { t, gradient, shading: gradient }
    }
}

impl Body<'_> {
    /// The first point from distance `from` on at which the ray from `origin` along `direction`, which need not be a
    /// unit vector, crosses the surface.
    pub(super) fn first(&self, origin: DVec3, direction: DVec3, from: f64) -> Option<Hit> {
        // Start at the point closest to the centre, so that rounding does not grow with the distance of the origin
        let middle = -origin.dot(direction) / direction.length_squared();
        let (origin, from) = (origin + middle * direction, from - middle);
        // False for NaN
        let is_near = origin.length_squared() < self.radius_squared();
        if !is_near {
            return None;
        }
        let hit = match self {
            Self::Ellipsoid => {
                quadric::sphere(origin, direction).and_then(|ends| after(ends, from))
            }
            Self::Cylinder => {
                quadric::cylinder(origin, direction).and_then(|ends| after(ends, from))
            }
            Self::Capsule(half) => {
                quadric::capsule(origin, direction, *half).and_then(|ends| after(ends, from))
            }
            Self::Cuboid => slab::cuboid(origin, direction).and_then(|ends| after(ends, from)),
            Self::Superquadric(exponents) => {
                superquadric::first(origin, direction, *exponents, from)
            }
            Self::Mesh(mesh) => mesh::first(mesh, origin, direction, from),
        }?;
        Some(Hit { t: hit.t + middle, ..hit })
    }

    /// The squared radius of a sphere around the body, slightly larger.
    pub(super) fn radius_squared(&self) -> f64 {
        const LARGER: f64 = 1.001;
        LARGER
            * match self {
                Self::Ellipsoid => 1.0,
                Self::Cylinder => 2.0,
                Self::Capsule(half) => (1.0 + half) * (1.0 + half),
                Self::Superquadric(exponents) => superquadric::radius_squared(*exponents),
                Self::Cuboid => 3.0,
                Self::Mesh(mesh) => mesh.radius() * mesh.radius(),
            }
    }
}

impl Body<'_> {
    /// The middle of the body along `direction`, in unit coordinates, and how far it reaches to both sides: its support
    /// function.
    pub(super) fn extent(&self, direction: DVec3) -> [f64; 2] {
        let u = direction.abs();
        match self {
            Self::Ellipsoid => [0.0, u.length()],
            Self::Superquadric(exponents) => [0.0, superquadric::support(u, *exponents)],
            Self::Capsule(half) => [0.0, u.length() + half * u.z],
            Self::Cylinder => [0.0, u.truncate().length() + u.z],
            Self::Cuboid => [0.0, u.x + u.y + u.z],
            Self::Mesh(mesh) => {
                let [center, half] = mesh.extent();
                [direction.dot(center), u.dot(half)]
            }
        }
    }
}

/// The first of both ends of an interval that is not before `from`.
fn after(ends: [Hit; 2], from: f64) -> Option<Hit> {
    ends.into_iter().find(|hit| hit.t >= from)
}
