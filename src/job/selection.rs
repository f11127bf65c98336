//! The frames of a run: a range and a shard of the frames of a sequence.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use spherule_formats::Sequence;
use spherule_jobs::{FrameRange, FrameRequest};

use super::RunError;

/// One of several parts of the frames, determined without communication between workers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    index: usize,
    count: usize,
}

/// The text is not a shard.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum ShardError {
    /// It does not have the form `2/4`.
    #[error("expected two whole numbers such as 2/4, the second of four parts")]
    Form,
    /// There is no such part.
    #[error("the part must be from 1 to the number of parts, such as 1/4 to 4/4")]
    Range,
}

impl Shard {
    /// The frames of this shard: every n-th one. All shards get early and late frames, because frames often grow
    /// over a sequence.
    pub fn select(self, frames: &[i64]) -> Vec<i64> {
        let selected = frames.iter().skip(self.index - 1).step_by(self.count);
        selected.copied().collect()
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

impl FromStr for Shard {
    type Err = ShardError;

    /// Parses `2/4`, the second of four parts.
    fn from_str(text: &str) -> Result<Self, ShardError> {
        let (index, count) = text.split_once('/').ok_or(ShardError::Form)?;
        let parse = |text: &str| text.trim().parse().map_err(|_| ShardError::Form);
        let (index, count) = (parse(index)?, parse(count)?);
        if index == 0 || index > count {
            return Err(ShardError::Range);
        }
        Ok(Self { index, count })
    }
}

/// The frames of `sequence` in `range`, or all.
///
/// # Errors
/// [`RunError::NoFrames`].
pub fn frames_in(sequence: &Sequence, range: Option<&FrameRange>) -> Result<Vec<i64>, RunError> {
    let numbers = numbers(sequence);
    let Some(range) = range else {
        return Ok(numbers);
    };
    let selected = range.select(&numbers);
    match FrameRange::from_frames(numbers) {
        Some(available) if selected.is_empty() => {
            Err(RunError::NoFrames { range: range.clone(), available })
        }
        _ => Ok(selected),
    }
}

/// The frames of a run: those in `range` and in `shard`.
pub(super) fn select(
    sequence: &Sequence,
    range: Option<&FrameRange>,
    shard: Option<Shard>,
) -> Vec<i64> {
    let numbers = numbers(sequence);
    let selected = match range {
        Some(range) => range.select(&numbers),
        None => numbers,
    };
    match shard {
        Some(shard) => shard.select(&selected),
        None => selected,
    }
}

/// Requests for all frames of `sequence`; `companions` returns further files that the images of a frame depend on beside
/// the topology and the files that its inputs refer to, `outputs` the output files.
pub(super) fn frame_requests(
    sequence: &Sequence,
    companions: impl Fn(i64) -> Vec<PathBuf>,
    outputs: impl Fn(i64) -> Vec<PathBuf>,
) -> Vec<FrameRequest> {
    let references = sequence.references();
    let request = |(index, number)| {
        let inputs = sequence.inputs(index);
        let topology = sequence.topology().map(|topology| topology.path().to_owned());
        let referenced = inputs.iter().filter_map(|path| references.get(path)).flatten().cloned();
        let beside = topology.into_iter().chain(referenced);
        FrameRequest {
            number,
            companions: beside.chain(companions(number)).collect(),
            inputs: inputs.into_iter().map(Path::to_owned).collect(),
            outputs: outputs(number),
        }
    };
    numbers(sequence).into_iter().enumerate().map(request).collect()
}

/// The numbers and indices of the `frames` that are in `sequence`.
pub(super) fn indices<'a>(
    sequence: &'a Sequence,
    frames: &'a [i64],
) -> impl Iterator<Item = (i64, usize)> + 'a {
    let all = sequence.frames();
    frames.iter().filter_map(move |number| {
        let index = all.binary_search_by_key(number, |f| f.number).ok()?;
        Some((*number, index))
    })
}

fn numbers(sequence: &Sequence) -> Vec<i64> {
    sequence.frames().iter().map(|f| f.number).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn invalid_parts_are_rejected() {
        assert_eq!("2/3".parse::<Shard>().unwrap().select(&[5, 6, 7, 8, 9]), [6, 9]);
        assert!("4/4".parse::<Shard>().unwrap().select(&[1, 2]).is_empty());
        for text in ["", "1", "0/2", "3/2", "1/0", "-1/2", "a/b", "1/2/3", "1.5/2"] {
            assert!(text.parse::<Shard>().is_err(), "{text}");
        }
    }

    proptest! {
        #[test]
        fn all_shards_together_have_every_frame_once(count in 1usize..20, total in 0i64..200) {
            let frames: Vec<i64> = (-5..total).collect();
            let mut all: Vec<i64> = (1..=count)
                .flat_map(|index| Shard { index, count }.select(&frames))
                .collect();
            all.sort_unstable();
            prop_assert_eq!(all, frames);
        }
    }
}
