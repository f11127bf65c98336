//! The report of one frame, in the form of the ledger and of `report.json`.

use std::time::Duration;

use serde::{Deserialize, Serialize};

use spherule_tracer::render::RayCounts;
use spherule_tree::accel::BuildReport;

/// Measurements of one image. Times are wall-clock seconds, sizes are bytes.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct FrameReport {
    /// Number of particles drawn.
    pub particles: u64,
    /// Number of particles in the files; 0 in reports of older versions.
    pub particles_read: u64,
    /// Number of particles dropped because a coordinate was NaN or infinite.
    pub dropped: u64,
    /// Number of particles with a radius raised to the minimum.
    pub clamped_radii: u64,
    /// Number of pixels with a colour too bright for half floats.
    pub clamped_pixels: u64,
    /// Part of the light of the image that `render.clamp` took away, 0 to 1.
    pub clamped_light: f64,
    /// The samples of an image with a limit of noise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sampling: Option<SamplingSummary>,
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
    /// The GPU that rendered it, if one did.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub device: Option<DeviceSummary>,
}

/// An image whose noise is limited (`render.noise`).
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct SamplingSummary {
    /// Mean number of samples of a pixel.
    pub samples: f64,
    /// Part of the image that has the maximum number of samples and more noise, 0 to 1.
    pub noisy: f64,
}

/// A picture on a GPU. Times are seconds on its own clock, 0 if it has none; those of copies are the host's.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct DeviceSummary {
    /// Name of the adapter.
    pub name: String,
    /// Name and version of its driver.
    pub driver: String,
    /// Copying the frame to the device.
    pub upload: f64,
    /// Building the tree.
    pub build: f64,
    /// Tracing the picture.
    pub trace: f64,
    /// Removing noise.
    pub denoise: f64,
    /// Copying the picture to its film.
    pub download: f64,
    /// Memory of the device in use, bytes.
    pub bytes: u64,
}

impl DeviceSummary {
    /// Adds the times of another picture; keeps the larger memory, and the names of all devices.
    fn add(&mut self, other: &Self) {
        for (names, name) in [(&mut self.name, &other.name), (&mut self.driver, &other.driver)] {
            if names.is_empty() {
                names.clone_from(name);
            } else if names.split("; ").all(|known| known != name) {
                *names = format!("{names}; {name}");
            }
        }
        self.upload += other.upload;
        self.build += other.build;
        self.trace += other.trace;
        self.denoise += other.denoise;
        self.download += other.download;
        self.bytes = self.bytes.max(other.bytes);
    }
}

/// Wall-clock seconds of the stages, from the moment that they have a thread; neighbouring frames overlap.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[expect(missing_docs, reason = "the names are self-explanatory")]
pub struct StageSeconds {
    pub read: f64,
    pub build: f64,
    /// Building the surface, without the tree.
    pub surface: f64,
    pub trace: f64,
    /// Removing noise; 0 in reports of older versions.
    #[serde(default)]
    pub denoise: f64,
    pub encode: f64,
    /// From the previous image, or the start of the run, to this image. The sum is the time that the user waits for
    /// the frames.
    pub wall: f64,
}

/// The content of a [`BuildReport`] in the form of files.
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

/// Memory by part, bytes: what a frame occupies during tracing, in anonymous memory or in a mapped file, and the
/// additional memory of its build.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct FrameBytes {
    /// Positions and radii in tree order.
    pub positions: u64,
    /// Nodes and particle indices.
    pub structure: u64,
    /// Attributes for the images.
    pub attributes: u64,
    /// The surface, without positions and structure.
    pub surface: u64,
    /// Peak memory of its build.
    pub surface_peak: u64,
    /// Additional memory during the build, without positions and structure.
    pub scratch: u64,
    /// Peak memory of the build. Includes the input only if the input itself is traced.
    pub build_peak: u64,
    /// The part of positions, structure and attributes that is in a mapped file.
    pub file: FileBytes,
}

/// Bytes by part in a mapped file. This is not anonymous memory: the system may drop these pages and read them again.
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
#[expect(missing_docs, reason = "the names are self-explanatory")]
pub struct RaySummary {
    pub primary: u64,
    pub shadow: u64,
    pub reflection: u64,
    pub refraction: u64,
}

/// Resident memory of the process, the largest values so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RssSummary {
    /// Heap and stacks: [`spherule_files::memory::MemoryPeaks::anonymous`].
    pub anonymous_peak: u64,
    /// Mapped files.
    pub file_peak: u64,
    /// Everything, from the kernel's `VmHWM`.
    pub total_peak: u64,
    /// Heap and stacks when this frame was finished, which do not grow over a sequence.
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
    /// Number of all rays.
    pub const fn total(&self) -> u64 {
        saturating_sum(&[self.primary, self.shadow, self.reflection, self.refraction])
    }
}

