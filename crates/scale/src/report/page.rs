//! `scale.html`: the tables, including the results of the thesis, and plots over the particle count on logarithmic
//! axes.

use spherule_report::page::{Page, Table};
use spherule_report::plots::{Axis, Line, Plot, Series};

use super::table;
use super::{
    CSV, CellMeasurement, Column, FAILED, JSON, MADE_BY, MIB, MISSING, ScaleReport, parts, thesis,
};
use crate::Motion;

/// The whole file.
pub fn html(report: &ScaleReport) -> String {
    let mut page =
        Page::new(&format!("{MADE_BY}: frame rate, build time and memory by particle count"));
    introduce(&mut page, report);
    page.section("plots", "Plots by particle count");
    page.text(
        "The image time is the inverse of the mean rate, because the thesis reports only rates. Bytes per \
         particle are those of the tree, in memory or in the mapped file; for the thesis, those of the whole \
         process.",
    );
    page.plots(&plots(report));
    // Frame rates, one table per motion
    for motion in &report.settings.motions {
        let heading = format!("Images per second: {motion}");
        page.section(&format!("rate-{motion}"), &heading);
        page.text(
            "Mean over the images of a cell (standard deviation in parentheses). The deviation is the \
             spread along the camera path, not a measurement error.",
        );
        page.table(&rates(report, *motion));
    }
    // Build time and memory, with the values of the thesis
    page.section("build", "Build time, s");
    page.text(
        "Median over camera motions of the median over builds. The thesis reports about 2.5 s for lbvh and \
         kdtree, and more than 80 s for sbvh.",
    );
    page.table(&figures(report, "build-table", table::build_seconds, &thesis::BUILD_SECONDS));
    page.section("memory", "Peak memory, MiB");
    page.text(
        "Peak resident memory of the process (VmHWM), including the program itself. The thesis also counts \
         in units of 1024 x 1024 bytes; its values are for its own program on a graphics card.",
    );
    page.table(&figures(report, "memory-table", table::peak, &thesis::PEAK_MIB));
    put_parts(&mut page, report);
    // All measurements, folded
    page.section("cells", "All cells");
    page.fold("All measurements by cell");
    page.table(&cells(report));
    page.end_fold();
    page.link("All values as JSON:", JSON);
    page.link("All values as CSV:", CSV);
    page.html()
}

/// Memory by part, and the native frames if there are any.
fn put_parts(page: &mut Page, report: &ScaleReport) {
    page.section("parts", "Memory by part");
    page.text(&format!(
        "{}. Positions include radii. Pages of a mapped file are not anonymous memory: they are read when \
         rays reach them, and the system may drop them. The peaks are the largest values of RssAnon and RssFile, \
         sampled every few milliseconds during loading and building, and after each image. The value of the \
         thesis is for its whole process.",
        parts::NOTE
    ));
    put_rows(page, "parts-table", &parts::HEADS, parts::rows(report));
    let conversions = parts::conversions(report);
    if !conversions.is_empty() {
        page.section("conversions", "Native frames");
        page.text(
            "Particles that are traced in place were first written to a native frame, once for all motions, in \
             a separate process. The error of compact positions is at most 0.02 radii. The times above do not \
             include the conversion.",
        );
        put_rows(page, "conversions-table", &parts::CONVERSION_HEADS, conversions);
    }
}

fn put_rows(page: &mut Page, id: &str, heads: &[&str], rows: Vec<Vec<String>>) {
    let mut table = Table::new(id, heads);
    for row in rows {
        table.row(row);
    }
    page.table(&table);
}

fn introduce(page: &mut Page, report: &ScaleReport) {
    page.key_values(&[
        ("Experiment", table::subject(report)),
        ("Machine", table::conditions(report)),
        ("Machine of the thesis", thesis::MACHINE.to_owned()),
    ]);
    for (cell, reason) in report.failed() {
        page.warning(&format!("failed: {}: {reason}", table::cell_name(cell)));
    }
    let missing = report.planned.saturating_sub(report.cells.len());
    if missing > 0 {
        page.warning(&format!(
            "{missing} of {} cells were not measured: the run is in progress or was interrupted",
            report.planned
        ));
    }
    page.text(
        "Rotation: the camera circles the particles once. Translation: the camera moves straight along its \
         view direction, from twice its distance to the target point, through that point, to the same distance \
         beyond. Both: both motions at the same time. Each cell ran in a separate process.",
    );
}

