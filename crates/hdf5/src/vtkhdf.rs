//! VTKHDF files: points and point data of `PolyData` and `UnstructuredGrid`, also with time steps.

use super::dialect::{Dialect, StepInfo, integer, no_step};
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

/// A file with points.
pub(super) struct VtkHdf {
    node: Node,
    kind: String,
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
        if !KINDS.contains(&kind.as_str()) {
            let what = format!(
                "a VTKHDF file of type `{kind}`, which is not read: only points of {} are; save these with ParaView",
                KINDS.join(" and ")
            );
            return Err(ParseError::unsupported(what));
        }
        let steps = node.group(STEPS)?;
        let stated = steps.as_ref().map(|steps| steps.number("NSteps").and_then(integer));
        let step_count = match stated {
            None => 1,
            Some(stated) => {
                let stated = stated.and_then(|count| usize::try_from(count).ok());
                stated.ok_or_else(|| {
                    ParseError::malformed(0, "/VTKHDF/Steps has no attribute NSteps")
                })?
            }
        };
        Ok(Some(Self { node, kind, steps, step_count }))
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
                let what = format!(
                    "/VTKHDF/Steps/{name} has no offset for step {step}, it has {count} numbers"
                );
                Err(ParseError::malformed(0, what))
            }
        }
    }

    /// First point of a step, and their number.
    fn points(&self, step: usize, budget: MemoryBudget) -> Result<(u64, u64), ParseError> {
        let counts = numbers(&self.node, "NumberOfPoints", budget)?
            .ok_or_else(|| ParseError::malformed(0, "/VTKHDF has no data set NumberOfPoints"))?;
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
            let what = format!(
                "step {step} has the parts {part} to {}, there are {}",
                part.saturating_add(parts),
                counts.len()
            );
            ParseError::malformed(0, what)
        })?;
        let count = own
            .iter()
            .try_fold(0_u64, |sum, count| {
                let count = integer(*count).and_then(|count| u64::try_from(count).ok());
                sum.checked_add(count?)
            })
            .ok_or_else(|| ParseError::malformed(0, "/VTKHDF/NumberOfPoints has invalid counts"))?;
        let first = self.offset("PointOffsets", step, budget)?;
        Ok((first.unwrap_or(0), count))
    }
}

impl Dialect for VtkHdf {
    fn steps(&self, budget: MemoryBudget) -> Result<Vec<StepInfo>, ParseError> {
        let times = self.list("Values", budget)?.unwrap_or_default();
        if self.steps.is_some() && times.len() < self.step_count {
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
        let (first, count) = self.points(step, budget)?;
        let rows = |first: u64| Slice::rows(first..first.saturating_add(count));
        let positions = values(&self.node, "Points", &rows(first), budget)?;
        let Some(positions) = positions.filter(|values| values.components() == 3) else {
            let what = "/VTKHDF has no data set Points with three numbers a point";
            return Err(ParseError::malformed(0, what));
        };
        let mut finder = PropertyFinder::new(count, budget);
        if let Some(data) = self.node.group("PointData")? {
            for name in data.members()?.1 {
                let offset = match &self.steps {
                    Some(steps) => steps.group("PointDataOffsets")?,
                    None => None,
                };
                let first = match offset {
                    Some(offsets) => {
                        let all = numbers(&offsets, &name, budget)?.unwrap_or_default();
                        let own = all.get(step).copied().and_then(integer);
                        own.and_then(|own| u64::try_from(own).ok()).unwrap_or(first)
                    }
                    None => first,
                };
                let stored = Stored::open(&data, &name);
                let len = stored.ok().flatten().and_then(|s| s.shape.first().copied());
                let is_inside =
                    len.is_some_and(|len| first.checked_add(count).is_some_and(|end| end <= len));
                if is_inside {
                    finder.add(&data, &name, &name, &rows(first))?;
                } else {
                    finder.left_out.push(name);
                }
            }
        }
        let part = Part {
            value: 0,
            name: String::new(),
            count,
            positions: vec![Piece::Stored(positions)],
            attributes: finder.found,
        };
        let times = self.list("Values", budget)?.unwrap_or_default();
        Ok(ParticleTable::new(vec![part], false).at(times.get(step).copied(), None))
    }

    fn notes(&self) -> Vec<String> {
        let version: Vec<String> =
            self.node.numbers("Version").unwrap_or_default().iter().map(f64::to_string).collect();
        let steps = match self.steps {
            Some(_) => format!(" with {} time steps", self.step_count),
            None => String::new(),
        };
        vec![one_line(format!(
            "HDF5, VTKHDF {} {}{steps}: points with point data, cells are not used",
            version.join("."),
            self.kind
        ))]
    }
}
