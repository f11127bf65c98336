//! A job belongs to one input, and to the files that it made: another simulation, and files that somebody
//! else made, are refused.

use std::fs;

use crate::harness::{JOB, Workshop, dam_break, files, images};

/// Renders `input` to the images of `out`.
fn render(workshop: &Workshop, input: &str, options: &[&str]) -> crate::harness::Ran {
    let arguments = [&["render", input, "-o", "out/f.####.exr"][..], &JOB, options];
    workshop.run(&arguments.concat())
}

/// The frames `from` to 6 of the example in a directory of their own.
fn later_frames(workshop: &Workshop, dir: &str, from: usize) {
    dam_break(&workshop.join(dir), from..=6);
}

// Starts the program nine times: each other input with each option.
#[test]
fn another_simulation_does_not_join_a_job() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=3);
    render(&workshop, "in", &["--frames", "1-2"]).expect(0);
    let before = files(&workshop.join("out"));
    // Other frames, and the same numbers with other contents of which none is finished.
    later_frames(&workshop, "other", 4);
    for number in [1, 2, 3] {
        let from = workshop.join(format!("other/f_{}.bgeo", number + 3));
        let to = workshop.join(format!("third/f_{number}.bgeo"));
        fs::create_dir_all(workshop.join("third")).expect("a directory");
        fs::copy(from, to).expect("a copy");
    }
    // Simulations may well begin alike.
    fs::create_dir_all(workshop.join("alike")).expect("a directory");
    for number in [1, 2, 3] {
        let from = if number == 1 { "in" } else { "third" };
        let from = workshop.join(format!("{from}/f_{number}.bgeo"));
        fs::copy(from, workshop.join(format!("alike/f_{number}.bgeo"))).expect("a copy");
    }
    for (input, options) in [
        ("alike", &["--frames", "3"][..]),
        ("other", &[]),
        ("other", &["--keep-done"]),
        ("third", &["--frames", "3"]),
        ("third", &["--frames", "3", "--keep-done"]),
    ] {
        let ran = render(&workshop, input, options)
            .expect(2)
            .prints("out: this job was made from other files (")
            .prints("in/f_1.bgeo, now ")
            .prints("; choose another output, or start over with --force");
        assert!(ran.rendered().is_empty());
    }
    let check = ["check", "other", "-o", "out/f.####.exr"];
    workshop
        .run(&[&check[..], &JOB].concat())
        .expect(2)
        .prints("out: this job was made from other files (");
    assert!(files(&workshop.join("out")) == before);
    let ran = render(&workshop, "other", &["--force"]).expect(0);
    assert_eq!(ran.rendered(), [4, 5, 6]);
    // From now on the job is that of the others.
    render(&workshop, "in", &[]).expect(2);
}

/// The same word for two places is no same place.
#[test]
fn relative_paths_are_reported_apart_by_where_they_begin() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("a/dump"), 1..=2);
    later_frames(&workshop, "b/dump", 3);
    let render = |dir: &str| {
        let arguments = [&["render", "dump", "-o", "../out/f.####.exr"][..], &JOB].concat();
        let mut command = workshop.command(&arguments);
        command.current_dir(workshop.join(dir));
        crate::harness::Ran(command.output().expect("the program starts"))
    };
    render("a").expect(0);
    render("b").expect(2).prints("a/dump/f_1.bgeo, now dump/f_3.bgeo");
}

#[test]
fn another_pattern_in_the_same_directory_is_another_input() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=2);
    render(&workshop, "in/f_#.bgeo", &[]).expect(0);
    for number in [3, 4] {
        let to = workshop.join(format!("in/g_{number}.bgeo"));
        dam_break(&workshop.join("more"), [number]);
        fs::rename(workshop.join(format!("more/f_{number}.bgeo")), to).expect("a rename");
    }
    render(&workshop, "in/g_#.bgeo", &[]).expect(2).prints("keep what is there with --keep-done");
    let ran = render(&workshop, "in/g_#.bgeo", &["--keep-done"]).expect(0);
    assert_eq!(ran.rendered(), [3, 4]);
}

#[test]
fn moved_data_with_the_same_contents_go_on() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=3);
    render(&workshop, "in", &["--frames", "1-2"]).expect(0);
    fs::rename(workshop.join("in"), workshop.join("archive")).expect("a rename");
    later_frames(&workshop, "archive", 4);
    let ran = render(&workshop, "archive", &[]).expect(0).prints("2 of 6 frames are done already");
    assert_eq!(ran.rendered(), [3, 4, 5, 6]);
    let ran = render(&workshop, "archive/f_#.bgeo", &[]).expect(0);
    assert!(ran.rendered().is_empty());
}

