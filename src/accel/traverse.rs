//! The one traversal: how a ray finds spheres in a [`WideTree`], whatever built it and whatever
//! instructions test nodes and blocks.

use super::simd::{Kernel, KernelTask, PacketKernel, SLAB_SLACK, finite_inverse};
use super::topology::{Implicit, Linked, Place, Topology};
use super::wide::{MAX_LEVELS, WideTree};
use crate::ray::Ray;
use spherule_formats::blocks::BLOCK_SIZE;
use spherule_formats::blocks::{Node, WIDTH};

/// A ray's meeting with a sphere of the tree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TreeHit {
    /// Distance along the ray.
    pub t: f32,
    /// Place of the particle in tree order.
    pub slot: u32,
}

/// Where a ray passes through the surface of a sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TreeCrossing {
    /// Distance along the ray.
    pub t: f32,
    /// Place of the particle in tree order.
    pub slot: u32,
}

impl WideTree {
    /// The nearest crossing of a sphere's surface (entering, or leaving when the ray starts inside)
    /// with `t` in `ray.t_min..ray.t_max`. Equal distances go to the lower particle index.
    pub fn nearest(&self, ray: &Ray) -> Option<TreeHit> {
        // Most rays of a picture miss everything: that is cheap to see before anything is prepared.
        if !self.may_be_met_by(ray) {
            return None;
        }
        if self.links.is_empty() {
            self.nearest_in(Implicit::of(self), ray)
        } else {
            self.nearest_in(Linked::of(self), ray)
        }
    }

    /// Whether the ray comes near the box of all spheres; a superset of the rays that meet any.
    fn may_be_met_by(&self, ray: &Ray) -> bool {
        let inverse = finite_inverse(ray.direction);
        let a = (self.bounds.min - ray.origin) * inverse;
        let b = (self.bounds.max - ray.origin) * inverse;
        let slack = a.abs().max(b.abs()) * SLAB_SLACK;
        let near = (a.min(b) - slack).max_element();
        let far = (a.max(b) + slack).min_element();
        // Said so that NaN (bounds beyond the range of f32) counts as met.
        !(near > far.min(ray.t_max) || far < ray.t_min)
    }

    /// Whether any sphere's surface crosses the ray within `ray.t_min..ray.t_max`.
    pub fn any_hit(&self, ray: &Ray) -> bool {
        if self.links.is_empty() {
            self.any_hit_in(Implicit::of(self), ray)
        } else {
            self.any_hit_in(Linked::of(self), ray)
        }
    }

    /// Replaces `crossings` by every crossing within `ray.t_min..ray.t_max`, by distance; equal
    /// distances by particle index.
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

    #[inline]
    fn nearest_in<T: Topology>(&self, topology: T, ray: &Ray) -> Option<TreeHit> {
        let tree = self;
        self.simd.run(Nearest {
            tree,
            topology,
            ray,
        })
    }

    #[inline]
    fn any_hit_in<T: Topology>(&self, topology: T, ray: &Ray) -> bool {
        let tree = self;
        self.simd.run(AnyHit {
            tree,
            topology,
            ray,
        })
    }

    /// Whether a particle may be met in several slots, so that [`WideTree::visit_crossings`] brings the
    /// same crossing several times.
    pub(crate) fn has_copies(&self) -> bool {
        self.has_copies
    }

    /// Gives `visit` every crossing within `ray.t_min..ray.t_max`, in the order of the walk, until it
    /// returns false.
    pub(crate) fn visit_crossings(&self, ray: &Ray, visit: impl FnMut(TreeCrossing) -> bool) {
        if self.links.is_empty() {
            self.visit_crossings_in(Implicit::of(self), ray, visit);
        } else {
            self.visit_crossings_in(Linked::of(self), ray, visit);
        }
    }

    fn visit_crossings_in<T: Topology>(
        &self,
        topology: T,
        ray: &Ray,
        visit: impl FnMut(TreeCrossing) -> bool,
    ) {
        self.simd.run(Crossings {
            tree: self,
            topology,
            ray,
            visit,
        });
    }

    /// Leaves one of several copies of a particle: all of them have the same crossings, next to each
    /// other in `crossings`. A ray that touches a sphere crosses it twice at one distance, so it is
    /// the slot that tells copies from crossings.
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

