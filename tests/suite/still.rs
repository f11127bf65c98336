//! `still`: one picture without a job.
//!
//! Most tests start the program several times: pictures are compared with each other and with those of jobs.

use std::fs;

use crate::harness::{Ran, SMALL, Workshop, dam_break, files, no_leftovers};

/// Five frames in `in`.
fn workshop() -> Workshop {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=5);
    workshop
}

fn still(workshop: &Workshop, options: &[&str]) -> Ran {
    workshop.run(&[&["still", "in"][..], &SMALL, options].concat())
}

/// The job of the same pictures.
fn job(workshop: &Workshop, options: &[&str]) -> Ran {
    workshop.run(&[&["render", "in", "-o", "out/f.####.exr"][..], &SMALL, options].concat())
}

#[test]
fn still_writes_only_the_image() {
    let workshop = workshop();
    let made = still(&workshop, &["-o", "looks/a.png"]).expect(0);
    // The frame in the middle.
    let line = made.text();
    assert!(line.starts_with("looks/a.png: frame 3, "), "{line}");
    assert!(line.ends_with(" s\n") && line.lines().count() == 1, "{line}");
    let first = still(&workshop, &["--frame", "1", "-o", "looks/b.png"]).expect(0);
    assert!(first.text().starts_with("looks/b.png: frame 1, "));
    still(&workshop, &["-o", "looks/c.exr"]).expect(0);
    let looks = files(&workshop.join("looks"));
    let names: Vec<&str> = looks.keys().map(String::as_str).collect();
    assert_eq!(names, ["a.png", "b.png", "c.exr"]);
    assert_ne!(looks["a.png"], looks["b.png"]);
    no_leftovers(&workshop.join("looks"));
}

#[test]
fn picture_equals_that_of_a_job() {
    let workshop = workshop();
    let look =
        ["--color-by", "velocity", "--map", "turbo", "--set", "camera.fov=50", "--fit", "all"];
    job(&workshop, &look).expect(0);
    for (name, image) in [("a.png", "f.0004.png"), ("a.exr", "f.0004.exr")] {
        let options = [&look[..], &["--frame", "4", "-o", name]].concat();
        still(&workshop, &options).expect(0);
        let job = fs::read(workshop.join("out").join(image)).expect("an image");
        assert!(fs::read(workshop.join(name)).expect("a picture") == job, "{name}");
    }
    // By the job's own manifest, too; its frames are those to choose the middle from.
    let made = workshop.run(&["still", "out/job.toml", "-o", "b.exr"]).expect(0);
    assert!(made.text().starts_with("b.exr: frame 3, "));
    let job = fs::read(workshop.join("out/f.0003.exr")).expect("an image");
    assert!(fs::read(workshop.join("b.exr")).expect("a picture") == job);
    let some = ["still", "out/job.toml", "--set", "input.frames=1-2", "-o", "b.exr"];
    assert!(workshop.run(&some).expect(0).text().starts_with("b.exr: frame 2, "));
}

#[test]
fn only_images_are_replaced() {
    let workshop = workshop();
    still(&workshop, &["-o", "a.png"]).expect(0);
    let before = fs::read(workshop.join("a.png")).expect("a picture");
    still(&workshop, &["--frame", "5", "-o", "a.png"]).expect(0);
    assert_ne!(fs::read(workshop.join("a.png")).expect("a picture"), before);

    fs::write(workshop.join("notes.png"), b"not a picture").expect("a file");
    let refused = |options: &[&str], why: &str| {
        still(&workshop, options).expect(2).prints(why);
    };
    refused(&["-o", "notes.png"], "notes.png: is not an image and would be overwritten;");
    assert_eq!(fs::read(workshop.join("notes.png")).expect("a file"), b"not a picture");
    fs::create_dir(workshop.join("dir.exr")).expect("a directory");
    refused(&["-o", "dir.exr"], "dir.exr: is not a file;");
    refused(
        &["-o", "look.eps"],
        "--output look.eps: the name must end in .png, .exr, .jpg, .tif, .pdf or .svg",
    );
    refused(&["-o", "look"], "the name must end in .png, .exr, .jpg, .tif, .pdf or .svg");
    refused(&["--frame", "9", "-o", "a.png"], "--frame 9: is not among the frames: 1-5");
    refused(&["--follow", "-o", "a.png"], "--follow: is for jobs, and `spherule still` has none");
    refused(&[], "--output");

    // The input under the name of an image.
    let frame = fs::read(workshop.join("in/f_1.bgeo")).expect("a frame");
    fs::write(workshop.join("in.exr"), &frame).expect("a file");
    std::os::unix::fs::symlink("../a.png", workshop.join("in/f_6.bgeo")).expect("a link");
    let ran = still(&workshop, &["--frame", "1", "-o", "a.png"]);
    ran.expect(2).prints("a.png: is an input and would be overwritten;");
}

