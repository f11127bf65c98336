//! What the trajectories of GROMACS have in common: frames one after another, each with a header that tells its length.

use memchr::memmem;

use super::Step;
use spherule_frame::{MemoryBudget, ParseError};

/// What the header of a frame tells of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct FrameSummary {
    /// Where the frame ends, perhaps behind the end of the file.
    pub(super) end: usize,
    /// Number of the time step.
    pub(super) number: i32,
    /// ps.
    pub(super) time: f64,
    /// Frames of a trajectory may have velocities or forces alone.
    pub(super) has_positions: bool,
}

/// Lists the frames of `bytes`, whose headers `summary` reads. Where there is no header, what follows up to the next
/// `signature` is one step, so that reading it gives the error and other frames are read.
///
/// # Errors
/// [`ParseError::TooLarge`] if the list is larger than `budget`.
pub(super) fn steps(
    bytes: &[u8],
    signature: &[u8],
    summary: fn(&[u8], usize) -> Result<FrameSummary, ParseError>,
    budget: MemoryBudget,
) -> Result<Vec<Step>, ParseError> {
    let finder = memmem::Finder::new(signature);
    let mut steps = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let found = summary(bytes, at).ok();
        let end = found.map_or_else(
            || {
                let rest = bytes.get(at + 1..).unwrap_or_default();
                finder.find(rest).map_or(bytes.len(), |next| at + 1 + next)
            },
            |frame| frame.end.min(bytes.len()),
        );
        if found.is_none_or(|frame| frame.has_positions) {
            Step::push(&mut steps, at..end, budget)?;
        }
        if let (Some(step), Some(frame)) = (steps.last_mut(), found.filter(|f| f.has_positions)) {
            (step.number, step.time) = (Some(frame.number.into()), Some(frame.time));
        }
        at = end;
    }
    Step::keep_increasing_numbers(&mut steps);
    Ok(steps)
}
