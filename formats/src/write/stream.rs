//! Writes particles from a source to a file in pieces: all threads read and convert pieces, which are written
//! in order.

use std::io::{self, Write};
use std::ops::ControlFlow;
use std::path::Path;

use glam::DVec3;
use rayon::prelude::*;
use spherule_files::{Publisher, publish_with};

use crate::FrameError;
use crate::convert::{ConvertError, ParticleSource, Phase, Progress};

/// Particles per piece.
const PIECE: usize = 1 << 14;
/// Pieces that are converted at the same time.
const TOGETHER: usize = 32;

/// The reason why writing ended early.
pub(super) enum WriteError {
    /// An I/O error of the file.
    Io(io::Error),
    /// Any other error, ready to return.
    Told(ConvertError),
}

impl From<io::Error> for WriteError {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}

impl From<FrameError> for WriteError {
    fn from(error: FrameError) -> Self {
        Self::Told(error.into())
    }
}

/// Writes the file `path` with `fill`. The file appears complete or not at all.
pub(super) fn publish_stream(
    path: &Path,
    fill: impl FnOnce(&mut Publisher) -> Result<(), WriteError>,
) -> Result<(), ConvertError> {
    match publish_with(path, fill) {
        Ok(_) => Ok(()),
        Err(WriteError::Io(error)) => Err(FrameError::io(path, error).into()),
        Err(WriteError::Told(error)) => Err(error),
    }
}

/// Writes the bytes that `make` appends for each range of particles, in order.
fn write_pieces(
    file: &mut impl Write,
    count: u64,
    progress: &dyn Progress,
    make: impl Fn(u64, usize, &mut Vec<u8>) -> Result<(), FrameError> + Sync,
) -> Result<(), WriteError> {
    let pieces = count.div_ceil(PIECE as u64);
    let mut made = vec![Vec::new(); TOGETHER];
    for first in (0..pieces).step_by(TOGETHER) {
        let end = pieces.min(first + TOGETHER as u64);
        let used = usize::try_from(end - first).map_or(TOGETHER, |used| used.min(TOGETHER));
        // Convert the pieces in parallel
        let together = made[..used].par_iter_mut().enumerate();
        together.try_for_each(|(number, bytes)| {
            let place = (first + number as u64) * PIECE as u64;
            let len = usize::try_from(count - place).map_or(PIECE, |left| left.min(PIECE));
            bytes.clear();
            make(place, len, bytes)
        })?;
        // Write them in order
        made[..used].iter().try_for_each(|bytes| file.write_all(bytes))?;
        // Report the progress
        let done = count.min(end * PIECE as u64);
        if let ControlFlow::Break(()) = progress.advanced(Phase::Finish, done, count) {
            return Err(WriteError::Told(ConvertError::Interrupted));
        }
    }
    Ok(())
}

/// Writes all positions as f32, converted by `to_bytes`.
pub(super) fn write_positions(
    file: &mut impl Write,
    source: &dyn ParticleSource,
    progress: &dyn Progress,
    to_bytes: impl Fn(f32) -> [u8; 4] + Sync,
) -> Result<(), WriteError> {
    write_pieces(file, source.count(), progress, |first, len, bytes| {
        let mut positions = vec![DVec3::ZERO; len];
        source.read_positions(first, &mut positions)?;
        for position in positions {
            for value in position.as_vec3().to_array() {
                bytes.extend_from_slice(&to_bytes(value));
            }
        }
        Ok(())
    })
}

/// Writes all values of an attribute, big-endian.
pub(super) fn write_values(
    file: &mut impl Write,
    source: &dyn ParticleSource,
    attribute: usize,
    progress: &dyn Progress,
) -> Result<(), WriteError> {
    let own = &source.attributes()[attribute];
    let (width, size) = (own.width(), own.scalar.size());
    write_pieces(file, source.count(), progress, |first, len, bytes| {
        bytes.resize(len * width, 0);
        source.read_values(attribute, first, bytes)?;
        bytes.chunks_exact_mut(size).for_each(<[u8]>::reverse);
        Ok(())
    })
}

/// Writes the result of `bytes_of` for each number below `count`.
pub(super) fn write_numbers<const N: usize>(
    file: &mut impl Write,
    count: u64,
    progress: &dyn Progress,
    bytes_of: impl Fn(u64) -> [u8; N] + Sync,
) -> Result<(), WriteError> {
    write_pieces(file, count, progress, |first, len, bytes| {
        for number in first..first + len as u64 {
            bytes.extend_from_slice(&bytes_of(number));
        }
        Ok(())
    })
}
