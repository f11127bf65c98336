//! Notes about a GSD file: what is not in its particles.

use super::file::{GsdFile, GsdHeader, IndexEntry, until_zero};
use super::frame::{BOX, DIAMETER, FIELDS, LOGGED, PARTICLES, STEP, TYPE_SHAPES};
use crate::read::notes::cell_note;
use crate::read::text;
use crate::reader::ValueNames;
use spherule_frame::{Endian, ScalarType};

const TYPES: &str = "particles/types";
const DIMENSIONS: &str = "configuration/dimensions";

/// Most types, or ignored names, that a note lists.
const LISTED: usize = 12;

/// See [`crate::reader::Reader::notes`]. If `bytes` are only the first of a file, its header is all there is to
/// report.
pub(super) fn notes(bytes: &[u8]) -> Vec<String> {
    let mut notes = Vec::new();
    let Ok(header) = GsdHeader::parse(bytes) else {
        return notes;
    };
    notes.push(format!(
        "GSD {}, schema hoomd {}, written by {}",
        header.version,
        header.schema_version,
        text::shown(header.application)
    ));
    let Ok(file) = GsdFile::parse(bytes) else {
        return notes;
    };
    notes.extend(types(&file));
    if file.name(&format!("{PARTICLES}{DIAMETER}")).is_none() {
        let what = "the file has no diameters: all are 1, the default of the schema";
        notes.push(what.to_owned());
    }
    if let Some(sizes) = numbers(&file, BOX) {
        let sizes: Vec<String> = sizes.iter().map(f64::to_string).collect();
        let (lengths, tilts) = sizes.split_at(sizes.len().min(3));
        notes.push(format!(
            "the cell of the first frame is {}, its tilt factors are {}",
            lengths.join(" x "),
            tilts.join(", ")
        ));
        notes.push(cell_note(None));
    }
    if numbers(&file, DIMENSIONS).is_some_and(|d| d == [2.0]) {
        notes.push("the simulation has two dimensions".to_owned());
    }
    notes.extend(ignored(&file));
    notes
}

/// The first chunk called `name`, of whatever frame, and how many there are.
fn find(file: &GsdFile<'_>, name: &str) -> Option<(IndexEntry, usize)> {
    let name = file.name(name)?;
    let entries = (0..).map_while(|index| file.entry(index));
    let mut named = entries.filter(|entry| entry.name == name);
    let first = named.next()?;
    Some((first, 1 + named.count()))
}

/// The names of types, by their numbers in the attribute `typeid`.
pub(super) fn value_names(bytes: &[u8]) -> Option<ValueNames> {
    let file = GsdFile::parse(bytes).ok()?;
    let (entry, _) = find(&file, TYPES)?;
    let width = entry.columns as usize;
    let bytes = file.numbers(&entry).ok().filter(|_| width > 0)?;
    let is_text = matches!(entry.scalar(), Some(ScalarType::I8 | ScalarType::U8));
    let names =
        bytes.chunks(width).map(|row| String::from_utf8_lossy(until_zero(row)).into_owned());
    let names = (0..).zip(names).take(MAX_NAMES).collect();
    is_text.then(|| ValueNames { attribute: "typeid".to_owned(), names })
}

/// Most names; legends have fewer.
const MAX_NAMES: usize = 256;

/// The names behind the numbers of types.
fn types(file: &GsdFile<'_>) -> Option<String> {
    let (entry, count) = find(file, TYPES)?;
    let width = entry.columns as usize;
    let bytes = file.numbers(&entry).ok().filter(|_| width > 0)?;
    let is_text = matches!(entry.scalar(), Some(ScalarType::I8 | ScalarType::U8));
    let rows = bytes.chunks(width).map(until_zero).enumerate();
    let names: Vec<String> = rows
        .take(LISTED)
        .map(|(number, name)| format!("{number} = {}", text::shown(name)))
        .collect();
    let more = if entry.rows > LISTED as u64 { ", ..." } else { "" };
    let changed = match count {
        1 => "",
        _ => "; other frames have other names",
    };
    let names = names.join(", ");
    is_text.then(|| format!("attribute `typeid` has numbers for types: {names}{more}{changed}"))
}

/// The numbers of the first chunk called `name`, if there are not many.
fn numbers(file: &GsdFile<'_>, name: &str) -> Option<Vec<f64>> {
    let (entry, _) = find(file, name)?;
    let bytes = file.numbers(&entry).ok().filter(|bytes| bytes.len() <= 64)?;
    let data = entry.scalar()?.decode(Endian::Little, bytes).ok()?;
    Some((0..data.len()).map(|i| data.get_f64(i)).collect())
}

/// What the file has and the particles have not: topology as a whole, other values by name.
fn ignored(file: &GsdFile<'_>) -> Option<String> {
    let mut all: Vec<String> = Vec::new();
    for name in file.names() {
        let name = String::from_utf8_lossy(name);
        let is_used =
            [STEP, BOX, DIMENSIONS, "particles/N", TYPES, TYPE_SHAPES, "particles/position"]
                .contains(&&*name)
                || name.starts_with(LOGGED)
                || name.starts_with("bonds/")
                || FIELDS.iter().any(|f| name.strip_prefix(PARTICLES) == Some(f.name));
        let shown = match name.split_once('/') {
            _ if is_used => continue,
            Some(("particles", property)) => text::shown(property.as_bytes()),
            Some((group, _)) => text::shown(group.as_bytes()),
            None => text::shown(name.as_bytes()),
        };
        if !all.contains(&shown) {
            all.push(shown);
        }
        // A file may have very many names.
        if all.len() > LISTED {
            all.pop();
            all.push("...".to_owned());
            break;
        }
    }
    (!all.is_empty()).then(|| format!("not used: {}", all.join(", ")))
}
