//! H5MD files: `/particles/<group>/<element>` with `value`, `step` and `time`, or fixed in time.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DVec3;

use super::dialect::{Dialect, StepInfo, integer, listed, no_step, part_names, units};
use super::node::{Node, dataset_number, dataset_text};
use super::piece::Piece;
use super::properties::{PropertyFinder, numbers};
use super::slice::Slice;
use super::stored::Stored;
use super::table::{Part, ParticleTable};
use super::values::Values;
use spherule_frame::{MemoryBudget, ParseError, SimulationCell};
use spherule_readers::read::notes::cell_note;

const POSITION: &str = "position";
/// Least budget for lists of steps.
const LIST_ENTRY_LEN: u64 = 64;

/// A file with groups of particles.
pub(super) struct Trajectory {
    root: Node,
    groups: Vec<ParticleGroup>,
    /// Steps of all groups, by number.
    steps: Vec<SampledStep>,
}

/// A group of particles, and the steps of its positions.
struct ParticleGroup {
    name: String,
    node: Node,
    position: Element,
}

/// A property that is fixed in time, or has values for each step.
struct Element {
    /// The data set with the values.
    stored: Arc<Stored>,
    /// Numbers of its steps; `None` if it is fixed in time.
    steps: Option<Vec<i64>>,
    times: Option<Vec<f64>>,
}

#[derive(Debug, Clone, Copy)]
struct SampledStep {
    number: i64,
    time: Option<f64>,
}

impl Element {
    /// The element `name` of `node`.
    fn open(node: &Node, name: &str, budget: MemoryBudget) -> Result<Option<Self>, ParseError> {
        let Some(group) = node.group(name)? else {
            let stored = Stored::open(node, name)?;
            return Ok(stored.map(|stored| Self {
                stored: Arc::new(stored),
                steps: None,
                times: None,
            }));
        };
        let Some(stored) = Stored::open(&group, "value")?.map(Arc::new) else {
            return Ok(None);
        };
        let count = stored.shape.first().copied().unwrap_or(0);
        let steps = sampled(&group, "step", count, budget)?;
        let steps = match steps {
            Some(steps) => steps.into_iter().map(integer).collect::<Option<Vec<i64>>>(),
            None => None,
        };
        let Some(steps) = steps else {
            return Err(stored.bad(format!("{} has no list of steps", group.path_of("step"))));
        };
        let times = sampled(&group, "time", count, budget)?;
        Ok(Some(Self { stored, steps: Some(steps), times }))
    }

    /// Which values are those of step `number`: all, those at an index, or none.
    fn slice(&self, number: i64) -> Option<Slice> {
        match &self.steps {
            None => Some(Slice::ALL),
            Some(steps) => {
                let index = steps
                    .binary_search(&number)
                    .ok()
                    .or_else(|| steps.iter().position(|step| *step == number))?;
                Some(Slice::frame(index as u64))
            }
        }
    }
}

/// The edges of a cell in two or three dimensions, from their lengths or all their components.
fn edges_of(numbers: &[f64]) -> Option<[DVec3; 3]> {
    Some(match *numbers {
        [a, b, c] => [a * DVec3::X, b * DVec3::Y, c * DVec3::Z],
        [a, b] => [a * DVec3::X, b * DVec3::Y, DVec3::ZERO],
        [ax, ay, bx, by] => [DVec3::new(ax, ay, 0.0), DVec3::new(bx, by, 0.0), DVec3::ZERO],
        [ax, ay, az, bx, by, bz, cx, cy, cz] => {
            [DVec3::new(ax, ay, az), DVec3::new(bx, by, bz), DVec3::new(cx, cy, cz)]
        }
        _ => return None,
    })
}

