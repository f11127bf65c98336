//! Sizes and pixels of overlays.

use super::*;
use crate::scene::ColorScale;

const BLACK: Color = [0.0; 3];

fn overlay(content: Content) -> Overlay {
    Overlay {
        content,
        layout: Layout::Over,
        corner: None,
        placement: Placement { corner: Corner::TopLeft, offset: [0.05, 0.05] },
        size: 0.05,
        color: BLACK,
        halo: [1.0; 3],
    }
}

fn text(text: &str) -> Overlay {
    overlay(Content::Text(Template::parse(text).unwrap()))
}

/// A bar from blue at 0 to yellow at 4.
fn bar(title: &str) -> Overlay {
    overlay(Content::ColorBar(ColorBar {
        title: title.to_owned(),
        unit: "m/s".to_owned(),
        length: 0.5,
        orientation: Orientation::Vertical,
        ticks: None,
        format: None,
        factor: 1.0,
        kind: ColorBarKind::Numbers {
            colors: vec![[0.0, 0.0, 1.0], [1.0, 1.0, 0.0]],
            range: [0.0, 4.0],
            scale: ColorScale::Linear,
            is_discrete: false,
        },
    }))
}

/// A white picture with the overlays.
fn drawn(overlays: &[Overlay], width: u32, height: u32, frame: &FrameView) -> Vec<u8> {
    let sprites = draw(overlays, &Page::whole(width, height), frame);
    let mut picture = vec![255; 3 * width as usize * height as usize];
    for (row, y) in picture.chunks_mut(3 * width as usize).zip(0..) {
        sprites.iter().for_each(|sprite| sprite.draw_over(y, row));
    }
    picture
}

#[test]
fn text_has_the_size_of_its_letters() {
    let frame = FrameView::default();
    // 20 pixels: the widths of S, p, e, e, d in 1/2048 em are 1300, 1300, 1260, 1260, 1300
    let width = 6420.0_f64 / 2048.0 * 20.0;
    let expected = [width.ceil(), 20.0];
    assert_eq!(text("Speed").measure(400, &frame).map(f64::from), expected);
    // Two lines
    assert_eq!(text("Speed\nd").measure(400, &frame), [63, 45]);
    // Text never becomes too small to be read
    assert_eq!(text("Speed").measure(40, &frame), [29, 9]);
    assert_eq!(text("").measure(400, &frame), [0, 0]);
}

#[test]
fn a_bar_shows_its_colours_from_bottom_to_top() {
    let (width, height) = (200, 400);
    let picture = drawn(&[bar("v")], width, height, &FrameView::default());
    let pixel = |x: usize, y: usize| &picture[3 * (y * width as usize + x)..][..3];
    // The bar is 18 pixels wide, from x = 20; title and gap are 38 pixels high, from y = 20
    for row in [59, 158, 256] {
        let part = 1.0 - (f64::from(row) + 0.5 - 58.0) / 200.0;
        let expected = [part, part, 1.0 - part].map(|v| 255.0 * v);
        for (found, expected) in pixel(29, row.try_into().unwrap()).iter().zip(expected) {
            assert!((f64::from(*found) - expected).abs() <= 1.0, "{row}");
        }
    }
    // A frame of a pixel, and ticks at 0, 1, 2, 3 and 4
    assert_eq!(pixel(19, 150), [0, 0, 0]);
    assert_eq!(pixel(38, 150), [0, 0, 0]);
    for row in [57, 107, 157, 207, 257] {
        let rows: Vec<usize> = (row - 2..=row + 2).filter(|y| pixel(42, *y) == [0, 0, 0]).collect();
        assert_eq!(rows.len(), 1, "{row}: {rows:?}");
    }
    assert_ne!(pixel(42, 133), [0, 0, 0]);
}

fn horizontal(bar: &Overlay) -> Overlay {
    let Content::ColorBar(mut bar) = bar.content.clone() else { unreachable!() };
    bar.orientation = Orientation::Horizontal;
    overlay(Content::ColorBar(bar))
}

#[test]
fn a_horizontal_bar_shows_its_colours_from_left_to_right() {
    let (width, height) = (300, 400);
    let own = horizontal(&bar("v"));
    let picture = drawn(std::slice::from_ref(&own), width, height, &FrameView::default());
    let pixel = |x: usize, y: usize| &picture[3 * (y * width as usize + x)..][..3];
    // The label 0 is 20 * 1303 / 2048 pixels wide; half of it is left of the bar, which is 200 pixels long
    let left = 20 + 7;
    for column in [left, left + 99, left + 199] {
        let part = (column as f64 + 0.5 - left as f64) / 200.0;
        let expected = [part, part, 1.0 - part].map(|v| 255.0 * v);
        // Title and gap are 30 pixels high, from y = 20, and the bar is 18 pixels high
        for (found, expected) in pixel(column, 59).iter().zip(expected) {
            assert!((f64::from(*found) - expected).abs() <= 1.0, "{column}");
        }
    }
    assert_eq!(pixel(left - 1, 59), [0, 0, 0]);
    assert_eq!(pixel(left + 50, 49), [0, 0, 0]);
    // Ticks at 0, 1, 2, 3 and 4
    for column in [left - 1, left + 49, left + 99, left + 149, left + 199] {
        let columns: Vec<usize> =
            (column - 2..=column + 2).filter(|x| pixel(*x, 71) == [0, 0, 0]).collect();
        assert_eq!(columns.len(), 1, "{column}: {columns:?}");
    }
    let [own_width, own_height] = own.measure(height, &FrameView::default());
    assert!((213..=215).contains(&own_width), "{own_width}");
    assert!((70..=90).contains(&own_height), "{own_height}");
}

