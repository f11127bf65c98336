//! Movies with programs that stand for `ffmpeg`.

use std::fs;
use std::os::unix::fs::PermissionsExt;

use super::{DONE, REFUSED, job};
use crate::harness::{Ran, Workshop, no_leftovers};

/// Runs a command with this shell script as `ffmpeg`, or without any.
fn run(workshop: &Workshop, script: Option<&str>, arguments: &[&str]) -> Ran {
    let bin = workshop.join("bin");
    fs::create_dir_all(&bin).expect("a directory");
    let program = bin.join("ffmpeg");
    let _ = fs::remove_file(&program);
    if let Some(script) = script {
        fs::write(&program, format!("#!/bin/sh\nPATH=/usr/bin:/bin\n{script}\n"))
            .expect("a script");
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).expect("a script");
    }
    let mut command = workshop.command(arguments);
    Ran(command.env("PATH", &bin).output().expect("the program starts"))
}

/// Keeps what it gets in the file that the last argument names.
const KEEP: &str = r#"echo "$@" > arguments
for last; do :; done
cat > "${last#file:}"
printf 'Made with spherule' >> "${last#file:}""#;

#[test]
fn pictures_go_through_a_pipe() {
    let workshop = job(&[1, 2, 4], &[]);
    let ran = run(
        &workshop,
        Some(KEEP),
        &["movie", "out", "--output=-a:b.mp4", "--fps", "23.976", "--width", "63"],
    )
    .expect(DONE);
    assert!(
        ran.text().contains("-a:b.mp4: H.264, 64x36, 4 frames in 0.17 s at 23.976 fps"),
        "{}",
        ran.text()
    );
    ran.prints(
        "63x35 pixels become 64x36: H.264 needs even sides, so the last column or row is repeated",
    );
    let bytes = fs::read(workshop.join("-a:b.mp4")).expect("a movie");
    assert_eq!(bytes.len(), 4 * 64 * 36 * 3 + 18);
    let arguments = fs::read_to_string(workshop.join("arguments")).expect("arguments");
    for part in [
        "-pixel_format rgb24 -video_size 64x36 -framerate 23.976 -i pipe:0",
        "format=yuv420p -c:v libx264",
        "-movflags +faststart -f mp4 file:",
    ] {
        assert!(arguments.contains(part), "{arguments}");
    }
    // The name of the movie appears only when it is complete
    assert!(arguments.trim_end().ends_with(".part"), "{arguments}");
    no_leftovers(workshop.path());
}

#[test]
fn a_failing_ffmpeg_leaves_no_movie() {
    let workshop = job(&[1, 2], &[]);
    for (script, text) in [
        (
            "echo 'first line' >&2; echo 'no such encoder' >&2; exit 3",
            "exit status: 3): first line | no such encoder",
        ),
        (
            "cat > /dev/null; echo 'disk is full' >&2; exit 1",
            "ffmpeg has failed (exit status: 1): disk is full",
        ),
        (
            "head -c 100 > half; kill -9 $$",
            "ffmpeg has failed (signal: 9 (SIGKILL)): it printed nothing",
        ),
    ] {
        fs::write(workshop.join("a.mp4"), b"Made with spherule before").expect("a movie");
        let ran = run(&workshop, Some(script), &["movie", "out", "-o", "a.mp4"]);
        ran.expect(REFUSED).prints(text);
        let left = fs::read(workshop.join("a.mp4")).expect("the movie before");
        assert_eq!(left, b"Made with spherule before");
        no_leftovers(workshop.path());
    }
}

#[test]
fn without_ffmpeg_the_message_helps() {
    let workshop = job(&[1, 2], &[]);
    let ran = run(&workshop, None, &["movie", "out", "-o", "a.mp4"])
        .expect(REFUSED)
        .prints("ffmpeg is not installed")
        .prints("sudo apt install ffmpeg");
    ran.prints(
        "Or run by hand elsewhere: ffmpeg -framerate 25 -start_number 1 -i 'out/f.%04d.png' -vf",
    );
    assert!(!workshop.join("a.mp4").exists());
    no_leftovers(workshop.path());
    run(&workshop, None, &["movie", "out", "-o", "a.gif"]).expect(DONE);
    // Before the render, not after it
    let ran = run(&workshop, None, &["render", "in", "-o", "new/f.####.exr", "--movie", "a.mp4"]);
    ran.expect(REFUSED).prints("ffmpeg is not installed");
    assert!(!workshop.join("new").exists());
}

#[test]
fn a_signal_stops_ffmpeg_and_leaves_nothing() {
    let workshop = job(&[1, 2], &[]);
    // It never ends by itself
    run(&workshop, Some("echo $$ > started; cat > /dev/null; exec sleep 600"), &["--version"]);
    let mut command = workshop.command(&["movie", "out", "-o", "a.mp4"]);
    command.env("PATH", workshop.join("bin"));
    let mut running = crate::harness::Running::new(command);
    let started = workshop.join("started");
    assert!(
        running.wait_until(|| fs::read_to_string(&started).is_ok_and(|text| text.ends_with('\n')))
    );
    running.signal("TERM");
    let (errors, status) = running.end();
    assert_eq!(status.code(), Some(75), "{errors}");
    assert!(errors.contains("stopped; no file was written"), "{errors}");
    assert!(!workshop.join("a.mp4").exists());
    no_leftovers(workshop.path());
    let id = fs::read_to_string(&started).expect("its number");
    let is_alive = std::path::Path::new("/proc").join(id.trim()).exists();
    assert!(!is_alive, "ffmpeg is still running");
}
