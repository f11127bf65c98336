//! Why a frame cannot be read.

use spherule_formats::FrameError;

/// Why a frame cannot be drawn.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// Its files cannot be read.
    #[error(transparent)]
    Frame(FrameError),
    /// The same for the last frame of the sequence, which a simulation may be at.
    #[error("{0}; it is the newest frame and may still be being written; render again later")]
    Newest(FrameError),
    /// It would not fit.
    #[error("{file}: the frame needs about {need} MiB, {available} MiB of memory are free")]
    TooLarge {
        /// The frame's first file.
        file: String,
        /// What reading needs, estimated.
        need: u64,
        /// What there is.
        available: u64,
    },
    /// It lacks an attribute that the job needs.
    #[error("{file}: no attribute `{name}` for {purpose}; it has {has}")]
    MissingAttribute {
        /// The frame's first file.
        file: String,
        /// What was looked for.
        name: String,
        /// What for.
        purpose: &'static str,
        /// What there is.
        has: String,
    },
}

/// That an attribute is not among those that the file `has`.
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

/// Names for a message.
pub(crate) fn attribute_list<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let names: Vec<String> = names.map(|n| format!("`{n}`")).collect();
    if names.is_empty() {
        "none".to_owned()
    } else {
        names.join(", ")
    }
}
