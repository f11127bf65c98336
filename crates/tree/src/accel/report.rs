//! Cost and result of a build, in the same form for every structure.

use std::time::{Duration, Instant};

use super::Structure;

/// One named piece of the build time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Phase {
    /// Name of the phase.
    pub name: &'static str,
    /// Wall-clock time.
    pub time: Duration,
}

/// Cost and result of a build, in the same form for every structure.
#[derive(Debug, Clone)]
pub struct BuildReport {
    /// The structure that was built.
    pub structure: Structure,
    /// The order of the particles.
    pub order: &'static str,
    /// Wall-clock time of the whole build.
    pub total: Duration,
    /// Wall-clock time by phase.
    pub phases: Vec<Phase>,
    /// Particle count.
    pub particles: u64,
    /// References in leaves: one per particle, and more if spatial splits have cut spheres.
    pub references: u64,
    /// Count of 8-wide nodes.
    pub nodes: u64,
    /// Leaf count (blocks).
    pub leaves: u64,
    /// Node levels from the root to the parents of the leaves.
    pub depth: u32,
    /// Expected number of node and block tests for a ray that hits the root box (surface area heuristic, Goldsmith &
    /// Salmon 1987; boxes padded by the radius, cost 1 for either test).
    pub sah_cost: f64,
    /// Bytes of the positions and radii in blocks.
    pub position_bytes: u64,
    /// Bytes of the nodes and of the particle indices.
    pub structure_bytes: u64,
    /// Bytes of these two that are in a mapped file; the system may drop their pages.
    pub file_bytes: u64,
    /// Peak memory of the build in bytes. Includes the input only if the input itself is traced, as stored leaves are.
    pub peak_bytes: u64,
    /// The instruction set that rays are traced with.
    pub simd: &'static str,
}

/// Measures the wall-clock time of consecutive phases.
pub(crate) struct PhaseClock {
    last: Instant,
    phases: Vec<Phase>,
}

impl PhaseClock {
    pub(crate) fn new() -> Self {
        Self { last: Instant::now(), phases: Vec::new() }
    }

    pub(crate) fn lap(&mut self, name: &'static str) {
        let now = Instant::now();
        self.phases.push(Phase { name, time: now - self.last });
        self.last = now;
    }

    pub(crate) fn finish(self) -> Vec<Phase> {
        self.phases
    }
}
