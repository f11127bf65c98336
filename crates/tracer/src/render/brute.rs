//! Test support: spheres that are intersected one by one in f64.

use glam::{DVec3, Vec3};

use spherule_surface::{Intersection, Shape, Side};
use spherule_tree::math::{Lanes, lanes_in};
use spherule_tree::ray::{Ray, RayPacket};

/// A sphere.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ball {
    pub(crate) center: Vec3,
    pub(crate) radius: f32,
}

/// A [`Shape`] over a few spheres.
pub(crate) struct Balls(pub(crate) Vec<Ball>);

impl Balls {
    pub(crate) fn one(center: Vec3, radius: f32) -> Self {
        Self(vec![Ball { center, radius }])
    }

    /// All intersections of `ray` with spheres in its range.
    fn all<'a>(&'a self, ray: &'a Ray) -> impl Iterator<Item = Intersection> + 'a {
        self.0.iter().zip(0_u32..).flat_map(move |(ball, index)| {
            ball.roots(ray).into_iter().flatten().filter_map(move |t| ball.hit(ray, t, index))
        })
    }
}

impl Ball {
    /// Distances of entry and exit.
    fn roots(&self, ray: &Ray) -> Option<[f64; 2]> {
        let center = self.center.as_dvec3() - ray.origin.as_dvec3();
        let direction = ray.direction.as_dvec3();
        let direction = direction / direction.length();
        let middle = center.dot(direction);
        let across = (center - middle * direction).length_squared();
        let half2 = f64::from(self.radius).powi(2) - across;
        (half2 > 0.0).then(|| [middle - half2.sqrt(), middle + half2.sqrt()])
    }

    #[expect(clippy::cast_possible_truncation, reason = "surfaces answer in f32")]
    fn hit(&self, ray: &Ray, t: f64, particle: u32) -> Option<Intersection> {
        let in_range = t >= f64::from(ray.t_min) && t < f64::from(ray.t_max);
        in_range.then(|| {
            let free: DVec3 = ray.origin.as_dvec3() + t * ray.direction.as_dvec3();
            let normal = (free - self.center.as_dvec3()).normalize();
            let point = self.center.as_dvec3() + f64::from(self.radius) * normal;
            let scale = point.abs().max_element().max(t) as f32;
            Intersection {
                t: t as f32,
                point: point.as_vec3(),
                normal: normal.as_vec3(),
                shading: normal.as_vec3(),
                lift: 0.0,
                radius: self.radius,
                particle,
                anchor: point.as_vec3(),
                offset: (1e-4 * self.radius).max(8.0 * f32::EPSILON * scale),
            }
        })
    }
}

impl Shape for Balls {
    fn crossing(&self, ray: &Ray, _side: Side) -> Option<Intersection> {
        self.all(ray).reduce(|best, hit| if hit.t < best.t { hit } else { best })
    }

    fn transmittance(
        &self,
        rays: &RayPacket,
        lanes: u32,
        fresnel_transmittance: &dyn Fn(f32, u32) -> f32,
        transmittance: &mut Lanes,
    ) {
        for lane in lanes_in(lanes) {
            let ray = rays.ray(lane);
            let cosine = |hit: Intersection| hit.normal.dot(ray.direction).abs();
            transmittance[lane] = self
                .all(&ray)
                .map(|hit| fresnel_transmittance(cosine(hit), hit.particle))
                .product();
        }
    }
}
