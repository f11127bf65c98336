//! Constructed reports, with the expected tables and files.

use spherule_report::frame::{FileBytes, FrameBytes};

use super::*;

fn measurement(rate: f64, build: f64, peak: u64) -> CellMeasurement {
    let bytes = FrameBytes {
        positions: 12_000,
        structure: 600,
        build_peak: 24_000,
        ..FrameBytes::default()
    };
    CellMeasurement {
        images: 3,
        images_per_second: Spread::of(&[rate - 1.0, rate, rate + 1.0]),
        image_seconds: Spread::of(&[1.0 / rate]),
        load_seconds: 0.1,
        conversion: None,
        build_seconds: BuildTimes::of(&[2.0 * build, build, build]),
        build: BuildSummary::default(),
        bytes_per_particle: PerParticle::of(&bytes, 1000),
        bytes,
        rss: RssSummary { total_peak: peak << 20, ..RssSummary::default() },
        rays: RaySummary::default(),
        rays_per_second: RayRates::default(),
    }
}

/// Two counts, one structure, all motions. Of the second count, the last motion failed and the first is missing.
fn report() -> ScaleReport {
    let cell = |particles, motion, outcome| CellReport {
        particles,
        structure: "lbvh".to_owned(),
        motion,
        representation: Representation::Memory,
        outcome,
    };
    let done = |rate, build, peak| CellOutcome::Done(Box::new(measurement(rate, build, peak)));
    ScaleReport {
        made_by: MADE_BY.to_owned(),
        machine: Machine::this(),
        settings: ScaleSettings {
            input: None,
            particles: vec![1000, 10_000_000],
            structures: vec!["lbvh".to_owned()],
            motions: Motion::ALL.to_vec(),
            representations: vec![Representation::Memory],
            budget: Budget::Images(3),
            width: 64,
            height: 36,
            samples: 1,
            max_depth: 3,
            seed: 1,
            threads: 2,
        },
        planned: 6,
        cells: vec![
            cell(1000, Motion::Rotation, done(20.0, 0.25, 100)),
            cell(1000, Motion::Translation, done(40.0, 0.5, 120)),
            cell(1000, Motion::Both, done(2000.0, 0.75, 110)),
            cell(10_000_000, Motion::Translation, done(4.0, 9.0, 3000)),
            cell(
                10_000_000,
                Motion::Both,
                CellOutcome::Failed { reason: "out of memory: 3, \"4\"\nor more".to_owned() },
            ),
        ],
    }
}

#[test]
fn spread_uses_the_sample_standard_deviation() {
    let spread = Spread::of(&[2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0]);
    // The sum of squared deviations is 32, of 8 samples.
    assert_eq!(spread.sd, Some((32.0_f64 / 7.0).sqrt()));
    assert_eq!((spread.mean, spread.min, spread.max), (5.0, 2.0, 9.0));
    assert_eq!(Spread::of(&[3.0]).sd, None);
    assert_eq!(Spread::of(&[]), Spread::default());
    let times = BuildTimes::of(&[5.0, 1.0, 2.0, 4.0]);
    assert_eq!((times.first, times.median), (5.0, 3.0));
    assert_eq!((times.min, times.max, times.builds), (1.0, 5.0, 4));
}

#[test]
fn tables_have_the_layout_of_the_thesis() {
    let text = table::text(&report());
    let lines: Vec<&str> = text.lines().collect();
    let after = |heading: &str| {
        let at = lines
            .iter()
            .position(|l| l.starts_with(heading))
            .unwrap_or_else(|| panic!("no {heading} in\n{text}"));
        [1, 2, 3].map(|i| lines[at + i])
    };
    assert_eq!(
        after("Images per second, rotation"),
        ["  particles           lbvh", "       1000   20.00 (1.00)", "   10000000              -"]
    );
    let both = after("Images per second, both");
    assert_eq!(both[1], "       1000   2000 (1.00)");
    assert_eq!(both[2], "   10000000        failed");
    // The median over motions of their medians.
    assert_eq!(after("Build time")[1], "       1000   0.500");
    assert_eq!(after("Build time")[2], "   10000000   9.000");
    assert_eq!(after("Peak memory")[1], "       1000    120.0");
    assert_eq!(after("Bytes per particle")[1], "       1000   12.60");
    assert!(text.contains("failed: 10000000 particles, lbvh in memory, both: out of memory"));
    assert!(text.contains("interrupted: 1 of 6 cells were not measured"));
}

/// Same as [`report`], and the last count also in a q10 file, with 4 bytes of positions per particle.
fn report_in_place() -> ScaleReport {
    let mut report = report();
    report.settings.structures.push("kdtree".to_owned());
    report.settings.representations.push(Representation::Q10);
    let mut measured = measurement(3.0, 0.001, 300);
    measured.bytes = FrameBytes {
        positions: 4000,
        structure: 600,
        scratch: 70,
        file: FileBytes { positions: 4000, structure: 500, attributes: 0 },
        ..FrameBytes::default()
    };
    measured.bytes_per_particle = PerParticle::of(&measured.bytes, 1000);
    measured.rss.anonymous_peak = 7 << 20;
    measured.rss.file_peak = 60 << 20;
    measured.conversion = Some(Conversion {
        load_seconds: 0.25,
        seconds: 1.5,
        file_bytes: 46 << 20,
        max_error: 1e-4,
        max_error_of_radius: Some(0.0125),
        rss: RssSummary::default(),
    });
    report.cells.push(CellReport {
        particles: 10_000_000,
        structure: "kdtree".to_owned(),
        motion: Motion::Rotation,
        representation: Representation::Q10,
        outcome: CellOutcome::Done(Box::new(measured)),
    });
    report
}