/// One row per count; columns of this report, then those of the thesis.
fn rates(report: &ScaleReport, motion: Motion) -> Table {
    let columns = report.columns();
    let theirs: Vec<_> = thesis::RATES.iter().filter(|r| r.motion == motion).collect();
    let names: Vec<&str> = theirs.iter().map(|r| r.structure).collect();
    let mut table = table_with(&format!("rate-{motion}-table"), &columns, &names);
    for particles in counts(report, thesis::RATE_PARTICLES) {
        let ours = columns.iter().map(|c| table::rate(report, particles, c, motion));
        let theirs = theirs.iter().map(|r| {
            if particles == thesis::RATE_PARTICLES {
                format!("{:.2} ({:.2})", r.mean, r.sd)
            } else {
                MISSING.to_owned()
            }
        });
        table.row(std::iter::once(particles.to_string()).chain(ours).chain(theirs));
    }
    table
}

/// The same for a quantity that does not depend on the motion.
fn figures(
    report: &ScaleReport,
    id: &str,
    value: fn(&ScaleReport, usize, &Column) -> Option<String>,
    theirs: &[thesis::Figure],
) -> Table {
    // Collect the structures of the thesis
    let columns = report.columns();
    let mut names: Vec<&str> = Vec::new();
    for figure in theirs {
        if !names.contains(&figure.structure) {
            names.push(figure.structure);
        }
    }
    let mut table = table_with(id, &columns, &names);
    // Write a row for each number of particles, with ours before theirs
    for particles in counts(report, thesis::RATE_PARTICLES) {
        let ours = columns
            .iter()
            .map(|c| table::summed(report, particles, c, value(report, particles, c)));
        let theirs = names.iter().map(|name| {
            let found = theirs.iter().find(|f| f.particles == particles && f.structure == *name);
            found.map_or_else(|| MISSING.to_owned(), |f| format!("{:.1}", f.value))
        });
        table.row(std::iter::once(particles.to_string()).chain(ours).chain(theirs));
    }
    table
}

/// The counts of the report, and the one of the thesis.
fn counts(report: &ScaleReport, theirs: usize) -> Vec<usize> {
    let mut counts = report.settings.particles.clone();
    if report.settings.input.is_none() && !counts.contains(&theirs) {
        counts.push(theirs);
    }
    counts
}

/// A table with columns for the count, for this report and for the thesis.
fn table_with(id: &str, columns: &[Column], theirs: &[&str]) -> Table {
    let theirs: Vec<String> = theirs.iter().map(|name| format!("thesis\n{name}")).collect();
    let heads: Vec<&str> = std::iter::once("particles")
        .chain(columns.iter().map(|c| c.title.as_str()))
        .chain(theirs.iter().map(String::as_str))
        .collect();
    Table::new(id, &heads)
}

fn plots(report: &ScaleReport) -> Vec<Plot> {
    let mut all = vec![
        plot(
            report,
            "plot-build",
            "Build time",
            "time, s",
            |r, n, c| r.build_seconds(n, c),
            &thesis::BUILD_SECONDS,
        ),
        plot(
            report,
            "plot-memory",
            "Peak memory of the process",
            "peak memory, MiB",
            |r, n, c| Some(r.peak_bytes(n, c)? as f64 / MIB),
            &thesis::PEAK_MIB,
        ),
        plot(
            report,
            "plot-bytes",
            "Bytes per particle: positions and structure",
            "bytes per particle",
            |r, n, c| {
                let share = measured(r, n, c, None)?.bytes_per_particle?;
                Some(share.positions + share.structure)
            },
            &thesis::BYTES_PER_PARTICLE,
        ),
    ];
    all.extend(report.settings.motions.iter().map(|motion| image_plot(report, *motion)));
    all
}

