//! Particles of openPMD files: `/data/<iteration>/particles/<species>/<record>/<component>`.
//!
//! Positions are `position * unitSI + positionOffset * unitSI`, metres. Other records keep their numbers.

use std::sync::Arc;

use super::dialect::{Dialect, StepInfo, listed, no_step, part_names, units};
use super::node::{Node, dataset_number};
use super::piece::Piece;
use super::properties::{AXES, PropertyFinder};
use super::slice::Slice;
use super::stored::Stored;
use super::table::{Part, ParticleTable};
use super::values::Values;
use spherule_frame::{MemoryBudget, ParseError, ScalarType};

const POSITION: &str = "position";
const OFFSET: &str = "positionOffset";
/// What stands for the number of an iteration in the path to it.
const ITERATION: &str = "%T";

/// A file with iterations.
pub(super) struct OpenPmd {
    root: Node,
    /// Numbers of the iterations with their groups, in the order of the numbers.
    iterations: Vec<(i64, Node)>,
    /// Path of particles below an iteration.
    particles: String,
    /// Names of the species of all iterations, sorted.
    species: Vec<String>,
}

/// Values of a component of a record.
struct Component {
    piece: Piece,
    /// Particles, if that is known without the data set of another component.
    count: Option<u64>,
    unit: f64,
    /// Byte of the object header of its data set.
    at: Option<usize>,
}

impl OpenPmd {
    /// The iterations of the file; `None` if it is no openPMD file.
    ///
    /// # Errors
    /// [`ParseError`] if the file is damaged, or has no particles.
    pub(super) fn open(root: &Node) -> Result<Option<Self>, ParseError> {
        let Some(version) = root.text("openPMD") else {
            return Ok(None);
        };
        let base = root.text("basePath").unwrap_or_else(|| format!("/data/{ITERATION}/"));
        let Some((before, after)) = base.split_once(ITERATION) else {
            let what =
                format!("openPMD {version} with the basePath {base}, which has no {ITERATION}");
            return Err(ParseError::malformed(0, what));
        };
        let mut iterations = Vec::new();
        if let Some(node) = root.descend(before)? {
            for name in node.members()?.0 {
                let Ok(number) = name.parse::<i64>() else {
                    continue;
                };
                if let Some(iteration) = node.descend(&format!("{name}/{after}"))? {
                    iterations.push((number, iteration));
                }
            }
        }
        iterations.sort_by_key(|(number, _)| *number);
        let particles = root.text("particlesPath").unwrap_or_else(|| "particles/".to_owned());
        let mut file = Self { root: root.clone(), iterations, particles, species: Vec::new() };
        for (_, iteration) in &file.iterations {
            if let Some(particles) = iteration.descend(&file.particles)? {
                let species = particles.distinct_groups(|_| true)?.into_iter();
                file.species.extend(species.map(|(name, _)| name));
            }
        }
        file.species.sort();
        file.species.dedup();
        if file.species.is_empty() {
            let what =
                "an openPMD file without particles, only meshes are in it: these are not read";
            return Err(ParseError::unsupported(what));
        }
        Ok(Some(file))
    }

    fn iteration(&self, step: usize) -> Result<&(i64, Node), ParseError> {
        let found = self.iterations.get(step);
        found.ok_or_else(|| no_step(step, self.iterations.len()))
    }

