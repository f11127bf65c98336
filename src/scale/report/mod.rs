//! What `spherule scale` has measured: one typed report, from which the tables, `scale.json`,
//! `scale.csv` and the page are made.

use serde::{Deserialize, Serialize};

use super::{Budget, Motion, Representation};
use crate::accel::Structure;
use crate::render::RayCounts;
use crate::report::frame::{BuildSummary, FrameBytes, RaySummary, RssSummary};
use crate::report::machine::Machine;

pub mod csv;
pub mod files;
pub mod page;
pub mod parts;
pub mod table;
pub mod thesis;

/// Who makes these reports; tells ours from files of the same name.
pub const MADE_BY: &str = "spherule scale";

/// File of the typed report.
pub const JSON: &str = "scale.json";
/// File of one row per cell.
pub const CSV: &str = "scale.csv";
/// File of tables and plots.
pub const HTML: &str = "scale.html";

/// Bytes in the thesis's "MB".
pub(super) const MIB: f64 = 1_048_576.0;
/// What stands where a cell has failed.
pub(super) const FAILED: &str = "failed";
/// What stands where nothing was measured.
pub(super) const MISSING: &str = "-";

/// Everything that was measured, cell by cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ScaleReport {
    /// [`MADE_BY`].
    pub made_by: String,
    /// Where it was measured.
    pub machine: Machine,
    /// What was asked.
    pub settings: ScaleSettings,
    /// Cells that were to be measured; more than there are if the run was interrupted.
    pub planned: usize,
    /// The cells that have ended, in the order in which they ran.
    pub cells: Vec<CellReport>,
}

/// What was asked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ScaleSettings {
    /// The user's frame; None is the thesis's box.
    pub input: Option<InputSummary>,
    /// Counts.
    pub particles: Vec<usize>,
    /// Names of the structures.
    pub structures: Vec<String>,
    /// Camera motions.
    pub motions: Vec<Motion>,
    /// Representations.
    pub representations: Vec<Representation>,
    /// Time or images of a cell.
    pub budget: Budget,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Samples a pixel.
    pub samples: u32,
    /// Levels of recursion.
    pub max_depth: u32,
    /// Seed of the particles.
    pub seed: u64,
    /// Threads in use.
    pub threads: usize,
}

/// A frame of the user's.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputSummary {
    /// As it was named.
    pub path: String,
    /// Frame number.
    pub frame: i64,
    /// All its particles.
    pub particles: usize,
}

/// One cell.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CellReport {
    /// How many particles.
    pub particles: usize,
    /// Name of the structure.
    pub structure: String,
    /// How the camera moved.
    pub motion: Motion,
    /// How positions were held.
    pub representation: Representation,
    /// How it ended.
    #[serde(flatten)]
    pub outcome: CellOutcome,
}

/// How a cell ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "status", rename_all = "lowercase")]
pub enum CellOutcome {
    /// It was measured.
    Done(Box<CellMeasurement>),
    /// It was not; the others are not concerned.
    Failed {
        /// Why.
        reason: String,
    },
}

/// What one cell has shown. Times are wall-clock seconds, sizes bytes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CellMeasurement {
    /// Images traced.
    pub images: u64,
    /// One over the time of each image.
    pub images_per_second: Spread,
    /// The time of each image.
    pub image_seconds: Spread,
    /// Making or reading the particles; of a native frame, opening and mapping it.
    pub load_seconds: f64,
    /// How the native frame was made that is traced in place, in a process of its own; None in memory.
    pub conversion: Option<Conversion>,
    /// Time of the builds; in place, of the levels above the stored ones.
    pub build_seconds: BuildTimes,
    /// The structure, phases of the last build.
    pub build: BuildSummary,
    /// Memory by purpose; the peak is the highest of all builds.
    pub bytes: FrameBytes,
    /// The same a particle; None without particles.
    pub bytes_per_particle: Option<PerParticle>,
    /// Resident memory of the cell's whole process.
    pub rss: RssSummary,
    /// Rays of all images.
    pub rays: RaySummary,
    /// Rays over the time of all images.
    pub rays_per_second: RayRates,
}

/// How a native frame was made.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Conversion {
    /// Making or reading the particles.
    pub load_seconds: f64,
    /// Bringing them into order, coding and writing them.
    pub seconds: f64,
    /// Length of the file.
    pub file_bytes: u64,
    /// The farthest that a stored position is from the true one, world units.
    pub max_error: f64,
    /// The same as a part of the smallest radius; None of spheres without one.
    pub max_error_of_radius: Option<f64>,
    /// Resident memory of the process that did it.
    pub rss: RssSummary,
}

