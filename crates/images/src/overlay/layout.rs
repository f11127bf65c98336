//! Places of overlays: corners of the picture, and the free one among them.

/// A corner of the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Corner {
    /// Top left.
    TopLeft,
    /// Top right.
    TopRight,
    /// Bottom left.
    BottomLeft,
    /// Bottom right.
    BottomRight,
}

/// The direction of a colour bar.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Orientation {
    /// Values rise upwards; labels are at the right.
    #[default]
    Vertical,
    /// Values rise to the right; labels are below.
    Horizontal,
}

/// Whether an overlay covers the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Layout {
    /// It is drawn over the picture.
    #[default]
    Over,
    /// The picture leaves room for it.
    Beside,
}

/// The place of an overlay over the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// The corner.
    pub corner: Corner,
    /// Horizontal and vertical distance from it, as fractions of the height of the picture.
    pub offset: [f32; 2],
}

/// Vertical distance of overlays in the same corner, as a fraction of the height of the picture.
const GAP: f32 = 0.02;

impl Corner {
    /// All corners.
    pub const ALL: [Self; 4] = [Self::TopLeft, Self::TopRight, Self::BottomLeft, Self::BottomRight];

    pub(super) const fn is_left(self) -> bool {
        matches!(self, Self::TopLeft | Self::BottomLeft)
    }

    pub(super) const fn is_top(self) -> bool {
        matches!(self, Self::TopLeft | Self::TopRight)
    }
}

impl Placement {
    /// The middle of a box of `size`, as fractions of the picture.
    pub fn center(&self, size: [i32; 2], picture: [u32; 2]) -> [f32; 2] {
        let corner = self.place(size, 0, picture);
        std::array::from_fn(|axis| {
            let middle = corner[axis] as f32 + 0.5 * size[axis] as f32;
            (middle / picture[axis].max(1) as f32).clamp(0.0, 1.0)
        })
    }

    /// The top left corner of a box, `below` others in the same corner.
    fn place(&self, size: [i32; 2], below: i32, picture: [u32; 2]) -> [i32; 2] {
        #[expect(clippy::cast_possible_truncation, reason = "pixels, saturated")]
        let offset = self.offset.map(|part| (part * picture[1] as f32).round() as i32);
        let [width, height] = picture.map(|side| i32::try_from(side).unwrap_or(i32::MAX));
        let far =
            |length: i32, own: i32, offset: i32| length.saturating_sub(own).saturating_sub(offset);
        let x = if self.corner.is_left() { offset[0] } else { far(width, size[0], offset[0]) };
        let y = if self.corner.is_top() {
            offset[1].saturating_add(below)
        } else {
            far(height, size[1], offset[1]).saturating_sub(below)
        };
        [x, y]
    }
}

/// Boxes that have been placed over a picture, pixels.
#[derive(Debug, Clone)]
pub struct Boxes {
    picture: [u32; 2],
    placed: Vec<(Placement, [i32; 2], [i32; 2])>,
}

impl Boxes {
    /// No boxes in a picture of this size.
    pub const fn new(picture: [u32; 2]) -> Self {
        Self { picture, placed: Vec::new() }
    }

    /// The top left corner of a box of `size` that would be added now. Boxes with the same placement are stacked, the
    /// first one nearest to the corner.
    fn next(&self, placement: Placement, size: [i32; 2]) -> [i32; 2] {
        #[expect(clippy::cast_possible_truncation, reason = "pixels")]
        let gap = (GAP * self.picture[1] as f32).round() as i32;
        let before = self.placed.iter().filter(|(other, ..)| *other == placement);
        let below = before.fold(0_i32, |sum, (_, _, size)| sum.saturating_add(size[1] + gap));
        placement.place(size, below, self.picture)
    }

    /// Adds a box, and returns its top left corner.
    pub fn add(&mut self, placement: Placement, size: [i32; 2]) -> [i32; 2] {
        let corner = self.next(placement, size);
        self.placed.push((placement, corner, size));
        corner
    }

