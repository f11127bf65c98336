//! Builds a tree of boxes: from the root down, by the surface area heuristic with bins (Wald, "On fast construction of
//! SAH-based bounding volume hierarchies", 2007). A node has eight children. Trees do not depend on threads.

use rayon::prelude::*;

use super::node::{Code, Node, WIDTH};
use spherule_tree::order::index_u32;

/// A grain and its box.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub(super) struct Item {
    pub(super) low: [f32; 3],
    /// The grain.
    pub(super) index: u32,
    pub(super) high: [f32; 3],
}

/// Bytes of an item.
pub(super) const ITEM_BYTES: u64 = size_of::<Item>() as u64;

/// Bins along an axis.
const BINS: usize = 16;

/// Levels below the root whose children are built in parallel.
const PARALLEL_LEVELS: u32 = 2;

/// Up to this number, grains are sorted and divided into multiples of the width of a node.
const MAX_SORTED: usize = 512;

/// Level from which grains are divided into halves of equal number, so that the depth has a limit.
const MEDIAN_LEVEL: u32 = 16;

/// Greatest number of levels: each from [`MEDIAN_LEVEL`] on has at most half of the grains, of at most 2^31.
pub(super) const MAX_LEVELS: usize = MEDIAN_LEVEL as usize + 31;

/// A box: lowest and highest corner.
#[derive(Debug, Clone, Copy)]
struct Bounds([[f32; 3]; 2]);

impl Bounds {
    const EMPTY: Self = Self([[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]]);

    fn of(items: &[Item]) -> Self {
        items.iter().fold(Self::EMPTY, |all, item| all.with(item.low, item.high))
    }

    /// The box with another one.
    #[inline(always)]
    fn with(mut self, low: [f32; 3], high: [f32; 3]) -> Self {
        for axis in 0..3 {
            self.0[0][axis] = if low[axis] < self.0[0][axis] { low[axis] } else { self.0[0][axis] };
            self.0[1][axis] =
                if high[axis] > self.0[1][axis] { high[axis] } else { self.0[1][axis] };
        }
        self
    }

    fn join(self, other: Self) -> Self {
        self.with(other.0[0], other.0[1])
    }

    /// Half the area of its surface; 0 if it is empty.
    fn half_area(&self) -> f32 {
        let [low, high] = &self.0;
        let [x, y, z] = [high[0] - low[0], high[1] - low[1], high[2] - low[2]];
        if x < 0.0 { 0.0 } else { x * y + y * z + z * x }
    }
}

/// The nodes over `items`, root first, and the items in the order of leaves. Empty without items.
pub(super) fn build(items: &mut [Item]) -> Vec<Node> {
    let mut nodes = Vec::new();
    if !items.is_empty() {
        nodes.reserve(items.len() / 4 + 1);
        grow(items, 0, 0, &mut nodes);
        nodes.shrink_to_fit();
    }
    nodes
}

/// A range of items that becomes a child.
struct Part<'i> {
    items: &'i mut [Item],
    /// Place of its first item.
    first: usize,
    bounds: Bounds,
}

impl<'i> Part<'i> {
    fn new(items: &'i mut [Item], first: usize) -> Self {
        let bounds = Bounds::of(items);
        Self { items, first, bounds }
    }

    /// Expected cost of rays that enter it.
    fn cost(&self) -> f32 {
        self.bounds.half_area() * self.items.len() as f32
    }
}

/// Appends the node over `items`, the first of which is at `first`, and all nodes below it.
fn grow(items: &mut [Item], first: usize, level: u32, nodes: &mut Vec<Node>) {
    let at = nodes.len();
    nodes.push(Node::EMPTY);
    let parts = divide(items, first, level);
    let boxes: Vec<[[f32; 3]; 2]> = parts.iter().map(|part| part.bounds.0).collect();
    if level < PARALLEL_LEVELS {
        // Build the subtrees on their own, and append them in their order
        let subtrees: Vec<(Option<Code>, Vec<Node>)> = parts
            .into_par_iter()
            .map(|part| {
                let mut below = Vec::new();
                (child(part, level, &mut below), below)
            })
            .collect();
        for (slot, (leaf, below)) in subtrees.into_iter().enumerate() {
            let start = index_u32(nodes.len());
            nodes[at].set(slot, boxes[slot], leaf.unwrap_or(Code(start)));
            nodes.extend(below.into_iter().map(|node| node.moved_by(start)));
        }
    } else {
        for (slot, part) in parts.into_iter().enumerate() {
            let start = index_u32(nodes.len());
            let leaf = child(part, level, nodes);
            nodes[at].set(slot, boxes[slot], leaf.unwrap_or(Code(start)));
        }
    }
}

/// The code of a leaf; None after the nodes of a larger part have been appended.
fn child(part: Part<'_>, level: u32, nodes: &mut Vec<Node>) -> Option<Code> {
    if part.items.len() == 1 {
        return Some(Code::leaf(index_u32(part.first)));
    }
    grow(part.items, part.first, level + 1, nodes);
    None
}

