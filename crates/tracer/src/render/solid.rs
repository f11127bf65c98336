//! Test support: connected bodies with exact intersections in f64.

use glam::{DVec3, Vec3};

use spherule_surface::{Intersection, Shape, Side};
use spherule_tree::ray::Ray;

/// The shape of a body.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Body {
    Ball {
        center: Vec3,
        radius: f32,
    },
    /// The space between two heights.
    Slab {
        low: f32,
        high: f32,
    },
}

/// A connected body.
pub(crate) struct Solid {
    body: Body,
}

impl Solid {
    pub(crate) const fn ball(radius: f32) -> Self {
        Self::of(Body::Ball { center: Vec3::ZERO, radius })
    }

    pub(crate) const fn ball_at(center: Vec3, radius: f32) -> Self {
        Self::of(Body::Ball { center, radius })
    }

    pub(crate) const fn slab(low: f32, high: f32) -> Self {
        Self::of(Body::Slab { low, high })
    }

    const fn of(body: Body) -> Self {
        Self { body }
    }

    /// Distances where the ray enters and leaves; empty if it misses.
    fn inside(&self, ray: &Ray) -> [f64; 2] {
        let (origin, direction) = (ray.origin.as_dvec3(), ray.direction.as_dvec3().normalize());
        match self.body {
            Body::Ball { center, radius } => {
                let center = center.as_dvec3() - origin;
                let middle = center.dot(direction);
                let across = (center - middle * direction).length_squared();
                let half = (f64::from(radius).powi(2) - across).sqrt();
                // NaN if the ray misses.
                [middle - half, middle + half]
            }
            Body::Slab { low, high } => {
                let at = |height: f32| (f64::from(height) - origin.z) / direction.z;
                let (a, b) = (at(low), at(high));
                [a.min(b), a.max(b)]
            }
        }
    }

    #[expect(clippy::cast_possible_truncation, reason = "surfaces answer in f32")]
    fn hit(&self, ray: &Ray, t: f64) -> Intersection {
        // Move the point onto the surface, which the distance alone does not hit exactly
        let free: DVec3 = ray.origin.as_dvec3() + t * ray.direction.as_dvec3();
        let (point, normal) = match self.body {
            Body::Ball { center, radius } => {
                let normal = (free - center.as_dvec3()).normalize();
                (center.as_dvec3() + f64::from(radius) * normal, normal)
            }
            Body::Slab { low, high } => {
                let up = free.z > f64::from(0.5 * (low + high));
                let z = f64::from(if up { high } else { low });
                (free.with_z(z), if up { DVec3::Z } else { DVec3::NEG_Z })
            }
        };
        // Compute an offset above the rounding of the point
        let scale = point.abs().max_element().max(t) as f32;
        Intersection {
            t: t as f32,
            point: point.as_vec3(),
            normal: normal.as_vec3(),
            shading: normal.as_vec3(),
            lift: 0.0,
            radius: f32::INFINITY,
            particle: 0,
            offset: 1e-5 * scale.max(1.0),
            anchor: point.as_vec3(),
        }
    }
}

impl Shape for Solid {
    fn crossing(&self, ray: &Ray, side: Side) -> Option<Intersection> {
        let [enter, leave] = self.inside(ray);
        let [low, high] = [f64::from(ray.t_min), f64::from(ray.t_max)];
        let is_in = enter <= low && low < leave;
        let t = match side {
            Side::Outside if !is_in => enter,
            Side::Inside if is_in => leave,
            // Rounding has put the origin on the wrong side.
            Side::Outside | Side::Inside => low,
        };
        (t >= low && t < high).then(|| self.hit(ray, t))
    }

    fn is_connected(&self) -> bool {
        true
    }

    fn side_of(&self, point: Vec3) -> Side {
        let is_in = match self.body {
            Body::Ball { center, radius } => point.distance(center) < radius,
            Body::Slab { low, high } => point.z > low && point.z < high,
        };
        if is_in { Side::Inside } else { Side::Outside }
    }
}
