//! Killed, interrupted, or out of room: the same command goes on, and the frames are those of an unbroken
//! run.

use std::fs;

use glam::Vec3;

use super::convert;
use crate::harness::{Running, Workshop, dam_break, files, ledger, natives, no_leftovers, npy};

const FRAMES: usize = 40;
const Q10: [&str; 6] = ["convert", "in", "-o", "out", "--encoding", "q10"];
/// A signal may come after the last frame on a busy machine; then it is tried again.
const TRIES: usize = 5;

/// When to kill.
#[derive(Debug, Clone, Copy)]
enum Moment {
    /// Once the plan is there.
    Plan,
    /// While a frame is being written.
    Writing,
    /// Once it has made so many frames; the ledger may not know of the last.
    Frames(usize),
    /// After its first message about a frame.
    Told,
}

fn wait(running: &mut Running, moment: Moment, shop: &Workshop) -> bool {
    let out = shop.join("out");
    let before = natives(&out).len();
    let is_part = |name: &String| name.starts_with(".frame.") && name.ends_with(".part");
    match moment {
        Moment::Plan => running.wait_until(|| out.join("job.plan.json").exists()),
        Moment::Writing => running.wait_until(|| files(&out).keys().any(is_part)),
        Moment::Frames(expected) => running.wait_until(|| natives(&out).len() >= before + expected),
        Moment::Told => running.wait_for_line("] frame "),
    }
}

// Kills seven conversions: most of them have to come in time, at different moments.
#[test]
fn repeated_kills_give_the_uninterrupted_result() {
    let shop = Workshop::new();
    dam_break(&shop.join("in"), 1..=FRAMES);
    let mut unbroken = Q10;
    unbroken[3] = "whole";
    shop.run(&unbroken).expect(0);
    let whole = natives(&shop.join("whole"));
    assert_eq!(whole.len(), FRAMES);
    let mut kills = 0;
    for moment in [
        Moment::Plan,
        Moment::Writing,
        Moment::Frames(1),
        Moment::Told,
        Moment::Writing,
        Moment::Frames(3),
        Moment::Writing,
    ] {
        let mut running = shop.start(&Q10);
        wait(&mut running, moment, &shop);
        running.kill();
        let (errors, status) = running.end();
        match status.code() {
            None => kills += 1,
            // It was faster; there is no other way to end.
            code => assert_eq!(code, Some(0), "{moment:?}: {errors}"),
        }
        let made = natives(&shop.join("out"));
        for (name, bytes) in &made {
            assert!(whole.get(name) == Some(bytes), "{moment:?}: {name}");
        }
        for (name, length) in ledger(&shop.join("out")).done() {
            let bytes = made.get(&name).map(|b| b.len() as u64);
            assert_eq!(bytes, Some(length), "{moment:?}: {name} is reported done");
        }
    }
    assert!(kills >= 4, "only {kills} kills came in time");
    shop.run(&Q10).expect(0);
    no_leftovers(&shop.join("out"));
    assert!(natives(&shop.join("out")) == whole);
    let plan = |dir: &str| fs::read(shop.join(dir).join("job.plan.json")).expect("the plan");
    assert!(plan("out") == plan("whole"));
    assert!(shop.run(&Q10).expect(0).rendered().is_empty());
}

/// A frame for which the clock of a test goes slowly.
fn large_frame() -> Workshop {
    let shop = Workshop::new();
    npy(&shop.join("in/f_1.npy"), 1_000_000, 1, Vec3::ZERO);
    shop
}

