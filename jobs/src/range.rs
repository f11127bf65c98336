//! Frame ranges in the notation of render engines: `7`, `1-10`, `1-10x2`, `10-1x-3`, `-5--2`, `1-5:2`, `1-10y2`,
//! and comma-separated lists of these.
//!
//! The notation is that of Fileseq (`x` is a step, `y` selects the frames that a step skips), except that `:` is a
//! step as in Open Job Description. A range is never expanded in memory: `0-9000000000000000000` needs as much
//! memory as `7`.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// One or more frames, in the requested order; never empty.
///
/// ```
/// use spherule_jobs::FrameRange;
///
/// let frames: FrameRange = "1-10x3,20".parse()?;
/// assert_eq!(frames.iter().collect::<Vec<_>>(), [1, 4, 7, 10, 20]);
/// assert!(frames.contains(7) && !frames.contains(8));
/// # Ok::<(), spherule_jobs::RangeError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct FrameRange {
    parts: Vec<Part>,
}

/// Why a text is not a frame range.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("frame range `{text}`: character {at}: {what}")]
pub struct RangeError {
    /// The text.
    pub text: String,
    /// Position, in characters from 1.
    pub at: usize,
    /// What is wrong.
    pub what: String,
}

/// The range `first-last` with a `step`, whose sign points from `first` to `last`. With `fill`, the frames that the
/// step skips. Contains at least one frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Part {
    first: i64,
    last: i64,
    step: i64,
    fill: bool,
}

impl FrameRange {
    /// The frames in the order of the text, each once. Lazy.
    pub fn iter(&self) -> impl Iterator<Item = i64> + '_ {
        self.parts.iter().enumerate().flat_map(move |(index, part)| {
            let earlier = &self.parts[..index];
            part.iter().filter(move |frame| !earlier.iter().any(|p| p.contains(*frame)))
        })
    }

    /// Whether the range contains `frame`. The time is linear in the number of parts.
    pub fn contains(&self, frame: i64) -> bool {
        self.parts.iter().any(|part| part.contains(frame))
    }

    /// Whether there is more than one frame.
    pub fn has_several(&self) -> bool {
        // Two frames per part are enough. Removing duplicates as `iter` does would take quadratic time
        let mut frames = self.parts.iter().flat_map(|part| part.iter().take(2));
        let first = frames.next();
        frames.any(|frame| Some(frame) != first)
    }

    /// The `available` frames that are in the range, in the order of the range, each once. The time depends on the
    /// length of `available`, not on the size of the range.
    pub fn select(&self, available: &[i64]) -> Vec<i64> {
        let mut found: Vec<(usize, u64, i64)> = available
            .iter()
            .filter_map(|&frame| {
                let part = self.parts.iter().position(|p| p.contains(frame))?;
                Some((part, self.parts[part].first.abs_diff(frame), frame))
            })
            .collect();
        found.sort_unstable();
        found.dedup();
        found.into_iter().map(|(_, _, frame)| frame).collect()
    }

    /// A short ascending range with exactly these frames: `1-3,7-15x4`. None if there are no frames.
    pub fn from_frames(frames: impl IntoIterator<Item = i64>) -> Option<Self> {
        let mut frames: Vec<i64> = frames.into_iter().collect();
        frames.sort_unstable();
        frames.dedup();
        let mut parts = Vec::new();
        let mut rest = frames.as_slice();
        while let [first, tail @ ..] = rest {
            let run = even_run(rest);
            match run {
                Some((step, count)) => {
                    parts.push(Part { first: *first, last: rest[count - 1], step, fill: false });
                    rest = &rest[count..];
                }
                None => {
                    parts.push(Part::single(*first));
                    rest = tail;
                }
            }
        }
        (!parts.is_empty()).then_some(Self { parts })
    }
}

/// Step and length of the evenly spaced run at the start of `frames` (ascending), if it is worth writing as a
/// range: two neighbours, or three frames with a step.
fn even_run(frames: &[i64]) -> Option<(i64, usize)> {
    let step = frames.get(1)?.checked_sub(*frames.first()?)?;
    let pairs =
        frames.windows(2).take_while(|pair| pair[1].checked_sub(pair[0]) == Some(step)).count();
    (step == 1 || pairs >= 2).then_some((step, pairs + 1))
}

impl Part {
    const fn single(frame: i64) -> Self {
        Self { first: frame, last: frame, step: 1, fill: false }
    }

    fn contains(&self, frame: i64) -> bool {
        let inside = (self.first.min(self.last)..=self.first.max(self.last)).contains(&frame);
        let on_step = self.first.abs_diff(frame).is_multiple_of(self.step.unsigned_abs());
        inside && on_step != self.fill
    }

