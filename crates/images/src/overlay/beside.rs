//! Overlays beside the picture: the picture leaves a strip of the page at the left or right, above or below.

use super::layout::{Corner, Layout};
use super::{Content, FrameView, Orientation, Overlay};

/// A page, and where the picture of the particles is on it, pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Page {
    /// Width and height of the page.
    pub size: [u32; 2],
    /// Column and row of the picture.
    pub at: [u32; 2],
    /// Width and height of the picture.
    pub picture: [u32; 2],
}

/// The side of the picture where an overlay is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Side {
    Left,
    Right,
    Top,
    Bottom,
}

/// Distance of overlays from the picture and from each other, in units of the size of their text.
const GAP: f32 = 0.8;
/// Distance from the edge of the page: that of a frame with its halo.
const EDGE: f32 = 0.3;
/// Room for values that are longer in other frames, in units of the size of text.
const SLACK: f32 = 1.2;
/// Width that a scale bar may have, as a fraction of the height of the page: see `ScaleBar::round_length`.
const SCALE_BAR: f32 = 0.2;

impl Overlay {
    fn side(&self) -> Side {
        let is_flat = matches!(&self.content,
            Content::ColorBar(bar) if bar.orientation == Orientation::Horizontal);
        match (is_flat, self.corner) {
            (true, Some(corner)) if corner.is_top() => Side::Top,
            (true, _) => Side::Bottom,
            (false, Some(corner)) if corner.is_left() => Side::Left,
            (false, _) => Side::Right,
        }
    }

    /// The lengths around it: to the picture, and to the edge of the page, pixels.
    #[expect(clippy::cast_possible_truncation, reason = "a few pixels")]
    fn margins(&self, height: u32) -> [i32; 2] {
        let size = self.pen(height).font.size;
        [GAP, EDGE].map(|margin| (margin * size).ceil() as i32)
    }

    /// The size for which room is left: that of any frame.
    #[expect(clippy::cast_possible_truncation, reason = "pixels")]
    fn room(&self, height: u32, frame: &FrameView) -> [i32; 2] {
        let [width, own_height] = self.measure(height, frame);
        let width = match &self.content {
            Content::Text(template) if template.varies() => {
                width + (SLACK * self.pen(height).font.size).ceil() as i32
            }
            Content::ScaleBar(_) => width.max((SCALE_BAR * height as f32).ceil() as i32),
            _ => width,
        };
        [width, own_height]
    }
}

impl Page {
    /// A picture that fills its page.
    pub const fn whole(width: u32, height: u32) -> Self {
        Self { size: [width, height], at: [0, 0], picture: [width, height] }
    }

    /// Whether the picture fills the page.
    pub fn is_whole(&self) -> bool {
        self.size == self.picture
    }

    /// The page of this size with room for those of the `overlays` that are beside the picture. `frame` has values as
    /// long as those of most frames. The picture may be empty.
    pub fn with_room_for(
        overlays: &[Overlay],
        [width, height]: [u32; 2],
        frame: &FrameView,
    ) -> Self {
        let strip = |side: Side| {
            // Find the overlays at this side
            let is_own = |o: &&Overlay| o.layout == Layout::Beside && o.side() == side;
            let own: Vec<&Overlay> = overlays.iter().filter(is_own).collect();
            let [gap, edge] = largest_margins(own.iter().copied(), height);
            let axis = usize::from(matches!(side, Side::Top | Side::Bottom));
            // Add up their sizes, with gaps between them and a margin at the edge
            let rooms = own.iter().map(|o| o.room(height, frame)[axis]);
            // One below the other in both kinds of strips
            let room: i32 = match axis {
                0 => rooms.max().unwrap_or(0),
                _ => rooms.map(|room| room + gap).sum::<i32>() - gap,
            };
            let strip = if own.is_empty() { 0 } else { room + gap + edge };
            u32::try_from(strip).unwrap_or(0)
        };
        // The picture gets what is left
        let [left, right, top, bottom] =
            [Side::Left, Side::Right, Side::Top, Side::Bottom].map(strip);
        Self {
            size: [width, height],
            at: [left, top],
            picture: [
                width.saturating_sub(left.saturating_add(right)),
                height.saturating_sub(top.saturating_add(bottom)),
            ],
        }
    }

    /// The top left corners of overlays beside the picture, in the order of `items`: overlays with their sizes.
    pub(super) fn places(&self, items: &[(&Overlay, [i32; 2])]) -> Vec<[i32; 2]> {
        let mut places = vec![[0, 0]; items.len()];
        for side in [Side::Left, Side::Right, Side::Top, Side::Bottom] {
            let own = (0..items.len()).filter(|i| items[*i].0.side() == side);
            // Those without a corner are in the middle
            for corner in [Some(true), Some(false), None] {
                let stack: Vec<usize> = (own.clone())
                    .filter(|i| items[*i].0.corner.map(Corner::is_top) == corner)
                    .collect();
                self.stack(side, corner, &stack, items, &mut places);
            }
        }
        places
    }

    /// Places the items `stack` below each other at one side.
    fn stack(
        &self,
        side: Side,
        is_top: Option<bool>,
        stack: &[usize],
        items: &[(&Overlay, [i32; 2])],
        places: &mut [[i32; 2]],
    ) {
        let [width, height] = self.size.map(u32::cast_signed);
        let [left, top] = self.at.map(u32::cast_signed);
        let [own_width, own_height] = self.picture.map(u32::cast_signed);
        // Find the height of the whole stack
        let [gap, edge] = largest_margins(stack.iter().map(|i| items[*i].0), self.size[1]);
        let total: i32 = stack.iter().map(|i| items[*i].1[1] + gap).sum::<i32>() - gap;
        // Align it with the picture
        let wanted = match (side, is_top) {
            (Side::Top, _) => edge,
            (Side::Bottom, _) => top + own_height + gap,
            (_, Some(true)) => top + edge,
            (_, Some(false)) => top + own_height - total - edge,
            (_, None) => top + (own_height - total) / 2,
        };
        let mut y = wanted.min(height - total).max(0);
        // Place the items from top to bottom
        for i in stack {
            let size = items[*i].1;
            let x = match side {
                Side::Left => edge,
                Side::Right => left + own_width + gap,
                Side::Top | Side::Bottom => left + (own_width - size[0]) / 2,
            };
            places[*i] = [x.min(width - size[0]).max(0), y];
            y += size[1] + gap;
        }
    }
}

/// The largest margins of `overlays` on a page of this height: to the picture, and to the edge of the page, pixels.
fn largest_margins<'a>(overlays: impl Iterator<Item = &'a Overlay>, height: u32) -> [i32; 2] {
    overlays.fold([0, 0], |most, overlay| {
        let own = overlay.margins(height);
        std::array::from_fn(|i| most[i].max(own[i]))
    })
}
