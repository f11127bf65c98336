//! Proof that a tree is sound: every child inside its own parent, every particle in the tree
//! exactly once, or its parts covering it (`coverage.rs`). Debug builds run it after each build.

use super::levels::MAX_LEVELS;
use super::topology::{Implicit, Linked, Place, Topology};
use super::view::TreeView;
use super::wide::WideTree;
use super::{Aabb, SphereRadius, Spheres};
use spherule_formats::blocks::BLOCK_SIZE;

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
        if self.links.is_empty() {
            self.validate_levels()
        } else {
            self.validate_links()?;
            if self.is_clipped {
                self.validate_coverage(spheres)?;
            }
            Ok(())
        }
    }

    /// The box that a block's own parent must hold.
    fn block_bounds(&self, block: usize) -> Aabb {
        match self.radii.get(block) {
            Some(radii) => self.blocks[block].sphere_bounds(radii),
            None => self.blocks[block].bounds(),
        }
    }

    /// Checks whole levels from the blocks up.
    fn validate_levels(&self) -> Result<(), String> {
        let view = self.view();
        let topology = view.implicit();
        let levels = self.level_starts.len();
        let mut below: Vec<Aabb> = (0..self.blocks.len())
            .map(|b| self.block_bounds(b))
            .collect();
        for level in (0..levels).rev() {
            below = self.validate_level(level, topology, &below)?;
        }
        if levels > 0 && below.len() != 1 {
            return Err(format!("{} roots", below.len()));
        }
        Ok(())
    }

    /// Checks one level over the boxes of the next, and returns its own boxes.
    fn validate_level(
        &self,
        level: usize,
        topology: Implicit,
        below: &[Aabb],
    ) -> Result<Vec<Aabb>, String> {
        let start = self.level_starts[level] as usize;
        let end = self
            .level_starts
            .get(level + 1)
            .map_or(self.nodes.len(), |s| *s as usize);
        let mut own = Vec::with_capacity(end - start);
        let mut reached = vec![false; below.len()];
        let number = spherule_formats::order::index_u32(level);
        for (index, node) in self.nodes[start..end].iter().enumerate() {
            let mut bounds = Aabb::EMPTY;
            for slot in 0..node.child_count() {
                let place = topology.first_child(number, index) + slot;
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

    /// Checks a tree of links from the root down.
    fn validate_links(&self) -> Result<(), String> {
        if self.links.len() != self.nodes.len() {
            return Err(format!(
                "{} links for {} nodes",
                self.links.len(),
                self.nodes.len()
            ));
        }
        let mut reached = Reached {
            nodes: vec![false; self.nodes.len()],
            blocks: vec![false; self.blocks.len()],
        };
        if self.nodes.is_empty() {
            return reached.all();
        }
        reached.nodes[0] = true;
        self.validate_below(&self.view(), Linked::ROOT, MAX_LEVELS, &mut reached)?;
        reached.all()
    }

    /// Checks the subtree of the node with `code`, which has `levels` left to grow, and returns the
    /// box of what is in it.
    fn validate_below(
        &self,
        view: &TreeView,
        code: u32,
        levels: usize,
        reached: &mut Reached,
    ) -> Result<Aabb, String> {
        let topology = view.linked();
        let Place::Node(index) = Linked::number(code) else {
            return Err(format!("code {code} is no node"));
        };
        if levels == 0 {
            return Err(format!("node {index}: deeper than {MAX_LEVELS} levels"));
        }
        let node = &self.nodes[index];
        let mut own = Aabb::EMPTY;
        for slot in 0..spherule_formats::order::index_u32(node.child_count()) {
            let child = topology.child(topology.children(code), slot);
            let place = Linked::number(child);
            reached
                .mark(place)
                .map_err(|fault| format!("node {index}, child {slot}: {fault}"))?;
            let bounds = match place {
                Place::Block(block) => self.block_bounds(block),
                Place::Node(_) => self.validate_below(view, child, levels - 1, reached)?,
            };
            // Of clipped spheres, whether parts cover them is seen from above (`coverage.rs`).
            if !self.is_clipped && !node.child_holds(slot as usize, &bounds) {
                return Err(format!("node {index}: child {slot} sticks out"));
            }
            own = own.union(bounds);
        }
        Ok(own)
    }

    /// Every particle once, or several times where there may be copies, with its own centre and
    /// radius.
    fn validate_particles(&self, spheres: &Spheres) -> Result<(), String> {
        if self.indices.is_empty() {
            return if self.has_copies {
                Err("copies that cannot be told apart".to_owned())
            } else {
                Ok(())
            };
        }
        let mut seen = vec![false; self.count];
        for slot in 0..self.view().slot_count() {
            let index = self.indices[slot] as usize;
            match seen.get_mut(index) {
                Some(seen) if self.has_copies || !*seen => *seen = true,
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
        if let Some(lost) = seen.iter().position(|seen| !seen) {
            return Err(format!("particle {lost} is nowhere"));
        }
        Ok(())
    }
}

/// What a walk has come to.
struct Reached {
    nodes: Vec<bool>,
    blocks: Vec<bool>,
}

impl Reached {
    fn mark(&mut self, place: Place<usize>) -> Result<(), String> {
        let mark = match place {
            Place::Node(node) => self.nodes.get_mut(node),
            Place::Block(block) => self.blocks.get_mut(block),
        };
        match mark {
            None => Err(format!("{place:?} does not exist")),
            Some(true) => Err(format!("{place:?} has two parents")),
            Some(mark) => {
                *mark = true;
                Ok(())
            }
        }
    }

    fn all(&self) -> Result<(), String> {
        let lost = |marks: &[bool]| marks.iter().position(|mark| !mark);
        match (lost(&self.nodes), lost(&self.blocks)) {
            (None, None) => Ok(()),
            (Some(node), _) => Err(format!("nobody has node {node}")),
            (_, Some(block)) => Err(format!("nobody has block {block}")),
        }
    }
}
