//! Animated PNG, without loss. Viewers that know no animation show the first picture.

use std::io::{self, Write};

use png::{BitDepth, BlendOp, ColorType, Compression, DisposeOp, Encoder, EncodingError};

use super::{MovieError, MovieSource, Observer, changed, part};
use crate::picture::{MARKER, Picture};

/// Ticks per second.
const TICKS: u16 = 1000;

/// Writes a PNG that repeats endlessly.
pub(super) fn write(
    source: &MovieSource,
    file: &mut impl Write,
    observer: &dyn Observer,
) -> Result<(), MovieError> {
    // Describe the animation in the header
    let size = source.first()?.size();
    let [width, height] = size.map(|side| u32::try_from(side).unwrap_or(u32::MAX));
    let mut encoder = Encoder::new(file, width, height);
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_compression(Compression::Default);
    encoder.set_adaptive_filter(png::AdaptiveFilterType::Adaptive);
    let count = u32::try_from(source.paths.len()).unwrap_or(u32::MAX);
    encoder.set_animated(count, 0).map_err(failed)?;
    encoder.set_blend_op(BlendOp::Source).map_err(failed)?;
    encoder.set_dispose_op(DisposeOp::None).map_err(failed)?;
    encoder.add_text_chunk("Software".to_owned(), MARKER.to_owned()).map_err(failed)?;
    let mut writer = encoder.write_header().map_err(failed)?;

    // Write each picture, with the time until the next in ticks
    let mut before: Option<Picture> = None;
    let (mut shown, mut ticks) = (0, 0);
    source.each(observer, |picture, repeats| {
        shown += u64::from(repeats);
        let end = source.rate.end(shown, f64::from(TICKS));
        let delay = u16::try_from(end - ticks).unwrap_or(u16::MAX);
        ticks = end;
        writer.set_frame_delay(delay, TICKS).map_err(failed)?;
        // Only the rectangle that has changed
        if let Some(before) = &before {
            let bounds =
                changed(before.pixels(), picture.pixels(), size[0]).unwrap_or([0, 0, 1, 1]);
            let piece = part(&picture, bounds);
            let [left, top, right, bottom] = bounds.map(|v| u32::try_from(v).unwrap_or(u32::MAX));
            writer.reset_frame_position().map_err(failed)?;
            writer.set_frame_dimension(right - left, bottom - top).map_err(failed)?;
            writer.set_frame_position(left, top).map_err(failed)?;
            writer.write_image_data(piece.rgb()).map_err(failed)?;
        } else {
            writer.write_image_data(picture.rgb()).map_err(failed)?;
        }
        before = Some(picture);
        Ok(())
    })?;
    writer.finish().map_err(failed)
}

fn failed(error: EncodingError) -> MovieError {
    let source = match error {
        EncodingError::IoError(source) => source,
        other => io::Error::other(other.to_string()),
    };
    MovieError::Io { path: "PNG".into(), source }
}
