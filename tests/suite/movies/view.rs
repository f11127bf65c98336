//! Pages of jobs. `.ci/pages` operates them in a browser.

use std::fs;

use serde_json::Value;

use super::{DONE, REFUSED, job, refuses};
use crate::harness::Workshop;

/// The data in a page.
fn data(workshop: &Workshop, page: &str) -> Value {
    let html = fs::read_to_string(workshop.join(page)).expect("a page");
    let (_, after) = html.split_once("id=\"viewer-data\">").expect("data");
    let (json, _) = after.split_once("</script>").expect("data");
    serde_json::from_str(json).expect("JSON")
}

/// Even with `--force`, which is for files of other programs.
#[test]
fn records_and_inputs_of_a_job_are_not_replaced() {
    let workshop = job(&[1], &[]);
    let names = [
        "out/job.plan.json",
        "out/job.toml",
        "out/job.schema.json",
        "out/report.json",
        "out/report.html",
        "out/f.0001.exr",
        "in/f_1.bgeo",
    ];
    for name in names {
        let before = fs::read(workshop.join(name)).expect("a file");
        let view = ["view", "out", "--force", "-o", name];
        refuses(workshop.run(&view), "choose another name");
        for command in ["movie", "sheet"] {
            let ran = workshop.run(&[command, "out", "--force", "-o", name]);
            ran.expect(REFUSED);
        }
        assert!(fs::read(workshop.join(name)).expect("a file") == before);
    }
    workshop.run(&["verify", "out"]).expect(DONE);
}

#[test]
fn pages_link_or_embed_pictures() {
    let workshop = job(&[1, 2, 3], &[]);
    let ran = workshop.run(&["view", "out"]).expect(DONE);
    let line = "out/view.html: 3 frames, ids at 64 pixels with depth, channels depth, normal, ";
    assert!(ran.text().starts_with(line.trim_end_matches(", ")), "{}", ran.text());
    let linked = data(&workshop, "out/view.html");
    assert_eq!(linked["frames"][2]["number"], 3);
    assert_eq!(linked["frames"][2]["source"], "f.0003.png");
    assert!(linked["frames"][2]["ids"].as_str().is_some_and(|ids| ids.len() > 100));
    let html = fs::read_to_string(workshop.join("out/view.html")).expect("a page");
    assert!(html.contains("id=\"plot-stages\"") && html.contains("<h1>out/f.####.exr</h1>"));

    workshop.run(&["view", "out", "--embed", "--no-data", "-o", "pages/a.html"]).expect(DONE);
    let embedded = data(&workshop, "pages/a.html");
    let source = embedded["frames"][0]["source"].as_str().expect("a picture");
    assert!(source.starts_with("data:image/png;base64,"));
    assert!(
        embedded["frames"][0]["ids"].is_null() && embedded["channels"] == serde_json::json!([])
    );
    workshop.run(&["view", "out", "-o", "pages/b.html"]).expect(DONE);
    assert_eq!(data(&workshop, "pages/b.html")["frames"][0]["source"], "../out/f.0001.png");
}

#[test]
fn values_and_images_without_previews_are_embedded() {
    let channels = ["--channels", "RGBA,id,V,attribute:velocity"];
    let workshop = job(&[1], &[&channels[..], &["--set", "output.preview=false"]].concat());
    let ran = workshop.run(&["view", "out"]).expect(DONE);
    assert!(ran.text().contains("with |velocity|, speed"), "{}", ran.text());
    ran.prints("the job has no previews: pictures are made from the images, into the page");
    let found = data(&workshop, "out/view.html");
    assert!(found["frames"][0]["source"].as_str().is_some_and(|s| s.starts_with("data:image/png")));
    assert_eq!(found["channels"], serde_json::json!(["speed", "velocity"]));
}

#[test]
fn unfinished_jobs_have_a_page_that_says_so() {
    let workshop = job(&[1, 2, 3], &["--shard", "1/3"]);
    workshop
        .run(&["view", "out"])
        .expect(DONE)
        .prints("missing: 2-3; the page shows what is there");
    let html = fs::read_to_string(workshop.join("out/view.html")).expect("a page");
    assert!(html.contains("1 of 3 frames are done, missing: 2-3</p>"));
    // Pages do not change the job
    workshop.run(&["verify", "out"]).expect(DONE);
    fs::remove_file(workshop.join("out/f.0001.exr")).expect("an image");
    refuses(workshop.run(&["view", "out"]), "there is nothing to show yet");
}
