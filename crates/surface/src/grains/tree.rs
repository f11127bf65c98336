//! Grains and the tree of their boxes.

use std::fmt;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::body::Body;
use super::bounds::box_of;
use super::build::{ITEM_BYTES, Item, build};
use super::check::{
    Checked, GrainError, GrainReport, check_lengths, checked, is_bounded, valid_exponents,
};
use super::instance::{Instance, Motion};
use super::node::Node;
use super::pose::Pose;
use super::rays::Space;
use super::{GrainShape, Grains};
use crate::SurfaceBytes;
use crate::hierarchy::single;

/// Grains of one shape, and a tree of their boxes.
///
/// A grain takes 52 bytes and its share of the nodes, about 40 bytes. Exponents of
/// superquadrics and lengths of capsules take 8 bytes more, motion takes 24.
pub struct GrainTree {
    shape: GrainShape,
    /// In tree order, like the other arrays.
    grains: Vec<Instance>,
    /// See [`Checked::parameters`].
    parameters: Vec<[f32; 2]>,
    /// Empty if nothing moves.
    motions: Vec<Motion>,
    nodes: Vec<Node>,
    space: Space,
    report: GrainReport,
}

impl fmt::Debug for GrainTree {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("GrainTree")
            .field("shape", &self.shape)
            .field("grains", &self.grains.len())
            .finish_non_exhaustive()
    }
}

impl GrainTree {
    /// The tree of `grains` of one shape, without those that cannot be drawn; see [`Self::report`].
    ///
    /// # Errors
    /// An array has not one element per grain, or there are too many grains.
    pub fn new(grains: &Grains<'_>, shape: GrainShape) -> Result<Self, GrainError> {
        check_lengths(grains)?;
        let center = middle_of(grains.centers);
        let Checked { instances, parameters, motions, mut report } =
            checked(grains, &shape, center);
        let shape = with_valid_exponents(shape, grains, &mut report);
        let mut tree = Self {
            shape,
            grains: instances,
            parameters,
            motions,
            nodes: Vec::new(),
            space: Space { center, half: Vec3::ZERO },
            report,
        };
        // Compute the boxes, and build the nodes over them
        let mut items = tree.items();
        tree.nodes = build(&mut items);
        // Bring the grains into the order of the leaves
        tree.grains = in_order(&items, &tree.grains);
        tree.parameters = in_order(&items, &tree.parameters);
        tree.motions = in_order(&items, &tree.motions);
        Ok(tree)
    }

    /// Renumbers the grains: grain `i` of the arrays that the tree was made of has the index `indices[i]`.
    #[must_use]
    pub fn with_indices(mut self, indices: &[u32]) -> Self {
        for grain in &mut self.grains {
            grain.index = indices[grain.index as usize];
        }
        self
    }

    /// The grains with their boxes, which are larger by the rounding of tests; sets the space.
    fn items(&mut self) -> Vec<Item> {
        let boxes = |slot: usize| {
            let [middle, half] =
                box_of(&self.body(slot), &self.grains[slot], self.motions.get(slot));
            let [low, high] = [middle - half, middle + half].map(|c| c.to_array().map(single));
            Item { low, index: spherule_tree::order::index_u32(slot), high }
        };
        let mut items: Vec<Item> = (0..self.grains.len()).into_par_iter().map(boxes).collect();
        // Find the box of all, and pad each
        let reach =
            |item: &Item| Vec3::from_array(item.low).abs().max(Vec3::from_array(item.high).abs());
        self.space.half = items.par_iter().map(reach).reduce(|| Vec3::ZERO, Vec3::max);
        let padding = self.space.padding();
        items.par_iter_mut().for_each(|item| {
            item.low = item.low.map(|c| c - padding);
            item.high = item.high.map(|c| c + padding);
        });
        items
    }

    /// What was wrong with grains.
    pub const fn report(&self) -> &GrainReport {
        &self.report
    }

    /// Number of grains that are drawn.
    pub const fn len(&self) -> usize {
        self.grains.len()
    }

    /// Whether there are none.
    pub const fn is_empty(&self) -> bool {
        self.grains.is_empty()
    }

    /// Whether grains move while the shutter is open.
    pub const fn is_moving(&self) -> bool {
        !self.motions.is_empty()
    }

    /// The lowest and the highest corner of a box around all grains, during the whole exposure; None without grains.
    pub fn bounds(&self) -> Option<[Vec3; 2]> {
        let Space { center, half } = self.space;
        (!self.is_empty()).then_some([center - half, center + half])
    }