#[test]
fn memory_by_part_separates_mapped_from_anonymous() {
    let report = report_in_place();
    let titles: Vec<String> = report.columns().into_iter().map(|c| c.title).collect();
    // Other structures cannot be traced in place.
    assert_eq!(titles, ["lbvh", "kdtree", "kdtree, q10 file"]);
    let rows = parts::rows(&report);
    let row = |title: &str| rows.iter().rfind(|row| row[1] == title).expect("a row");
    assert_eq!(
        row("kdtree, q10 file")[2..],
        ["4.00", "0.00", "0.60", "4.60", "0.10", "4.50", "0.07", "7.0", "60.0"]
    );
    assert_eq!(rows[0][2..8], ["12.00", "0.00", "0.60", "12.60", "12.60", "0.00"]);
    // That count has no measurements.
    assert!(row("kdtree")[2..].iter().all(|cell| cell == MISSING));
    assert_eq!(row("thesis (about)")[5], "350");
    assert!(rows.iter().all(|row| row.len() == parts::HEADS.len()));
    assert_eq!(
        parts::conversions(&report),
        [["10000000", "kdtree, q10 file", "0.250", "1.500", "46.0", "0.0125", "0.0"]]
    );
    let text = table::text(&report);
    assert!(text.contains("Native frames"), "{text}");
    assert!(!table::text(&self::report()).contains("Native frames"));
    let html = page::html(&report);
    assert!(html.contains("id=\"conversions-table\"") && html.contains("in a q10 file"));
}

#[test]
fn undefined_values_are_not_failures() {
    let mut report = report();
    report.settings.particles = vec![0];
    let CellOutcome::Done(measured) = &mut report.cells[0].outcome else {
        panic!("the first cell was measured")
    };
    measured.bytes_per_particle = None;
    report.cells.truncate(1);
    report.cells[0].particles = 0;
    let text = table::text(&report);
    let (_, bytes) = text.split_once("Bytes per particle").unwrap();
    assert!(!bytes.contains("failed"), "{text}");
    // A row with failures only is marked as failed.
    report.cells[0].outcome = CellOutcome::Failed { reason: "it was late".to_owned() };
    let text = table::text(&report);
    let (_, bytes) = text.split_once("Bytes per particle").unwrap();
    assert!(bytes.contains("failed"), "{text}");
}

#[test]
fn json_round_trips() {
    let report = report_in_place();
    let json = serde_json::json!(report);
    assert_eq!(json["made_by"], MADE_BY);
    assert_eq!(json["cells"][0]["status"], "done");
    assert_eq!(json["cells"][0]["images_per_second"]["mean"], 20.0);
    assert_eq!(json["cells"][4]["status"], "failed");
    assert_eq!(json["settings"]["budget"]["images"], 3);
    assert_eq!(serde_json::from_value::<ScaleReport>(json).unwrap(), report);
}

#[test]
fn csv_has_one_row_per_cell_and_quotes_text() {
    let text = csv::text(&report());
    let columns = csv::header().split(',').count();
    let rows: Vec<&str> = text.lines().collect();
    // The last reason contains a line break.
    assert_eq!(rows.len(), 1 + 5 + 1);
    for row in &rows[..5] {
        assert_eq!(row.split(',').count(), columns, "{row}");
    }
    assert!(rows[1].starts_with("1000,lbvh,rotation,memory,done,,3,20,1,19,21,"));
    assert!(rows[5].starts_with("10000000,lbvh,both,memory,failed,\"out of memory: 3, \"\"4\"\""));
    assert!(rows[6].starts_with("or more\",,,"));
}

#[test]
fn page_compares_all_measurements_with_the_thesis() {
    let html = page::html(&report());
    for id in [
        "plot-build",
        "plot-memory",
        "plot-bytes",
        "plot-image-rotation",
        "plot-image-translation",
        "plot-image-both",
        "rate-rotation-table",
        "build-table",
        "memory-table",
        "parts-table",
        "cells-table",
    ] {
        assert_eq!(html.matches(&format!("id=\"{id}\"")).count(), 1, "{id}");
    }
    assert!(html.contains("13.39 (2.78)") && html.contains("3481.6"));
    assert!(html.contains("thesis, lbvh"));
    assert!(html.contains("&quot;4&quot;"));

    let mut own = report();
    own.settings.input =
        Some(InputSummary { path: "<mine>.vtk".to_owned(), frame: 7, particles: 1000 });
    let html = page::html(&own);
    assert!(html.contains("&lt;mine&gt;.vtk, frame 7"));
    assert!(!html.contains("thesis, lbvh"));
}

#[test]
fn own_files_are_distinguished_from_others() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    assert_eq!(files::foreign(dir), None);
    files::write(dir, &report()).unwrap();
    assert_eq!(files::foreign(dir), None);
    for name in [HTML, CSV, JSON] {
        let path = dir.join(name);
        std::fs::write(&path, "{}").unwrap();
        assert_eq!(files::foreign(dir), Some(path));
    }
}
