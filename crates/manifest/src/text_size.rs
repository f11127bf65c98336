//! `size` of overlays: the height of text, as a fraction of the picture or in points on paper.

use serde_json::{Value as Json, json};

use super::field::Field;
use super::key::Key;
use super::print_size::DEFAULT_DPI;
use super::value::{Fault, Value, quoted};

/// The largest part of the height of a picture.
const MAX: f32 = 0.25;

/// The largest text, points.
const MAX_POINTS: f64 = 1000.0;

/// Points in an inch, as in PostScript and PDF.
const POINTS_PER_INCH: f64 = 72.0;

/// Height of text.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum TextSize {
    /// As a fraction of the height of the picture.
    Fraction(f32),
    /// In points on paper.
    Points(f64),
}

impl TextSize {
    /// As a value of a manifest.
    pub fn to_value(self) -> toml::Value {
        match self {
            Self::Fraction(fraction) => f64::from(fraction).into(),
            Self::Points(points) => format!("{points}pt").into(),
        }
    }

    /// The fraction of a picture of `height` pixels, which has `dpi` dots per inch on paper.
    pub fn fraction(self, height: u32, dpi: Option<u32>) -> f32 {
        match self {
            Self::Fraction(fraction) => fraction,
            Self::Points(points) => {
                let pixels = points / POINTS_PER_INCH * f64::from(dpi.unwrap_or(DEFAULT_DPI));
                #[expect(clippy::cast_possible_truncation, reason = "a fraction")]
                let fraction = (pixels / f64::from(height.max(1))) as f32;
                fraction.min(MAX)
            }
        }
    }
}

/// The height on paper, in points, of text that is `fraction` of a picture of `height` pixels.
pub fn points_on_paper(fraction: f32, height: u32, dpi: u32) -> f64 {
    f64::from(fraction) * f64::from(height) / f64::from(dpi) * POINTS_PER_INCH
}

impl Value for TextSize {
    fn kind(key: &Key) -> String {
        format!("{}, or points on paper such as \"7pt\"", f32::kind(key))
    }

    fn parse(field: &Field<'_>, key: &Key) -> Result<Self, Fault> {
        let Some(text) = field.as_text() else {
            return f32::parse(field, key).map(Self::Fraction);
        };
        let number = text.trim().strip_suffix("pt").map(str::trim);
        let points = number.and_then(|number| number.parse().ok());
        let usable = |points: &f64| *points > 0.0 && *points <= MAX_POINTS;
        points.filter(usable).map(Self::Points).ok_or(Fault::Unwanted)
    }

    fn toml(&self) -> String {
        match self {
            Self::Fraction(fraction) => fraction.toml(),
            Self::Points(points) => quoted(&format!("{points}pt")),
        }
    }

    fn schema(key: &Key) -> Json {
        let points = r"^\s*(0*[1-9][0-9]{0,2}(\.[0-9]+)?|0*\.[0-9]*[1-9][0-9]*|0+\.[0-9]*[1-9][0-9]*|0*1000)\s*pt\s*$";
        json!({ "anyOf": [f32::schema(key), { "type": "string", "pattern": points }] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_those_of_the_printed_picture() {
        // 7 points are 29.2 pixels at 300 dots per inch
        let size = TextSize::Points(7.0);
        let found = size.fraction(531, Some(300));
        assert!((found * 531.0 - 29.17).abs() < 0.01, "{found}");
        assert!((points_on_paper(found, 531, 300) - 7.0).abs() < 1e-4);
        assert_eq!(size.fraction(531, None), found);
        // Large text in a small picture
        assert_eq!(TextSize::Points(8.0).fraction(100, Some(300)), MAX);
        assert_eq!(TextSize::Fraction(0.03).fraction(100, None), 0.03);
    }
}