#[test]
fn labels_of_horizontal_bars_do_not_touch() {
    let Content::ColorBar(mut bar) = horizontal(&bar("v")).content else { unreachable!() };
    if let ColorBarKind::Numbers { range, .. } = &mut bar.kind {
        *range = [1000.0, 1010.0];
    }
    bar.length = 0.3;
    let wide = overlay(Content::ColorBar(bar)).measure(400, &FrameView::default())[0];
    // Two labels of four digits and at most one between them
    assert!((120..190).contains(&wide), "{wide}");
}

#[test]
fn titles_have_unit_and_exponent() {
    let frame = FrameView::default();
    let plain = bar("speed").measure(400, &frame)[0];
    let Content::ColorBar(mut large) = bar("speed").content else { unreachable!() };
    if let ColorBarKind::Numbers { range, .. } = &mut large.kind {
        *range = [0.0, 4e6];
    }
    let wide = overlay(Content::ColorBar(large)).measure(400, &frame)[0];
    let text_width = |s: &str| text(s).measure(400, &frame)[0];
    assert_eq!(plain, text_width("speed (m/s)"));
    assert_eq!(wide, text_width("speed (10⁶ m/s)"));
}

#[test]
fn lengths_of_scale_bars_are_those_of_the_scene() {
    let frame = FrameView { units_per_height: 4.0, ..FrameView::default() };
    let scale_bar =
        |length: f64| overlay(Content::ScaleBar(ScaleBar { length, unit: "mm".to_owned() }));
    // An eighth of 400 pixels; the label is wider
    let sprite = &draw(&[scale_bar(0.5)], &Page::whole(600, 400), &frame)[0];
    let dark = |x: &i32| {
        let at = usize::try_from(27 + 3 + 10 / 2).unwrap() * usize::try_from(sprite.width).unwrap();
        let pixel = sprite.pixels[at + usize::try_from(*x).unwrap()];
        pixel == [0, 0, 0, 255]
    };
    let rows = 0..sprite.width;
    assert_eq!(rows.filter(dark).count(), 50);
    for (height, expected) in [(4.0, 0.5), (1.0, 0.2), (0.049, 0.005), (9999.0, 1000.0), (0.0, 1.0)]
    {
        assert_eq!(ScaleBar::round_length(height), expected, "{height}");
    }
}

#[test]
fn overlays_beyond_the_picture_are_cut_off() {
    let frame = FrameView {
        axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        ..FrameView::default()
    };
    let axes = overlay(Content::Axes(Axes { names: ["x", "y", "z"].map(str::to_owned) }));
    for (width, height) in [(1, 1), (16, 9), (30, 300)] {
        let all = [bar("a long title"), axes.clone(), text("t = 1")];
        assert_eq!(drawn(&all, width, height, &frame).len(), 3 * (width * height) as usize);
    }
}

/// The pixels of all machines.
#[test]
fn all_machines_draw_the_same_bytes() {
    let frame = FrameView {
        units_per_height: 4.0,
        axes: [[0.8, 0.1, 0.5], [-0.5, 0.4, 0.7], [0.1, 0.9, -0.3]],
        ..FrameView::default()
    };
    let mut corner = bar("speed ρ ≤ ½");
    corner.placement.corner = Corner::BottomRight;
    let axes = overlay(Content::Axes(Axes { names: ["x", "y", "z"].map(str::to_owned) }));
    let picture = drawn(&[corner, axes, text("t = 0.35 s")], 480, 270, &frame);
    assert_eq!(blake3::hash(&picture).to_hex()[..16].to_owned(), "0330d0be8a00eb47");
}

#[test]
fn many_categories_have_columns_that_fit_the_picture() {
    let height = |count: usize| {
        let all = (0..count).map(|i| (format!("M{i}"), BLACK)).collect();
        let mut many = bar("");
        if let Content::ColorBar(bar) = &mut many.content {
            (bar.unit, bar.kind) = (String::new(), ColorBarKind::Categories(all));
        }
        many.measure(400, &FrameView::default())
    };
    let [one, two] = [height(12), height(40)];
    // 20 pixels of text: rows of 28 pixels
    assert_eq!(one[1], 11 * 28 + 18);
    assert!(two[1] <= 340 && two[0] > 3 * one[0], "{one:?} {two:?}");
}

#[test]
fn areas_are_those_of_the_sprites_without_halos() {
    let at_right = Placement { corner: Corner::BottomRight, offset: [0.1, 0.2] };
    let overlays = [
        text("Speed"),
        Overlay { placement: at_right, ..bar("v") },
        Overlay { layout: Layout::Beside, ..bar("w") },
    ];
    let frame = FrameView::default();
    let page = Page::with_room_for(&overlays, [500, 400], &frame);
    let found = areas(&overlays, &page, &frame);
    for (area, sprite) in found.iter().zip(draw(&overlays, &page, &frame)) {
        let margin = area.at[0] - sprite.left;
        assert!((1..8).contains(&margin) && area.at[1] - sprite.top == margin, "{area:?}");
        let size = [sprite.width, sprite.height].map(|side| side - 2 * margin);
        assert_eq!(area.size, size);
    }
    // The distances from the corner of the picture, in pixels
    let [width, height] = page.picture.map(u32::cast_signed);
    let Area { at, size } = found[1];
    assert_eq!([width - at[0] - size[0], height - at[1] - size[1]], [40, 80]);
    assert!(found[2].at[0] > width, "beside the picture");
}
