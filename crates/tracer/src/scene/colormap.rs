//! Colour maps: from values of particles to linear RGB.
//!
//! The maps of matplotlib and d3 are those of `colorous`, except turbo; those of Fabio Crameri are data.

use glam::Vec3;
use spherule_tree::math::narrow;
use thiserror::Error;

mod crameri;
mod elements;
mod palette;
mod scale;
mod tables;
mod turbo;

use elements::{color_on_white, element_color};
use palette::{PALETTES, palette};
pub use scale::ColorScale;
use tables::Table;

/// Entries of a table, as in the published 8-bit maps.
const ENTRIES: usize = 256;

/// Colour of a value that is NaN, or of an unknown category (linear RGB): a grey that is in no map except `greys`.
pub const NO_VALUE: Vec3 = Vec3::new(0.18, 0.18, 0.18);

/// Ending of the names of reversed maps.
const REVERSED: &str = "_r";

/// A colour map with a fixed range, so that a value has the same colour in every frame.
#[derive(Debug, Clone, PartialEq)]
pub struct ColorMap {
    kind: Kind,
}

#[derive(Debug, Clone, PartialEq)]
enum Kind {
    Continuous(Continuous),
    /// Values with their colours, rising, and the colours of all others.
    Categories(Vec<(i64, Vec3)>, Others),
}

/// Colours of categories that are not listed.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Others {
    Unknown,
    /// Values are atomic numbers.
    Elements,
    /// The same, with the colours for pictures in front of white.
    ElementsOnWhite,
}

impl Others {
    /// The colour of a value.
    fn color(self, value: i64) -> Vec3 {
        match self {
            Self::Unknown => NO_VALUE,
            Self::Elements => element_color(value),
            Self::ElementsOnWhite => color_on_white(value),
        }
    }
}

/// A map of real numbers.
#[derive(Debug, Clone, PartialEq)]
struct Continuous {
    table: Box<[Vec3; ENTRIES]>,
    /// The position on the scale where the map begins.
    low: f32,
    /// Table steps per unit of the scale; 0 for an empty range.
    rate: f32,
    /// Table position of `low`.
    start: f32,
    scale: ColorScale,
    /// Values at the two ends.
    range: [f64; 2],
    /// Number of colours of a discrete map.
    steps: Option<u32>,
}

/// An unknown name of a colour map.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("no color map is called {name:?}, did you mean {nearest:?}")]
pub struct UnknownColorMap {
    /// The name.
    pub name: String,
    /// The most similar known name.
    pub nearest: &'static str,
}

impl ColorMap {
    /// Largest number of colours of a discrete map.
    pub const MAX_STEPS: u32 = 64;

    /// The palette with the colours of chemical elements, whose categories are atomic numbers.
    pub const ELEMENTS: &str = "jmol";

    /// The same with a light grey instead of white, for pictures in front of white.
    pub const ELEMENTS_ON_WHITE: &str = "jmol-on-white";

    /// The map `name`, stretched over the range `low` to `high`; values outside get the colours at the ends. `low >
    /// high` reverses the map; with `low == high` every number gets the middle colour. Names that end in `_r` are
    /// reversed maps.
    ///
    /// # Errors
    /// If the name is unknown.
    pub fn new(name: &str, low: f32, high: f32) -> Result<Self, UnknownColorMap> {
        Self::with_scale(name, [low.into(), high.into()], ColorScale::Linear)
    }

    /// Same as [`Self::new`], with a `scale`. The range must be above 0 for a logarithmic one.
    ///
    /// # Errors
    /// If the name is unknown.
    pub fn with_scale(
        name: &str,
        range: [f64; 2],
        scale: ColorScale,
    ) -> Result<Self, UnknownColorMap> {
        // Read the table, from either end
        let (table, is_reversed) = table(name)?;
        let entry = |i| if is_reversed { table.entry(ENTRIES - 1 - i) } else { table.entry(i) };
        let last = (ENTRIES - 1) as f32;
        // Map the range to entries of the table; an empty range maps to the middle
        let [low, high] = range.map(|value| narrow(scale.forward(value)));
        let span = high - low;
        let usable = span != 0.0 && span.is_finite();
        Ok(Self {
            kind: Kind::Continuous(Continuous {
                table: Box::new(std::array::from_fn(entry)),
                low,
                rate: if usable { last / span } else { 0.0 },
                start: if usable { 0.0 } else { 0.5 * last },
                scale,
                range,
                steps: None,
            }),
        })
    }

