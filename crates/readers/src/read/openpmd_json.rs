//! openPMD in JSON, as the library openPMD-api writes it: `data/<iteration>/particles/<species>/<record>/<component>`.
//!
//! Groups are objects. Each has `attributes`, values have also `data`, or `value` and `shape` among their attributes if all
//! are equal. Positions are those that the reader of openPMD in HDF5 gives. Values of the file are parsed where they are
//! needed, group by group.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;
use serde::Deserialize;
use serde_json::value::RawValue;

use super::vtk_xml::short;
use super::{ByteSource, CUT_SHORT, Step};
use crate::format::Format;
use crate::reader::{Confidence, FormatInfo, Reader, ValueNames};
use crate::shared::SharedBytes;
use spherule_frame::join::{PART, Part, join_numbered};
use spherule_frame::{Attribute, AttributeData, MemoryBudget, ParseError, Positions, RawParticles};

/// openPMD in JSON.
pub const FORMAT: Format = Format::new(&OpenPmdJson);

struct OpenPmdJson;

/// Maximum number of records of a species that have one value for all particles: the file does not limit how many numbers
/// they become.
const MAX_CONSTANT: usize = 64;
const POSITION: &str = "position";
const OFFSET: &str = "positionOffset";
const AXES: [&str; 3] = ["x", "y", "z"];

/// A group of the file.
#[derive(Clone, Copy)]
struct Group<'a> {
    text: &'a str,
    /// Place in the file.
    at: usize,
}

/// The members of a group.
type Members<'a> = BTreeMap<String, Group<'a>>;

impl<'a> Group<'a> {
    fn malformed(self, what: impl std::fmt::Display) -> ParseError {
        ParseError::malformed(self.at, what.to_string())
    }

    /// Parses this as a value of type `T`.
    fn parse<T: Deserialize<'a>>(self) -> Result<T, ParseError> {
        serde_json::from_str(self.text).map_err(|error| {
            if error.is_eof() {
                return ParseError::malformed(self.at + self.text.len(), CUT_SHORT);
            }
            self.malformed(format!("bad JSON: {error}"))
        })
    }

    fn members(self) -> Result<Members<'a>, ParseError> {
        let raw: BTreeMap<String, &'a RawValue> = self.parse()?;
        let member = |(name, raw): (String, &'a RawValue)| {
            let text = raw.get();
            (name, Group { text, at: self.at + (text.as_ptr().addr() - self.text.as_ptr().addr()) })
        };
        Ok(raw.into_iter().map(member).collect())
    }

    fn member(self, name: &str) -> Result<Option<Self>, ParseError> {
        Ok(self.members()?.remove(name))
    }

    /// The attribute called `name`. Long ones have their type beside the value.
    fn attribute(self, name: &str) -> Result<Option<Self>, ParseError> {
        let Some(attributes) = self.member("attributes")? else { return Ok(None) };
        let Some(found) = attributes.member(name)? else { return Ok(None) };
        if found.text.starts_with('{') { found.member("value") } else { Ok(Some(found)) }
    }

    /// The attribute as a number, or the first one of a list.
    fn number(self, name: &str) -> Result<Option<f64>, ParseError> {
        let Some(found) = self.attribute(name)? else { return Ok(None) };
        if found.text.starts_with('[') {
            return Ok(found.parse::<Vec<f64>>()?.first().copied());
        }
        found.parse()
    }
}

/// A file with iterations.
struct File<'a> {
    root: Group<'a>,
    iterations: BTreeMap<i64, Group<'a>>,
    /// Names of the species of all iterations.
    species: BTreeSet<String>,
}

impl<'a> File<'a> {
    fn open(bytes: &'a [u8]) -> Result<Self, ParseError> {
        let text = std::str::from_utf8(bytes).map_err(|error| {
            ParseError::malformed(error.valid_up_to(), "the JSON is not text in UTF-8")
        })?;
        let root = Group { text, at: 0 };
        if root.attribute("openPMD")?.is_none() {
            return Err(ParseError::malformed(0, "JSON without the attribute openPMD"));
        }
        let mut file = Self { root, iterations: BTreeMap::new(), species: BTreeSet::new() };
        for (name, group) in
            root.member("data")?.map_or_else(|| Ok(Members::new()), Group::members)?
        {
            if let Ok(number) = name.parse() {
                file.species.extend(species_of(group)?.into_keys());
                file.iterations.insert(number, group);
            }
        }
        if file.species.is_empty() {
            let what = "an openPMD file without particles; meshes are not read";
            return Err(ParseError::unsupported(what));
        }
        Ok(file)
    }

