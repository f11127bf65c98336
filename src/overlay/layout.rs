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

/// The place of an overlay.
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

    const fn is_left(self) -> bool {
        matches!(self, Self::TopLeft | Self::BottomLeft)
    }

    const fn is_top(self) -> bool {
        matches!(self, Self::TopLeft | Self::TopRight)
    }

    /// The first of `corners`, best first, with the fewest `points` of a picture inside a box of `size` there. Points
    /// and size are in pixels.
    pub fn freest(
        corners: &[Self],
        offset: [f32; 2],
        size: [i32; 2],
        picture: [u32; 2],
        points: &[[f32; 2]],
    ) -> Self {
        let covered = |corner: &&Self| {
            let placement = Placement { corner: **corner, offset };
            let [left, top] = placement.place(size, 0, picture).map(|v| v as f32);
            let [right, bottom] = [left + size[0] as f32, top + size[1] as f32];
            let is_inside =
                |p: &&[f32; 2]| (left..=right).contains(&p[0]) && (top..=bottom).contains(&p[1]);
            points.iter().filter(is_inside).count()
        };
        let best = corners.iter().min_by_key(covered);
        best.copied().unwrap_or(Self::TopLeft)
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
        let x = match self.corner.is_left() {
            true => offset[0],
            false => far(width, size[0], offset[0]),
        };
        let y = match self.corner.is_top() {
            true => offset[1].saturating_add(below),
            false => far(height, size[1], offset[1]).saturating_sub(below),
        };
        [x, y]
    }
}

/// The top left corners of boxes of these `sizes` in a picture. Boxes with the same placement are stacked, the first
/// one nearest to the corner.
pub(super) fn place(
    placements: &[Placement],
    sizes: &[[i32; 2]],
    picture: [u32; 2],
) -> Vec<[i32; 2]> {
    #[expect(clippy::cast_possible_truncation, reason = "pixels")]
    let gap = (GAP * picture[1] as f32).round() as i32;
    let mut placed = Vec::with_capacity(placements.len());
    for (i, placement) in placements.iter().enumerate() {
        let before = placements[..i].iter().zip(sizes);
        let before = before.filter(|(other, _)| *other == placement);
        let below = before.fold(0_i32, |sum, (_, size)| sum.saturating_add(size[1] + gap));
        placed.push(placement.place(sizes[i], below, picture));
    }
    placed
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
        assert_eq!(place(&all, &sizes, PICTURE), [[340, 150], [10, 20], [370, 136]]);
    }

    #[test]
    fn the_free_corner_is_chosen() {
        let order = [Corner::BottomRight, Corner::TopRight, Corner::BottomLeft, Corner::TopLeft];
        let free =
            |points: &[[f32; 2]]| Corner::freest(&order, [0.05, 0.1], [50, 30], PICTURE, points);
        assert_eq!(free(&[]), Corner::BottomRight);
        assert_eq!(free(&[[200.0, 100.0]]), Corner::BottomRight);
        assert_eq!(free(&[[350.0, 160.0]]), Corner::TopRight);
        assert_eq!(free(&[[350.0, 160.0], [350.0, 30.0]]), Corner::BottomLeft);
        // All are covered: the one with the fewest points
        let all = [[350.0, 160.0], [351.0, 161.0], [350.0, 30.0], [20.0, 160.0], [20.0, 30.0]];
        assert_eq!(free(&all), Corner::TopRight);
    }
}
