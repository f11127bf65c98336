use std::fs;
use std::process::{Command, Output};

use spherule_jobs::FrameRange;

use super::{FRAMES, job};
use crate::harness::{Ran, Workshop, images, no_leftovers};

/// A name with everything that a shell takes for something else.
const ODD: &str = "it's $HOME & \"so\" `x` *";

/// The frames of each task, as the script has them.
fn chunks(script: &str) -> Vec<Vec<i64>> {
    let (_, rest) = script.split_once("\nchunks=(").expect("chunks");
    let (chunks, _) = rest.split_once("\n)").expect("an end");
    let frames = |text: &str| -> Vec<i64> {
        let range: FrameRange = text.parse().expect("a range");
        range.iter().collect()
    };
    chunks.split_whitespace().map(frames).collect()
}

fn export(workshop: &Workshop, options: &[&str]) -> Ran {
    workshop.run(&[&["export", "slurm"], options].concat())
}

/// The script as the shell sees it.
#[track_caller]
fn sound(script: &str) {
    let checked = Command::new("bash").args(["-n", "-c", script]).output().expect("bash");
    assert!(checked.status.success() && checked.stderr.is_empty());
    let array = script.lines().find_map(|l| l.strip_prefix("#SBATCH --array=0-"));
    let last = array.and_then(|a| a.split('%').next()?.parse::<usize>().ok());
    assert_eq!(last, Some(chunks(script).len() - 1));
}

#[test]
fn every_frame_is_in_one_task() {
    let workshop = Workshop::new();
    job(&workshop, "data", &FRAMES);
    for chunk in ["1", "2", "5", "13", "99"] {
        let script = export(&workshop, &["data/job.toml", "--chunk", chunk]).expect(0).text();
        sound(&script);
        let tasks = chunks(&script);
        assert_eq!(tasks.concat(), FRAMES, "--chunk {chunk}");
        let size: usize = chunk.parse().expect("a number");
        let (last, others) = tasks.split_last().expect("tasks");
        assert!(others.iter().all(|task| task.len() == size) && last.len() <= size);
    }
}

/// Options of the program in the script, which are on the lines that call it or set its arguments.
fn options(script: &str) -> Vec<&str> {
    let is_call = |line: &&str| line.contains("set -- ") || line.contains("exec \"$program\"");
    let words = script.lines().filter(is_call).flat_map(str::split_whitespace);
    words.filter(|word| word.len() > 2 && word.starts_with("--")).collect()
}

#[test]
fn tasks_use_options_that_render_has() {
    let workshop = Workshop::new();
    job(&workshop, "data", &FRAMES);
    let script = export(&workshop, &["data/job.toml", "--mem", "4GiB"]).expect(0).text();
    let help = workshop.run(&["render", "--help"]).expect(0).text();
    let used = options(&script);
    assert_eq!(used, ["--frames", "--threads", "--memory-limit", "--grace"]);
    let known: Vec<&str> = help.split_whitespace().collect();
    for option in used {
        assert!(known.contains(&option), "{option}");
    }
}

#[test]
fn frames_come_from_the_manifest_or_the_option() {
    let workshop = Workshop::new();
    job(&workshop, "data", &FRAMES);
    let tasks = |options: &[&str]| {
        let options = [options, &["--chunk", "2"]].concat();
        chunks(&export(&workshop, &options).expect(0).text())
    };
    assert_eq!(tasks(&["data/job.toml", "--frames=-4-0"]), [vec![-4, -3], vec![-1, 0]]);
    // The order asked for stays.
    assert_eq!(tasks(&["data/job.toml", "--frames", "1002,2-0x-1"]), [vec![2, 1002], vec![0, 1]]);
    // The manifest beside the images is as good.
    workshop.run(&["render", "data/job.toml", "--frames", "10"]).expect(0);
    assert_eq!(tasks(&["data/out/job.toml"]).concat(), FRAMES);
    let manifest = workshop.join("data/job.toml");
    let text = fs::read_to_string(&manifest).expect("a manifest");
    let some = text.replace("[input]\n", "[input]\nframes = \"10-16\"\n");
    fs::write(&manifest, some).expect("a file");
    assert_eq!(tasks(&["data/job.toml"]), [vec![10, 12], vec![14, 16]]);
}

#[test]
fn tasks_are_few_enough_for_an_array() {
    let workshop = Workshop::new();
    job(&workshop, "data", &FRAMES);
    let ran = export(&workshop, &["data/job.toml", "--max-tasks", "3", "--chunk", "2"])
        .expect(0)
        .prints("3 tasks of 5 frames, because 2 would give 7 tasks");
    assert_eq!(chunks(&ran.text()).concat(), FRAMES);
    assert!(ran.text().contains("# 5 frames per task, because 2 would give 7 tasks"));
    // Without an option for the count.
    let ran = export(&workshop, &["data/job.toml"]).expect(0);
    assert_eq!(chunks(&ran.text()).len(), FRAMES.len());
}

