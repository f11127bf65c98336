//! Movies and contact sheets of finished pictures: MP4, MOV, MKV and WebM by an installed `ffmpeg`; GIF, animated PNG
//! and animated WebP without it.
//!
//! The caller lists files with their frame numbers; this module knows neither jobs nor printing. A movie appears
//! complete under its name or not at all.

use std::ffi::OsString;
use std::io;
use std::path::{Path, PathBuf};

use spherule_files::Publisher;
use thiserror::Error;

use crate::file::ImageReadError;
use crate::picture::Picture;

mod apng;
mod codec;
mod ffmpeg;
mod format;
mod gif;
mod letters;
mod palette;
mod panels;
mod rate;
mod sheet;
mod sheet_layout;
mod source;
mod timeline;
mod webp;

pub use codec::{Codec, CodecError};
pub use ffmpeg::{FFMPEG, by_hand, ffmpeg_is_installed};
pub use format::{Container, FormatError, MovieFormat};
pub use letters::{LetterStyle, LetterStyleError};
pub use rate::{FrameRate, FrameRateError};
pub use sheet::{FinishedSheet, write_sheet};
pub use sheet_layout::{SheetBar, SheetFormat, SheetLayout, SheetSettings, SheetSource};
pub use source::MovieSource;
pub use timeline::{Gaps, MAX_HELD, Timeline};

/// A finished movie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FinishedMovie {
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// Number of pictures, each counted as often as it is shown.
    pub shown: u64,
    /// Length of the file in bytes.
    pub bytes: u64,
}

/// Why a movie or a sheet cannot be written.
#[derive(Debug, Error)]
pub enum MovieError {
    /// There are no pictures.
    #[error("there are no pictures")]
    Empty,
    /// A picture cannot be read.
    #[error(transparent)]
    Picture(#[from] ImageReadError),
    /// A picture has another size than the first.
    #[error("{}: has {}x{} pixels, but the first picture has {}x{}", path.display(), found[0], found[1],
        expected[0], expected[1])]
    OtherSize {
        /// The picture.
        path: PathBuf,
        /// Its size.
        found: [usize; 2],
        /// The size of the first picture.
        expected: [usize; 2],
    },
    /// The format cannot have pictures of this size.
    #[error("{format} cannot have {}x{} pixels; choose another width or format", size[0], size[1])]
    TooLarge {
        /// The format.
        format: &'static str,
        /// The size.
        size: [usize; 2],
    },
    /// The colour bar needs more than half of a sheet.
    #[error(
        "a sheet of {width} pixels has no room for the colour bar beside its pictures; make it wider, or put \
         the bar below"
    )]
    NoRoom {
        /// Width of the sheet, pixels.
        width: usize,
    },
    /// There is no program `ffmpeg`.
    #[error("{FFMPEG} is not installed")]
    NoFfmpeg,
    /// `ffmpeg` has failed.
    #[error("{FFMPEG} has failed ({status}): {}", lines.join(" | "))]
    Ffmpeg {
        /// How it ended.
        status: String,
        /// Its last lines on standard error.
        lines: Vec<String>,
    },
    /// The file cannot be written, or `ffmpeg` cannot be started.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or the program.
        path: PathBuf,
        /// The error of the system.
        source: io::Error,
    },
    /// Stopped on request.
    #[error("stopped")]
    Stopped,
}

/// Progress of a movie, and requests to stop it.
pub trait Observer {
    /// Whether to stop. It is called often.
    fn stops(&self) -> bool;

    /// `done` of all pictures are read.
    fn on_picture(&self, done: usize);
}

/// Writes a movie to `path`, where it replaces an older file.
///
/// # Errors
/// See [`MovieError`]. There is no new file then.
pub fn write_movie(
    source: &MovieSource,
    format: MovieFormat,
    path: &Path,
    observer: &dyn Observer,
) -> Result<FinishedMovie, MovieError> {
    let io = |source| MovieError::Io { path: path.to_owned(), source };
    // Check the size, which all pictures have
    let first = source.first()?;
    let [width, height] = first.size();
    let size = format.padded([width, height]);
    if size.iter().any(|side| *side > format.max_side()) {
        return Err(MovieError::TooLarge { format: format.name(), size });
    }
    // Write it to a temporary file, which then replaces the older one
    let mut file = Publisher::create(path).map_err(io)?;
    match format {
        MovieFormat::Ffmpeg { container, codec } => {
            ffmpeg::write(source, size, container, codec, &file, observer)?;
        }
        MovieFormat::Gif => gif::write(source, &mut file, observer)?,
        MovieFormat::Apng => apng::write(source, &mut file, observer)?,
        MovieFormat::WebP => webp::write(source, &mut file, observer)?,
    }
    let bytes = file.commit().map_err(io)?;
    Ok(FinishedMovie { size, shown: source.shown(), bytes })
}

/// The commands of a shell that install `ffmpeg`, by system.
pub const INSTALL: &str = "Debian, Ubuntu: sudo apt install ffmpeg; Fedora: sudo dnf install ffmpeg-free; \
                           macOS: brew install ffmpeg; Windows: winget install ffmpeg";

/// Arguments as a line for a shell.
fn shell_line(arguments: &[OsString]) -> String {
    let quoted = arguments.iter().map(|argument| quoted(&argument.to_string_lossy()));
    quoted.collect::<Vec<_>>().join(" ")
}

/// `text` for a POSIX shell.
fn quoted(text: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "_-+=:,./@".contains(c);
    if !text.is_empty() && text.chars().all(is_plain) {
        return text.to_owned();
    }
    format!("'{}'", text.replace('\'', r"'\''"))
}

/// Whether the pixels of `picture` differ from those before, as rectangle: left, top, right and bottom, the last two
/// exclusive. None if there is no difference.
fn changed<T: PartialEq>(before: &[T], now: &[T], width: usize) -> Option<[usize; 4]> {
    let rows = || before.chunks(width).zip(now.chunks(width)).enumerate();
    let mut differing = rows().filter(|(_, (before, now))| before != now).map(|(y, _)| y);
    let top = differing.next()?;
    let bottom = differing.last().unwrap_or(top) + 1;
    let mut bounds = [width, top, 0, bottom];
    for (_, (before, now)) in rows().skip(top).take(bottom - top) {
        let mut columns = before.iter().zip(now);
        let Some(first) = columns.position(|(before, now)| before != now) else {
            continue;
        };
        let mut columns = before.iter().zip(now);
        let last = columns.rposition(|(before, now)| before != now).unwrap_or(first);
        bounds[0] = bounds[0].min(first);
        bounds[2] = bounds[2].max(last + 1);
    }
    Some(bounds)
}

impl Observer for () {
    fn stops(&self) -> bool {
        false
    }

    fn on_picture(&self, _: usize) {}
}

/// A part of `picture`: left, top, right and bottom, the last two exclusive.
fn part(picture: &Picture, [left, top, right, bottom]: [usize; 4]) -> Picture {
    let rows = (top..bottom).flat_map(|y| &picture.row(y)[3 * left..3 * right]);
    Picture::new(right - left, bottom - top, rows.copied().collect())
}

#[cfg(test)]
mod tests;