    /// The particles of a species.
    fn part(
        &self,
        (value, name): (u32, &str),
        node: &Node,
        budget: MemoryBudget,
    ) -> Result<(Part, Vec<String>), ParseError> {
        let Some(record) = node.group(POSITION)? else {
            let what = format!("{} has no record {POSITION}", node.path());
            return Err(ParseError::malformed(0, what));
        };
        let offsets = node.group(OFFSET)?;
        // Find the components
        let mut axes = Vec::new();
        let mut count = None;
        for name in AXES {
            let position = Component::open(&record, name, budget)?;
            let offset = match &offsets {
                Some(offsets) => Component::open(offsets, name, budget)?,
                None => None,
            };
            for component in [&position, &offset].into_iter().flatten() {
                if component.at.is_some() {
                    let of_data = component.count;
                    if count.is_some() && of_data != count {
                        return Err(ragged(&record, name, of_data, count));
                    }
                    count = of_data;
                }
            }
            axes.push((position, offset));
        }
        if axes.iter().filter(|(position, _)| position.is_some()).count() < 2 {
            let what = format!("{} has fewer than two of the components x, y, z", record.path());
            return Err(ParseError::malformed(0, what));
        }
        // Positions that are all constant take no space, so that only their number could be wrong
        let stated = axes.iter().flat_map(|(position, _)| position).find_map(|p| p.count);
        let count = match (count, stated) {
            (Some(count), _) => count,
            (None, None | Some(0)) => 0,
            (None, Some(count)) => {
                let what =
                    format!("all {count} positions of {} are the same constant", node.path());
                return Err(ParseError::malformed(0, what));
            }
        };
        let positions =
            axes.into_iter().map(|(position, offset)| scaled(position, offset)).collect();
        // Other records
        let mut finder = PropertyFinder::new(count, budget);
        let (groups, datasets) = node.members()?;
        for name in datasets {
            finder.add(node, &name, &name, &Slice::ALL)?;
        }
        for name in groups {
            if ![POSITION, OFFSET, "particlePatches"].contains(&name.as_str()) {
                add_record(&mut finder, node, &name)?;
            }
        }
        let part =
            Part { value, name: name.to_owned(), count, positions, attributes: finder.found };
        Ok((part, finder.left_out))
    }

    /// Species of the first iteration that has some, with their groups.
    fn first_species(&self) -> Vec<(String, Node)> {
        let mut found = self.iterations.iter().filter_map(|(_, iteration)| {
            let particles = iteration.descend(&self.particles).ok()??;
            let species = particles.distinct_groups(|_| true).ok()?;
            Some(species).filter(|species| !species.is_empty())
        });
        found.next().unwrap_or_default()
    }

    /// Units of records that are not SI units.
    fn units(&self) -> Vec<String> {
        let mut all = vec!["positions m".to_owned(), "time s".to_owned()];
        for (species, node) in self.first_species() {
            let (groups, datasets) = node.members().unwrap_or_default();
            let scalars = datasets.into_iter().filter_map(|name| {
                let dataset = node.dataset(&name).ok()??;
                let unit = dataset_number(&dataset, "unitSI")?;
                Some((name, unit))
            });
            let vectors = groups.into_iter().filter_map(|name| {
                if name == POSITION || name == OFFSET {
                    return None;
                }
                let record = node.group(&name).ok()??;
                let unit = Component::open(&record, "x", MemoryBudget::UNLIMITED).ok()??.unit;
                Some((name, unit))
            });
            let others = scalars.chain(vectors).filter(|(_, unit)| *unit != 1.0);
            all.extend(others.map(|(name, unit)| format!("{species}/{name} {unit:e} SI")));
        }
        all
    }
}

/// The error for a component with another number of particles.
fn ragged(record: &Node, name: &str, count: Option<u64>, expected: Option<u64>) -> ParseError {
    let what = format!(
        "{} has {} values for {} particles",
        record.path_of(name),
        count.unwrap_or(0),
        expected.unwrap_or(0)
    );
    ParseError::malformed(0, what)
}

/// A coordinate in metres; 0 without a component.
fn scaled(position: Option<Component>, offset: Option<Component>) -> Piece {
    let Some(position) = position else {
        return Piece::zero(ScalarType::F32);
    };
    let is_zero =
        |offset: &Component| matches!(offset.piece, Piece::Constant(value, _) if value == 0.0);
    let offset = offset.filter(|offset| !is_zero(offset));
    if position.unit == 1.0 && offset.is_none() {
        return position.piece;
    }
    let (offset, offset_unit) = match offset {
        Some(offset) => (offset.piece, offset.unit),
        None => (Piece::zero(ScalarType::F64), 1.0),
    };
    Piece::Scaled {
        values: Box::new(position.piece),
        unit: position.unit,
        offset: Box::new(offset),
        offset_unit,
    }
}

