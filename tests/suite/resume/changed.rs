//! The same command does nothing; another setting or input is refused by name.
//!
//! Tests start the program several times over five frames: for a job, and for what is done to it later.

use std::fs;

use crate::harness::{JOB, Ran, Workshop, dam_break, images, ledger, stamps};

/// As a shell gives them for `in/*`.
const FIVE: [&str; 5] = ["in/f_1.bgeo", "in/f_2.bgeo", "in/f_3.bgeo", "in/f_4.bgeo", "in/f_5.bgeo"];

fn five_frames() -> Workshop {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=5);
    workshop
}

#[test]
fn the_same_command_again_does_nothing() {
    let workshop = five_frames();
    workshop.render(&[]).expect(0).prints("5 of 5 frames done");
    let out = workshop.join("out");
    let before = stamps(&out);
    // Two images a frame; manifest and its schema, plan, ledger and two reports.
    assert_eq!(before.len(), 2 * 5 + 6);
    let nothing = |ran: Ran| {
        let ran = ran.expect(0).prints("5 of 5 frames are done already");
        assert!(ran.rendered().is_empty());
    };
    nothing(workshop.render(&[]));
    assert_eq!(stamps(&out), before);

    // The same job in other words.
    nothing(workshop.render(&["--threads", "1", "--progress", "json"]));
    nothing(workshop.render(&["--accelerator", "lbvh"]));
    nothing(workshop.run(&["render", "out/job.toml"]));
    nothing(workshop.run(&["render", "./out/../out/job.toml"]));
    let absolute = workshop.join("in").display().to_string();
    for input in [&[absolute.as_str()][..], &["in/f_#.bgeo"], &FIVE] {
        let arguments = [&["render"], input, &["-o", "out/f.####.exr"], &JOB].concat();
        nothing(workshop.run(&arguments));
    }
    let after = stamps(&out);
    for (name, stamp) in &before {
        // The others tell of the last run: accelerator, threads, paths as they were given.
        if name.starts_with("f.") || name.ends_with(".jsonl") {
            assert_eq!(after.get(name), Some(stamp), "{name} was touched");
        }
    }
}

#[test]
fn the_directory_may_be_moved() {
    let workshop = five_frames();
    workshop.render(&[]).expect(0);
    fs::rename(workshop.join("out"), workshop.join("moved")).expect("a rename");
    workshop.run(&["render", "moved/job.toml"]).expect(0).prints("5 of 5 frames are done already");
    workshop.render_to("moved", &[]).expect(0).prints("5 of 5 frames are done already");
    assert!(!workshop.join("out").exists());
}

#[cfg(unix)]
#[test]
fn images_may_go_through_a_link() {
    let workshop = five_frames();
    fs::create_dir_all(workshop.join("disk/deep")).expect("a directory");
    std::os::unix::fs::symlink("disk/deep", workshop.join("out")).expect("a link");
    workshop.render(&[]).expect(0);
    workshop.run(&["render", "out/job.toml"]).expect(0).prints("5 of 5 frames are done already");
    workshop.render_to("out/../beside", &["--frames", "1"]).expect(0);
    assert!(workshop.join("disk/beside/f.0001.exr").exists());
}

#[test]
fn changed_settings_are_refused_with_old_and_new_value() {
    let workshop = five_frames();
    workshop.render(&[]).expect(0);
    let before = stamps(&workshop.join("out"));
    let refused = workshop
        .render(&["--max-depth", "2", "--set", "material.ior=1.5"])
        .expect(2)
        .prints("out: settings have changed since this job began: render.max_depth: 3 -> 2; material.ior: 1.33 -> 1.5;")
        .prints("--force starts over, --keep-done keeps what is there");
    assert_eq!(refused.errors().matches("error:").count(), 1);
    assert_eq!(stamps(&workshop.join("out")), before);

    let file = workshop.join("out/job.toml");
    let text = fs::read_to_string(&file).expect("the manifest");
    fs::write(&file, text.replace("max_depth = 3", "max_depth = 4")).expect("a file");
    workshop.run(&["render", "out/job.toml"]).expect(2).prints("render.max_depth: 3 -> 4");
}

#[test]
fn force_starts_over() {
    let workshop = five_frames();
    workshop.render(&[]).expect(0);
    workshop.render_to("fresh", &["--max-depth", "1"]).expect(0);
    let old = images(&workshop.join("out"));
    let ran = workshop.render(&["--max-depth", "1", "--force"]).expect(0);
    assert_eq!(ran.rendered(), [1, 2, 3, 4, 5]);
    let new = images(&workshop.join("out"));
    assert!(new != old && new == images(&workshop.join("fresh")));
    assert_eq!(ledger(&workshop.join("out")).lines.len(), 5);
    workshop.render(&[]).expect(2).prints("render.max_depth: 1 -> 3");
    workshop.render(&["--max-depth", "1"]).expect(0).prints("5 of 5 frames are done already");
}

#[test]
fn force_does_not_forget_a_job_for_one_that_cannot_be() {
    let workshop = five_frames();
    workshop.render(&[]).expect(0);
    let before = stamps(&workshop.join("out"));
    workshop.render(&["--force", "--color-by", "nosuch"]).expect(2).prints("nosuch");
    assert_eq!(stamps(&workshop.join("out")), before);
    workshop.render(&[]).expect(0).prints("5 of 5 frames are done already");
}