    fn iter(self) -> impl Iterator<Item = i64> {
        let stride = if self.fill { self.step.signum() } else { self.step };
        std::iter::successors(Some(self.first), move |frame| frame.checked_add(stride))
            .take_while(
                move |frame| {
                    if stride > 0 { *frame <= self.last } else { *frame >= self.last }
                },
            )
            .filter(move |frame| self.contains(*frame))
    }
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.first)?;
        if self.first != self.last {
            write!(f, "-{}", self.last)?;
        }
        match (self.fill, self.step) {
            (true, step) => write!(f, "y{step}"),
            (false, 1 | -1) => Ok(()),
            (false, step) => write!(f, "x{step}"),
        }
    }
}

impl fmt::Display for FrameRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, part) in self.parts.iter().enumerate() {
            if index > 0 {
                f.write_str(",")?;
            }
            part.fmt(f)?;
        }
        Ok(())
    }
}

impl FromStr for FrameRange {
    type Err = RangeError;

    fn from_str(text: &str) -> Result<Self, RangeError> {
        let mut scanner = Scanner { text, chars: text.chars().collect(), at: 0 };
        let mut parts = vec![scanner.part()?];
        while scanner.eat(',') {
            parts.push(scanner.part()?);
        }
        match scanner.peek() {
            None => Ok(Self { parts }),
            Some(other) => Err(scanner.error(
                scanner.at,
                format!("unexpected `{other}`; examples: `1-10`, `1-10x2`, `7,9,20`"),
            )),
        }
    }
}

impl TryFrom<String> for FrameRange {
    type Error = RangeError;

    fn try_from(text: String) -> Result<Self, RangeError> {
        text.parse()
    }
}

impl From<FrameRange> for String {
    fn from(range: FrameRange) -> Self {
        range.to_string()
    }
}

struct Scanner<'a> {
    text: &'a str,
    chars: Vec<char>,
    at: usize,
}

impl Scanner<'_> {
    fn error(&self, at: usize, what: impl Into<String>) -> RangeError {
        RangeError { text: self.text.to_owned(), at: at + 1, what: what.into() }
    }

    /// The next character that is not white space.
    fn peek(&mut self) -> Option<char> {
        while self.chars.get(self.at).is_some_and(|c| c.is_whitespace()) {
            self.at += 1;
        }
        self.chars.get(self.at).copied()
    }

    fn eat(&mut self, expected: char) -> bool {
        let found = self.peek() == Some(expected);
        self.at += usize::from(found);
        found
    }

    fn number(&mut self) -> Result<i64, RangeError> {
        let _ = self.peek();
        let start = self.at;
        let sign = usize::from(self.chars.get(start) == Some(&'-'));
        let digits = self.chars[start + sign..].iter().take_while(|c| c.is_ascii_digit()).count();
        if digits == 0 {
            return Err(match self.chars.get(start) {
                None => self.error(start, "a frame number is missing"),
                Some(c) => self.error(start, format!("expected a frame number, found `{c}`")),
            });
        }
        self.at = start + sign + digits;
        let word: String = self.chars[start..self.at].iter().collect();
        word.parse().map_err(|_| self.error(start, format!("{word} does not fit in 64 bits")))
    }

    fn part(&mut self) -> Result<Part, RangeError> {
        let first = self.number()?;
        if !self.eat('-') {
            return Ok(Part::single(first));
        }
        let last = self.number()?;
        // Find the step, or what stands for it
        let fill = match self.peek() {
            Some('x' | ':') => false,
            Some('y') => true,
            _ => {
                return Ok(Part {
                    step: if last < first { -1 } else { 1 },
                    last,
                    ..Part::single(first)
                });
            }
        };
        // Read the step, with its place for errors
        self.at += 1;
        let _ = self.peek();
        let at = self.at;
        let step = self.number()?;
        self.stepped(first, last, step, fill, at)
    }

    fn stepped(
        &self,
        first: i64,
        last: i64,
        step: i64,
        fill: bool,
        at: usize,
    ) -> Result<Part, RangeError> {
        if step == 0 {
            return Err(self.error(at, "the step must not be 0"));
        }
        if step < 0 && first < last {
            return Err(self.error(at, format!("a step of {step} leads away from {last}")));
        }
        if fill && (step.unsigned_abs() == 1 || first == last) {
            return Err(self.error(at, format!("`y{step}` selects no frame")));
        }
        if first == last {
            return Ok(Part::single(first));
        }
        // `10-1x3` counts down just as `10-1` does.
        let step = if last < first && step > 0 { -step } else { step };
        Ok(Part { first, last, step, fill })
    }
}

#[cfg(test)]
mod tests;
