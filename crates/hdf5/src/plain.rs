//! Files without a known layout: data sets with the usual names of positions, in any group.

use std::collections::HashSet;
use std::sync::Arc;

use super::dialect::{Dialect, StepInfo, integer, listed, no_step, part_names};
use super::file::ObjectKey;
use super::node::Node;
use super::piece::Piece;
use super::properties::{PropertyFinder, numbers};
use super::slice::Slice;
use super::stored::Stored;
use super::table::{Part, ParticleTable};
use super::types::Field;
use super::values::Values;
use spherule_frame::names::{POSITION_ARRAYS, POSITION_STEMS, is_one_of};
use spherule_frame::{MemoryBudget, ParseError};

/// Groups within groups that are looked at.
const DEPTH: usize = 4;
/// Most groups that are looked at.
const MAX_GROUPS: usize = 1 << 10;
/// Most time steps of a file that has fewer bytes.
const MAX_STEPS: u64 = 1 << 16;
/// Separators between the stem of a name and its axis.
const SEPARATORS: [&str; 4] = ["", "_", ".", "-"];

/// Groups that have positions.
pub(super) struct PlainFile {
    groups: Vec<PositionGroup>,
    /// Number of time steps, if positions have a dimension for them.
    frames: Option<u64>,
}

/// A group with positions.
struct PositionGroup {
    node: Node,
    positions: Vec<PositionData>,
}

/// A data set of positions, or of one axis.
struct PositionData {
    stored: Arc<Stored>,
    field: Option<Field>,
}

impl PlainFile {
    /// The positions in the file.
    ///
    /// # Errors
    /// [`ParseError::Unsupported`] if there are none, with what is there.
    pub(super) fn open(root: &Node) -> Result<Self, ParseError> {
        let mut search = Search::default();
        search.visit(root, DEPTH)?;
        let Some(first) = search.groups.first() else {
            return Err(search.nothing());
        };
        let frames = first.frames();
        // Others may have no time steps, or as many.
        let groups = search.groups;
        let fits = |group: &PositionGroup| group.frames() == frames;
        if let Some(other) = groups.iter().find(|group| !fits(group)) {
            let what = format!(
                "{} has {} time steps, {} has {}; split the file",
                shown(first_path(&groups)),
                frames.unwrap_or(1),
                shown(other.node.path()),
                other.frames().unwrap_or(1)
            );
            return Err(ParseError::unsupported(what));
        }
        // Steps without particles take no bytes, so nothing else bounds their number
        let most = MAX_STEPS.max(root.file().bytes().len() as u64);
        if let Some(frames) = frames.filter(|frames| *frames > most) {
            let what = format!("{frames} time steps, at most {most} are read");
            return Err(groups[0].positions[0].stored.bad(what));
        }
        Ok(Self { groups, frames })
    }

    /// The first numbers with one of `names`: an attribute of the group or of the file, or a data set.
    fn number(&self, names: &[&str], step: usize, budget: MemoryBudget) -> Option<f64> {
        let group = &self.groups.first()?.node;
        for name in names {
            let in_data = numbers(group, name, budget).ok().flatten();
            let found = match (in_data, self.frames) {
                (Some(all), Some(frames)) if all.len() as u64 == frames => all.get(step).copied(),
                (Some(all), None) if all.len() == 1 => all.first().copied(),
                _ => group.number(name).filter(|_| self.frames.is_none()),
            };
            if found.is_some() {
                return found;
            }
        }
        None
    }

    fn time(&self, step: usize, budget: MemoryBudget) -> Option<f64> {
        self.number(&["time", "Time", "times", "t"], step, budget)
    }

    fn step(&self, step: usize, budget: MemoryBudget) -> Option<i64> {
        integer(self.number(&["step", "steps", "Step", "timestep"], step, budget)?)
    }

