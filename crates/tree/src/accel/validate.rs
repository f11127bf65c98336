//! Validates a tree: every child is inside its own parent, and every particle is in the tree exactly once, or its
//! parts cover it (`coverage.rs`). Debug builds validate every tree that is built.

use super::levels::MAX_LEVELS;
use super::topology::{Implicit, Linked, NodeRef, Topology};
use super::tree_fault::{ChildFault, ParticleFault, TreeFault};
use super::view::TreeView;
use super::wide::WideTree;
use super::{Aabb, SphereRadius, Spheres};
use crate::blocks::BLOCK_SIZE;

impl WideTree {
    /// Checks the tree against the spheres that it was built over.
    ///
    /// # Errors
    /// Describes the first fault.
    pub fn validate(&self, spheres: &Spheres) -> Result<(), TreeFault> {
        if self.count != spheres.centers.len() {
            return Err(TreeFault::ParticleCount {
                found: self.count,
                expected: spheres.centers.len(),
            });
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
    fn validate_levels(&self) -> Result<(), TreeFault> {
        let view = self.view();
        let topology = view.implicit();
        let levels = self.level_starts.len();
        let mut below: Vec<Aabb> = (0..self.blocks.len()).map(|b| self.block_bounds(b)).collect();
        for level in (0..levels).rev() {
            below = self.validate_level(level, topology, &below)?;
        }
        if levels > 0 && below.len() != 1 {
            return Err(TreeFault::Roots(below.len()));
        }
        Ok(())
    }

    /// Checks one level against the boxes of the next level, and returns the boxes of its nodes.
    fn validate_level(
        &self,
        level: usize,
        topology: Implicit,
        below: &[Aabb],
    ) -> Result<Vec<Aabb>, TreeFault> {
        let start = self.level_starts[level] as usize;
        let end = self.level_starts.get(level + 1).map_or(self.nodes.len(), |s| *s as usize);
        let mut own = Vec::with_capacity(end - start);
        let mut reached = vec![false; below.len()];
        // Check that each child exists, has one parent, and is inside it
        let number = crate::order::index_u32(level);
        for (index, node) in self.nodes[start..end].iter().enumerate() {
            let mut bounds = Aabb::EMPTY;
            for slot in 0..node.child_count() {
                let place = topology.first_child(number, index) + slot;
                let Some(child) = below.get(place) else {
                    return Err(TreeFault::in_level(level, index, slot, ChildFault::Missing));
                };
                if std::mem::replace(&mut reached[place], true) {
                    return Err(TreeFault::in_level(level, index, slot, ChildFault::Shared));
                }
                if !node.child_holds(slot, child) {
                    return Err(TreeFault::in_level(level, index, slot, ChildFault::Outside));
                }
                bounds = bounds.union(*child);
            }
            own.push(bounds);
        }
        // Check that each child has a parent
        if let Some(lost) = reached.iter().position(|r| !r) {
            return Err(TreeFault::Orphan { level, child: lost });
        }
        Ok(own)
    }

    /// Checks a tree with links from the root down.
    fn validate_links(&self) -> Result<(), TreeFault> {
        if self.links.len() != self.nodes.len() {
            return Err(TreeFault::LinkCount { links: self.links.len(), nodes: self.nodes.len() });
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
    ) -> Result<Aabb, TreeFault> {
        let topology = view.linked();
        let NodeRef::Node(index) = Linked::decode(code) else {
            return Err(TreeFault::NotANode(code));
        };
        if levels == 0 {
            return Err(TreeFault::TooDeep(index));
        }
        let node = &self.nodes[index];
        let mut own = Aabb::EMPTY;
        for slot in 0..crate::order::index_u32(node.child_count()) {
            // Check that the child exists and has one parent
            let child = topology.child(topology.children(code), slot);
            let node_ref = Linked::decode(child);
            reached.mark(node_ref).map_err(|fault| TreeFault::in_node(index, slot, fault))?;
            // Check the subtree of the child
            let bounds = match node_ref {
                NodeRef::Block(block) => self.block_bounds(block),
                NodeRef::Node(_) => self.validate_below(view, child, levels - 1, reached)?,
            };
            // The parts of clipped spheres are checked from above (`coverage.rs`).
            if !self.is_clipped && !node.child_holds(slot as usize, &bounds) {
                return Err(TreeFault::in_node(index, slot, ChildFault::Outside));
            }
            own = own.union(bounds);
        }
        Ok(own)
    }

    /// Checks that every particle is stored once, or several times if there may be copies, with its own centre and
    /// radius.
    fn validate_particles(&self, spheres: &Spheres) -> Result<(), TreeFault> {
        if self.indices.is_empty() {
            return if self.has_copies { Err(TreeFault::UnidentifiedCopies) } else { Ok(()) };
        }
        let mut is_stored = vec![false; self.count];
        for slot in 0..self.view().slot_count() {
            // Check that the particle exists and is not a duplicate
            let index = self.indices[slot] as usize;
            match is_stored.get_mut(index) {
                Some(is_stored) if self.has_copies || !*is_stored => *is_stored = true,
                Some(_) => return Err(TreeFault::Particle(index, ParticleFault::Repeated)),
                None => return Err(TreeFault::Particle(index, ParticleFault::Unknown)),
            }
            // Compare centre and radius with the input
            let (block, lane) = (slot / BLOCK_SIZE, slot % BLOCK_SIZE);
            if self.blocks[block].center(lane) != spheres.centers[index] {
                return Err(TreeFault::Particle(index, ParticleFault::Center));
            }
            if let (SphereRadius::Each(radii), Some(own)) = (spheres.radius, self.radii.get(block))
                && own.0[lane].to_bits() != radii[index].to_bits()
            {
                return Err(TreeFault::Particle(index, ParticleFault::Radius));
            }
        }
        // Check that no particle is missing
        if let Some(lost) = is_stored.iter().position(|stored| !stored) {
            return Err(TreeFault::Particle(lost, ParticleFault::Missing));
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
    fn mark(&mut self, node_ref: NodeRef<usize>) -> Result<(), ChildFault> {
        let mark = match node_ref {
            NodeRef::Node(node) => self.nodes.get_mut(node),
            NodeRef::Block(block) => self.blocks.get_mut(block),
        };
        match mark {
            None => Err(ChildFault::Missing),
            Some(true) => Err(ChildFault::Shared),
            Some(mark) => {
                *mark = true;
                Ok(())
            }
        }
    }

    fn all(&self) -> Result<(), TreeFault> {
        let lost = |marks: &[bool]| marks.iter().position(|mark| !mark);
        match (lost(&self.nodes), lost(&self.blocks)) {
            (None, None) => Ok(()),
            (Some(node), _) => Err(TreeFault::UnreachedNode(node)),
            (_, Some(block)) => Err(TreeFault::UnreachedBlock(block)),
        }
    }
}
