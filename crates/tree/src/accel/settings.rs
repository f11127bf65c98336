//! Settings of the tree builders: which structure, and the parameters of each.

use std::fmt;
use std::ops::RangeInclusive;
use std::str::FromStr;

use spherule_files::ValueError;

use super::preset::BvhPreset;

/// How particles are ordered and grouped. The structure affects speed and memory, not the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Structure {
    /// Along a space-filling curve (`lbvh.rs`): the fastest build.
    #[default]
    Lbvh,
    /// By medians of the widest axis (`kdtree/`): the fastest to trace.
    Kdtree,
    /// By clustering from the leaves up (`bvh.rs`).
    Bvh,
    /// By the surface area heuristic with spatial splits (`sbvh/`): the slowest build.
    Sbvh,
}

impl Structure {
    /// All structures.
    pub const ALL: [Self; 4] = [Self::Lbvh, Self::Kdtree, Self::Bvh, Self::Sbvh];

    /// The name on the command line and in files.
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
    type Err = ValueError;

    fn from_str(name: &str) -> Result<Self, ValueError> {
        let found = Self::ALL.into_iter().find(|s| s.name() == name);
        found.ok_or_else(|| ValueError::one_of(&Self::ALL.map(Self::name), name))
    }
}

/// Settings of a build.
#[derive(Debug, Clone, Copy)]
pub struct BuildSettings {
    /// The structure to build.
    pub structure: Structure,
    /// Keep the index in the frame for each particle (4 bytes per particle). Attributes and ids need it. Structures
    /// that may store a particle more than once always keep it.
    pub keep_indices: bool,
    /// Settings of [`Structure::Bvh`].
    pub bvh: BvhSettings,
    /// Settings of [`Structure::Sbvh`].
    pub sbvh: SbvhSettings,
}

impl BuildSettings {
    /// Default settings for `structure`.
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
    /// Single particles: about 200 bytes per particle during the build, and blocks that are not full.
    Particles,
}

/// Settings of [`Structure::Bvh`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct BvhSettings {
    /// Effort of the build.
    pub preset: BvhPreset,
    /// What the tree is built over.
    pub leaves: BvhLeaves,
}

impl BvhLeaves {
    /// All kinds of leaves.
    pub const ALL: [Self; 2] = [Self::Blocks, Self::Particles];

    /// The name in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Blocks => "blocks",
            Self::Particles => "particles",
        }
    }
}

/// Settings of `sbvh`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SbvhSettings {
    /// A spatial split is searched if the children of the best object split overlap by more than this fraction of the
    /// surface area of the whole scene.
    pub alpha: f32,
    /// References that spatial splits may add, as a fraction of the particle count; 0 disables such splits.
    pub budget: f32,
}

impl SbvhSettings {
    /// The alpha of the paper, and at most one additional reference per particle.
    pub const DEFAULT: Self = Self { alpha: 1e-5, budget: 1.0 };
    /// Valid values of `alpha`.
    pub const ALPHAS: RangeInclusive<f32> = 0.0..=1.0;
    /// Valid values of `budget`; a larger one would only cost memory.
    pub const BUDGETS: RangeInclusive<f32> = 0.0..=8.0;
}

impl Default for SbvhSettings {
    fn default() -> Self {
        Self::DEFAULT
    }
}
