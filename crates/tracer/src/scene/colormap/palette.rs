//! Palettes for categories: colours that people with a colour vision deficiency can tell apart.

/// A palette of sRGB colours.
#[derive(Debug)]
pub(super) struct Palette {
    pub(super) name: &'static str,
    pub(super) colors: &'static [[u8; 3]],
}

/// All palettes, the default first.
pub(super) const PALETTES: [Palette; 3] = [
    // Okabe & Ito, "Color Universal Design", 2008. Black is last: it is hard to see on shaded particles.
    Palette {
        name: "okabe-ito",
        colors: &[
            [0, 114, 178],
            [230, 159, 0],
            [0, 158, 115],
            [213, 94, 0],
            [86, 180, 233],
            [204, 121, 167],
            [240, 228, 66],
            [0, 0, 0],
        ],
    },
    // Tol, "Colour schemes", SRON/EPS/TN/09-002, issue 3.2, 2021: bright
    Palette {
        name: "tol-bright",
        colors: &[
            [68, 119, 170],
            [238, 102, 119],
            [34, 136, 51],
            [204, 187, 68],
            [102, 204, 238],
            [170, 51, 119],
            [187, 187, 187],
        ],
    },
    // The same: muted
    Palette {
        name: "tol-muted",
        colors: &[
            [204, 102, 119],
            [51, 34, 136],
            [221, 204, 119],
            [17, 119, 51],
            [136, 204, 238],
            [136, 34, 85],
            [68, 170, 153],
            [153, 153, 51],
            [170, 68, 153],
        ],
    },
];

/// The palette `name`.
pub(super) fn palette(name: &str) -> Option<&'static Palette> {
    PALETTES.iter().find(|palette| palette.name == name)
}
