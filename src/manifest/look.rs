//! `[image]` and `[render]`: how large, and how traced.

use super::color::{Background, rgb};
use super::length::AutoLength;
use super::named;
use super::reader::{Field, Section};
use super::write::{Entries, Toml, described};
use crate::accel::{BvhLeaves, BvhPreset, SbvhSettings, Structure};
use crate::metrics::Bytes;
use crate::render::{DEFAULT_MIN_WEIGHT, MAX_DEPTH, MAX_SAMPLES, MAX_SIDE, MIN_WEIGHTS};
use crate::scene::ground;
use crate::surface::SurfaceKind;

/// `[image]`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Image {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Samples a pixel.
    pub samples: u32,
}

named! {
    /// How particles are ordered for tracing. The picture is the same.
    Accelerator {
        /// The renderer's choice.
        Auto = "auto",
        /// Along a space-filling curve: the fastest build.
        Lbvh = "lbvh",
        /// By median splits: the fastest to trace.
        Kdtree = "kdtree",
        /// By locally ordered clustering.
        Bvh = "bvh",
        /// By the surface area heuristic with spatial splits.
        Sbvh = "sbvh",
    }
}

impl Accelerator {
    /// The structure that was asked for; None leaves it to the renderer.
    pub fn structure(self) -> Option<Structure> {
        match self {
            Self::Auto => None,
            named => named.name().parse().ok(),
        }
    }
}

/// Where the ground is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum GroundHeight {
    /// Just under the particles of the whole sequence.
    Auto,
    /// Along `input.up`, world units.
    At(f64),
}

named! {
    /// What is painted on the ground.
    GroundPattern {
        /// Nothing.
        Plain = "plain",
        /// Squares, every other one darker.
        Checker = "checker",
    }
}

/// `[render]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Render {
    /// How particles are ordered for tracing.
    pub accelerator: Accelerator,
    /// How much `bvh` spends on its tree.
    pub bvh_preset: BvhPreset,
    /// What `bvh` builds its tree over.
    pub bvh_leaves: BvhLeaves,
    /// What `sbvh` is told.
    pub sbvh: SbvhSettings,
    /// Reflections and refractions in a row.
    pub max_depth: u32,
    /// Path weight below which one of the two branches at a transmissive sphere is followed; 0 follows both.
    pub min_weight: f32,
    /// What rays see that meet nothing.
    pub background: Background,
    /// Whether there is a ground that takes shadows.
    pub ground: bool,
    /// Where it is.
    pub ground_height: GroundHeight,
    /// Linear RGB.
    pub ground_color: [f32; 3],
    /// What is painted on it.
    pub ground_pattern: GroundPattern,
    /// Edge of the pattern's squares.
    pub ground_tile: AutoLength,
    /// Most memory to take; None is what is free.
    pub memory_limit: Option<Bytes>,
}

impl Default for Image {
    fn default() -> Self {
        Self {
            width: 1920,
            height: 1080,
            samples: 16,
        }
    }
}

impl Default for Render {
    fn default() -> Self {
        Self {
            accelerator: Accelerator::Auto,
            bvh_preset: BvhPreset::default(),
            bvh_leaves: BvhLeaves::default(),
            sbvh: SbvhSettings::DEFAULT,
            max_depth: 3,
            min_weight: DEFAULT_MIN_WEIGHT,
            background: Background::Auto,
            ground: false,
            ground_height: GroundHeight::Auto,
            ground_color: ground::DEFAULT_COLOR.to_array(),
            ground_pattern: GroundPattern::Plain,
            ground_tile: AutoLength::Auto,
            memory_limit: None,
        }
    }
}

impl Image {
    pub(super) fn read(mut section: Section<'_>) -> Self {
        let default = Self::default();
        let image = Self {
            width: section.value("width", default.width, |f| f.count(1, MAX_SIDE)),
            height: section.value("height", default.height, |f| f.count(1, MAX_SIDE)),
            samples: section.value("samples", default.samples, |f| f.count(1, MAX_SAMPLES)),
        };
        section.finish();
        image
    }

    pub(super) fn entries(&self, out: &mut Entries) {
        out.section("image");
        out.put("width", &self.width, "pixels");
        out.put("height", &self.height, "pixels");
        out.put("samples", &self.samples, "per pixel");
    }
}

impl Render {
    /// Reads what is left of the section after the surface.
    pub(super) fn read(mut section: Section<'_>) -> Self {
        let default = Self::default();
        let render = Self {
            accelerator: section.value("accelerator", default.accelerator, |field| {
                field.choice(Accelerator::ALL)
            }),
            bvh_preset: section.value("bvh_preset", default.bvh_preset, |f| {
                f.choice(&BvhPreset::ALL.map(|preset| (preset, preset.name())))
            }),
            bvh_leaves: section.value("bvh_leaves", default.bvh_leaves, |f| {
                f.choice(&BvhLeaves::ALL.map(|leaves| (leaves, leaves.name())))
            }),
            sbvh: SbvhSettings {
                alpha: section.value("sbvh_alpha", default.sbvh.alpha, |f| {
                    f.number32("a number from 0 to 1", |v| {
                        SbvhSettings::ALPHAS.contains(&v)
                    })
                }),
                budget: section.value("sbvh_budget", default.sbvh.budget, |f| {
                    f.number32("a number from 0 (no spatial splits) to 8", |v| {
                        SbvhSettings::BUDGETS.contains(&v)
                    })
                }),
            },
            max_depth: section.value("max_depth", default.max_depth, |f| f.count(1, MAX_DEPTH)),
            min_weight: section.value("min_weight", default.min_weight, |f| {
                f.number32("0, or a number from 1e-5 to 1", |v| {
                    v == 0.0 || MIN_WEIGHTS.contains(&v)
                })
            }),
            background: section.value("background", default.background, Background::read),
            ground: section.value("ground", default.ground, Field::bool),
            ground_height: section.value("ground_height", default.ground_height, |f| {
                if f.as_text() == Some("auto") {
                    return Some(GroundHeight::Auto);
                }
                f.number("a height or \"auto\"", |_| true)
                    .map(GroundHeight::At)
            }),
            ground_color: section.value("ground_color", default.ground_color, rgb),
            ground_pattern: section.value("ground_pattern", default.ground_pattern, |f| {
                f.choice(GroundPattern::ALL)
            }),
            ground_tile: section.value("ground_tile", default.ground_tile, AutoLength::read),
            memory_limit: section.optional("memory_limit", read_size),
        };
        section.finish();
        render
    }

