//! Verifies native frames: checksums, and whether the numbers can belong to a frame.
//!
//! Opening checks the header and the index. Reading a whole frame compares checksums, which detects damage on
//! the disk or in transfer. A file from a faulty writer, or a forged file, has correct checksums; the full
//! check therefore also examines nodes, positions, radii and padding. It reports the first fault, the same for
//! any number of threads.

use rayon::prelude::*;
use xxhash_rust::xxh3::xxh3_64;

use super::layout::{FrameIndex, HEADER_LEN, RadiusIndex, Section};
use super::section_of;
use super::view::NativeFrame;
use crate::ParseError;
use crate::blocks::{
    Aabb, BLOCK_SIZE, Block, BlockRadii, CompactBlock, FARTHEST_PLANE, Node, StoredBlocks,
    StoredLeaves, WIDTH,
};
use spherule_files::one_line;

/// Nodes that one task checks.
const TASK: usize = 64;

impl NativeFrame<'_> {
    /// Compares every section with its checksum; opening does not.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] at the first section that differs.
    pub fn verify(&self) -> Result<(), ParseError> {
        let sections = self.index().sections();
        let fault = sections.par_iter().find_map_first(|(what, section)| {
            let verified = verify_section(self.bytes(), what, section);
            verified.err()
        });
        fault.map_or(Ok(()), Err)
    }

    /// Compares the nodes with their checksum. No other section is read before rays are traced.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if they differ.
    pub fn verify_nodes(&self) -> Result<(), ParseError> {
        verify_section(self.bytes(), "the nodes", &self.index().nodes)
    }

    /// Compares the sections that rendering uses with their checksums: those that tracing reads, and the
    /// attributes of these names.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] at the first section, in file order, that differs.
    pub fn verify_used(&self, attributes: &[&str]) -> Result<(), ParseError> {
        let sections = self.used(attributes);
        let all = sections.par_iter();
        let found =
            all.find_map_first(|(what, section)| verify_section(self.bytes(), what, section).err());
        found.map_or(Ok(()), Err)
    }

    /// Bytes that [`Self::verify_used`] reads.
    pub fn used_bytes(&self, attributes: &[&str]) -> u64 {
        self.used(attributes).iter().map(|(_, s)| s.len).sum()
    }

    fn used(&self, attributes: &[&str]) -> Vec<(String, &Section)> {
        let mut sections = self.index().tree_sections();
        let all = self.index().attributes.iter();
        let used = all.filter(|a| attributes.contains(&a.name.as_str()));
        sections.extend(used.map(|a| (format!("attribute {}", a.name), &a.section)));
        sections
    }

    /// Checks everything: checksums, zeros between sections, the children and planes of nodes, and that
    /// positions and radii are numbers within the boxes of their nodes and the bounds of the frame.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] with the first fault, [`ParseError::Unsupported`] as [`Self::leaves`].
    pub fn verify_all(&self) -> Result<(), ParseError> {
        self.verify()?;
        self.verify_padding()?;
        let contents = Contents { index: self.index(), leaves: self.leaves()? };
        contents.verify()
    }

    /// Checks that sections do not overlap and that all bytes between them are zero.
    fn verify_padding(&self) -> Result<(), ParseError> {
        let index = self.index();
        // Check the gaps between sections in file order
        let mut sections = index.sections();
        sections.retain(|(_, section)| section.len > 0);
        sections.sort_by_key(|(_, section)| section.offset);
        let mut end = HEADER_LEN as u64;
        for (what, section) in &sections {
            if section.offset < end {
                let what = format!("{what} overlap the section before");
                return Err(fault(section.offset, &what));
            }
            self.verify_zeros(end, section.offset)?;
            end = section.offset + section.len;
        }
        self.verify_zeros(end, end.next_multiple_of(super::layout::ALIGN))
    }

    /// Checks that the bytes from `start` to `end` are zero.
    fn verify_zeros(&self, start: u64, end: u64) -> Result<(), ParseError> {
        let gap = Section { offset: start, len: end - start, xxh3: 0 };
        let bytes = section_of(self.bytes(), &gap)?;
        match bytes.par_iter().position_first(|byte| *byte != 0) {
            Some(at) => {
                Err(fault(start + at as u64, "between the sections are numbers where zeros belong"))
            }
            None => Ok(()),
        }
    }
}

