//! Reasons why there can be no images.

use crate::manifest::{ManifestError, nearest};
use crate::pipeline::attribute_list;
use crate::scene::{CameraError, PathError};
use crate::survey::Survey;

/// Reasons why there can be no images.
#[derive(Debug, thiserror::Error)]
pub enum ResolveError {
    /// Settings do not go together.
    #[error(transparent)]
    Manifest(#[from] ManifestError),
    /// This version does not support a value.
    #[error("{key}: {what}")]
    Unsupported {
        /// The manifest's key.
        key: &'static str,
        /// The problem and its remedy.
        what: String,
    },
    /// No frame has the requested attribute.
    #[error("{key}: no attribute `{name}` in the sampled frames{hint}; available: {has}")]
    MissingAttribute {
        /// The manifest's key.
        key: &'static str,
        /// Name of the attribute.
        name: String,
        /// A similar name, if there is one.
        hint: String,
        /// The existing attributes.
        has: String,
    },
    /// No frame has a value that a selection needs.
    #[error(
        "{key}: character {column}: no value `{name}` in the sampled frames{hint}; available: {has}"
    )]
    UnknownName {
        /// The key of the condition.
        key: String,
        /// The name in the condition.
        name: String,
        /// Its place in the condition, in characters from 1.
        column: usize,
        /// A similar name, if there is one.
        hint: String,
        /// The existing values.
        has: String,
    },
    /// No frame has a text that a selection compares a value with.
    #[error("{key}: character {column}: {what}")]
    UnknownText {
        /// The key of the condition.
        key: String,
        /// Its place in the condition, in characters from 1.
        column: usize,
        /// The text, and those that there are.
        what: String,
    },
    /// There is no radius in the frames, and no estimate from the spacing of particles.
    #[error(
        "input.radius: the frames contain no radius, and it cannot be estimated from so few, coincident or \
         distant particles"
    )]
    NoRadius,
    /// The radius is too small: squares of lengths would underflow.
    #[error(
        "input.radius: {0:e} is too small to trace in single precision, whose squares end at 1e-38; \
         write the particles in a smaller unit of length"
    )]
    TinyRadius(f32),
    /// The image does not fit into memory.
    #[error(
        "image.width, image.height: an image of {width}x{height} needs about {need} MiB, \
         {available} MiB of memory are free; make it smaller or ask for fewer channels"
    )]
    ImageTooLarge {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// Memory for its planes and encoding.
        need: u64,
        /// Available memory.
        available: u64,
    },
    /// The camera is invalid.
    #[error("camera: {0}")]
    Camera(#[from] CameraError),
    /// The keys do not define a path.
    #[error("camera.key: {0}")]
    Path(#[from] PathError),
    /// The camera is invalid at some frame.
    #[error("{place}: {source}")]
    View {
        /// Key and frame.
        place: String,
        /// The error.
        source: CameraError,
    },
}

/// Refuses the attribute `name`, which `key` names, if no frame has it.
pub(super) fn require_attribute(
    survey: &Survey,
    key: &'static str,
    name: &str,
) -> Result<(), ResolveError> {
    let known = |a: &String| a.eq_ignore_ascii_case(name);
    if survey.most_particles == 0 || survey.attributes.iter().any(known) {
        return Ok(());
    }
    Err(ResolveError::MissingAttribute {
        key,
        name: name.to_owned(),
        hint: similar(name, &survey.attributes),
        has: attribute_list(survey.attributes.iter().map(String::as_str)),
    })
}

/// A question about the attribute that was probably meant.
pub(super) fn similar(name: &str, attributes: &[String]) -> String {
    let known: Vec<&str> = attributes.iter().map(String::as_str).collect();
    nearest(name, &known).map_or_else(String::new, |found| format!(" (did you mean `{found}`?)"))
}
