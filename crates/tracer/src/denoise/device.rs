//! The filter on another device: the numbers of its kernels, which are those of the kernels here.

use super::DenoiseSettings;
use super::gather::{
    DEPTHS, MAX_VALUE, MIN_ALBEDO, MIN_NOISE, MISSED, RELATIVE_NOISE, Shares, UNUSABLE,
    UNUSABLE_NOISE,
};
use super::glints::LIMITS;
use super::kernels::MAX_DISTANCE;
use super::settings::{
    ALBEDO_TOLERANCE, DEPTH_TOLERANCE, NORMAL_TOLERANCE, OWN_PART, PATCH_SIDE, SLOPE_TOLERANCE,
};

/// Constants by the names that they have here.
pub const CONSTANTS: [(&str, f32); 17] = [
    ("MISSED", MISSED),
    ("UNUSABLE", UNUSABLE),
    ("LEAST_DEPTH", DEPTHS[0]),
    ("GREATEST_DEPTH", DEPTHS[1]),
    ("MAX_VALUE", MAX_VALUE),
    ("MIN_ALBEDO", MIN_ALBEDO),
    ("UNUSABLE_NOISE", UNUSABLE_NOISE),
    ("RELATIVE_NOISE", RELATIVE_NOISE),
    ("MIN_NOISE", MIN_NOISE),
    ("MAX_DISTANCE", MAX_DISTANCE),
    ("OWN_PART", OWN_PART),
    ("ALBEDO_TOLERANCE", ALBEDO_TOLERANCE),
    ("NORMAL_TOLERANCE", NORMAL_TOLERANCE),
    ("SLOPE_TOLERANCE", SLOPE_TOLERANCE),
    ("DEPTH_TOLERANCE", DEPTH_TOLERANCE),
    ("FEW_FACTOR", LIMITS[0].1),
    ("SEVERAL_FACTOR", LIMITS[1].1),
];

/// Parts of the samples that are even and odd, counted from 0.
pub fn shares(samples: u32) -> [f32; 2] {
    let Shares { even, odd } = Shares::of(samples);
    [even, odd]
}

impl DenoiseSettings {
    /// Factor of the sum of colour distances over a patch of 3x3 pixels.
    pub const fn color_scale(&self) -> f32 {
        1.0 / (self.k * self.k * (PATCH_SIDE * PATCH_SIDE) as f32)
    }
}