/// Compares a section with its checksum.
fn verify_section(bytes: &[u8], what: &str, section: &Section) -> Result<(), ParseError> {
    if xxh3_64(section_of(bytes, section)?) == section.xxh3 {
        return Ok(());
    }
    let what = format!("{what} are damaged: the checksum differs");
    Err(fault(section.offset, &what))
}

/// The error for a fault at byte `at`, with the remedy that helps against all of them.
fn fault(at: u64, what: &str) -> ParseError {
    ParseError::Malformed {
        at,
        // Names of attributes may hold anything
        what: one_line(format!("{what}; convert again")),
    }
}

/// The contents of the sections of a frame.
struct Contents<'a> {
    index: &'a FrameIndex,
    leaves: StoredLeaves<'a>,
}

impl Contents<'_> {
    fn verify(&self) -> Result<(), ParseError> {
        self.verify_errors()?;
        let nodes = (0..self.leaves.nodes.len()).into_par_iter();
        let fault = nodes.with_min_len(TASK).find_map_first(|node| {
            let blocks = node * WIDTH..self.leaves.block_count().min((node + 1) * WIDTH);
            let mut blocks_of_node = blocks.clone();
            self.node_fault(node, blocks.len())
                .or_else(|| blocks_of_node.find_map(|block| self.block_fault(block)))
        });
        match fault {
            Some(fault) => Err(fault),
            None => self.verify_references(),
        }
    }

    /// Checks that the stored errors are numbers.
    fn verify_errors(&self) -> Result<(), ParseError> {
        let is_error = |error: f64| error.is_finite() && error >= 0.0;
        let radii = match &self.index.radius {
            RadiusIndex::PerParticle(radii) => f64::from(radii.max_error),
            RadiusIndex::None | RadiusIndex::Common(_) => 0.0,
        };
        let attributes = self.index.attributes.iter().map(|a| a.max_error);
        let mut errors = attributes.chain([self.index.max_error, radii]);
        if errors.all(is_error) {
            return Ok(());
        }
        // The offset within the index is unknown; report the end of the sections, where the index begins.
        let ends = self.index.sections().into_iter();
        let end = ends.map(|(_, s)| s.offset + s.len).max().unwrap_or(0);
        Err(fault(end, "the index: a largest error is not a number"))
    }

    /// Checks that the number of references equals the number of wide blocks.
    fn verify_references(&self) -> Result<(), ParseError> {
        let wide = self.index.wide.len / size_of::<Block>() as u64;
        let blocks = (0..self.leaves.block_count()).into_par_iter();
        let found = blocks.filter(|b| self.wide_index(*b).is_some()).count() as u64;
        if found == wide {
            return Ok(());
        }
        let what = format!("the wide blocks: there are {wide}, and {found} blocks refer to one");
        Err(fault(self.index.wide.offset, &what))
    }

    /// The fault of node `node`, if it has one; `blocks` is its number of blocks.
    fn node_fault(&self, node: usize, blocks: usize) -> Option<ParseError> {
        let at = self.index.nodes.offset + (node * size_of::<Node>()) as u64;
        let stored = &self.leaves.nodes[node];
        let mask = stored.child_mask;
        if u32::from(mask) != (1 << blocks) - 1 {
            let what =
                format!("the nodes: node {node} has children {mask:08b} for {blocks} blocks");
            return Some(fault(at, &what));
        }
        let is_box = |(slot, axis): (usize, usize)| {
            let [lower, upper] = stored.interval(slot, axis);
            // Written this way so that NaN fails.
            -FARTHEST_PLANE <= lower && lower <= upper && upper <= FARTHEST_PLANE
        };
        let mut boxes = (0..blocks).flat_map(|slot| (0..3).map(move |axis| (slot, axis)));
        let (slot, _) = boxes.find(|place| !is_box(*place))?;
        let what = format!("the nodes: child {slot} of node {node} has no box");
        Some(fault(at, &what))
    }

    /// The fault of block `block`, if it has one; its node must be valid.
    fn block_fault(&self, block: usize) -> Option<ParseError> {
        let wide = self.wide_index(block);
        let here = |what: &str| {
            let (section, place, len) = match wide {
                Some(wide) => (&self.index.wide, wide, size_of::<Block>()),
                None => (&self.index.positions, block, self.index.encoding().block_len()),
            };
            let what = format!("the positions: block {block} {what}");
            Some(fault(section.offset + (place * len) as u64, &what))
        };
        // Check the reference to a wide block
        let count = self.index.wide.len / size_of::<Block>() as u64;
        if let Some(wide) = wide.filter(|wide| *wide as u64 >= count) {
            let at = self.index.encoding().block_len() * block;
            let what =
                format!("the positions: block {block} refers to wide block {wide} of {count}");
            return Some(fault(self.index.positions.offset + at as u64, &what));
        }
        // Check that the positions are finite
        let stored = self.leaves.block(block);
        if !(0..BLOCK_SIZE).all(|lane| stored.center(lane).is_finite()) {
            return here("has a position that is not finite");
        }
        // Check that unused lanes repeat the last particle
        let last = self.last_lane(block);
        if (last..BLOCK_SIZE).any(|lane| stored.center(lane) != stored.center(last)) {
            return here("has particles beyond the last one");
        }
        // Check the radii
        let radii = self.leaves.radii.load(block);
        if let Some(fault) = radii.as_ref().and_then(|r| self.radii_fault(block, r)) {
            return Some(fault);
        }
        // Check the box in the node
        let node = &self.leaves.nodes[block / WIDTH];
        let bounds = stored.bounds();
        let spheres = radii.map_or(bounds, |radii| stored.sphere_bounds(&radii));
        if !node.child_holds(block % WIDTH, &spheres) {
            return here("has a particle outside its box");
        }
        // Check the bounds of the frame
        let all = Aabb { min: self.index.min.into(), max: self.index.max.into() };
        if !all.contains(&bounds) {
            return here("has a particle outside the bounds of the frame");
        }
        None
    }

    fn radii_fault(&self, block: usize, found: &BlockRadii) -> Option<ParseError> {
        let RadiusIndex::PerParticle(radii) = &self.index.radius else {
            return None;
        };
        let lanes = &found.0;
        let last = lanes[self.last_lane(block)];
        let what = if !lanes.iter().all(|r| r.is_finite() && *r >= 0.0) {
            "has a radius that is negative or no number"
        } else if lanes[self.last_lane(block)..].iter().any(|r| *r != last) {
            "has radii beyond the last one"
        } else {
            return None;
        };
        let len = radii.section.len / self.leaves.block_count().max(1) as u64;
        let what = format!("the radii: block {block} {what}");
        Some(fault(radii.section.offset + block as u64 * len, &what))
    }

    /// The last lane of `block` with a particle of its own.
    fn last_lane(&self, block: usize) -> usize {
        let left = self.index.count - block as u64 * BLOCK_SIZE as u64;
        let used = usize::try_from(left).map_or(BLOCK_SIZE, |left| left.min(BLOCK_SIZE));
        used.saturating_sub(1)
    }

    /// The index of the wide block that `block` refers to, if it is a reference.
    fn wide_index(&self, block: usize) -> Option<usize> {
        let index = match &self.leaves.blocks {
            StoredBlocks::F32(_) => None,
            StoredBlocks::Q16(compact) => compact.blocks[block].wide_index(),
            StoredBlocks::Q10(compact) => compact.blocks[block].wide_index(),
        };
        index.map(|index| index as usize)
    }
}

#[cfg(test)]
#[path = "verify_tests.rs"]
mod tests;
