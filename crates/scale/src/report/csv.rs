//! `scale.csv`: one row per cell, for spreadsheets and scripts.

use super::{CellMeasurement, CellReport, ScaleReport};

type Value = fn(&CellMeasurement) -> Option<f64>;

/// Columns that identify a cell and its outcome.
const CELL: [&str; 6] = ["particles", "structure", "motion", "representation", "status", "reason"];

/// Columns of numbers in seconds and bytes; empty if a cell does not have them.
const NUMBERS: [(&str, Value); 43] = [
    ("images", |m| Some(m.images as f64)),
    ("images_per_second_mean", |m| Some(m.images_per_second.mean)),
    ("images_per_second_sd", |m| m.images_per_second.sd),
    ("images_per_second_min", |m| Some(m.images_per_second.min)),
    ("images_per_second_max", |m| Some(m.images_per_second.max)),
    ("image_seconds_mean", |m| Some(m.image_seconds.mean)),
    ("load_seconds", |m| Some(m.load_seconds)),
    ("builds", |m| Some(m.build_seconds.builds as f64)),
    ("build_seconds_first", |m| Some(m.build_seconds.first)),
    ("build_seconds_median", |m| Some(m.build_seconds.median)),
    ("build_seconds_min", |m| Some(m.build_seconds.min)),
    ("build_seconds_max", |m| Some(m.build_seconds.max)),
    ("nodes", |m| Some(m.build.nodes as f64)),
    ("leaves", |m| Some(m.build.leaves as f64)),
    ("depth", |m| Some(f64::from(m.build.depth))),
    ("sah_cost", |m| Some(m.build.sah_cost)),
    ("position_bytes", |m| Some(m.bytes.positions as f64)),
    ("structure_bytes", |m| Some(m.bytes.structure as f64)),
    ("attribute_bytes", |m| Some(m.bytes.attributes as f64)),
    ("scratch_bytes", |m| Some(m.bytes.scratch as f64)),
    ("file_position_bytes", |m| Some(m.bytes.file.positions as f64)),
    ("file_structure_bytes", |m| Some(m.bytes.file.structure as f64)),
    ("file_attribute_bytes", |m| Some(m.bytes.file.attributes as f64)),
    ("build_peak_bytes", |m| Some(m.bytes.build_peak as f64)),
    ("position_bytes_per_particle", |m| Some(m.bytes_per_particle?.positions)),
    ("structure_bytes_per_particle", |m| Some(m.bytes_per_particle?.structure)),
    ("attribute_bytes_per_particle", |m| Some(m.bytes_per_particle?.attributes)),
    ("scratch_bytes_per_particle", |m| Some(m.bytes_per_particle?.scratch)),
    ("anonymous_bytes_per_particle", |m| Some(m.bytes_per_particle?.anonymous)),
    ("file_bytes_per_particle", |m| Some(m.bytes_per_particle?.file)),
    ("rss_anonymous_peak", |m| Some(m.rss.anonymous_peak as f64)),
    ("rss_file_peak", |m| Some(m.rss.file_peak as f64)),
    ("rss_total_peak", |m| Some(m.rss.total_peak as f64)),
    ("conversion_load_seconds", |m| Some(m.conversion?.load_seconds)),
    ("conversion_seconds", |m| Some(m.conversion?.seconds)),
    ("conversion_file_bytes", |m| Some(m.conversion?.file_bytes as f64)),
    ("conversion_max_error", |m| Some(m.conversion?.max_error)),
    ("conversion_max_error_of_radius", |m| m.conversion?.max_error_of_radius),
    ("primary_rays_per_second", |m| Some(m.rays_per_second.primary)),
    ("shadow_rays_per_second", |m| Some(m.rays_per_second.shadow)),
    ("reflection_rays_per_second", |m| Some(m.rays_per_second.reflection)),
    ("refraction_rays_per_second", |m| Some(m.rays_per_second.refraction)),
    ("rays_per_second", |m| Some(m.rays_per_second.total)),
];

/// The first row.
pub fn header() -> String {
    let numbers = NUMBERS.iter().map(|(name, _)| *name);
    let names: Vec<&str> = CELL.into_iter().chain(numbers).collect();
    names.join(",")
}

/// The whole file, with line feeds as line ends.
pub fn text(report: &ScaleReport) -> String {
    let rows = report.cells.iter().map(row);
    let lines: Vec<String> = std::iter::once(header()).chain(rows).collect();
    lines.join("\n") + "\n"
}

fn row(cell: &CellReport) -> String {
    let measured = cell.measured();
    let (status, reason) = match &cell.outcome {
        super::CellOutcome::Done(_) => ("done", ""),
        super::CellOutcome::Failed { reason } => ("failed", reason.as_str()),
    };
    let names = [
        cell.particles.to_string(),
        quoted(&cell.structure),
        cell.motion.to_string(),
        cell.representation.to_string(),
        status.to_owned(),
        quoted(reason),
    ];
    let numbers = NUMBERS.iter().map(|(_, value)| {
        let value = measured.and_then(value);
        value.map_or_else(String::new, |v| v.to_string())
    });
    let fields: Vec<String> = names.into_iter().chain(numbers).collect();
    fields.join(",")
}

/// Text in the form of RFC 4180, quoted if necessary.
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}
