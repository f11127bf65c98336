//! TERM and Ctrl-C: exit code 75, and the same command goes on.

use std::fs;

use crate::harness::{JOB, Workshop, dam_break, files, images, ledger, no_leftovers};

const FRAMES: usize = 30;
/// A signal may come after the last frame on a busy machine; then it is tried again.
const TRIES: usize = 5;

/// Interrupts a job after its first frame; false if it was done before.
fn interrupt(workshop: &Workshop, out: &str, signal: &str) -> bool {
    let pattern = format!("{out}/f.####.exr");
    let arguments = [&["render", "in", "-o", &pattern][..], &JOB].concat();
    let mut running = workshop.start(&arguments);
    assert!(running.wait_for_line("] frame 1:"));
    running.signal(signal);
    let (messages, status) = running.end();
    if status.code() == Some(0) {
        return false;
    }
    assert_eq!(status.code(), Some(75), "{messages}");
    assert!(messages.contains("stopping after the frames in progress"), "{messages}");
    // The frame in progress was finished, and the messages match the files
    let done = ledger(&workshop.join(out)).lines.len();
    assert!((1..FRAMES).contains(&done), "{messages}");
    assert!(messages.contains(&format!("{done} of {FRAMES} frames done")), "{messages}");
    assert!(!messages.contains("error:") && !messages.contains("failed:"), "{messages}");
    assert_eq!(images(&workshop.join(out)).len(), 2 * done);
    no_leftovers(&workshop.join(out));
    true
}

// 30 frames, rendered three times: a shorter job could end before the signal comes.
#[test]
fn term_and_interrupt_end_with_75_and_the_job_goes_on() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=FRAMES);
    workshop.render_to("whole", &[]).expect(0);
    let whole = images(&workshop.join("whole"));
    for signal in ["TERM", "INT"] {
        let tried = |n: &usize| interrupt(&workshop, &format!("{signal}{n}"), signal);
        let out =
            (0..TRIES).find(tried).map(|n| format!("{signal}{n}")).expect("a signal comes in time");
        let done = ledger(&workshop.join(&out)).lines.len();
        // By the same command after one signal, by the job's own manifest after the other.
        let ran = if signal == "TERM" {
            workshop.render_to(&out, &[])
        } else {
            workshop.run(&["render", &format!("{out}/job.toml")])
        }
        .expect(0)
        .prints(&format!("{done} of {FRAMES} frames are done already"));
        assert_eq!(ran.rendered().len(), FRAMES - done);
        assert!(images(&workshop.join(&out)) == whole, "{signal}");
    }
}

#[test]
fn an_interrupted_second_try_is_no_failure() {
    let workshop = Workshop::new();
    let input = workshop.join("in");
    let tried = |n: &usize| {
        let out = format!("out{n}");
        dam_break(&input, 1..=FRAMES);
        for frame in 2..=FRAMES {
            let file = input.join(format!("f_{frame}.bgeo"));
            let good = fs::read(&file).expect("a frame");
            fs::write(&file, &good[..good.len() / 2]).expect("a file");
        }
        workshop.render_to(&out, &[]).expect(1).prints(&format!("failed: 2-{FRAMES}"));
        dam_break(&input, 2..=FRAMES);
        let pattern = format!("{out}/f.####.exr");
        let arguments = [&["render", "in", "-o", &pattern][..], &JOB].concat();
        let mut running = workshop.start(&arguments);
        assert!(running.wait_for_line("] frame 2:"));
        running.signal("TERM");
        let (messages, status) = running.end();
        if status.code() == Some(0) {
            return false;
        }
        assert_eq!(status.code(), Some(75), "{messages}");
        assert!(!messages.contains("failed:"), "{messages}");
        true
    };
    assert!((0..TRIES).any(|n| tried(&n)), "no signal came in time");
}

/// Frames that take minutes: the program ends early or the test does not.
const LONG: [&str; 6] = ["--width", "1280", "--height", "720", "--samples", "256"];

#[test]
fn a_second_term_stops_at_once() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=2);
    let arguments = [&["render", "in", "-o", "out/f.####.exr"][..], &LONG].concat();
    let in_hand = (0..TRIES).any(|_| {
        let mut running = workshop.start(&arguments);
        // Told last before the first frame is begun.
        assert!(running.wait_for_line("colour by"));
        running.signal("TERM");
        let asked = running.wait_for_line("stopping after the frames in progress");
        running.signal("TERM");
        let (messages, status) = running.end();
        assert_eq!(status.code(), Some(75), "{messages}");
        // Without a frame in progress the first signal is enough
        asked && messages.contains("stopped; the same command continues")
    });
    assert!(in_hand, "no frame was ever in progress");
    assert!(images(&workshop.join("out")).is_empty());
    assert!(ledger(&workshop.join("out")).lines.is_empty());
}

#[test]
fn a_frame_that_outlasts_the_grace_period_is_dropped() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=2);
    for (out, options) in [("out", &[][..]), ("apart", &["--isolate"])] {
        let pattern = format!("{out}/f.####.exr");
        let arguments = ["render", "in", "-o", &pattern, "--grace", "0"];
        let arguments = [&arguments[..], &LONG, options].concat();
        let in_hand = (0..TRIES).any(|_| {
            let mut running = workshop.start(&arguments);
            assert!(running.wait_for_line("colour by"));
            running.signal("TERM");
            let (messages, status) = running.end();
            assert_eq!(status.code(), Some(75), "{messages}");
            messages.contains("the grace period of 0 s is over (--grace): stopping now")
        });
        assert!(in_hand, "no frame was ever in progress");
        let out = workshop.join(out);
        assert!(images(&out).is_empty() && ledger(&out).lines.is_empty());
        let parts = files(&out).into_keys().filter(|name| name.ends_with(".part"));
        assert_eq!(parts.count(), 0);
    }
}

// Starts a job of 30 frames again until a signal arrives while a frame is being rendered.
#[test]
fn a_frame_within_the_grace_period_is_finished() {
    let workshop = Workshop::new();
    let input = workshop.join("in");
    dam_break(&input, 1..=FRAMES);
    let in_hand = (0..TRIES).any(|n| {
        let pattern = format!("out{n}/f.####.exr");
        let options = ["render", "in", "-o", &pattern, "--set", "job.grace=600"];
        let mut running = workshop.start(&[&options[..], &JOB].concat());
        assert!(running.wait_for_line("] frame "));
        running.signal("TERM");
        let (messages, status) = running.end();
        let in_time = status.code() == Some(75);
        assert!(in_time || status.code() == Some(0), "{messages}");
        assert!(!messages.contains("is over"), "{messages}");
        let done = ledger(&workshop.join(format!("out{n}"))).done();
        in_time && !done.is_empty() && messages.contains("(grace period: 600 s)")
    });
    assert!(in_hand, "no signal came in time");
}

// Each refusal waits for the next heartbeat of the worker.
#[test]
fn a_job_is_not_changed_under_those_at_work() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=2);
    // Nobody needs the image
    let arguments = ["render", "in", "-o", "out/f.####.exr", "--threads", "1"];
    let arguments = [&arguments[..], &LONG].concat();
    let mut running = workshop.start(&arguments);
    assert!(running.wait_for_line("colour by"));
    for options in [&["--force"][..], &["--keep-done", "--max-depth", "2"]] {
        workshop
            .run(&[&arguments[..], options].concat())
            .expect(2)
            .prints("is working on this job; wait for it, or stop it first");
    }
    running.kill();
    assert_eq!(running.end().1.code(), None);
    assert!(workshop.join("out/job.plan.json").exists());
}
