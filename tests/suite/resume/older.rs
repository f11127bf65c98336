//! Jobs that an older version began, which wrote fewer settings, or the same ones in other words.

use std::fs::{self, File};
use std::path::Path;
use std::time::{Duration, UNIX_EPOCH};

use crate::harness::{Workshop, dam_break, images, ledger, sample};

/// 2026-01-01, when the inputs of the older jobs were last written.
const WRITTEN: Duration = Duration::from_secs(1_767_225_600);

/// The older job `name` in `out`, with the first of two frames done.
fn older(name: &str) -> Workshop {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 1..=2);
    for frame in 1..=2 {
        let path = workshop.join(format!("in/f_{frame}.bgeo"));
        let file = File::options().write(true).open(path).expect("a frame");
        file.set_modified(UNIX_EPOCH + WRITTEN).expect("a time");
    }
    let out = workshop.join("out");
    fs::create_dir(&out).expect("a directory");
    for file in ["job.plan.json", "job.ledger.older.jsonl"] {
        let from = sample(Path::new("older_jobs").join(name).join(file).to_str().expect("UTF-8"));
        fs::copy(from, out.join(file)).expect("a file");
    }
    // Its images are known by their lengths.
    for output in ledger(&out).lines[0]["outputs"].as_array().expect("files") {
        let path = out.join(output["path"].as_str().expect("a name"));
        let file = File::create(path).expect("a file");
        file.set_len(output["len"].as_u64().expect("a length")).expect("room");
    }
    workshop
}

#[track_caller]
fn goes_on(name: &str, options: &[&str]) {
    let workshop = older(name);
    let plan = |workshop: &Workshop| {
        let text = fs::read_to_string(workshop.join("out/job.plan.json")).expect("a plan");
        let plan: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        // The first version had them at the top.
        plan.get("plan").unwrap_or(&plan)["settings"].clone()
    };
    let before = plan(&workshop);
    let ran = workshop.render(options).expect(0).prints("1 of 2 frames are done already");
    assert_eq!(ran.rendered(), [2]);
    assert_eq!(plan(&workshop), before);
    // Also by the manifest that lies there now.
    let again = workshop.run(&["render", "out/job.toml"]).expect(0);
    assert!(again.rendered().is_empty());
    assert_eq!(images(&workshop.join("out")).len(), 4);
}

#[test]
fn opaque_spheres_go_on() {
    goes_on("plain", &[]);
    goes_on("plain", &["--set", "render.min_weight=0.25"]);
}

#[test]
fn colours_by_an_attribute_go_on() {
    goes_on("colored", &["--color-by", "density"]);
    goes_on("colored", &["--color-by", "density", "--map", "viridis"]);
    older("colored")
        .render(&["--color-by", "density", "--map", "turbo"])
        .expect(2)
        .prints("material.color: { attribute = \"density\", map = \"viridis\" } -> { attribute = ");
}

#[test]
fn unions_that_were_called_medium_go_on() {
    let spray = ["--set", "surface.spray=true"];
    goes_on("medium", &[&["--surface", "union"], &spray[..]].concat());
    goes_on("medium", &[&["--surface", "medium"], &spray[..]].concat());
    older("medium")
        .render(&["--surface", "medium", "--force"])
        .expect(0)
        .prints("--surface: \"medium\" is now called \"union\"; the old name still works");
    older("medium")
        .render(&["--surface", "smooth"])
        .expect(2)
        .prints("render.surface: \"medium\" -> \"smooth\"");
}

#[test]
fn glass_that_would_look_otherwise_is_refused() {
    const GLASS: [&str; 2] = ["--set", "material.transmission=1"];
    let refused = older("glass").render(&GLASS).expect(2);
    refused.prints(
        "settings have changed since this job began: render.min_weight: (not set) -> 0.0009765625;",
    );
    // It followed both branches always.
    goes_on("glass", &[&GLASS[..], &["--set", "render.min_weight=0"]].concat());
    older("plain").render(&GLASS).expect(2).prints("material.transmission: 0.0 -> 1.0");
}