    /// The particles of an iteration.
    fn read(&self, step: &Step, budget: MemoryBudget) -> Result<RawParticles, ParseError> {
        let found = self.iterations.iter().nth(step.index);
        let Some((number, iteration)) = found else {
            return Err(ParseError::malformed(
                0,
                format!("no iteration {} in the file", step.index),
            ));
        };
        let (groups, mut parts, mut left) = (species_of(*iteration)?, Vec::new(), budget);
        for (number, name) in (0..).zip(&self.species) {
            if let Some(group) = groups.get(name) {
                let particles = particles(*group, &mut left)?;
                parts.push(Part { number, name: short(name), particles });
            }
        }
        let mut particles = match (self.species.len(), parts.pop()) {
            (1, Some(part)) => part.particles,
            (_, last) => {
                parts.extend(last);
                join_numbered(parts, left)?
            }
        };
        particles.step = Some(*number);
        let unit = iteration.number("timeUnitSI")?.unwrap_or(1.0);
        particles.time = iteration.number("time")?.map(|time| time * unit);
        Ok(particles)
    }
}

/// The species of an iteration.
fn species_of(iteration: Group<'_>) -> Result<Members<'_>, ParseError> {
    let mut species = match iteration.member("particles")? {
        Some(particles) => particles.members()?,
        None => Members::new(),
    };
    species.retain(|name, _| name != "attributes");
    Ok(species)
}

/// The values of a component, and their unit.
struct Component {
    values: Values,
    unit: f64,
}

enum Values {
    Stored(AttributeData),
    /// All are equal; the number of them, if the file has it.
    Constant(f64, Option<usize>),
}

impl Component {
    /// The values of `group`; `None` if it has none, or none that are numbers in one row.
    fn of(group: Group<'_>, budget: &mut MemoryBudget) -> Result<Option<Self>, ParseError> {
        let members = group.members()?;
        let values = match (members.get("data"), members.get("datatype")) {
            (Some(data), Some(kind)) => {
                stored(*data, &kind.parse::<String>()?, budget)?.map(Values::Stored)
            }
            _ => group.number("value")?.map(|value| Values::Constant(value, None)),
        };
        let Some(mut values) = values else { return Ok(None) };
        if let (Values::Constant(_, count), Some(shape)) = (&mut values, group.attribute("shape")?)
        {
            *count = shape.parse::<Vec<usize>>()?.first().copied();
        }
        Ok(Some(Self { values, unit: group.number("unitSI")?.unwrap_or(1.0) }))
    }

    /// The components of a record in the order of the axes.
    ///
    /// # Errors
    /// One of them has no numbers.
    fn of_axes(
        record: Group<'_>,
        budget: &mut MemoryBudget,
    ) -> Result<[Option<Self>; 3], ParseError> {
        let members = record.members()?;
        let mut found = [None, None, None];
        for (component, axis) in found.iter_mut().zip(AXES) {
            if let Some(group) = members.get(axis) {
                let Some(values) = Self::of(*group, budget)? else {
                    let what = format!("the component {axis} is no real number for each particle");
                    return Err(ParseError::unsupported(what));
                };
                *component = Some(values);
            }
        }
        Ok(found)
    }

    fn at(&self, index: usize) -> f64 {
        match &self.values {
            Values::Stored(data) => data.get_f64(index),
            Values::Constant(value, _) => *value,
        }
    }

    /// The number of values, if they are stored.
    fn stored_count(&self) -> Option<usize> {
        match &self.values {
            Values::Stored(data) => Some(data.len()),
            Values::Constant(..) => None,
        }
    }

    fn is_zero(&self) -> bool {
        matches!(self.values, Values::Constant(0.0, _))
    }

    /// Whether single precision has all values in metres.
    fn is_single(&self) -> bool {
        self.unit == 1.0
            && matches!(&self.values, Values::Stored(data) if data.scalar_type().is_exact_in_f32())
    }

    /// The values of `count` particles.
    fn data(self, count: usize) -> AttributeData {
        match self.values {
            Values::Stored(data) => data,
            Values::Constant(value, _) => AttributeData::F64(vec![value; count]),
        }
    }
}

/// Takes `bytes` for numbers from the budget.
fn spend(budget: &mut MemoryBudget, bytes: usize) -> Result<(), ParseError> {
    budget.check(bytes as u64, "its numbers in memory are")?;
    *budget = budget.less(bytes as u64);
    Ok(())
}

/// The numbers in `data`; `None` if they are of another type than real numbers, or not in one row.
fn stored(
    data: Group<'_>,
    kind: &str,
    budget: &mut MemoryBudget,
) -> Result<Option<AttributeData>, ParseError> {
    // Floating-point numbers take twice their size while they are read, because some are missing
    let count = data.text.bytes().filter(|byte| *byte == b',').count() + 1;
    spend(budget, count * size_of::<Option<f64>>())?;
    if data.text.bytes().filter(|byte| *byte == b'[').count() != 1 {
        return Ok(None);
    }
    Ok(Some(match kind {
        "CHAR" | "SCHAR" => AttributeData::I8(data.parse()?),
        "UCHAR" => AttributeData::U8(data.parse()?),
        "SHORT" => AttributeData::I16(data.parse()?),
        "USHORT" => AttributeData::U16(data.parse()?),
        "INT" => AttributeData::I32(data.parse()?),
        "UINT" => AttributeData::U32(data.parse()?),
        "LONG" | "LONGLONG" => AttributeData::I64(data.parse()?),
        "ULONG" | "ULONGLONG" => AttributeData::U64(data.parse()?),
        "FLOAT" => {
            let values: Vec<Option<f32>> = data.parse()?;
            AttributeData::F32(values.into_iter().map(|value| value.unwrap_or(f32::NAN)).collect())
        }
        "DOUBLE" | "LONG_DOUBLE" => {
            let values: Vec<Option<f64>> = data.parse()?;
            AttributeData::F64(values.into_iter().map(|value| value.unwrap_or(f64::NAN)).collect())
        }
        _ => return Ok(None),
    }))
}

/// The particles of a species.
fn particles(group: Group<'_>, budget: &mut MemoryBudget) -> Result<RawParticles, ParseError> {
    let mut records = group.members()?;
    let Some(position) = records.remove(POSITION) else {
        return Err(group.malformed(format!("particles without the record {POSITION}")));
    };
    let (axes, count) = position_axes(position, records.remove(OFFSET), budget)?;
    spend(budget, count * size_of::<DVec3>())?;
    let position_of = |index: usize| DVec3::from_array(axes.each_ref().map(|axis| axis.at(index)));
    let positions = if axes.iter().all(Axis::is_single) {
        Positions::F32((0..count).map(|index| position_of(index).as_vec3()).collect())
    } else {
        Positions::F64((0..count).map(position_of).collect())
    };
    let mut found = RawParticles { positions, ..RawParticles::default() };
    let mut constant = 0;
    for (name, record) in records {
        if ["attributes", "particlePatches"].contains(&name.as_str()) {
            continue;
        }
        constant += usize::from(!record.text.contains("\"data\""));
        if constant > MAX_CONSTANT {
            let what = format!("more than {MAX_CONSTANT} records of one value");
            return Err(record.malformed(what));
        }
        match attribute(record, count, budget)? {
            Some((components, data)) => {
                found.attributes.push(Attribute { name: short(&name), components, data });
            }
            None => found.notes.push(format!(
                "record `{}` is left out: its values are not real numbers, or not one for each particle",
                short(&name)
            )),
        }
    }
    Ok(found)
}

/// A coordinate: values, and what is added to them.
#[derive(Default)]
struct Axis {
    position: Option<Component>,
    offset: Option<Component>,
}

impl Axis {
    /// The coordinate in metres; 0 without values.
    fn at(&self, index: usize) -> f64 {
        let Some(position) = &self.position else { return 0.0 };
        let value = position.at(index) * position.unit;
        self.offset.as_ref().map_or(value, |offset| value + offset.at(index) * offset.unit)
    }

    fn is_single(&self) -> bool {
        self.offset.is_none() && self.position.as_ref().is_none_or(Component::is_single)
    }
}

/// The coordinates of a species, and the number of its particles.
fn position_axes(
    position: Group<'_>,
    offset: Option<Group<'_>>,
    budget: &mut MemoryBudget,
) -> Result<([Axis; 3], usize), ParseError> {
    let positions = Component::of_axes(position, budget)?;
    let offsets = match offset {
        Some(offset) => Component::of_axes(offset, budget)?,
        None => [None, None, None],
    };
    let mut axes: [Axis; 3] = Default::default();
    for ((axis, position), offset) in axes.iter_mut().zip(positions).zip(offsets) {
        axis.position = position;
        axis.offset = offset.filter(|offset| !offset.is_zero());
    }
    if axes.iter().filter(|axis| axis.position.is_some()).count() < 2 {
        return Err(position.malformed("positions with fewer than two of the components x, y, z"));
    }
    let all = || axes.iter().flat_map(|axis| axis.position.iter().chain(&axis.offset));
    let counts: BTreeSet<usize> = all().filter_map(Component::stored_count).collect();
    let stated = all().find_map(|component| match component.values {
        Values::Constant(_, count) => count,
        Values::Stored(_) => None,
    });
    match (counts.len(), counts.first(), stated) {
        (1, Some(count), _) => Ok((axes, *count)),
        (0, _, None | Some(0)) => Ok((axes, 0)),
        (0, _, Some(count)) => {
            let what = format!("all {count} positions are the same constant");
            Err(position.malformed(what))
        }
        _ => Err(position.malformed(format!("components of {counts:?} values"))),
    }
}

/// The numbers of a record with one value or one vector for each of `count` particles.
fn attribute(
    record: Group<'_>,
    count: usize,
    budget: &mut MemoryBudget,
) -> Result<Option<(usize, AttributeData)>, ParseError> {
    let fits = |found: &Component| found.stored_count().is_none_or(|stored| stored == count);
    spend(budget, 3 * count * size_of::<f64>())?;
    if let Some(scalar) = Component::of(record, budget)? {
        return Ok(fits(&scalar).then(|| (1, scalar.data(count))));
    }
    let components: Vec<Component> = match Component::of_axes(record, budget) {
        Ok(found) => found.into_iter().flatten().collect(),
        Err(ParseError::Unsupported { .. }) => return Ok(None),
        Err(error) => return Err(error),
    };
    if components.is_empty() || !components.iter().all(fits) {
        return Ok(None);
    }
    let columns: Vec<AttributeData> =
        components.into_iter().map(|component| component.data(count)).collect();
    Ok(Some((columns.len(), interleaved(&columns, count))))
}

/// The components of a vector one after another, in double precision unless all have single precision.
#[expect(clippy::cast_possible_truncation, reason = "single precision has them")]
fn interleaved(columns: &[AttributeData], count: usize) -> AttributeData {
    let values = (0..count).flat_map(|i| columns.iter().map(move |column| column.get_f64(i)));
    if columns.iter().all(|column| column.scalar_type().is_exact_in_f32()) {
        return AttributeData::F32(values.map(|value| value as f32).collect());
    }
    AttributeData::F64(values.collect())
}

impl Reader for OpenPmdJson {
    fn info(&self) -> FormatInfo {
        FormatInfo {
            may_hold_many_steps: true,
            notes_need_whole_file: true,
            time_unit: Some("s"),
            ..FormatInfo::new("openpmd-json", &[])
        }
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        let is_object = head.trim_ascii_start().starts_with(b"{");
        let has_version = memchr::memmem::find(head, b"\"openPMD\"").is_some();
        Ok(Confidence::signature_if(is_object && has_version))
    }

    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let (budget, mut steps) = (source.budget(), Vec::new());
        for (key, number) in (0..).zip(File::open(source.bytes())?.iterations.keys()) {
            Step::push_with_key(&mut steps, key, budget)?;
            if let Some(step) = steps.last_mut() {
                step.number = Some(*number);
            }
        }
        Ok(steps)
    }

    fn read(&self, source: &mut ByteSource<'_>, step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        File::open(source.bytes())?.read(step, budget)
    }

    fn value_names(&self, file: &SharedBytes) -> Vec<ValueNames> {
        let Ok(file) = File::open(file) else { return Vec::new() };
        if file.species.len() < 2 {
            return Vec::new();
        }
        let names = (0..).zip(&file.species).map(|(number, name)| (number, short(name)));
        vec![ValueNames { attribute: PART.to_owned(), names: names.collect() }]
    }

    fn notes(&self, bytes: &[u8]) -> Vec<String> {
        let Ok(file) = File::open(bytes) else { return Vec::new() };
        let version = file.root.attribute("openPMD").ok().flatten();
        let version = version.and_then(|version| version.parse::<String>().ok());
        let species: Vec<String> = file.species.iter().map(|name| short(name)).collect();
        vec![
            format!(
                "JSON, openPMD {} with {} iterations; species {}",
                short(&version.unwrap_or_default()),
                file.iterations.len(),
                species.join(", ")
            ),
            "positions m".to_owned(),
            "time s".to_owned(),
        ]
    }
}
