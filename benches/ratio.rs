//! Each of our structures against obvhs on the thesis's scene: one table.
//!
//! The two take turns, so that whatever else the machine does hits both; a ratio of the same turn
//! is worth more than either rate. Ratios above 1 are in our favour, in every row.
#![expect(clippy::print_stdout, reason = "the table is what it is for")]

use std::env;
use std::fs;
use std::hint::black_box;
use std::process::Command;
use std::time::Instant;

use spherule::accel::stored::{StoredSettings, StoredTree};
use spherule::accel::view::TreeView;
use spherule::accel::{Structure, TreeBuilder};

#[path = "support/stored.rs"]
mod stored;
mod support;

use stored::{Encoding, OwnedLeaves};
use support::obvhs::ObvhsBuilder;
use support::rays::{
    trace_primary, trace_primary_packets, trace_reflection, trace_reflection_packets, trace_shadow,
    trace_shadow_packets,
};
use support::{Case, build_ours, is_quick_run, particle_counts, structures};

/// Turns per row; an odd number has a median.
const ROUNDS: usize = 5;
/// Name to filter by on the command line.
const NAME: &str = "ratio";

fn main() {
    if !is_asked_for() {
        return;
    }
    let quick = is_quick_run();
    let rounds = if quick { 1 } else { ROUNDS };
    print_machine(rounds);
    for particles in particle_counts(quick) {
        let case = Case::new(particles);
        for structure in structures() {
            let table = Table { case: &case, structure, rounds };
            table.print_builds();
            let builder = case.tree(structure);
            table.print_rays(structure.name(), &builder.tree().view());
            if matches!(structure, Structure::Lbvh | Structure::Kdtree) {
                for encoding in Encoding::ALL {
                    table.print_stored(&builder, encoding);
                }
            }
        }
    }
}

/// Not when tests are only listed, nor when another benchmark was named.
fn is_asked_for() -> bool {
    let mut names = env::args().skip(1).filter(|a| !a.starts_with('-')).peekable();
    let listing = env::args().any(|a| a == "--list");
    !listing && (names.peek().is_none() || names.any(|name| NAME.contains(&name)))
}

fn print_machine(rounds: usize) {
    println!("thesis's box, 1920x1080, one ray a pixel; turns of each: {rounds}; best (median)");
    println!(
        "{}, {} threads, {}, {}",
        cpu_name(),
        rayon::current_num_threads(),
        TreeBuilder::new().tree().simd().name(),
        compiler_version(),
    );
    println!("ratio: obvhs / ours in time or bytes, of the best (median of the turns' ratios)");
    println!(
        "{:>9}  {:<10} {:<21} {:>15} {:>15} {:>14}",
        "particles", "", "", "ours", "obvhs", "ratio"
    );
}

fn cpu_name() -> String {
    fs::read_to_string("/proc/cpuinfo")
        .ok()
        .and_then(|text| {
            let line = text.lines().find(|line| line.starts_with("model name"))?;
            Some(line.split_once(": ")?.1.to_owned())
        })
        .unwrap_or_else(|| format!("unknown {} processor", env::consts::ARCH))
}

fn compiler_version() -> String {
    let compiler = env::var("RUSTC").unwrap_or_else(|_| "rustc".to_owned());
    Command::new(compiler)
        .arg("--version")
        .output()
        .ok()
        .and_then(|output| String::from_utf8(output.stdout).ok())
        .map_or_else(|| "unknown rustc".to_owned(), |text| text.trim().to_owned())
}

/// The rows of one structure.
struct Table<'a> {
    case: &'a Case,
    structure: Structure,
    rounds: usize,
}

