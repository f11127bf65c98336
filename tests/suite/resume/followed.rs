//! `--follow`: a simulation that writes while we render.
//!
//! Tests wait until files have settled (`--settle`), and until no more come (`--idle`).

use std::fs;
use std::path::Path;

use crate::harness::{JOB, Workshop, dam_break, images, ledger, no_leftovers};

const QUICK: [&str; 3] = ["--follow", "--settle", "0.3"];

fn arguments<'a>(options: &[&'a str]) -> Vec<&'a str> {
    let render = ["render", "in", "-o", "out/f.####.exr"];
    [&render[..], &JOB, &QUICK, options].concat()
}

/// The bytes of a frame of the example.
fn frame(workshop: &Workshop, number: usize) -> Vec<u8> {
    dam_break(&workshop.join("elsewhere"), [number]);
    fs::read(workshop.join(format!("elsewhere/f_{number}.bgeo"))).expect("a frame")
}

#[test]
fn frames_are_rendered_as_they_come_until_the_stop_file_appears() {
    let workshop = Workshop::new();
    let mut running = workshop.start(&arguments(&[]));
    // The simulation has not even made its directory.
    assert!(running.wait_for_line("waiting: "));
    let input = workshop.join("in");
    fs::create_dir(&input).expect("a directory");
    for number in 1..=3 {
        let bytes = frame(&workshop, number);
        fs::write(input.join(format!("f_{number}.bgeo")), bytes).expect("a file");
        assert!(running.wait_for_line(&format!("] frame {number}:")));
    }
    fs::write(workshop.join("out/job.stop"), "").expect("a file");
    let (messages, status) = running.end();
    assert_eq!(status.code(), Some(0), "{messages}");
    assert!(messages.contains("job.stop exists"), "{messages}");
    assert!(!messages.contains("error"), "a file was taken before it was complete: {messages}");
    assert_eq!(ledger(&workshop.join("out")).lines.len(), 3);
    no_leftovers(&workshop.join("out"));

    // The same as if everything had been there, but for what was settled by the first frame alone.
    dam_break(&workshop.join("first"), 1..=1);
    let render = ["render", "in", "-o", "whole/f.####.exr"];
    fs::rename(&input, workshop.join("later")).expect("a directory");
    fs::rename(workshop.join("first"), &input).expect("a directory");
    let render = [&render[..], &JOB].concat();
    workshop.run(&render).expect(0);
    fs::remove_dir_all(&input).expect("a directory");
    fs::rename(workshop.join("later"), &input).expect("a directory");
    workshop.run(&[&render[..], &["--keep-done"]].concat()).expect(0);
    assert!(images(&workshop.join("out")) == images(&workshop.join("whole")));
}

#[test]
fn it_ends_when_nothing_new_comes_and_goes_on_from_there() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=2);
    let ran = workshop.run(&arguments(&["--idle", "1"])).expect(0).prints("no new frames for 1 s");
    assert_eq!(ran.rendered(), [1, 2]);
    dam_break(&workshop.join("in"), 3..=3);
    let ran = workshop.run(&arguments(&["--idle", "1"])).expect(0);
    assert_eq!(ran.rendered(), [3]);
    workshop
        .run(&arguments(&["--shard", "1/2"]))
        .expect(2)
        .prints("--shard 1/2 does not combine with --follow");
    // And what was never there is named.
    fs::remove_dir_all(workshop.join("in")).expect("a directory");
    let options = ["--idle", "0.5", "-o", "never/f.####.exr"];
    let never = [&["render", "in"][..], &QUICK, &options].concat();
    workshop
        .run(&never)
        .expect(2)
        .prints("waiting: in: no such file or directory")
        .prints("found no complete frame: no new frames for 0.5 s");
    assert!(!workshop.join("never").exists());
}

#[test]
fn a_frame_that_was_not_complete_after_all_is_made_once_it_is() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=2);
    let whole = fs::read(workshop.join("in/f_2.bgeo")).expect("a frame");
    let cut = |path: &Path| fs::write(path, &whole[..whole.len() / 2]).expect("a file");
    cut(&workshop.join("in/f_2.bgeo"));
    let mut running = workshop.start(&arguments(&[]));
    assert!(running.wait_for_line("frame 2: "));
    fs::write(workshop.join("in/f_2.bgeo"), &whole).expect("a file");
    assert!(running.wait_for_line("] frame 2:"));
    fs::write(workshop.join("out/job.stop"), "").expect("a file");
    let (messages, status) = running.end();
    assert_eq!(status.code(), Some(0), "{messages}");
    assert_eq!(images(&workshop.join("out")).len(), 4);
    // The stop file is of this run, not of the next
    workshop
        .run(&arguments(&["--idle", "0.5"]))
        .expect(0)
        .prints("job.stop is from an earlier run and does not end this one")
        .prints("no new frames for 0.5 s");
}

