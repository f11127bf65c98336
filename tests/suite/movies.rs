//! Movies, contact sheets and pages of finished jobs. `.ci/movies` decodes those of a real `ffmpeg`.

use std::fs::{self, File};
use std::path::Path;

use crate::harness::{Ran, Workshop, dam_break, no_leftovers};

#[cfg(unix)]
mod ffmpeg;
mod view;

/// Exit codes.
const DONE: i32 = 0;
const REFUSED: i32 = 2;

/// A finished job in `out` with these frames.
fn job(frames: &[usize], options: &[&str]) -> Workshop {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), frames.iter().copied());
    workshop.render(options).expect(DONE);
    workshop
}

/// Size and pixels of a PNG.
fn png(path: &Path) -> ([u32; 2], Vec<u8>) {
    let mut reader =
        png::Decoder::new(File::open(path).expect("a picture")).read_info().expect("a PNG");
    let size = [reader.info().width, reader.info().height];
    let mut pixels = vec![0; reader.output_buffer_size()];
    let frame = reader.next_frame(&mut pixels).expect("pixels");
    pixels.truncate(frame.buffer_size());
    (size, pixels)
}

fn refuses(ran: Ran, text: &str) {
    ran.expect(REFUSED).prints(text);
}

/// A job of some frames is complete when these are done.
#[test]
fn movies_have_the_frames_that_the_render_asked_for() {
    let workshop = job(&[1, 2, 3, 4, 5], &["--frames", "1-5x2"]);
    let movie = ["movie", "out", "-o", "a.gif"];
    let note = "3 of 5 frames, those that renders have asked for; --frames 1-5 takes all";
    let ran = workshop.run(&movie).expect(DONE).prints(note);
    assert!(ran.text().contains("3 frames"), "{}", ran.text());
    let ran = workshop.run(&["verify", "out"]).expect(DONE);
    assert!(!ran.text().contains("pending"), "{}", ran.text());
    workshop.render(&["--frames", "1-5"]).expect(DONE);
    let ran = workshop.run(&movie).expect(DONE);
    assert!(ran.text().contains("5 frames"), "{}", ran.text());
}

#[test]
fn animations_have_all_frames() {
    let workshop = job(&[1, 2, 3], &[]);
    for (name, line) in [
        ("a.gif", "a.gif: GIF, 64x36, 3 frames in 0.12 s at 25 fps"),
        ("new/a.png", "a.png: animated PNG, 64x36, 3 frames"),
        ("a.webp", "a.webp: animated WebP, 64x36, 3 frames"),
    ] {
        let ran = workshop.run(&["movie", "out", "-o", name]).expect(DONE);
        assert!(ran.text().contains(line), "{}", ran.text());
        // Again, over the own file: the same bytes
        let bytes = fs::read(workshop.join(name)).expect("a movie");
        workshop.run(&["movie", "out/job.toml", "-o", name]).expect(DONE);
        assert_eq!(fs::read(workshop.join(name)).expect("a movie"), bytes);
    }
    // The first picture of an animated PNG is the first preview
    assert_eq!(png(&workshop.join("new/a.png")), png(&workshop.join("out/f.0001.png")));
    let small =
        workshop.run(&["movie", "out", "-o", "s.png", "--width", "32", "--fps", "10"]).expect(DONE);
    assert!(small.text().contains("32x18, 3 frames in 0.30 s at 10 fps"), "{}", small.text());
    // A GIF cannot be as fast
    let fast = ["movie", "out", "-o", "f.gif", "--fps", "100"];
    let fast = workshop.run(&fast).expect(DONE);
    assert!(fast.text().contains("3 frames in 0.06 s at 50 fps"), "{}", fast.text());
    fast.prints("the movie is slower than 100 fps");
    no_leftovers(workshop.path());
    no_leftovers(&workshop.join("out"));
}

#[test]
fn an_image_is_no_job() {
    let workshop = job(&[1], &[]);
    for arguments in [
        &["movie", "out/f.0001.exr", "-o", "a.gif"][..],
        &["status", "out/f.0001.exr"],
        &["verify", "out/f.0001.png"],
    ] {
        workshop
            .run(arguments)
            .expect(REFUSED)
            .prints("is a file; give the directory of the job: out");
    }
}

