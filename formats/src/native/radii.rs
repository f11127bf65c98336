//! Encodes radii that differ.

use rayon::prelude::*;

use super::RadiusCode;
use crate::blocks::{BLOCK_SIZE, BlockRadii};

/// The radii of a run of particles.
#[derive(Debug)]
pub(super) struct CodedRadii {
    /// The decoded radii, in blocks; unused lanes of the last block repeat its last radius.
    pub(super) blocks: Vec<BlockRadii>,
    /// The stored bytes.
    pub(super) bytes: Vec<u8>,
    /// Largest difference of a decoded radius from the given one.
    pub(super) max_error: f32,
}

/// How the radii of a frame are coded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RadiusRange {
    /// The type of the codes.
    pub code: RadiusCode,
    /// The smallest radius of the frame.
    pub low: f32,
    /// The largest radius of the frame.
    pub high: f32,
}

impl RadiusRange {
    /// The smallest code for radii from `low` to `high` with an error of at most `bound`.
    pub fn within(low: f32, high: f32, bound: f64) -> Self {
        let is_fine = |code: &RadiusCode| f64::from(code.step(low, high)) * 0.5 <= bound * 0.999;
        let code = RadiusCode::ALL.into_iter().find(is_fine);
        Self { code: code.unwrap_or(RadiusCode::F32), low, high }
    }

    /// The code of `radius`, and its decoded value.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a cast saturates, and codes are clamped to their bits"
    )]
    fn code(&self, radius: f32) -> (u16, f32) {
        let step = self.code.step(self.low, self.high);
        let largest = match self.code {
            RadiusCode::F32 => return (0, radius),
            RadiusCode::U16 => 65_535.0,
            RadiusCode::U8 => 255.0,
        };
        let exact = if step > 0.0 { (radius - self.low) / step } else { 0.0 };
        let code = exact.round().clamp(0.0, largest) as u16;
        (code, self.low + f32::from(code) * step)
    }

    /// Encodes `radii`.
    pub(super) fn coded(&self, radii: &[f32]) -> CodedRadii {
        let blocks: Vec<BlockRadii> = radii
            .par_chunks(BLOCK_SIZE)
            .with_min_len(1024)
            .map(|chunk| BlockRadii(lanes_of(chunk).map(|radius| self.code(radius).1)))
            .collect();
        let error = |(given, read): (&[f32], &BlockRadii)| {
            let pairs = given.iter().zip(&read.0);
            pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
        };
        let max_error = radii
            .par_chunks(BLOCK_SIZE)
            .zip(&blocks)
            .with_min_len(1024)
            .map(error)
            .reduce(|| 0.0, f32::max);
        CodedRadii { bytes: self.bytes(radii), blocks, max_error }
    }

    fn bytes(&self, radii: &[f32]) -> Vec<u8> {
        let lanes = radii.chunks(BLOCK_SIZE).flat_map(lanes_of);
        let mut bytes =
            Vec::with_capacity(radii.len().next_multiple_of(BLOCK_SIZE) * self.code.size());
        match self.code {
            RadiusCode::F32 => bytes.extend(lanes.flat_map(f32::to_le_bytes)),
            RadiusCode::U16 => bytes.extend(lanes.flat_map(|r| self.code(r).0.to_le_bytes())),
            #[expect(clippy::cast_possible_truncation, reason = "clamped to eight bits")]
            RadiusCode::U8 => bytes.extend(lanes.map(|r| self.code(r).0 as u8)),
        }
        bytes
    }
}

/// Up to 16 radii; the remaining lanes repeat the last one.
fn lanes_of(radii: &[f32]) -> [f32; BLOCK_SIZE] {
    std::array::from_fn(|lane| radii[lane.min(radii.len() - 1)])
}