    /// The map divided into `steps` bands of one colour each, from the first to the last colour of the map.
    #[must_use]
    pub fn with_steps(mut self, steps: Option<u32>) -> Self {
        if let Kind::Continuous(map) = &mut self.kind {
            map.steps = steps.map(|steps| steps.clamp(2, Self::MAX_STEPS));
        }
        self
    }

    /// Colours for the categories `values`, rising. `name` is a palette, or a map whose colours are taken at equal
    /// distances. If the palette has a colour for each number from 0 to the largest value, the value is the index of
    /// its colour; otherwise colours are assigned in order. After the last one, a palette starts again.
    ///
    /// # Errors
    /// If the name is unknown.
    pub fn of_categories(name: &str, values: &[i64]) -> Result<Self, UnknownColorMap> {
        // Elements have colours of their own
        let (base, is_reversed) = base_name(name);
        let elements = match base {
            Self::ELEMENTS => Some(Others::Elements),
            Self::ELEMENTS_ON_WHITE => Some(Others::ElementsOnWhite),
            _ => None,
        };
        if let Some(others) = elements {
            let colors = values.iter().map(|value| (*value, others.color(*value)));
            return Ok(Self { kind: Kind::Categories(colors.collect(), others) });
        }
        // Numbers may be those of the palette, if all of them are
        let last = values.len().saturating_sub(1).max(1);
        let is_index = |count: usize| {
            let fits = |value: &i64| usize::try_from(*value).is_ok_and(|value| value < count);
            values.iter().all(fits)
        };
        // Take a colour of the palette, or one at equal distances along a map
        let color = |(order, value): (usize, &i64)| match palette(base) {
            Some(palette) => {
                let count = palette.colors.len();
                let index = match usize::try_from(*value) {
                    Ok(index) if is_index(count) => index,
                    _ => order % count,
                };
                let at = if is_reversed { count - 1 - index } else { index };
                let srgb = palette.colors[at].map(|byte| f32::from(byte) / 255.0);
                Ok(Vec3::from_array(srgb.map(linear_from_srgb)))
            }
            None => {
                let (table, is_reversed) = table(name)?;
                let at = order * (ENTRIES - 1) / last;
                Ok(table.entry(if is_reversed { ENTRIES - 1 - at } else { at }))
            }
        };
        let colors: Result<Vec<Vec3>, UnknownColorMap> =
            values.iter().enumerate().map(color).collect();
        let categories = values.iter().copied().zip(colors?);
        Ok(Self::of_colors(categories.collect()))
    }

    /// These colours for categories, linear RGB; the values rise.
    pub const fn of_colors(categories: Vec<(i64, Vec3)>) -> Self {
        Self { kind: Kind::Categories(categories, Others::Unknown) }
    }

    /// Names of all maps of numbers, without the reversed ones.
    pub fn names() -> impl Iterator<Item = &'static str> {
        tables::names()
    }

    /// Names of the palettes for categories, the default first.
    pub fn palette_names() -> impl Iterator<Item = &'static str> {
        let elements = [Self::ELEMENTS, Self::ELEMENTS_ON_WHITE];
        PALETTES.iter().map(|palette| palette.name).chain(elements)
    }

    /// Linear RGB of `value`, interpolated between table entries; [`NO_VALUE`] for NaN.
    pub fn color(&self, value: f32) -> Vec3 {
        if value.is_nan() {
            return NO_VALUE;
        }
        match &self.kind {
            Kind::Continuous(map) => map.at(map.position(value)),
            Kind::Categories(all, others) => {
                #[expect(clippy::cast_possible_truncation, reason = "an integer, or saturated")]
                let value = value as i64;
                let found = all.binary_search_by_key(&value, |(known, _)| *known);
                found.map_or_else(|_| others.color(value), |index| all[index].1)
            }
        }
    }

    /// Linear RGB at a fraction of the length of the map; [`NO_VALUE`] for categories.
    pub fn color_at(&self, fraction: f32) -> Vec3 {
        match &self.kind {
            Kind::Continuous(map) => map.at(fraction.clamp(0.0, 1.0) * (ENTRIES - 1) as f32),
            Kind::Categories(..) => NO_VALUE,
        }
    }

    /// The categories with their colours in linear RGB; None for a map of numbers.
    pub fn categories(&self) -> Option<&[(i64, Vec3)]> {
        match &self.kind {
            Kind::Continuous(_) => None,
            Kind::Categories(all, _) => Some(all),
        }
    }

    /// Values at the two ends of a map of numbers, and its scale; None for categories.
    pub fn range(&self) -> Option<([f64; 2], ColorScale)> {
        match &self.kind {
            Kind::Continuous(map) => Some((map.range, map.scale)),
            Kind::Categories(..) => None,
        }
    }

    /// Number of colours of a discrete map of numbers.
    pub fn steps(&self) -> Option<u32> {
        match &self.kind {
            Kind::Continuous(map) => map.steps,
            Kind::Categories(..) => None,
        }
    }
}