#[test]
fn gaps_are_held_or_left_out() {
    let workshop = job(&[1, 2, 3, 6], &[]);
    let held = workshop.run(&["movie", "out", "-o", "a.gif"]).expect(DONE);
    assert!(held.text().contains("6 frames in 0.24 s"), "{}", held.text());
    let held = held.prints("2 frames are missing after frame 3, which is shown for");
    drop(held);
    let skipped = workshop.run(&["movie", "out", "-o", "a.gif", "--gaps", "skip"]).expect(DONE);
    assert!(skipped.text().contains("4 frames in 0.16 s"), "{}", skipped.text());
    skipped.prints("2 frames are missing after frame 3, which is followed by the next");
    let some = workshop.run(&["movie", "out", "-o", "a.gif", "--frames", "1-6x5"]).expect(DONE);
    assert!(some.text().contains("2 frames") && some.errors().is_empty(), "{}", some.errors());
}

#[test]
fn unfinished_jobs_are_refused_unless_partial() {
    let workshop = job(&[1, 2, 3], &["--shard", "1/3"]);
    let ran = workshop.run(&["movie", "out", "-o", "a.gif"]);
    refuses(
        ran,
        "out: 1 of 3 frames are done, missing: 2-3; the same `render` command continues the job, or",
    );
    assert!(!workshop.join("a.gif").exists());
    let partial = workshop.run(&["movie", "out", "-o", "a.gif", "--partial"]).expect(DONE);
    partial.prints("missing: 2-3; the movie shows what is there");
    workshop.run(&["movie", "out", "-o", "a.gif", "--frames", "1"]).expect(DONE);
    let sheet = workshop.run(&["sheet", "out", "-o", "a.png"]).expect(DONE);
    sheet.prints("missing: 2-3; the sheet shows what is there");
    // A finished frame whose preview is lost
    fs::remove_file(workshop.join("out/f.0001.png")).expect("a preview");
    refuses(workshop.run(&["movie", "out", "-o", "b.gif", "--frames", "1"]), "missing: 1");
    let ran = workshop.run(&["movie", "out", "-o", "b.gif", "--partial"]);
    refuses(ran, "0 of 3 frames are done, missing: 1-3; there is nothing to show yet");
}

#[test]
fn only_own_files_are_replaced() {
    let workshop = job(&[1, 2], &[]);
    for (command, name) in [("movie", "a.gif"), ("sheet", "a.png"), ("view", "a.html")] {
        let path = workshop.join(name);
        fs::write(&path, b"by hand").expect("a file");
        refuses(
            workshop.run(&[command, "out", "-o", name]),
            "already exists and was not made by this command;",
        );
        assert_eq!(fs::read(&path).expect("a file"), b"by hand");
        workshop.run(&[command, "out", "-o", name, "--force"]).expect(DONE);
        workshop.run(&[command, "out", "-o", name]).expect(DONE);
        fs::create_dir(workshop.join(format!("dir.{name}"))).expect("a directory");
        let dir = format!("dir.{name}");
        refuses(workshop.run(&[command, "out", "-o", &dir, "--force"]), "is not a file;");
    }
    for (command, name) in [("movie", "out/f.0001.png"), ("sheet", "out/../out/f.0002.png")] {
        let ran = workshop.run(&[command, "out", "-o", name, "--force"]);
        refuses(ran, "is an image or an input of the job; choose another name");
    }
    workshop.run(&["verify", "out"]).expect(DONE);
}

#[test]
fn bad_requests_are_refused() {
    let workshop = job(&[1], &[]);
    let movie = |options: &[&str], text: &str| {
        refuses(workshop.run(&[&["movie", "out"], options].concat()), text);
    };
    movie(&["-o", "a.avi"], "--output a.avi: the name must end in .mp4,");
    movie(
        &["-o", "a.gif", "--codec", "h264"],
        "a codec can be chosen for .mp4, .mov, .mkv and .webm only",
    );
    movie(
        &["-o", "a.webm", "--codec", "prores"],
        "webm files cannot have the codec prores; choose one of vp9",
    );
    movie(&["-o", "a.gif", "--fps", "0"], "expected frames per second from 0.1 to 240");
    movie(&["-o", "a.gif", "--frames", "7"], "--frames: 7 contains none of the job's frames: 1");
    refuses(workshop.run(&["movie", "in", "-o", "a.gif"]), "in: no job here");
    refuses(
        workshop.run(&["sheet", "out", "-o", "a.jpg"]),
        "--output a.jpg: the name must end in .png",
    );
    workshop.run(&["convert", "in", "-o", "frames"]).expect(DONE);
    refuses(
        workshop.run(&["movie", "frames", "-o", "a.gif"]),
        "this job has native frames, no pictures;",
    );
    // A damaged preview of the recorded length
    let path = workshop.join("out/f.0001.png");
    let length = fs::read(&path).expect("a preview").len();
    fs::write(&path, vec![7; length]).expect("a file");
    refuses(workshop.run(&["movie", "out", "-o", "a.gif"]), "f.0001.png: cannot be decoded");
    refuses(workshop.run(&["sheet", "out", "-o", "a.png"]), "f.0001.png: cannot be decoded");
    no_leftovers(workshop.path());
}