/// The numbers `name` for `count` samples: a list, or an increment from an offset.
fn sampled(
    group: &Node,
    name: &str,
    count: u64,
    budget: MemoryBudget,
) -> Result<Option<Vec<f64>>, ParseError> {
    let Some(dataset) = group.dataset(name)? else {
        return Ok(None);
    };
    budget.check(count.saturating_mul(LIST_ENTRY_LEN), "the list of its steps is")?;
    let Some(all) = numbers(group, name, budget)? else {
        return Ok(None);
    };
    if dataset.shape().is_empty() {
        let increment = all.first().copied().unwrap_or(1.0);
        let offset = dataset_number(&dataset, "offset").unwrap_or(0.0);
        // No file has more samples than bytes.
        let most = group.file().bytes().len() as u64;
        if count > most {
            return Err(ParseError::malformed(
                0,
                format!("{count} samples in a file of {most} bytes"),
            ));
        }
        let samples = (0..count).map(|index| offset + index as f64 * increment);
        return Ok(Some(samples.collect()));
    }
    if (all.len() as u64) < count {
        let stored = Stored::of(&group.path_of(name), &dataset)?;
        return Err(stored.bad(format!("{} numbers for {count} samples", all.len())));
    }
    Ok(Some(all.into_iter().take(usize::try_from(count).unwrap_or(usize::MAX)).collect()))
}

impl Trajectory {
    /// The particles of the file; `None` if it has another layout.
    ///
    /// # Errors
    /// [`ParseError`] if the file is damaged or no group has positions.
    pub(super) fn open(root: &Node) -> Result<Option<Self>, ParseError> {
        if root.group("h5md")?.is_none() {
            return Ok(None);
        }
        let budget = MemoryBudget::UNLIMITED;
        let mut groups = Vec::new();
        let particles = root.group("particles")?;
        if let Some(particles) = particles {
            for (name, node) in particles.distinct_groups(|_| true)? {
                if let Some(position) = Element::open(&node, POSITION, budget)? {
                    groups.push(ParticleGroup { name, node, position });
                }
            }
        }
        if groups.is_empty() {
            return Err(ParseError::malformed(
                0,
                "an H5MD file in which no group of /particles has an element `position`",
            ));
        }
        let mut steps: BTreeMap<i64, Option<f64>> = BTreeMap::new();
        for group in &groups {
            let position = &group.position;
            for (index, number) in position.steps.iter().flatten().enumerate() {
                let time = position.times.as_ref().and_then(|times| times.get(index));
                let known = steps.entry(*number).or_default();
                *known = known.or(time.copied());
            }
        }
        let is_fixed = groups.iter().all(|group| group.position.steps.is_none());
        if is_fixed {
            steps.insert(0, None);
        }
        let steps = steps.into_iter();
        Ok(Some(Self {
            root: root.clone(),
            groups,
            steps: steps.map(|(number, time)| SampledStep { number, time }).collect(),
        }))
    }

    /// The particles of `group` at a step; `None` if it has no positions there.
    fn part(
        &self,
        value: u32,
        group: &ParticleGroup,
        number: i64,
        budget: MemoryBudget,
    ) -> Result<Option<Part>, ParseError> {
        let Some(slice) = group.position.slice(number) else {
            return Ok(None);
        };
        let stored = &group.position.stored;
        let positions = Values::find(stored, &slice, budget)?
            .filter(|values| matches!(values.components(), 2 | 3))
            .ok_or_else(|| {
                let shape = &stored.shape;
                stored.bad(format!("shape {shape:?}, two or three numbers a particle are needed"))
            })?;
        let mut finder = PropertyFinder::new(positions.count(), budget);
        let (groups, datasets) = group.node.members()?;
        for name in groups.iter().chain(&datasets) {
            if name == POSITION || name == "box" {
                continue;
            }
            let Some(element) = Element::open(&group.node, name, budget)? else {
                continue;
            };
            if let Some(slice) = element.slice(number) {
                finder.add_stored(&element.stored, name, &slice)?;
            }
        }
        Ok(Some(Part {
            value,
            name: group.name.clone(),
            count: finder.count,
            positions: vec![Piece::Stored(positions)],
            attributes: finder.found,
        }))
    }

