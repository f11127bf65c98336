//! Plots of unusual data, and checks of their text.

use super::*;

fn plot(series: Vec<Series>) -> Plot {
    let axes = (Axis::linear("frame"), Axis::linear("time, s").from_zero());
    plot_on(axes, series)
}

fn plot_on((x, y): (Axis, Axis), series: Vec<Series>) -> Plot {
    series.into_iter().fold(Plot::new("p", "A plot", x, y), Plot::with)
}

fn line(values: &[f64]) -> Series {
    let mut x = 0.0;
    let points = values.iter().map(|y| {
        x += 1.0;
        (x, *y)
    });
    Series::new("values", points.collect::<Vec<_>>())
}

/// Checks that all numbers in attributes of positions and sizes are finite and inside the plot.
#[track_caller]
fn check_geometry(html: &str) {
    assert!(!html.contains("NaN") && !html.contains("inf"), "{html}");
    for key in [" cx=\"", " cy=\"", " x=\"", " y=\"", " d=\"M"] {
        for rest in html.split(key).skip(1) {
            let data = rest.split('"').next().expect("an attribute ends");
            for number in data.split(|c: char| !(c.is_ascii_digit() || c == '.' || c == '-')) {
                let Ok(value) = number.parse::<f64>() else {
                    continue;
                };
                assert!((-4.0..=444.0).contains(&value), "{value} in {data}");
            }
        }
    }
}

/// Numbers of lines and of markers.
fn drawn(html: &str) -> (usize, usize) {
    let svg = html.split("</svg>").next().expect("a first part");
    let series = svg.split("<g class=\"series").skip(1);
    let mut counts = (0, 0);
    for group in series {
        counts.0 += group.matches("<path fill=\"none\"").count();
        counts.1 += group.matches("<circle").count() + group.matches("Z\"/>").count();
    }
    counts
}

#[test]
fn same_data_give_the_same_text() {
    let make =
        || plot(vec![line(&[1.0, 2.0, 1.5]), line(&[0.5, 0.7, 0.1]).line(Line::Dashed)]).figure();
    let html = make();
    assert_eq!(html, make());
    check_geometry(&html);
    assert_eq!(drawn(&html), (2, 6));
    assert!(html.contains("id=\"p\"") && html.contains("viewBox=\"0 0 440 270\""));
    assert!(html.contains("<title id=\"p-title\">A plot: time, s by frame</title>"));
    assert!(html.contains("hue-0") && html.contains("hue-1") && html.contains("stroke-dasharray"));
}

#[test]
fn heights_are_in_proportion() {
    let html = plot(vec![Series::new("one", [(0.0, 0.0), (2.0, 5.0), (4.0, 10.0)])]).figure();
    let path = html
        .split("<path fill=\"none\" d=\"M")
        .nth(1)
        .expect("a line")
        .split('"')
        .next()
        .expect("its end");
    let points: Vec<(f64, f64)> = path
        .split('L')
        .map(|p| {
            let (x, y) = p.split_once(' ').expect("two numbers");
            (x.parse().expect("x"), y.parse().expect("y"))
        })
        .collect();
    assert_eq!(points.len(), 3);
    assert!((points[1].0 - f64::midpoint(points[0].0, points[2].0)).abs() < 0.11, "{points:?}");
    assert!((points[1].1 - f64::midpoint(points[0].1, points[2].1)).abs() < 0.11, "{points:?}");
    assert!(points[0].0 < points[2].0 && points[0].1 > points[2].1, "{points:?}");
}

#[test]
fn missing_values_leave_gaps() {
    let html = plot(vec![line(&[1.0, 2.0, f64::NAN, 3.0, f64::INFINITY, 1.0, 2.0])]).figure();
    check_geometry(&html);
    // Two lines, and a marker for the isolated point between the gaps.
    assert_eq!(drawn(&html), (2, 5));
}

#[test]
fn unusual_ranges_are_plotted() {
    for values in [
        &[1.0][..],
        &[0.0],
        &[2.0, 2.0, 2.0],
        &[-1.0, -5.0],
        &[1e-30, 2e-30],
        &[1e30, 2e30],
        &[1e99, -1e99],
    ] {
        let html = plot(vec![line(values)]).figure();
        check_geometry(&html);
        assert_eq!(drawn(&html).1, values.len(), "{values:?}");
    }
}

#[test]
fn empty_plots_have_a_message() {
    for series in [vec![], vec![line(&[])], vec![line(&[f64::NAN, f64::NEG_INFINITY, 1e300])]] {
        let html = plot(series).figure();
        assert!(html.contains("No values to plot") && !html.contains("<svg"), "{html}");
    }
}

#[test]
fn values_up_to_zero_are_omitted_from_a_log_axis() {
    let axes = || (Axis::linear("frame"), Axis::log("bytes"));
    let html = plot_on(axes(), vec![line(&[10.0, 0.0, 1000.0, -1.0, 1e5])]).figure();
    check_geometry(&html);
    assert_eq!(drawn(&html), (0, 3));
    assert!(html.contains("2 values are omitted"));
    let html = plot_on(axes(), vec![line(&[0.0])]).figure();
    assert!(html.contains("No values to plot") && html.contains("1 value is omitted"), "{html}");
}

#[test]
fn long_series_keep_their_peaks_and_stay_small() {
    let mut values: Vec<f64> = (0..100_000u32).map(|i| f64::from(i % 7)).collect();
    values[54_321] = 100.0;
    let html = plot(vec![line(&values)]).figure();
    check_geometry(&html);
    assert!(html.len() < 30_000, "{}", html.len());
    let points = html
        .split("<path fill=\"none\" d=\"M")
        .nth(1)
        .expect("a line")
        .split('"')
        .next()
        .expect("its end")
        .split('L');
    let highest = points
        .filter_map(|p| p.split_once(' ')?.1.parse::<f64>().ok())
        .fold(f64::INFINITY, f64::min);
    assert!(highest < 40.0, "the peak is lost: {highest}");
}

#[test]
fn names_are_escaped() {
    let hostile = "</svg><script>'\"&";
    let mut plot = plot(vec![Series::new(hostile, [(1.0, 1.0)])]);
    plot.title = hostile.to_owned();
    plot.x = Axis::linear(hostile);
    let html = plot.figure();
    assert!(!html.contains("<script") && !html.contains("'\""), "{html}");
}
