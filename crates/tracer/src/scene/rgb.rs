//! Colours in particle attributes: three components, interpreted as the programs that write them do.
//!
//! Floating-point colours are linear (Houdini's `Cd`), integers are sRGB codes (PLY, VTK): with 16 bits if the type
//! is an unsigned 16-bit integer, otherwise with 8 bits.

use glam::Vec3;
use serde::{Deserialize, Serialize};
use spherule_frame::{Attribute, ScalarType, names};

use super::colormap::linear_from_srgb;

/// Encoding of the components of a colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RgbEncoding {
    /// Linear from 0 to 1.
    Linear,
    /// sRGB from 0 to 255.
    Srgb8,
    /// sRGB from 0 to 65535.
    Srgb16,
}

impl RgbEncoding {
    /// Encoding of colours of the type `scalar`.
    pub const fn of(scalar: ScalarType) -> Self {
        match scalar {
            ScalarType::F32 | ScalarType::F64 => Self::Linear,
            ScalarType::U16 => Self::Srgb16,
            _ => Self::Srgb8,
        }
    }

    /// A name for messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Srgb8 => "8-bit sRGB",
            Self::Srgb16 => "16-bit sRGB",
        }
    }

    /// Linear RGB from 0 to 1; 0 for NaN.
    #[expect(clippy::cast_possible_truncation, reason = "colours need no more than f32")]
    pub fn color(self, rgb: [f64; 3]) -> Vec3 {
        let linear = |value: f64| {
            let part = match self {
                Self::Linear => value,
                Self::Srgb8 => value / 255.0,
                Self::Srgb16 => value / 65535.0,
            };
            let part = if part.is_nan() { 0.0 } else { part.clamp(0.0, 1.0) as f32 };
            match self {
                Self::Linear => part,
                Self::Srgb8 | Self::Srgb16 => linear_from_srgb(part),
            }
        };
        Vec3::from_array(rgb.map(linear))
    }
}

/// Whether `attribute` holds colours: three or four components per particle, and either a colour name or bytes, which
/// VTK treats as colours whatever their name.
pub fn is_rgb(attribute: &Attribute) -> bool {
    let is_named = || names::is_one_of(&attribute.name, &names::COLOR);
    let is_bytes = attribute.data.scalar_type() == ScalarType::U8;
    matches!(attribute.components, 3 | 4) && (is_bytes || is_named())
}

#[cfg(test)]
mod tests {
    use spherule_frame::AttributeData;

    use super::*;

    fn attribute(name: &str, components: usize, data: AttributeData) -> Attribute {
        Attribute { name: name.to_owned(), components, data }
    }

    #[test]
    fn colours_are_recognised_by_name_or_type() {
        let floats = |n: usize| AttributeData::F32(vec![0.5; n]);
        let bytes = |n: usize| AttributeData::U8(vec![7; n]);
        for (name, components, data, expected) in [
            ("Cd", 3, floats(3), true),
            ("Color", 4, floats(4), true),
            ("rgb", 1, floats(1), false),
            ("velocity", 3, floats(3), false),
            ("scalars", 3, bytes(3), true),
            ("flags", 1, bytes(1), false),
            ("flags", 2, bytes(2), false),
        ] {
            let attribute = attribute(name, components, data);
            assert_eq!(is_rgb(&attribute), expected, "{name} {components}");
        }
    }

    #[test]
    fn floats_are_linear_and_integers_srgb() {
        let linear = RgbEncoding::of(ScalarType::F32);
        let color = linear.color([0.25, -1.0, f64::NAN]);
        assert_eq!(color, Vec3::new(0.25, 0.0, 0.0));
        assert_eq!(linear.color([7.0, 1.0, 0.0]), Vec3::new(1.0, 1.0, 0.0));
        // 188 of 255 is half the light.
        let bytes = RgbEncoding::of(ScalarType::U8);
        let color = bytes.color([188.0, 255.0, 0.0]);
        assert!((color.x - 0.502_9).abs() < 1e-3, "{color}");
        assert_eq!((color.y, color.z), (1.0, 0.0));
        assert_eq!(RgbEncoding::of(ScalarType::I64), RgbEncoding::Srgb8);
        let words = RgbEncoding::of(ScalarType::U16);
        assert_eq!(words.color([65535.0, 0.0, 0.0]), Vec3::X);
    }
}