    /// Memory of the grains and their tree, and of their mesh, bytes.
    pub fn bytes(&self) -> usize {
        let mesh = match &self.shape {
            GrainShape::Mesh(mesh) => mesh.bytes(),
            _ => 0,
        };
        size_of_val(self.grains.as_slice())
            + size_of_val(self.parameters.as_slice())
            + size_of_val(self.motions.as_slice())
            + size_of_val(self.nodes.as_slice())
            + mesh
    }

    /// Upper bounds of the memory of `grains` grains without their mesh, bytes: while the tree is built, and afterwards.
    pub const fn predicted_bytes(grains: u64, is_moving: bool) -> SurfaceBytes {
        let motion = if is_moving { size_of::<Motion>() as u64 } else { 0 };
        let own = size_of::<Instance>() as u64 + size_of::<[f32; 2]>() as u64 + motion;
        // Most nodes of the lowest level have eight grains, and there are about a fifth as many nodes as grains
        let nodes = (size_of::<Node>() as u64).div_ceil(5);
        let kept = grains.saturating_mul(own + nodes).saturating_add(size_of::<Node>() as u64);
        // Grains are copied twice into another order; nodes are appended to each other
        let building = grains.saturating_mul(own + nodes + ITEM_BYTES);
        SurfaceBytes { building: kept.saturating_add(building), kept }
    }

    /// The nodes and the grains, for a traversal.
    pub(super) fn parts(&self) -> (&[Node], &[Instance], &[Motion]) {
        (&self.nodes, &self.grains, &self.motions)
    }

    pub(super) const fn shape(&self) -> &GrainShape {
        &self.shape
    }

    pub(super) const fn space(&self) -> &Space {
        &self.space
    }

    /// The grain in `slot`, in tree order.
    pub(super) fn grain(&self, slot: usize) -> (&Instance, Option<&Motion>) {
        (&self.grains[slot], self.motions.get(slot))
    }

    /// The pose of the grain in `slot` at `time`.
    pub(super) fn pose(&self, slot: usize, time: f32) -> Pose {
        match self.grain(slot) {
            (grain, None) => Pose::fixed(grain),
            (grain, Some(motion)) => Pose::at(grain, motion, time),
        }
    }

    /// The body of the grain in `slot`.
    pub(super) fn body(&self, slot: usize) -> Body<'_> {
        match &self.shape {
            GrainShape::Ellipsoid => Body::Ellipsoid,
            GrainShape::Superquadric { exponents } => {
                let own = self.parameters.get(slot).unwrap_or(exponents);
                Body::Superquadric(own.map(f64::from))
            }
            GrainShape::Capsule => {
                Body::Capsule(self.parameters.get(slot).map_or(0.0, |[half, _]| f64::from(*half)))
            }
            GrainShape::Cylinder => Body::Cylinder,
            GrainShape::Cuboid => Body::Cuboid,
            GrainShape::Mesh(mesh) => Body::Mesh(mesh),
        }
    }
}

/// The middle of the box of the centres that can be drawn.
fn middle_of(centers: &[Vec3]) -> Vec3 {
    let nothing = || [DVec3::INFINITY, DVec3::NEG_INFINITY];
    let placed = centers.par_iter().filter(|center| is_bounded(**center));
    let [min, max] = placed
        .map(|center| [center.as_dvec3(); 2])
        .reduce(nothing, |a, b| [a[0].min(b[0]), a[1].max(b[1])]);
    let middle = 0.5 * (min + max);
    if middle.is_finite() { middle.as_vec3() } else { Vec3::ZERO }
}

/// The shape with exponents that can be drawn. If there are no others, each grain counts.
fn with_valid_exponents(
    shape: GrainShape,
    grains: &Grains<'_>,
    report: &mut GrainReport,
) -> GrainShape {
    let GrainShape::Superquadric { exponents } = shape else {
        return shape;
    };
    let mut own = GrainReport::default();
    let exponents = valid_exponents(exponents, &mut own);
    if grains.exponents.is_empty() {
        report.bad_exponents += own.bad_exponents * report.grains;
    }
    GrainShape::Superquadric { exponents }
}

/// `values` in the order of `items`; empty if there are none.
fn in_order<T: Copy + Send + Sync>(items: &[Item], values: &[T]) -> Vec<T> {
    if values.is_empty() {
        return Vec::new();
    }
    items.par_iter().map(|item| values[item.index as usize]).collect()
}
