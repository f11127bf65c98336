//! The results of `spherule scale`: one typed report, from which the tables, `scale.json`, `scale.csv` and the page
//! are made.

use serde::{Deserialize, Serialize};
use spherule_report::frame::{BuildSummary, FrameBytes, RaySummary, RssSummary};
use spherule_report::machine::Machine;
use spherule_tracer::render::RayCounts;
use spherule_tree::accel::Structure;

use super::{Budget, Motion, Representation};

pub mod csv;
pub mod files;
pub mod page;
pub mod parts;
pub mod table;
pub mod thesis;

/// The program that makes these reports; distinguishes them from other files of the same name.
pub const MADE_BY: &str = "spherule scale";

/// File with the typed report.
pub const JSON: &str = "scale.json";
/// File with one row per cell.
pub const CSV: &str = "scale.csv";
/// File with tables and plots.
pub const HTML: &str = "scale.html";

/// Bytes per "MB" of the thesis.
pub(super) const MIB: f64 = 1_048_576.0;
/// Entry for a failed cell.
pub(super) const FAILED: &str = "failed";
/// Entry for a value that was not measured.
pub(super) const MISSING: &str = "-";

/// All measurements, cell by cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ScaleReport {
    /// [`MADE_BY`].
    pub made_by: String,
    /// The machine.
    pub machine: Machine,
    /// The settings.
    pub settings: ScaleSettings,
    /// Number of planned cells; larger than the number of cells if the run was interrupted.
    pub planned: usize,
    /// The finished cells, in the order in which they ran.
    pub cells: Vec<CellReport>,
}

/// The settings of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ScaleSettings {
    /// The frame of the user; None for the box of the thesis.
    pub input: Option<InputSummary>,
    /// Particle counts.
    pub particles: Vec<usize>,
    /// Names of the structures.
    pub structures: Vec<String>,
    /// Camera motions.
    pub motions: Vec<Motion>,
    /// Representations.
    pub representations: Vec<Representation>,
    /// Time or number of images per cell.
    pub budget: Budget,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Samples per pixel.
    pub samples: u32,
    /// Recursion depth.
    pub max_depth: u32,
    /// Seed of the particles.
    pub seed: u64,
    /// Threads in use.
    pub threads: usize,
}

/// A frame of the user.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputSummary {
    /// The path as given.
    pub path: String,
    /// Frame number.
    pub frame: i64,
    /// All its particles.
    pub particles: usize,
}

/// Settings and outcome of one cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CellReport {
    /// How many particles.
    pub particles: usize,
    /// Name of the structure.
    pub structure: String,
    /// Motion of the camera.
    pub motion: Motion,
    /// How positions were held.
    pub representation: Representation,
    /// The outcome.
    #[serde(flatten)]
    pub outcome: CellOutcome,
}

/// Outcome of a cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "status", rename_all = "lowercase")]
pub enum CellOutcome {
    /// It was measured.
    Done(Box<CellMeasurement>),
    /// It failed; other cells are not affected.
    Failed {
        /// The reason.
        reason: String,
    },
}

/// Measurements of one cell. Times are wall-clock seconds, sizes are bytes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CellMeasurement {
    /// Number of images.
    pub images: u64,
    /// Inverse of the time of each image.
    pub images_per_second: Spread,
    /// Time of each image.
    pub image_seconds: Spread,
    /// Time of making or reading the particles; with a native frame, of opening and mapping it.
    pub load_seconds: f64,
    /// Conversion to the native frame that is traced in place, in a separate process; None in memory.
    pub conversion: Option<Conversion>,
    /// Time of the builds; in place, of the levels above the stored ones.
    pub build_seconds: BuildTimes,
    /// The structure, with the phases of the last build.
    pub build: BuildSummary,
    /// Memory by purpose, with the highest peak of all builds.
    pub bytes: FrameBytes,
    /// The same per particle; None without particles.
    pub bytes_per_particle: Option<PerParticle>,
    /// Resident memory of the whole process of the cell.
    pub rss: RssSummary,
    /// Rays of all images.
    pub rays: RaySummary,
    /// Rays divided by the time of all images.
    pub rays_per_second: RayRates,
}

/// Measurements of a conversion to a native frame.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Conversion {
    /// Time of making or reading the particles.
    pub load_seconds: f64,
    /// Time of ordering, encoding and writing them.
    pub seconds: f64,
    /// Length of the file.
    pub file_bytes: u64,
    /// Maximum error of a stored position, world units.
    pub max_error: f64,
    /// The same as a fraction of the smallest radius; None for spheres without a radius.
    pub max_error_of_radius: Option<f64>,
    /// Resident memory of its process.
    pub rss: RssSummary,
}

/// Mean and spread of a series.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the names are self-explanatory")]
pub struct Spread {
    pub mean: f64,
    /// Standard deviation of the sample; None of a single value.
    pub sd: Option<f64>,
    pub min: f64,
    pub max: f64,
}

/// Times of builds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct BuildTimes {
    /// Number of builds.
    pub builds: usize,
    /// The first build, which allocates its memory.
    pub first: f64,
    /// The median.
    pub median: f64,
    /// The fastest.
    pub min: f64,
    /// The slowest.
    pub max: f64,
}

/// Bytes per particle by purpose; see [`FrameBytes`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "see `FrameBytes`")]
pub struct PerParticle {
    pub positions: f64,
    pub structure: f64,
    pub attributes: f64,
    pub scratch: f64,
    pub build_peak: f64,
    /// Positions, structure and attributes in anonymous memory.
    pub anonymous: f64,
    /// Positions, structure and attributes in a mapped file.
    pub file: f64,
}

