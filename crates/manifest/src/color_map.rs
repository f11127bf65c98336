//! Names and ranges of colour maps.

use serde_json::{Value as Json, json};
use spherule_tracer::scene::ColorMap;

use super::field::Field;
use super::key::Key;
use super::nearest::nearest;
use super::value::{Fault, Value, numbers_schema, quoted};

/// The name of a colour map or of a palette.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MapName {
    name: &'static str,
    is_reversed: bool,
}

impl MapName {
    /// The default map of numbers.
    pub const DEFAULT: Self = Self::plain("viridis");
    /// The default map of a symmetric range, with a light colour in the middle.
    pub const DIVERGING: Self = Self::plain("vik");
    /// The default palette.
    pub const PALETTE: Self = Self::plain("okabe-ito");
    /// The colours of chemical elements, by atomic number.
    pub const ELEMENTS: Self = Self::plain(ColorMap::ELEMENTS);

    /// Whether its colours are those of chemical elements.
    pub fn is_of_elements(self) -> bool {
        [ColorMap::ELEMENTS, ColorMap::ELEMENTS_ON_WHITE].contains(&self.name)
    }

    const fn plain(name: &'static str) -> Self {
        Self { name, is_reversed: false }
    }

    /// The map with a name, if there is one. The names of reversed maps end in `_r`.
    pub fn named(name: &str) -> Option<Self> {
        let (base, is_reversed) = match name.strip_suffix("_r") {
            Some(base) => (base, true),
            None => (name, false),
        };
        let name = known().find(|known| *known == base)?;
        Some(Self { name, is_reversed })
    }

    /// The name in a manifest.
    pub fn name(self) -> String {
        let ending = if self.is_reversed { "_r" } else { "" };
        format!("{}{ending}", self.name)
    }

    /// The same map from its end to its beginning.
    #[must_use]
    pub const fn reversed(self) -> Self {
        Self { is_reversed: !self.is_reversed, ..self }
    }

    /// The names of all maps and palettes, without reversed ones.
    pub fn all() -> Vec<&'static str> {
        known().collect()
    }

    /// Whether it is a palette for categories.
    pub fn is_palette(self) -> bool {
        ColorMap::palette_names().any(|palette| palette == self.name)
    }
}

/// Maps here, each with the names of similar ones in matplotlib, ParaView, OVITO, VMD and MATLAB: alike in kind
/// (sequential, diverging, cyclic) first, then in hue.
const SIMILAR: [(&str, &str); 24] = [
    ("vik", "coolwarm cooltowarm bluewhitered bwr rwb bgr seismic blueorange diverging"),
    ("red-blue", "rdbu redwhiteblue redblue"),
    ("red-yellow-blue", "rdylbu"),
    ("spectral", "rdylgn"),
    ("purple-orange", "puor"),
    ("cork", "piyg prgn"),
    ("broc", "brbg"),
    ("turbo", "jet hsvrainbow nipyspectral gistrainbow gistncar rainbowuniform colorspectrum"),
    ("lajolla", "hot afmhot gistheat heat fire blackbody blackbodyradiation gnuplot2 cmrmap"),
    ("inferno", "rocket"),
    ("magma", "bluered"),
    ("plasma", "gnuplot ember"),
    ("viridis", "parula default"),
    ("romaO", "hsv twilight twilightshifted phase cyclic hue"),
    ("greys", "gray grey grays grayscale greyscale gistgray gistyarg binary blackwhite xray"),
    ("blues", "bone ice gnbu pubu"),
    ("greens", "summer ylgn bugn"),
    ("reds", "orrd autumn"),
    ("oranges", "copper wistia ylorbr ylorrd"),
    ("oleron", "terrain topo gistearth earth"),
    ("devon", "ocean winter deep"),
    ("batlow", "haline thermal crameri"),
    ("okabe-ito", "tab10 set1 dark2 paired categorical colorblind"),
    ("tol-muted", "tab20 set2 set3 pastel1 accent"),
];

/// The map that was probably meant, if one is similar.
fn similar(name: &str) -> Option<&'static str> {
    let base = name.strip_suffix("_r").unwrap_or(name).to_ascii_lowercase();
    let joined = base.replace([' ', '-', '_', '.', '(', ')'], "");
    let is_other = |others: &str| others.split(' ').any(|other| other == joined);
    let elsewhere = SIMILAR.iter().find(|(_, others)| is_other(others));
    let names: Vec<&str> = known().collect();
    elsewhere.map_or_else(|| nearest(name, &names), |(known, _)| Some(*known))
}

