//! Tables of frames. For a long sequence `report.json` lists all frames, and this page a selection.

use super::numbers::{count, float, mib, percent, seconds, short, shortened};
use super::{JobFrame, JobReport, Status};
use crate::page::{Page, Table};

/// Maximum number of rows in the table of frames.
const MAX_FRAMES: usize = 300;
/// Maximum number of rows in the table of failures.
const MAX_FAILURES: usize = 50;
/// Maximum length of a message, in characters.
const MAX_TEXT: usize = 500;

const HEADS: [&str; 19] = [
    "frame",
    "status",
    "particles",
    "read\ns",
    "build\ns",
    "surface\ns",
    "trace\ns",
    "encode\ns",
    "total\ns",
    "rays\nM",
    "rays\nM/s",
    "anonymous peak\nMiB",
    "file-backed peak\nMiB",
    "tree bytes\nper particle",
    "build peak\nMiB",
    "dropped\nparticles",
    "clamped\nradii",
    "clamped\npixels",
    "clamped\nlight",
];

impl JobReport {
    /// Adds failed frames with their reasons, if there are any.
    pub(super) fn put_failures(&self, page: &mut Page) {
        let failed = || self.frames.iter().filter(|f| f.status == Status::Failed);
        let total = failed().count();
        if total == 0 {
            return;
        }
        page.section("failed", "Failed frames");
        page.warning(&match total {
            1 => "1 frame failed.".to_owned(),
            total => format!("{total} frames failed."),
        });
        // List the first of them
        let mut table = Table::new("failed-frames", &["frame", "image", "reason"]);
        for frame in failed().take(MAX_FAILURES) {
            table.bad_row([
                frame.number.to_string(),
                frame.image.clone().unwrap_or_default(),
                shortened(frame.reason.as_deref().unwrap_or("not recorded"), MAX_TEXT),
            ]);
        }
        page.table(&table);
        if total > MAX_FAILURES {
            let note = format!("The first {MAX_FAILURES} are listed; all are in");
            page.link(&note, super::JSON_FILE);
        }
    }

    /// Adds the slowest frames, if there are at least two.
    pub(super) fn put_slowest(&self, page: &mut Page) {
        if self.done().count() < 2 {
            return;
        }
        page.section("slowest", "Slowest frames");
        // Up to the sum of the stages; the table of all frames has the other columns.
        let mut table = Table::new("slowest-frames", &HEADS[..9]);
        for (frame, _) in self.slowest() {
            table.row(cells(frame).into_iter().take(9));
        }
        page.table(&table);
    }

    /// Adds all frames that were attempted.
    pub(super) fn put_frames(&self, page: &mut Page) {
        page.section("frames", "Frames");
        let tried: Vec<&JobFrame> =
            self.frames.iter().filter(|frame| frame.status != Status::Pending).collect();
        if tried.is_empty() {
            page.text("No frame has been attempted yet.");
            return;
        }
        // Choose frames at equal distances, to limit the size of the page
        let mut table = Table::new("all-frames", &HEADS);
        let chosen = evenly(tried.len(), MAX_FRAMES);
        let all = chosen.len() == tried.len();
        for index in chosen {
            let frame = tried[index];
            if frame.status == Status::Failed {
                table.bad_row(cells(frame));
            } else {
                table.row(cells(frame));
            }
        }
        page.text(
            "Times are wall-clock; neighbouring frames overlap. Memory peaks are those of the process, from \
             the start of its run to this frame.",
        );
        if !all {
            let tried = count(tried.len() as u64);
            let note = format!("{MAX_FRAMES} of {tried} frames, evenly spaced; all are in");
            page.link(&note, super::JSON_FILE);
        }
        page.table(&table);
    }
}

/// At most `most` of the indices below `total`, evenly distributed, including the first and the last one.
fn evenly(total: usize, most: usize) -> Vec<usize> {
    if total <= most {
        return (0..total).collect();
    }
    (0..most).map(|i| i * (total - 1) / (most - 1)).collect()
}

/// The row of a frame under [`HEADS`]; cells of unknown values are empty.
fn cells(frame: &JobFrame) -> Vec<String> {
    let mut cells = vec![frame.number.to_string(), frame.status.name().to_owned()];
    let Some(report) = &frame.report else {
        return cells;
    };
    let times = &report.seconds;
    let rate = report.rays_per_second().map_or(f64::NAN, |rate| rate / 1e6);
    cells.extend([
        count(report.particles),
        seconds(times.read),
        seconds(times.build),
        seconds(times.surface),
        seconds(times.trace),
        seconds(times.encode),
        seconds(report.total().as_secs_f64()),
        short(float(report.rays.total()) / 1e6),
        short(rate),
        mib(report.rss.anonymous_peak),
        mib(report.rss.file_peak),
        short(report.bytes_per_particle().unwrap_or(f64::NAN)),
        mib(report.bytes.build_peak),
        count(report.dropped),
        count(report.clamped_radii),
        count(report.clamped_pixels),
        percent(report.clamped_light),
    ]);
    cells
}

#[cfg(test)]
mod tests {
    use super::evenly;

    #[test]
    fn even_selection_includes_both_ends() {
        assert_eq!(evenly(3, 5), [0, 1, 2]);
        assert_eq!(evenly(9, 3), [0, 4, 8]);
        assert_eq!(evenly(0, 3), [0usize; 0]);
        let chosen = evenly(10_000, 300);
        assert_eq!((chosen.len(), chosen[0], chosen[299]), (300, 0, 9999));
        assert!(chosen.windows(2).all(|pair| pair[0] < pair[1]));
    }
}
