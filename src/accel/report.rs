//! What a build cost and what came out, the same for every structure.

use std::time::{Duration, Instant};

use super::Structure;

/// One named piece of the build time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Phase {
    /// What was done.
    pub name: &'static str,
    /// Wall-clock time.
    pub time: Duration,
}

/// What a build cost and what came out; the same for every structure.
#[derive(Debug, Clone)]
pub struct BuildReport {
    /// Who built it.
    pub structure: Structure,
    /// The order that the particles were brought into.
    pub order: &'static str,
    /// Wall-clock time of the whole build.
    pub total: Duration,
    /// The same by phase.
    pub phases: Vec<Phase>,
    /// Particles.
    pub particles: u64,
    /// Places of particles in leaves: one for each, and more where spatial splits have cut some.
    pub references: u64,
    /// 8-wide nodes.
    pub nodes: u64,
    /// Leaves (blocks).
    pub leaves: u64,
    /// Node levels from the root to the leaves' parents.
    pub depth: u32,
    /// Expected nodes and blocks tested by a ray that hits the root box (surface area heuristic,
    /// Goldsmith & Salmon 1987, with the radius added to every box and one unit for either test).
    pub sah_cost: f64,
    /// Bytes of the positions and radii in blocks.
    pub position_bytes: u64,
    /// Bytes of the nodes and of the way back to the frame's order.
    pub structure_bytes: u64,
    /// The part of these two that lies in a mapped file, whose pages the system may drop.
    pub file_bytes: u64,
    /// Most bytes held at any time while building, the input not counted unless it is traced where it
    /// lies.
    pub peak_bytes: u64,
    /// The instruction set that rays are traced with.
    pub simd: &'static str,
}

/// Wall-clock laps.
pub(crate) struct PhaseClock {
    last: Instant,
    phases: Vec<Phase>,
}

impl PhaseClock {
    pub(crate) fn new() -> Self {
        Self {
            last: Instant::now(),
            phases: Vec::new(),
        }
    }

    pub(crate) fn lap(&mut self, name: &'static str) {
        let now = Instant::now();
        self.phases.push(Phase {
            name,
            time: now - self.last,
        });
        self.last = now;
    }

    pub(crate) fn finish(self) -> Vec<Phase> {
        self.phases
    }
}
