//! The one walk through a tree, whatever built it, wherever its leaves lie and whatever instructions test
//! nodes and blocks.

use super::leaves::Leaves;
use super::levels::MAX_LEVELS;
use super::simd::Kernel;
use super::topology::{Place, Topology};
use super::view::Resolved;
use spherule_formats::blocks::{Node, WIDTH};

/// Every level can leave all children but one on the stack.
pub(super) const STACK_SIZE: usize = MAX_LEVELS * (WIDTH - 1) + 1;

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
pub(super) fn walk<'a, K: Kernel, T: Topology<'a>, L: Leaves>(
    kernel: K,
    tree: Resolved<'a, T, L>,
    test: impl Fn(&Node, f32) -> (usize, K::Keys),
    mut limit: f32,
    mut visit: impl FnMut(usize, f32) -> f32,
) {
    if tree.view.is_empty() {
        return;
    }
    let topology = tree.topology;
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
            Place::Node(node) => {
                let (found, keys) = test(node, limit);
                let below = Below {
                    tree,
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
struct Below<'a, T: Topology<'a>, L> {
    tree: Resolved<'a, T, L>,
    children: T::Children,
}

impl<'a, T: Topology<'a>, L: Leaves> Below<'a, T, L> {
    /// Code of the child that a key is for.
    #[inline(always)]
    fn code(&self, key: u32) -> u32 {
        self.tree.topology.child(self.children, key & 7)
    }

    /// Asks for the memory of a child that will be visited, well before it is.
    #[inline(always)]
    fn prefetch<K: Kernel>(&self, kernel: K, code: u32) {
        match self.tree.topology.place(code) {
            Place::Block(block) => self.tree.leaves.prefetch(kernel, block),
            Place::Node(node) => kernel.prefetch(node),
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