/// `cp -r` gives files other times. The hash covers files of up to 128 KiB; larger ones are compared with the originals.
#[test]
fn copied_data_go_on() {
    let workshop = Workshop::new();
    for dir in ["in", "copy"] {
        dam_break(&workshop.join(dir), 1..=3);
    }
    let long = |dir: &str| workshop.join(dir).join("f_3.bgeo");
    let size = fs::metadata(long("in")).expect("a file").len();
    assert!(size > 128 << 10, "{size}");
    render(&workshop, "in", &[]).expect(0);
    let ran = render(&workshop, "copy", &[]).expect(0);
    assert!(ran.rendered().is_empty());
    // Of a file that differs in the middle, no end tells
    let mut bytes = fs::read(long("copy")).expect("a file");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(long("copy"), bytes).expect("a file");
    render(&workshop, "copy", &[]).expect(2).prints("modification time has changed");
}

#[test]
fn a_conversion_belongs_to_one_input_too() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=2);
    later_frames(&workshop, "other", 4);
    workshop.run(&["convert", "in", "-o", "out"]).expect(0);
    workshop
        .run(&["convert", "other", "-o", "out"])
        .expect(2)
        .prints("out: this job was made from other files (");
    workshop.run(&["convert", "other", "-o", "out", "--force"]).expect(0);
    // Not the directory with the input itself
    workshop
        .run(&["convert", "in", "-o", "./in"])
        .expect(2)
        .prints("in: is the input; choose another directory for the native frames");
}

// Starts the program 28 times: each name of a file with each option.
#[test]
fn files_that_no_job_made_are_not_replaced() {
    let names = ["f.0002.exr", "f.0001.png", "report.html", "report.json"];
    for name in names {
        let workshop = Workshop::new();
        dam_break(&workshop.join("in"), 1..=2);
        fs::create_dir(workshop.join("out")).expect("a directory");
        fs::write(workshop.join("out").join(name), "mine").expect("a file");
        // Also where this run would not make that file.
        for options in [&[][..], &["--frames", "1"], &["--shard", "1/2"], &["--keep-done"]] {
            render(&workshop, "in", options)
                .expect(2)
                .prints(&format!("out/{name}: already exists and was not written by this job; "))
                .prints("or replace it with --force");
        }
        let check = ["check", "in", "-o", "out/f.####.exr"];
        workshop
            .run(&[&check[..], &JOB].concat())
            .expect(2)
            .prints(&format!("out/{name}: already exists"));
        let left = files(&workshop.join("out"));
        assert_eq!(left.len(), 1, "{:?}", left.keys());
        assert_eq!(left[name], b"mine");
        render(&workshop, "in", &["--force"]).expect(0);
        assert_ne!(files(&workshop.join("out"))[name], b"mine");
        render(&workshop, "in", &[]).expect(0);
    }
}

#[test]
fn nor_are_files_in_the_way_of_frames_that_come_later() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=2);
    render(&workshop, "in", &["--set", "output.preview=false"]).expect(0);
    fs::write(workshop.join("out/f.0003.exr"), "mine").expect("a file");
    fs::write(workshop.join("out/f.0001.png"), "mine").expect("a file");
    // The previews are new to the job.
    render(&workshop, "in", &["--keep-done"]).expect(2).prints("out/f.0001.png: already exists");
    dam_break(&workshop.join("in"), 3..=3);
    render(&workshop, "in", &["--set", "output.preview=false"])
        .expect(2)
        .prints("out/f.0003.exr: already exists");
    fs::remove_file(workshop.join("out/f.0003.exr")).expect("a file");
    let ran = render(&workshop, "in", &["--set", "output.preview=false"]).expect(0);
    assert_eq!(ran.rendered(), [3]);
}

/// Image first, ledger second: a kill in between leaves an image that no ledger knows, and it is ours.
#[test]
fn images_whose_line_was_lost_are_replaced() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=2);
    render(&workshop, "in", &["--frames", "1"]).expect(0);
    let whole = images(&workshop.join("out"));
    for name in ["f.0002.exr", "f.0002.png"] {
        fs::write(workshop.join("out").join(name), "half").expect("a file");
    }
    for path in crate::harness::ledger_paths(&workshop.join("out")) {
        fs::remove_file(path).expect("a ledger");
    }
    let ran = render(&workshop, "in", &[]).expect(0);
    assert_eq!(ran.rendered(), [1, 2]);
    let now = images(&workshop.join("out"));
    assert!(now["f.0001.exr"] == whole["f.0001.exr"] && now["f.0002.exr"] != b"half");
}

#[test]
fn native_frames_that_no_job_made_are_not_replaced() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=2);
    fs::create_dir(workshop.join("out")).expect("a directory");
    fs::write(workshop.join("out/frame.0002.spf"), "mine").expect("a file");
    workshop
        .run(&["convert", "in", "-o", "out"])
        .expect(2)
        .prints("out/frame.0002.spf: already exists");
    assert_eq!(files(&workshop.join("out")).len(), 1);
    workshop.run(&["convert", "in", "-o", "out", "--force"]).expect(0);
}
