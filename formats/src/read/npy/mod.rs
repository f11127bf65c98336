//! Arrays saved by numpy: NPY (one array) and NPZ (a zip of them).
//!
//! `header` says what an array is, `layout` where its particles are, `archive` looks through an NPZ;
//! the shared column reader decodes. Nothing is ever unpickled: a pickle is a program. The header
//! parser is our own because `npyz` allocates what a damaged header asks for and brings a parser
//! generator and big integers with it for one dictionary. After NEP 1 and `numpy/lib/format.py`.

mod archive;
mod dtype;
mod header;
mod layout;
mod literal;
mod member;
#[cfg(test)]
mod tests;

use self::header::Header;
use self::layout::Layout;
use super::Step;
use super::columns::ParticleLayout;
use crate::{MemoryBudget, ParseError, RawParticles};

/// The time steps that `bytes` hold: as many as the first dimension of (frames, N, 3), else one.
///
/// # Errors
/// [`ParseError::Malformed`] for damaged files; [`ParseError::Unsupported`] for pickled objects and
/// for arrays that are no positions, saying what to save instead.
/// [`ParseError::TooLarge`] if the times, a member of an archive, need more than `budget`.
pub(crate) fn steps(bytes: &[u8], budget: MemoryBudget) -> Result<Vec<Step>, ParseError> {
    if archive::is_zip(bytes) {
        return archive::Archive::open(bytes)?.steps(budget);
    }
    let header = Header::parse(bytes)?;
    header.check_items(bytes.len())?;
    Ok(layout_steps(&Layout::of(&header)?, bytes.len()))
}

/// Reads one of the [`steps`].
///
/// Positions keep their precision; two coordinates lie in the plane z = 0. Numeric fields of a
/// structured array, and numeric members of an archive with one entry a particle, become attributes.
///
/// # Errors
/// As [`steps`]; [`ParseError::Malformed`] if there is no such step.
pub(crate) fn read(
    bytes: &[u8],
    step: &Step,
    budget: MemoryBudget,
) -> Result<RawParticles, ParseError> {
    if archive::is_zip(bytes) {
        return archive::Archive::open(bytes)?.read(step.index, budget);
    }
    let header = Header::parse(bytes)?;
    read_array(bytes, &header, step.index)
}

/// Where the particles of an array of one step are; none for archives and for several steps.
///
/// # Errors
/// As [`read`].
pub(crate) fn layout(bytes: &[u8]) -> Result<Option<ParticleLayout>, ParseError> {
    if archive::is_zip(bytes) {
        return Ok(None);
    }
    let header = Header::parse(bytes)?;
    header.check_items(bytes.len())?;
    match Layout::of(&header)?.frames {
        None | Some(1) => array_layout(bytes.len(), &header, 0).map(Some),
        Some(_) => Ok(None),
    }
}

/// The particles of one array in step `frame`.
fn read_array(bytes: &[u8], header: &Header, frame: usize) -> Result<RawParticles, ParseError> {
    array_layout(bytes.len(), header, frame)?.particles(bytes)
}

/// Where they are, in a file of `len` bytes.
fn array_layout(len: usize, header: &Header, frame: usize) -> Result<ParticleLayout, ParseError> {
    header.check_items(len)?;
    let layout = Layout::of(header)?;
    check_frame(&layout, frame)?;
    layout.columns(header, frame)
}

fn check_frame(layout: &Layout, frame: usize) -> Result<(), ParseError> {
    let frames = layout.frames.unwrap_or(1);
    if frame < frames {
        return Ok(());
    }
    Err(ParseError::malformed(
        0,
        format!("step {frame} is not among the {frames} of the file"),
    ))
}

/// All steps share one header, so each spans the whole file.
fn layout_steps(layout: &Layout, len: usize) -> Vec<Step> {
    (0..layout.frames.unwrap_or(1))
        .map(|index| Step {
            index,
            ..Step::whole(len)
        })
        .collect()
}
