//! The report as text, in the layout of tables 2 to 5 of the thesis: rows are particle counts, columns structures.

use std::fmt::Write as _;

use spherule_files::counted;
use spherule_formats::escape_controls;

use super::{
    CellMeasurement, CellReport, Column, FAILED, MIB, MISSING, ScaleReport, Spread, parts,
};
use crate::{Budget, Motion};

/// All tables with their headings.
pub fn text(report: &ScaleReport) -> String {
    let mut text = format!("{}\n{}\n", subject(report), conditions(report));
    // Frame rates, one table per motion
    for motion in &report.settings.motions {
        let heading = format!("Images per second, {motion}: mean (standard deviation)");
        put(&mut text, report, &heading, |particles, column| {
            rate(report, particles, column, *motion)
        });
    }
    // Build time and memory
    let heading = "Build time, s: median";
    put(&mut text, report, heading, |particles, column| {
        summed(report, particles, column, build_seconds(report, particles, column))
    });
    let heading = "Peak memory of the process, MiB";
    put(&mut text, report, heading, |particles, column| {
        summed(report, particles, column, peak(report, particles, column))
    });
    let heading = "Bytes per particle: positions and structure";
    put(&mut text, report, heading, |particles, column| {
        summed(report, particles, column, bytes(report, particles, column))
    });
    put_parts(&mut text, report);
    // List failed and missing cells
    for (cell, reason) in report.failed() {
        let reason = escape_controls(reason);
        let _ = write!(text, "\nfailed: {}: {reason}", cell_name(cell));
    }
    if report.failed().next().is_some() {
        text.push('\n');
    }
    let missing = report.planned - report.cells.len().min(report.planned);
    if missing > 0 {
        let _ = writeln!(
            text,
            "\ninterrupted: {missing} of {} cells were not measured",
            report.planned
        );
    }
    text
}

/// Description of the scene and settings.
pub fn subject(report: &ScaleReport) -> String {
    let s = &report.settings;
    let what = s.input.as_ref().map_or_else(
        || "box of the thesis".to_owned(),
        |i| {
            let path = escape_controls(&i.path);
            format!("{path}, frame {} ({} particles)", i.frame, i.particles)
        },
    );
    let budget = match s.budget {
        Budget::Seconds(seconds) => format!("{seconds} s"),
        Budget::Images(images) => counted(images, "image"),
    };
    format!(
        "{what}; {}x{}, samples per pixel {}, depth {}, {budget} per cell",
        s.width, s.height, s.samples, s.max_depth
    )
}

/// Description of the machine and software.
pub fn conditions(report: &ScaleReport) -> String {
    format!(
        "{}; {} threads used; spherule {}",
        report.machine, report.settings.threads, report.machine.spherule
    )
}

/// Description of a cell for messages.
pub fn cell_name(cell: &CellReport) -> String {
    format!(
        "{} particles, {} {}, {}",
        cell.particles,
        cell.structure,
        cell.representation.place(),
        cell.motion
    )
}

fn put(
    text: &mut String,
    report: &ScaleReport,
    heading: &str,
    value: impl Fn(usize, &Column) -> String,
) {
    let columns = report.columns();
    let mut rows = vec![
        std::iter::once("particles".to_owned())
            .chain(columns.iter().map(|c| c.title.clone()))
            .collect::<Vec<_>>(),
    ];
    for &particles in &report.settings.particles {
        let cells = columns.iter().map(|column| value(particles, column));
        rows.push(std::iter::once(particles.to_string()).chain(cells).collect());
    }
    put_rows(text, heading, &rows);
}

/// Memory by part, and the native frames if there are any.
fn put_parts(text: &mut String, report: &ScaleReport) {
    let with_heads = |heads: &[&str], rows: Vec<Vec<String>>| -> Vec<Vec<String>> {
        let heads = heads.iter().map(|head| (*head).to_owned()).collect();
        std::iter::once(heads).chain(rows).collect()
    };
    let heading = format!("Memory by part: {}", parts::NOTE);
    let rows = with_heads(&parts::HEADS, parts::rows(report));
    put_rows(text, &heading, &rows);
    let conversions = parts::conversions(report);
    if !conversions.is_empty() {
        let rows = with_heads(&parts::CONVERSION_HEADS, conversions);
        put_rows(text, "Native frames: converted once for all motions", &rows);
    }
}

/// `rows` under `heading`, aligned in columns; the first row has as many cells as any other.
fn put_rows(text: &mut String, heading: &str, rows: &[Vec<String>]) {
    let columns = rows.first().map_or(0, Vec::len);
    let width = |place: usize| rows.iter().map(|r| r[place].len()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let _ = writeln!(text, "\n{heading}");
    for row in rows {
        let cells: Vec<String> =
            row.iter().zip(&widths).map(|(c, width)| format!("{c:>width$}")).collect();
        let _ = writeln!(text, "  {}", cells.join("   "));
    }
}

/// The entry of a table for one motion.
pub(super) fn rate(
    report: &ScaleReport,
    particles: usize,
    column: &Column,
    motion: Motion,
) -> String {
    let mut cells = report.cells_of(particles, column);
    match cells.find(|cell| cell.motion == motion) {
        None => MISSING.to_owned(),
        Some(cell) => {
            cell.measured().map_or_else(|| FAILED.to_owned(), |m| spread(&m.images_per_second))
        }
    }
}

/// The entry of a table for all motions: `value`, or the reason why there is none.
pub(super) fn summed(
    report: &ScaleReport,
    particles: usize,
    column: &Column,
    value: Option<String>,
) -> String {
    let mut cells = report.cells_of(particles, column).peekable();
    // Bytes per particle are undefined without particles, which is not a failure.
    let failed = cells.peek().is_some() && cells.all(|c| c.measured().is_none());
    value.unwrap_or_else(|| if failed { FAILED } else { MISSING }.to_owned())
}

pub(super) fn build_seconds(
    report: &ScaleReport,
    particles: usize,
    column: &Column,
) -> Option<String> {
    let seconds = report.build_seconds(particles, column)?;
    // The fastest builds take microseconds.
    let digits = if seconds < 0.1 { 4 } else { 3 };
    Some(format!("{seconds:.digits$}"))
}

pub(super) fn peak(report: &ScaleReport, particles: usize, column: &Column) -> Option<String> {
    let bytes = report.peak_bytes(particles, column)?;
    Some(format!("{:.1}", bytes as f64 / MIB))
}

pub(super) fn bytes(report: &ScaleReport, particles: usize, column: &Column) -> Option<String> {
    let mut cells = report.cells_of(particles, column);
    let share = cells.find_map(|c| c.measured()?.bytes_per_particle)?;
    Some(format!("{:.2}", share.positions + share.structure))
}

/// Mean and standard deviation, in the format of the thesis.
pub(super) fn spread(values: &Spread) -> String {
    let mean = short(values.mean);
    values.sd.map_or_else(|| mean.clone(), |sd| format!("{mean} ({})", short(sd)))
}

/// Two digits after the decimal point, fewer for large numbers.
fn short(value: f64) -> String {
    match value {
        ..100.0 => format!("{value:.2}"),
        100.0..1000.0 => format!("{value:.1}"),
        _ => format!("{value:.0}"),
    }
}

/// The measurements of a cell in one line.
pub fn line(measured: &CellMeasurement) -> String {
    format!(
        "build {:.4} s, {} images/s in {} images, peak {:.1} MiB",
        measured.build_seconds.median,
        spread(&measured.images_per_second),
        measured.images,
        measured.rss.total_peak as f64 / MIB
    )
}