impl Continuous {
    /// Position of a number in the table.
    fn position(&self, value: f32) -> f32 {
        let value = match self.scale {
            ColorScale::Linear => value,
            scale => narrow(scale.forward(value.into())),
        };
        // An infinite value times 0 would be NaN, so the offset is bounded first.
        let offset = (value - self.low).clamp(f32::MIN, f32::MAX) * self.rate;
        (self.start + offset).clamp(0.0, (ENTRIES - 1) as f32)
    }

    /// Linear RGB at a position in the table.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the table or to the steps; the fraction is taken below"
    )]
    fn at(&self, position: f32) -> Vec3 {
        let last = (ENTRIES - 1) as f32;
        let at = match self.steps {
            None => position,
            Some(steps) => {
                let step = ((position / last * steps as f32) as u32).min(steps - 1);
                step as f32 / (steps - 1) as f32 * last
            }
        };
        let index = (at as usize).min(ENTRIES - 2);
        self.table[index].lerp(self.table[index + 1], at - index as f32)
    }
}

/// The name without the ending of reversed maps, and whether it had that.
fn base_name(name: &str) -> (&str, bool) {
    match name.strip_suffix(REVERSED) {
        Some(base) => (base, true),
        None => (name, false),
    }
}

/// The table of a map, and whether it is reversed.
fn table(name: &str) -> Result<(Table, bool), UnknownColorMap> {
    let (base, is_reversed) = base_name(name);
    let found = Table::named(base)
        .ok_or_else(|| UnknownColorMap { name: name.to_owned(), nearest: nearest_name(name) })?;
    Ok((found, is_reversed))
}

/// The known name with the smallest edit distance to `name`.
fn nearest_name(name: &str) -> &'static str {
    let distance = |known: &str| strsim::damerau_levenshtein(known, &name.to_lowercase());
    ColorMap::names().min_by_key(|known| distance(known)).unwrap_or("viridis")
}

