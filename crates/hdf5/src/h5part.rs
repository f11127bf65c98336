//! H5Part and H5hut files: a group `Step#<number>` for each time step, with a data set for each property.

use super::dialect::{Dialect, StepInfo, integer, listed, no_step};
use super::node::Node;
use super::properties::{PropertyFinder, numbers, values};
use super::slice::Slice;
use super::table::{Part, ParticleTable};
use super::values::Values;
use spherule_frame::{MemoryBudget, ParseError};

const STEP: &str = "Step#";
/// Names of the attribute, or data set, with the time of a step.
const TIMES: [&str; 6] = ["TimeValue", "time", "Time", "TIME", "t", "$TimeValue"];

/// A file with steps.
pub(super) struct StepGroups {
    root: Node,
    /// Numbers of the steps with the names of their groups, in the order of the numbers.
    steps: Vec<(i64, String)>,
}

impl StepGroups {
    /// The steps of the file; `None` if it has another layout.
    ///
    /// # Errors
    /// [`ParseError`] if the file is damaged.
    pub(super) fn open(root: &Node) -> Result<Option<Self>, ParseError> {
        let (groups, _) = root.members()?;
        let numbered = groups.into_iter().filter_map(|name| {
            let number = name.strip_prefix(STEP)?.parse().ok()?;
            Some((number, name))
        });
        let mut steps: Vec<(i64, String)> = numbered.collect();
        steps.sort();
        Ok((!steps.is_empty()).then(|| Self { root: root.clone(), steps }))
    }

    fn node(&self, step: usize) -> Result<(i64, Node), ParseError> {
        let found = self.steps.get(step);
        let (number, name) = found.ok_or_else(|| no_step(step, self.steps.len()))?;
        let node = self
            .root
            .group(name)?
            .ok_or_else(|| ParseError::malformed(0, format!("/{name} is not a group")))?;
        Ok((*number, node))
    }
}

fn time(node: &Node, budget: MemoryBudget) -> Option<f64> {
    let attribute = TIMES.iter().find_map(|name| node.number(name));
    let stored = || {
        let mut found = TIMES.iter().filter_map(|name| numbers(node, name, budget).ok()?);
        found.find_map(|all| (all.len() == 1).then(|| all[0]))
    };
    attribute.or_else(stored)
}

/// The coordinates of an axis, whatever the case of its name.
fn axis(node: &Node, axis: &str, budget: MemoryBudget) -> Result<Option<Values>, ParseError> {
    let upper = axis.to_ascii_uppercase();
    for name in [axis, upper.as_str(), &format!("Coords_{axis}")] {
        if let Some(values) = values(node, name, &Slice::ALL, budget)? {
            return Ok(Some(values));
        }
    }
    Ok(None)
}

impl Dialect for StepGroups {
    fn steps(&self, _budget: MemoryBudget) -> Result<Vec<StepInfo>, ParseError> {
        let info = |(number, _): &(i64, String)| StepInfo { number: Some(*number), time: None };
        Ok(self.steps.iter().map(info).collect())
    }

    fn table(&self, step: usize, budget: MemoryBudget) -> Result<ParticleTable, ParseError> {
        let (number, node) = self.node(step)?;
        let mut finder = PropertyFinder::new(0, budget);
        let find = |name: &str| axis(&node, name, budget);
        let positions = finder.positions(&node, "coordinates", find)?;
        for name in node.members()?.1 {
            if !TIMES.contains(&name.as_str()) {
                finder.add(&node, &name, &name, &Slice::ALL)?;
            }
        }
        finder.join_vectors();
        let part = Part {
            value: 0,
            name: String::new(),
            count: finder.count,
            positions,
            attributes: finder.found,
        };
        let table = ParticleTable::new(vec![part], false);
        Ok(table.at(time(&node, budget), Some(number)))
    }

    fn notes(&self) -> Vec<String> {
        let mut notes =
            vec![format!("HDF5, H5Part (or H5hut) with {} time steps", self.steps.len())];
        if let Ok((_, node)) = self.node(0)
            && let Ok((groups, _)) = node.members()
            && !groups.is_empty()
        {
            let groups: Vec<String> = groups.iter().map(|name| node.path_of(name)).collect();
            notes.push(format!("groups within a step are not read: {}", listed(&groups)));
        }
        let version = self.root.number("H5hutVersion").and_then(integer);
        notes.extend(version.map(|version| format!("H5hut version {version}")));
        notes
    }
}
