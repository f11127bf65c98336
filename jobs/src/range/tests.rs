use super::*;
use proptest::prelude::*;

fn frames(text: &str) -> Vec<i64> {
    text.parse::<FrameRange>().unwrap().iter().collect()
}

#[track_caller]
fn refused(text: &str, at: usize, what: &str) {
    let error = text.parse::<FrameRange>().unwrap_err();
    assert_eq!(error.at, at, "{error}");
    assert!(error.what.contains(what), "{error}");
}

#[test]
fn forms() {
    assert_eq!(frames("7"), [7]);
    assert_eq!(frames("1-1"), [1]);
    assert_eq!(frames("1-4"), [1, 2, 3, 4]);
    assert_eq!(frames("4-1"), [4, 3, 2, 1]);
    assert_eq!(frames("1-10x2"), [1, 3, 5, 7, 9]);
    assert_eq!(frames("1-5:2"), [1, 3, 5]);
    assert_eq!(frames("1-10y2"), [2, 4, 6, 8, 10]);
    assert_eq!(frames("10-1x-3"), [10, 7, 4, 1]);
    assert_eq!(frames("10-1x3"), [10, 7, 4, 1]);
    assert_eq!(frames("-5--2"), [-5, -4, -3, -2]);
    assert_eq!(frames("-2-2:2"), [-2, 0, 2]);
    assert_eq!(frames("7,9,20"), [7, 9, 20]);
    assert_eq!(frames(" 1 - 3 , 8 "), [1, 2, 3, 8]);
    assert_eq!(frames("1-5,3-7,4"), [1, 2, 3, 4, 5, 6, 7]);
}

#[test]
fn errors_name_the_position() {
    refused("", 1, "missing");
    refused("1-", 3, "missing");
    refused("1-5,", 5, "missing");
    refused("1-10z2", 5, "`z`");
    refused("1-10x0", 6, "must not be 0");
    refused("1-10x-3", 6, "away");
    refused("1-10y1", 6, "no frame");
    refused("a", 1, "found `a`");
    refused("1-99999999999999999999", 3, "64 bits");
    refused("1 0", 3, "`0`");
    refused("--3", 1, "frame number");
}

#[test]
fn huge_ranges_stay_small() {
    let all: FrameRange = format!("{}-{}", i64::MIN, i64::MAX).parse().unwrap();
    assert!(all.contains(0) && all.contains(i64::MAX) && all.has_several());
    assert_eq!(all.iter().take(2).collect::<Vec<_>>(), [i64::MIN, i64::MIN + 1]);
    assert_eq!(all.select(&[5, -1, 5]), [-1, 5]);
    let top = format!("{}-{}x5", i64::MAX - 7, i64::MAX);
    assert_eq!(frames(&top), [i64::MAX - 7, i64::MAX - 2]);
}

#[test]
fn select_keeps_the_order_of_the_range() {
    let range: FrameRange = "20,10-1x-3".parse().unwrap();
    assert_eq!(range.select(&[1, 2, 4, 10, 20, 30]), [20, 10, 4, 1]);
}

#[test]
fn frames_become_a_short_range() {
    let text = |f: &[i64]| FrameRange::from_frames(f.iter().copied()).unwrap().to_string();
    assert_eq!(text(&[3, 1, 2, 7, 11, 15]), "1-3,7-15x4");
    assert_eq!(text(&[1, 2]), "1-2");
    assert_eq!(text(&[1, 5]), "1,5");
    assert_eq!(text(&[i64::MIN, i64::MAX]), format!("{},{}", i64::MIN, i64::MAX));
    assert_eq!(FrameRange::from_frames([]), None);
}

/// A random part in one of the valid forms, with frames near `around`.
fn any_part(around: i64) -> impl Strategy<Value = String> {
    let near = move || (-60i64..60).prop_map(move |n| around.saturating_add(n));
    let blank = prop_oneof![Just(""), Just(" ")];
    (near(), near(), 2i64..9, 0..6, blank).prop_map(|(a, b, step, form, blank)| {
        let b = if form == 3 && a == b { a ^ 1 } else { b };
        // A step may point the way that the frames go.
        let towards = if b < a { -step } else { step };
        match form {
            0 => format!("{a}{blank}"),
            1 => format!("{a}{blank}-{b}"),
            2 => format!("{a}-{blank}{b}x{step}"),
            3 => format!("{a}-{b}{blank}y{step}"),
            4 => format!("{a}-{b}:{step}{blank}"),
            _ => format!("{blank}{a}-{b}x{towards}"),
        }
    })
}

/// Lists of parts near zero or near the ends of what fits.
fn any_list() -> impl Strategy<Value = (i64, String)> {
    let around = prop_oneof![4 => Just(0), 1 => Just(i64::MIN), 1 => Just(i64::MAX)];
    around.prop_flat_map(|around| {
        let parts = prop::collection::vec(any_part(around), 1..5);
        parts.prop_map(move |parts| (around, parts.join(",")))
    })
}

proptest! {
    #[test]
    fn display_parses_back((around, text) in any_list()) {
        let range: FrameRange = text.parse().unwrap();
        let again: FrameRange = range.to_string().parse().unwrap();
        prop_assert_eq!(&range, &again);
        let listed: Vec<i64> = range.iter().collect();
        let everything: Vec<i64> = (-70..70).map(|n| around.saturating_add(n)).collect();
        for frame in &everything {
            prop_assert_eq!(range.contains(*frame), listed.contains(frame));
        }
        prop_assert_eq!(range.select(&everything), listed.clone());
        // The same frames by another way.
        let sorted = FrameRange::from_frames(listed.iter().copied()).unwrap();
        prop_assert_eq!(sorted.iter().count(), listed.len());
        prop_assert!(listed.iter().all(|frame| sorted.contains(*frame)));
        let again: FrameRange = sorted.to_string().parse().unwrap();
        prop_assert_eq!(sorted, again);
    }

    #[test]
    fn from_frames_is_exact(mut frames in prop::collection::vec(-40i64..40, 1..30)) {
        let range = FrameRange::from_frames(frames.iter().copied()).unwrap();
        frames.sort_unstable();
        frames.dedup();
        prop_assert_eq!(range.iter().collect::<Vec<_>>(), frames);
    }

    #[test]
    fn any_text_is_answered(text in "[-0-9xy:, a]{0,12}") {
        let _ = text.parse::<FrameRange>();
    }
}

#[test]
fn a_long_list_of_one_frame_is_one_frame() {
    let list = "7,".repeat(100_000);
    let has_several =
        |last: &str| format!("{list}{last}").parse::<FrameRange>().unwrap().has_several();
    assert!(!has_several("7"));
    assert!(!has_several("7-7x2"));
    assert!(!has_several("6-8y2"));
    assert!(has_several("7-8"));
    assert!(has_several("8"));
}
