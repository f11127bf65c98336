//! The tree traversal that all queries share. It does not depend on the builder, on the storage of the leaves, or on
//! the instruction set that tests nodes and blocks.

use super::leaves::Leaves;
use super::levels::MAX_LEVELS;
use super::simd::Kernel;
use super::topology::{NodeRef, Topology};
use super::view::Resolved;
use crate::blocks::{Node, WIDTH};

/// On every level, all children except one can be on the stack.
pub(super) const STACK_SIZE: usize = MAX_LEVELS * (WIDTH - 1) + 1;

/// A node or block still to be visited, as one word so that it is stored and loaded at once. The upper half has the
/// bits of the distance at which the ray enters its box (rounded down), the lower half its code.
#[derive(Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Pending(u64);

impl Pending {
    /// `key` has the bits of the distance; its lowest three bits do not count.
    #[inline(always)]
    pub(super) fn new(key: u32, code: u32) -> Self {
        Self((u64::from(key & !7) << 32) | u64::from(code))
    }

    #[inline(always)]
    #[expect(clippy::cast_possible_truncation, reason = "the two halves")]
    pub(super) fn split(self) -> (f32, u32) {
        (f32::from_bits((self.0 >> 32) as u32), self.0 as u32)
    }
}

/// The stack of a traversal. It can be reused for several traversals, one after another.
pub(super) struct WalkStack([Pending; STACK_SIZE]);

impl WalkStack {
    #[inline(always)]
    pub(super) fn new() -> Self {
        Self([Pending::default(); STACK_SIZE])
    }
}

/// A visitor of the tree: the node test of a ray or a beam, and its work in blocks.
///
/// Implementations must be `inline(always)`: only inlined code is compiled with the instructions of the kernel, and
/// closures that are called in two places may not be inlined.
pub(super) trait Walker<K: Kernel> {
    /// [`Kernel::test_node`] for a ray or a beam.
    fn test(&self, kernel: K, node: &Node, limit: f32) -> (usize, K::Keys);

    /// Visits a block that may be reached before `limit`, and returns the new limit; a negative one ends the traversal.
    fn visit(&mut self, kernel: K, block: usize, limit: f32) -> f32;
}

/// A visitor made of two closures, for queries with a single traversal.
struct OfClosures<A, B> {
    test: A,
    visit: B,
}

impl<K: Kernel, A, B> Walker<K> for OfClosures<A, B>
where
    A: Fn(&Node, f32) -> (usize, K::Keys),
    B: FnMut(usize, f32) -> f32,
{
    #[inline(always)]
    fn test(&self, _: K, node: &Node, limit: f32) -> (usize, K::Keys) {
        (self.test)(node, limit)
    }

    #[inline(always)]
    fn visit(&mut self, _: K, block: usize, limit: f32) -> f32 {
        (self.visit)(block, limit)
    }
}

/// [`walk_with`] with two closures in place of a [`Walker`].
#[inline(always)]
pub(super) fn walk<'a, K: Kernel, T: Topology<'a>, L: Leaves>(
    kernel: K,
    tree: Resolved<'a, T, L>,
    test: impl Fn(&Node, f32) -> (usize, K::Keys),
    limit: f32,
    visit: impl FnMut(usize, f32) -> f32,
) {
    walk_with(kernel, tree, &mut OfClosures { test, visit }, limit);
}

/// Visits the blocks with boxes that the ray enters before `limit`, nearest boxes first.
#[inline(always)]
pub(super) fn walk_with<'a, K: Kernel, T: Topology<'a>, L: Leaves>(
    kernel: K,
    tree: Resolved<'a, T, L>,
    walker: &mut impl Walker<K>,
    limit: f32,
) {
    if !tree.view.is_empty() {
        walk_from(kernel, tree, T::ROOT, &mut WalkStack::new(), walker, limit);
    }
}

/// [`walk_with`] for the subtree with `code`.
#[inline(always)]
pub(super) fn walk_from<'a, K: Kernel, T: Topology<'a>, L: Leaves>(
    kernel: K,
    tree: Resolved<'a, T, L>,
    mut code: u32,
    WalkStack(stack): &mut WalkStack,
    walker: &mut impl Walker<K>,
    mut limit: f32,
) {
    let topology = tree.topology;
    let mut depth = 0;
    loop {
        match topology.resolve(code) {
            NodeRef::Block(block) => {
                // Visit the block, which may shorten the ray
                limit = walker.visit(kernel, block, limit);
                if limit < 0.0 {
                    return;
                }
            }
            NodeRef::Node(node) => {
                // Test all children of the node
                let (found, keys) = walker.test(kernel, node, limit);
                let below = Below { tree, children: topology.children(code) };
                // One child: continue with it
                if found == 1 {
                    code = below.code(kernel.first_two(keys)[0]);
                    continue;
                }
                // Two children: push the farther one, continue with the nearer one
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
                // More children: sort them by distance, push all but the nearest, continue with the nearest
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
        // Pop the next node or block that begins before the limit
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

/// The children of a node.
pub(super) struct Below<'a, T: Topology<'a>, L> {
    pub(super) tree: Resolved<'a, T, L>,
    pub(super) children: T::Children,
}

impl<'a, T: Topology<'a>, L: Leaves> Below<'a, T, L> {
    /// Code of the child that a key belongs to.
    #[inline(always)]
    pub(super) fn code(&self, key: u32) -> u32 {
        self.tree.topology.child(self.children, key & 7)
    }

    /// Prefetches a child long before it is visited.
    #[inline(always)]
    pub(super) fn prefetch<K: Kernel>(&self, kernel: K, code: u32) {
        match self.tree.topology.resolve(code) {
            NodeRef::Block(block) => self.tree.leaves.prefetch(kernel, block),
            NodeRef::Node(node) => kernel.prefetch(node),
        }
    }
}

/// Insertion sort: two or three keys are usual, eight is the maximum. Keys are the bits of distances that are not
/// negative, which order like integers.
#[inline(always)]
pub(super) fn sort_descending(keys: &mut [u32]) {
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
