//! Queries of single rays: the nearest hit, any hit, all crossings.

use std::borrow::Borrow;

use super::hits::TreeHits;
use super::leaves::{Leaves, LoadedRadii};
use super::simd::{PacketKernel, SLAB_SLACK, finite_inverse};
use super::topology::Topology;
use super::view::{Resolved, TreeTask, TreeView};
use super::walk::{Walker, walk_with};
use crate::blocks::{BLOCK_SIZE, Node};
use crate::math::lanes_in;
use crate::ray::Ray;

/// Intersection of a ray with a sphere of the tree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TreeHit {
    /// Distance along the ray.
    pub t: f32,
    /// Slot of the particle in tree order.
    pub slot: u32,
}

/// Intersection of a ray with the surface of a sphere, on the way in or out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TreeCrossing {
    /// Distance along the ray.
    pub t: f32,
    /// Slot of the particle in tree order.
    pub slot: u32,
    /// Half the length of the chord through the sphere: the radius times the absolute cosine between ray and normal.
    pub half_chord: f32,
}

impl TreeView<'_> {
    /// The nearest intersection with the surface of a sphere (from outside, or from inside if the ray starts there)
    /// with `t` in `ray.t_min..ray.t_max`. Ties in distance go to the lower particle index.
    pub fn nearest(&self, ray: &Ray) -> Option<TreeHit> {
        // Most rays of a picture miss everything. This test rejects them before any setup.
        if !self.may_intersect(ray) {
            return None;
        }
        self.run(Nearest { ray })
    }

    /// `ray` as the kernel needs it.
    #[inline(always)]
    pub(super) fn prepare<K: PacketKernel>(&self, kernel: K, ray: &Ray) -> K::Ray {
        kernel.prepare(ray, finite_inverse(ray.direction), self.radius, self.padding)
    }

    /// Whether the ray enters the box of all spheres: true for all rays that hit any sphere, and for some others.
    pub(super) fn may_intersect(&self, ray: &Ray) -> bool {
        let inverse = finite_inverse(ray.direction);
        let a = (self.bounds.min - ray.origin) * inverse;
        let b = (self.bounds.max - ray.origin) * inverse;
        let slack = a.abs().max(b.abs()) * SLAB_SLACK;
        let near = (a.min(b) - slack).max_element();
        let far = (a.max(b) + slack).min_element();
        // Written as `!(a > b)` so that NaN (bounds beyond the range of f32) counts as a hit.
        !(near > far.min(ray.t_max) || far < ray.t_min)
    }

    /// Whether any sphere's surface crosses the ray within `ray.t_min..ray.t_max`.
    pub fn any_hit(&self, ray: &Ray) -> bool {
        self.run(AnyHit { ray })
    }

    /// Replaces the content of `crossings` by every crossing within `ray.t_min..ray.t_max`, sorted by distance, then
    /// by particle index.
    pub fn crossings(&self, ray: &Ray, crossings: &mut Vec<TreeCrossing>) {
        crossings.clear();
        self.visit_crossings(ray, |crossing| {
            crossings.push(crossing);
            true
        });
        crossings.sort_unstable_by(|a, b| {
            a.t.total_cmp(&b.t)
                .then_with(|| self.tie_order(a.slot, b.slot))
                .then(a.slot.cmp(&b.slot))
        });
        if self.has_copies {
            self.keep_first_copies(crossings);
        }
    }

    /// Calls `visit` for every crossing within `ray.t_min..ray.t_max`, in traversal order, until it returns false.
    pub fn visit_crossings(&self, ray: &Ray, visit: impl FnMut(TreeCrossing) -> bool) {
        self.run(Crossings { ray, visit });
    }

    /// Removes duplicates of particles that are stored in several slots. They have the same crossings, which are
    /// adjacent in `crossings`. A ray that touches a sphere crosses it twice at the same distance, so slots
    /// distinguish duplicates from such crossings.
    fn keep_first_copies(&self, crossings: &mut Vec<TreeCrossing>) {
        let mut first: Option<TreeCrossing> = None;
        crossings.retain(|crossing| match first {
            Some(held)
                if held.t == crossing.t
                    && self.particle(held.slot) == self.particle(crossing.slot) =>
            {
                held.slot == crossing.slot
            }
            _ => {
                first = Some(*crossing);
                true
            }
        });
    }
}

struct Nearest<'r> {
    ray: &'r Ray,
}

