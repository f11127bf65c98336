//! VTKHDF files: points and point data of `PolyData` and `UnstructuredGrid`, also with time steps, and of blocks of these
//! (`PartitionedDataSetCollection`, `MultiBlockDataSet`), which are parts.

use std::collections::HashMap;

use super::dialect::{Dialect, StepInfo, integer, listed, no_step, part_names};
use super::file::ObjectKey;
use super::node::Node;
use super::piece::Piece;
use super::properties::{PropertyFinder, numbers, values};
use super::slice::Slice;
use super::stored::Stored;
use super::table::{Part, ParticleTable};
use spherule_files::one_line;
use spherule_frame::{MemoryBudget, ParseError};

/// Kinds of data that have points.
const KINDS: [&str; 2] = ["PolyData", "UnstructuredGrid"];
/// Steps of a file.
const STEPS: &str = "Steps";

/// Kinds of data that are made of blocks, which are of other kinds.
const MULTI_BLOCK: &str = "MultiBlockDataSet";
const COMPOSITES: [&str; 2] = ["PartitionedDataSetCollection", MULTI_BLOCK];
/// The group that says how blocks are named and nested, with links to them.
const ASSEMBLY: &str = "Assembly";
/// Most groups in one another in it.
const MAX_DEPTH: usize = 16;

/// A file with points.
pub(super) struct VtkHdf {
    node: Node,
    kind: String,
    /// One without a name if the file is not made of blocks.
    blocks: Vec<Block>,
    /// Blocks of other kinds, with these.
    unread: Vec<String>,
    step_count: usize,
}

/// The points of a file, or of a part of it.
struct Block {
    name: String,
    node: Node,
    /// The group with the offsets of each time step; `None` for one step.
    steps: Option<Node>,
    step_count: usize,
}

impl VtkHdf {
    /// The points of the file; `None` if it has another layout.
    ///
    /// # Errors
    /// [`ParseError::Unsupported`] for other kinds of data, [`ParseError`] if the file is damaged.
    pub(super) fn open(root: &Node) -> Result<Option<Self>, ParseError> {
        let Some(node) = root.group("VTKHDF")? else {
            return Ok(None);
        };
        let kind = node.text("Type").unwrap_or_default();
        if !COMPOSITES.contains(&kind.as_str()) {
            if !has_points(&kind) {
                return Err(ParseError::unsupported(unread_kind(&kind)));
            }
            let block = Block::open(String::new(), node.clone())?;
            let step_count = block.step_count;
            return Ok(Some(Self {
                node,
                kind,
                blocks: vec![block],
                unread: Vec::new(),
                step_count,
            }));
        }
        // Find the blocks, in the order of their indices or of the numbers in their names
        let (mut blocks, mut unread) = (Vec::new(), Vec::new());
        let names = if kind == MULTI_BLOCK { assembled_names(&node)? } else { HashMap::new() };
        let mut groups = node.distinct_groups(|name| ![ASSEMBLY, STEPS].contains(&name))?;
        groups.sort_by_cached_key(|(name, block)| {
            block.number("Index").and_then(integer).or_else(|| last_number(name))
        });
        for (name, block) in groups {
            let name = names.get(&block.key()).cloned().unwrap_or(name);
            match block.text("Type").unwrap_or_default() {
                kind if has_points(&kind) => blocks.push(Block::open(name, block)?),
                kind => unread.push(format!("{name} ({kind})")),
            }
        }
        if blocks.is_empty() {
            let which =
                if unread.is_empty() { "without blocks".to_owned() } else { listed(&unread) };
            return Err(ParseError::unsupported(unread_kind(&format!("{kind}: {which}"))));
        }
        let step_count = common_step_count(&blocks)?;
        Ok(Some(Self { node, kind, blocks, unread, step_count }))
    }

    /// Whether the blocks are parts.
    fn is_divided(&self) -> bool {
        COMPOSITES.contains(&self.kind.as_str())
    }

    /// Time of each step, by the file or by the first block that has them.
    fn times(&self, budget: MemoryBudget) -> Result<Vec<f64>, ParseError> {
        let own = self.node.group(STEPS)?;
        let blocks = self.blocks.iter().filter_map(|block| block.steps.clone());
        for steps in own.into_iter().chain(blocks) {
            if let Some(times) = numbers(&steps, "Values", budget)? {
                return Ok(times);
            }
        }
        Ok(Vec::new())
    }
}