#[test]
fn script_creates_the_log_directory() {
    let workshop = Workshop::new();
    job(&workshop, "data", &[1, 2]);
    let logs = workshop.join("data/slurm-logs");
    let ran = export(&workshop, &["data/job.toml"]).expect(0);
    assert!(!logs.exists(), "what only prints makes nothing");
    let ran = ran.prints("mkdir -p '");
    let options = ["data/job.toml", "-o", "array.sh"];
    export(&workshop, &options).expect(0).prints("sbatch array.sh");
    assert!(logs.is_dir());
    let script = fs::read_to_string(workshop.join("array.sh")).expect("a script");
    assert_eq!(script, ran.text());
    let line = format!("#SBATCH --output=\"{}/%A_%a.log\"", logs.display());
    assert!(script.lines().any(|l| l == line), "{script}");
    export(&workshop, &[&options[..], &["--logs", "mine"]].concat()).expect(0);
    assert!(workshop.join("mine").is_dir());
}

#[test]
fn requested_resources() {
    let workshop = Workshop::new();
    job(&workshop, "data", &[1, 2]);
    let has = |options: &[&str], expected: &[&str]| {
        let options = [&["data/job.toml"], options].concat();
        let script = export(&workshop, &options).expect(0).text();
        sound(&script);
        for line in expected {
            let line = format!("#SBATCH --{line}");
            assert!(script.lines().any(|l| l == line), "no {line} in\n{script}");
        }
        script
    };
    let script = has(
        &["--cpus", "3", "--mem", "4GiB", "--time", "90", "--concurrent", "2"],
        &["job-name=data", "array=0-1%2", "cpus-per-task=3", "mem=4096M", "time=01:30:00"],
    );
    assert!(script.contains("--memory-limit"));
    assert!(script.contains("--grace 108"), "{script}");
    let script = has(
        &["--partition", "long", "--account", "sim", "--signal-ahead", "300"],
        &["partition=long", "account=sim", "signal=B:TERM@300", "requeue"],
    );
    assert!(script.contains("--grace 270"), "{script}");
    // What the manifest limits itself to, and a little more.
    let manifest = workshop.join("data/job.toml");
    let text = fs::read_to_string(&manifest).expect("a manifest");
    fs::write(&manifest, text + "[render]\nmemory_limit = \"900MiB\"\n").expect("a file");
    assert!(!has(&[], &["mem=1000M"]).contains("--memory-limit"));
    assert!(has(&["--mem", "500MiB"], &["mem=500M"]).contains("--memory-limit"));
}

/// Runs a task of the script in `/`, as the engine would.
fn run(script: &str, task: usize) -> Output {
    Command::new("bash")
        .args(["-c", script])
        .current_dir("/")
        .env("SLURM_ARRAY_JOB_ID", "7")
        .env("SLURM_ARRAY_TASK_ID", task.to_string())
        .env("SLURM_CPUS_PER_TASK", "1")
        .env("SLURM_MEM_PER_NODE", "1000")
        .env_remove("SPHERULE")
        .output()
        .expect("bash")
}

#[test]
fn tasks_give_the_same_files_as_one_run() {
    let workshop = Workshop::new();
    job(&workshop, ODD, &FRAMES);
    let manifest = format!("{ODD}/job.toml");
    workshop.run(&["render", &manifest, "-o", "whole/f.####.exr"]).expect(0);
    let options = [&manifest, "--chunk", "4", "--logs", "logs"];
    let script = export(&workshop, &options).expect(0).text();
    sound(&script);
    for task in 0..4 {
        let ran = Ran(run(&script, task)).expect(0);
        assert!(ran.text().contains(&format!("task 7_{task}")), "{}", ran.text());
    }
    let out = workshop.join(ODD).join("out");
    assert!(images(&out) == images(&workshop.join("whole")));
    assert_eq!(images(&out).len(), 2 * FRAMES.len());
    no_leftovers(&out);
    // The manifest beside the images is that of the whole job, not of the last task.
    let kept = fs::read_to_string(out.join("job.toml")).expect("a manifest");
    let has = |line: &str| kept.lines().any(|l| l.starts_with(line));
    assert!(has("frames = \"all\"") && has("threads = \"all\""), "{kept}");
    let again = workshop.run(&["render", out.join("job.toml").to_str().expect("UTF-8")]);
    assert!(again.expect(0).rendered().is_empty());
}