impl TreeTask for Nearest<'_> {
    type Output = Option<TreeHit>;

    #[inline(always)]
    fn run<'a, K: PacketKernel, T: Topology<'a>, L: Leaves>(
        self,
        kernel: K,
        tree: Resolved<'a, T, L>,
    ) -> Option<TreeHit> {
        let (ray, view) = (self.ray, tree.view);
        let mut search = NearestOfRay {
            tree,
            ray: &view.prepare(kernel, ray),
            best: TreeHit {
                // `t_max` is exclusive, but limits are inclusive because of ties.
                t: ray.t_max.next_down(),
                slot: TreeHits::NO_SLOT,
            },
        };
        let limit = search.best.t;
        walk_with(kernel, tree, &mut search, limit);
        (search.best.slot != TreeHits::NO_SLOT).then_some(search.best)
    }
}

/// A ray that searches for its nearest hit.
pub(super) struct NearestOfRay<'r, 'a, R, T, L> {
    pub(super) tree: Resolved<'a, T, L>,
    pub(super) ray: &'r R,
    /// The nearest hit so far; before the first hit, [`TreeHits::NO_SLOT`] and the largest valid distance.
    pub(super) best: TreeHit,
}

impl<'a, K: PacketKernel, T: Topology<'a>, L: Leaves> Walker<K>
    for NearestOfRay<'_, 'a, K::Ray, T, L>
{
    #[inline(always)]
    fn test(&self, kernel: K, node: &Node, limit: f32) -> (usize, K::Keys) {
        kernel.test_node(self.ray, node, limit)
    }

    #[inline(always)]
    fn visit(&mut self, kernel: K, block: usize, limit: f32) -> f32 {
        let view = self.tree.view;
        let centers = self.tree.leaves.load(kernel, block);
        let radii = LoadedRadii::of(&view.radii, block);
        // Find the nearest hit in the block
        let Some((t, lanes)) =
            kernel.nearest_in_block(self.ray, centers.borrow(), radii.as_ref(), limit)
        else {
            return limit;
        };
        // Break ties within the block, then with the current hit
        let slot = first_of_tied(view, block, lanes);
        let is_tied = self.best.t == t && self.best.slot != TreeHits::NO_SLOT;
        if !(is_tied && view.tie_order(self.best.slot, slot).is_le()) {
            self.best = TreeHit { t, slot };
        }
        t
    }
}

/// The slot among the `lanes` of `block` that wins a tie in distance.
#[inline(always)]
fn first_of_tied(tree: &TreeView, block: usize, lanes: u32) -> u32 {
    #[expect(clippy::cast_possible_truncation, reason = "slots are counted in 32 bits")]
    let first = (block * BLOCK_SIZE) as u32;
    let mut slot = first + lanes.trailing_zeros();
    let mut others = lanes & (lanes - 1);
    while others != 0 {
        let other = first + others.trailing_zeros();
        if tree.tie_order(other, slot).is_lt() {
            slot = other;
        }
        others &= others - 1;
    }
    slot
}

struct AnyHit<'r> {
    ray: &'r Ray,
}

impl TreeTask for AnyHit<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<'a, K: PacketKernel, T: Topology<'a>, L: Leaves>(
        self,
        kernel: K,
        tree: Resolved<'a, T, L>,
    ) -> bool {
        let (ray, view) = (self.ray, tree.view);
        let mut search = AnyOfRay { tree, ray: &view.prepare(kernel, ray), found: false };
        walk_with(kernel, tree, &mut search, ray.t_max.next_down());
        search.found
    }
}

/// A ray that searches for any hit.
pub(super) struct AnyOfRay<'r, 'a, R, T, L> {
    pub(super) tree: Resolved<'a, T, L>,
    pub(super) ray: &'r R,
    pub(super) found: bool,
}

impl<'a, K: PacketKernel, T: Topology<'a>, L: Leaves> Walker<K> for AnyOfRay<'_, 'a, K::Ray, T, L> {
    #[inline(always)]
    fn test(&self, kernel: K, node: &Node, limit: f32) -> (usize, K::Keys) {
        kernel.test_node(self.ray, node, limit)
    }

    #[inline(always)]
    fn visit(&mut self, kernel: K, block: usize, limit: f32) -> f32 {
        let centers = self.tree.leaves.load(kernel, block);
        let radii = LoadedRadii::of(&self.tree.view.radii, block);
        self.found = kernel.any_in_block(self.ray, centers.borrow(), radii.as_ref(), limit);
        if self.found { -1.0 } else { limit }
    }
}

/// Intersection of the line of a ray with a sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TreeChord {
    /// Slot of the particle in tree order.
    pub slot: u32,
    /// Distances along the ray where it enters and leaves the sphere.
    pub ends: [f32; 2],
}

impl TreeChord {
    /// Half the length.
    #[inline(always)]
    pub fn half(&self) -> f32 {
        0.5 * (self.ends[1] - self.ends[0])
    }
}

