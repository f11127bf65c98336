//! Validates trees of clipped spheres: a ray that hits a sphere must reach a leaf that holds it.
//!
//! Such a ray hits a point of the surface, so each point of the surface must be inside all boxes on the path to some
//! leaf with this particle. The check uses sample points: the six extremes of each sphere, and the directions to the
//! edges and corners of its box.

use glam::DVec3;

use super::topology::{Linked, NodeRef, Topology};
use super::tree_fault::TreeFault;
use super::wide::WideTree;
use super::{SphereRadius, Spheres};
use crate::blocks::BLOCK_SIZE;

/// Sample points per sphere.
const POINTS: usize = 26;
/// One bit per sample point.
type Points = u32;

/// Intersection of all boxes from the root to a node.
#[derive(Debug, Clone, Copy)]
struct Cell {
    min: DVec3,
    max: DVec3,
}

impl WideTree {
    /// Checks that the parts of each sphere cover it.
    ///
    /// # Errors
    /// Describes the first sphere with an uncovered point.
    pub(super) fn validate_coverage(&self, spheres: &Spheres) -> Result<(), TreeFault> {
        let mut covered: Vec<Points> = vec![0; self.count];
        let everywhere = Cell { min: DVec3::NEG_INFINITY, max: DVec3::INFINITY };
        // Walk down the tree; intersect the boxes on the path and mark the points that each leaf covers
        let mut pending = Vec::new();
        pending.extend((!self.nodes.is_empty()).then_some((Linked::ROOT, everywhere)));
        let (view, directions) = (self.view(), directions());
        let topology = view.linked();
        while let Some((code, cell)) = pending.pop() {
            match Linked::decode(code) {
                NodeRef::Block(block) => {
                    for index in &self.indices[block * BLOCK_SIZE..][..BLOCK_SIZE] {
                        let index = *index as usize;
                        covered[index] |= points_within(spheres, index, cell, &directions);
                    }
                }
                NodeRef::Node(node) => {
                    for slot in 0..self.nodes[node].child_count() {
                        let child =
                            topology.child(topology.children(code), crate::order::index_u32(slot));
                        pending.push((child, self.cell_of_child(node, slot, cell)));
                    }
                }
            }
        }
        // Report the first sphere with an uncovered point
        let all = (1 << POINTS) - 1;
        match covered.iter().position(|points| *points != all) {
            None => Ok(()),
            Some(index) => Err(TreeFault::Uncovered {
                particle: index,
                direction: directions[covered[index].trailing_ones() as usize],
            }),
        }
    }

    fn cell_of_child(&self, node: usize, slot: usize, cell: Cell) -> Cell {
        let sides = [0, 1, 2].map(|axis| self.nodes[node].interval(slot, axis));
        Cell {
            min: cell.min.max(DVec3::from_array(sides.map(|side| side[0]))),
            max: cell.max.min(DVec3::from_array(sides.map(|side| side[1]))),
        }
    }
}

/// Unit vectors to the middles of the faces, edges and corners of a cube.
fn directions() -> [DVec3; POINTS] {
    let signs = |place: u32| [1, 3, 9].map(|unit| f64::from(place / unit % 3) - 1.0);
    let mut all = (0..27).map(|place| DVec3::from_array(signs(place)));
    let mut next = || all.find(|v| *v != DVec3::ZERO).expect("26 of 27");
    std::array::from_fn(|_| next().normalize())
}

/// The sample points of sphere `index` inside `cell`. The boxes of leaves are rounded to the nearest f32; ray tests
/// have a tolerance for that.
fn points_within(
    spheres: &Spheres,
    index: usize,
    cell: Cell,
    directions: &[DVec3; POINTS],
) -> Points {
    let center = spheres.centers[index].as_dvec3();
    let radius = f64::from(match spheres.radius {
        SphereRadius::Common(radius) => radius,
        SphereRadius::Each(radii) => radii[index],
    });
    let rounding = (center.abs() + radius) * f64::from(f32::EPSILON);
    let (min, max) = (cell.min - rounding, cell.max + rounding);
    let mut points = 0;
    for (bit, direction) in directions.iter().enumerate() {
        let point = center + *direction * radius;
        let is_within = point.cmpge(min).all() && point.cmple(max).all();
        points |= Points::from(is_within) << bit;
    }
    points
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::super::{BuildSettings, SbvhSettings, SphereRadius, Structure, TreeBuilder};
    use super::*;

    #[test]
    fn directions_are_all_different() {
        let all = directions();
        assert!(all.iter().all(|d| (d.length() - 1.0).abs() < 1e-12));
        assert!((1..POINTS).all(|i| !all[..i].contains(&all[i])));
    }

    /// Large spheres among small ones are cut; the test removes one part.
    #[test]
    fn missing_part_is_detected() {
        let centers: Vec<Vec3> = (0..1000_u16)
            .map(|i| Vec3::new(f32::from(i % 10), f32::from(i / 10 % 10), f32::from(i / 100)))
            .collect();
        let radii: Vec<f32> = (0..1000).map(|i| if i % 7 == 0 { 1.5 } else { 0.05 }).collect();
        let spheres = Spheres { centers: &centers, radius: SphereRadius::Each(&radii) };
        let mut builder = TreeBuilder::new();
        let sbvh = SbvhSettings { alpha: 0.0, budget: 2.0 };
        let settings = BuildSettings { sbvh, ..BuildSettings::new(Structure::Sbvh) };
        let report = builder.build(&spheres, &settings);
        assert!(report.references > report.particles, "nothing was cut");
        let tree = builder.tree_mut();
        tree.validate_coverage(&spheres).expect("sound");
        let slot = tree.indices.iter().position(|index| *index == 100);
        let first = slot.expect("it is somewhere") / BLOCK_SIZE * BLOCK_SIZE;
        for index in &mut tree.indices[first..first + BLOCK_SIZE] {
            if *index == 100 {
                *index = 0;
            }
        }
        let fault = tree.validate_coverage(&spheres).expect_err("a part is lost");
        assert!(matches!(fault, TreeFault::Uncovered { particle: 100, .. }), "{fault}");
    }
}