impl FrameReport {
    /// Copies the values of a build report.
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
        // In a damaged ledger, times may be negative or too large.
        Duration::try_from_secs_f64(seconds.max(0.0)).unwrap_or(Duration::MAX)
    }

    /// Bytes of positions, radii and tree per particle; None without particles.
    pub fn bytes_per_particle(&self) -> Option<f64> {
        let bytes = self.bytes.positions.saturating_add(self.bytes.structure);
        ratio(bytes, float(self.particles))
    }

    /// Number of all rays per second of tracing; None without tracing.
    pub fn rays_per_second(&self) -> Option<f64> {
        ratio(self.rays.total(), self.seconds.trace)
    }

    /// Adds all values that can be summed over frames; for memory and parts, keeps the larger value.
    pub(super) fn add(&mut self, frame: &Self) {
        add(&mut self.particles, frame.particles);
        add(&mut self.particles_read, frame.particles_read);
        add(&mut self.dropped, frame.dropped);
        add(&mut self.clamped_radii, frame.clamped_radii);
        add(&mut self.clamped_pixels, frame.clamped_pixels);
        self.clamped_light = self.clamped_light.max(frame.clamped_light);
        self.seconds.read += frame.seconds.read;
        self.seconds.build += frame.seconds.build;
        self.seconds.surface += frame.seconds.surface;
        self.seconds.trace += frame.seconds.trace;
        self.seconds.denoise += frame.seconds.denoise;
        self.seconds.encode += frame.seconds.encode;
        self.seconds.wall += frame.seconds.wall;
        add(&mut self.rays.primary, frame.rays.primary);
        add(&mut self.rays.shadow, frame.rays.shadow);
        add(&mut self.rays.reflection, frame.rays.reflection);
        add(&mut self.rays.refraction, frame.rays.refraction);
        self.rss.anonymous_peak = self.rss.anonymous_peak.max(frame.rss.anonymous_peak);
        self.rss.file_peak = self.rss.file_peak.max(frame.rss.file_peak);
        self.rss.total_peak = self.rss.total_peak.max(frame.rss.total_peak);
        if let Some(device) = &frame.device {
            self.device.get_or_insert_default().add(device);
        }
    }
}

impl FrameBytes {
    /// Copies the values of a build report; attributes are not affected.
    fn set_build(&mut self, report: &BuildReport) {
        self.positions = report.position_bytes;
        self.structure = report.structure_bytes;
        let lasting = report.position_bytes + report.structure_bytes;
        self.scratch = report.peak_bytes.saturating_sub(lasting);
        self.build_peak = report.peak_bytes;
        // If particles are traced in place, all positions are in the file, and the lowest nodes.
        self.file.positions = report.file_bytes.min(report.position_bytes);
        self.file.structure = report.file_bytes - self.file.positions;
    }

    /// Memory during tracing: positions, structure, surface and attributes.
    pub const fn held(&self) -> u64 {
        saturating_sum(&[self.positions, self.structure, self.surface, self.attributes])
    }

    /// The part of [`Self::held`] that is in anonymous memory.
    pub const fn anonymous(&self) -> u64 {
        self.held().saturating_sub(self.file.total())
    }
}

impl FileBytes {
    /// The sum of all parts.
    pub const fn total(&self) -> u64 {
        saturating_sum(&[self.positions, self.structure, self.attributes])
    }
}

/// Saturating addition, because a damaged ledger may contain any numbers.
fn add(to: &mut u64, value: u64) {
    *to = to.saturating_add(value);
}

/// Saturating sum of several values.
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
    use spherule_tree::accel::Structure;

    #[test]
    fn totals_name_each_device_once() {
        let frame = |name: &str, bytes| FrameReport {
            device: Some(DeviceSummary {
                name: name.to_owned(),
                driver: "1.2".to_owned(),
                upload: 0.5,
                bytes,
                ..DeviceSummary::default()
            }),
            ..FrameReport::default()
        };
        let mut totals = FrameReport::default();
        for report in [frame("A, 8 bits", 3), frame("B", 7), frame("A, 8 bits", 5)] {
            totals.add(&report);
        }
        totals.add(&FrameReport::default());
        let device = totals.device.expect("frames of devices");
        assert_eq!([device.name.as_str(), device.driver.as_str()], ["A, 8 bits; B", "1.2"]);
        assert_eq!((device.upload, device.bytes), (1.5, 7));
    }

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
        // A built tree, after a tree in place.
        report.set_build(&built(0));
        assert_eq!(report.bytes.file, FileBytes::default());
        assert_eq!(report.bytes.anonymous(), 1260);
    }
}