/// Divides items into up to eight parts.
fn divide(items: &mut [Item], first: usize, level: u32) -> Vec<Part<'_>> {
    let bounds = Bounds::of(items);
    let mut parts = vec![Part { items, first, bounds }];
    while parts.len() < WIDTH {
        // Divide the part with the greatest cost that does not fit into a node
        let large = costliest(&parts, |count| count > WIDTH);
        if let Some(place) = large {
            let Part { items, first, .. } = parts.swap_remove(place);
            let middle = split(items, level);
            let (left, right) = items.split_at_mut(middle);
            parts.push(Part::new(left, first));
            parts.push(Part::new(right, first + middle));
            continue;
        }
        // Else, take the grains of a whole part into this node
        let free = WIDTH - parts.len();
        let Some(place) = costliest(&parts, |count| count > 1 && count <= free + 1) else { break };
        let Part { items, first, .. } = parts.swap_remove(place);
        let singles = items.chunks_mut(1).enumerate();
        parts.extend(singles.map(|(place, item)| Part::new(item, first + place)));
    }
    parts
}

/// The part with the greatest cost among those with a number of grains that is `allowed`.
fn costliest(parts: &[Part<'_>], allowed: impl Fn(usize) -> bool) -> Option<usize> {
    let places = (0..parts.len()).filter(|place| allowed(parts[*place].items.len()));
    places.reduce(|a, b| if parts[b].cost() > parts[a].cost() { b } else { a })
}

/// Twice the centre of an item along an axis.
#[inline(always)]
fn doubled_center(item: &Item, axis: usize) -> f32 {
    item.low[axis] + item.high[axis]
}

/// Divides at least two items, and returns the number of those in the first part.
fn split(items: &mut [Item], level: u32) -> usize {
    // Use the axis along which centres differ most
    let centers = items.iter().fold(Bounds::EMPTY, |all, item| {
        let center = [0, 1, 2].map(|axis| doubled_center(item, axis));
        all.with(center, center)
    });
    let [low, high] = centers.0;
    let sizes = [0, 1, 2].map(|axis| high[axis] - low[axis]);
    let axis = (0..3).reduce(|a, b| if sizes[b] > sizes[a] { b } else { a }).unwrap_or(0);
    let half = items.len() / 2;
    let is_divisible = sizes[axis] > 0.0;
    if !is_divisible {
        return half;
    }
    let order = |a: &Item, b: &Item| {
        let center = |item| doubled_center(item, axis);
        center(a).total_cmp(&center(b)).then(a.index.cmp(&b.index))
    };
    if level >= MEDIAN_LEVEL {
        items.select_nth_unstable_by(half, order);
        return half;
    }
    if items.len() <= MAX_SORTED {
        items.sort_unstable_by(order);
        return best_multiple(items);
    }
    let scale = BINS as f32 / sizes[axis];
    let bin = |item: &Item| bin_of(doubled_center(item, axis) - low[axis], scale);
    let plane = best_plane(items, bin);
    let middle = partition(items, |item| bin(item) < plane);
    // Rounding may leave a part empty
    if middle == 0 || middle == items.len() { half } else { middle }
}

/// The number of items in the first part, a multiple of the width of a node, so that few nodes have empty places. The
/// items are sorted, and there are more than the width of a node.
fn best_multiple(items: &[Item]) -> usize {
    let chunks: Vec<Bounds> = items.chunks(WIDTH).map(Bounds::of).collect();
    // Sum up the costs from both sides
    let mut costs = [0.0_f32; MAX_SORTED / WIDTH];
    let mut left = Bounds::EMPTY;
    for plane in 1..chunks.len() {
        left = left.join(chunks[plane - 1]);
        costs[plane] = left.half_area() * (plane * WIDTH) as f32;
    }
    let mut right = Bounds::EMPTY;
    for plane in (1..chunks.len()).rev() {
        right = right.join(chunks[plane]);
        costs[plane] += right.half_area() * (items.len() - plane * WIDTH) as f32;
    }
    let planes = 2..chunks.len();
    WIDTH * planes.fold(1, |best, plane| if costs[plane] < costs[best] { plane } else { best })
}

/// The bin at a distance from the first centre.
#[inline(always)]
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "distances are not negative, and larger ones are limited"
)]
fn bin_of(distance: f32, scale: f32) -> usize {
    ((distance * scale) as usize).min(BINS - 1)
}

/// The first bin of the second part.
fn best_plane(items: &[Item], bin: impl Fn(&Item) -> usize) -> usize {
    // Fill the bins
    let mut bins = [(Bounds::EMPTY, 0_usize); BINS];
    for item in items {
        let (bounds, count) = &mut bins[bin(item)];
        *bounds = bounds.with(item.low, item.high);
        *count += 1;
    }
    // Sum up the costs from both sides
    let mut costs = [0.0_f32; BINS];
    let (mut left, mut count) = (Bounds::EMPTY, 0);
    for (plane, (bounds, more)) in bins.iter().enumerate().take(BINS - 1) {
        (left, count) = (left.join(*bounds), count + more);
        costs[plane + 1] = left.half_area() * count as f32;
    }
    let (mut right, mut count) = (Bounds::EMPTY, 0);
    for (plane, (bounds, more)) in bins.iter().enumerate().skip(1).rev() {
        (right, count) = (right.join(*bounds), count + more);
        costs[plane] += right.half_area() * count as f32;
    }
    (2..BINS).fold(1, |best, plane| if costs[plane] < costs[best] { plane } else { best })
}

/// Moves the items that are `first` to the front, and returns their number.
fn partition(items: &mut [Item], is_first: impl Fn(&Item) -> bool) -> usize {
    let (mut start, mut end) = (0, items.len());
    loop {
        while start < end && is_first(&items[start]) {
            start += 1;
        }
        while start < end && !is_first(&items[end - 1]) {
            end -= 1;
        }
        if start >= end {
            return start;
        }
        items.swap(start, end - 1);
    }
}
