//! GIF: one palette for all pictures, and only the pixels that change.

use std::borrow::Cow;
use std::io::{self, Write};

use ::gif::{AnyExtension, DisposalMethod, Encoder, EncodingError, Extension, Frame, Repeat};

use super::palette::{Ditherer, Histogram, MAX_COLORS};
use super::{MovieError, MovieSource, Observer, changed};
use crate::picture::MARKER;

/// The index of pixels that do not change.
#[expect(clippy::cast_possible_truncation, reason = "the last index")]
const UNCHANGED: u8 = MAX_COLORS as u8;

/// Shortest time of a picture, hundredths of a second. Browsers show shorter ones for a tenth of a second.
pub(super) const MIN_DELAY: u64 = 2;

/// Ticks per second.
const TICKS: f64 = 100.0;

/// Writes a GIF that repeats endlessly.
pub(super) fn write(
    source: &MovieSource,
    file: &mut impl Write,
    observer: &dyn Observer,
) -> Result<(), MovieError> {
    // Read all pictures for the palette first
    let mut histogram = Histogram::new();
    let quiet = Quiet(observer);
    let mut size = [0; 2];
    source.each(&quiet, |picture, _| {
        size = picture.size();
        histogram.add(&picture);
        Ok(())
    })?;
    let palette = histogram.palette();
    let mut ditherer = Ditherer::new(&palette);
    // Write the header
    let side =
        |side: usize| u16::try_from(side).map_err(|_| MovieError::TooLarge { format: "GIF", size });
    let (width, height) = (side(size[0])?, side(size[1])?);
    let mut encoder = Encoder::new(file, width, height, &full(palette.bytes())).map_err(failed)?;
    encoder.set_repeat(Repeat::Infinite).map_err(failed)?;
    let comment = AnyExtension::from(Extension::Comment);
    encoder.write_raw_extension(comment, &[MARKER.as_bytes()]).map_err(failed)?;

    // Write each picture, with rounding errors of its time carried over
    let mut before: Option<Vec<u8>> = None;
    let (mut shown, mut ticks) = (0, 0);
    source.each(observer, |picture, repeats| {
        let now = ditherer.indices(&picture);
        shown += u64::from(repeats);
        let end = source.rate.end(shown, TICKS).max(ticks + MIN_DELAY);
        let delay = u16::try_from(end - ticks).unwrap_or(u16::MAX);
        ticks = end;
        let frame = frame(before.as_deref(), &now, size[0], delay);
        before = Some(now);
        encoder.write_frame(&frame).map_err(failed)
    })
}

/// The palette with unused colours up to 256, so that its last index is [`UNCHANGED`].
fn full(bytes: &[u8]) -> Vec<u8> {
    let mut all = bytes.to_vec();
    all.resize(3 * 256, 0);
    all
}

/// The pixels that have changed since `before`, or all.
#[expect(clippy::cast_possible_truncation, reason = "places in a picture of a GIF")]
fn frame(before: Option<&[u8]>, now: &[u8], width: usize, delay: u16) -> Frame<'static> {
    let whole = [0, 0, width, now.len() / width];
    // Find the rectangle that has changed
    let bounds = match before {
        None => whole,
        // A frame has at least one pixel
        Some(before) => changed(before, now, width).unwrap_or([0, 0, 1, 1]),
    };
    let [left, top, right, bottom] = bounds;
    // Pixels that have not changed are transparent, which compresses well
    let mut pixels = Vec::with_capacity((right - left) * (bottom - top));
    for i in (top..bottom).flat_map(|y| y * width + left..y * width + right) {
        let is_same = before.is_some_and(|before| before[i] == now[i]);
        pixels.push(if is_same { UNCHANGED } else { now[i] });
    }
    Frame {
        delay,
        dispose: DisposalMethod::Keep,
        transparent: Some(UNCHANGED),
        needs_user_input: false,
        top: top as u16,
        left: left as u16,
        width: (right - left) as u16,
        height: (bottom - top) as u16,
        interlaced: false,
        palette: None,
        buffer: Cow::Owned(pixels),
    }
}

/// Passes on requests to stop, but no progress.
struct Quiet<'a>(&'a dyn Observer);

impl Observer for Quiet<'_> {
    fn stops(&self) -> bool {
        self.0.stops()
    }

    fn on_picture(&self, _: usize) {}
}

fn failed(error: EncodingError) -> MovieError {
    let source = match error {
        EncodingError::Io(source) => source,
        other => io::Error::other(other.to_string()),
    };
    MovieError::Io { path: "GIF".into(), source }
}