#[test]
fn keep_done_keeps_what_is_there_and_does_the_rest_anew() {
    let workshop = five_frames();
    workshop.render(&["--frames", "1-3"]).expect(0);
    let old = images(&workshop.join("out"));
    workshop.render_to("fresh", &["--max-depth", "1"]).expect(0);
    let fresh = images(&workshop.join("fresh"));
    let ran = workshop.render(&["--max-depth", "1", "--keep-done"]).expect(0);
    assert_eq!(ran.rendered(), [4, 5]);
    let mixed = images(&workshop.join("out"));
    assert_eq!(mixed.len(), 10);
    for (name, bytes) in &mixed {
        let expected = old.get(name).or_else(|| fresh.get(name));
        assert!(expected == Some(bytes), "{name}");
    }
    // From now on the new setting is the job's.
    workshop.render(&["--max-depth", "1"]).expect(0).prints("5 of 5 frames are done already");
    workshop.render(&[]).expect(2).prints("render.max_depth: 1 -> 3");
}

#[test]
fn options_on_the_job_s_own_manifest_become_part_of_it() {
    let workshop = five_frames();
    workshop.render(&[]).expect(0);
    let own = |options: &[&str]| workshop.run(&[&["render", "out/job.toml"], options].concat());
    let file = || fs::read_to_string(workshop.join("out/job.toml")).expect("the manifest");
    // Without the mark at the end, which has a checksum.
    let manifest = || {
        let text = file();
        let (text, mark) = text.trim_end().rsplit_once('\n').expect("lines");
        assert!(mark.starts_with("# Written by spherule"), "{mark}");
        text.to_owned()
    };
    let first = manifest();

    let ran = own(&["--width", "80", "--frames", "2", "--force"]).expect(0);
    assert_eq!(ran.rendered(), [2]);
    assert_eq!(manifest(), first.replace("width = 64", "width = 80"));
    let ran = own(&[]).expect(0);
    assert_eq!(ran.rendered(), [1, 3, 4, 5]);

    let output = workshop.join("out/g.####.exr").display().to_string();
    let ran = own(&["--keep-done", "-o", &output]).expect(0);
    assert_eq!(ran.rendered(), [1, 2, 3, 4, 5]);
    assert!(manifest().contains("path = \"g.####.exr\""));
    own(&[]).expect(0).prints("5 of 5 frames are done already");
}

/// No command changes what a user has written, or written into.
#[test]
fn a_manifest_that_a_user_wrote_stays_as_it_is() {
    let workshop = five_frames();
    workshop.render(&["--frames", "1"]).expect(0);
    let path = workshop.join("out/job.toml");
    let mine = format!("# mine\n{}", fs::read_to_string(&path).expect("the manifest"));
    fs::write(&path, &mine).expect("a file");
    let own = |options: &[&str]| workshop.run(&[&["render", "out/job.toml"], options].concat());
    let stays = || fs::read_to_string(&path).expect("the manifest") == mine;
    own(&["--frames", "1", "--keep-done"]).expect(0);
    own(&["--width", "90"]).expect(2);
    for option in ["--force", "--keep-done"] {
        let width = if option == "--force" { "80" } else { "90" };
        let messages =
            "out/job.toml: not written by spherule, or edited since, so it is not changed";
        own(&["--frames", "2", "--width", width, option]).expect(0).prints(messages);
        assert!(stays(), "{option}");
    }
    // Nor from elsewhere.
    let ran = workshop.render(&["--frames", "1", "--force"]).expect(0);
    assert!(stays() && !ran.errors().contains("not changed"));
    workshop.render(&["--max-depth", "1", "--force"]).expect(0);
    workshop.render(&["--max-depth", "1"]).expect(0);
    assert!(stays());
    let export = ["export", "slurm", "mine.toml", "-o", "out/job.toml"];
    fs::write(workshop.join("mine.toml"), "[input]\npath = \"in\"\n").expect("a file");
    workshop.run(&export).expect(2).prints("out/job.toml: is a manifest already");
    assert!(stays());
}

#[test]
fn force_and_keep_done_exclude_each_other() {
    let workshop = five_frames();
    workshop.render(&["--force", "--keep-done"]).expect(2).prints("cannot be used with");
    assert!(!workshop.join("out").exists());
}

#[test]
fn a_rewritten_input_is_refused_by_name() {
    let workshop = five_frames();
    workshop.render(&[]).expect(0);
    fs::copy(workshop.join("in/f_5.bgeo"), workshop.join("in/f_2.bgeo")).expect("a copy");
    workshop
        .render(&[])
        .expect(2)
        .prints("inputs of finished frames have changed: frame 2: in/f_2.bgeo: ");
    // Other frames are not concerned.
    workshop.render(&["--frames", "3-5"]).expect(0).prints("3 of 3 frames are done already");
    let ran = workshop.render(&["--keep-done"]).expect(0);
    assert!(ran.rendered().is_empty());
}