#[test]
fn a_signal_ends_it_with_75() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=1);
    let mut running = workshop.start(&arguments(&[]));
    assert!(running.wait_for_line("] frame 1:"));
    running.signal("TERM");
    let (messages, status) = running.end();
    assert_eq!(status.code(), Some(75), "{messages}");
    no_leftovers(&workshop.join("out"));
}

/// A simulator may pause inside a file for longer than `--settle`.
#[test]
fn a_finished_frame_whose_file_grows_is_rendered_again() {
    let workshop = Workshop::new();
    let input = workshop.join("in");
    fs::create_dir(&input).expect("a directory");
    let file = |number: usize| input.join(format!("f_{number}.xyz"));
    let lines = |count: usize| -> String {
        let line = |i: usize| format!("{} {} {}\n", i % 7, i / 7 % 7, i / 49);
        (0..count).map(line).collect()
    };
    fs::write(file(1), lines(300)).expect("a file");
    fs::write(file(2), lines(100)).expect("a file");
    for options in [&[][..], &["--isolate"]] {
        fs::write(file(2), lines(100)).expect("a file");
        let mut running = workshop.start(&arguments(options));
        assert!(running.wait_for_line("] frame 2:"));
        let half = fs::read(workshop.join("out/f.0002.exr")).expect("an image");
        fs::write(file(2), lines(300)).expect("a file");
        assert!(running.wait_for_line("note: frame 2: in/f_2.xyz: length "));
        assert!(running.wait_for_line("] frame 2:"));
        fs::write(file(3), lines(300)).expect("a file");
        assert!(running.wait_for_line("] frame 3:"));
        fs::write(workshop.join("out/job.stop"), "").expect("a file");
        let (messages, status) = running.end();
        assert_eq!(status.code(), Some(0), "{messages}");
        assert!(messages.contains("since it was rendered; it is rendered again"));
        assert!(fs::read(workshop.join("out/f.0002.exr")).expect("an image") != half);
        let report = fs::read_to_string(workshop.join("out/report.json")).expect("a report");
        assert_eq!(report.matches("\"status\": \"done\"").count(), 3, "{report}");
        let again = workshop.run(&arguments(&["--idle", "0.5"])).expect(0);
        assert!(again.rendered().is_empty());
        fs::remove_dir_all(workshop.join("out")).expect("a directory");
        fs::remove_file(file(3)).expect("a file");
    }
}

/// The run ended while the simulator paused inside a file.
#[test]
fn a_frame_that_grew_between_two_runs_is_rendered_again() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=3);
    let (whole, other) = (frame(&workshop, 2), frame(&workshop, 4));
    workshop.run(&arguments(&["--idle", "0.5"])).expect(0);
    let before = images(&workshop.join("out"));
    fs::write(workshop.join("in/f_2.bgeo"), &other).expect("a file");
    // What is cleared away has been rendered, and stays.
    fs::remove_file(workshop.join("in/f_1.bgeo")).expect("a file");

    let plainly = [&["render", "in", "-o", "out/f.####.exr"][..], &JOB].concat();
    workshop
        .run(&plainly)
        .expect(2)
        .prints("inputs of finished frames have changed: frame 2: in/f_2.bgeo: length ");
    let check = [&["check"], &arguments(&["--idle", "0.5"])[1..]].concat();
    let checked = workshop.run(&check).expect(0).prints("note: frame 2: in/f_2.bgeo: length ");
    assert!(checked.text().contains("to do 1 (2)"), "{}", checked.text());
    for (content, options) in [(&other, &[][..]), (&whole, &["--isolate"])] {
        fs::write(workshop.join("in/f_2.bgeo"), content).expect("a file");
        let ran = workshop
            .run(&arguments(&[&["--idle", "0.5"], options].concat()))
            .expect(0)
            .prints("note: frame 2: in/f_2.bgeo: length ")
            .prints(" since it was rendered; it is rendered again");
        assert_eq!(ran.rendered(), [2]);
        let is_as_before = images(&workshop.join("out")) == before;
        assert_eq!(is_as_before, content == &whole);
    }
    let ran = workshop.run(&arguments(&["--idle", "0.5"])).expect(0);
    assert!(ran.rendered().is_empty());
    workshop.run(&plainly).expect(0);

    // Finished frames can be kept all the same; other settings are refused as ever.
    fs::write(workshop.join("in/f_2.bgeo"), &other).expect("a file");
    let ran = workshop.run(&arguments(&["--idle", "0.5", "--keep-done"]));
    assert!(ran.expect(0).rendered().is_empty());
    workshop
        .run(&arguments(&["--idle", "0.5", "--max-depth", "1"]))
        .expect(2)
        .prints("settings have changed since this job began: render.max_depth: 3 -> 1");
}
