//! What a job costs beside its images: 2,000 frames of 1,000 particles at 64x64, and `status` on 10,000 frames; and how
//! much longer 200 frames of 10,000 particles at 640x360 take than the slowest of the stages that overlap.
//!
//! Stages overlap, so the sum of their times does not give the rest. Writing images, with what syncing
//! them takes, is by far the longest here: what the run took beyond it is an upper bound of claims, ledger and
//! all else, and of reading, building and tracing where these were not hidden behind it.

#![expect(clippy::print_stdout, reason = "a benchmark prints its measurements")]

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use spherule_formats::generate::{BoxSettings, fill_box};
use spherule_formats::write;

const FRAMES: usize = 2000;
const PARTICLES: usize = 1000;
/// Factor on the number of frames of the job that `status` reads.
const TIMES: usize = 5;
const TURNS: usize = 5;
/// Frames of the sequence, and their particles.
const SEQUENCE: (usize, usize) = (200, 10_000);

fn main() {
    let place = tempfile::tempdir().expect("a temporary directory");
    let input = place.path().join("in");
    fs::create_dir(&input).expect("a directory");
    boxes(&input, FRAMES, PARTICLES);
    for options in [&[][..], &["--set", "output.preview=false"]] {
        render(place.path(), options);
    }
    sequence(place.path());
    enlarge(place.path());
    let times: Vec<Duration> = (0..TURNS).map(|_| status(place.path(), "large")).collect();
    println!(
        "status of {} frames: best {:.1} ms, worst {:.1} ms of {TURNS}",
        FRAMES * TIMES,
        milliseconds(*times.iter().min().expect("turns")),
        milliseconds(*times.iter().max().expect("turns"))
    );
}

fn milliseconds(time: Duration) -> f64 {
    1000.0 * time.as_secs_f64()
}

fn boxes(input: &Path, frames: usize, particles: usize) {
    for frame in 0..frames {
        let centers = fill_box(&BoxSettings::thesis(particles, frame as u64));
        write::npy::write(&input.join(format!("f_{frame}.npy")), &centers).expect("a file");
    }
}

/// Renders small frames and compares what they took with the stage that took most.
fn sequence(place: &Path) {
    let (count, particles) = SEQUENCE;
    let input = place.join("sequence");
    fs::create_dir(&input).expect("a directory");
    boxes(&input, count, particles);
    let size = ["--width", "640", "--height", "360", "--samples", "1"];
    println!("{count} frames of {particles} particles at 640x360, seconds:");
    for _ in 0..TURNS {
        let _ = fs::remove_dir_all(place.join("sequence-out"));
        let what = ["render", "sequence", "-o", "sequence-out/f.####.exr"];
        let start = Instant::now();
        run(place, &[&what[..], &size, &["--progress", "none"]].concat());
        let process = start.elapsed().as_secs_f64();
        let text = fs::read_to_string(place.join("sequence-out/report.json")).expect("a report");
        let report = json(&text);
        let frames = report["frames"].as_array().expect("frames");
        let sum = |names: &[&str]| -> f64 {
            let of = |f: &Value| names.iter().filter_map(|n| f["seconds"][n].as_f64()).sum::<f64>();
            frames.iter().map(of).sum()
        };
        let stages = [&["read"][..], &["build", "surface", "trace"], &["encode"]].map(sum);
        let [read, trace, encode] = stages;
        let slowest = stages.into_iter().fold(0.0, f64::max);
        println!(
            "  read {read:.2}, build and trace {trace:.2}, encode and write {encode:.2}; all {process:.2}, {:.2} times \
             the slowest",
            process / slowest
        );
    }
}

