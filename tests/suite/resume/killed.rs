//! SIGKILL at any moment loses at most the frames in hand.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use crate::harness::{Running, SMALL, Workshop, dam_break, files, images, ledger, no_leftovers};

const FRAMES: usize = 60;

/// When to kill.
#[derive(Debug, Clone, Copy)]
enum Moment {
    /// As soon as it has started.
    Start,
    /// Once this file is there.
    File(&'static str),
    /// While a file is being written.
    Writing,
    /// Once it has made so many images; the ledger may not know of the last.
    Images(usize),
    /// Once it has made so many previews; their image is on its way.
    Previews(usize),
    /// Once it has told that a frame is done.
    Told(&'static str),
}

/// In an order in which each can still come: what is there once stays.
const MOMENTS: [Moment; 16] = [
    Moment::Start,
    Moment::File("job.ledger.main.jsonl"),
    Moment::File("job.plan.json"),
    Moment::File("job.toml"),
    Moment::Previews(1),
    Moment::Images(1),
    Moment::Start,
    Moment::Writing,
    Moment::Told("] frame "),
    Moment::Images(2),
    Moment::Writing,
    Moment::Previews(2),
    Moment::Images(3),
    Moment::Told("are done already"),
    Moment::Writing,
    Moment::Images(1),
];

type Files = BTreeMap<String, Vec<u8>>;

#[test]
fn killed_again_and_again_the_result_is_that_of_an_unbroken_run() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=FRAMES);
    workshop.render_to("whole", &[]).expect(0);
    let whole = images(&workshop.join("whole"));
    assert_eq!(whole.len(), 2 * FRAMES);

    let out = workshop.join("out");
    let arguments = [&["render", "in", "-o", "out/f.####.exr"][..], &SMALL].concat();
    let mut kills = 0;
    for moment in MOMENTS {
        let mut running = workshop.start(&arguments);
        wait(&mut running, moment, &out);
        running.kill();
        let (told, status) = running.end();
        if status.code().is_none() {
            kills += 1;
        } else {
            // It was faster; there is no other way to end.
            assert_eq!(status.code(), Some(0), "{moment:?}: {told}");
        }
        all_is_whole(&out, &whole, moment);
    }
    assert!(
        kills >= 10,
        "only {kills} of {} kills came in time",
        MOMENTS.len()
    );

    workshop.run(&arguments).expect(0);
    no_leftovers(&out);
    assert!(images(&out) == whole, "images differ from the unbroken run");
    assert_eq!(ledger(&out).done().len(), 2 * FRAMES);
    for name in ["job.toml", "job.plan.json"] {
        let read = |dir: &str| fs::read(workshop.join(dir).join(name)).expect(name);
        assert!(read("out") == read("whole"), "{name} differs");
    }
    let again = workshop.run(&arguments).expect(0);
    assert!(again.rendered().is_empty());
}

fn wait(running: &mut Running, moment: Moment, out: &Path) {
    let before = images(out);
    let count = |extension: &str| {
        let fits = |(name, _): &(String, Vec<u8>)| name.ends_with(extension);
        let new = |(name, _): &(String, Vec<u8>)| !before.contains_key(name);
        images(out).into_iter().filter(fits).filter(new).count()
    };
    match moment {
        Moment::Start => true,
        Moment::File(name) => running.wait_until(|| out.join(name).exists()),
        Moment::Writing => running.wait_until(|| {
            files(out)
                .keys()
                .any(|name| name.starts_with(".f.") && name.ends_with(".part"))
        }),
        Moment::Images(wanted) => running.wait_until(|| count(".exr") >= wanted),
        Moment::Previews(wanted) => running.wait_until(|| count(".png") >= wanted),
        Moment::Told(text) => running.wait_for_line(text),
    };
}

/// Nothing under a final name is half written, and nothing is reported done that is not there.
#[track_caller]
fn all_is_whole(out: &Path, whole: &Files, moment: Moment) {
    let made = images(out);
    for (name, bytes) in &made {
        assert!(
            whole.get(name) == Some(bytes),
            "{moment:?}: {name} is not whole"
        );
    }
    for (name, length) in ledger(out).done() {
        let bytes = made.get(&name).map(|b| b.len() as u64);
        assert_eq!(bytes, Some(length), "{moment:?}: {name} is reported done");
    }
}