#[test]
fn sheets_have_chosen_frames() {
    let workshop = job(&[1, 2, 3, 4, 5], &[]);
    let ran = workshop
        .run(&["sheet", "out", "-o", "a.png", "--width", "100", "--columns", "3"])
        .expect(DONE);
    assert_eq!(ran.text().trim(), "a.png: 100x40, 3 columns of 28x16, frames 1-5");
    // At full size the pictures are unchanged
    let two = ["sheet", "out", "-o", "b.png", "--count", "2", "--columns", "1", "--gap", "0"];
    let ran = workshop.run(&two).expect(DONE);
    assert!(ran.text().contains("frames 1,5"), "{}", ran.text());
    let (size, pixels) = png(&workshop.join("b.png"));
    assert_eq!(size, [64, 72]);
    let first = png(&workshop.join("out/f.0001.png")).1;
    let last = png(&workshop.join("out/f.0005.png")).1;
    assert_eq!(pixels, [first, last].concat());
}

/// Pictures of images without previews are those that the previews would be, but for rounding to half-floats.
#[test]
fn images_without_previews_are_shown() {
    let exposed = ["--set", "output.preview_exposure=0.5"];
    let workshop = job(&[1], &exposed);
    let bare = [&exposed[..], &["--set", "output.preview=false"]].concat();
    workshop.render_to("bare", &bare).expect(DONE);
    workshop.run(&["sheet", "bare", "-o", "a.png"]).expect(DONE);
    let (size, expected) = png(&workshop.join("out/f.0001.png"));
    let (found_size, found) = png(&workshop.join("a.png"));
    assert_eq!(size, found_size);
    let differences: Vec<u8> = expected.iter().zip(&found).map(|(a, b)| a.abs_diff(*b)).collect();
    let largest = differences.iter().max().expect("pixels");
    assert!(*largest <= 1, "{largest}");
    workshop.run(&["movie", "bare", "-o", "a.gif"]).expect(DONE);
    // Images without background cannot be shown
    let transparent = [&bare[..], &["--set", "output.transparent=true"]].concat();
    workshop.render_to("open", &transparent).expect(DONE);
    let ran = workshop.run(&["movie", "open", "-o", "b.gif"]);
    refuses(
        ran,
        "this job has no previews, and its images have no background; render it with --set output.preview",
    );
}

#[test]
fn render_makes_a_movie_at_its_end() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), [1, 2]);
    refuses(workshop.render(&["--movie", "a.avi"]), "--movie a.avi: the name must end in");
    fs::write(workshop.join("b.gif"), b"by hand").expect("a file");
    refuses(
        workshop.render(&["--movie", "b.gif"]),
        "already exists and was not made by this command",
    );
    assert!(!workshop.join("out").exists(), "refused before the render");
    let ran = workshop.render(&["--movie", "a.gif", "--progress", "json"]).expect(DONE);
    assert!(ran.text().lines().all(|line| line.starts_with('{')), "{}", ran.text());
    ran.prints("a.gif: GIF, 64x36, 2 frames");
    // Nothing is left to render, but the movie may be
    fs::remove_file(workshop.join("a.gif")).expect("a movie");
    workshop.render(&["--movie", "a.gif"]).expect(DONE);
    assert!(workshop.join("a.gif").exists());
    // A frame that fails
    fs::write(workshop.join("in/f_3.bgeo"), b"damaged").expect("a frame");
    let ran = workshop.render(&["--movie", "c.gif"]).expect(1);
    ran.prints("no movie: not all frames are done");
    assert!(!workshop.join("c.gif").exists());
}
