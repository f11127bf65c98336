//! SIGKILL at any moment loses at most the frames in progress, with one worker and with several.
//!
//! Thirty processes are killed in each test: moments such as that of writing an image come several times.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use glam::Vec3;

use crate::harness::{
    JOB, Running, Workshop, files, images, ledger, ledger_paths, no_leftovers, npy,
};

const FRAMES: usize = 36;

/// When to kill.
#[derive(Debug, Clone, Copy)]
enum Moment {
    /// At once.
    Start,
    /// Once it has registered as a worker.
    Registered,
    /// Once it has printed that a frame is finished.
    Reported,
    /// Once this file is there.
    File(&'static str),
    /// While an image is being written.
    Writing,
    /// While a frame is claimed; somewhere in reading, tracing or writing.
    Claimed,
    /// Once a ledger has become longer; its line may not be whole.
    Recorded,
    /// Once it has made so many images; the ledger may not know of the last.
    Images(usize),
    /// Once it has made so many previews; their image is on its way.
    Previews(usize),
}

/// In an order in which each can still come: what is there once stays.
const FIRST: [Moment; 6] = [
    Moment::Start,
    Moment::File("job.work"),
    Moment::File("job.plan.json"),
    Moment::File("job.toml"),
    Moment::Previews(1),
    Moment::Images(1),
];

/// Again and again.
const LATER: [Moment; 6] = [
    Moment::Writing,
    Moment::Claimed,
    Moment::Registered,
    Moment::Recorded,
    Moment::Previews(1),
    Moment::Reported,
];

type Files = BTreeMap<String, Vec<u8>>;

#[test]
fn killed_again_and_again_the_result_is_that_of_an_unbroken_run() {
    torture(1, 30);
}

#[test]
fn several_workers_killed_again_and_again_make_what_one_makes() {
    torture(4, 30);
}

#[test]
#[ignore = "takes half a minute"]
fn two_hundred_kills_lose_nothing() {
    torture(1, 100);
    torture(4, 100);
}

/// Lets `workers` processes work in one directory, kills one after the other and starts another in its
/// place, until so many are killed.
fn torture(workers: usize, enough: usize) {
    let workshop = Workshop::new();
    for (frame, seed) in (1..=FRAMES).zip(1..) {
        npy(&workshop.join(format!("in/f_{frame}.npy")), 1_000, seed, Vec3::ZERO);
    }
    workshop.render_to("whole", &[]).expect(0);
    let whole = images(&workshop.join("whole"));
    assert_eq!(whole.len(), 2 * FRAMES);

    let out = workshop.join("out");
    let arguments = [&["render", "in", "-o", "out/f.####.exr"][..], &JOB].concat();
    let mut team: Vec<Running> = Vec::new();
    let mut kills = 0;
    let moments = FIRST.into_iter().chain(LATER.into_iter().cycle());
    let mut done = 0;
    for moment in moments {
        while team.len() < workers {
            team.push(workshop.start(&arguments));
        }
        let mut running = team.remove(0);
        wait(&mut running, moment, &out);
        running.kill();
        let (messages, status) = running.end();
        if status.code().is_none() {
            kills += 1;
        } else {
            // It was faster; there is no other way to end.
            assert_eq!(status.code(), Some(0), "{moment:?}: {messages}");
            done += 1;
        }
        all_is_whole(&out, &whole, moment);
        if kills >= enough {
            break;
        }
        if images(&out).len() == whole.len() {
            // Made too soon: some of them again, once nobody is at them.
            finish(std::mem::take(&mut team));
            lose_some(&out, kills);
        }
    }
    assert!(kills >= enough && done < 4 * enough, "{kills} kills, {done} ends");
    finish(team);
    workshop.run(&arguments).expect(0);

    no_leftovers(&out);
    assert!(images(&out) == whole, "images differ from the unbroken run");
    let mut reported: Vec<String> = ledger(&out).done().into_iter().map(|(n, _)| n).collect();
    reported.sort();
    reported.dedup();
    assert_eq!(reported.len(), 2 * FRAMES);
    assert!(ledger_paths(&out).len() < 20, "dead workers' ledgers are brought together");
    for name in ["job.toml", "job.plan.json"] {
        let read = |dir: &str| fs::read(workshop.join(dir).join(name)).expect(name);
        assert!(read("out") == read("whole"), "{name} differs");
    }
    let again = workshop.run(&arguments).expect(0);
    assert!(again.rendered().is_empty());
}

/// Workers that are not killed do all that is left.
#[track_caller]
fn finish(team: Vec<Running>) {
    for running in team {
        let (messages, status) = running.end();
        assert_eq!(status.code(), Some(0), "{messages}");
    }
}

/// Removes every third image, so that there is something to do again.
fn lose_some(out: &Path, from: usize) {
    for frame in (1 + from % 3..=FRAMES).step_by(3) {
        let _ = fs::remove_file(out.join(format!("f.{frame:04}.exr")));
    }
}

fn wait(running: &mut Running, moment: Moment, out: &Path) {
    let before = images(out);
    let count = |extension: &str| {
        let fits = |(name, _): &(String, Vec<u8>)| name.ends_with(extension);
        let new = |(name, _): &(String, Vec<u8>)| !before.contains_key(name);
        images(out).into_iter().filter(fits).filter(new).count()
    };
    let lengths = || -> u64 {
        let length = |path| fs::metadata(path).map_or(0, |m| m.len());
        ledger_paths(out).iter().map(length).sum()
    };
    let recorded = lengths();
    let id = format!("-{}-", running.id());
    match moment {
        Moment::Start => true,
        Moment::Registered => running.wait_until(|| {
            let names = files(&out.join("job.work"));
            let is_own = |name: &String| name.contains(&id) && name.ends_with(".worker");
            names.keys().any(is_own)
        }),
        Moment::Reported => running.wait_for_line("] frame "),
        Moment::File(name) => running.wait_until(|| out.join(name).exists()),
        Moment::Writing => running.wait_until(|| {
            files(out).keys().any(|name| name.starts_with(".f.") && name.ends_with(".part"))
        }),
        Moment::Claimed => running.wait_until(|| {
            let names = files(&out.join("job.work"));
            names.keys().any(|name| name.starts_with("frame."))
        }),
        Moment::Recorded => running.wait_until(|| lengths() != recorded),
        Moment::Images(expected) => running.wait_until(|| count(".exr") >= expected),
        Moment::Previews(expected) => running.wait_until(|| count(".png") >= expected),
    };
}

/// Nothing under a final name is half written, and nothing is reported done that is not there, unless it
/// was lost on purpose.
#[track_caller]
fn all_is_whole(out: &Path, whole: &Files, moment: Moment) {
    let reported = ledger(out).done();
    let made = images(out);
    for (name, bytes) in &made {
        assert!(whole.get(name) == Some(bytes), "{moment:?}: {name} is not whole");
    }
    for (name, length) in reported {
        let bytes = made.get(&name).map_or(length, |b| b.len() as u64);
        assert_eq!(bytes, length, "{moment:?}: {name} is reported done");
        let expected = whole.get(&name).map(|b| b.len() as u64);
        assert_eq!(expected, Some(length), "{moment:?}: {name} is reported done");
    }
}