    fn part(
        &self,
        value: u32,
        group: &PositionGroup,
        step: usize,
        budget: MemoryBudget,
    ) -> Result<(Part, Vec<String>), ParseError> {
        let frame = self.frames.map(|_| step as u64);
        let count = group.count(frame.is_some());
        let mut finder = PropertyFinder::new(count, budget);
        let mut positions = Vec::new();
        for data in &group.positions {
            let slice = Slice { frame, field: data.field, ..Slice::ALL };
            let values = Values::find(&data.stored, &slice, budget)?;
            let values = values.filter(|values| values.count() == count).ok_or_else(|| {
                let shape = &data.stored.shape;
                data.stored.bad(format!("shape {shape:?} for {count} particles"))
            })?;
            positions.push(Piece::Stored(values));
            if data.field.is_none() {
                finder.exclude(&data.stored);
            }
        }
        // The other fields of a compound type, then the other data sets
        let own: Vec<Field> = group.positions.iter().filter_map(|data| data.field).collect();
        if let Some(first) = group.positions.first().filter(|data| data.field.is_some()) {
            for (name, field) in Field::of_compound(&first.stored.datatype) {
                if !own.contains(&field) {
                    let slice = Slice { frame, field: Some(field), ..Slice::ALL };
                    finder.add_stored(&first.stored, &name, &slice)?;
                }
            }
            finder.exclude(&first.stored);
        }
        for name in group.node.members()?.1 {
            let is_per_frame = |node: &Node| {
                let shape = node.dataset(&name).ok().flatten();
                let shape = shape.map(|dataset| dataset.shape().to_vec());
                matches!(shape.as_deref(), Some([t, n, ..]) if Some(*t) == self.frames && *n == count)
            };
            let frame = frame.filter(|_| is_per_frame(&group.node));
            let slice = Slice { frame, ..Slice::ALL };
            finder.add(&group.node, &name, &name, &slice)?;
        }
        finder.join_vectors();
        let part = Part {
            value,
            name: shown(group.node.path()).to_owned(),
            count,
            positions,
            attributes: finder.found,
        };
        Ok((part, finder.left_out))
    }
}

fn first_path(groups: &[PositionGroup]) -> &str {
    groups.first().map_or("", |group| group.node.path())
}

/// A path for a message.
fn shown(path: &str) -> &str {
    if path.is_empty() { "/" } else { path }
}

impl PositionGroup {
    /// Time steps, if there is a dimension for them.
    fn frames(&self) -> Option<u64> {
        match self.positions.as_slice() {
            [data] => match data.stored.shape.as_slice() {
                [frames, _, 2 | 3] if data.field.is_none() => Some(*frames),
                _ => None,
            },
            _ => None,
        }
    }

    /// What is the same for all names of its positions: the data sets, and the places of the fields in their rows.
    fn keys(&self) -> impl Iterator<Item = (ObjectKey, Option<usize>)> {
        let positions = self.positions.iter();
        positions.map(|data| (data.stored.key(), data.field.map(|field| field.offset)))
    }

    /// Number of particles of a step.
    fn count(&self, has_frames: bool) -> u64 {
        let shape = self.positions.first().map(|data| &data.stored.shape);
        let count = shape.and_then(|shape| shape.get(usize::from(has_frames)));
        count.copied().unwrap_or(0)
    }

    /// The positions among the data sets `names` of `node`.
    fn find(node: &Node, names: &[String]) -> Result<Option<Self>, ParseError> {
        let group = |positions| Some(Self { node: node.clone(), positions });
        // One data set with all axes
        for known in POSITION_ARRAYS {
            for name in names.iter().filter(|name| name.eq_ignore_ascii_case(known)) {
                let stored = Stored::open(node, name)?.map(Arc::new);
                if let Some(stored) = stored.filter(|stored| is_position_shape(stored)) {
                    let data = PositionData { stored, field: None };
                    return Ok(group(vec![data]));
                }
            }
        }
        // One for each axis
        for stem in POSITION_STEMS {
            for separator in SEPARATORS {
                let axis = |axis| {
                    let wanted = format!("{stem}{separator}{axis}");
                    names.iter().find(|name| name.eq_ignore_ascii_case(&wanted))
                };
                let (Some(x), Some(y)) = (axis("x"), axis("y")) else {
                    continue;
                };
                let mut positions = Vec::new();
                for name in [Some(x), Some(y), axis("z")].into_iter().flatten() {
                    let stored = open(node, name)?;
                    let is_axis = |stored: &Arc<Stored>| {
                        stored.shape.len() == 1
                            && Field::of(&stored.datatype).is_some_and(|f| f.components == 1)
                    };
                    positions.extend(
                        stored.filter(is_axis).map(|stored| PositionData { stored, field: None }),
                    );
                }
                if positions.len() >= 2 {
                    return Ok(group(positions));
                }
            }
        }
        // Fields of a table
        for name in names {
            let Some(stored) = open(node, name)? else {
                continue;
            };
            let fields = position_fields(&Field::of_compound(&stored.datatype));
            if stored.shape.len() == 1 && !fields.is_empty() {
                let fields = fields
                    .into_iter()
                    .map(|field| PositionData { stored: Arc::clone(&stored), field: Some(field) });
                return Ok(group(fields.collect()));
            }
        }
        Ok(None)
    }
}

/// The data set `name`; `None` also for one that is not read.
fn open(node: &Node, name: &str) -> Result<Option<Arc<Stored>>, ParseError> {
    match Stored::open(node, name) {
        Err(ParseError::Unsupported { .. }) => Ok(None),
        other => Ok(other?.map(Arc::new)),
    }
}

/// Whether a data set may be positions: (N, 3), (N, 2), or time steps of them.
fn is_position_shape(stored: &Stored) -> bool {
    let is_plain = Field::of(&stored.datatype).is_some_and(|field| field.components == 1);
    let is_list = matches!(stored.shape.as_slice(), [_, 2 | 3] | [_, _, 2 | 3]);
    is_plain && is_list
}

