//! Reference unsplitting (Stich et al. 2009, section 4.4): a sphere that the plane meets goes to one
//! side whole where that is cheaper than to have it on both.

use super::reference::{Bounds, Parts, Reference};
use super::split::Split;

/// Where a reference goes.
enum Side {
    Below,
    Above,
    Both([Bounds; 2]),
}

/// Divides the references that `plane` meets. Those that go below come to the front of
/// `straddlers`; returns how many they are, and those that go above.
pub(super) fn divide(
    straddlers: &mut [Reference],
    split: &Split,
    plane: f32,
    parts: Parts,
) -> (usize, Vec<Reference>) {
    let mut sides = Sides {
        boxes: split.boxes,
        areas: split.boxes.map(Bounds::area),
        counts: split.counts,
    };
    let (mut below, mut above) = (0, Vec::new());
    for at in 0..straddlers.len() {
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

/// The two sides as they would be if all that are still to come were on both.
struct Sides {
    boxes: [Bounds; 2],
    areas: [f64; 2],
    counts: [usize; 2],
}

impl Sides {
    /// Where a reference of the box `whole`, in `halves` by the plane, is cheapest. Counts are not
    /// rounded up to blocks here, or one reference would hardly ever matter. No side is left empty.
    fn place(&mut self, whole: Bounds, halves: [Bounds; 2]) -> Side {
        #[expect(clippy::cast_precision_loss, reason = "fewer than 2^53")]
        let counts = self.counts.map(|count| count as f64);
        let alone = [0, 1].map(|side| self.boxes[side].union(whole));
        let alone_areas = alone.map(Bounds::area);
        let both = self.areas[0] * counts[0] + self.areas[1] * counts[1];
        // Staying on one side makes that one larger and takes the reference from the other.
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
        self.boxes[side] = alone[side];
        self.areas[side] = alone_areas[side];
        self.counts[1 - side] -= 1;
        if side == 0 { Side::Below } else { Side::Above }
    }
}
