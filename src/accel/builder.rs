//! One interface for all builders: the choice of structure, its settings, and the memory that is reused from frame to
//! frame.

use std::fmt;
use std::str::FromStr;

use super::wide::WideTree;
use super::{BuildReport, BvhSettings, SbvhSettings, Spheres, bvh, kdtree, lbvh, sbvh};

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
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|s| s.name() == name);
        found.ok_or_else(|| {
            let names = Self::ALL.map(Self::name);
            format!("no structure {name:?}; there are {}", names.join(", "))
        })
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

/// Builds one [`WideTree`] after another in the same memory.
#[derive(Debug, Default)]
pub struct TreeBuilder {
    tree: WideTree,
}

impl TreeBuilder {
    /// A builder that has not allocated memory yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// The tree of the last build.
    pub fn tree(&self) -> &WideTree {
        &self.tree
    }

    /// The tree of the last build, for changes of how it is traced.
    pub fn tree_mut(&mut self) -> &mut WideTree {
        &mut self.tree
    }

    /// Builds over `spheres`, replacing the last tree.
    ///
    /// # Panics
    /// If there are 2^32 or more spheres, or fewer radii than centres.
    pub fn build(&mut self, spheres: &Spheres, settings: &BuildSettings) -> BuildReport {
        assert!(
            u32::try_from(spheres.centers.len()).is_ok(),
            "a tree holds fewer than 2^32 particles"
        );
        let report = match settings.structure {
            Structure::Lbvh => lbvh::build(&mut self.tree, spheres, settings),
            Structure::Kdtree => kdtree::build(&mut self.tree, spheres, settings),
            Structure::Bvh => bvh::build(&mut self.tree, spheres, settings),
            Structure::Sbvh => sbvh::build(&mut self.tree, spheres, settings),
        };
        #[cfg(debug_assertions)]
        if let Err(fault) = self.tree.validate(spheres) {
            panic!("{} built a broken tree: {fault}", settings.structure);
        }
        report
    }
}
