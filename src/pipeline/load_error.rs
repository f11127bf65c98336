//! Errors when reading frames.

use spherule_formats::sequence::Sequence;
use spherule_formats::{Attribute, FrameError};
use spherule_frame::grain_columns::GrainColumnError;
use spherule_frame::values::{Named, Value, value_names};

use super::meshes::MeshLoadError;
use crate::selection::UnknownName;

/// Reasons why a frame cannot be rendered.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// Its files cannot be read.
    #[error(transparent)]
    Frame(FrameError),
    /// The same for the last frame of the sequence, which a simulation may be at.
    #[error(
        "{0}; this is the newest frame: if the simulation is still writing it, render again later"
    )]
    Newest(FrameError),
    /// One of its meshes cannot be read.
    #[error(transparent)]
    Mesh(#[from] MeshLoadError),
    /// It does not fit into memory.
    #[error("{file}: the frame needs about {need} MiB, {available} MiB of memory are free")]
    TooLarge {
        /// The frame's first file.
        file: String,
        /// Estimated memory for reading.
        need: u64,
        /// Available memory.
        available: u64,
    },
    /// It lacks an attribute that the job needs.
    #[error("{file}: no attribute `{name}` for {purpose}; it has {has}")]
    MissingAttribute {
        /// The frame's first file.
        file: String,
        /// Name of the attribute.
        name: String,
        /// Its purpose.
        purpose: &'static str,
        /// The attributes of the frame.
        has: String,
    },
    /// It has particles that a table of radii does not list.
    #[error(
        "{file}: input.radius.values has no radius for `{name}` = {value}; add one, such as {value} = 0.5"
    )]
    NoRadius {
        /// The frame's first file.
        file: String,
        /// Name of the attribute.
        name: String,
        /// The value of the attribute.
        value: f64,
    },
    /// It lacks a value that a selection needs.
    #[error("{file}: {key}: character {column}: no value `{name}`; the file has {has}")]
    UnknownName {
        /// The frame's first file.
        file: String,
        /// The key of the condition.
        key: &'static str,
        /// The name.
        name: String,
        /// Its place in the condition, in characters from 1.
        column: usize,
        /// The attributes of the frame.
        has: String,
    },
    /// It lacks a text that a selection compares a value with.
    #[error("{file}: {key}: character {column}: {what}")]
    UnknownText {
        /// The frame's first file.
        file: String,
        /// The key of the condition.
        key: &'static str,
        /// Its place in the condition, in characters from 1.
        column: usize,
        /// The text, and those that there are.
        what: String,
    },
    /// It lacks columns of grains.
    #[error("{file}: style: {fault}")]
    Grains {
        /// The frame's first file.
        file: String,
        /// The fault.
        fault: GrainColumnError,
    },
    /// Its particles are so near each other that there are too many bonds.
    #[error(
        "{file}: bonds.find gives more than 8 bonds for each of {particles} particles, on average; take a shorter \
         distance"
    )]
    TooManyBonds {
        /// The frame's first file.
        file: String,
        /// Number of particles.
        particles: usize,
    },
    /// The camera focuses on a particle that it does not have.
    #[error(
        "{file}: no particle has the id {id}, which camera.focus follows; choose another one, or a distance"
    )]
    NoFocus {
        /// The frame's first file.
        file: String,
        /// The id.
        id: u32,
    },
}

/// The first file of the frame with `index`, for messages.
pub(super) fn first_file(sequence: &Sequence, index: usize) -> String {
    let inputs = sequence.inputs(index);
    inputs.first().map_or_else(String::new, |p| p.display().to_string())
}

/// The error for an attribute that is not among those that the file `has`.
pub(super) fn missing<'a>(
    name: &str,
    purpose: &'static str,
    file: &str,
    has: impl Iterator<Item = &'a str>,
) -> LoadError {
    LoadError::MissingAttribute {
        file: file.to_owned(),
        name: name.to_owned(),
        purpose,
        has: attribute_list(has),
    }
}

/// The error for a value that particles with the columns that the file `has` do not have.
pub(super) fn missing_value<C: Named>(
    name: &str,
    purpose: &'static str,
    file: &str,
    has: &[C],
) -> LoadError {
    let names = value_names(has, |_| true);
    missing(name, purpose, file, names.iter().map(String::as_str))
}

/// The error for a name in a selection that particles with `attributes` have no value for.
pub(super) fn unknown_name(
    unknown: &UnknownName,
    (key, file): (&'static str, &str),
    attributes: &[Attribute],
) -> LoadError {
    if let Some(what) = unknown.text_fault("") {
        let (file, column) = (file.to_owned(), unknown.column);
        return LoadError::UnknownText { file, key, column, what };
    }
    LoadError::UnknownName {
        file: file.to_owned(),
        key,
        name: unknown.name.clone(),
        column: unknown.column,
        has: {
            let names = value_names(attributes, |value| *value != Value::Depth);
            attribute_list(names.iter().map(String::as_str))
        },
    }
}

/// A list of names for a message.
pub(crate) fn attribute_list<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let names: Vec<String> = names.map(|n| format!("`{n}`")).collect();
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}
