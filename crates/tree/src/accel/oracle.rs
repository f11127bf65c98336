//! An independent reference for the tests: a left-balanced particle k-d tree in one array (Wald 2015), scalar and in
//! f64. It shares no code with the trees under test.

use glam::{DVec3, Vec3};

use crate::ray::Ray;

/// A complete binary tree: the children of particle `i` are `2 i + 1` and `2 i + 2`.
pub(super) struct ParticleTree {
    nodes: Vec<OracleNode>,
    radius: f64,
}

#[derive(Clone, Copy, Default)]
struct OracleNode {
    center: DVec3,
    particle: usize,
    axis: usize,
}

impl ParticleTree {
    pub(super) fn new(centers: &[Vec3], radius: f32) -> Self {
        let mut particles: Vec<(DVec3, usize)> =
            (0..).zip(centers).map(|(i, c)| (c.as_dvec3(), i)).collect();
        let mut nodes = vec![OracleNode::default(); centers.len()];
        place(&mut particles, 0, &mut nodes);
        Self { nodes, radius: f64::from(radius) }
    }

    /// Distance and particle of the nearest crossing not behind the origin, and the margin of the closest decision
    /// that rounding could change: grazing a sphere, or starting on one.
    pub(super) fn nearest(&self, ray: &Ray) -> (Option<(f64, usize)>, f64) {
        let mut search = Search {
            origin: ray.origin.as_dvec3(),
            direction: ray.direction.as_dvec3().normalize(),
            best: None,
            closeness: f64::INFINITY,
        };
        self.visit(0, [0.0, f64::INFINITY], &mut search);
        (search.best, search.closeness)
    }

    /// Searches the subtree of `index` for the part of the ray between the distances `span`.
    fn visit(&self, index: usize, span: [f64; 2], search: &mut Search) {
        let Some(node) = self.nodes.get(index) else {
            return;
        };
        search.meet(node, self.radius);
        let (o, d) = (search.origin[node.axis], search.direction[node.axis]);
        for (child, side) in [(2 * index + 1, -1.0), (2 * index + 2, 1.0)] {
            // Spheres of that side extend a radius and a little more beyond the plane.
            let border = node.center[node.axis] - side * self.radius * 1.01;
            if let Some(inside) = clip(span, side * (o - border), side * d) {
                self.visit(child, inside, search);
            }
        }
    }
}

/// The part of `span` where `offset + t * slope` is not negative.
fn clip([from, to]: [f64; 2], offset: f64, slope: f64) -> Option<[f64; 2]> {
    if slope == 0.0 {
        return (offset >= 0.0).then_some([from, to]);
    }
    let t = -offset / slope;
    let inside = if slope > 0.0 { [from.max(t), to] } else { [from, to.min(t)] };
    // Extended a little, so that rounding loses nothing.
    (inside[0] <= inside[1] + 1e-9).then_some(inside)
}

struct Search {
    origin: DVec3,
    direction: DVec3,
    best: Option<(f64, usize)>,
    closeness: f64,
}

impl Search {
    fn meet(&mut self, node: &OracleNode, radius: f64) {
        let to_center = node.center - self.origin;
        let middle = to_center.dot(self.direction);
        let across = (to_center - self.direction * middle).length();
        if middle > -2.0 * radius {
            self.closeness = self.closeness.min((across - radius).abs());
        }
        if across > radius {
            return;
        }
        let half = (radius * radius - across * across).sqrt();
        for t in [middle - half, middle + half] {
            self.closeness = self.closeness.min(t.abs());
            if t >= 0.0 && self.best.is_none_or(|(best, _)| t < best) {
                self.best = Some((t, node.particle));
            }
        }
    }
}

/// Puts the median of the widest axis at `index`, so that the tree is filled from the left.
fn place(particles: &mut [(DVec3, usize)], index: usize, nodes: &mut [OracleNode]) {
    if particles.is_empty() {
        return;
    }
    let low = particles.iter().fold(DVec3::INFINITY, |a, p| a.min(p.0));
    let high = particles.iter().fold(DVec3::NEG_INFINITY, |a, p| a.max(p.0));
    let extent = high - low;
    let axis = (0..3).fold(0, |a, b| if extent[b] > extent[a] { b } else { a });
    let left = left_size(particles.len());
    particles.select_nth_unstable_by(left, |a, b| a.0[axis].total_cmp(&b.0[axis]));
    let (center, particle) = particles[left];
    nodes[index] = OracleNode { center, particle, axis };
    let (below, above) = particles.split_at_mut(left);
    place(below, 2 * index + 1, nodes);
    place(&mut above[1..], 2 * index + 2, nodes);
}

/// Particles in the left subtree of a complete tree of `len`.
fn left_size(len: usize) -> usize {
    let levels = (len + 1).ilog2();
    let full = (1 << levels) - 1;
    let last_row = len - full;
    full / 2 + last_row.min(1 << levels >> 1)
}

#[test]
fn left_subtrees_are_filled_first() {
    let sizes = [1, 2, 3, 4, 5, 6, 7, 8, 12, 15].map(left_size);
    assert_eq!(sizes, [0, 1, 1, 2, 3, 3, 3, 4, 7, 7]);
}
