//! Numbers to colours: the maps of `colorous` as tables in linear RGB.

use glam::Vec3;
use thiserror::Error;

/// Entries of a table: what the published 8-bit maps hold.
const ENTRIES: usize = 256;

/// Colour of a value that is not a number (linear RGB): a grey outside every map but `greys`.
pub const NO_VALUE: Vec3 = Vec3::new(0.18, 0.18, 0.18);

/// Names and maps, best known first.
const MAPS: [(&str, colorous::Gradient); 21] = [
    ("viridis", colorous::VIRIDIS),
    ("turbo", colorous::TURBO),
    ("plasma", colorous::PLASMA),
    ("inferno", colorous::INFERNO),
    ("magma", colorous::MAGMA),
    ("cividis", colorous::CIVIDIS),
    ("greys", colorous::GREYS),
    ("blues", colorous::BLUES),
    ("greens", colorous::GREENS),
    ("oranges", colorous::ORANGES),
    ("purples", colorous::PURPLES),
    ("reds", colorous::REDS),
    ("warm", colorous::WARM),
    ("cool", colorous::COOL),
    ("cubehelix", colorous::CUBEHELIX),
    ("red-blue", colorous::RED_BLUE),
    ("red-yellow-blue", colorous::RED_YELLOW_BLUE),
    ("purple-orange", colorous::PURPLE_ORANGE),
    ("spectral", colorous::SPECTRAL),
    ("rainbow", colorous::RAINBOW),
    ("sinebow", colorous::SINEBOW),
];

/// A colour map with a fixed range, so that a value has the same colour in every frame.
#[derive(Debug, Clone, PartialEq)]
pub struct ColorMap {
    table: Box<[Vec3; ENTRIES]>,
    low: f32,
    /// Table steps per unit of value; 0 for an empty range.
    scale: f32,
    /// Table position of `low`.
    start: f32,
}

/// No map has this name.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("no color map is called {name:?}, did you mean {nearest:?}")]
pub struct UnknownColorMap {
    /// What was asked for.
    pub name: String,
    /// The known name most like it.
    pub nearest: &'static str,
}

impl ColorMap {
    /// The map called `name` stretched over `low` to `high`; values outside take the end colours.
    /// `low > high` turns the map round; with `low == high` every number has the middle colour.
    ///
    /// # Errors
    /// If there is no such map.
    pub fn new(name: &str, low: f32, high: f32) -> Result<Self, UnknownColorMap> {
        let found = MAPS.iter().find(|(known, _)| *known == name);
        let (_, gradient) = found.ok_or_else(|| UnknownColorMap {
            name: name.to_owned(),
            nearest: nearest_name(name),
        })?;
        let table = Box::new(std::array::from_fn(|i| {
            let color = gradient.eval_rational(i, ENTRIES);
            Vec3::new(
                linear_from_srgb(color.r),
                linear_from_srgb(color.g),
                linear_from_srgb(color.b),
            )
        }));
        let last = (ENTRIES - 1) as f32;
        let span = high - low;
        let usable = span != 0.0 && span.is_finite();
        Ok(Self {
            table,
            low,
            scale: if usable { last / span } else { 0.0 },
            start: if usable { 0.0 } else { 0.5 * last },
        })
    }

    /// Names of all maps.
    pub fn names() -> impl Iterator<Item = &'static str> {
        MAPS.iter().map(|(name, _)| *name)
    }

    /// Linear RGB of `value`, interpolated between table entries; [`NO_VALUE`] for NaN.
    pub fn color(&self, value: f32) -> Vec3 {
        if value.is_nan() {
            return NO_VALUE;
        }
        // Infinite values times 0 would be NaN; the offset must be bounded first.
        let offset = (value - self.low).clamp(f32::MIN, f32::MAX) * self.scale;
        let at = (self.start + offset).clamp(0.0, (ENTRIES - 1) as f32);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to the table; the fraction is taken below"
        )]
        let index = (at as usize).min(ENTRIES - 2);
        self.table[index].lerp(self.table[index + 1], at - index as f32)
    }
}

/// The known name at the least edit distance from `name`.
fn nearest_name(name: &str) -> &'static str {
    let distance = |known: &str| strsim::damerau_levenshtein(known, &name.to_lowercase());
    ColorMap::names()
        .min_by_key(|known| distance(known))
        .unwrap_or(MAPS[0].0)
}

/// Inverse of the sRGB transfer function (IEC 61966-2-1) for an 8-bit value.
fn linear_from_srgb(value: u8) -> f32 {
    let v = f32::from(value) / 255.0;
    if v <= 0.040_45 {
        v / 12.92
    } else {
        ((v + 0.055) / 1.055).powf(2.4)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_are_the_published_colours_in_linear_light() {
        // viridis runs from #440154 to #fde725; 0x44 = 68 is 0.0578 linear.
        let map = ColorMap::new("viridis", 2.0, 4.0).unwrap();
        let low = map.color(2.0);
        assert!((low.x - 0.057_805).abs() < 1e-4, "{low}");
        assert!((low.y - 0.000_304).abs() < 1e-5, "{low}");
        let high = map.color(4.0);
        assert!(high.x > 0.97 && high.y > 0.79 && high.z < 0.03, "{high}");
        assert_eq!(map.color(-1e30), low);
        assert_eq!(map.color(f32::NEG_INFINITY), low);
        assert_eq!(map.color(f32::INFINITY), high);
        assert_eq!(map.color(f32::NAN), NO_VALUE);
    }

    #[test]
    fn interpolates_and_turns_round() {
        let map = ColorMap::new("greys", 0.0, 255.0).unwrap();
        let between = map.color(100.5);
        let mean = 0.5 * (map.color(100.0) + map.color(101.0));
        assert!((between - mean).length() < 1e-5);
        let turned = ColorMap::new("greys", 255.0, 0.0).unwrap();
        assert!((turned.color(30.0) - map.color(225.0)).length() < 1e-5);
    }

    #[test]
    fn an_empty_range_gives_the_middle() {
        let empty = ColorMap::new("turbo", 3.0, 3.0).unwrap();
        let full = ColorMap::new("turbo", 0.0, 1.0).unwrap();
        for value in [3.0, -7.0, f32::INFINITY] {
            assert!((empty.color(value) - full.color(0.5)).length() < 1e-5);
        }
    }

    #[test]
    fn every_name_works_and_a_wrong_one_is_helped() {
        for name in ColorMap::names() {
            let map = ColorMap::new(name, 0.0, 1.0).unwrap();
            assert!(map.color(0.3).is_finite());
        }
        let error = ColorMap::new("Virdis", 0.0, 1.0).unwrap_err();
        assert_eq!(error.nearest, "viridis");
    }
}
