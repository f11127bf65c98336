//! Grains against definitions of their bodies in f64 that share nothing with the code.

use glam::{DQuat, DVec3, Vec3};

use super::*;
use spherule_tree::ray::{Ray, RayPacket};

mod bodies;
mod input;
mod meshes;
mod motion;
mod packets;

/// Numbers in -1..1.
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn next(&mut self) -> f32 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1 << 23) as f32 - 1.0
    }

    pub(super) fn vector(&mut self) -> Vec3 {
        Vec3::new(self.next(), self.next(), self.next())
    }

    /// A unit quaternion x, y, z, w.
    pub(super) fn orientation(&mut self) -> [f32; 4] {
        loop {
            let q = [self.next(), self.next(), self.next(), self.next()];
            let length = q.iter().map(|c| c * c).sum::<f32>().sqrt();
            if (0.1..1.0).contains(&length) {
                return q.map(|c| c / length);
            }
        }
    }
}

/// Grains in arrays.
#[derive(Clone, Default)]
pub(super) struct Heap {
    pub(super) centers: Vec<Vec3>,
    pub(super) orientations: Vec<[f32; 4]>,
    pub(super) sizes: Vec<[f32; 3]>,
    pub(super) exponents: Vec<[f32; 2]>,
    pub(super) displacements: Vec<Vec3>,
    pub(super) rotations: Vec<Vec3>,
}

impl Heap {
    /// `count` grains with centres within `spread` around `center`, whose semi-axes are from `size[0]` to `size[1]`.
    pub(super) fn random(
        count: usize,
        center: Vec3,
        spread: f32,
        size: [f32; 2],
        seed: u64,
    ) -> Self {
        let mut random = Random(seed);
        let mut heap = Self::default();
        for _ in 0..count {
            heap.centers.push(center + spread * random.vector());
            heap.orientations.push(random.orientation());
            let mut axis = || size[0] + (0.5 + 0.5 * random.next()) * (size[1] - size[0]);
            heap.sizes.push([axis(), axis(), axis()]);
        }
        heap
    }

    /// Lets the grains move.
    pub(super) fn in_motion(mut self, distance: f32, angle: f32, seed: u64) -> Self {
        let mut random = Random(seed);
        for _ in 0..self.centers.len() {
            self.displacements.push(distance * random.vector());
            self.rotations.push(angle * random.vector());
        }
        self
    }

    pub(super) fn tree(&self, shape: GrainShape) -> GrainTree {
        let motion = (!self.displacements.is_empty()).then_some(GrainMotion {
            displacements: &self.displacements,
            rotations: &self.rotations,
        });
        let grains = Grains {
            centers: &self.centers,
            orientations: &self.orientations,
            sizes: GrainSizes::Each(&self.sizes),
            exponents: &self.exponents,
            motion,
        };
        GrainTree::new(&grains, shape).expect("grains")
    }

    /// A point in the own axes of a grain at rest.
    pub(super) fn own(&self, grain: usize, point: DVec3) -> DVec3 {
        let [x, y, z, w] = self.orientations[grain].map(f64::from);
        let rotation = DQuat::from_xyzw(x, y, z, w).normalize();
        rotation.inverse() * (point - self.centers[grain].as_dvec3())
    }
}

/// The convex shapes, each with a function that is negative inside, of a point in the own axes of a grain with these
/// semi-axes.
pub(super) type Implicit = fn(DVec3, DVec3) -> f64;

pub(super) const EXPONENTS: [f32; 2] = [3.0, 5.0];

fn ellipsoid(p: DVec3, a: DVec3) -> f64 {
    (p / a).length() - 1.0
}

fn superquadric(p: DVec3, a: DVec3) -> f64 {
    superquadric_of(p / a, EXPONENTS)
}

pub(super) fn superquadric_of(p: DVec3, exponents: [f32; 2]) -> f64 {
    let [n1, n2] = exponents.map(f64::from);
    let p = p.abs();
    let across = (p.x.powf(n2) + p.y.powf(n2)).powf(n1 / n2);
    (across + p.z.powf(n1)).powf(1.0 / n1) - 1.0
}

fn capsule(p: DVec3, a: DVec3) -> f64 {
    let cap = a.x.min(a.z);
    let half = a.z - cap;
    ((p - DVec3::Z * p.z.clamp(-half, half)) / DVec3::new(a.x, a.y, cap)).length() - 1.0
}

fn cylinder(p: DVec3, a: DVec3) -> f64 {
    let p = p / a;
    p.truncate().length().max(p.z.abs()) - 1.0
}

fn cuboid(p: DVec3, a: DVec3) -> f64 {
    (p / a).abs().max_element() - 1.0
}

pub(super) fn shapes() -> [(GrainShape, Implicit); 5] {
    [
        (GrainShape::Ellipsoid, ellipsoid),
        (GrainShape::Superquadric { exponents: EXPONENTS }, superquadric),
        (GrainShape::Capsule, capsule),
        (GrainShape::Cylinder, cylinder),
        (GrainShape::Cuboid, cuboid),
    ]
}

/// A ray from `origin` towards `target`.
pub(super) fn towards(origin: Vec3, target: Vec3) -> Ray {
    Ray::new(origin, (target - origin).normalize())
}

/// A packet of sixteen rays: from one point if `number` is even, else from anywhere.
pub(super) fn packet(number: u32, random: &mut Random, size: f32) -> RayPacket {
    let mut rays = RayPacket::default();
    let (eye, target) = (4.0 * size * random.vector(), size * random.vector());
    for lane in 0..16 {
        let mut ray = if number.is_multiple_of(2) {
            towards(eye, target + 0.1 * size * random.vector())
        } else {
            towards(2.0 * size * random.vector(), size * random.vector())
        };
        if lane == 5 {
            ray.t_max = 3.0 * size * random.next().abs();
        }
        if lane == 6 {
            ray.t_min = 2.0 * size * random.next().abs();
        }
        if lane == 7 {
            ray.direction = Vec3::NEG_X;
        }
        rays.push(&ray);
        rays.time[lane] = 0.5 * random.next();
    }
    rays
}
