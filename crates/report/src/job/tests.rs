//! Reports of unusual jobs.

use serde_json::json;

use super::*;
use crate::frame::{FrameBytes, RaySummary, StageSeconds};

fn done(number: i64, particles: u64) -> JobFrame {
    #[expect(clippy::cast_precision_loss, reason = "small numbers")]
    let n = number as f64;
    let report = FrameReport {
        particles,
        seconds: StageSeconds {
            read: 0.25,
            build: 0.375,
            surface: 0.125,
            trace: 1.0 + 0.25 * n,
            denoise: 0.0,
            encode: 0.125,
            wall: 2.0,
        },
        bytes: FrameBytes {
            positions: 12 * particles,
            structure: 2 * particles,
            build_peak: 20 * particles,
            ..FrameBytes::default()
        },
        rays: RaySummary { primary: 1000, shadow: 500, ..RaySummary::default() },
        ..FrameReport::default()
    };
    let mut details = json!(report);
    details["build"]["phases"] = json!([["scatter", 0.2], ["sort", 0.3]]);
    of(number, Status::Done, None, details)
}

fn failed(number: i64, reason: &str) -> JobFrame {
    of(number, Status::Failed, Some(reason), Value::Null)
}

fn of(number: i64, status: Status, reason: Option<&str>, details: Value) -> JobFrame {
    let entry = json!({
        "seq": 1, "time_ms": 1, "frame": number, "status": status.name(), "reason": reason,
        "details": details,
    });
    let entry: LedgerEntry = serde_json::from_value(entry).expect("an entry");
    JobFrame::of(number, Some(format!("f.{number}.exr")), status, Some(&entry))
}

fn pending(number: i64) -> JobFrame {
    JobFrame::of(number, None, Status::Pending, None)
}

fn report(frames: Vec<JobFrame>) -> JobReport {
    let settings = vec![("output.path".to_owned(), "\"f.#.exr\"".to_owned())];
    let machine = Machine { threads: 2, simd: "avx2" };
    JobReport::of(frames, settings, machine)
}

/// The part of `html` between the heading `id` and the next one.
#[track_caller]
fn section<'a>(html: &'a str, id: &str) -> &'a str {
    let start = format!("<h2 id=\"{id}\">");
    let rest = html.split(&start).nth(1).unwrap_or_else(|| panic!("no section {id} in {html}"));
    rest.split("<h2").next().expect("a first part")
}

fn rows(section: &str) -> usize {
    section.matches("<tr><td").count() + section.matches("<tr class=\"bad\"><td").count()
}

#[test]
fn derived_numbers_and_totals() {
    let json = report(vec![done(1, 100), done(2, 300), failed(3, "no"), pending(4)]).to_json();
    assert_eq!(json["frames"][0]["bytes"]["per_particle"], 14.0);
    assert_eq!(json["frames"][0]["rays_per_second"], 1500.0 / 1.25);
    assert_eq!(json["frames"][2]["reason"], "no");
    assert_eq!(json["frames"][2].get("bytes"), None);
    let totals = &json["totals"];
    assert_eq!(totals["particles"], 400);
    assert_eq!(totals["seconds"]["wall"], 4.0);
    assert_eq!(totals["seconds"]["trace"], 2.75);
    assert_eq!(totals["rays_per_second"], 3000.0 / 2.75);
    assert_eq!((&totals["frames"], &totals["pending"]), (&json!(4), &json!(1)));
    assert_eq!(
        json["slowest"],
        json!([{"frame": 2, "seconds": 2.375}, {"frame": 1, "seconds": 2.125}])
    );
}

