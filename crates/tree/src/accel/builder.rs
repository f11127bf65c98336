//! One interface for all builders: the choice of structure, its settings, and the memory that is reused from frame to
//! frame.

use super::wide::WideTree;
use super::{BuildReport, BuildSettings, Spheres, Structure, bvh, kdtree, lbvh, sbvh};

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
