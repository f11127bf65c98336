//! Several workers at one job: each frame is made once, by whomever, and what comes of it is what one
//! worker makes.

use std::fs;

use crate::harness::{SMALL, Workshop, dam_break, images, ledger, no_leftovers};

const FRAMES: usize = 12;

fn arguments<'a>(options: &[&'a str]) -> Vec<&'a str> {
    [
        &["render", "in", "-o", "out/f.####.exr"][..],
        &SMALL,
        options,
    ]
    .concat()
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
        let (told, status) = running.end();
        assert_eq!(status.code(), Some(0), "{told}");
        assert!(told.contains("12 of 12 frames done"), "{told}");
    }
    let out = workshop.join("out");
    no_leftovers(&out);
    assert!(images(&out) == images(&workshop.join("whole")));
    let lines = ledger(&out).lines;
    assert_eq!(lines.len(), FRAMES, "{lines:?}");
    let report = fs::read_to_string(out.join("report.json")).expect("a report");
    let report: serde_json::Value = serde_json::from_str(&report).expect("JSON");
    let frames = report["frames"].as_array().expect("frames");
    assert!(
        frames.iter().all(|f| f["status"] == "done"),
        "all workers' frames are in it"
    );
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
    workshop
        .run(&arguments(&["--shard", "6/5"]))
        .expect(2)
        .tells("from 1 to the number of parts");
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

/// A worker whose machine went down cannot be asked whether it lives.
#[test]
fn a_silent_worker_elsewhere_is_waited_for_and_then_replaced() {
    let workshop = with_whole();
    let work = workshop.join("out/job.work");
    fs::create_dir_all(&work).expect("a directory");
    let card = r#"{"worker":"far-7-00","process":{"token":"far-7-00","host":"far","machine":"gone","pid":7,"start":9},"since_ms":1}"#;
    fs::write(work.join("far-7-00.worker"), format!("{card}\n")).expect("a file");
    fs::hard_link(work.join("far-7-00.worker"), work.join("frame.2.0")).expect("a link");
    fs::write(workshop.join("out/.f.0002.exr.far-7-00.3.part"), "half").expect("a file");
    let ran = workshop
        .run(&arguments(&["--takeover-after", "1"]))
        .expect(0)
        .tells("waiting for frame 2, which process 7 on far has in hand");
    assert_eq!(ran.rendered().last(), Some(&2));
    assert!(images(&workshop.join("out")) == images(&workshop.join("whole")));
    // With what it was writing.
    no_leftovers(&workshop.join("out"));
}

/// All that has the job's files in hand may vanish under a worker.
#[test]
fn a_worker_that_was_taken_for_dead_stops_and_may_join_again() {
    let workshop = with_whole();
    let slow = ["--samples", "64", "--width", "640", "--height", "360"];
    let arguments = [&["render", "in", "-o", "slow/f.####.exr"][..], &slow].concat();
    let arguments = [&arguments[..], &["--takeover-after", "0.1"]].concat();
    let mut running = workshop.start(&arguments);
    assert!(running.wait_for_line("] frame 1:"));
    fs::remove_dir_all(workshop.join("slow/job.work")).expect("a directory");
    let (told, status) = running.end();
    assert_eq!(status.code(), Some(75), "{told}");
    assert!(
        told.contains("taken it for dead; the same command joins again"),
        "{told}"
    );
    assert!(!ledger(&workshop.join("slow")).lines.is_empty());
}
