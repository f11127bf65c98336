//! PNG images of 8 or 16 bits, in sRGB.

use std::io::Read;

use glam::Vec3;

use super::{Check, Pixels};
use crate::file::Fault;
use crate::file::png::PngSamples;
use crate::scene::RgbEncoding;

/// Decodes a file. Transparent pixels show the colour `behind`.
pub(super) fn decode(file: impl Read, check: Check, behind: Vec3) -> Result<Pixels, Fault> {
    let samples = PngSamples::decode(file, check)?;
    // Decode the codes of samples by a table
    let encoding = if samples.is_deep { RgbEncoding::Srgb16 } else { RgbEncoding::Srgb8 };
    let linear = |code: u16| encoding.color([f64::from(code), 0.0, 0.0]).x;
    let table: Vec<f32> = (0..=samples.max_code()).map(linear).collect();
    let pixels = samples.rgba().map(|[red, green, blue, alpha]| {
        let color = Vec3::from_array([red, green, blue].map(|code| table[usize::from(code)]));
        behind.lerp(color, f32::from(alpha) / f32::from(samples.max_code()))
    });
    Ok(Pixels { width: samples.width, height: samples.height, pixels: pixels.collect() })
}