#[test]
fn page_contains_all_sections() {
    let frames = vec![done(1, 100), failed(2, "f_2.vtk: cut off"), done(3, 0), pending(4)];
    let html = report(frames).to_html();
    assert!(html.contains("Job report: f.#.exr") && html.contains("2 of 4 done"));
    assert!(section(&html, "failed").contains("f_2.vtk: cut off"));
    let plots = section(&html, "plots");
    for id in ["stages", "build", "rays", "particles", "memory", "bytes"] {
        assert!(plots.contains(&format!("<svg class=\"plot\" id=\"plot-{id}\"")), "{id}");
    }
    assert!(plots.contains("<title>scatter</title>") && plots.contains("<title>sort</title>"));
    assert_eq!(rows(section(&html, "slowest")), 2);
    assert_eq!(rows(section(&html, "build")), 2);
    assert_eq!(rows(section(&html, "frames")), 3);
    assert!(!html.contains("NaN") && !html.contains(">inf"));
}

#[test]
fn frames_without_particles_have_no_bytes_per_particle() {
    let report = report(vec![done(1, 0)]);
    assert_eq!(report.to_json()["frames"][0]["bytes"]["per_particle"], Value::Null);
    let html = report.to_html();
    let bytes = section(&html, "plots").split("Tree memory per particle").nth(1);
    assert!(bytes.expect("the figure").contains("No values to plot"));
    assert_eq!(rows(section(&html, "frames")), 1);
}

#[test]
fn jobs_without_done_frames() {
    for frames in [vec![], vec![pending(1), pending(2)], vec![failed(1, "a"), failed(2, "b")]] {
        let failures = frames.iter().filter(|f| f.status == Status::Failed).count();
        let report = report(frames);
        assert_eq!(report.to_json()["slowest"], json!([]));
        let html = report.to_html();
        assert!(section(&html, "plots").contains("No frame is finished yet"));
        assert!(!html.contains("id=\"build\"") && !html.contains("NaN"));
        if failures == 0 {
            assert!(section(&html, "frames").contains("No frame has been attempted yet"));
            assert!(!html.contains("id=\"failed\""));
        } else {
            assert_eq!(rows(section(&html, "failed")), 2);
            assert_eq!(rows(section(&html, "frames")), 2);
        }
    }
}

#[test]
fn hostile_names_are_escaped() {
    let hostile = "in/<img src=x onerror=alert(1)>\"'&\u{202e}.vtk: cut off";
    let mut frame = failed(1, hostile);
    frame.image = Some(hostile.to_owned());
    let mut named = report(vec![frame, done(2, 5)]);
    named.settings = vec![("output.path".to_owned(), hostile.to_owned())];
    named.frames[1].report.as_mut().expect("done").build.phases = vec![(hostile.to_owned(), 1.0)];
    let html = named.to_html();
    assert!(!html.contains("<img") && !html.contains('\u{202e}'));
    assert!(html.contains("&lt;img src=x onerror=alert(1)&gt;&quot;&#39;&amp;\\u{202e}.vtk"));
}

#[test]
fn ten_thousand_frames_make_a_page_of_bounded_size() {
    let long = "x".repeat(5000);
    let frame = |number: i64| match number % 3 {
        0 => failed(number, &long),
        _ => done(number, 1_000_000),
    };
    let html = report((0..10_000).map(frame).collect()).to_html();
    assert!(html.len() < 500_000, "{} bytes", html.len());
    assert_eq!(rows(section(&html, "failed")), 50);
    assert_eq!(rows(section(&html, "frames")), 300);
    assert_eq!(rows(section(&html, "slowest")), 10);
    assert!(section(&html, "frames").contains("300 of 10\u{202f}000 frames"));
    assert!(section(&html, "frames").contains("href=\"./report.json\""));
}

#[test]
fn many_phases_share_the_last_colour() {
    let mut frame = done(1, 5);
    let phases = (0..10).map(|i| (format!("phase {i}"), 0.5)).collect();
    frame.report.as_mut().expect("done").build.phases = phases;
    let html = report(vec![frame]).to_html();
    let plots = section(&html, "plots");
    assert!(plots.contains("<title>phase 5</title>") && !plots.contains("<title>phase 6</title>"));
    assert!(plots.contains("<title>others</title>"));
}
