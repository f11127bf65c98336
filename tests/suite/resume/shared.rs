//! Several workers on one job: each frame is rendered once, and the result is that of one worker.
//!
//! Tests render twelve frames by one worker first, and most of them all frames again by others.

use std::fs;

use crate::harness::{JOB, Workshop, dam_break, images, ledger, no_leftovers};

const FRAMES: usize = 12;

fn arguments<'a>(options: &[&'a str]) -> Vec<&'a str> {
    [&["render", "in", "-o", "out/f.####.exr"][..], &JOB, options].concat()
}

/// A workshop with the images of an unbroken run in `whole`.
fn with_whole() -> Workshop {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=FRAMES);
    workshop.render_to("whole", &[]).expect(0);
    workshop
}

#[test]
fn workers_started_at_once_make_each_frame_once() {
    let workshop = with_whole();
    let team: Vec<_> = (0..4).map(|_| workshop.start(&arguments(&[]))).collect();
    for running in team {
        let (messages, status) = running.end();
        assert_eq!(status.code(), Some(0), "{messages}");
        assert!(messages.contains("12 of 12 frames done"), "{messages}");
    }
    let out = workshop.join("out");
    no_leftovers(&out);
    assert!(images(&out) == images(&workshop.join("whole")));
    let lines = ledger(&out).lines;
    assert_eq!(lines.len(), FRAMES, "{lines:?}");
    let report = workshop.report("out");
    let frames = report["frames"].as_array().expect("frames");
    assert!(frames.iter().all(|f| f["status"] == "done"), "all workers' frames are in it");
}

#[test]
fn parts_are_disjoint_and_together_everything() {
    let workshop = with_whole();
    let mut all = Vec::new();
    for part in ["1/5", "3/5", "2/5", "5/5", "4/5"] {
        let ran = workshop.run(&arguments(&["--shard", part])).expect(0);
        assert!(matches!(ran.rendered().len(), 2 | 3));
        all.extend(ran.rendered());
    }
    all.sort_unstable();
    assert_eq!(all, (1..=12).collect::<Vec<i64>>());
    assert!(images(&workshop.join("out")) == images(&workshop.join("whole")));
    // More parts than frames are no mistake.
    workshop.run(&arguments(&["--shard", "99/99"])).expect(0);
    workshop.run(&arguments(&["--shard", "6/5"])).expect(2).prints("from 1 to the number of parts");
}

#[test]
fn ranges_of_one_manifest_leave_the_manifest_as_it_is() {
    let workshop = with_whole();
    let manifest = fs::read_to_string(workshop.join("whole/job.toml")).expect("a manifest");
    fs::create_dir(workshop.join("out")).expect("a directory");
    fs::write(workshop.join("out/job.toml"), &manifest).expect("a file");
    for range in ["5-8", "9-12", "1-4"] {
        let ran = workshop.run(&["render", "out/job.toml", "--frames", range]);
        assert_eq!(ran.expect(0).rendered().len(), 4);
    }
    let after = fs::read_to_string(workshop.join("out/job.toml")).expect("a manifest");
    assert_eq!(after, manifest);
    assert!(images(&workshop.join("out")) == images(&workshop.join("whole")));
}

// The takeover comes after the other frames are rendered, so that frame 2 is the last.
/// The liveness of a worker on another machine is known only from its heartbeats.
#[test]
fn frames_of_an_unresponsive_worker_are_taken_over() {
    let workshop = with_whole();
    let work = workshop.join("out/job.work");
    fs::create_dir_all(&work).expect("a directory");
    let record = r#"{"worker":"far-7-00","process":{"token":"far-7-00","host":"far","machine":"gone","pid":7,"start":9},"since_ms":1}"#;
    fs::write(work.join("far-7-00.worker"), format!("{record}\n")).expect("a file");
    fs::hard_link(work.join("far-7-00.worker"), work.join("frame.2.0")).expect("a link");
    fs::write(workshop.join("out/.f.0002.exr.far-7-00.3.part"), "half").expect("a file");
    let ran = workshop
        .run(&arguments(&["--takeover-after", "4"]))
        .expect(0)
        .prints("waiting for frame 2: process 7 on far is working on it");
    assert_eq!(ran.rendered().last(), Some(&2));
    assert!(images(&workshop.join("out")) == images(&workshop.join("whole")));
    // Its temporary files are removed too
    no_leftovers(&workshop.join("out"));
}

/// A worker whose machine is gone shows no heartbeat, and must not keep a job from starting over.
#[test]
fn a_job_of_an_unresponsive_worker_starts_over() {
    let workshop = with_whole();
    workshop.run(&arguments(&[])).expect(0);
    let cases =
        [(&["--force"][..], FRAMES), (&["--keep-done", "--set", "image.filter=gaussian"], 0)];
    for (options, frames) in cases {
        let work = workshop.join("out/job.work");
        fs::create_dir_all(&work).expect("a directory");
        let record = r#"{"worker":"far-7-00","process":{"token":"far-7-00","host":"far","machine":"gone","pid":7,"start":9},"since_ms":1}"#;
        fs::write(work.join("far-7-00.worker"), format!("{record}\n")).expect("a file");
        let options = [options, &["--takeover-after", "0.3"]].concat();
        let ran = workshop
            .run(&arguments(&options))
            .expect(0)
            .prints("waiting for a heartbeat of process 7 on far");
        assert_eq!(ran.rendered().len(), frames);
        assert!(!work.exists());
    }
    assert!(images(&workshop.join("out")) == images(&workshop.join("whole")));
}

// Images take a while, so that the worker is still at work when its record is gone.
/// The directory with the worker records may be removed while a worker is active.
#[test]
fn a_worker_that_was_declared_dead_stops_and_may_rejoin() {
    let workshop = with_whole();
    let slow = ["--samples", "16", "--width", "640", "--height", "360"];
    let arguments = [&["render", "in", "-o", "slow/f.####.exr"][..], &slow].concat();
    let arguments = [&arguments[..], &["--takeover-after", "0.1"]].concat();
    let mut running = workshop.start(&arguments);
    assert!(running.wait_for_line("] frame 1:"));
    fs::remove_dir_all(workshop.join("slow/job.work")).expect("a directory");
    let (messages, status) = running.end();
    assert_eq!(status.code(), Some(75), "{messages}");
    assert!(
        messages.contains("its frames were reassigned; the same command rejoins"),
        "{messages}"
    );
    assert!(!ledger(&workshop.join("slow")).lines.is_empty());
}
