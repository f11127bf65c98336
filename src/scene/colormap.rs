//! Colour maps: those of `colorous`, as tables in linear RGB.
//!
//! The turbo map of `colorous` is a polynomial that differs from the published map by up to 22 of 255 at the ends, so
//! turbo is interpolated here from knots of the published map.

use glam::Vec3;
use thiserror::Error;

/// Entries of a table, as in the published 8-bit maps.
const ENTRIES: usize = 256;

/// Colour of a value that is NaN (linear RGB): a grey that is in no map except `greys`.
pub const NO_VALUE: Vec3 = Vec3::new(0.18, 0.18, 0.18);

/// Number of table entries between two knots of [`TURBO`].
const TURBO_STEP: usize = 5;

/// Every fifth of the 256 colours of turbo (sRGB): Mikhailov, "Turbo, an improved rainbow colormap for
/// visualization", 2019. The cubics through them differ by at most 1 from all published entries.
const TURBO: [[u8; 3]; (ENTRIES - 1) / TURBO_STEP + 1] = [
    [48, 18, 59],
    [54, 33, 95],
    [59, 47, 128],
    [63, 62, 156],
    [66, 75, 181],
    [69, 89, 203],
    [70, 102, 221],
    [71, 115, 235],
    [70, 128, 246],
    [69, 140, 253],
    [64, 153, 255],
    [56, 165, 251],
    [47, 178, 244],
    [39, 190, 233],
    [31, 201, 221],
    [26, 212, 208],
    [24, 221, 194],
    [26, 228, 182],
    [34, 235, 170],
    [47, 241, 155],
    [63, 246, 138],
    [82, 250, 122],
    [101, 253, 105],
    [121, 254, 89],
    [139, 255, 75],
    [156, 254, 64],
    [169, 251, 57],
    [183, 247, 53],
    [195, 241, 52],
    [208, 234, 52],
    [219, 226, 54],
    [229, 217, 56],
    [238, 207, 58],
    [245, 197, 58],
    [250, 186, 57],
    [253, 174, 53],
    [254, 161, 48],
    [254, 147, 42],
    [252, 132, 35],
    [249, 117, 29],
    [244, 102, 23],
    [239, 88, 17],
    [232, 75, 12],
    [225, 65, 9],
    [216, 55, 6],
    [206, 45, 4],
    [195, 37, 3],
    [183, 29, 2],
    [169, 22, 1],
    [155, 15, 1],
    [139, 9, 2],
    [122, 4, 3],
];

/// Source of the colours of a map.
#[derive(Debug, Clone, Copy)]
enum Source {
    Colorous(colorous::Gradient),
    Turbo,
}

impl Source {
    /// Entry `i` of the table in linear RGB.
    fn entry(self, i: usize) -> Vec3 {
        let srgb = match self {
            Self::Colorous(gradient) => {
                let color = gradient.eval_rational(i, ENTRIES);
                Vec3::new(color.r.into(), color.g.into(), color.b.into())
            }
            Self::Turbo => turbo(i),
        };
        (srgb / 255.0).map(linear_from_srgb)
    }
}

/// Entry `i` of turbo in sRGB from 0 to 255: a Catmull-Rom spline through the knots.
fn turbo(i: usize) -> Vec3 {
    let knot = |k: usize| Vec3::from(TURBO[k.min(TURBO.len() - 1)].map(f32::from));
    let (k, t) = (i / TURBO_STEP, (i % TURBO_STEP) as f32 / TURBO_STEP as f32);
    let (from, to) = (knot(k), knot(k + 1));
    // Extrapolate linearly beyond the ends
    let before = if k == 0 { 2.0 * from - to } else { knot(k - 1) };
    let after = if k + 2 < TURBO.len() {
        knot(k + 2)
    } else {
        2.0 * to - from
    };
    // Evaluate the cubic between the knots
    let (slope_from, slope_to) = (0.5 * (to - before), 0.5 * (after - from));
    let bend = to - from;
    let cubic = slope_from + slope_to - 2.0 * bend;
    let square = 3.0 * bend - 2.0 * slope_from - slope_to;
    let color = from + t * (slope_from + t * (square + t * cubic));
    color.clamp(Vec3::ZERO, Vec3::splat(255.0))
}

/// Names and maps, best known first.
const MAPS: [(&str, Source); 21] = [
    ("viridis", Source::Colorous(colorous::VIRIDIS)),
    ("turbo", Source::Turbo),
    ("plasma", Source::Colorous(colorous::PLASMA)),
    ("inferno", Source::Colorous(colorous::INFERNO)),
    ("magma", Source::Colorous(colorous::MAGMA)),
    ("cividis", Source::Colorous(colorous::CIVIDIS)),
    ("greys", Source::Colorous(colorous::GREYS)),
    ("blues", Source::Colorous(colorous::BLUES)),
    ("greens", Source::Colorous(colorous::GREENS)),
    ("oranges", Source::Colorous(colorous::ORANGES)),
    ("purples", Source::Colorous(colorous::PURPLES)),
    ("reds", Source::Colorous(colorous::REDS)),
    ("warm", Source::Colorous(colorous::WARM)),
    ("cool", Source::Colorous(colorous::COOL)),
    ("cubehelix", Source::Colorous(colorous::CUBEHELIX)),
    ("red-blue", Source::Colorous(colorous::RED_BLUE)),
    (
        "red-yellow-blue",
        Source::Colorous(colorous::RED_YELLOW_BLUE),
    ),
    ("purple-orange", Source::Colorous(colorous::PURPLE_ORANGE)),
    ("spectral", Source::Colorous(colorous::SPECTRAL)),
    ("rainbow", Source::Colorous(colorous::RAINBOW)),
    ("sinebow", Source::Colorous(colorous::SINEBOW)),
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
    /// The map `name`, stretched over the range `low` to `high`; values outside get the colours at the ends. `low >
    /// high` reverses the map; with `low == high` every number gets the middle colour.
    ///
    /// # Errors
    /// If the name is unknown.
    pub fn new(name: &str, low: f32, high: f32) -> Result<Self, UnknownColorMap> {
        let found = MAPS.iter().find(|(known, _)| *known == name);
        let (_, source) = found.ok_or_else(|| UnknownColorMap {
            name: name.to_owned(),
            nearest: nearest_name(name),
        })?;
        let table = Box::new(std::array::from_fn(|i| source.entry(i)));
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
        // An infinite value times 0 would be NaN, so the offset is bounded first.
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

/// The known name with the smallest edit distance to `name`.
fn nearest_name(name: &str) -> &'static str {
    let distance = |known: &str| strsim::damerau_levenshtein(known, &name.to_lowercase());
    ColorMap::names()
        .min_by_key(|known| distance(known))
        .unwrap_or(MAPS[0].0)
}

/// Inverse of the sRGB transfer function (IEC 61966-2-1).
pub(super) fn linear_from_srgb(v: f32) -> f32 {
    if v <= 0.040_45 {
        v / 12.92
    } else {
        libm::powf((v + 0.055) / 1.055, 2.4)
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
                assert!(
                    (step(-1.0)..=step(1.0)).contains(&got),
                    "{entry}: {got} {expected}"
                );
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
}
