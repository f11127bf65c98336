//! The time steps of a file.

use std::ops::Range;

use spherule_frame::{MemoryBudget, ParseError};

/// One time step of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Step {
    /// Index among the steps of the file, from 0.
    pub index: usize,
    /// Step number in the file (LAMMPS `TIMESTEP`), if there is one.
    pub number: Option<i64>,
    /// Simulation time in the file, if it is cheap to find.
    pub time: Option<f64>,
    handle: StepHandle,
}

/// How a reader finds a step again. Only the reader that created it can interpret it.
#[derive(Debug, Clone, PartialEq)]
enum StepHandle {
    /// The step is one range of bytes.
    Bytes(Range<usize>),
    /// A number that the reader chose, such as an index into an array of frames or the address of a group.
    Key(u64),
}

impl Step {
    /// Step `index` in the bytes `range` of the file.
    pub const fn at_bytes(index: usize, range: Range<usize>) -> Self {
        Self::new(index, StepHandle::Bytes(range))
    }

    /// Step `index`, which its reader finds again by `key`.
    pub const fn with_key(index: usize, key: u64) -> Self {
        Self::new(index, StepHandle::Key(key))
    }

    /// The only step of a file of `len` bytes.
    pub const fn whole(len: usize) -> Self {
        Self::at_bytes(0, 0..len)
    }

    const fn new(index: usize, handle: StepHandle) -> Self {
        Self { index, number: None, time: None, handle }
    }

    /// Appends a step with the bytes `range` to the steps of a file.
    ///
    /// # Errors
    /// [`ParseError::TooLarge`] if the list needs more memory than `budget` allows.
    pub fn push(
        steps: &mut Vec<Self>,
        range: Range<usize>,
        budget: MemoryBudget,
    ) -> Result<(), ParseError> {
        Self::push_new(steps, StepHandle::Bytes(range), budget)
    }

    /// [`Self::push`] of a step that its reader finds again by `key`.
    ///
    /// # Errors
    /// As [`Self::push`].
    pub fn push_with_key(
        steps: &mut Vec<Self>,
        key: u64,
        budget: MemoryBudget,
    ) -> Result<(), ParseError> {
        Self::push_new(steps, StepHandle::Key(key), budget)
    }

    fn push_new(
        steps: &mut Vec<Self>,
        handle: StepHandle,
        budget: MemoryBudget,
    ) -> Result<(), ParseError> {
        // `Sequence` makes its own copy of the list.
        let need = 4 * size_of::<Self>() * (steps.len() + 1);
        budget.check(need as u64, "the list of its steps is")?;
        steps.push(Self::new(steps.len(), handle));
        Ok(())
    }

    /// Removes the numbers of `steps` unless each is greater than the one before. Files that were joined after a
    /// restart have some twice.
    pub fn keep_increasing_numbers(steps: &mut [Self]) {
        if !steps.is_sorted_by(|a, b| a.number < b.number) {
            steps.iter_mut().for_each(|step| step.number = None);
        }
    }

    /// The bytes of the uncompressed file that hold the step, if they are one range.
    pub const fn byte_range(&self) -> Option<&Range<usize>> {
        match &self.handle {
            StepHandle::Bytes(range) => Some(range),
            StepHandle::Key(_) => None,
        }
    }

    /// Offset of the first byte of the step; 0 if the step is not one range of bytes.
    pub fn start(&self) -> usize {
        self.byte_range().map_or(0, |range| range.start)
    }

    /// Ends the byte range of the step at `end`.
    pub fn end_at(&mut self, end: usize) {
        if let StepHandle::Bytes(range) = &mut self.handle {
            range.end = end;
        }
    }

    /// The key of [`Self::with_key`], or the index for a step without one.
    pub const fn key(&self) -> u64 {
        match self.handle {
            StepHandle::Bytes(_) => self.index as u64,
            StepHandle::Key(key) => key,
        }
    }
}