// Converts 40 frames for each signal: a shorter job could end before the signal comes.
#[test]
fn term_and_interrupt_exit_75_after_the_current_frame() {
    let shop = Workshop::new();
    dam_break(&shop.join("in"), 1..=FRAMES);
    for signal in ["TERM", "INT"] {
        let tried = |_: &usize| {
            let _ = fs::remove_dir_all(shop.join("out"));
            let mut running = shop.start(&Q10);
            assert!(running.wait_for_line("] frame 1:"));
            running.signal(signal);
            let (errors, status) = running.end();
            if status.code() == Some(0) {
                return false;
            }
            assert_eq!(status.code(), Some(75), "{errors}");
            let done = ledger(&shop.join("out")).lines.len();
            assert!((1..FRAMES).contains(&done), "{errors}");
            assert!(errors.contains(&format!("{done} of {FRAMES} frames done")));
            assert!(!errors.contains("error:") && !errors.contains("failed:"));
            assert_eq!(natives(&shop.join("out")).len(), done);
            no_leftovers(&shop.join("out"));
            let ran = shop.run(&Q10).expect(0);
            assert_eq!(ran.rendered().len(), FRAMES - done);
            true
        };
        assert!((0..TRIES).any(|n| tried(&n)), "no {signal} came in time");
    }
}

// A frame of a million particles takes long enough for two signals.
#[test]
fn a_second_term_stops_at_once() {
    let shop = large_frame();
    let in_hand = (0..TRIES).any(|_| {
        let mut running = shop.start(&Q10);
        // Told last before the first frame is begun.
        assert!(running.wait_for_line("half the typical distance"));
        running.signal("TERM");
        let is_stopping = running.wait_for_line("stopping after the frames in progress");
        running.signal("TERM");
        let (errors, status) = running.end();
        if status.code() == Some(0) {
            fs::remove_dir_all(shop.join("out")).expect("a directory");
            return false;
        }
        assert_eq!(status.code(), Some(75), "{errors}");
        assert!(natives(&shop.join("out")).is_empty());
        let left = files(&shop.join("out"));
        let is_part = |name: &String| name.ends_with(".part");
        assert!(!left.keys().any(is_part), "{:?}", left.keys());
        // Without a frame in progress the first signal is enough
        is_stopping && errors.contains("stopped; the same command continues")
    });
    assert!(in_hand, "no frame was ever in progress");
    assert!(ledger(&shop.join("out")).lines.is_empty());
}

// A frame of a million particles takes long enough for a second process to wait for it.
#[test]
fn second_process_takes_over_from_a_killed_one() {
    let shop = large_frame();
    let mut running = shop.start(&Q10);
    assert!(running.wait_for_line("half the typical distance"));
    let mut second = shop.start(&Q10);
    let waits = second.wait_for_line("is working on it");
    running.kill();
    running.end();
    let (errors, status) = second.end();
    assert_eq!(status.code(), Some(0), "{errors}");
    assert!(waits, "{errors}");
    assert_eq!(natives(&shop.join("out")).len(), 1);
    no_leftovers(&shop.join("out"));
}

/// Files may not grow beyond some limit: the frame fails, and nothing of it is left.
#[cfg(unix)]
#[test]
fn a_frame_that_cannot_be_written_costs_one_frame() {
    let shop = Workshop::new();
    dam_break(&shop.join("in"), 1..=2);
    convert(&shop, &[]).expect(0);
    let whole = natives(&shop.join("out"));
    fs::remove_dir_all(shop.join("out")).expect("a directory");
    let smallest = whole.values().map(Vec::len).min().expect("frames");
    // In blocks of 512 bytes; the signal about the limit is ignored.
    let script = format!("trap '' XFSZ; ulimit -f {}; exec \"$@\"", (smallest - 1) / 512);
    let output = std::process::Command::new("sh")
        .args(["-c", &script, "sh", env!("CARGO_BIN_EXE_spherule")])
        .args(["convert", "in", "-o", "out"])
        .current_dir(shop.path())
        .output()
        .expect("sh starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{errors}");
    assert!(errors.contains("0 of 2 frames done"), "{errors}");
    assert!(natives(&shop.join("out")).is_empty());
    no_leftovers(&shop.join("out"));
    convert(&shop, &[]).expect(0);
    assert!(natives(&shop.join("out")) == whole);
}