/// Mean and spread of a series.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the names say all")]
pub struct Spread {
    pub mean: f64,
    /// Standard deviation of the sample; None of a single value.
    pub sd: Option<f64>,
    pub min: f64,
    pub max: f64,
}

/// How long builds took.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct BuildTimes {
    /// How many there were.
    pub builds: usize,
    /// The first one, in new memory.
    pub first: f64,
    /// The middle one of all.
    pub median: f64,
    /// The fastest.
    pub min: f64,
    /// The slowest.
    pub max: f64,
}

/// Bytes a particle by purpose; see [`FrameBytes`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "see `FrameBytes`")]
pub struct PerParticle {
    pub positions: f64,
    pub structure: f64,
    pub attributes: f64,
    pub scratch: f64,
    pub build_peak: f64,
    /// Positions, structure and attributes together: those in anonymous memory.
    pub anonymous: f64,
    /// And those in a mapped file.
    pub file: f64,
}

/// Rays a second by purpose. Kinds are traced in turns within an image, so these add up to the
/// total, and none says how fast its kind alone would be.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "the names say all")]
pub struct RayRates {
    pub primary: f64,
    pub shadow: f64,
    pub reflection: f64,
    pub refraction: f64,
    pub total: f64,
}

impl Spread {
    /// Of `values`; zeros if there are none.
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
    /// Of the `seconds` of builds in their order; zeros if there are none.
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
    /// `bytes` shared by `particles`.
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
    /// `rays` in `seconds`.
    pub fn of(rays: RayCounts, seconds: f64) -> Self {
        let rate = |count: u64| {
            if seconds > 0.0 {
                count as f64 / seconds
            } else {
                0.0
            }
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
    /// What was measured, if it was.
    pub fn measured(&self) -> Option<&CellMeasurement> {
        match &self.outcome {
            CellOutcome::Done(measured) => Some(measured),
            CellOutcome::Failed { .. } => None,
        }
    }
}

impl ScaleReport {
    /// The columns of tables: every structure in every representation that it goes with, with a name for
    /// people.
    pub fn columns(&self) -> Vec<Column> {
        let structures = self.settings.structures.iter();
        let pairs = structures.flat_map(|name| {
            let structure: Option<Structure> = name.parse().ok();
            let all = self.settings.representations.iter();
            all.filter(move |r| structure.is_some_and(|s| r.goes_with(s)))
                .map(move |r| (name, *r))
        });
        pairs
            .map(|(structure, representation)| Column {
                structure: structure.clone(),
                representation,
                title: match representation.encoding() {
                    None => structure.clone(),
                    Some(encoding) => format!("{structure}, {encoding} file"),
                },
            })
            .collect()
    }

    /// The cells of one count and column, one a motion.
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

    /// The median over motions of the median build time in seconds.
    pub fn build_seconds(&self, particles: usize, column: &Column) -> Option<f64> {
        let cells = self.cells_of(particles, column);
        let medians: Vec<f64> = cells
            .filter_map(|c| Some(c.measured()?.build_seconds.median))
            .collect();
        (!medians.is_empty()).then(|| BuildTimes::of(&medians).median)
    }

    /// The highest peak over motions of everything resident, bytes.
    pub fn peak_bytes(&self, particles: usize, column: &Column) -> Option<u64> {
        let cells = self.cells_of(particles, column);
        cells
            .filter_map(|c| Some(c.measured()?.rss.total_peak))
            .max()
    }

    /// The highest peak over motions of anonymous memory, bytes.
    pub fn anonymous_peak_bytes(&self, particles: usize, column: &Column) -> Option<u64> {
        let cells = self.cells_of(particles, column);
        cells
            .filter_map(|c| Some(c.measured()?.rss.anonymous_peak))
            .max()
    }

    /// The same of mapped files.
    pub fn file_peak_bytes(&self, particles: usize, column: &Column) -> Option<u64> {
        let cells = self.cells_of(particles, column);
        cells
            .filter_map(|c| Some(c.measured()?.rss.file_peak))
            .max()
    }

    /// Cells that have failed.
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
    /// For people.
    pub title: String,
}

#[cfg(test)]
pub(crate) mod tests;
