//! Pictures as files for the page.

use serde_json::{Value, json};

use crate::output::{OutputError, PictureFormat, PreviewBackground};
use crate::overlay::{Layout, Page};
use crate::pipeline::{Setup, TracedFrame};
use crate::render::{Channels, Film};

/// A picture as a file.
pub(super) struct Encoded {
    pub(super) bytes: Vec<u8>,
    /// The type of the file, as in HTTP.
    pub(super) mime: &'static str,
    /// Where the picture and the overlays are in it, as JSON.
    pub(super) layout: Value,
}

/// The file of the last picture: the bytes of the preview of the job.
pub(super) fn last(setup: &Setup, frame: &TracedFrame) -> Result<Encoded, OutputError> {
    Ok(Encoded { bytes: frame.to_png(setup)?, mime: "image/png", layout: layout(setup, frame) })
}

/// Least height of pictures with overlays, pixels: those of a job are then small, but can be read.
const LEAST_HEIGHT: u32 = 405;

/// The file of a picture on the way to the last one. `setup` is that of the last one.
pub(super) fn draft(setup: &Setup, frame: &mut TracedFrame) -> Result<Encoded, OutputError> {
    let render = &setup.picture.render;
    let options = setup.preview_from(&frame.camera);
    let has_page = !setup.picture.files.overlays.is_empty() || options.page.is_some();
    let mut setup = setup;
    let smaller;
    if has_page && frame.film.width < render.width {
        let height = frame.film.height.max(LEAST_HEIGHT).min(render.height);
        smaller = scaled_page(setup, f64::from(height) / f64::from(render.height));
        let size = &smaller.picture.render;
        frame.film = enlarged(&frame.film, size.width, size.height);
        setup = &smaller;
    }
    // JPEG has no alpha
    let is_clear = options.background == PreviewBackground::Transparent;
    let (format, mime) = if is_clear {
        (PictureFormat::Png, "image/png")
    } else {
        (PictureFormat::Jpeg, "image/jpeg")
    };
    Ok(Encoded { bytes: frame.to_picture(setup, format)?, mime, layout: layout(setup, frame) })
}

/// Where the picture and the overlays are on the page of `frame`, in its pixels.
fn layout(setup: &Setup, frame: &TracedFrame) -> Value {
    let (page, areas) = setup.overlay_areas(frame);
    let files = &setup.picture.files;
    let overlays = files.overlay_entries.iter().zip(&files.overlays).zip(areas);
    let overlays = overlays.map(|((entry, overlay), area)| {
        json!({
            "entry": entry,
            "is_beside": overlay.layout == Layout::Beside,
            "at": area.at,
            "size": area.size,
        })
    });
    json!({
        "size": page.size,
        "picture": { "at": page.at, "size": page.picture },
        "overlays": overlays.collect::<Vec<_>>(),
    })
}

/// `setup` for a picture that is smaller by a factor `scale`, with the page around it.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "sizes of pictures, made smaller"
)]
fn scaled_page(setup: &Setup, scale: f64) -> Setup {
    let side = |side: u32| (f64::from(side) * scale).round() as u32;
    let mut smaller = setup.clone();
    let render = &mut smaller.picture.render;
    (render.width, render.height) = (side(render.width).max(1), side(render.height).max(1));
    let picture = [render.width, render.height];
    if let Some(own) = &mut smaller.picture.files.preview.page {
        let Page { size, at, .. } = own.page;
        let at = at.map(side);
        let least = [at[0] + picture[0], at[1] + picture[1]];
        let size = [side(size[0]).max(least[0]), side(size[1]).max(least[1])];
        own.page = Page { size, at, picture };
    }
    smaller
}

/// The colours of `film` in another size, blended between the four nearest pixels.
fn enlarged(film: &Film, width: u32, height: u32) -> Film {
    let mut large = Film::new(width, height, Channels::COLOR);
    let columns = places(width, film.width);
    let rows = places(height, film.height);
    let stride = film.width as usize;
    for (row, &(top, bottom, down)) in large.color.chunks_mut(width as usize).zip(&rows) {
        let row_at = |y: usize| &film.color[y * stride..][..stride];
        let (above, below) = (row_at(top), row_at(bottom));
        for (pixel, &(left, right, along)) in row.iter_mut().zip(&columns) {
            *pixel = std::array::from_fn(|i| {
                let upper = above[left][i] + along * (above[right][i] - above[left][i]);
                let lower = below[left][i] + along * (below[right][i] - below[left][i]);
                upper + down * (lower - upper)
            });
        }
    }
    large
}

/// For each of `count` pixels the two nearest of `from`, and the part of the second one.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "sizes of pictures, and places in them"
)]
fn places(count: u32, from: u32) -> Vec<(usize, usize, f32)> {
    let last = from.saturating_sub(1);
    let place = |pixel: u32| {
        let at = (f64::from(pixel) + 0.5) * f64::from(from) / f64::from(count) - 0.5;
        let at = at.clamp(0.0, f64::from(last));
        let first = at.floor() as u32;
        (first as usize, (first + 1).min(last) as usize, (at - at.floor()) as f32)
    };
    (0..count).map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn enlarged_pictures_blend_between_pixels() {
        let mut film = Film::new(2, 1, Channels::COLOR);
        film.color = vec![[0.0, 0.0, 0.0, 1.0], [1.0, 2.0, 4.0, 1.0]];
        let large = enlarged(&film, 4, 2);
        let reds: Vec<f32> = large.color.iter().map(|pixel| pixel[0]).collect();
        assert_eq!(reds, [0.0, 0.25, 0.75, 1.0, 0.0, 0.25, 0.75, 1.0]);
        assert_eq!(enlarged(&film, 2, 1).color, film.color);
    }
}