#[test]
fn names_are_checked_before_the_render() {
    let workshop = workshop();
    let long = "x".repeat(5000) + ".png";
    for name in [long.clone(), format!("new/{long}")] {
        let ran = still(&workshop, &["-o", &name]).expect(2);
        assert!(!ran.errors().contains("surveying"), "{}", ran.errors());
    }
    assert!(!workshop.join("new").exists());
}

#[test]
fn the_first_and_last_frames_have_names() {
    let workshop = workshop();
    for (frame, number) in [("first", 1), ("last", 5), ("-1", 5), ("-5", 1)] {
        let made = still(&workshop, &["--frame", frame, "-o", "a.png"]).expect(0);
        assert!(made.text().starts_with(&format!("a.png: frame {number}, ")));
    }
    still(&workshop, &["--frame", "middle", "-o", "a.png"])
        .expect(2)
        .prints("expected the number of a frame, first, last, or a time (t=0.5)");
}

#[test]
fn images_of_a_job_are_not_replaced() {
    let workshop = workshop();
    workshop.render(&["--frames", "1-2"]).expect(0);
    for name in ["out/f.0001.exr", "out/f.0001.png", "out/f.0005.exr"] {
        still(&workshop, &["-o", name])
            .expect(2)
            .prints("is an image of the job in that directory; choose another name");
    }
    still(&workshop, &["-o", "out/look.png"]).expect(0);
    workshop.run(&["verify", "out"]).expect(0);
}

#[test]
fn a_frame_is_chosen_by_its_time() {
    let workshop = Workshop::new();
    fs::create_dir(workshop.join("in")).expect("a directory");
    for (frame, time) in [(1, "0"), (4, "0.2"), (9, "0.5")] {
        let text =
            format!("2\nTime={time} Properties=species:S:1:pos:R:3\nHe 0 0 0\nHe 1 0 {frame}\n");
        fs::write(workshop.join(format!("in/f_{frame}.xyz")), text).expect("a file");
    }
    for (time, number, found) in [("t=0.3", 4, "0.2"), ("t=0.36", 9, "0.5"), ("t=-1", 1, "0")] {
        let made = still(&workshop, &["--frame", time, "-o", "a.png"]).expect(0);
        assert!(made.text().starts_with(&format!("a.png: frame {number}, ")), "{}", made.text());
        made.prints(&format!("frame {number} is the nearest to {time}: its time is {found}"));
    }
    fs::write(workshop.join("in/f_4.xyz"), "1\n\nHe 0 0 0\n").expect("a file");
    still(&workshop, &["--frame", "t=0.3", "-o", "b.png"]).expect(2).prints(
        "--frame t=0.3: the files have no times; give the number of a frame, first or last",
    );
    assert!(!workshop.join("b.png").exists());
}

#[test]
fn a_frame_that_cannot_be_read_has_failed() {
    let workshop = workshop();
    let file = workshop.join("in/f_5.bgeo");
    let good = fs::read(&file).expect("a frame");
    fs::write(&file, &good[..good.len() / 2]).expect("a file");
    still(&workshop, &["--frame", "5", "-o", "a.png"]).expect(1).prints("error: frame 5: ");
    assert!(!workshop.join("a.png").exists());
    still(&workshop, &["--frame", "4", "-o", "a.png"]).expect(0);
}

#[test]
fn help_has_examples_and_no_job_options() {
    let workshop = Workshop::new();
    let help = workshop.run(&["still", "--help"]).expect(0).text();
    for shown in ["Examples:", "spherule still dump -o look.png", "--frame <NUMBER>", "look.exr"] {
        assert!(help.contains(shown), "no {shown} in\n{help}");
    }
    for hidden in ["--frames", "--follow ", "--isolate", "--retries"] {
        assert!(!help.contains(hidden), "{hidden} in\n{help}");
    }
}

