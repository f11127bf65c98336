//! Verification of images.

use std::io::Cursor;

use spherule::output::{ImageFault, ImageShape, verify_exr, verify_preview};
use spherule::render::{Channels, DataWindow};

/// What the seeds are, and what no file of theirs can be. The first byte picks one.
const SHAPES: [ImageShape; 4] = [
    shape(5, 3, Channels::COLOR),
    shape(5, 3, Channels::ALL),
    shape(40, 37, Channels::COLOR),
    shape(1 << 15, 1 << 15, Channels::ALL),
];

const fn shape(width: u32, height: u32, channels: Channels) -> ImageShape {
    ImageShape {
        width,
        height,
        window: DataWindow::whole(width, height),
        channels,
        attributes: Vec::new(),
        light_groups: Vec::new(),
        has_data_part: false,
        is_on_page: false,
    }
}

/// An OpenEXR file.
pub fn exr(bytes: &[u8]) -> usize {
    verified(bytes, |file, expected| verify_exr(file, expected))
}

/// A preview.
pub fn png(bytes: &[u8]) -> usize {
    verified(bytes, |file, expected| verify_preview(file, expected))
}

fn verified(
    bytes: &[u8],
    verify: impl Fn(Cursor<&[u8]>, &ImageShape) -> Result<(), ImageFault>,
) -> usize {
    let Some((choice, bytes)) = bytes.split_first() else {
        return 0;
    };
    let expected = &SHAPES[usize::from(*choice) % SHAPES.len()];
    match verify(Cursor::new(bytes), expected) {
        Ok(()) => 1,
        Err(fault) => {
            assert!(!fault.to_string().is_empty());
            0
        }
    }
}
