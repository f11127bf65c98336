//! `report.html`, the report as a page.

use spherule_jobs::FrameRange;

use super::numbers::{bytes, count, duration, percent, seconds as time, short, shortened};
use super::{JobReport, Status};
use crate::FrameReport;
use crate::THESIS_BYTES_PER_PARTICLE;
use crate::frame::DeviceSummary;
use crate::page::{Page, Table};

/// Maximum length of a list of frame numbers or of a setting, in characters.
const MAX_TEXT: usize = 300;

impl JobReport {
    /// The report as a page.
    pub fn to_html(&self) -> String {
        let mut page = Page::new(&self.title());
        page.key_values(&self.progress());
        self.put_failures(&mut page);
        page.section("totals", "Totals");
        page.key_values(&self.totals_list());
        page.section("plots", "Plots by frame");
        if self.done().next().is_some() {
            page.plots(&self.plots());
        } else {
            page.text("No frame is finished yet.");
        }
        self.put_slowest(&mut page);
        self.put_tree(&mut page);
        self.put_frames(&mut page);
        self.put_settings(&mut page);
        page.link("All values as JSON:", super::JSON_FILE);
        page.html()
    }

    /// The title contains the path of the images, by which users know the job.
    fn title(&self) -> String {
        let path = self.settings.iter().find(|(key, _)| key == "output.path");
        path.map_or_else(
            || "Job report".to_owned(),
            |(_, path)| format!("Job report: {}", path.trim_matches('"')),
        )
    }

    fn progress(&self) -> Vec<(&'static str, String)> {
        let done = self.with_status(Status::Done).len();
        let mut list = vec![("Frames", format!("{done} of {} done", self.frames.len()))];
        for (name, status) in [("Failed", Status::Failed), ("Pending", Status::Pending)] {
            let frames = self.with_status(status);
            if !frames.is_empty() {
                list.push((name, format!("{}: {}", frames.len(), list_of(&frames))));
            }
        }
        list.push((
            "Report written on",
            format!(
                "{} threads, {}, {} {}, spherule {}",
                self.machine.threads,
                self.machine.simd,
                std::env::consts::OS,
                std::env::consts::ARCH,
                env!("CARGO_PKG_VERSION")
            ),
        ));
        list
    }

    fn totals_list(&self) -> Vec<(&'static str, String)> {
        let totals = &self.totals;
        let seconds = &totals.seconds;
        let rays = &totals.rays;
        let mut list = vec![
            ("Particles drawn", count(totals.particles)),
            ("Wall-clock time of finished frames", duration(seconds.wall)),
            ("Read", duration(seconds.read)),
            ("Build", duration(seconds.build)),
            ("Surface", duration(seconds.surface)),
            ("Trace", duration(seconds.trace)),
            ("Denoise", duration(seconds.denoise)),
            ("Encode and write", duration(seconds.encode)),
            ("Rays", count(rays.total())),
            (
                "Primary, shadow, reflection, refraction rays",
                [rays.primary, rays.shadow, rays.reflection, rays.refraction].map(count).join(", "),
            ),
        ];
        if let Some(rate) = totals.rays_per_second() {
            list.push(("Rays per second of tracing", format!("{} million", short(rate / 1e6))));
        }
        list.extend([
            ("Peak anonymous memory", bytes(totals.rss.anonymous_peak)),
            ("Peak file-backed memory", bytes(totals.rss.file_peak)),
            ("Peak resident memory", bytes(totals.rss.total_peak)),
            ("Dropped particles (not finite, or too far away)", count(totals.dropped)),
            ("Clamped radii (too small)", count(totals.clamped_radii)),
            ("Clamped pixels (too bright)", count(totals.clamped_pixels)),
            ("Light lost to render.clamp, at most", percent(totals.clamped_light)),
        ]);
        list.extend(totals.device.iter().flat_map(of_device));
        list
    }

    /// Adds the tree of the slowest frame, and the phases of its build.
    fn put_tree(&self, page: &mut Page) {
        let slowest = self.slowest();
        let Some((frame, report)) = slowest.first() else {
            return;
        };
        let build = &report.build;
        // Properties of the tree and its memory
        page.section("build", &format!("Tree of the slowest frame ({})", frame.number));
        page.key_values(&[
            ("Structure", build.structure.clone()),
            ("Particle order", build.order.clone()),
            ("Instruction set for tracing", build.simd.clone()),
            ("Nodes", count(build.nodes)),
            ("Leaves", count(build.leaves)),
            ("Depth", build.depth.to_string()),
            ("SAH cost", short(build.sah_cost)),
            ("Positions", bytes(report.bytes.positions)),
            ("Nodes and indices", bytes(report.bytes.structure)),
            ("Surface", bytes(report.bytes.surface)),
            ("Attributes", bytes(report.bytes.attributes)),
            (
                "Total in anonymous memory, in the mapped file",
                [report.bytes.anonymous(), report.bytes.file.total()].map(bytes).join(", "),
            ),
            ("Total per particle, in anonymous memory, in the mapped file", per_particle(report)),
            ("Build scratch memory", bytes(report.bytes.scratch)),
            ("Build peak memory", bytes(report.bytes.build_peak)),
        ]);
        // Times of the phases of the build
        let table = phases(report);
        if !table.is_empty() {
            page.table(&table);
        }
    }

    fn put_settings(&self, page: &mut Page) {
        page.section("settings", "Settings");
        page.fold(&format!("All {} settings", self.settings.len()));
        let mut table = Table::new("all-settings", &["setting", "value"]);
        for (key, value) in &self.settings {
            table.row([key.clone(), shortened(value, MAX_TEXT)]);
        }
        page.table(&table);
        page.end_fold();
    }
}

/// What the totals have of a GPU.
fn of_device(device: &DeviceSummary) -> [(&'static str, String); 4] {
    let name = format!("{} ({})", device.name, device.driver);
    let times = [device.build, device.trace, device.denoise].map(duration).join(", ");
    [
        ("GPU", shortened(&name, MAX_TEXT)),
        ("GPU: build, trace, denoise", times),
        ("GPU: copies to it, from it", [device.upload, device.download].map(duration).join(", ")),
        ("GPU: most memory", bytes(device.bytes)),
    ]
}

/// Seconds by phase, and their percentage of the total.
fn phases(report: &FrameReport) -> Table {
    let mut table = Table::new("build-phases", &["phase", "time, s", "share, %"]);
    for (name, seconds) in &report.build.phases {
        let part = 100.0 * seconds / report.seconds.build;
        table.row([name.clone(), time(*seconds), short(part)]);
    }
    table
}

/// Frame numbers as ranges.
fn list_of(frames: &[i64]) -> String {
    let range = FrameRange::from_frames(frames.iter().copied());
    range.map_or_else(String::new, |r| shortened(&r.to_string(), MAX_TEXT))
}

/// Bytes per particle in anonymous memory and in the mapped file.
fn per_particle(report: &FrameReport) -> String {
    let each = |bytes: u64| short(bytes as f64 / report.particles.max(1) as f64);
    let held = [report.bytes.anonymous(), report.bytes.file.total()].map(each);
    format!("{} B (program of the thesis: about {} B)", held.join(", "), THESIS_BYTES_PER_PARTICLE)
}