#[test]
fn manifests_of_jobs_have_the_camera_of_the_job() {
    let workshop = workshop();
    workshop.render(&[]).expect(0);
    let job = fs::read(workshop.join("out/f.0004.png")).expect("an image");
    let arguments = ["still", "out/job.toml", "--frame", "4", "-o", "a.png"];
    workshop.run(&arguments).expect(0);
    assert!(fs::read(workshop.join("a.png")).expect("a picture") == job);
    // Without the job, the camera shows the frame of the picture
    let printed = still(&workshop, &["--frame", "4", "-o", "b.png"]).expect(0);
    printed.prints("camera: --set 'camera.eye=");
}

#[test]
fn pictures_without_background_have_alpha() {
    let workshop = workshop();
    let options = [
        "--set",
        "output.transparent=true",
        "--ground=none",
        "--color-by",
        "velocity",
        "--fit",
        "all",
    ];
    still(&workshop, &[&options[..], &["--frame", "3", "-o", "a.png"]].concat()).expect(0);
    let picture = image::open(workshop.join("a.png")).expect("a picture");
    assert_eq!(picture.color(), image::ColorType::Rgba8);
    let pixels: Vec<[u8; 4]> = picture.into_rgba8().pixels().map(|p| p.0).collect();
    assert_eq!(pixels[0], [0; 4]);
    // Particles are opaque, and have the colours that they have in front of a background
    still(&workshop, &[&options[2..], &["--frame", "3", "-o", "b.png"]].concat()).expect(0);
    let opaque = image::open(workshop.join("b.png")).expect("a picture").into_rgb8();
    let particles = pixels.iter().zip(opaque.pixels()).filter(|(pixel, _)| pixel[3] == 255);
    let mut count = 0;
    for ([r, g, b, _], other) in particles {
        count += 1;
        let difference = [r, g, b].into_iter().zip(other.0).map(|(a, b)| a.abs_diff(b)).max();
        assert!(difference <= Some(1), "{difference:?}");
    }
    assert!(count > 50, "{count}");
    assert!(pixels.iter().all(|[r, g, b, a]| *a > 0 || [r, g, b] == [&0; 3]));
    // Previews of jobs are the same, and other commands read them
    job(&workshop, &options).expect(0);
    let preview = fs::read(workshop.join("out/f.0003.png")).expect("a preview");
    assert_eq!(preview, fs::read(workshop.join("a.png")).expect("a picture"));
    for command in [
        &["verify", "out"][..],
        &["sheet", "out", "-o", "sheet.png"],
        &["movie", "out", "-o", "movie.gif"],
        &["view", "out", "-o", "view.html"],
    ] {
        workshop.run(command).expect(0);
    }
}

#[test]
fn progress_and_details_are_shown_on_request() {
    let workshop = workshop();
    // Nothing of it without a terminal
    let usual = still(&workshop, &["-o", "a.png"]).expect(0);
    assert!(!usual.errors().contains("traced"), "{}", usual.errors());
    let plain = still(&workshop, &["-o", "a.png", "--progress", "plain", "-v"]).expect(0);
    let errors = plain.errors();
    let tenths: Vec<&str> = errors.lines().filter(|line| line.ends_with("% traced")).collect();
    let expected: Vec<String> = (1..=10).map(|tenth| format!("{} % traced", 10 * tenth)).collect();
    assert_eq!(tenths, expected);
    let details = errors.lines().find(|line| line.contains("million rays")).expect("details");
    for part in ["trace ", "encode ", "peak memory "] {
        assert!(details.contains(part), "{details}");
    }
    // Events: every percent once, in rising order, and the picture
    let events = still(&workshop, &["-o", "a.png", "--progress", "json"]).expect(0).text();
    let events: Vec<serde_json::Value> =
        events.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let of = |name: &str| events.iter().filter(|event| event["event"] == name).count();
    assert_eq!([of("start"), of("progress"), of("frame_done"), of("end")], [1, 100, 1, 1]);
    let percents: Vec<u64> = events.iter().filter_map(|event| event["percent"].as_u64()).collect();
    assert_eq!(percents, (1..=100).collect::<Vec<u64>>());
    assert_eq!(events[events.len() - 1]["done"], 1);
    // Both words at once make no sense
    still(&workshop, &["-o", "a.png", "-q", "-v"]).expect(2);
    // Jobs have the details in their lines
    let job = workshop.run(&["render", "in", "-o", "out/f.####.exr", "-v", "--size", "64x36"]);
    assert!(job.expect(0).errors().contains("million rays; peak memory"));
}
