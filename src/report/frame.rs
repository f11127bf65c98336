//! The report of one frame, as it stands in the ledger and in `report.json`.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::accel::BuildReport;
use crate::render::RayCounts;

/// What one image took. Times are wall-clock seconds, sizes bytes.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct FrameReport {
    /// Particles drawn.
    pub particles: u64,
    /// Particles left out because a coordinate was NaN or infinite.
    pub dropped: u64,
    /// Particles whose radius was raised to the least that can be drawn.
    pub clamped_radii: u64,
    /// Pixels whose colour was too bright for half floats.
    pub clamped_pixels: u64,
    /// Time by stage.
    pub seconds: StageSeconds,
    /// The acceleration structure.
    pub build: BuildSummary,
    /// Memory by purpose.
    pub bytes: FrameBytes,
    /// Rays by purpose.
    pub rays: RaySummary,
    /// Memory of the process when the frame was done.
    pub rss: RssSummary,
}

/// Wall-clock seconds of the stages, from when they have a thread to work on; neighbouring frames overlap.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[expect(missing_docs, reason = "the names say all")]
pub struct StageSeconds {
    pub read: f64,
    pub build: f64,
    /// Making the surface, apart from the tree.
    pub surface: f64,
    pub trace: f64,
    pub encode: f64,
    /// From the image before, or the beginning of the run, to this image: summed, the time that the
    /// frames had anyone wait.
    pub wall: f64,
}

/// What [`BuildReport`] says, in the form of the files.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[expect(missing_docs, reason = "see `BuildReport`")]
pub struct BuildSummary {
    pub structure: String,
    pub order: String,
    pub simd: String,
    pub nodes: u64,
    pub leaves: u64,
    pub depth: u32,
    pub sah_cost: f64,
    /// Seconds by phase, in order.
    pub phases: Vec<(String, f64)>,
}

/// Bytes by part: what a traced frame holds, in anonymous memory or in a mapped file, and what its build
/// needed beside that.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct FrameBytes {
    /// Positions and radii in tree order.
    pub positions: u64,
    /// Nodes and the way back to the file's order.
    pub structure: u64,
    /// Attributes that images are made of.
    pub attributes: u64,
    /// The surface, apart from positions and structure.
    pub surface: u64,
    /// Most held while making it.
    pub surface_peak: u64,
    /// Held while building and let go then, beside positions and structure.
    pub scratch: u64,
    /// Most held while building, the frame as read not counted unless it is traced where it lies.
    pub build_peak: u64,
    /// How much of positions, structure and attributes lies in a mapped file.
    pub file: FileBytes,
}

/// Bytes by part in a mapped file. They are not anonymous memory: the system may drop their pages and
/// read them again.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
#[expect(missing_docs, reason = "see `FrameBytes`")]
pub struct FileBytes {
    pub positions: u64,
    pub structure: u64,
    pub attributes: u64,
}

/// Rays by purpose.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[expect(missing_docs, reason = "the names say all")]
pub struct RaySummary {
    pub primary: u64,
    pub shadow: u64,
    pub reflection: u64,
    pub refraction: u64,
}

/// Resident memory of the process, the largest seen so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RssSummary {
    /// Heap and stacks: [`crate::metrics::MemoryPeaks::anonymous`].
    pub anonymous_peak: u64,
    /// Mapped files.
    pub file_peak: u64,
    /// Everything, as the kernel's `VmHWM` has it.
    pub total_peak: u64,
    /// Heap and stacks when this frame was done: what does not grow over a sequence.
    pub anonymous: u64,
}

impl From<RayCounts> for RaySummary {
    fn from(rays: RayCounts) -> Self {
        Self {
            primary: rays.primary,
            shadow: rays.shadow,
            reflection: rays.reflection,
            refraction: rays.refraction,
        }
    }
}

impl RaySummary {
    /// Rays of all kinds.
    pub const fn total(&self) -> u64 {
        saturating_sum(&[self.primary, self.shadow, self.reflection, self.refraction])
    }
}

impl FrameReport {
    /// Takes over what the builder says.
    pub fn set_build(&mut self, report: &BuildReport) {
        self.seconds.build = report.total.as_secs_f64();
        self.build = BuildSummary {
            structure: report.structure.name().to_owned(),
            order: report.order.to_owned(),
            simd: report.simd.to_owned(),
            nodes: report.nodes,
            leaves: report.leaves,
            depth: report.depth,
            sah_cost: report.sah_cost,
            phases: report
                .phases
                .iter()
                .map(|p| (p.name.to_owned(), p.time.as_secs_f64()))
                .collect(),
        };
        self.bytes.set_build(report);
    }

    /// Sum of the stages.
    pub fn total(&self) -> Duration {
        let s = &self.seconds;
        let seconds = s.read + s.build + s.surface + s.trace + s.encode;
        // Of a damaged ledger they may be negative, or more than there are.
        Duration::try_from_secs_f64(seconds.max(0.0)).unwrap_or(Duration::MAX)
    }