/// The paths in the assembly of a file, by the blocks that are there.
fn assembled_names(node: &Node) -> Result<HashMap<ObjectKey, String>, ParseError> {
    let mut names = HashMap::new();
    let Some(assembly) = node.group(ASSEMBLY)? else {
        return Ok(names);
    };
    let mut left = vec![(String::new(), assembly, 0)];
    while let Some((path, group, depth)) = left.pop() {
        for (name, member) in group.distinct_groups(|_| true)? {
            let path = if path.is_empty() { name } else { format!("{path}/{name}") };
            if member.text("Type").is_none()
                && depth < MAX_DEPTH
                && !names.contains_key(&member.key())
            {
                left.push((path.clone(), member.clone(), depth + 1));
            }
            names.entry(member.key()).or_insert(path);
        }
    }
    Ok(names)
}

/// The number at the end of a name.
fn last_number(name: &str) -> Option<i64> {
    let (_, digits) = name.rsplit_once(|c: char| !c.is_ascii_digit())?;
    digits.parse().ok()
}

fn has_points(kind: &str) -> bool {
    KINDS.contains(&kind)
}

fn unread_kind(kind: &str) -> String {
    format!(
        "a VTKHDF file of type `{}`, which is not read: only points of {} are, also in blocks; save these with ParaView",
        one_line(kind.to_owned()),
        KINDS.join(" and ")
    )
}

/// The steps of all blocks. A block without a group of steps is the same in all of them.
fn common_step_count(blocks: &[Block]) -> Result<usize, ParseError> {
    let mut moving = blocks.iter().filter(|block| block.steps.is_some());
    let Some(first) = moving.next() else {
        return Ok(1);
    };
    match moving.find(|block| block.step_count != first.step_count) {
        None => Ok(first.step_count),
        Some(other) => {
            let what = format!(
                "{} has {} time steps, {} has {}: all blocks need the same steps",
                first.node.path(),
                first.step_count,
                other.node.path(),
                other.step_count
            );
            Err(ParseError::malformed(0, what))
        }
    }
}

impl Block {
    fn open(name: String, node: Node) -> Result<Self, ParseError> {
        let steps = node.group(STEPS)?;
        let stated = steps.as_ref().map(|steps| steps.number("NSteps").and_then(integer));
        let step_count = match stated {
            None => 1,
            Some(stated) => {
                let stated = stated.and_then(|count| usize::try_from(count).ok());
                stated.ok_or_else(|| {
                    let what = format!("{}/Steps has no attribute NSteps", node.path());
                    ParseError::malformed(0, what)
                })?
            }
        };
        Ok(Self { name, node, steps, step_count })
    }

    /// One number for each step from the group of steps.
    fn list(&self, name: &str, budget: MemoryBudget) -> Result<Option<Vec<f64>>, ParseError> {
        match &self.steps {
            Some(steps) => numbers(steps, name, budget),
            None => Ok(None),
        }
    }

    /// The offset `name` of a step; `None` if the file has none.
    fn offset(
        &self,
        name: &str,
        step: usize,
        budget: MemoryBudget,
    ) -> Result<Option<u64>, ParseError> {
        let Some(all) = self.list(name, budget)? else {
            return Ok(None);
        };
        let offset = all.get(step).copied().and_then(integer);
        let offset = offset.and_then(|offset| u64::try_from(offset).ok());
        match offset {
            Some(offset) => Ok(Some(offset)),
            None => {
                let count = all.len();
                let path = self.node.path();
                let what = format!(
                    "{path}/Steps/{name} has no offset for step {step}, it has {count} numbers"
                );
                Err(ParseError::malformed(0, what))
            }
        }
    }

    /// First point of a step, and their number.
    fn points(&self, step: usize, budget: MemoryBudget) -> Result<(u64, u64), ParseError> {
        let counts = numbers(&self.node, "NumberOfPoints", budget)?
            .ok_or_else(|| self.bad("has no data set NumberOfPoints"))?;
        let part = self.offset("PartOffsets", step, budget)?;
        let parts = self.offset("NumberOfParts", step, budget)?;
        let (part, parts) = match (&self.steps, part, parts) {
            (None, ..) => (0, counts.len() as u64),
            (Some(_), Some(part), parts) => (part, parts.unwrap_or(1)),
            (Some(_), None, parts) => (step as u64, parts.unwrap_or(1)),
        };
        let end = part.checked_add(parts).and_then(|end| usize::try_from(end).ok());
        let start = usize::try_from(part).unwrap_or(usize::MAX);
        let own = end.and_then(|end| counts.get(start..end)).ok_or_else(|| {
            let end = part.saturating_add(parts);
            let what = format!("has the parts {part} to {end} in step {step}, of {}", counts.len());
            self.bad(&what)
        })?;
        let count = own
            .iter()
            .try_fold(0_u64, |sum, count| {
                let count = integer(*count).and_then(|count| u64::try_from(count).ok());
                sum.checked_add(count?)
            })
            .ok_or_else(|| self.bad("has invalid counts in NumberOfPoints"))?;
        let first = self.offset("PointOffsets", step, budget)?;
        Ok((first.unwrap_or(0), count))
    }