    /// The one of `corners`, best first, where a box of `size` covers no other box and the fewest `points`. A corner
    /// with a box is worse than a free one with as many points.
    pub fn freest(
        &self,
        corners: &[Corner],
        offset: [f32; 2],
        size: [i32; 2],
        points: &[[f32; 2]],
    ) -> Corner {
        let rank = |corner: &&Corner| {
            let placement = Placement { corner: **corner, offset };
            let at = self.next(placement, size);
            let [left, top] = at.map(|v| v as f32);
            let [right, bottom] = [left + size[0] as f32, top + size[1] as f32];
            let is_inside =
                |p: &&[f32; 2]| (left..=right).contains(&p[0]) && (top..=bottom).contains(&p[1]);
            let is_taken = self.placed.iter().any(|(other, ..)| other.corner == **corner);
            (self.overlaps(at, size), points.iter().filter(is_inside).count(), is_taken)
        };
        corners.iter().min_by_key(rank).copied().unwrap_or(Corner::TopLeft)
    }

    /// Whether a box covers another one or leaves the picture.
    fn overlaps(&self, at: [i32; 2], size: [i32; 2]) -> bool {
        let far = |at: [i32; 2], size: [i32; 2], axis: usize| at[axis].saturating_add(size[axis]);
        let leaves =
            |axis: usize| at[axis] < 0 || far(at, size, axis) > self.picture[axis].cast_signed();
        let covers = |(_, other, other_size): &(Placement, [i32; 2], [i32; 2])| {
            (0..2).all(|axis| {
                at[axis] < far(*other, *other_size, axis) && other[axis] < far(at, size, axis)
            })
        };
        (0..2).any(leaves) || self.placed.iter().any(covers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PICTURE: [u32; 2] = [400, 200];

    fn placement(corner: Corner) -> Placement {
        Placement { corner, offset: [0.05, 0.1] }
    }

    #[test]
    fn corners_and_offsets() {
        let place = |corner| placement(corner).place([50, 30], 0, PICTURE);
        assert_eq!(place(Corner::TopLeft), [10, 20]);
        assert_eq!(place(Corner::TopRight), [340, 20]);
        assert_eq!(place(Corner::BottomLeft), [10, 150]);
        assert_eq!(place(Corner::BottomRight), [340, 150]);
    }

    #[test]
    fn boxes_in_one_corner_are_stacked() {
        let all = [Corner::BottomRight, Corner::TopLeft, Corner::BottomRight].map(placement);
        let sizes = [[50, 30], [10, 10], [20, 10]];
        let mut boxes = Boxes::new(PICTURE);
        let places = all.into_iter().zip(sizes).map(|(placement, size)| boxes.add(placement, size));
        assert_eq!(places.collect::<Vec<_>>(), [[340, 150], [10, 20], [370, 136]]);
    }

    #[test]
    fn the_free_corner_is_chosen() {
        let order = [Corner::BottomRight, Corner::TopRight, Corner::BottomLeft, Corner::TopLeft];
        let boxes = Boxes::new(PICTURE);
        let free = |points: &[[f32; 2]]| boxes.freest(&order, [0.05, 0.1], [50, 30], points);
        assert_eq!(free(&[]), Corner::BottomRight);
        assert_eq!(free(&[[200.0, 100.0]]), Corner::BottomRight);
        assert_eq!(free(&[[350.0, 160.0]]), Corner::TopRight);
        assert_eq!(free(&[[350.0, 160.0], [350.0, 30.0]]), Corner::BottomLeft);
        // All are covered: the one with the fewest points
        let all = [[350.0, 160.0], [351.0, 161.0], [350.0, 30.0], [20.0, 160.0], [20.0, 30.0]];
        assert_eq!(free(&all), Corner::TopRight);
    }

    #[test]
    fn boxes_share_a_corner_rather_than_cover_particles() {
        let order = [Corner::TopLeft, Corner::BottomLeft, Corner::TopRight, Corner::BottomRight];
        let mut boxes = Boxes::new(PICTURE);
        boxes.add(placement(Corner::TopLeft), [50, 30]);
        let free = |boxes: &Boxes, points: &[[f32; 2]]| {
            boxes.freest(&order, [0.05, 0.1], [50, 30], points)
        };
        // An empty corner is better than a stack
        assert_eq!(free(&boxes, &[]), Corner::BottomLeft);
        // Below the first box is room
        let lower_and_right = [[20.0, 160.0], [350.0, 160.0], [350.0, 30.0]];
        assert_eq!(free(&boxes, &lower_and_right), Corner::TopLeft);
        // Not over a box of another corner
        boxes.add(placement(Corner::BottomLeft), [50, 100]);
        assert_ne!(free(&boxes, &lower_and_right), Corner::TopLeft);
    }
}
