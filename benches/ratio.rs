//! Ours against obvhs on the thesis's scene: one table.
//!
//! The two take turns, so that whatever else the machine does hits both; a ratio of the same turn
//! is worth more than either rate. Ratios say how many times better ours is, in every row.
#![expect(clippy::print_stdout, reason = "the table is what it is for")]

use std::env;
use std::fs;
use std::hint::black_box;
use std::process::Command;
use std::time::Instant;

use spherule::accel::TreeBuilder;

mod support;

use support::obvhs::ObvhsBuilder;
use support::rays::{trace_primary, trace_reflection, trace_shadow};
use support::{Case, build_lbvh, is_quick_run, particle_counts};

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
    for (place, particles) in particle_counts(quick).into_iter().enumerate() {
        let case = Case::new(particles);
        if place == 0 {
            print_machine(&case, rounds);
        }
        print_rows(&case, rounds);
    }
}

/// Not when tests are only listed, nor when another benchmark was named.
fn is_asked_for() -> bool {
    let mut names = env::args()
        .skip(1)
        .filter(|a| !a.starts_with('-'))
        .peekable();
    let listing = env::args().any(|a| a == "--list");
    !listing && (names.peek().is_none() || names.any(|name| NAME.contains(&name)))
}

fn print_machine(case: &Case, rounds: usize) {
    println!("thesis's box, 1920x1080, one ray a pixel; turns of each: {rounds}; best (median)");
    println!(
        "{}, {} threads, {}, {}",
        cpu_name(),
        rayon::current_num_threads(),
        case.lbvh.tree().simd().name(),
        compiler_version(),
    );
    println!("ratio: obvhs / lbvh in time or bytes, of the best (median of the turns' ratios)");
    println!(
        "{:>9}  {:<21} {:>15} {:>15} {:>14}",
        "particles", "", "lbvh", "obvhs", "ratio"
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

fn print_rows(case: &Case, rounds: usize) {
    print_builds(case, rounds);
    print_rays(case, rounds);
}

fn print_builds(case: &Case, rounds: usize) {
    let scene = &case.scene;
    let turns = Turns::take(
        rounds,
        || build_lbvh(&mut TreeBuilder::new(), scene).nodes,
        || ObvhsBuilder::new().build(&case.spheres),
    );
    print_row(case, "build, new memory, s", Unit::Seconds, &turns);

    let (mut ours, mut theirs) = (TreeBuilder::new(), ObvhsBuilder::new());
    let report = build_lbvh(&mut ours, scene);
    let node_bytes = theirs.build(&case.spheres);
    let turns = Turns::take(
        rounds,
        || build_lbvh(&mut ours, scene).nodes,
        || theirs.build(&case.spheres),
    );
    print_row(case, "build, kept memory, s", Unit::Seconds, &turns);

    // Positions and structure; neither keeps the way back to the particles' order.
    let our_bytes = report.position_bytes + report.structure_bytes;
    let their_bytes = size_of_val(&scene.centers[..]) + node_bytes;
    print_bytes(scene.centers.len(), our_bytes, their_bytes as u64);
}

fn print_rays(case: &Case, rounds: usize) {
    let (tree, obvhs) = (case.lbvh.tree(), &case.obvhs);
    let (scene, points) = (&case.scene, &case.points);
    let (mut records, mut others) = (Vec::new(), Vec::new());
    let turns = Turns::take(
        rounds,
        || trace_primary(tree, scene, &mut records),
        || trace_primary(obvhs, scene, &mut others),
    );
    let unit = Unit::MillionsOf(scene.pixels.len());
    print_row(case, "primary, Mrays/s", unit, &turns);

    let unit = Unit::MillionsOf(points.len());
    let turns = Turns::take(
        rounds,
        || trace_shadow(tree, points),
        || trace_shadow(obvhs, points),
    );
    print_row(case, "shadow, Mrays/s", unit, &turns);
    let turns = Turns::take(
        rounds,
        || trace_reflection(tree, points),
        || trace_reflection(obvhs, points),
    );
    print_row(case, "reflection, Mrays/s", unit, &turns);
}

fn print_row(case: &Case, what: &str, unit: Unit, turns: &Turns) {
    let particles = case.scene.centers.len();
    println!("{particles:>9}  {what:<21} {}", turns.text(unit));
}

fn print_bytes(particles: usize, ours: u64, theirs: u64) {
    #[expect(clippy::cast_precision_loss, reason = "a figure for people")]
    let [ours, theirs] = [ours, theirs].map(|bytes| bytes as f64 / particles as f64);
    println!(
        "{particles:>9}  {:<21} {ours:>15.2} {theirs:>15.2} {:>7.2}",
        "bytes a particle",
        theirs / ours
    );
}

/// What a row's figures are.
#[derive(Debug, Clone, Copy)]
enum Unit {
    Seconds,
    /// Rays of each turn, told as millions in a second.
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
        let ratios: Vec<f64> = self
            .ours
            .iter()
            .zip(&self.theirs)
            .map(|(ours, theirs)| theirs / ours)
            .collect();
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
