//! What is around the pictures of a sheet: letters in their corners, and a common colour bar.

use super::MovieError;
use super::sheet_layout::{SheetBar, SheetLayout, SheetSettings};
use crate::overlay::{
    Color, ColorBar, Content, Corner, FrameView, Layout, Orientation, Overlay, Page, Placement,
    Template,
};
use crate::picture::Picture;

/// Length of a bar as a fraction of the pictures beside it.
const LENGTH: f32 = 0.8;

/// Distance of letters from the edges of their picture, in units of the size of text.
const LETTER_OFFSET: f32 = 0.4;

/// Part of a picture that decides the colour of its letter, in units of the size of text.
const LETTER_BOX: f32 = 2.0;

/// Overlays of a sheet.
pub(super) struct Decoration {
    pub(super) overlays: Vec<Overlay>,
    pub(super) page: Page,
}

impl Decoration {
    /// The places of `count` pictures, and the colour bar beside them.
    pub(super) fn around(
        count: usize,
        picture: [usize; 2],
        settings: &SheetSettings,
    ) -> Result<(SheetLayout, Self), MovieError> {
        let mut layout = SheetLayout::new(count, picture, settings);
        let mut page = whole(layout.size);
        let Some(SheetBar { bar }) = &settings.bar else {
            return Ok((layout, Self { overlays: Vec::new(), page }));
        };
        // The room for the bar depends on its labels, and these on its length
        let mut overlay = beside(bar, &page, settings.text);
        for _ in 0..3 {
            let room = room(&overlay, &page);
            let width = settings.width.saturating_sub(room[0] as usize);
            if 2 * width < settings.width {
                return Err(MovieError::NoRoom { width: settings.width });
            }
            layout = SheetLayout::new(count, picture, &SheetSettings { width, ..settings.clone() });
            let grid = whole(layout.size).size;
            page = Page { size: [grid[0] + room[0], grid[1] + room[1]], at: [0, 0], picture: grid };
            overlay = beside(bar, &page, settings.text);
        }
        Ok((layout, Self { overlays: vec![overlay], page }))
    }

    /// Adds the letters of picture number `index`, which is at `place` among the pictures.
    pub(super) fn add_letter(
        &mut self,
        index: usize,
        place: [usize; 2],
        picture: &Picture,
        settings: &SheetSettings,
    ) {
        let Some(style) = &settings.letters else { return };
        let height = self.page.picture[1].max(1) as f32;
        let offset = place.map(|at| (at as f32 + LETTER_OFFSET * settings.text) / height);
        let Ok(template) = Template::parse(&style.of(index)) else { return };
        let is_dark = is_dark(picture, LETTER_BOX * settings.text);
        let (color, halo) = if is_dark { ([1.0; 3], [0.0; 3]) } else { ([0.0; 3], [1.0; 3]) };
        let content = Content::Text(template);
        self.overlays.push(Overlay {
            layout: Layout::Over,
            placement: Placement { corner: Corner::TopLeft, offset },
            ..overlay(content, &self.page, settings.text, color, halo)
        });
    }
}

fn whole(size: [usize; 2]) -> Page {
    let [width, height] = size.map(|side| u32::try_from(side).unwrap_or(u32::MAX));
    Page::whole(width, height)
}

/// Width and height that an overlay needs beside the pictures, pixels.
fn room(overlay: &Overlay, page: &Page) -> [u32; 2] {
    let around =
        Page::with_room_for(std::slice::from_ref(overlay), page.size, &FrameView::default());
    [0, 1].map(|axis| around.size[axis] - around.picture[axis])
}

/// `bar` beside the pictures of `page`.
fn beside(bar: &ColorBar, page: &Page, text: f32) -> Overlay {
    let along = match bar.orientation {
        Orientation::Vertical => page.picture[1],
        Orientation::Horizontal => page.picture[0],
    };
    let length = LENGTH * along as f32 / page.size[1].max(1) as f32;
    let content = Content::ColorBar(ColorBar { length, ..bar.clone() });
    overlay(content, page, text, [0.0; 3], [1.0; 3])
}

fn overlay(content: Content, page: &Page, text: f32, color: Color, halo: Color) -> Overlay {
    Overlay {
        content,
        layout: Layout::Beside,
        corner: None,
        placement: Placement { corner: Corner::TopLeft, offset: [0.0; 2] },
        size: text / page.size[1].max(1) as f32,
        color,
        halo,
    }
}

/// Whether the top left corner of a picture is dark.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "pixels; saturates")]
fn is_dark(picture: &Picture, side: f32) -> bool {
    let side = (side as usize).max(1);
    let rows = (0..picture.height().min(side)).map(|y| picture.row(y));
    let (mut sum, mut count) = (0_u64, 0_u64);
    for [r, g, b] in rows.flat_map(|row| row.as_chunks::<3>().0.iter().take(side)) {
        sum += 2 * u64::from(*r) + 7 * u64::from(*g) + u64::from(*b);
        count += 10;
    }
    // The middle between black and white text is at 0.18 of the light, 46 % of sRGB
    sum < 117 * count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_stand_out_from_their_picture() {
        let dark = Picture::filled(9, 9, [40, 60, 90]);
        assert!(is_dark(&dark, 20.0));
        assert!(!is_dark(&Picture::filled(9, 9, [200, 190, 180]), 3.0));
    }
}