    /// The points of a step with their values, and names of values that are left out.
    fn part(
        &self,
        value: u32,
        step: usize,
        budget: MemoryBudget,
    ) -> Result<(Part, Vec<String>), ParseError> {
        let (first, count) = self.points(step, budget)?;
        let rows = Slice::rows(first..first.saturating_add(count));
        let positions = values(&self.node, "Points", &rows, budget)?;
        let Some(positions) = positions.filter(|values| values.components() == 3) else {
            return Err(self.bad("has no data set Points with three numbers a point"));
        };
        let mut finder = PropertyFinder::new(count, budget);
        if let Some(data) = self.node.group("PointData")? {
            let offsets = match &self.steps {
                Some(steps) => steps.group("PointDataOffsets")?,
                None => None,
            };
            for name in data.members()?.1 {
                let first = match &offsets {
                    Some(offsets) => value_offset(offsets, &name, step, budget)?.unwrap_or(first),
                    None => first,
                };
                add_values(&mut finder, &data, &name, first)?;
            }
        }
        let part = Part {
            value,
            name: self.name.clone(),
            count,
            positions: vec![Piece::Stored(positions)],
            attributes: finder.found,
        };
        Ok((part, finder.left_out))
    }

    fn bad(&self, what: &str) -> ParseError {
        ParseError::malformed(0, format!("{} {what}", self.node.path()))
    }
}

/// The first value `name` of a step; `None` if the file does not say.
fn value_offset(
    offsets: &Node,
    name: &str,
    step: usize,
    budget: MemoryBudget,
) -> Result<Option<u64>, ParseError> {
    let all = numbers(offsets, name, budget)?.unwrap_or_default();
    let own = all.get(step).copied().and_then(integer);
    Ok(own.and_then(|own| u64::try_from(own).ok()))
}

/// Adds the values `name` of a step, which begin at row `first`. They are left out if the file does not have all of them.
fn add_values(
    finder: &mut PropertyFinder,
    data: &Node,
    name: &str,
    first: u64,
) -> Result<(), ParseError> {
    let stored = Stored::open(data, name);
    let len = stored.ok().flatten().and_then(|stored| stored.shape.first().copied());
    let end = first.checked_add(finder.count);
    match (len, end) {
        (Some(len), Some(end)) if end <= len => {
            finder.add(data, name, name, &Slice::rows(first..end))
        }
        _ => {
            finder.left_out.push(name.to_owned());
            Ok(())
        }
    }
}

impl Dialect for VtkHdf {
    fn steps(&self, budget: MemoryBudget) -> Result<Vec<StepInfo>, ParseError> {
        let times = self.times(budget)?;
        let has_steps = self.blocks.iter().any(|block| block.steps.is_some());
        if has_steps && times.len() < self.step_count {
            let (count, stated) = (times.len(), self.step_count);
            let what = format!("/VTKHDF/Steps/Values has {count} times for {stated} steps");
            return Err(ParseError::malformed(0, what));
        }
        let info = |step: usize| StepInfo { number: None, time: times.get(step).copied() };
        Ok((0..self.step_count).map(info).collect())
    }

    fn table(&self, step: usize, budget: MemoryBudget) -> Result<ParticleTable, ParseError> {
        if step >= self.step_count {
            return Err(no_step(step, self.step_count));
        }
        let parts = (0..).zip(&self.blocks).map(|(value, block)| {
            let (part, _) = block.part(value, step, budget)?;
            Ok(part)
        });
        let parts = parts.collect::<Result<Vec<Part>, ParseError>>()?;
        let time = self.times(budget)?.get(step).copied();
        Ok(ParticleTable::new(parts, self.is_divided()).at(time, None))
    }

    fn notes(&self) -> Vec<String> {
        let version: Vec<String> =
            self.node.numbers("Version").unwrap_or_default().iter().map(f64::to_string).collect();
        let steps = match self.step_count {
            1 => String::new(),
            count => format!(" with {count} time steps"),
        };
        let mut notes = vec![one_line(format!(
            "HDF5, VTKHDF {} {}{steps}: points with point data, cells are not used",
            version.join("."),
            self.kind
        ))];
        if self.is_divided() {
            let names = self.blocks.iter().map(|block| block.name.as_str());
            notes.push(one_line(part_names((0..).zip(names))));
        }
        let parts = self.blocks.iter().filter_map(|b| b.part(0, 0, MemoryBudget::UNLIMITED).ok());
        let left_out: Vec<String> = parts.flat_map(|(_, left_out)| left_out).collect();
        if !left_out.is_empty() {
            notes.push(one_line(format!(
                "not numbers for each point, so left out: {}",
                listed(&left_out)
            )));
        }
        if !self.unread.is_empty() {
            notes.push(one_line(format!(
                "blocks of other kinds are left out: {}",
                listed(&self.unread)
            )));
        }
        notes
    }
}
