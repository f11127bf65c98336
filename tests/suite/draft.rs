//! `--draft`: quick previews with ambient light.
//!
//! Tests compare drafts with pictures of other settings, and render several of them.

use std::fs;

use crate::harness::{Workshop, dam_break, images};

const MANIFEST: &str = r#"
[input]
path = "in"
[image]
width = 96
height = 54
samples = 64
[render]
denoise = false
[output]
path = "out/f.####.exr"
"#;

fn workshop() -> Workshop {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 5..=6);
    fs::write(workshop.join("job.toml"), MANIFEST).expect("a manifest");
    workshop
}

/// Renders to the directory `out`, and returns the number of rays of both frames.
fn rays(workshop: &Workshop, out: &str, options: &[&str]) -> u64 {
    let pattern = format!("{out}/f.####.exr");
    let render = ["render", "job.toml", "-o", &pattern];
    workshop.run(&[&render[..], options].concat()).expect(0);
    let report = workshop.report(out);
    let frames = report["frames"].as_array().expect("frames");
    let kinds = ["primary", "shadow", "reflection", "refraction"];
    let of = |frame: &serde_json::Value| -> u64 {
        let counts = kinds.iter().map(|kind| frame["rays"][*kind].as_u64());
        counts.map(|count| count.expect("a count")).sum()
    };
    frames.iter().map(of).sum()
}

#[test]
fn drafts_have_few_samples_and_ambient_light() {
    let workshop = workshop();
    let draft = rays(&workshop, "draft", &["--draft", "--threads", "1"]);
    let text = fs::read_to_string(workshop.join("draft/job.toml")).expect("a manifest");
    for line in ["samples = 4 ", "indirect = \"ambient\" ", "denoise = \"auto\" "] {
        assert!(text.contains(line), "{line}: {text}");
    }
    // The same bytes on any threads, and from the settings one by one
    let settings = ["--samples", "4", "--set", "render.denoise=auto"];
    let ambient = ["--threads", "4", "--set", "render.indirect=ambient"];
    let options = [&settings[..], &ambient].concat();
    assert_eq!(rays(&workshop, "same", &options), draft);
    let [one, other] = ["draft", "same"].map(|out| images(&workshop.join(out)));
    // With previews
    assert_eq!(one.len(), 4);
    assert!(one == other);
    // Ambient light needs fewer rays than traced light
    let traced = rays(&workshop, "traced", &settings);
    assert!(100 * draft < 98 * traced, "{draft} {traced}");
}

#[test]
fn other_options_override_a_draft() {
    let workshop = workshop();
    let frame = ["still", "job.toml", "--draft", "--frame", "5", "-o"];
    let still = |name: &str, options: &[&str]| {
        workshop.run(&[&frame[..], &[name], options].concat()).expect(0);
        fs::read(workshop.join(name)).expect("an image")
    };
    let draft = still("draft.png", &[]);
    assert!(draft == still("again.png", &["--samples", "4"]));
    assert!(draft != still("more.png", &["--samples", "8"]));
    assert!(draft != still("noisy.png", &["--set", "render.denoise=false"]));
    assert!(draft != still("traced.png", &["--set", "render.indirect=traced"]));
}