    /// Who comes first of two particles hit at the same distance: the lower index in the frame, or
    /// where indices were not kept, the lower centre (so that it never depends on the structure). Equal
    /// ones go by slot, so that it does not depend on the order of visits either.
    #[cold]
    pub(super) fn tie_order(&self, a: u32, b: u32) -> std::cmp::Ordering {
        if !self.indices.is_empty() {
            return self.particle(a).cmp(&self.particle(b)).then(a.cmp(&b));
        }
        let center = |slot| self.sphere(slot).0;
        let (p, q) = (center(a), center(b));
        p.x.total_cmp(&q.x)
            .then(p.y.total_cmp(&q.y))
            .then(p.z.total_cmp(&q.z))
            .then(a.cmp(&b))
    }
}

/// Every level can leave all children but one on the stack.
const STACK_SIZE: usize = MAX_LEVELS * (WIDTH - 1) + 1;

/// A node or block still to visit, as one word so that it is stored and loaded whole: the bits of
/// the distance at which the ray enters its box (rounded down) above, and below them its code.
#[derive(Clone, Copy, Default)]
struct Pending(u64);

impl Pending {
    #[inline(always)]
    fn new(key: u32, code: u32) -> Self {
        Self((u64::from(key & !7) << 32) | u64::from(code))
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "the two halves")]
    fn split(self) -> (f32, u32) {
        (f32::from_bits((self.0 >> 32) as u32), self.0 as u32)
    }
}

/// Visits the blocks whose boxes are entered before `limit`, nearest boxes first. `test` is
/// [`Kernel::test_node`] for whatever walks: a ray or a beam of them. `visit` gets each block's number
/// and the limit, and returns the new limit; negative ends the walk.
#[inline(always)]
pub(super) fn walk<K: Kernel, T: Topology>(
    kernel: K,
    tree: &WideTree,
    topology: T,
    test: impl Fn(&Node, f32) -> (usize, K::Keys),
    mut limit: f32,
    mut visit: impl FnMut(usize, f32) -> f32,
) {
    if tree.nodes.is_empty() {
        return;
    }
    let mut stack = [Pending::default(); STACK_SIZE];
    let mut depth = 0;
    let mut code = T::ROOT;
    loop {
        match topology.place(code) {
            Place::Block(block) => {
                limit = visit(block, limit);
                if limit < 0.0 {
                    return;
                }
            }
            Place::Node(index) => {
                let (found, keys) = test(&tree.nodes[index], limit);
                let below = Below {
                    tree,
                    topology,
                    children: topology.children(code),
                };
                if found == 1 {
                    code = below.code(kernel.first_two(keys)[0]);
                    continue;
                }
                if found == 2 {
                    let [a, b] = kernel.first_two(keys);
                    let (near, far) = (a.min(b), a.max(b));
                    let far_code = below.code(far);
                    below.prefetch(kernel, far_code);
                    stack[depth] = Pending::new(far, far_code);
                    depth += 1;
                    code = below.code(near);
                    continue;
                }
                if found > 2 {
                    let mut keys = kernel.all_keys(keys);
                    for key in &keys[..found] {
                        below.prefetch(kernel, below.code(*key));
                    }
                    sort_descending(&mut keys[..found]);
                    for key in &keys[..found - 1] {
                        stack[depth] = Pending::new(*key, below.code(*key));
                        depth += 1;
                    }
                    code = below.code(keys[found - 1]);
                    continue;
                }
            }
        }
        loop {
            if depth == 0 {
                return;
            }
            depth -= 1;
            let (t, pending) = stack[depth].split();
            if t <= limit {
                code = pending;
                break;
            }
        }
    }
}

/// What is below a node, seen from it.
struct Below<'a, T: Topology> {
    tree: &'a WideTree,
    topology: T,
    children: T::Children,
}

impl<T: Topology> Below<'_, T> {
    /// Code of the child that a key is for.
    #[inline(always)]
    fn code(&self, key: u32) -> u32 {
        self.topology.child(self.children, key & 7)
    }

    /// Asks for the memory of a child that will be visited, well before it is.
    #[inline(always)]
    fn prefetch<K: Kernel>(&self, kernel: K, code: u32) {
        match self.topology.place(code) {
            Place::Block(block) => kernel.prefetch_block(&self.tree.blocks[block]),
            Place::Node(node) => kernel.prefetch_node(&self.tree.nodes[node]),
        }
    }
}