/// The times of images while the camera has this `motion`.
fn image_plot(report: &ScaleReport, motion: Motion) -> Plot {
    let theirs: Vec<thesis::Figure> = thesis::RATES
        .iter()
        .filter(|r| r.motion == motion)
        .map(|r| thesis::Figure {
            structure: r.structure,
            particles: thesis::RATE_PARTICLES,
            value: 1e3 / r.mean,
        })
        .collect();
    plot(
        report,
        &format!("plot-image-{motion}"),
        &format!("Image time: {motion}"),
        "time, ms",
        |r, n, c| {
            let rate = measured(r, n, c, Some(motion))?.images_per_second.mean;
            (rate > 0.0).then(|| 1e3 / rate)
        },
        &theirs,
    )
}

/// One line per column, and that of the thesis in the same colour.
fn plot(
    report: &ScaleReport,
    id: &str,
    title: &str,
    unit: &str,
    value: impl Fn(&ScaleReport, usize, &Column) -> Option<f64>,
    theirs: &[thesis::Figure],
) -> Plot {
    let mut plot = Plot::new(id, title, Axis::log("particles"), Axis::log(unit));
    let columns = report.columns();
    let mut counts: Vec<usize> = report.settings.particles.clone();
    counts.sort_unstable();
    for (hue, column) in columns.iter().enumerate() {
        let points = counts.iter().filter(|n| **n > 0).map(|&n| {
            let value = value(report, n, column);
            (n as f64, value.unwrap_or(f64::NAN))
        });
        plot = plot.with(Series::new(&column.title, points).hue(hue));
    }
    // The particles of a user cannot be compared with the thesis.
    if report.settings.input.is_some() {
        return plot;
    }
    for (hue, column) in columns.iter().enumerate() {
        let is_first = columns.iter().position(|c| c.structure == column.structure) == Some(hue);
        let points: Vec<(f64, f64)> = theirs
            .iter()
            .filter(|f| is_first && f.structure == column.structure)
            .map(|f| (f.particles as f64, f.value))
            .collect();
        if !points.is_empty() {
            let name = format!("thesis, {}", column.structure);
            plot = plot.with(Series::new(name, points).hue(hue).line(Line::Dashed));
        }
    }
    plot
}

/// The measurements of a count and a column, for one motion or the first available one.
fn measured<'a>(
    report: &'a ScaleReport,
    particles: usize,
    column: &'a Column,
    motion: Option<Motion>,
) -> Option<&'a CellMeasurement> {
    report
        .cells_of(particles, column)
        .filter(|cell| motion.is_none_or(|m| cell.motion == m))
        .find_map(|cell| cell.measured())
}

const CELL_HEADS: [&str; 18] = [
    "particles",
    "structure",
    "positions",
    "motion",
    "images",
    "images/s\nmean (sd)",
    "images/s\nmin",
    "images/s\nmax",
    "first build\ns",
    "median build\ns",
    "all rays\nM/s",
    "primary\nM/s",
    "shadow\nM/s",
    "reflection\nM/s",
    "refraction\nM/s",
    "resident peak\nMiB",
    "anonymous peak\nMiB",
    "file-backed peak\nMiB",
];

fn cells(report: &ScaleReport) -> Table {
    let mut table = Table::new("cells-table", &CELL_HEADS);
    for cell in &report.cells {
        let names = [
            cell.particles.to_string(),
            cell.structure.clone(),
            cell.representation.place().to_owned(),
            cell.motion.to_string(),
        ];
        match cell.measured() {
            Some(measured) => table.row(names.into_iter().chain(numbers(measured))),
            None => table.bad_row(names.into_iter().chain([FAILED.to_owned()])),
        }
    }
    table
}

fn numbers(m: &CellMeasurement) -> [String; 14] {
    let millions = |rate: f64| format!("{:.2}", rate * 1e-6);
    let mib = |bytes: u64| format!("{:.1}", bytes as f64 / MIB);
    [
        m.images.to_string(),
        table::spread(&m.images_per_second),
        format!("{:.2}", m.images_per_second.min),
        format!("{:.2}", m.images_per_second.max),
        format!("{:.4}", m.build_seconds.first),
        format!("{:.4}", m.build_seconds.median),
        millions(m.rays_per_second.total),
        millions(m.rays_per_second.primary),
        millions(m.rays_per_second.shadow),
        millions(m.rays_per_second.reflection),
        millions(m.rays_per_second.refraction),
        mib(m.rss.total_peak),
        mib(m.rss.anonymous_peak),
        mib(m.rss.file_peak),
    ]
}