struct Crossings<'r, F> {
    ray: &'r Ray,
    /// Called with every crossing; false ends the traversal.
    visit: F,
}

impl<F: FnMut(TreeCrossing) -> bool> TreeTask for Crossings<'_, F> {
    type Output = ();

    #[inline(always)]
    fn run<'a, K: PacketKernel, T: Topology<'a>, L: Leaves>(
        self,
        kernel: K,
        tree: Resolved<'a, T, L>,
    ) {
        let Self { ray, mut visit } = self;
        // Visit both ends of each chord that lie within the ray
        let mut search = ChordsOfRay {
            tree,
            ray: &tree.view.prepare(kernel, ray),
            visit: |chord: TreeChord| {
                chord.ends.into_iter().all(|t| {
                    let is_within = t >= ray.t_min && t < ray.t_max;
                    !is_within
                        || visit(TreeCrossing { t, slot: chord.slot, half_chord: chord.half() })
                })
            },
        };
        walk_with(kernel, tree, &mut search, ray.t_max.next_down());
    }
}

/// A ray that searches for all spheres on its line, in boxes that begin before its end.
pub(super) struct ChordsOfRay<'r, 'a, R, T, L, F> {
    pub(super) tree: Resolved<'a, T, L>,
    pub(super) ray: &'r R,
    /// Called with every chord; false ends the traversal.
    pub(super) visit: F,
}

impl<'a, K, T, L, F> Walker<K> for ChordsOfRay<'_, 'a, K::Ray, T, L, F>
where
    K: PacketKernel,
    T: Topology<'a>,
    L: Leaves,
    F: FnMut(TreeChord) -> bool,
{
    #[inline(always)]
    fn test(&self, kernel: K, node: &Node, limit: f32) -> (usize, K::Keys) {
        kernel.test_node(self.ray, node, limit)
    }

    #[inline(always)]
    fn visit(&mut self, kernel: K, block: usize, limit: f32) -> f32 {
        let view = self.tree.view;
        let centers = self.tree.leaves.load(kernel, block);
        let radii = LoadedRadii::of(&view.radii, block);
        // Visit the chords through the spheres of the block
        let found = kernel.all_in_block(self.ray, centers.borrow(), radii.as_ref());
        let mut lanes = found.lanes;
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize;
            lanes &= lanes - 1;
            let slot = block * BLOCK_SIZE + lane;
            if slot >= view.slot_count() {
                break;
            }
            #[expect(clippy::cast_possible_truncation, reason = "slots are counted in 32 bits")]
            let slot = slot as u32;
            let ends = [found.near[lane], found.far[lane]];
            if !(self.visit)(TreeChord { slot, ends }) {
                return -1.0;
            }
        }
        limit
    }
}

/// A ray that searches for the spheres that it enters up to a limit, which may fall with each one.
pub(super) struct EntriesOfRay<'r, 'a, R, T, L, F> {
    pub(super) tree: Resolved<'a, T, L>,
    pub(super) ray: &'r R,
    pub(super) t_min: f32,
    pub(super) limit: f32,
    /// Called with every entry; returns a new limit, or None to keep it. A negative limit ends the traversal.
    pub(super) visit: F,
}

impl<'a, K, T, L, F> Walker<K> for EntriesOfRay<'_, 'a, K::Ray, T, L, F>
where
    K: PacketKernel,
    T: Topology<'a>,
    L: Leaves,
    F: FnMut(TreeHit) -> Option<f32>,
{
    #[inline(always)]
    fn test(&self, kernel: K, node: &Node, limit: f32) -> (usize, K::Keys) {
        kernel.test_node(self.ray, node, limit)
    }

    #[inline(always)]
    fn visit(&mut self, kernel: K, block: usize, _limit: f32) -> f32 {
        let view = self.tree.view;
        let centers = self.tree.leaves.load(kernel, block);
        let radii = LoadedRadii::of(&view.radii, block);
        let found = kernel.all_in_block(self.ray, centers.borrow(), radii.as_ref());
        for lane in lanes_in(found.lanes) {
            let (t, slot) = (found.near[lane], block * BLOCK_SIZE + lane);
            // Spheres in which the ray starts, and padding after the last one, do not count
            let is_entry = t >= self.t_min && t <= self.limit && slot < view.slot_count();
            #[expect(clippy::cast_possible_truncation, reason = "slots are counted in 32 bits")]
            if is_entry && let Some(limit) = (self.visit)(TreeHit { t, slot: slot as u32 }) {
                self.limit = limit;
            }
        }
        self.limit
    }
}
