use std::fs;

use super::job;
use crate::harness::Workshop;

/// No engine gets a text; the message has `expected`, and nothing is written.
#[track_caller]
fn refused(workshop: &Workshop, arguments: &[&str], expected: &str) {
    for engine in ["slurm", "openjd"] {
        only(workshop, &[&["export", engine], arguments].concat(), expected);
    }
}

#[track_caller]
fn only(workshop: &Workshop, arguments: &[&str], expected: &str) {
    let ran = workshop.run(arguments).expect(2).prints(expected);
    assert!(ran.text().is_empty() && !ran.errors().contains("panicked"));
    assert!(!workshop.join("new.yaml").exists() && !workshop.join("data/slurm-logs").exists());
}

#[test]
fn jobs_that_cannot_be_exported() {
    let workshop = Workshop::new();
    job(&workshop, "data", &[1, 2, 3]);
    let manifest = workshop.join("data/job.toml");
    let job = ["data/job.toml", "-o", "new.yaml"];
    let with = |more: &[&'static str]| [&job[..], more].concat();
    refused(&workshop, &["data/in"], "spherule init data/in > job.toml");
    refused(&workshop, &["none.toml"], "none.toml: ");
    refused(&workshop, &with(&["--frames", "7-9"]), "none of the frames of the input: 1-3");
    refused(&workshop, &with(&["--frames", "1-"]), "--frames");
    refused(
        &workshop,
        &with(&["--mem", "16"]),
        "expected at least 16.0 MiB, with a unit, such as 4GiB",
    );
    refused(&workshop, &with(&["--mem", "lots"]), "expected a size, such as 4GiB");
    refused(&workshop, &with(&["--chunk", "0"]), "--chunk");
    refused(&workshop, &with(&["--cpus", "0"]), "--cpus");
    let text = fs::read_to_string(&manifest).expect("a manifest");
    fs::write(&manifest, text.replace("f.####.exr", "f.exr")).expect("a file");
    refused(&workshop, &job, "f.exr for 3 frames");
    fs::write(&manifest, text.replace("width", "breadth")).expect("a file");
    refused(&workshop, &job, "breadth");
}

#[test]
fn the_input_of_a_job_may_have_moved() {
    let workshop = Workshop::new();
    job(&workshop, "data", &[1]);
    workshop.run(&["render", "data/job.toml"]).expect(0);
    fs::rename(workshop.join("data/in"), workshop.join("data/moved")).expect("a directory");
    refused(
        &workshop,
        &["data/job.toml", "-o", "new.yaml"],
        "data/job.toml: input.path: data/in: no such file or directory; \
         if the files have moved: spherule render NEW_PLACE -o data/out/f.####.exr",
    );
}

#[test]
fn unsupported_job_features() {
    let workshop = Workshop::new();
    job(&workshop, "data", &[1]);
    let slurm = |options: &[&str], expected: &str| {
        let arguments = ["export", "slurm", "data/job.toml", "-o", "new.yaml"];
        only(&workshop, &[&arguments, options].concat(), expected);
    };
    slurm(&["--time", "2h"], "invalid time limit");
    slurm(&["--time", "2:00"], "a time limit of 00:02:00 leaves no time");
    slurm(&["--signal-ahead", "0"], "1 to 65535 seconds");
    slurm(&["--partition", "a b"], "partition: \"a b\"");
    slurm(&["--concurrent", "0"], "--concurrent");
    slurm(&["--logs", "a\"b"], "log directory: ");
    slurm(&["--logs", "a\nb"], "line break");
    let openjd = ["export", "openjd", "data/job.toml", "-o", "new.txt"];
    only(&workshop, &openjd, "new.txt: engines recognise a template by its name");
    job(&workshop, "%04d", &[1]);
    let openjd = ["export", "openjd", "%04d/job.toml"];
    only(&workshop, &openjd, "rename the directory");
    job(&workshop, "a{{b", &[1]);
    let openjd = ["export", "openjd", "a{{b/job.toml"];
    only(&workshop, &openjd, "starts an expression");
}

#[test]
fn the_manifest_is_not_overwritten() {
    let workshop = Workshop::new();
    job(&workshop, "data", &[1]);
    let before = fs::read(workshop.join("data/job.toml")).expect("a manifest");
    for to in ["data/job.toml", "data/../data/job.toml"] {
        let arguments = ["export", "slurm", "data/job.toml", "-o", to];
        let ran = workshop.run(&arguments).expect(2);
        let _ = ran.prints("is the manifest itself");
    }
    assert_eq!(fs::read(workshop.join("data/job.toml")).expect("a manifest"), before);
}
