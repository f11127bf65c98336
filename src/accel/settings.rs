//! Settings of the tree builders: which structure, and the parameters of each.

use std::fmt;
use std::ops::RangeInclusive;
use std::str::FromStr;

use super::preset::BvhPreset;

/// How particles are ordered and grouped. The picture is the same with each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Structure {
    /// Along a space-filling curve (`lbvh.rs`): the fastest build.
    #[default]
    Lbvh,
    /// By medians of the widest axis (`kdtree.rs`): the fastest to trace.
    Kdtree,
    /// By clustering from the leaves up (`bvh.rs`).
    Bvh,
    /// By the surface area heuristic with spatial splits (`sbvh/`): the slowest build.
    Sbvh,
}

impl Structure {
    /// All there are.
    pub const ALL: [Self; 4] = [Self::Lbvh, Self::Kdtree, Self::Bvh, Self::Sbvh];

    /// Its name on the command line and in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Lbvh => "lbvh",
            Self::Kdtree => "kdtree",
            Self::Bvh => "bvh",
            Self::Sbvh => "sbvh",
        }
    }
}

impl fmt::Display for Structure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Structure {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|s| s.name() == name);
        found.ok_or_else(|| {
            let names = Self::ALL.map(Self::name);
            format!("no structure {name:?}; there are {}", names.join(", "))
        })
    }
}

/// What the builders may be told.
#[derive(Debug, Clone, Copy)]
pub struct BuildSettings {
    /// Who builds.
    pub structure: Structure,
    /// Keep the way back to the particle's index in the frame (4 bytes a particle): needed for
    /// attributes and ids. Structures that may have a particle twice keep it anyway.
    pub keep_indices: bool,
    /// What [`Structure::Bvh`] is told.
    pub bvh: BvhSettings,
    /// What [`Structure::Sbvh`] is told.
    pub sbvh: SbvhSettings,
}

impl BuildSettings {
    /// `structure` with everything else as usual.
    pub fn new(structure: Structure) -> Self {
        Self {
            structure,
            keep_indices: true,
            bvh: BvhSettings::default(),
            sbvh: SbvhSettings::DEFAULT,
        }
    }
}

impl Default for BuildSettings {
    fn default() -> Self {
        Self::new(Structure::default())
    }
}

/// What the tree is built over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum BvhLeaves {
    /// Blocks of 16 particles along a space-filling curve.
    #[default]
    Blocks,
    /// Single particles: some 200 bytes each while building, and blocks that are not full.
    Particles,
}

/// What [`Structure::Bvh`] may be told.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct BvhSettings {
    /// How much is spent.
    pub preset: BvhPreset,
    /// What the tree is built over.
    pub leaves: BvhLeaves,
}

impl BvhLeaves {
    /// All there are.
    pub const ALL: [Self; 2] = [Self::Blocks, Self::Particles];

    /// Its name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Blocks => "blocks",
            Self::Particles => "particles",
        }
    }
}

/// What `sbvh` may be told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SbvhSettings {
    /// A spatial split is looked for where the sides of the best object split overlap by more than
    /// this part of the whole scene's surface area.
    pub alpha: f32,
    /// References that spatial splits may add, as a part of the particles; 0 for no such splits.
    pub budget: f32,
}

impl SbvhSettings {
    /// The paper's alpha; at most as many references again as there are particles.
    pub const DEFAULT: Self = Self {
        alpha: 1e-5,
        budget: 1.0,
    };
    /// Areas of which the overlap may be measured as a part.
    pub const ALPHAS: RangeInclusive<f32> = 0.0..=1.0;
    /// More than the largest is memory that nothing is gained for.
    pub const BUDGETS: RangeInclusive<f32> = 0.0..=8.0;
}

impl Default for SbvhSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}
