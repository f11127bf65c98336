//! Notes about the frames of a sequence: gaps in the numbering, missing parts.

use std::collections::BTreeMap;

use super::SequenceFrame;

/// Notes where the numbering jumps by more than it usually does.
pub(super) fn note_gaps(frames: &[SequenceFrame], notes: &mut Vec<String>) {
    const SHOWN: usize = 5;
    let pairs = || frames.windows(2).map(|w| (w[0].number, w[1].number));
    let mut strides = BTreeMap::<i64, usize>::new();
    for (a, b) in pairs() {
        *strides.entry(b.saturating_sub(a)).or_default() += 1;
    }
    // The most frequent one, the smallest of equals.
    let usual = strides.iter().max_by_key(|(stride, count)| (**count, std::cmp::Reverse(**stride)));
    let Some((usual, _)) = usual else { return };
    let gaps: Vec<String> = pairs()
        .filter(|(a, b)| b.saturating_sub(*a) > *usual)
        .map(|(a, b)| format!("{a} to {b}"))
        .collect();
    if gaps.is_empty() {
        return;
    }
    let more = match gaps.len().saturating_sub(SHOWN) {
        0 => String::new(),
        more => format!(" and {more} times more"),
    };
    let shown = gaps[..gaps.len().min(SHOWN)].join(", ");
    notes.push(format!("frame numbers go up by {usual}, but jump from {shown}{more}"));
}

pub(super) fn note_missing_parts(
    frames: &[SequenceFrame],
    parts: &[String],
    notes: &mut Vec<String>,
) {
    if parts.len() < 2 {
        return;
    }
    // Frames that have a part, in their order; a frame may have several steps of one.
    let mut present: Vec<Vec<usize>> = vec![Vec::new(); parts.len()];
    for (place, frame) in frames.iter().enumerate() {
        for part in &frame.parts {
            if let Some(places) = present.get_mut(part.part as usize)
                && places.last() != Some(&place)
            {
                places.push(place);
            }
        }
    }
    // Note the frames that lack each part
    for (name, present) in parts.iter().zip(present) {
        if present.len() == frames.len() {
            continue;
        }
        let mut present = present.into_iter().peekable();
        let missing: Vec<i64> = frames
            .iter()
            .enumerate()
            .filter(|(place, _)| present.next_if_eq(place).is_none())
            .map(|(_, frame)| frame.number)
            .collect();
        notes.push(format!(
            "part `{name}` is missing in {} of {} frames: {}",
            missing.len(),
            frames.len(),
            ranges(&missing)
        ));
    }
}

/// Sorted numbers as `1-4, 7`; long lists are cut.
pub(super) fn ranges(numbers: &[i64]) -> String {
    const SHOWN: usize = 8;
    let mut runs: Vec<(i64, i64)> = Vec::new();
    for &number in numbers {
        match runs.last_mut() {
            Some((_, last)) if number == *last || Some(number) == last.checked_add(1) => {
                *last = number;
            }
            _ => runs.push((number, number)),
        }
    }
    let text = |(first, last): &(i64, i64)| {
        if first == last { first.to_string() } else { format!("{first}-{last}") }
    };
    let mut texts: Vec<String> = runs.iter().take(SHOWN).map(text).collect();
    if runs.len() > SHOWN {
        texts.push("...".to_owned());
    }
    texts.join(", ")
}
