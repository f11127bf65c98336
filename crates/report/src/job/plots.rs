//! Plots over a sequence.

use super::JobReport;
use super::numbers::{MIB, float};
use crate::FrameReport;
use crate::plots::{Axis, Plot, Series};

/// Number of distinct colours.
const MAX_PHASES: usize = 7;

type Curve<'a> = (String, Box<dyn Fn(&FrameReport) -> f64 + 'a>);

fn curve<'a>(name: &str, value: impl Fn(&FrameReport) -> f64 + 'a) -> Curve<'a> {
    (name.to_owned(), Box::new(value))
}

impl JobReport {
    /// All plots, with gaps for frames that are not finished.
    pub fn plots(&self) -> Vec<Plot> {
        // Collect the curves
        let stages = vec![
            curve("read", |r| r.seconds.read),
            curve("build", |r| r.seconds.build),
            curve("surface", |r| r.seconds.surface),
            curve("trace", |r| r.seconds.trace),
            curve("encode", |r| r.seconds.encode),
        ];
        let memory = vec![
            curve("anonymous", |r| float(r.rss.anonymous_peak) / MIB),
            curve("file-backed", |r| float(r.rss.file_peak) / MIB),
            curve("total resident", |r| float(r.rss.total_peak) / MIB),
        ];
        let rays =
            vec![curve("all rays", |r| r.rays_per_second().map_or(f64::NAN, |rate| rate / 1e6))];
        let particles = vec![curve("particles", |r| float(r.particles))];
        let per_particle =
            vec![curve("positions and tree", |r| r.bytes_per_particle().unwrap_or(f64::NAN))];
        // Draw each group in a plot of its own
        vec![
            self.times("plot-stages", "Time by stage", stages),
            self.times("plot-build", "Build time by phase", self.phases()),
            self.plot("plot-rays", "Ray throughput", "rays, M/s", rays),
            self.plot("plot-particles", "Particles", "particles", particles),
            self.plot("plot-memory", "Peak memory of the process", "peak memory, MiB", memory),
            self.plot("plot-bytes", "Tree memory per particle", "bytes per particle", per_particle),
        ]
    }

    /// A plot of seconds, or of milliseconds for short times.
    fn times(&self, id: &str, title: &str, curves: Vec<Curve>) -> Plot {
        let values = self.done().flat_map(|(_, r)| curves.iter().map(|(_, value)| value(r)));
        if values.fold(0.0, f64::max) >= 0.1 {
            return self.plot(id, title, "time, s", curves);
        }
        let scaled = curves.into_iter().map(|(name, value)| curve(&name, move |r| 1e3 * value(r)));
        self.plot(id, title, "time, ms", scaled.collect())
    }

    fn plot(&self, id: &str, title: &str, quantity: &str, curves: Vec<Curve>) -> Plot {
        let axes = (Axis::linear("frame").whole(), Axis::linear(quantity).from_zero());
        let plot = Plot::new(id, title, axes.0, axes.1);
        curves.into_iter().fold(plot, |plot, (name, value)| {
            let points = self.frames.iter().map(|frame| {
                #[expect(clippy::cast_precision_loss, reason = "a place on a plot")]
                let number = frame.number as f64;
                (number, frame.report.as_ref().map_or(f64::NAN, &value))
            });
            plot.with(Series::new(name, points))
        })
    }

    /// Phases of the build in their order; if there are more than colours, the last ones are combined.
    fn phases(&self) -> Vec<Curve<'_>> {
        let mut names: Vec<&str> = Vec::new();
        for (_, report) in self.done() {
            for (name, _) in &report.build.phases {
                if !names.contains(&name.as_str()) {
                    names.push(name);
                }
            }
        }
        let of = |name: &str, report: &FrameReport| {
            let phases = report.build.phases.iter();
            phases.filter(|phase| phase.0 == name).map(|phase| phase.1).sum::<f64>()
        };
        let single = if names.len() > MAX_PHASES { MAX_PHASES - 1 } else { names.len() };
        let rest = names.split_off(single);
        let mut curves: Vec<Curve> =
            names.into_iter().map(|name| curve(name, move |report| of(name, report))).collect();
        if !rest.is_empty() {
            let sum = move |report: &FrameReport| rest.iter().map(|name| of(name, report)).sum();
            curves.push(curve("others", sum));
        }
        curves
    }
}
