//! Ticks against values that were computed by hand.

use super::*;

fn settings(range: [f64; 2], scale: ColorScale, steps: Option<u32>) -> TickSettings<'static> {
    TickSettings { range, scale, steps, factor: 1.0, choice: None, format: None }
}

/// The labels, `.` for a small mark, and the common exponent.
fn labels(range: [f64; 2], scale: ColorScale, steps: Option<u32>, most: usize) -> (String, i32) {
    let found = settings(range, scale, steps).ticks(most);
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
        ([0.0, 3.7], "0 1 2 3 3.7"),
        ([0.0, 0.35], "0.0 0.1 0.2 0.3 0.35"),
        ([-1.0, 1.0], "−1.0 −0.5 0.0 0.5 1.0"),
        ([-0.3, 0.7], "−0.3 . 0.0 0.2 0.4 . 0.7"),
        ([950.0, 1050.0], "950 975 1000 1025 1050"),
        ([998.1, 1001.9], "998.1 999 1000 1001 1001.9"),
        ([0.012, 0.019], "0.012 0.014 0.016 0.018 0.019"),
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
    let ticks = settings([950.0, 1050.0], ColorScale::Linear, None).ticks(6).ticks;
    let positions: Vec<f64> = ticks.iter().map(|tick| tick.position).collect();
    for (found, expected) in positions.iter().zip([0.0, 0.25, 0.5, 0.75, 1.0]) {
        assert!((found - expected).abs() < 1e-12, "{positions:?}");
    }
    let ticks = settings([0.1, 1000.0], ColorScale::Log, None).ticks(6).ticks;
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
    assert_labels([2.0, 50.0], ColorScale::Log, "2 . . 5 . . . . 10 20 . . 50");
    assert_labels([3.0, 4.2], ColorScale::Log, "3.0 3.5 4.0 4.2");
    // Many decades have labels at equal distances
    assert_labels(
        [1e-12, 1e6],
        ColorScale::Log,
        "10⁻¹² . . . 10⁻⁸ . . . 10⁻⁴ . . . 10⁰ . . . . . 10⁶",
    );
}

#[test]
fn symlog_ticks_have_zero_in_the_middle() {
    let scale = |threshold| ColorScale::SymLog { threshold };
    assert_labels([-10.0, 10.0], scale(0.1), "−10 −1 0 1 10");
    assert_labels([-2.0, 100.0], scale(0.5), "−2 . 0 1 10 100");
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
        let found = settings([low, high], ColorScale::Linear, None).ticks(6);
        assert!(found.ticks.len() <= 103);
    }
}

#[test]
fn both_ends_have_labels() {
    // Few labels: 4000 reaches both ends, 5000 does not
    let pressure = labels([0.0, 8000.0], ColorScale::Linear, None, 3).0;
    assert_eq!(pressure, "0 4000 8000");
    assert_eq!(labels([0.0, 7300.0], ColorScale::Linear, None, 3).0, "0 5000 7300");
    assert_eq!(labels([0.03, 7.834], ColorScale::Linear, None, 5).0, "0.03 2 4 6 7.83");
    let fluid = labels([0.3, 4200.0], ColorScale::Log, None, 8).0;
    assert!(fluid.starts_with("0.3 . . . . . . 1 ") && fluid.ends_with(" . . 4200"), "{fluid}");
    let small = labels([3e-6, 0.2], ColorScale::Log, None, 9).0;
    assert!(small.starts_with("3×10⁻⁶ ") && small.ends_with(" 2×10⁻¹"), "{small}");
    // The common power of ten of a short range is that of its ends, too
    assert_eq!(
        labels([3e-8, 4.2e-8], ColorScale::Log, None, 6),
        ("3.0 3.5 4.0 4.2".to_owned(), -8)
    );
}

#[test]
fn values_are_shown_in_another_unit() {
    let pascal = settings([0.0, 8000.0], ColorScale::Linear, None);
    let texts = |settings: &TickSettings<'_>| -> Vec<String> {
        settings.ticks(6).ticks.into_iter().filter_map(|tick| tick.label).collect()
    };
    assert_eq!(texts(&TickSettings { factor: 1e-3, ..pascal }), ["0", "2", "4", "6", "8"]);
    let format = NumberFormat::parse(".1e");
    let scientific = TickSettings { format, ..pascal };
    assert_eq!(texts(&scientific), ["0.0×10⁰", "2.0×10³", "4.0×10³", "6.0×10³", "8.0×10³"]);
    let format = NumberFormat::parse(",");
    assert_eq!(texts(&TickSettings { format, ..pascal })[4], "8,000");
    let count = TickChoice::Count(2);
    assert_eq!(texts(&TickSettings { choice: Some(&count), ..pascal }), ["0", "8000"]);
}

#[test]
fn ticks_are_where_users_want_them() {
    let choice = TickChoice::Values(vec![7.5, 2.0, -1.0, 9.0, 2.0]);
    let pascal = settings([0.0, 8000.0], ColorScale::Linear, None);
    let kilo = TickSettings { factor: 1e-3, choice: Some(&choice), ..pascal };
    let found = kilo.ticks(6);
    let labels: Vec<&str> = found.ticks.iter().filter_map(|t| t.label.as_deref()).collect();
    assert_eq!(labels, ["2.0", "7.5"]);
    assert_eq!(found.ticks[1].position, 7.5 / 8.0);
    assert_eq!(kilo.outside(), [-1.0, 9.0]);
    // Labels that would overlap are left out
    let close = TickChoice::Values((0..50).map(f64::from).collect());
    let mut close =
        TickSettings { choice: Some(&close), ..settings([0.0, 49.0], pascal.scale, None) }.ticks(6);
    close.thin(0.01, |_| 0.05);
    let count = close.ticks.iter().filter(|tick| tick.label.is_some()).count();
    assert_eq!((close.ticks.len(), count), (50, 9));
}
