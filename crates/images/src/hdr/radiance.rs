//! Radiance HDR images (RGBE).

use std::io::BufRead;

use glam::Vec3;
use image::codecs::hdr::HdrDecoder;
use image::{ImageDecoder, ImageError};

use super::{Check, Pixels};
use crate::file::Fault;

impl From<ImageError> for Fault {
    fn from(error: ImageError) -> Self {
        match error {
            ImageError::IoError(error) => Self::Io(error),
            other => Self::Other(format!("cannot be decoded: {other}")),
        }
    }
}

/// Decodes a file.
pub(super) fn decode(file: impl BufRead, check_size: Check) -> Result<Pixels, Fault> {
    let decoder = HdrDecoder::new(file)?;
    let (width, height) = decoder.dimensions();
    let (width, height) = (width as usize, height as usize);
    check_size(width, height)?;
    let mut values = vec![0.0_f32; 3 * width * height];
    decoder.read_image(bytemuck::cast_slice_mut(&mut values))?;
    let (pixels, _) = values.as_chunks::<3>();
    let pixels = pixels.iter().map(|pixel| Vec3::from_array(*pixel));
    Ok(Pixels { width, height, pixels: pixels.collect() })
}
