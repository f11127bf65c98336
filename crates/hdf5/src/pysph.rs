//! Output of PySPH: `/particles/<array>/arrays/<property>`, and the time in `/solver_data`.

use std::collections::BTreeSet;

use hdf5_reader::Dataset;

use super::dialect::{Dialect, StepInfo, integer, listed, part_names};
use super::node::{Node, dataset_number};
use super::piece::Piece;
use super::properties::{AXES, PropertyFinder, values};
use super::slice::Slice;
use super::table::{Part, ParticleTable};
use spherule_frame::{MemoryBudget, ParseError, ScalarType};

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
        for (name, node) in particles.distinct_groups(|_| true)? {
            if let Some(node) = node.group("arrays")? {
                arrays.push((name, node));
            }
        }
        if arrays.is_empty() {
            return Err(ParseError::malformed(
                0,
                "a PySPH file without particle arrays: /particles has no group with `arrays`",
            ));
        }
        Ok(Some(Self { root: root.clone(), solver, arrays }))
    }

    fn time(&self) -> Option<f64> {
        self.solver.number("t")
    }

    fn step(&self) -> Option<i64> {
        self.solver.number("count").and_then(integer)
    }

    /// Names of properties that some array stores.
    fn stored_names(&self) -> Result<BTreeSet<String>, ParseError> {
        let mut names = BTreeSet::new();
        for (_, node) in &self.arrays {
            for name in node.members()?.1 {
                let dataset = node.dataset(&name)?;
                if dataset.is_some_and(|dataset| is_stored(&dataset)) {
                    names.insert(name);
                }
            }
        }
        Ok(names)
    }

    /// The particles of one array. `names` are those of properties that some array stores.
    fn part(
        &self,
        (value, array): (u32, &str),
        node: &Node,
        names: &BTreeSet<String>,
        budget: MemoryBudget,
    ) -> Result<Part, ParseError> {
        let mut finder = PropertyFinder::new(0, budget);
        // In two dimensions, z is empty
        let find = |name: &str| {
            let axis = values(node, name, &Slice::ALL, budget)?;
            Ok(axis.filter(|axis| name != AXES[2] || axis.count() > 0))
        };
        let positions = finder.positions(node, "numbers", find)?;
        for name in node.members()?.1 {
            if names.contains(&name) && !AXES.contains(&name.as_str()) {
                add_property(&mut finder, node, &name)?;
            }
        }
        finder.join("velocity", &["u", "v", "w"]);
        Ok(Part {
            value,
            name: array.to_owned(),
            count: finder.count,
            positions,
            attributes: finder.found,
        })
    }
}

/// Whether the property has values in the file.
fn is_stored(dataset: &Dataset) -> bool {
    dataset.shape() != [0] && dataset_number(dataset, "stored") != Some(0.0)
}

/// Adds the property `name`. Vectors are flat, with the number of their components in `stride`. A scalar that is not
/// stored has its default for all particles.
fn add_property(finder: &mut PropertyFinder, node: &Node, name: &str) -> Result<(), ParseError> {
    let Some(dataset) = node.dataset(name)? else {
        return Ok(());
    };
    let stride = dataset_number(&dataset, "stride").and_then(integer);
    let stride = stride.and_then(|stride| u64::try_from(stride).ok());
    let stride = stride.filter(|stride| *stride > 1);
    if !is_stored(&dataset) {
        if stride.is_none() && finder.count > 0 {
            let default = dataset_number(&dataset, "default").unwrap_or(0.0);
            let piece = Piece::Constant(default, ScalarType::F64);
            finder.found.push((name.to_owned(), vec![piece]));
        }
        return Ok(());
    }
    if dataset.shape().len() == 1 {
        let slice = Slice { stride, ..Slice::ALL };
        finder.add(node, name, name, &slice)?;
    }
    Ok(())
}

impl Dialect for ParticleArrays {
    fn steps(&self, _budget: MemoryBudget) -> Result<Vec<StepInfo>, ParseError> {
        Ok(vec![StepInfo { number: self.step(), time: self.time() }])
    }

    fn table(&self, _step: usize, budget: MemoryBudget) -> Result<ParticleTable, ParseError> {
        let mut parts = Vec::new();
        let names = self.stored_names()?;
        for (value, (name, node)) in (0..).zip(&self.arrays) {
            parts.push(self.part((value, name), node, &names, budget)?);
        }
        let is_divided = self.arrays.len() > 1;
        Ok(ParticleTable::new(parts, is_divided).at(self.time(), self.step()))
    }

    fn notes(&self) -> Vec<String> {
        let version = self.root.number("version");
        let version = version.map_or(String::new(), |v| format!(", version {v} of its layout"));
        let names: Vec<String> = self.arrays.iter().map(|(name, _)| name.clone()).collect();
        let mut notes = vec![format!("HDF5, output of PySPH{version}")];
        match self.arrays.len() {
            1 => notes.push(format!("particle array {}", listed(&names))),
            _ => notes.push(part_names((0..).zip(names.iter().map(String::as_str)))),
        }
        notes
    }
}
