//! Ticks and ranges.

use super::axis::Axis;

#[track_caller]
fn labels(axis: &Axis, low: f64, high: f64) -> Vec<String> {
    let span = axis.span(axis.place(low), axis.place(high), 5.0);
    for pair in span.ticks.windows(2) {
        assert!(pair[0].0 < pair[1].0 && pair[0].1 != pair[1].1, "{span:?}");
    }
    for (at, _) in &span.ticks {
        let slack = 1e-9 * (span.high - span.low);
        assert!(*at >= span.low - slack && *at <= span.high + slack, "{span:?}");
    }
    assert!(span.low < span.high && !span.ticks.is_empty(), "{span:?}");
    span.ticks.into_iter().map(|(_, label)| label).collect()
}

#[test]
fn ticks_are_round_numbers() {
    let axis = Axis::linear("t, s");
    assert_eq!(labels(&axis, 0.0, 1.0), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
    assert_eq!(labels(&axis, -3.0, 7.0), ["\u{2212}2", "0", "2", "4", "6"]);
    assert_eq!(labels(&axis, 0.0, 4e6), ["0", "1e6", "2e6", "3e6", "4e6"]);
    assert_eq!(
        labels(&axis, 5e-6, 1e-5),
        ["5e\u{2212}6", "6e\u{2212}6", "7e\u{2212}6", "8e\u{2212}6", "9e\u{2212}6", "1e\u{2212}5"]
    );
    assert_eq!(labels(&axis.clone().from_zero(), 3.0, 4.0), ["0", "1", "2", "3", "4"]);
    assert_eq!(labels(&axis.whole(), 1.0, 3.0), ["1", "2", "3"]);
}

#[test]
fn log_ticks_are_decades_or_1_2_5_steps() {
    let axis = Axis::log("n");
    assert_eq!(labels(&axis, 1e5, 1e7), ["1e5", "2e5", "5e5", "1e6", "2e6", "5e6", "1e7"]);
    assert_eq!(labels(&axis, 0.01, 1000.0), ["0.01", "0.1", "1", "10", "100", "1000"]);
    assert_eq!(labels(&axis, 3.0, 3.0), ["2", "5"]);
    assert_eq!(labels(&axis, 10.0, 10.0), ["5", "10", "20"]);
    assert!(labels(&axis, 1e-99, 1e99).len() < 12);
}

#[test]
fn unusual_ranges_have_distinct_ticks() {
    for axis in [Axis::linear("v"), Axis::linear("v").from_zero(), Axis::linear("v").whole()] {
        for value in [0.0, 1.0, -1.0, 1e9, -1e-9, 1e99, 1e-99] {
            labels(&axis, value, value);
            labels(&axis, value, value * (1.0 + 1e-15));
        }
        labels(&axis, -1e99, 1e99);
        labels(&axis, 1e9, 1e9 + 0.25);
    }
    for value in [1e-99, 1e-5, 0.3, 1.0, 7.0, 1e99] {
        labels(&Axis::log("v"), value, value);
    }
}

#[test]
fn values_off_the_axis() {
    let axis = Axis::log("n");
    for value in [0.0, -1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert!(axis.place(value).is_nan(), "{value}");
    }
    assert!(Axis::linear("n").place(f64::INFINITY).is_nan());
}
