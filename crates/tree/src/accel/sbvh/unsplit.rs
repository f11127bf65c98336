//! Reference unsplitting (Stich et al. 2009, section 4.4): a sphere that crosses the plane is assigned to one child
//! entirely if that is cheaper than a reference in both.

use super::reference::{Bounds, Parts, Reference};
use super::split::Split;

/// Assignment of a reference to the children.
enum Side {
    Below,
    Above,
    Both([Bounds; 2]),
}

/// Assigns the references that `plane` cuts. References of the lower child are moved to the front of `straddlers`.
/// Returns their number, and the references of the upper child.
pub(super) fn divide(
    straddlers: &mut [Reference],
    split: &Split,
    plane: f32,
    parts: Parts,
) -> (usize, Vec<Reference>) {
    let mut sides =
        Sides { boxes: split.boxes, areas: split.boxes.map(Bounds::area), counts: split.counts };
    let (mut below, mut above) = (0, Vec::new());
    for at in 0..straddlers.len() {
        // Cut the reference, and keep the cheapest of the three choices
        let reference = straddlers[at];
        let halves = parts.cut(&reference, split.axis, plane);
        match sides.place(reference.bounds(), halves) {
            Side::Above => above.push(reference),
            Side::Below => {
                straddlers[below] = reference;
                below += 1;
            }
            Side::Both([lower, upper]) => {
                straddlers[below] = Reference::new(lower, reference.particle);
                below += 1;
                above.push(Reference::new(upper, reference.particle));
            }
        }
    }
    (below, above)
}

/// The two children, under the assumption that all remaining references belong to both.
struct Sides {
    boxes: [Bounds; 2],
    areas: [f64; 2],
    counts: [usize; 2],
}

impl Sides {
    /// The cheapest assignment of a reference with the box `whole`, which the plane cuts into `halves`. Counts are
    /// not rounded up to blocks here, because a single reference would then hardly ever matter. No child becomes
    /// empty.
    fn place(&mut self, whole: Bounds, halves: [Bounds; 2]) -> Side {
        #[expect(clippy::cast_precision_loss, reason = "fewer than 2^53")]
        let counts = self.counts.map(|count| count as f64);
        // Compute the cost of both choices that keep the reference whole, and of the split
        let alone = [0, 1].map(|side| self.boxes[side].union(whole));
        let alone_areas = alone.map(Bounds::area);
        let both = self.areas[0] * counts[0] + self.areas[1] * counts[1];
        // Keeping the reference on one side enlarges that side and removes the reference from the other.
        let cost = |side: usize| {
            let other = 1 - side;
            if self.counts[other] > 1 {
                alone_areas[side] * counts[side] + self.areas[other] * (counts[other] - 1.0)
            } else {
                f64::INFINITY
            }
        };
        let costs = [cost(0), cost(1)];
        let side = usize::from(costs[1] < costs[0]);
        if costs[side] > both {
            return Side::Both(halves);
        }
        // Update the children for the references that follow
        self.boxes[side] = alone[side];
        self.areas[side] = alone_areas[side];
        self.counts[1 - side] -= 1;
        if side == 0 { Side::Below } else { Side::Above }
    }
}
