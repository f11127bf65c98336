//! The tables of colours by the names of the maps.

use glam::Vec3;

use super::{ENTRIES, crameri, linear_from_srgb, turbo};

/// Source of the colours of a map.
#[derive(Debug, Clone, Copy)]
pub(super) enum Table {
    Colorous(colorous::Gradient),
    Turbo,
    Crameri(usize),
}

impl Table {
    /// The table of the map `name`.
    pub(super) fn named(name: &str) -> Option<Self> {
        let found = MAPS.iter().find(|(known, _)| *known == name);
        found.map(|(_, table)| *table).or_else(|| {
            let number = crameri::NAMES.iter().position(|known| *known == name);
            number.map(Self::Crameri)
        })
    }

    /// Entry `i` in linear RGB.
    pub(super) fn entry(self, i: usize) -> Vec3 {
        let bytes = |[r, g, b]: [u8; 3]| Vec3::new(r.into(), g.into(), b.into());
        let srgb = match self {
            Self::Colorous(gradient) => {
                let color = gradient.eval_rational(i, ENTRIES);
                bytes([color.r, color.g, color.b])
            }
            Self::Turbo => turbo::entry(i),
            Self::Crameri(number) => bytes(crameri::entry(number, i)),
        };
        (srgb / 255.0).map(linear_from_srgb)
    }
}

/// Names of all maps, best known first.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    MAPS.iter().map(|(name, _)| *name).chain(crameri::NAMES)
}

/// The maps that are not in [`crameri`], best known first.
const MAPS: [(&str, Table); 21] = [
    ("viridis", Table::Colorous(colorous::VIRIDIS)),
    ("turbo", Table::Turbo),
    ("plasma", Table::Colorous(colorous::PLASMA)),
    ("inferno", Table::Colorous(colorous::INFERNO)),
    ("magma", Table::Colorous(colorous::MAGMA)),
    ("cividis", Table::Colorous(colorous::CIVIDIS)),
    ("greys", Table::Colorous(colorous::GREYS)),
    ("blues", Table::Colorous(colorous::BLUES)),
    ("greens", Table::Colorous(colorous::GREENS)),
    ("oranges", Table::Colorous(colorous::ORANGES)),
    ("purples", Table::Colorous(colorous::PURPLES)),
    ("reds", Table::Colorous(colorous::REDS)),
    ("warm", Table::Colorous(colorous::WARM)),
    ("cool", Table::Colorous(colorous::COOL)),
    ("cubehelix", Table::Colorous(colorous::CUBEHELIX)),
    ("red-blue", Table::Colorous(colorous::RED_BLUE)),
    ("red-yellow-blue", Table::Colorous(colorous::RED_YELLOW_BLUE)),
    ("purple-orange", Table::Colorous(colorous::PURPLE_ORANGE)),
    ("spectral", Table::Colorous(colorous::SPECTRAL)),
    ("rainbow", Table::Colorous(colorous::RAINBOW)),
    ("sinebow", Table::Colorous(colorous::SINEBOW)),
];