/// Insertion sort: two or three keys are usual, eight the most. Keys are the bits of distances that
/// are not negative, which order like integers.
#[inline(always)]
fn sort_descending(keys: &mut [u32]) {
    for i in 1..keys.len() {
        let key = keys[i];
        let mut j = i;
        while j > 0 && keys[j - 1] < key {
            keys[j] = keys[j - 1];
            j -= 1;
        }
        keys[j] = key;
    }
}

struct Nearest<'a, T> {
    tree: &'a WideTree,
    topology: T,
    ray: &'a Ray,
}

impl<T: Topology> KernelTask for Nearest<'_, T> {
    type Output = Option<TreeHit>;

    #[inline(always)]
    fn run<K: PacketKernel>(self, kernel: K) -> Option<TreeHit> {
        let Self {
            tree,
            topology,
            ray,
        } = self;
        let prepared = kernel.prepare(ray, tree.radius, tree.padding);
        let mut best: Option<TreeHit> = None;
        // The end is exclusive for the ray and inclusive for ties.
        walk(
            kernel,
            tree,
            topology,
            |node, limit| kernel.test_node(&prepared, node, limit),
            ray.t_max.next_down(),
            |block, limit| {
                let Some((t, lanes)) = kernel.nearest_in_block(
                    &prepared,
                    &tree.blocks[block],
                    tree.radii.get(block),
                    limit,
                ) else {
                    return limit;
                };
                let slot = first_of_tied(tree, block, lanes);
                match &best {
                    Some(held) if held.t == t && tree.tie_order(held.slot, slot).is_le() => {}
                    _ => best = Some(TreeHit { t, slot }),
                }
                t
            },
        );
        best
    }
}

/// The slot among the `lanes` of `block` that wins at equal distance.
#[inline(always)]
fn first_of_tied(tree: &WideTree, block: usize, lanes: u32) -> u32 {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "slots are counted in 32 bits"
    )]
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

struct AnyHit<'a, T> {
    tree: &'a WideTree,
    topology: T,
    ray: &'a Ray,
}

impl<T: Topology> KernelTask for AnyHit<'_, T> {
    type Output = bool;

    #[inline(always)]
    fn run<K: PacketKernel>(self, kernel: K) -> bool {
        let Self {
            tree,
            topology,
            ray,
        } = self;
        let prepared = kernel.prepare(ray, tree.radius, tree.padding);
        let mut found = false;
        walk(
            kernel,
            tree,
            topology,
            |node, limit| kernel.test_node(&prepared, node, limit),
            ray.t_max.next_down(),
            |block, limit| {
                found = kernel.any_in_block(
                    &prepared,
                    &tree.blocks[block],
                    tree.radii.get(block),
                    limit,
                );
                if found { -1.0 } else { limit }
            },
        );
        found
    }
}

struct Crossings<'a, T, F> {
    tree: &'a WideTree,
    topology: T,
    ray: &'a Ray,
    /// Gets every crossing; false ends the walk.
    visit: F,
}

impl<T: Topology, F: FnMut(TreeCrossing) -> bool> KernelTask for Crossings<'_, T, F> {
    type Output = ();

    #[inline(always)]
    fn run<K: PacketKernel>(self, kernel: K) {
        let Self {
            tree,
            topology,
            ray,
            mut visit,
        } = self;
        let prepared = kernel.prepare(ray, tree.radius, tree.padding);
        let slots = tree.slot_count();
        walk(
            kernel,
            tree,
            topology,
            |node, limit| kernel.test_node(&prepared, node, limit),
            ray.t_max.next_down(),
            |block, limit| {
                let found =
                    kernel.all_in_block(&prepared, &tree.blocks[block], tree.radii.get(block));
                let mut lanes = found.lanes;
                while lanes != 0 {
                    let lane = lanes.trailing_zeros() as usize;
                    lanes &= lanes - 1;
                    let slot = block * BLOCK_SIZE + lane;
                    if slot >= slots {
                        break;
                    }
                    #[expect(
                        clippy::cast_possible_truncation,
                        reason = "slots are counted in 32 bits"
                    )]
                    let slot = slot as u32;
                    for t in [found.near[lane], found.far[lane]] {
                        let is_within = t >= ray.t_min && t < ray.t_max;
                        if is_within && !visit(TreeCrossing { t, slot }) {
                            return -1.0;
                        }
                    }
                }
                limit
            },
        );
    }
}
