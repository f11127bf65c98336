//! Memory by part: one row per count and column of the other tables, one column per part; and the measurements of
//! conversions.

use super::{CellMeasurement, Column, Conversion, ScaleReport, thesis};
use super::{FAILED, MIB, MISSING};

/// Headings of the table of bytes.
pub(super) const HEADS: [&str; 11] = [
    "particles",
    "structure",
    "positions",
    "attributes",
    "nodes",
    "total",
    "anonymous",
    "mapped",
    "scratch",
    "peak anonymous, MiB",
    "peak mapped, MiB",
];

/// Headings of the table of conversions.
pub(super) const CONVERSION_HEADS: [&str; 7] = [
    "particles",
    "structure",
    "load, s",
    "conversion, s",
    "file, MiB",
    "max error, radii",
    "peak anonymous, MiB",
];

/// Explanation of the columns of bytes.
pub(super) const NOTE: &str = "bytes per particle during tracing (positions to mapped) and during the build (scratch); \
    sampled peaks of the process, including images and the program itself";

/// The rows of the table of bytes; the last one is that of the thesis.
pub(super) fn rows(report: &ScaleReport) -> Vec<Vec<String>> {
    let mut rows = our_rows(report);
    if report.settings.input.is_none() {
        let mut theirs = vec![MISSING.to_owned(); HEADS.len()];
        theirs[0] = thesis::RATE_PARTICLES.to_string();
        theirs[1] = "thesis (about)".to_owned();
        theirs[5] = format!("{:.0}", thesis::BYTES_PER_PARTICLE[0].value);
        rows.push(theirs);
    }
    rows
}

fn our_rows(report: &ScaleReport) -> Vec<Vec<String>> {
    rows_of(report, |particles, column| {
        let mut cells = report.cells_of(particles, column).peekable();
        let empty = match cells.peek() {
            Some(_) => FAILED,
            None => MISSING,
        };
        let Some(measured) = cells.find_map(|c| c.measured()) else {
            return Some(vec![empty.to_owned(); HEADS.len() - 2]);
        };
        let peaks = [
            report.anonymous_peak_bytes(particles, column),
            report.file_peak_bytes(particles, column),
        ]
        .map(|bytes| bytes.map_or_else(|| MISSING.to_owned(), mib));
        Some(shares(measured).into_iter().chain(peaks).collect())
    })
}

/// Bytes per particle; none without particles.
fn shares(measured: &CellMeasurement) -> Vec<String> {
    let Some(share) = measured.bytes_per_particle else {
        return vec![MISSING.to_owned(); 7];
    };
    let all = [
        share.positions,
        share.attributes,
        share.structure,
        share.anonymous + share.file,
        share.anonymous,
        share.file,
        share.scratch,
    ];
    all.iter().map(|bytes| format!("{bytes:.2}")).collect()
}

/// The rows of the table of conversions, one per native frame.
pub(super) fn conversions(report: &ScaleReport) -> Vec<Vec<String>> {
    rows_of(report, |particles, column| {
        let mut cells = report.cells_of(particles, column);
        let conversion = cells.find_map(|c| c.measured()?.conversion)?;
        Some(conversion_cells(&conversion).to_vec())
    })
}

fn conversion_cells(conversion: &Conversion) -> [String; 5] {
    let error = conversion.max_error_of_radius;
    [
        format!("{:.3}", conversion.load_seconds),
        format!("{:.3}", conversion.seconds),
        mib(conversion.file_bytes),
        error.map_or_else(|| MISSING.to_owned(), |error| format!("{error:.4}")),
        mib(conversion.rss.anonymous_peak),
    ]
}

/// The rows of all counts and columns that have one, with count and column in front.
fn rows_of(
    report: &ScaleReport,
    row: impl Fn(usize, &Column) -> Option<Vec<String>>,
) -> Vec<Vec<String>> {
    let columns = report.columns();
    let mut rows = Vec::new();
    for &particles in &report.settings.particles {
        for column in &columns {
            if let Some(row) = row(particles, column) {
                let names = [particles.to_string(), column.title.clone()];
                rows.push(names.into_iter().chain(row).collect());
            }
        }
    }
    rows
}

fn mib(bytes: u64) -> String {
    format!("{:.1}", bytes as f64 / MIB)
}
