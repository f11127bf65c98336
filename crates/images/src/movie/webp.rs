//! Animated WebP, without loss. `image-webp` encodes pictures, but no animations; their container is written here
//! (RFC 9649, section 2.7).

use std::io::{self, Seek, SeekFrom, Write};

use image_webp::{ColorType, EncodingError, WebPEncoder};

use super::{MovieError, MovieSource, Observer, changed, part};
use crate::picture::{MARKER, Picture};

/// Ticks per second.
const TICKS: f64 = 1000.0;

/// Bit of an animation in the chunk `VP8X`.
const IS_ANIMATION: u8 = 0x02;

/// Bits of a frame: its pixels replace those before.
const NO_BLENDING: u8 = 0x02;

/// Chunks of other names are ignored by readers.
const MARKER_CHUNK: &[u8; 4] = b"SPHR";

/// Writes a WebP that repeats endlessly.
pub(super) fn write(
    source: &MovieSource,
    file: &mut (impl Write + Seek),
    observer: &dyn Observer,
) -> Result<(), MovieError> {
    let mut started = false;
    let mut before: Option<Picture> = None;
    let (mut shown, mut ticks) = (0, 0);
    source.each(observer, |picture, repeats| {
        if !started {
            write_header(file, picture.size()).map_err(failed)?;
            started = true;
        }
        shown += u64::from(repeats);
        let end = source.rate.end(shown, TICKS);
        let bounds = before.as_ref().map_or([0, 0, picture.width(), picture.height()], |before| {
            let bounds = changed(before.pixels(), picture.pixels(), picture.width());
            let [left, top, right, bottom] = bounds.unwrap_or([0, 0, 1, 1]);
            // Frames begin at even places
            [left & !1, top & !1, right, bottom]
        });
        write_frame(file, &part(&picture, bounds), [bounds[0], bounds[1]], end - ticks)
            .map_err(failed)?;
        ticks = end;
        before = Some(picture);
        Ok(())
    })?;
    finish(file).map_err(failed)
}

/// `RIFF` with a length that [`finish`] fills in, size, and endless repetition.
fn write_header(file: &mut impl Write, [width, height]: [usize; 2]) -> io::Result<()> {
    file.write_all(b"RIFF\0\0\0\0WEBP")?;
    let mut header = vec![IS_ANIMATION, 0, 0, 0];
    header.extend(u24(width - 1));
    header.extend(u24(height - 1));
    write_chunk(file, b"VP8X", &header)?;
    // White background, and no number of repetitions
    write_chunk(file, b"ANIM", &[0xff, 0xff, 0xff, 0xff, 0, 0])
}

fn write_frame(
    file: &mut impl Write,
    picture: &Picture,
    [left, top]: [usize; 2],
    ms: u64,
) -> io::Result<()> {
    let side = |side: usize| u32::try_from(side).map_err(io::Error::other);
    let (width, height) = (side(picture.width())?, side(picture.height())?);
    let mut image = Vec::new();
    let encoder = WebPEncoder::new(&mut image);
    let encoded = encoder.encode(picture.rgb(), width, height, ColorType::Rgb8);
    encoded.map_err(|error| match error {
        EncodingError::IoError(error) => error,
        other => io::Error::other(other.to_string()),
    })?;
    let mut frame = Vec::with_capacity(image.len() + 16);
    for value in [left / 2, top / 2, picture.width() - 1, picture.height() - 1] {
        frame.extend(u24(value));
    }
    frame.extend(u24(usize::try_from(ms).unwrap_or(usize::MAX)));
    frame.push(NO_BLENDING);
    // The chunk of the image, without the header of its file
    frame.extend(image.get(12..).unwrap_or_default());
    write_chunk(file, b"ANMF", &frame)
}

fn finish(file: &mut (impl Write + Seek)) -> io::Result<()> {
    write_chunk(file, MARKER_CHUNK, MARKER.as_bytes())?;
    let length = file.stream_position()?;
    let too_long = |_| io::Error::other("WebP files have at most 4 GiB; choose a smaller width");
    let riff = u32::try_from(length - 8).map_err(too_long)?;
    file.seek(SeekFrom::Start(4))?;
    file.write_all(&riff.to_le_bytes())?;
    file.seek(SeekFrom::Start(length))?;
    Ok(())
}

/// A chunk, padded to an even length.
fn write_chunk(file: &mut impl Write, name: &[u8; 4], data: &[u8]) -> io::Result<()> {
    let length = u32::try_from(data.len()).map_err(io::Error::other)?;
    file.write_all(name)?;
    file.write_all(&length.to_le_bytes())?;
    file.write_all(data)?;
    file.write_all(&[0][..data.len() % 2])
}

/// Three bytes; larger values become the largest.
#[expect(clippy::cast_possible_truncation, reason = "the low bytes of a value below 2^24")]
fn u24(value: usize) -> [u8; 3] {
    let value = value.min(0xff_ffff);
    [value as u8, (value >> 8) as u8, (value >> 16) as u8]
}

fn failed(source: io::Error) -> MovieError {
    MovieError::Io { path: "WebP".into(), source }
}
