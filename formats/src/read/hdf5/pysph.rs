//! Output of PySPH: `/particles/<array>/arrays/<property>`, and the time in `/solver_data`.

use super::dialect::{Dialect, StepInfo, integer, listed, part_names};
use super::file::{Node, dataset_number};
use super::piece::Piece;
use super::properties::{PropertyFinder, values};
use super::stored::Stored;
use super::table::{Part, ParticleTable};
use super::values::Slice;
use crate::{MemoryBudget, ParseError};

/// A file with particle arrays.
pub(super) struct ParticleArrays {
    root: Node,
    solver: Node,
    /// Names of arrays with the groups of their properties.
    arrays: Vec<(String, Node)>,
}

impl ParticleArrays {
    /// The arrays of the file; `None` if it has another layout.
    ///
    /// # Errors
    /// [`ParseError`] if the file is damaged.
    pub(super) fn open(root: &Node) -> Result<Option<Self>, ParseError> {
        let (Some(particles), Some(solver)) =
            (root.group("particles")?, root.group("solver_data")?)
        else {
            return Ok(None);
        };
        let mut arrays = Vec::new();
        for name in particles.members()?.0 {
            if let Some(node) = particles.descend(&format!("{name}/arrays"))? {
                arrays.push((name, node));
            }
        }
        if arrays.is_empty() {
            return Err(ParseError::malformed(
                0,
                "a PySPH file without particle arrays: /particles has no group with `arrays`",
            ));
        }
        Ok(Some(Self {
            root: root.clone(),
            solver,
            arrays,
        }))
    }

    fn time(&self) -> Option<f64> {
        self.solver.number("t")
    }

    fn step(&self) -> Option<i64> {
        self.solver.number("count").and_then(integer)
    }

    /// The particles of one array.
    fn part(&self, value: u32, node: &Node, budget: MemoryBudget) -> Result<Part, ParseError> {
        let mut positions = Vec::new();
        let mut count = None;
        let mut finder = PropertyFinder::new(0, budget);
        for name in ["x", "y", "z"] {
            let Some(axis) = values(node, name, &Slice::ALL, budget)? else {
                if name == "z" {
                    continue;
                }
                let what = format!("{} has no numbers {name}", node.path());
                return Err(ParseError::malformed(0, what));
            };
            let stored = axis.stored();
            let expected = *count.get_or_insert(axis.count());
            // A property that PySPH does not store is empty; then it has its default, 0.
            if name == "z" && axis.count() == 0 {
                continue;
            }
            if axis.count() != expected || axis.components() != 1 {
                let shape = &stored.shape;
                return Err(stored.bad(format!("shape {shape:?} for {expected} particles")));
            }
            finder.exclude(stored);
            positions.push(Piece::Stored(axis));
        }
        finder.count = count.unwrap_or(0);
        for name in node.members()?.1 {
            add_property(&mut finder, node, &name)?;
        }
        finder.join("velocity", &["u", "v", "w"]);
        Ok(Part {
            value,
            count: finder.count,
            positions,
            attributes: finder.found,
        })
    }
}

/// Adds the property `name` if it is stored. Vectors are flat, with the number of their components in `stride`.
fn add_property(finder: &mut PropertyFinder, node: &Node, name: &str) -> Result<(), ParseError> {
    let Some(dataset) = node.dataset(name)? else {
        return Ok(());
    };
    if dataset.shape() == [0] || dataset_number(&dataset, "stored") == Some(0.0) {
        return Ok(());
    }
    let stride = dataset_number(&dataset, "stride").and_then(integer);
    let stride = stride.and_then(|stride| u64::try_from(stride).ok());
    let slice = Slice {
        stride: stride.filter(|stride| *stride > 1),
        ..Slice::ALL
    };
    let stored = Stored::of(node, name, &dataset)?;
    if stored.shape.len() == 1 {
        finder.add(node, name, name, &slice)?;
    }
    Ok(())
}

impl Dialect for ParticleArrays {
    fn steps(&self, _budget: MemoryBudget) -> Result<Vec<StepInfo>, ParseError> {
        Ok(vec![StepInfo {
            number: self.step(),
            time: self.time(),
        }])
    }

    fn table(&self, _step: usize, budget: MemoryBudget) -> Result<ParticleTable, ParseError> {
        let mut parts = Vec::new();
        for (value, (_, node)) in (0..).zip(&self.arrays) {
            parts.push(self.part(value, node, budget)?);
        }
        let is_divided = self.arrays.len() > 1;
        Ok(ParticleTable::new(parts, is_divided).at(self.time(), self.step()))
    }

    fn remarks(&self) -> Vec<String> {
        let version = self.root.number("version");
        let version = version.map_or(String::new(), |v| format!(", version {v} of its layout"));
        let names: Vec<String> = self.arrays.iter().map(|(name, _)| name.clone()).collect();
        let mut remarks = vec![format!("HDF5, output of PySPH{version}")];
        match self.arrays.len() {
            1 => remarks.push(format!("particle array {}", listed(&names))),
            _ => remarks.push(part_names((0..).zip(names.iter().map(String::as_str)))),
        }
        remarks
    }
}