/// Names of all maps and palettes, without the reversed ones.
fn known() -> impl Iterator<Item = &'static str> {
    ColorMap::names().chain(ColorMap::palette_names())
}

impl Value for MapName {
    fn kind(_: &Key) -> String {
        "a colour map".to_owned()
    }

    fn words() -> Vec<&'static str> {
        known().collect()
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        let text = field.as_text().ok_or(Fault::Unwanted)?;
        Self::named(text).ok_or_else(|| {
            let what = match similar(text) {
                Some(near) => format!("did you mean {near}?"),
                None => format!(
                    "choose one of {}; an `_r` at the end reverses a map",
                    known().collect::<Vec<_>>().join(", ")
                ),
            };
            Fault::Because(format!("unknown colour map `{text}`; {what}"))
        })
    }

    fn toml(&self) -> String {
        quoted(&self.name())
    }

    fn schema(_: &Key) -> Json {
        let names: Vec<&str> = known().collect();
        let reversed = format!("^({})_r$", names.join("|"));
        json!({ "anyOf": [{ "enum": names }, { "type": "string", "pattern": reversed }] })
    }
}

/// The values at the two ends of a colour map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RangeSetting {
    /// These values, rising.
    Values([f64; 2]),
    /// Percentiles of the values in the sequence, rising.
    Percentiles([f64; 2]),
    /// The range of the sequence, extended so that 0 is in the middle.
    Symmetric,
}

const SYMMETRIC: &str = "symmetric";

impl RangeSetting {
    /// Reads two percentages, such as `1%-99%`.
    fn percentiles(text: &str) -> Option<[f64; 2]> {
        let (low, high) = text.split_once('-')?;
        let number = |part: &str| {
            let digits = part.trim().strip_suffix('%')?;
            let is_plain = digits.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.');
            digits.parse::<f64>().ok().filter(|_| is_plain)
        };
        let range = [number(low)?, number(high)?];
        (range[0] < range[1] && range[1] <= 100.0).then_some(range)
    }
}

impl Value for RangeSetting {
    fn kind(_: &Key) -> String {
        "two rising numbers, such as [0.0, 4.0], percentiles such as \"1%-99%\", or \"symmetric\""
            .to_owned()
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        if let Some(text) = field.as_text() {
            return match text {
                SYMMETRIC => Ok(Self::Symmetric),
                text => Self::percentiles(text).map(Self::Percentiles).ok_or(Fault::Unwanted),
            };
        }
        match field.as_numbers() {
            Some([low, high]) if low < high => Ok(Self::Values([low, high])),
            Some([low, high]) => Err(Fault::Because(format!(
                "expected two rising numbers, found [{low:?}, {high:?}]; reverse = true reverses the map"
            ))),
            None => Err(Fault::Unwanted),
        }
    }

    fn toml(&self) -> String {
        match self {
            Self::Values([low, high]) => format!("[{low:?}, {high:?}]"),
            Self::Percentiles([low, high]) => quoted(&format!("{low}%-{high}%")),
            Self::Symmetric => quoted(SYMMETRIC),
        }
    }

    fn schema(_: &Key) -> Json {
        let percent = r" *([0-9]+(\.[0-9]*)?|\.[0-9]+)% *";
        json!({ "anyOf": [
            numbers_schema(2),
            { "type": "string", "pattern": format!("^({SYMMETRIC}|{percent}-{percent})$") },
        ] })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_other_programs_have_a_similar_map() {
        for (typed, expected) in [
            ("coolwarm", "vik"),
            ("Cool to Warm", "vik"),
            ("RdBu", "red-blue"),
            ("RdBu_r", "red-blue"),
            ("jet", "turbo"),
            ("gist_rainbow", "turbo"),
            ("Black-Body Radiation", "lajolla"),
            ("parula", "viridis"),
            ("gray", "greys"),
            ("virdis", "viridis"),
        ] {
            assert_eq!(similar(typed), Some(expected), "{typed}");
        }
        assert_eq!(similar("xyzzy"), None);
        for (map, others) in SIMILAR {
            assert!(MapName::named(map).is_some(), "{map}");
            for other in others.split(' ') {
                assert!(MapName::named(other).is_none(), "{other}");
                assert_eq!(similar(other), Some(map), "{other}");
            }
        }
    }
}