    /// Bytes of positions, radii and tree for a particle; None without particles.
    pub fn bytes_per_particle(&self) -> Option<f64> {
        let bytes = self.bytes.positions.saturating_add(self.bytes.structure);
        ratio(bytes, float(self.particles))
    }

    /// Rays of all kinds in a second of tracing; None if there was none.
    pub fn rays_per_second(&self) -> Option<f64> {
        ratio(self.rays.total(), self.seconds.trace)
    }

    /// Adds what can be summed over frames; of memory the larger value stays.
    pub(super) fn add(&mut self, frame: &Self) {
        add(&mut self.particles, frame.particles);
        add(&mut self.dropped, frame.dropped);
        add(&mut self.clamped_radii, frame.clamped_radii);
        add(&mut self.clamped_pixels, frame.clamped_pixels);
        self.seconds.read += frame.seconds.read;
        self.seconds.build += frame.seconds.build;
        self.seconds.surface += frame.seconds.surface;
        self.seconds.trace += frame.seconds.trace;
        self.seconds.encode += frame.seconds.encode;
        self.seconds.wall += frame.seconds.wall;
        add(&mut self.rays.primary, frame.rays.primary);
        add(&mut self.rays.shadow, frame.rays.shadow);
        add(&mut self.rays.reflection, frame.rays.reflection);
        add(&mut self.rays.refraction, frame.rays.refraction);
        self.rss.anonymous_peak = self.rss.anonymous_peak.max(frame.rss.anonymous_peak);
        self.rss.file_peak = self.rss.file_peak.max(frame.rss.file_peak);
        self.rss.total_peak = self.rss.total_peak.max(frame.rss.total_peak);
    }
}

impl FrameBytes {
    /// Takes over what the builder says; attributes are not its business and stay.
    fn set_build(&mut self, report: &BuildReport) {
        self.positions = report.position_bytes;
        self.structure = report.structure_bytes;
        let lasting = report.position_bytes + report.structure_bytes;
        self.scratch = report.peak_bytes.saturating_sub(lasting);
        self.build_peak = report.peak_bytes;
        // Positions that are traced where they lie do so as a whole; of the nodes, the lowest.
        self.file.positions = report.file_bytes.min(report.position_bytes);
        self.file.structure = report.file_bytes - self.file.positions;
    }

    /// Held while tracing: positions, structure, surface and attributes.
    pub const fn held(&self) -> u64 {
        saturating_sum(&[
            self.positions,
            self.structure,
            self.surface,
            self.attributes,
        ])
    }

    /// The part of [`Self::held`] that lies in anonymous memory.
    pub const fn anonymous(&self) -> u64 {
        self.held().saturating_sub(self.file.total())
    }
}

impl FileBytes {
    /// Of all parts.
    pub const fn total(&self) -> u64 {
        saturating_sum(&[self.positions, self.structure, self.attributes])
    }
}

/// What a ledger says may be anything.
fn add(to: &mut u64, value: u64) {
    *to = to.saturating_add(value);
}

/// The same for several.
const fn saturating_sum(values: &[u64]) -> u64 {
    let (mut sum, mut rest) = (0_u64, values);
    while let [first, others @ ..] = rest {
        sum = sum.saturating_add(*first);
        rest = others;
    }
    sum
}

fn ratio(of: u64, to: f64) -> Option<f64> {
    (to > 0.0).then(|| float(of) / to)
}

#[expect(clippy::cast_precision_loss, reason = "for people and ratios")]
const fn float(count: u64) -> f64 {
    count as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::accel::Structure;

    fn built(file_bytes: u64) -> BuildReport {
        BuildReport {
            structure: Structure::Kdtree,
            order: "",
            total: Duration::ZERO,
            phases: Vec::new(),
            particles: 100,
            references: 100,
            nodes: 1,
            leaves: 7,
            depth: 1,
            sah_cost: 1.0,
            position_bytes: 400,
            structure_bytes: 60,
            file_bytes,
            peak_bytes: 470,
            simd: "",
        }
    }

    #[test]
    fn bytes_are_in_the_file_or_in_anonymous_memory() {
        let mut report = FrameReport::default();
        report.bytes.attributes = 800;
        report.set_build(&built(450));
        let bytes = report.bytes;
        assert_eq!((bytes.file.positions, bytes.file.structure), (400, 50));
        assert_eq!((bytes.held(), bytes.anonymous()), (1260, 810));
        assert_eq!((bytes.scratch, bytes.build_peak), (10, 470));
        // A built tree after one in place.
        report.set_build(&built(0));
        assert_eq!(report.bytes.file, FileBytes::default());
        assert_eq!(report.bytes.anonymous(), 1260);
    }
}
