//! What water takes as a real job: the program renders a smooth surface at 1920x1080 and 16 samples a pixel, and
//! its report says what that took.
//!
//! ```text
//! cargo bench --bench surface                       a block of water of 1e6 particles
//! cargo bench --bench surface -- --full             of 1e7 too
//! cargo bench --bench surface -- FILE RADIUS ...    particles of files
//! ```
//!
//! The environment's `SPHERULE_BENCH_PARTICLES` (`1e5,1e6`) names other blocks.

#![expect(clippy::print_stdout, reason = "the table is what it is for")]

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::Value;

/// Particle radius of the blocks.
const RADIUS: &str = "0.01";
/// Turns a row; an odd number has a median.
const TURNS: usize = 3;
/// Threads of the job.
const THREADS: &str = "2";
/// Particle counts of blocks: a comma-separated list.
const PARTICLES_VARIABLE: &str = "SPHERULE_BENCH_PARTICLES";
/// Name to filter by on the command line.
const NAME: &str = "surface";

/// Particles to render.
struct Case {
    name: String,
    file: PathBuf,
    radius: String,
}

/// How large the images are and how often each is made.
#[derive(Clone, Copy)]
struct Size {
    width: &'static str,
    height: &'static str,
    samples: &'static str,
    turns: usize,
}

const QUICK: Size = Size { width: "64", height: "36", samples: "1", turns: 1 };
const USUAL: Size = Size { width: "1920", height: "1080", samples: "16", turns: TURNS };

fn main() {
    let given: Vec<String> = env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let has = |flag: &str| env::args().any(|argument| argument == flag);
    // One word is the name of a benchmark, as other benchmarks take it.
    let is_other = given.len() == 1 && !NAME.contains(&given[0][..]);
    if has("--list") || is_other {
        return;
    }
    let place = tempfile::tempdir().expect("a temporary directory");
    let is_quick = has("--test") || !has("--bench");
    let cases = match given.len() {
        0 | 1 => blocks(place.path(), is_quick, has("--full")),
        _ => files(&given),
    };
    let size = if is_quick { QUICK } else { USUAL };
    print_head(size);
    for case in cases {
        print_row(place.path(), &case, size);
    }
}

fn blocks(place: &Path, is_quick: bool, is_full: bool) -> Vec<Case> {
    let counts = match (env::var(PARTICLES_VARIABLE), is_quick, is_full) {
        (Ok(list), _, _) => list,
        (_, true, _) => "2e4".to_owned(),
        (_, _, true) => "1e6,1e7".to_owned(),
        _ => "1e6".to_owned(),
    };
    let block = |count: &str| {
        let file = place.join(format!("block_{count}.npy"));
        let output = file.to_str().expect("a plain path");
        run(&["generate", "block", "--particles", count, "--radius", RADIUS, "-o", output]);
        Case { name: format!("block {count}"), file, radius: RADIUS.to_owned() }
    };
    counts.split(',').map(str::trim).map(block).collect()
}

/// Pairs of a file and its radius.
fn files(given: &[String]) -> Vec<Case> {
    let pairs = given.chunks_exact(2);
    assert!(pairs.remainder().is_empty(), "each file needs a radius: FILE RADIUS ...");
    let case = |pair: &[String]| {
        let file = Path::new(&pair[0]);
        let name = file.file_name().unwrap_or(file.as_os_str());
        Case {
            name: name.to_string_lossy().into_owned(),
            file: fs::canonicalize(file).unwrap_or_else(|e| panic!("{}: {e}", pair[0])),
            radius: pair[1].clone(),
        }
    };
    pairs.map(case).collect()
}

fn print_head(size: Size) {
    println!(
        "water, smooth surface, {}x{}, {} samples a pixel, {THREADS} threads; turns: {}; best (median) seconds",
        size.width, size.height, size.samples, size.turns
    );
    println!("{}, {}", cpu_name(), compiler_version());
    println!(
        "bytes beside the particles as they were read: in all, at the peak of building, a particle"
    );
    println!(
        "{:<24} {:>10} {:>15} {:>17} {:>10} {:>12} {:>11} {:>11} {:>11} {:>9}",
        "",
        "particles",
        "surface",
        "trace",
        "Mrays",
        "bytes",
        "peak",
        "each",
        "each, peak",
        "Mrays/s"
    );
}

fn print_row(place: &Path, case: &Case, size: Size) {
    let turns: Vec<Value> = (0..size.turns).map(|_| frame_of(place, case, size)).collect();
    let seconds = |stage: &str| -> Vec<f64> {
        let of = |frame: &Value| frame["seconds"][stage].as_f64().expect("seconds");
        turns.iter().map(of).collect()
    };
    let (surface, trace) = (seconds("surface"), seconds("trace"));
    let frame = &turns[0];
    let number = |value: &Value| value.as_f64().expect("a number");
    let particles = number(&frame["particles"]);
    let bytes = number(&frame["bytes"]["surface"]);
    let peak = number(&frame["bytes"]["surface_peak"]);
    let kinds = frame["rays"].as_object().expect("rays");
    let rays: f64 = kinds.values().filter_map(Value::as_f64).sum();
    println!(
        "{:<24} {particles:>10} {:>15} {:>17} {:>10.2} {bytes:>12} {peak:>11} {:>11.1} {:>11.1} {:>9.2}",
        case.name,
        text(&surface),
        text(&trace),
        1e-6 * rays,
        bytes / particles,
        peak / particles,
        1e-6 * rays / best(&trace)
    );
}

/// The report of the only frame of a job.
fn frame_of(place: &Path, case: &Case, size: Size) -> Value {
    let out = place.join("out");
    // Left by the turn before.
    let _ = fs::remove_dir_all(&out);
    let pattern = out.join("f.####.exr");
    let path = |path: &Path| path.to_str().expect("a plain path").to_owned();
    let (file, pattern) = (path(&case.file), path(&pattern));
    run(&[
        "render",
        &file,
        "-o",
        &pattern,
        "--look",
        "water",
        "--surface",
        "smooth",
        "--radius",
        &case.radius,
        "--width",
        size.width,
        "--height",
        size.height,
        "--samples",
        size.samples,
        "--channels",
        "RGBA",
        "--threads",
        THREADS,
        "--progress",
        "none",
    ]);
    let text = fs::read_to_string(out.join("report.json")).expect("a report");
    let mut report: Value = serde_json::from_str(&text).expect("JSON");
    report["frames"][0].take()
}

fn run(arguments: &[&str]) {
    let output = Command::new(env!("CARGO_BIN_EXE_spherule"))
        .args(arguments)
        .stdout(Stdio::null())
        .output()
        .expect("the program starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {errors}");
}

fn text(seconds: &[f64]) -> String {
    format!("{:.3} ({:.3})", best(seconds), median(seconds))
}

fn best(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::INFINITY, f64::min)
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

fn cpu_name() -> String {
    let text = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let line = text.lines().find(|line| line.starts_with("model name"));
    line.and_then(|line| line.split_once(": ")).map_or_else(
        || format!("unknown {} processor", env::consts::ARCH),
        |(_, name)| name.to_owned(),
    )
}

fn compiler_version() -> String {
    let compiler = env::var("RUSTC").unwrap_or_else(|_| "rustc".to_owned());
    let output = Command::new(compiler).arg("--version").output();
    output.map_or_else(
        |_| "unknown rustc".to_owned(),
        |output| String::from_utf8_lossy(&output.stdout).trim().to_owned(),
    )
}