/// Rays per second by purpose. The kinds of rays are interleaved within an image, so the rates add up to the total,
/// and do not show how fast one kind alone would be.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the names are self-explanatory")]
pub struct RayRates {
    pub primary: f64,
    pub shadow: f64,
    pub reflection: f64,
    pub refraction: f64,
    pub total: f64,
}

impl Spread {
    /// The spread of `values`; zeros if there are none.
    pub fn of(values: &[f64]) -> Self {
        if values.is_empty() {
            return Self::default();
        }
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        let squares: f64 = values.iter().map(|v| (v - mean) * (v - mean)).sum();
        Self {
            mean,
            sd: (values.len() > 1).then(|| (squares / (count - 1.0)).sqrt()),
            min: values.iter().copied().fold(f64::INFINITY, f64::min),
            max: values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        }
    }
}

impl BuildTimes {
    /// The times of builds in their order; zeros if there are none.
    pub fn of(seconds: &[f64]) -> Self {
        let mut sorted = seconds.to_vec();
        sorted.sort_unstable_by(f64::total_cmp);
        let at = |place: usize| sorted.get(place).copied().unwrap_or_default();
        Self {
            builds: seconds.len(),
            first: seconds.first().copied().unwrap_or_default(),
            median: 0.5 * (at(seconds.len().saturating_sub(1) / 2) + at(seconds.len() / 2)),
            min: at(0),
            max: sorted.last().copied().unwrap_or_default(),
        }
    }
}

impl PerParticle {
    /// `bytes` divided by `particles`.
    pub fn of(bytes: &FrameBytes, particles: u64) -> Option<Self> {
        let share = |bytes: u64| bytes as f64 / particles as f64;
        (particles > 0).then(|| Self {
            positions: share(bytes.positions),
            structure: share(bytes.structure),
            attributes: share(bytes.attributes),
            scratch: share(bytes.scratch),
            build_peak: share(bytes.build_peak),
            anonymous: share(bytes.anonymous()),
            file: share(bytes.file.total()),
        })
    }
}

impl RayRates {
    /// `rays` divided by `seconds`.
    pub fn of(rays: RayCounts, seconds: f64) -> Self {
        let rate = |count: u64| {
            if seconds > 0.0 { count as f64 / seconds } else { 0.0 }
        };
        Self {
            primary: rate(rays.primary),
            shadow: rate(rays.shadow),
            reflection: rate(rays.reflection),
            refraction: rate(rays.refraction),
            total: rate(rays.total()),
        }
    }
}

impl CellReport {
    /// The measurements, unless the cell failed.
    pub fn measured(&self) -> Option<&CellMeasurement> {
        match &self.outcome {
            CellOutcome::Done(measured) => Some(measured),
            CellOutcome::Failed { .. } => None,
        }
    }
}

impl ScaleReport {
    /// The columns of tables: every structure in all representations that it supports, with a title.
    pub fn columns(&self) -> Vec<Column> {
        let structures = self.settings.structures.iter();
        let pairs = structures.flat_map(|name| {
            let structure: Option<Structure> = name.parse().ok();
            let all = self.settings.representations.iter();
            all.filter(move |r| structure.is_some_and(|s| r.goes_with(s))).map(move |r| (name, *r))
        });
        pairs
            .map(|(structure, representation)| Column {
                structure: structure.clone(),
                representation,
                title: match (representation, representation.encoding()) {
                    (Representation::Gpu, _) => format!("{structure}, GPU"),
                    (_, None) => structure.clone(),
                    (_, Some(encoding)) => format!("{structure}, {encoding} file"),
                },
            })
            .collect()
    }

    /// The cells of one count and column, one per motion.
    pub fn cells_of<'a>(
        &'a self,
        particles: usize,
        column: &'a Column,
    ) -> impl Iterator<Item = &'a CellReport> {
        self.cells.iter().filter(move |cell| {
            cell.particles == particles
                && cell.structure == column.structure
                && cell.representation == column.representation
        })
    }

    /// The median over all motions of the median build time, in seconds.
    pub fn build_seconds(&self, particles: usize, column: &Column) -> Option<f64> {
        let cells = self.cells_of(particles, column);
        let medians: Vec<f64> =
            cells.filter_map(|c| Some(c.measured()?.build_seconds.median)).collect();
        (!medians.is_empty()).then(|| BuildTimes::of(&medians).median)
    }

    /// The highest peak over all motions of resident memory, bytes.
    pub fn peak_bytes(&self, particles: usize, column: &Column) -> Option<u64> {
        let cells = self.cells_of(particles, column);
        cells.filter_map(|c| Some(c.measured()?.rss.total_peak)).max()
    }

    /// The highest peak over all motions of anonymous memory, bytes.
    pub fn anonymous_peak_bytes(&self, particles: usize, column: &Column) -> Option<u64> {
        let cells = self.cells_of(particles, column);
        cells.filter_map(|c| Some(c.measured()?.rss.anonymous_peak)).max()
    }

    /// The highest peak over all motions of mapped files, bytes.
    pub fn file_peak_bytes(&self, particles: usize, column: &Column) -> Option<u64> {
        let cells = self.cells_of(particles, column);
        cells.filter_map(|c| Some(c.measured()?.rss.file_peak)).max()
    }

    /// The failed cells, with their reasons.
    pub fn failed(&self) -> impl Iterator<Item = (&CellReport, &str)> {
        self.cells.iter().filter_map(|cell| match &cell.outcome {
            CellOutcome::Failed { reason } => Some((cell, reason.as_str())),
            CellOutcome::Done(_) => None,
        })
    }
}

/// A column of the tables.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Name of the structure.
    pub structure: String,
    /// Of the positions.
    pub representation: Representation,
    /// Title for tables.
    pub title: String,
}

#[cfg(test)]
pub(crate) mod tests;