/// Renders all frames and prints the time beyond writing images.
fn render(place: &Path, options: &[&str]) {
    let _ = fs::remove_dir_all(place.join("out"));
    let small = ["--width", "64", "--height", "64", "--samples", "1", "--progress", "none"];
    let start = Instant::now();
    run(place, &[&["render", "in", "-o", "out/f.####.exr"], &small[..], options].concat());
    let took = start.elapsed().as_secs_f64();
    let text = fs::read_to_string(place.join("out/report.json")).expect("a report");
    let report: Value = serde_json::from_str(&text).expect("JSON");
    let frames = report["frames"].as_array().expect("frames");
    let sum = |stage: &str| -> f64 {
        let seconds = frames.iter().filter_map(|f| f["seconds"][stage].as_f64());
        1000.0 * seconds.sum::<f64>() / FRAMES as f64
    };
    let each = 1000.0 * took / FRAMES as f64;
    println!("{FRAMES} frames of {PARTICLES} particles at 64x64 {options:?}: {took:.2} s");
    println!(
        "  a frame: {each:.2} ms = {:.2} writing and syncing images + {:.2} else \
         (read {:.2}, build {:.2}, trace {:.2} behind it)",
        sum("encode"),
        each - sum("encode"),
        sum("read"),
        sum("build"),
        sum("trace")
    );
}

/// Makes a job of many times the frames in `large` by giving images further names.
fn enlarge(place: &Path) {
    let (from, to) = (place.join("out"), place.join("large"));
    fs::create_dir(&to).expect("a directory");
    let sealed = json(&fs::read_to_string(from.join("job.plan.json")).expect("a plan"));
    let mut plan = sealed["plan"].clone();
    let planned = plan["frames"].as_array().expect("frames").clone();
    let ledger = fs::read_dir(&from)
        .expect("a directory")
        .filter_map(|entry| Some(entry.ok()?.path()))
        .find(|path| path.extension().is_some_and(|e| e == "jsonl"))
        .expect("a ledger");
    let entries: Vec<Value> =
        fs::read_to_string(ledger).expect("a ledger").lines().map(json).collect();
    let (mut frames, mut lines) = (Vec::new(), String::new());
    for turn in 0..TIMES {
        for frame in &planned {
            frames.push(renamed(frame, "number", "outputs", turn));
        }
        for entry in &entries {
            let mut entry = renamed(entry, "frame", "outputs", turn);
            let number = entry["frame"].as_i64().expect("a number");
            entry["seq"] = number.into();
            for output in entry["outputs"].as_array().expect("outputs") {
                let name = output["path"].as_str().expect("a name");
                let old = format!("f.{:04}.exr", number % FRAMES as i64);
                fs::hard_link(from.join(old), to.join(name)).expect("a link");
            }
            lines += &format!("{entry}\n");
        }
    }
    plan["frames"] = frames.into();
    let text = plan.to_string();
    let seal = serde_json::json!({"version": sealed["version"], "blake3": spherule_jobs::text_hash(&text)});
    let sealed = seal.to_string().replacen('}', &format!(",\"plan\":{text}}}"), 1);
    fs::write(to.join("job.plan.json"), sealed).expect("a file");
    fs::write(to.join("job.ledger.ended.jsonl"), lines).expect("a file");
}

/// A frame of the plan or the ledger as that of another turn.
fn renamed(frame: &Value, number: &str, outputs: &str, turn: usize) -> Value {
    let mut frame = frame.clone();
    let old = frame[number].as_i64().expect("a number");
    let new = old + (turn * FRAMES) as i64;
    frame[number] = new.into();
    let name = Value::from(format!("f.{new:04}.exr"));
    for output in frame[outputs].as_array_mut().expect("outputs") {
        match output.get_mut("path") {
            Some(path) => *path = name.clone(),
            None => *output = name.clone(),
        }
    }
    frame
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).expect("JSON")
}

fn status(place: &Path, job: &str) -> Duration {
    let start = Instant::now();
    run(place, &["status", job]);
    start.elapsed()
}

fn run(place: &Path, arguments: &[&str]) {
    let status = Command::new(env!("CARGO_BIN_EXE_spherule"))
        .args(arguments)
        .current_dir(place)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status();
    assert!(status.expect("the program starts").success(), "{arguments:?}");
}
