//! Validates a tree: every child is inside its own parent, and every particle is in the tree exactly once, or its
//! parts cover it (`coverage.rs`). Debug builds validate every tree that is built.

use super::levels::MAX_LEVELS;
use super::topology::{Implicit, Linked, NodeRef, Topology};
use super::view::TreeView;
use super::wide::WideTree;
use super::{Aabb, SphereRadius, Spheres};
use spherule_formats::blocks::BLOCK_SIZE;

impl WideTree {
    /// Checks the tree against the spheres that it was built over.
    ///
    /// # Errors
    /// Describes the first fault.
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

    /// The box of a block that its own parent must contain.
    fn block_bounds(&self, block: usize) -> Aabb {
        match self.radii.get(block) {
            Some(radii) => self.blocks[block].sphere_bounds(radii),
            None => self.blocks[block].bounds(),
        }
    }

    /// Checks complete levels from the blocks up.
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

    /// Checks one level against the boxes of the next level, and returns the boxes of its nodes.
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
        // Check that each child exists, has one parent, and is inside it
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
        // Check that each child has a parent
        if let Some(lost) = reached.iter().position(|r| !r) {
            return Err(format!("level {level}: child {lost} has no parent"));
        }
        Ok(own)
    }

    /// Checks a tree with links from the root down.
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

    /// Checks the subtree of the node with `code`, which may have up to `levels` levels, and returns the box of its
    /// content.
    fn validate_below(
        &self,
        view: &TreeView,
        code: u32,
        levels: usize,
        reached: &mut Reached,
    ) -> Result<Aabb, String> {
        let topology = view.linked();
        let NodeRef::Node(index) = Linked::decode(code) else {
            return Err(format!("code {code} does not name a node"));
        };
        if levels == 0 {
            return Err(format!("node {index}: deeper than {MAX_LEVELS} levels"));
        }
        let node = &self.nodes[index];
        let mut own = Aabb::EMPTY;
        for slot in 0..spherule_formats::order::index_u32(node.child_count()) {
            // Check that the child exists and has one parent
            let child = topology.child(topology.children(code), slot);
            let node_ref = Linked::decode(child);
            reached
                .mark(node_ref)
                .map_err(|fault| format!("node {index}, child {slot}: {fault}"))?;
            // Check the subtree of the child
            let bounds = match node_ref {
                NodeRef::Block(block) => self.block_bounds(block),
                NodeRef::Node(_) => self.validate_below(view, child, levels - 1, reached)?,
            };
            // The parts of clipped spheres are checked from above (`coverage.rs`).
            if !self.is_clipped && !node.child_holds(slot as usize, &bounds) {
                return Err(format!("node {index}: child {slot} sticks out"));
            }
            own = own.union(bounds);
        }
        Ok(own)
    }

    /// Checks that every particle is stored once, or several times if there may be copies, with its own centre and
    /// radius.
    fn validate_particles(&self, spheres: &Spheres) -> Result<(), String> {
        if self.indices.is_empty() {
            return if self.has_copies {
                Err("identical copies".to_owned())
            } else {
                Ok(())
            };
        }
        let mut is_stored = vec![false; self.count];
        for slot in 0..self.view().slot_count() {
            // Check that the particle exists and is not a duplicate
            let index = self.indices[slot] as usize;
            match is_stored.get_mut(index) {
                Some(is_stored) if self.has_copies || !*is_stored => *is_stored = true,
                Some(_) => return Err(format!("particle {index} twice")),
                None => return Err(format!("slot {slot}: particle {index} does not exist")),
            }
            // Compare centre and radius with the input
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
        // Check that no particle is missing
        if let Some(lost) = is_stored.iter().position(|seen| !seen) {
            return Err(format!("particle {lost} is nowhere"));
        }
        Ok(())
    }
}

/// Nodes and blocks that a traversal has reached.
struct Reached {
    nodes: Vec<bool>,
    blocks: Vec<bool>,
}

impl Reached {
    fn mark(&mut self, node_ref: NodeRef<usize>) -> Result<(), String> {
        let mark = match node_ref {
            NodeRef::Node(node) => self.nodes.get_mut(node),
            NodeRef::Block(block) => self.blocks.get_mut(block),
        };
        match mark {
            None => Err(format!("{node_ref:?} does not exist")),
            Some(true) => Err(format!("{node_ref:?} has two parents")),
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
            (Some(node), _) => Err(format!("node {node} has no parent")),
            (_, Some(block)) => Err(format!("block {block} is in no leaf")),
        }
    }
}
