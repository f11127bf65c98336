//! Long rods in several boxes along their length: the box of a diagonal is mostly empty, and a ray would be intersected
//! with all rods whose boxes it passes.

use glam::DVec3;

use super::{Caps, Rod, double, interval::Body};

/// Length of a part as a fraction of the size of all rods, so that there is little to gain from shorter ones.
const SHORTEST: f64 = 1.0 / 64.0;

/// Number of parts that are always possible beyond one for each rod.
const SPARE_PARTS: f64 = 65_536.0;
/// Number of further ones for each rod.
const PARTS_PER_ROD: f64 = 0.5;

/// A part of a rod.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Part {
    /// Index of the rod.
    pub(super) rod: u32,
    /// Number of the part.
    number: u32,
    /// Number of parts of the rod.
    count: u32,
}

/// The parts of `rods` in their order. `size` is that of all of them.
pub(super) fn parts_of(rods: &[Rod], size: f64) -> Vec<Part> {
    let length = |rod: &Rod| double(rod.ends[0]).distance(double(rod.ends[1]));
    let shortest = SHORTEST * size;
    let long = |rod: &&Rod| length(rod) >= 2.0 * shortest;
    let total: f64 = rods.iter().filter(long).map(length).sum();
    // Parts as long as the number of parts allows
    let part = shortest.max(total / (SPARE_PARTS + PARTS_PER_ROD * rods.len() as f64));
    let of_rod = |(rod, value): (u32, &Rod)| {
        #[expect(
            clippy::cast_possible_truncation,
            reason = "a rod is at most as long as the diagonal of all rods"
        )]
        let parts = (length(value) / part).ceil().max(1.0) as u32;
        let count = if long(&value) { parts } else { 1 };
        (0..count).map(move |number| Part { rod, number, count })
    };
    (0..).zip(rods).flat_map(of_rod).collect()
}

impl Part {
    /// Lowest and highest corner of a box around it. A rod is within the spheres along its axis.
    pub(super) fn bounds(&self, rods: &[Rod], caps: Caps) -> [DVec3; 2] {
        let rod = &rods[self.rod as usize];
        let [min, max] = Body::new(rod, caps).bounds();
        if self.count == 1 {
            return [min, max];
        }
        let ends = self.ends(rod);
        let [low, high] =
            [-1.0, 1.0].map(|side| ends.map(|(center, radius)| center + side * radius));
        [low[0].min(low[1]).max(min), high[0].max(high[1]).min(max)]
    }

    /// Centre and radius of a sphere around it.
    pub(super) fn sphere(&self, rods: &[Rod], caps: Caps) -> (DVec3, f64) {
        let [(a, r), (b, s)] = self.ends(&rods[self.rod as usize]);
        let (half, radius) = (0.5 * a.distance(b), r.max(s));
        let reach = match caps {
            Caps::Round => half + radius,
            // Around the circles at both ends
            Caps::Open | Caps::Flat if self.count == 1 => (half * half + radius * radius).sqrt(),
            // A frustum is within the spheres along its axis
            Caps::Open | Caps::Flat => half + radius,
        };
        (0.5 * (a + b), reach)
    }

    /// The points of the axis at its ends, and the radii there.
    fn ends(&self, rod: &Rod) -> [(DVec3, f64); 2] {
        let [a, b] = rod.ends.map(double);
        let [r, s] = rod.radii.map(f64::from);
        [self.number, self.number + 1].map(|number| {
            let along = f64::from(number) / f64::from(self.count);
            (a.lerp(b, along), r + along * (s - r))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// `count` rods between pseudo-random places of a cube.
    fn rods(count: usize) -> Vec<Rod> {
        let mut state = 1_u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let mut point = || Vec3::new(random(), random(), random());
        let rods = (0..count).map(|_| Rod::line([point(), point()], 1e-3));
        rods.collect()
    }

    /// The area of all boxes: what rays at random meet.
    fn area(rods: &[Rod], parts: &[Part]) -> f64 {
        let area = |part: &Part| {
            let [min, max] = part.bounds(rods, Caps::Round);
            let size = max - min;
            size.x * size.y + size.y * size.z + size.z * size.x
        };
        parts.iter().map(area).sum()
    }

    #[test]
    fn long_rods_have_small_boxes_and_short_ones_have_one() {
        let long = rods(1000);
        let parts = parts_of(&long, 1.0);
        let whole: Vec<Part> = (0..1000).map(|rod| Part { rod, number: 0, count: 1 }).collect();
        let ratio = area(&long, &parts) / area(&long, &whole);
        assert!(ratio < 0.1, "{ratio}");
        assert_eq!(parts_of(&long, 100.0), whole);
        // The boxes of the parts make up that of the rod
        let mut at = 0;
        for (rod, _) in (0..).zip(&long) {
            let own = &parts[at..][..parts[at].count as usize];
            at += own.len();
            let boxes = own.iter().map(|part| part.bounds(&long, Caps::Flat));
            let union = boxes.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
            let whole = Part { rod, number: 0, count: 1 };
            assert_eq!(union, Some(whole.bounds(&long, Caps::Flat)));
        }
        assert_eq!(at, parts.len());
    }

    #[test]
    fn the_number_of_parts_is_limited() {
        let many = rods(200_000);
        let parts = parts_of(&many, 1.0);
        assert!(parts.len() > 220_000 && parts.len() <= 200_000 * 3 / 2 + 65_536);
    }
}