impl Table<'_> {
    fn print_builds(&self) {
        let name = self.structure.name();
        let (scene, spheres) = (&self.case.scene, &self.case.spheres);
        let build = |builder: &mut TreeBuilder| build_ours(self.structure, builder, scene);
        let turns = Turns::take(
            self.rounds,
            || build(&mut TreeBuilder::new()).nodes,
            || ObvhsBuilder::new().build(spheres),
        );
        self.print_row(name, "build, new memory, s", &turns.text(Unit::Seconds));

        let (mut ours, mut theirs) = (TreeBuilder::new(), ObvhsBuilder::new());
        let report = build(&mut ours);
        let node_bytes = theirs.build(spheres);
        let turns = Turns::take(self.rounds, || build(&mut ours).nodes, || theirs.build(spheres));
        self.print_row(name, "build, kept memory, s", &turns.text(Unit::Seconds));

        // Positions and structure; neither keeps the way back to the particles' order.
        let our_bytes = report.position_bytes + report.structure_bytes;
        let their_bytes = (size_of_val(&scene.centers[..]) + node_bytes) as u64;
        self.print_bytes(name, "bytes per particle", our_bytes, Some(their_bytes));
        self.print_bytes(name, "  while building", report.peak_bytes, None);
    }

    /// The same particles in the same order, traced as a native frame stores them.
    fn print_stored(&self, builder: &TreeBuilder, encoding: Encoding) {
        let owned = OwnedLeaves::of(&builder.tree().view(), encoding);
        let (leaves, spheres) = (owned.leaves(), &self.case.spheres);
        let settings = StoredSettings {
            structure: self.structure,
            radius: Some(self.case.scene.radius),
            keep_indices: false,
        };
        let name = format!("{} {}", self.structure, encoding.name());
        let (mut ours, mut theirs) = (StoredTree::new(), ObvhsBuilder::new());
        let mut build = || ours.build(&leaves, settings).expect("sound leaves");
        let report = build();
        let turns = Turns::take(self.rounds, || build().nodes, || theirs.build(spheres));
        self.print_row(&name, "build, kept memory, s", &turns.text(Unit::Seconds));
        let bytes = report.position_bytes + report.structure_bytes;
        self.print_bytes(&name, "bytes per particle", bytes, None);
        let held = report.peak_bytes - report.file_bytes;
        self.print_bytes(&name, "  while building", held, None);
        self.print_rays(&name, &ours.view(&leaves));
    }

    fn print_rays(&self, name: &str, tree: &TreeView) {
        let (case, obvhs) = (self.case, &self.case.obvhs);
        let (scene, points) = (&case.scene, &case.points);
        let (mut records, mut others) = (Vec::new(), Vec::new());
        let turns = Turns::take(
            self.rounds,
            || trace_primary(tree, scene, &mut records),
            || trace_primary(obvhs, scene, &mut others),
        );
        let unit = Unit::MillionsOf(scene.pixels.len());
        self.print_row(name, "primary, Mrays/s", &turns.text(unit));
        let turns = Turns::take(
            self.rounds,
            || trace_primary_packets(tree, scene, &mut records),
            || trace_primary(obvhs, scene, &mut others),
        );
        self.print_row(name, "in packets", &turns.text(unit));

        let unit = Unit::MillionsOf(points.len());
        let turns =
            Turns::take(self.rounds, || trace_shadow(tree, points), || trace_shadow(obvhs, points));
        self.print_row(name, "shadow, Mrays/s", &turns.text(unit));
        let turns = Turns::take(
            self.rounds,
            || trace_shadow_packets(tree, points),
            || trace_shadow(obvhs, points),
        );
        self.print_row(name, "in packets", &turns.text(unit));
        let turns = Turns::take(
            self.rounds,
            || trace_reflection(tree, points),
            || trace_reflection(obvhs, points),
        );
        self.print_row(name, "reflection, Mrays/s", &turns.text(unit));
        let turns = Turns::take(
            self.rounds,
            || trace_reflection_packets(tree, points),
            || trace_reflection(obvhs, points),
        );
        self.print_row(name, "in hybrid packets", &turns.text(unit));
        // What incoherent packets gain: single rays of the same tree take the other turn.
        let turns = Turns::take(
            self.rounds,
            || trace_reflection_packets(tree, points),
            || trace_reflection(tree, points),
        );
        self.print_row(name, "  against ours alone", &turns.text(unit));
    }

    fn print_row(&self, name: &str, what: &str, figures: &str) {
        let particles = self.case.scene.centers.len();
        println!("{particles:>9}  {name:<10} {what:<21} {figures}");
    }

    fn print_bytes(&self, name: &str, what: &str, ours: u64, theirs: Option<u64>) {
        #[expect(clippy::cast_precision_loss, reason = "a figure for people")]
        let each = |bytes: u64| bytes as f64 / self.case.scene.centers.len() as f64;
        let ours = each(ours);
        let compared = theirs.map_or_else(String::new, |theirs| {
            format!("{:>15.2} {:>7.2}", each(theirs), each(theirs) / ours)
        });
        self.print_row(name, what, format!("{ours:>15.2} {compared}").trim_end());
    }
}

/// What a row's figures are.
#[derive(Debug, Clone, Copy)]
enum Unit {
    Seconds,
    /// Rays of each repetition, printed in millions per second.
    MillionsOf(usize),
}

impl Unit {
    fn figure(self, seconds: f64) -> f64 {
        match self {
            Self::Seconds => seconds,
            #[expect(clippy::cast_precision_loss, reason = "millions at most")]
            Self::MillionsOf(rays) => rays as f64 / seconds * 1e-6,
        }
    }

    const fn digits(self) -> usize {
        match self {
            Self::Seconds => 3,
            Self::MillionsOf(_) => 2,
        }
    }
}

/// Seconds of every turn, ours and theirs.
struct Turns {
    ours: Vec<f64>,
    theirs: Vec<f64>,
}

impl Turns {
    fn take<A, B>(
        rounds: usize,
        mut ours: impl FnMut() -> A,
        mut theirs: impl FnMut() -> B,
    ) -> Self {
        let pairs = (0..rounds).map(|_| (seconds(&mut ours), seconds(&mut theirs)));
        let (ours, theirs) = pairs.unzip();
        Self { ours, theirs }
    }

    fn text(&self, unit: Unit) -> String {
        let side = |times: &[f64]| {
            let (best, middle) = (unit.figure(best(times)), unit.figure(median(times)));
            let digits = unit.digits();
            format!("{best:.digits$} ({middle:.digits$})")
        };
        let ratios: Vec<f64> =
            self.ours.iter().zip(&self.theirs).map(|(ours, theirs)| theirs / ours).collect();
        format!(
            "{:>15} {:>15} {:>7.2} ({:.2})",
            side(&self.ours),
            side(&self.theirs),
            best(&self.theirs) / best(&self.ours),
            median(&ratios)
        )
    }
}

fn seconds<R>(work: &mut impl FnMut() -> R) -> f64 {
    let start = Instant::now();
    black_box(work());
    start.elapsed().as_secs_f64()
}

fn best(times: &[f64]) -> f64 {
    times.iter().copied().fold(f64::INFINITY, f64::min)
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}
