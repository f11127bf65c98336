//! How often each picture is shown: frames that are missing between others are held or left out.

use std::collections::BTreeMap;

/// What stands for missing frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Gaps {
    /// The picture before is shown for longer, so that the movie keeps the time of the simulation.
    #[default]
    Hold,
    /// Nothing: the movie jumps.
    Skip,
}

/// Most steps for which one picture stands. Longer gaps are left out.
pub const MAX_HELD: u64 = 100;

/// How often each picture is shown.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Timeline {
    /// For each frame.
    pub repeats: Vec<u32>,
    /// Frames after which the movie has a gap that the picture fills, with the number of missing frames.
    pub held: Vec<(i64, u64)>,
    /// Frames after which the movie jumps, with the number of missing frames.
    pub skipped: Vec<(i64, u64)>,
}

impl Timeline {
    /// The timeline of `frames`, out of `all` planned frames; both ascending. The step of the sequence is the most
    /// frequent difference between planned frames.
    pub fn new(frames: &[i64], all: &[i64], gaps: Gaps) -> Self {
        let step = step(all);
        let mut timeline =
            Self { repeats: vec![1; frames.len()], held: Vec::new(), skipped: Vec::new() };
        for (pair, repeats) in frames.windows(2).zip(&mut timeline.repeats) {
            // Count the frames that are missing between two pictures
            let distance = pair[1].abs_diff(pair[0]);
            let steps = distance.saturating_add(step / 2) / step;
            let missing = steps.saturating_sub(1);
            if missing == 0 {
                continue;
            }
            // Fill the gap with the picture before it, unless it is too long
            let shown = u32::try_from(missing + 1).ok().filter(|_| missing < MAX_HELD);
            match shown.filter(|_| gaps == Gaps::Hold) {
                Some(shown) => {
                    *repeats = shown;
                    timeline.held.push((pair[0], missing));
                }
                None => timeline.skipped.push((pair[0], missing)),
            }
        }
        timeline
    }
}

/// The most frequent difference between consecutive `frames`; the smaller one of equally frequent ones.
fn step(frames: &[i64]) -> u64 {
    let mut counts: BTreeMap<u64, usize> = BTreeMap::new();
    for pair in frames.windows(2) {
        *counts.entry(pair[1].abs_diff(pair[0]).max(1)).or_default() += 1;
    }
    let most = counts.iter().rev().max_by_key(|(_, count)| **count);
    most.map_or(1, |(step, _)| *step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(frames: &[i64], all: &[i64], repeats: &[u32]) -> Timeline {
        let timeline = Timeline::new(frames, all, Gaps::Hold);
        assert_eq!(timeline.repeats, repeats);
        let skipped = Timeline::new(frames, all, Gaps::Skip);
        assert!(skipped.repeats.iter().all(|repeats| *repeats == 1) && skipped.held.is_empty());
        assert_eq!(skipped.skipped.len(), timeline.held.len() + timeline.skipped.len());
        timeline
    }

    #[test]
    fn regular_sequences_have_no_gaps() {
        check(&[], &[], &[]);
        check(&[7], &[7], &[1]);
        let odd = [1, 3, 5, 7, 9];
        assert!(check(&odd, &odd, &[1; 5]).held.is_empty());
        let tens: Vec<i64> = (-3..4).map(|i| 10 * i).collect();
        assert!(check(&tens, &tens, &[1; 7]).held.is_empty());
    }

    #[test]
    fn missing_frames_are_held() {
        // Planned, but missing
        let odd = [1, 3, 5, 7, 9];
        let timeline = check(&[1, 5, 7], &odd, &[2, 1, 1]);
        assert_eq!(timeline.held, [(1, 1)]);
        // Missing in the input already
        let timeline = check(&[1, 2, 3, 7, 8], &[1, 2, 3, 7, 8], &[1, 1, 4, 1, 1]);
        assert_eq!(timeline.held, [(3, 3)]);
    }

    #[test]
    fn long_gaps_are_left_out() {
        let frames = [1, 2, 3, 1000, 1001];
        assert_eq!(check(&frames, &frames, &[1; 5]).skipped, [(3, 996)]);
        let far = [i64::MIN, 0, 1, 2, i64::MAX];
        assert_eq!(check(&far, &far, &[1; 5]).skipped.len(), 2);
    }
}