    /// The cell at a step, that of the first group that has one. A damaged cell is none.
    fn cell(&self, number: i64, budget: MemoryBudget) -> Option<SimulationCell> {
        let mut boxes = self.groups.iter().filter_map(|group| {
            let node = group.node.group("box").ok()??;
            let edges = Element::open(&node, "edges", budget).ok()??;
            let slice = edges.slice(number)?;
            let values = Values::find(&edges.stored, &slice, budget).ok()??;
            // Three lengths, or a matrix whose rows are the edges
            let count = usize::try_from(values.count()).ok().filter(|count| *count <= 3)?;
            let numbers = Piece::Stored(values).all(count).ok()?;
            let vectors = edges_of(&numbers)?;
            let boundary = node.texts("boundary");
            let is_periodic = |text: &String| text.trim_end_matches('\0').trim() == "periodic";
            let periodic = [0, 1, 2].map(|axis| boundary.get(axis).is_none_or(is_periodic));
            SimulationCell::new(DVec3::ZERO, vectors, periodic)
        });
        boxes.next()
    }

    /// Units of the elements of the first group.
    fn units(&self) -> Vec<String> {
        let Some(group) = self.groups.first() else {
            return Vec::new();
        };
        let elements =
            group.node.members().map(|(groups, _)| groups).unwrap_or_default().into_iter();
        let unit = |name: String| {
            let element = group.node.group(&name).ok()??;
            let unit = |what: &str| {
                let dataset = element.dataset(what).ok()??;
                dataset_text(&dataset, "unit")
            };
            let time = if name == POSITION {
                unit("time").map(|unit| format!("time {unit}, "))
            } else {
                None
            };
            Some(format!("{}{name} {}", time.unwrap_or_default(), unit("value")?))
        };
        elements.filter_map(unit).collect()
    }
}

impl Dialect for Trajectory {
    fn steps(&self, _budget: MemoryBudget) -> Result<Vec<StepInfo>, ParseError> {
        let is_fixed = self.groups.iter().all(|group| group.position.steps.is_none());
        let info = |step: &SampledStep| StepInfo {
            number: (!is_fixed).then_some(step.number),
            time: step.time,
        };
        Ok(self.steps.iter().map(info).collect())
    }

    fn table(&self, step: usize, budget: MemoryBudget) -> Result<ParticleTable, ParseError> {
        let found = self.steps.get(step).ok_or_else(|| no_step(step, self.steps.len()))?;
        let mut parts = Vec::new();
        for (value, group) in (0..).zip(&self.groups) {
            parts.extend(self.part(value, group, found.number, budget)?);
        }
        let table = ParticleTable::new(parts, self.groups.len() > 1);
        let is_fixed = self.groups.iter().all(|group| group.position.steps.is_none());
        let table = table.at(found.time, (!is_fixed).then_some(found.number));
        Ok(table.in_cell(self.cell(found.number, budget)))
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if let Ok(Some(h5md)) = self.root.group("h5md") {
            let version: Vec<String> =
                h5md.numbers("version").unwrap_or_default().iter().map(f64::to_string).collect();
            let creator = h5md
                .group("creator")
                .ok()
                .flatten()
                .and_then(|c| {
                    let version = c.text("version").unwrap_or_default();
                    Some(format!(", written by {} {version}", c.text("name")?))
                })
                .unwrap_or_default();
            notes.push(format!(
                "HDF5, H5MD {} with {} time steps{}",
                version.join("."),
                self.steps.len(),
                creator.trim_end()
            ));
        }
        let names: Vec<String> = self.groups.iter().map(|group| group.name.clone()).collect();
        match names.len() {
            1 => notes.push(format!("group of particles {}", listed(&names))),
            _ => notes.push(part_names((0..).zip(names.iter().map(String::as_str)))),
        }
        notes.extend(units(&self.units()));
        let first = self.steps.first().map_or(0, |step| step.number);
        if self.cell(first, MemoryBudget::UNLIMITED).is_some() {
            notes.push(cell_note(None));
        }
        notes
    }
}
