//! Memory by purpose.

use std::fmt;

use serde::Serialize;

use spherule_files::Bytes;

/// Anonymous memory by purpose, bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct MemoryNeed {
    /// The program and its threads.
    pub program: u64,
    /// Reading a frame: its file, the numbers in it, and the part that is kept.
    pub reading: u64,
    /// Particle data of the current frame next to its tree: colours, ids, velocities; positions as well during the
    /// build.
    pub particles: u64,
    /// The tree, and the scratch memory of its build.
    pub tree: u64,
    /// The surface, without the tree, and meshes.
    pub surface: u64,
    /// The planes of the images that are traced and encoded.
    pub images: u64,
    /// Encoding, without the planes.
    pub encoding: u64,
}

impl MemoryNeed {
    /// The sum of all parts.
    pub const fn total(&self) -> u64 {
        self.program
            + self.reading
            + self.particles
            + self.tree
            + self.surface
            + self.images
            + self.encoding
    }

    /// The parts by name.
    pub fn parts(&self) -> [(&'static str, u64); 7] {
        [
            ("images", self.images),
            ("encoding", self.encoding),
            ("tree", self.tree),
            ("surface", self.surface),
            ("particles", self.particles),
            ("reading the next frame", self.reading),
            ("program", self.program),
        ]
    }

    pub(in crate::pipeline) fn larger(self, other: Self) -> Self {
        if other.total() > self.total() { other } else { self }
    }
}

impl fmt::Display for MemoryNeed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = self.parts();
        parts.sort_by_key(|(_, bytes)| std::cmp::Reverse(*bytes));
        for (index, (name, bytes)) in parts.iter().filter(|(_, b)| *b > 0).enumerate() {
            let comma = if index > 0 { ", " } else { "" };
            write!(f, "{comma}{name} {}", Bytes(*bytes))?;
        }
        Ok(())
    }
}