    /// `branches`: whether both a mirrored and a refracted ray leave from the spheres.
    pub(super) fn entries(&self, surface: SurfaceKind, branches: bool, out: &mut Entries) {
        out.section("render");
        out.put(
            "surface",
            &surface,
            "spheres | medium (one body of overlapping spheres) | smooth (of the SPH field)",
        );
        out.put(
            "accelerator",
            &self.accelerator,
            "auto | lbvh | kdtree | bvh | sbvh; the picture is the same",
        );
        out.depends_on(None);
        out.put(
            "bvh_preset",
            &self.bvh_preset,
            "how much bvh spends on its tree: fast | medium | high",
        );
        out.depends_on(None);
        out.put(
            "bvh_leaves",
            &self.bvh_leaves,
            "what bvh builds over: blocks, or particles (200 bytes each while building)",
        );
        out.depends_on(None);
        out.put(
            "sbvh_alpha",
            &self.sbvh.alpha,
            "sbvh tries to cut spheres where boxes overlap by more than this part of the scene's area",
        );
        out.depends_on(None);
        out.put(
            "sbvh_budget",
            &self.sbvh.budget,
            "parts of cut spheres that sbvh may add, per particle; 0 cuts none",
        );
        out.depends_on(None);
        out.put(
            "max_depth",
            &self.max_depth,
            "1 is direct light only; each more follows reflections and refractions once",
        );
        out.put(
            "min_weight",
            &self.min_weight,
            "transmissive spheres: path weight below which one of two branches is followed; 0 follows both",
        );
        if !branches {
            out.depends_on(None);
        }
        out.put(
            "background",
            &self.background,
            "auto, linear RGB, or { bottom = [...], top = [...] }",
        );
        out.put(
            "ground",
            &self.ground,
            "a plane under the particles that takes shadows",
        );
        out.put(
            "ground_height",
            &self.ground_height,
            "auto, or a height along input.up",
        );
        out.put("ground_color", &self.ground_color, "linear RGB");
        out.put(
            "ground_pattern",
            &self.ground_pattern,
            "plain | checker (every other square darker)",
        );
        out.put(
            "ground_tile",
            &self.ground_tile,
            "edge of a square: auto, or a length",
        );
        out.maybe(
            "memory_limit",
            self.memory_limit.as_ref(),
            "\"4GiB\"",
            "most memory to take; frames that need more fail; default: what is free",
        );
        out.depends_on(None);
    }
}

/// A size as text or as a number of bytes, above 0.
pub(super) fn read_size(field: &Field<'_>) -> Option<Bytes> {
    let size = match (field.as_text(), field.as_integer()) {
        (Some(text), _) => text.parse().ok(),
        (None, Some(bytes)) => u64::try_from(bytes).ok().map(Bytes),
        (None, None) => None,
    };
    // TOML has no larger integers.
    let size = size.filter(|size| (1..=i64::MAX as u64).contains(&size.0));
    field.or_wants(
        size,
        "a size above 0, as \"4GiB\", \"512MiB\" or a number of bytes",
    )
}

impl Toml for Bytes {
    fn toml(&self) -> String {
        // Exactly, in the largest unit that it is whole in.
        let units = [("GiB", 30), ("MiB", 20), ("KiB", 10)];
        let unit = units
            .iter()
            .find(|(_, shift)| self.0.trailing_zeros() >= *shift);
        match unit {
            Some((name, shift)) => format!("{}{name}", self.0 >> shift).toml(),
            None => self.0.to_string(),
        }
    }
}

described!(Bytes, {
    "anyOf": [
        { "type": "integer", "minimum": 1 },
        { "type": "string", "pattern": SIZE_PATTERN },
    ],
});

/// Sizes as a regular expression; parts of a unit need one larger than a byte.
const SIZE_PATTERN: &str = concat!(
    r"^\s*([0-9]+\s*([bB]|[kKmMgGtT]([iI]?[bB])?)?",
    r"|([0-9]+\.[0-9]*|\.[0-9]+)\s*[kKmMgGtT]([iI]?[bB])?)\s*$"
);

impl Toml for BvhPreset {
    fn toml(&self) -> String {
        self.name().toml()
    }
}

impl Toml for BvhLeaves {
    fn toml(&self) -> String {
        self.name().toml()
    }
}

described!(BvhPreset, { "enum": BvhPreset::ALL.map(BvhPreset::name) });

described!(BvhLeaves, { "enum": BvhLeaves::ALL.map(BvhLeaves::name) });

described!(GroundHeight, { "anyOf": [{ "const": "auto" }, { "type": "number" }] });

impl Toml for GroundHeight {
    fn toml(&self) -> String {
        match self {
            Self::Auto => "auto".toml(),
            Self::At(height) => height.toml(),
        }
    }
}
