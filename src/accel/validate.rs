//! Proof that a tree is sound: every child inside its own parent, every particle in the tree
//! exactly once. Debug builds run it after each build.

use super::block::BLOCK_SIZE;
use super::wide::WideTree;
use super::{Aabb, SphereRadius, Spheres};

impl WideTree {
    /// Checks the tree against the spheres that it was built over.
    ///
    /// # Errors
    /// The first fault found, in words.
    pub fn validate(&self, spheres: &Spheres) -> Result<(), String> {
        if self.count != spheres.centers.len() {
            return Err(format!(
                "{} particles, should be {}",
                self.count,
                spheres.centers.len()
            ));
        }
        self.validate_particles(spheres)?;
        let levels = self.level_starts.len();
        let mut below: Vec<Aabb> = (0..self.blocks.len())
            .map(|b| match self.radii.get(b) {
                Some(radii) => self.blocks[b].sphere_bounds(radii),
                None => self.blocks[b].bounds(),
            })
            .collect();
        for level in (0..levels).rev() {
            below = self.validate_level(level, &below)?;
        }
        if levels > 0 && below.len() != 1 {
            return Err(format!("{} roots", below.len()));
        }
        Ok(())
    }

    /// Checks one level over the boxes of the next, and returns its own boxes.
    fn validate_level(&self, level: usize, below: &[Aabb]) -> Result<Vec<Aabb>, String> {
        let start = self.level_starts[level] as usize;
        let end = self
            .level_starts
            .get(level + 1)
            .map_or(self.nodes.len(), |s| *s as usize);
        let mut own = Vec::with_capacity(end - start);
        let mut reached = vec![false; below.len()];
        let number = super::partition::index_u32(level);
        for (index, node) in self.nodes[start..end].iter().enumerate() {
            let mut bounds = Aabb::EMPTY;
            for slot in 0..node.child_count() {
                let place = self.first_child(number, index) + slot;
                let Some(child) = below.get(place) else {
                    return Err(format!("level {level} node {index}: no child {slot}"));
                };
                if std::mem::replace(&mut reached[place], true) {
                    return Err(format!(
                        "level {level} node {index}: child {slot} has two parents"
                    ));
                }
                if !node.child_holds(slot, child) {
                    return Err(format!(
                        "level {level} node {index}: child {slot} sticks out"
                    ));
                }
                bounds = bounds.union(*child);
            }
            own.push(bounds);
        }
        if let Some(lost) = reached.iter().position(|r| !r) {
            return Err(format!("level {level}: nobody has child {lost}"));
        }
        Ok(own)
    }

    /// Every particle once, with its own centre and radius.
    fn validate_particles(&self, spheres: &Spheres) -> Result<(), String> {
        if self.indices.is_empty() {
            return Ok(());
        }
        let mut seen = vec![false; self.count];
        for slot in 0..self.count {
            let index = self.indices[slot] as usize;
            match seen.get_mut(index) {
                Some(seen) if !*seen => *seen = true,
                Some(_) => return Err(format!("particle {index} twice")),
                None => return Err(format!("slot {slot}: particle {index} does not exist")),
            }
            let (block, lane) = (slot / BLOCK_SIZE, slot % BLOCK_SIZE);
            if self.blocks[block].center(lane) != spheres.centers[index] {
                return Err(format!("slot {slot}: not the centre of particle {index}"));
            }
            if let (SphereRadius::Each(radii), Some(own)) = (spheres.radius, self.radii.get(block))
                && own.0[lane].to_bits() != radii[index].to_bits()
            {
                return Err(format!("slot {slot}: not the radius of particle {index}"));
            }
        }
        Ok(())
    }
}