/// The fields of a table that are the position.
fn position_fields(fields: &[(String, Field)]) -> Vec<Field> {
    let vector = fields.iter().find(|(name, field)| {
        is_one_of(name, &POSITION_ARRAYS) && matches!(field.components, 2 | 3)
    });
    if let Some((_, field)) = vector {
        return vec![*field];
    }
    let axis = |axis: &str| {
        let found = fields
            .iter()
            .find(|(name, field)| name.eq_ignore_ascii_case(axis) && field.components == 1);
        found.map(|(_, field)| *field)
    };
    match (axis("x"), axis("y")) {
        (Some(x), Some(y)) => [x, y].into_iter().chain(axis("z")).collect(),
        _ => Vec::new(),
    }
}

/// The search for groups with positions.
#[derive(Default)]
struct Search {
    groups: Vec<PositionGroup>,
    visited: HashSet<ObjectKey>,
    /// Data sets of positions.
    positions: HashSet<(ObjectKey, Option<usize>)>,
    /// Data sets with their shapes, for the message.
    datasets: Vec<String>,
}

impl Search {
    /// Looks at a group and those in it, unless it was met before under another name.
    fn visit(&mut self, node: &Node, depth: usize) -> Result<(), ParseError> {
        if self.visited.len() >= MAX_GROUPS || !self.visited.insert(node.key()) {
            return Ok(());
        }
        let (groups, datasets) = node.members()?;
        if let Some(group) = PositionGroup::find(node, &datasets)?
            && group.keys().all(|key| self.positions.insert(key))
        {
            self.groups.push(group);
        }
        if self.groups.is_empty() {
            for name in &datasets {
                let shape = match node.dataset(name) {
                    Ok(Some(dataset)) => format!("{:?}", dataset.shape()),
                    Ok(None) => continue,
                    Err(error) => error.to_string(),
                };
                self.datasets.push(format!("{} {shape}", node.path_of(name)));
            }
        }
        if depth > 0 {
            for name in groups {
                if let Some(group) = node.group(&name)? {
                    self.visit(&group, depth - 1)?;
                }
            }
        }
        Ok(())
    }

    /// The error for a file without positions.
    fn nothing(self) -> ParseError {
        let what = "an HDF5 file of no known layout, and without a data set for positions";
        let found = if self.datasets.is_empty() {
            "no data sets".to_owned()
        } else {
            listed(&self.datasets)
        };
        ParseError::unsupported(format!(
            "{what}; it has {found}; name positions of shape (N, 3) `positions`, or its axes `x`, `y` and `z`"
        ))
    }
}

impl Dialect for PlainFile {
    fn steps(&self, budget: MemoryBudget) -> Result<Vec<StepInfo>, ParseError> {
        let frames = self.frames.unwrap_or(1);
        budget.check(frames.saturating_mul(64), "the list of its steps is")?;
        let is_alone = self.frames.is_none();
        let info = |index| StepInfo {
            number: self.step(0, budget).filter(|_| is_alone && index == 0),
            time: self.time(0, budget).filter(|_| is_alone),
        };
        let count = usize::try_from(frames).unwrap_or(usize::MAX);
        Ok(if is_alone { vec![info(0)] } else { vec![StepInfo::default(); count] })
    }

    fn table(&self, step: usize, budget: MemoryBudget) -> Result<ParticleTable, ParseError> {
        let frames = usize::try_from(self.frames.unwrap_or(1)).unwrap_or(usize::MAX);
        if step >= frames {
            return Err(no_step(step, frames));
        }
        let mut parts = Vec::new();
        for (value, group) in (0..).zip(&self.groups) {
            parts.push(self.part(value, group, step, budget)?.0);
        }
        let table = ParticleTable::new(parts, self.groups.len() > 1);
        Ok(table.at(self.time(step, budget), self.step(step, budget)))
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        let mut paths: Vec<String> = self
            .groups
            .iter()
            .flat_map(|group| &group.positions)
            .map(|data| data.stored.path.clone())
            .collect();
        paths.dedup();
        notes.push(format!("HDF5 of no known layout; positions are {}", listed(&paths)));
        if self.groups.len() > 1 {
            let names = self.groups.iter().map(|group| shown(group.node.path()));
            notes.push(part_names((0..).zip(names)));
        }
        let budget = MemoryBudget::UNLIMITED;
        let left_out: Vec<String> = self
            .groups
            .iter()
            .filter_map(|group| self.part(0, group, 0, budget).ok())
            .flat_map(|(_, left_out)| left_out)
            .collect();
        if !left_out.is_empty() {
            let what = "not one group of numbers for each particle, or not readable, so left out";
            notes.push(format!("{what}: {}", listed(&left_out)));
        }
        notes
    }
}
