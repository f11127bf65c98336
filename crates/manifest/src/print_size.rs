//! `image.width` and `image.height`: a number of pixels, or a length on paper.

use serde_json::{Value as Json, json};
use spherule_tracer::render::MAX_SIDE;

use super::field::Field;
use super::key::Key;
use super::value::{Fault, FlagKind, Value};

/// Dots per inch of pictures with lengths on paper.
pub(super) const DEFAULT_DPI: u32 = 300;

/// Millimetres in an inch.
const INCH: f64 = 25.4;

/// Units of length with their millimetres: a point is that of PostScript and PDF.
const UNITS: [(&str, f64); 4] = [("mm", 1.0), ("cm", 10.0), ("in", INCH), ("pt", INCH / 72.0)];

/// A side of an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Side {
    /// Pixels.
    Pixels(u32),
    /// Millimetres on paper.
    Paper(f64),
}

impl Side {
    /// Reads a number of pixels, or a length on paper such as `80mm`.
    ///
    /// # Errors
    /// It is neither.
    pub fn of_text(text: &str) -> Result<Self, String> {
        match text.trim().parse() {
            Ok(pixels @ 1..=MAX_SIDE) => Ok(Self::Pixels(pixels)),
            Ok(pixels) => Err(format!("{pixels} pixels; 1 to {MAX_SIDE} are possible")),
            Err(_) => length(text.trim()).map(Self::Paper),
        }
    }

    /// The number of pixels; with `dpi`, also that of a length on paper.
    pub fn pixels(self, dpi: u32) -> u32 {
        match self {
            Self::Pixels(pixels) => pixels,
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "positive; saturates"
            )]
            Self::Paper(length) => (length / INCH * f64::from(dpi)).round() as u32,
        }
    }

    /// Whether it is a length on paper.
    pub const fn is_on_paper(self) -> bool {
        matches!(self, Self::Paper(_))
    }
}

/// The length in millimetres that `text` says.
fn length(text: &str) -> Result<f64, String> {
    let number = text.trim_end_matches(|c: char| c.is_alphabetic() || c == '"' || c == '\'');
    let unit = text[number.len()..].trim();
    let Some((_, factor)) = UNITS.iter().find(|(known, _)| *known == unit) else {
        return Err(match unit {
            "" => format!("\"{text}\" has no unit; write \"{text}mm\" for a length on paper"),
            _ => format!(
                "unknown unit `{unit}`; write a whole number of pixels, or a length in mm, cm, in or pt"
            ),
        });
    };
    let value: Option<f64> = number.trim().parse().ok();
    let millimetres = value.map(|value| value * factor);
    millimetres
        .filter(|length| (0.1..=1e5).contains(length))
        .ok_or_else(|| format!("\"{text}\" is not a length on paper (0.1mm to 100m)"))
}

impl Value for Side {
    const FLAG: FlagKind = FlagKind::NumberOrText;

    fn kind(key: &Key) -> String {
        format!("a length on paper such as \"85mm\", or {}", u32::kind(key))
    }

    fn parse(field: &Field<'_>, key: &Key) -> Result<Self, Fault> {
        let Some(text) = field.as_text() else {
            return u32::parse(field, key).map(Self::Pixels);
        };
        let starts_with_number =
            text.trim_start().starts_with(|c: char| c.is_ascii_digit() || c == '.');
        if !starts_with_number {
            return Err(Fault::Unwanted);
        }
        length(text.trim()).map(Self::Paper).map_err(Fault::Because)
    }

    fn toml(&self) -> String {
        match self {
            Self::Pixels(pixels) => pixels.to_string(),
            Self::Paper(length) => format!("\"{length}mm\""),
        }
    }

    fn schema(key: &Key) -> Json {
        json!({ "anyOf": [
            u32::schema(key),
            { "type": "string", "pattern": r"^\s*([0-9]+\.?[0-9]*|\.[0-9]+)\s*(mm|cm|in|pt)\s*$" },
        ] })
    }
}

/// The message for a side of no or too many pixels.
pub(super) fn wrong_size(pixels: u32, dpi: u32) -> Option<String> {
    let is_possible = (1..=MAX_SIDE).contains(&pixels);
    (!is_possible).then(|| {
        format!("is {pixels} pixels with {dpi} dots per inch, but must be 1 to {MAX_SIDE}; change it or image.dpi")
    })
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use crate::Manifest;

    fn size(image: &str) -> Result<[u32; 2], String> {
        let text = format!("input.path = \"a\"\n[image]\n{image}");
        let manifest = Manifest::parse(&text, Path::new("job.toml"));
        let sides = |m: Manifest| [m.image.width, m.image.height].map(|side| side.pixels(1));
        manifest.map(sides).map_err(|error| error.to_string())
    }

    #[test]
    fn lengths_on_paper_are_pixels() {
        for (image, wanted) in [
            ("width = \"85mm\"\ndpi = 300", [1004, 565]),
            ("width = \"85mm\"", [1004, 565]),
            ("width = \"8.5 cm\"\nheight = \"6cm\"\ndpi = 600", [2008, 1417]),
            ("width = \"3in\"\nheight = \"144pt\"\ndpi = 100", [300, 200]),
            ("height = \"1in\"\ndpi = 90", [160, 90]),
            ("width = \"1in\"\nheight = 77\ndpi = 90", [90, 77]),
            ("width = 640\ndpi = 90", [640, 1080]),
        ] {
            assert_eq!(size(image), Ok(wanted), "{image}");
        }
    }

    #[test]
    fn wrong_lengths_are_refused() {
        for (image, part) in [
            ("width = \"85\"", "image.width: \"85\" has no unit; write \"85mm\""),
            ("width = \"85px\"", "image.width: unknown unit `px`; write a whole number of pixels"),
            ("width = \"85 m\"", "unknown unit `m`"),
            ("width = \"8.5.1cm\"", "\"8.5.1cm\" is not a length on paper"),
            ("height = \"0mm\"", "image.height: \"0mm\" is not a length on paper"),
            (
                "width = \"wide\"",
                "image.width: expected a length on paper such as \"85mm\", or a whole number from 1 to 65536",
            ),
            (
                "width = \"90in\"\ndpi = 4800",
                "image.width: is 432000 pixels with 4800 dots per inch",
            ),
            ("width = \"1mm\"\ndpi = 1", "image.width: is 0 pixels"),
            ("dpi = 0", "image.dpi: expected a whole number"),
        ] {
            let error = size(image).unwrap_err();
            assert!(error.contains(part), "{image}: {error}");
        }
    }
}