impl Component {
    /// The component `name` of `record`: a data set, or a group with a constant.
    fn open(record: &Node, name: &str, budget: MemoryBudget) -> Result<Option<Self>, ParseError> {
        if let Some(dataset) = record.dataset(name)? {
            let unit = dataset_number(&dataset, "unitSI").unwrap_or(1.0);
            let stored = Arc::new(Stored::of(&record.path_of(name), &dataset)?);
            let values = Values::find(&stored, &Slice::ALL, budget)?;
            let Some(values) = values.filter(|values| values.components() == 1) else {
                let shape = &stored.shape;
                return Err(stored.bad(format!("shape {shape:?}, one number a particle is needed")));
            };
            return Ok(Some(Self {
                count: Some(values.count()),
                piece: Piece::Stored(values),
                unit,
                at: Some(stored.at),
            }));
        }
        let Some(constant) = record.group(name)? else {
            return Ok(None);
        };
        Ok(Self::constant(&constant))
    }

    /// The constant that a group has in its attributes.
    fn constant(node: &Node) -> Option<Self> {
        let value = node.number("value")?;
        let count = node.number("shape").and_then(super::dialect::integer);
        Some(Self {
            piece: Piece::Constant(value, ScalarType::F64),
            count: count.and_then(|count| u64::try_from(count).ok()),
            unit: node.number("unitSI").unwrap_or(1.0),
            at: None,
        })
    }
}

/// Adds the record `name`: a constant scalar, or a vector.
fn add_record(finder: &mut PropertyFinder, node: &Node, name: &str) -> Result<(), ParseError> {
    let Some(record) = node.group(name)? else {
        return Ok(());
    };
    if let Some(component) = Component::constant(&record) {
        finder.found.push((name.to_owned(), vec![component.piece]));
        return Ok(());
    }
    let mut pieces = Vec::new();
    for axis in AXES {
        match Component::open(&record, axis, finder.budget) {
            Ok(Some(component)) => {
                if component.at.is_some() && component.count != Some(finder.count) {
                    finder.left_out.push(name.to_owned());
                    return Ok(());
                }
                pieces.push(component.piece);
            }
            Ok(None) => {}
            Err(ParseError::Unsupported { .. }) => {
                finder.left_out.push(name.to_owned());
                return Ok(());
            }
            Err(error) => return Err(error),
        }
    }
    if !pieces.is_empty() {
        finder.found.push((name.to_owned(), pieces));
    }
    Ok(())
}

/// The time of an iteration, seconds.
fn time(iteration: &Node) -> Option<f64> {
    let unit = iteration.number("timeUnitSI").unwrap_or(1.0);
    Some(iteration.number("time")? * unit)
}

impl Dialect for OpenPmd {
    fn steps(&self, _budget: MemoryBudget) -> Result<Vec<StepInfo>, ParseError> {
        let info = |(number, _): &(i64, Node)| StepInfo { number: Some(*number), time: None };
        Ok(self.iterations.iter().map(info).collect())
    }

    fn table(&self, step: usize, budget: MemoryBudget) -> Result<ParticleTable, ParseError> {
        let (number, iteration) = self.iteration(step)?;
        let mut parts = Vec::new();
        if let Some(particles) = iteration.descend(&self.particles)? {
            for (value, name) in (0..).zip(&self.species) {
                if let Some(node) = particles.group(name)? {
                    parts.push(self.part((value, name), &node, budget)?.0);
                }
            }
        }
        let table = ParticleTable::new(parts, self.species.len() > 1);
        Ok(table.at(time(iteration), Some(*number)))
    }

    fn notes(&self) -> Vec<String> {
        let version = self.root.text("openPMD").unwrap_or_default();
        let software =
            self.root.text("software").map_or(String::new(), |name| format!(", written by {name}"));
        let mut notes = vec![format!(
            "HDF5, openPMD {version} with {} iterations{software}",
            self.iterations.len()
        )];
        match self.species.len() {
            1 => notes.push(format!("species {}", listed(&self.species))),
            _ => notes.push(part_names((0..).zip(self.species.iter().map(String::as_str)))),
        }
        notes.extend(units(&self.units()));
        notes
    }
}
