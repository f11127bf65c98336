//! Ticks against values that were computed by hand.

use super::*;

/// The labels, `.` for a small mark, and the common exponent.
fn labels(range: [f64; 2], scale: ColorScale, steps: Option<u32>, most: usize) -> (String, i32) {
    let found = Ticks::of(range, scale, steps, most);
    let texts = found.ticks.iter().map(|tick| tick.label.as_deref().unwrap_or("."));
    assert!(found.ticks.is_sorted_by(|a, b| a.position < b.position), "{found:?}");
    (texts.collect::<Vec<_>>().join(" "), found.exponent)
}

#[track_caller]
fn assert_labels(range: [f64; 2], scale: ColorScale, expected: &str) {
    assert_eq!(labels(range, scale, None, 6).0, expected, "{range:?}");
}

#[test]
fn linear_ticks_are_round() {
    for (range, expected) in [
        ([0.0, 4.0], "0 1 2 3 4"),
        ([0.0, 3.7], "0 1 2 3"),
        ([0.0, 0.35], "0.0 0.1 0.2 0.3"),
        ([-1.0, 1.0], "−1.0 −0.5 0.0 0.5 1.0"),
        ([-0.3, 0.7], "−0.2 0.0 0.2 0.4 0.6"),
        ([950.0, 1050.0], "960 980 1000 1020 1040"),
        ([998.1, 1001.9], "999 1000 1001"),
        ([0.012, 0.019], "0.012 0.014 0.016 0.018"),
        ([0.0, 30_000.0], "0 10000 20000 30000"),
    ] {
        assert_labels(range, ColorScale::Linear, expected);
    }
}

#[test]
fn large_and_small_values_have_a_common_exponent() {
    let linear = |low, high| labels([low, high], ColorScale::Linear, None, 6);
    assert_eq!(linear(0.0, 4e5), ("0 1 2 3 4".to_owned(), 5));
    assert_eq!(linear(-2e-7, 4e-7), ("−2 0 2 4".to_owned(), -7));
    assert_eq!(linear(0.0, 1.5e300), ("0.0 0.5 1.0 1.5".to_owned(), 300));
    assert_eq!(power_text(-12), "10⁻¹²");
    assert_eq!(power_text(34_567_890), "10³⁴⁵⁶⁷⁸⁹⁰");
}

#[test]
fn positions_are_fractions_of_the_range() {
    let ticks = Ticks::of([950.0, 1050.0], ColorScale::Linear, None, 6).ticks;
    let positions: Vec<f64> = ticks.iter().map(|tick| tick.position).collect();
    for (found, expected) in positions.iter().zip([0.1, 0.3, 0.5, 0.7, 0.9]) {
        assert!((found - expected).abs() < 1e-12, "{positions:?}");
    }
    let ticks = Ticks::of([0.1, 1000.0], ColorScale::Log, None, 6).ticks;
    let labelled = ticks.iter().filter(|tick| tick.label.is_some());
    let positions: Vec<f64> = labelled.map(|tick| tick.position).collect();
    for (found, expected) in positions.iter().zip([0.0, 0.25, 0.5, 0.75, 1.0]) {
        assert!((found - expected).abs() < 1e-12, "{positions:?}");
    }
}

#[test]
fn log_ticks_are_powers_of_ten() {
    let small = ". . . . . . . .";
    assert_labels([0.1, 100.0], ColorScale::Log, &format!("0.1 {small} 1 {small} 10 {small} 100"));
    assert_labels([1e-6, 1e-4], ColorScale::Log, &format!("10⁻⁶ {small} 10⁻⁵ {small} 10⁻⁴"));
    assert_labels([2.0, 50.0], ColorScale::Log, "2 5 10 20 50");
    assert_labels([3.0, 4.2], ColorScale::Log, "3.0 3.5 4.0");
    // Many decades have labels at equal distances
    assert_labels(
        [1e-12, 1e6],
        ColorScale::Log,
        "10⁻¹² . . . 10⁻⁸ . . . 10⁻⁴ . . . 10⁰ . . . 10⁴ . .",
    );
}

#[test]
fn symlog_ticks_have_zero_in_the_middle() {
    let scale = |threshold| ColorScale::SymLog { threshold };
    assert_labels([-10.0, 10.0], scale(0.1), "−10 −1 0 1 10");
    assert_labels([-2.0, 100.0], scale(0.5), "−1 0 1 10 100");
    assert_labels([-1e6, 1e6], scale(1.0), "−10⁶ −10⁴ 0 10⁴ 10⁶");
}

#[test]
fn bands_have_ticks_at_their_borders() {
    let bands = |range, scale, steps, most| labels(range, scale, Some(steps), most).0;
    assert_eq!(bands([0.0, 4.0], ColorScale::Linear, 4, 8), "0 1 2 3 4");
    assert_eq!(bands([0.0, 1.0], ColorScale::Linear, 8, 5), "0.00 . 0.25 . 0.50 . 0.75 . 1.00");
    assert_eq!(bands([1.0, 100.0], ColorScale::Log, 2, 8), "1 10 100");
    // A prime number of bands: first and last
    assert_eq!(bands([0.0, 7.0], ColorScale::Linear, 7, 4), "0 . . . . . . 7");
}

#[test]
fn unusual_ranges_have_a_tick_or_none() {
    assert_eq!(labels([3.0, 3.0], ColorScale::Linear, None, 6), ("3".to_owned(), 0));
    assert_eq!(labels([0.0, 0.0], ColorScale::Linear, None, 6), ("0".to_owned(), 0));
    for (low, high) in [(0.0, 5e-324), (-1.7e308, 1.7e308), (1.0, 1.0 + f64::EPSILON)] {
        let found = Ticks::of([low, high], ColorScale::Linear, None, 6);
        assert!(found.ticks.len() <= 101);
    }
}
