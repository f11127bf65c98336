//! Frames that come later, fail, get lost, or are asked for one by one.

use std::fs;

use glam::Vec3;
use serde_json::Value;

use crate::harness::{Workshop, dam_break, images, ledger, npy, stamps};
use crate::picture::world_to_camera;

fn boxes(workshop: &Workshop, frames: impl IntoIterator<Item = u64>) {
    for frame in frames {
        let path = workshop.join(format!("in/f_{frame}.npy"));
        npy(&path, 3000, frame, Vec3::ZERO);
    }
}

fn camera_of(workshop: &Workshop, image: &str) -> [f32; 16] {
    world_to_camera(&workshop.join(image))
}

#[test]
fn appended_frames_are_seen_by_the_old_camera() {
    let workshop = Workshop::new();
    boxes(&workshop, 1..=3);
    workshop.render(&[]).expect(0);
    let resolved = || {
        let text = fs::read(workshop.join("out/job.plan.json")).expect("the plan");
        let plan: Value = serde_json::from_slice(&text).expect("JSON");
        plan["plan"]["resolved"].clone()
    };
    let settled = resolved();
    let before = stamps(&workshop.join("out"));

    npy(&workshop.join("in/f_4.npy"), 9000, 4, Vec3::new(20.0, 0.0, 0.0));
    let ran = workshop
        .render(&[])
        .expect(0)
        .prints("4 frames, ")
        .prints("3 of 4 frames are done already");
    assert_eq!(ran.rendered(), [4]);
    let after = stamps(&workshop.join("out"));
    for (name, stamp) in before.iter().filter(|(name, _)| name.starts_with("f.")) {
        assert_eq!(after.get(name), Some(stamp), "{name}");
    }
    assert_eq!(resolved(), settled);
    let camera = camera_of(&workshop, "out/f.0001.exr");
    assert_eq!(camera_of(&workshop, "out/f.0004.exr"), camera);

    // A job that knows all four from the start stands elsewhere.
    workshop.render_to("all", &[]).expect(0);
    assert_ne!(camera_of(&workshop, "all/f.0001.exr"), camera);
}

#[test]
fn lost_and_shortened_images_are_made_again() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=4);
    workshop.render(&[]).expect(0);
    let whole = images(&workshop.join("out"));
    fs::remove_file(workshop.join("out/f.0002.exr")).expect("an image");
    fs::remove_file(workshop.join("out/f.0003.png")).expect("a preview");
    let image = workshop.join("out/f.0004.exr");
    let bytes = &whole["f.0004.exr"];
    fs::write(&image, &bytes[..bytes.len() / 2]).expect("a file");
    let ran = workshop.render(&[]).expect(0);
    assert_eq!(ran.rendered(), [2, 3, 4]);
    assert!(images(&workshop.join("out")) == whole);
}

#[test]
fn one_damaged_frame_costs_one_frame() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=5);
    let file = workshop.join("in/f_3.bgeo");
    let good = fs::read(&file).expect("a frame");
    fs::write(&file, &good[..good.len() / 2]).expect("a file");
    let ran = workshop
        .render(&[])
        .expect(1)
        .prints("error: frame 3: in/f_3.bgeo: byte ")
        .prints("4 of 5 frames done")
        .prints("failed: 3");
    assert_eq!(ran.rendered(), [1, 2, 4, 5]);
    assert_eq!(ran.errors().matches("error:").count(), 1);
    assert_eq!(images(&workshop.join("out")).len(), 8);

    // As long as it is damaged it is tried and messages again, and nothing else is.
    let before = stamps(&workshop.join("out"));
    let ran = workshop.render(&[]).expect(1).prints("failed: 3");
    assert!(ran.rendered().is_empty());

    fs::write(&file, &good).expect("a file");
    let ran = workshop.render(&[]).expect(0).prints("5 of 5 frames done");
    assert_eq!(ran.rendered(), [3]);
    let after = stamps(&workshop.join("out"));
    for (name, stamp) in before.iter().filter(|(name, _)| name.starts_with("f.")) {
        assert_eq!(after.get(name), Some(stamp), "{name}");
    }
    assert_eq!(images(&workshop.join("out")).len(), 10);
}

#[test]
fn a_frame_without_the_attribute_costs_one_frame() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), [1, 2]);
    fs::write(
        workshop.join("in/f_3.bgeo"),
        fs::read(crate::harness::sample("public_partio/base.bgeo")).expect("a sample"),
    )
    .expect("a file");
    let ran = workshop
        .render(&["--color-by", "density"])
        .expect(1)
        .prints("error: frame 3: in/f_3.bgeo: no attribute `density` for colour; it has ")
        .prints("failed: 3");
    assert_eq!(ran.rendered(), [1, 2]);
}

// Starts the program six times: each way to ask for frames, and all of them at once.
#[test]
fn frames_are_rendered_as_asked_for() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=8);
    for (range, frames, kept) in [
        ("3-5", &[3, 4, 5][..], 0),
        ("1-8x3", &[1, 7], 1),
        ("8,2", &[8, 2], 0),
        ("3-5", &[], 3),
        ("6-100", &[6], 2),
    ] {
        let ran = workshop.render(&["--frames", range]).expect(0);
        assert_eq!(ran.rendered(), frames, "{range}");
        let total = frames.len() + kept;
        assert!(ran.errors().contains(&format!("{total} of {total} frames done")));
    }
    assert_eq!(ledger(&workshop.join("out")).lines.len(), 8);
    // The same pictures as all at once.
    workshop.render_to("whole", &[]).expect(0);
    assert!(images(&workshop.join("out")) == images(&workshop.join("whole")));
}

#[test]
fn the_manifest_beside_the_images_is_the_job() {
    let workshop = Workshop::new();
    boxes(&workshop, 1..=3);
    workshop.render(&["--set", "camera.azimuth=77"]).expect(0);
    fs::copy(workshop.join("out/job.toml"), workshop.join("mine.toml")).expect("a copy");
    let text = fs::read_to_string(workshop.join("mine.toml")).expect("the manifest");
    let text =
        text.replace("\"../in\"", "\"in\"").replace("\"f.####.exr\"", "\"elsewhere/f.####.exr\"");
    fs::write(workshop.join("mine.toml"), text).expect("a file");
    workshop.run(&["render", "mine.toml"]).expect(0);
    assert!(images(&workshop.join("out")) == images(&workshop.join("elsewhere")));
}