/// Inverse of the sRGB transfer function (IEC 61966-2-1).
pub(super) fn linear_from_srgb(v: f32) -> f32 {
    if v <= 0.040_45 { v / 12.92 } else { libm::powf((v + 0.055) / 1.055, 2.4) }
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
    fn turbo_is_the_published_map() {
        let map = ColorMap::new("turbo", 0.0, 255.0).unwrap();
        for (entry, published) in [
            (0.0, [48.0, 18.0, 59.0]),
            (1.0, [50.0, 21.0, 67.0]),
            (64.0, [40.0, 188.0, 235.0]),
            (127.0, [161.0, 253.0, 61.0]),
            (128.0, [164.0, 252.0, 60.0]),
            (191.0, [251.0, 129.0, 34.0]),
            (254.0, [126.0, 5.0, 2.0]),
            (255.0, [122.0, 4.0, 3.0_f32]),
        ] {
            let color = map.color(entry).to_array();
            for (got, expected) in color.into_iter().zip(published) {
                let step = |by: f32| linear_from_srgb((expected + by).clamp(0.0, 255.0) / 255.0);
                assert!((step(-1.0)..=step(1.0)).contains(&got), "{entry}: {got} {expected}");
            }
        }
    }

    #[test]
    fn interpolates_and_reverses() {
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
    fn map_names_are_found_or_suggested() {
        for name in ColorMap::names() {
            let map = ColorMap::new(name, 0.0, 1.0).unwrap();
            assert!(map.color(0.3).is_finite());
        }
        let error = ColorMap::new("Virdis", 0.0, 1.0).unwrap_err();
        assert_eq!(error.nearest, "viridis");
    }

    /// Entry `i` of a map as sRGB bytes.
    fn bytes(map: &ColorMap, i: u8) -> [u8; 3] {
        let close = |linear: f32| {
            let distance = |byte: &u8| (linear_from_srgb(f32::from(*byte) / 255.0) - linear).abs();
            let bytes = 0..=255_u8;
            let best = bytes.min_by(|a, b| distance(a).total_cmp(&distance(b)));
            best.expect("not empty")
        };
        map.color(f32::from(i)).to_array().map(close)
    }

    #[test]
    fn crameri_maps_are_the_published_ones() {
        // Rounded from the tables of cmcrameri 1.10
        for (name, ends) in [
            ("batlow", [[1, 25, 89], [130, 130, 49], [250, 204, 250]]),
            ("vik", [[0, 18, 97], [236, 229, 224], [89, 0, 8]]),
            ("vikO", [[79, 26, 61], [213, 190, 179], [80, 25, 60]]),
        ] {
            let map = ColorMap::new(name, 0.0, 255.0).unwrap();
            assert_eq!([0, 128, 255].map(|i| bytes(&map, i)), ends, "{name}");
            let reversed = ColorMap::new(&format!("{name}_r"), 0.0, 255.0).unwrap();
            assert_eq!([255, 127, 0].map(|i| bytes(&reversed, i)), ends, "{name}");
        }
    }

    #[test]
    fn log_maps_have_equal_lengths_for_equal_ratios() {
        let log = ColorMap::with_scale("viridis", [1e-2, 1e2], ColorScale::Log).unwrap();
        let linear = ColorMap::new("viridis", -2.0, 2.0).unwrap();
        for exponent in [-2, -1, 0, 1, 2] {
            let value = 10_f64.powi(exponent);
            let found = log.color(narrow(value));
            let expected = linear.color(narrow(f64::from(exponent)));
            assert!((found - expected).length() < 1e-5, "{exponent}");
        }
        for value in [0.0, -3.0, f32::NEG_INFINITY] {
            assert_eq!(log.color(value), log.color_at(0.0));
        }
        assert_eq!(log.color(f32::INFINITY), log.color_at(1.0));
    }

    #[test]
    fn discrete_maps_have_bands() {
        let map = ColorMap::new("batlow", 0.0, 8.0).unwrap().with_steps(Some(4));
        let full = ColorMap::new("batlow", 0.0, 3.0).unwrap();
        for (value, band) in
            [(-1.0, 0.0), (0.0, 0.0), (1.9, 0.0), (2.1, 1.0), (5.9, 2.0), (6.1, 3.0), (9.0, 3.0)]
        {
            assert!((map.color(value) - full.color(band)).length() < 1e-5, "{value}");
        }
    }

    #[test]
    fn categories_have_colours_of_the_palette() {
        let orange =
            Vec3::from_array([230.0, 159.0, 0.0].map(|b: f32| linear_from_srgb(b / 255.0)));
        // Small values are indices, so that a type keeps its colour if another is absent
        let map = ColorMap::of_categories("okabe-ito", &[1, 3]).unwrap();
        assert_eq!(map.color(1.0), orange);
        assert_eq!(map.color(2.0), NO_VALUE);
        // Others have colours in order
        let map = ColorMap::of_categories("okabe-ito", &[-7, 1000, 1001]).unwrap();
        assert_eq!(map.color(1000.0), orange);
        // Palettes start again
        let many: Vec<i64> = (100..110).collect();
        let map = ColorMap::of_categories("okabe-ito", &many).unwrap();
        assert_eq!(map.color(101.0), map.color(109.0));
        // Maps of numbers are divided
        let map = ColorMap::of_categories("viridis", &[5, 6, 70]).unwrap();
        let viridis = ColorMap::new("viridis", 0.0, 1.0).unwrap();
        assert_eq!(map.color(70.0), viridis.color(1.0));
        assert!(ColorMap::of_categories("okabe", &[1]).is_err());
    }
}
