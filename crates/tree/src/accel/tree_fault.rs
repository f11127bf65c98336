//! Faults of a tree that its validation finds.

use glam::DVec3;

use super::levels::MAX_LEVELS;

/// The first fault of a tree.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TreeFault {
    /// The tree is of a different number of particles.
    #[error("{found} particles, expected {expected}")]
    ParticleCount {
        /// In the tree.
        found: usize,
        /// In the input.
        expected: usize,
    },
    /// The top level has several nodes, or none.
    #[error("{0} roots")]
    Roots(usize),
    /// A child in a tree of complete levels.
    #[error("level {level} node {node}: child {slot} {fault}")]
    LevelChild {
        /// Level, counted from the root.
        level: usize,
        /// Index of the node in its level.
        node: usize,
        /// Index of the child in the node.
        slot: usize,
        /// The fault.
        fault: ChildFault,
    },
    /// A child of the next level that no node refers to.
    #[error("level {level}: child {child} has no parent")]
    Orphan {
        /// Level of the missing parent.
        level: usize,
        /// Index in the next level.
        child: usize,
    },
    /// Nodes without links, or links without nodes.
    #[error("{links} links for {nodes} nodes")]
    LinkCount {
        /// Number of links.
        links: usize,
        /// Number of nodes.
        nodes: usize,
    },
    /// A child in a tree with links.
    #[error("node {node}: child {slot} {fault}")]
    LinkedChild {
        /// Index of the node.
        node: usize,
        /// Index of the child in the node.
        slot: u32,
        /// The fault.
        fault: ChildFault,
    },
    /// A code that does not refer to a node where one is required.
    #[error("code {0} does not name a node")]
    NotANode(u32),
    /// Too many levels above this node.
    #[error("node {0}: deeper than {MAX_LEVELS} levels")]
    TooDeep(usize),
    /// A node that no path from the root reaches.
    #[error("node {0} has no parent")]
    UnreachedNode(usize),
    /// A block that no leaf refers to.
    #[error("block {0} is in no leaf")]
    UnreachedBlock(usize),
    /// Copies of particles without indices that identify them.
    #[error("copies of particles without indices")]
    UnidentifiedCopies,
    /// A particle, by its index in the input.
    #[error("particle {0} {1}")]
    Particle(usize, ParticleFault),
    /// A point of a clipped sphere that is in none of its parts.
    #[error("particle {particle}: no part has its surface towards {direction}")]
    Uncovered {
        /// Index in the input.
        particle: usize,
        /// Direction of the point from the centre.
        direction: DVec3,
    },
}

/// A fault of a reference to a child.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ChildFault {
    /// It does not exist.
    #[error("does not exist")]
    Missing,
    /// Another node refers to it.
    #[error("has two parents")]
    Shared,
    /// It extends beyond its box in the parent.
    #[error("extends beyond its box")]
    Outside,
}

/// A fault of a particle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ParticleFault {
    /// It is stored several times.
    #[error("is stored twice")]
    Repeated,
    /// The input has no such particle.
    #[error("is not in the input")]
    Unknown,
    /// Its centre differs from the input.
    #[error("has a wrong centre")]
    Center,
    /// Its radius differs from the input.
    #[error("has a wrong radius")]
    Radius,
    /// It is not in the tree.
    #[error("is missing")]
    Missing,
}

impl TreeFault {
    pub(super) const fn in_level(
        level: usize,
        node: usize,
        slot: usize,
        fault: ChildFault,
    ) -> Self {
        Self::LevelChild { level, node, slot, fault }
    }

    pub(super) const fn in_node(node: usize, slot: u32, fault: ChildFault) -> Self {
        Self::LinkedChild { node, slot, fault }
    }
}
