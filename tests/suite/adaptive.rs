//! `render.noise`: tiles take as many samples as their noise needs.

use std::fs;

use crate::harness::{Workshop, dam_break, images};

/// The number of samples and the noisy part of the picture in the report of a job with `options`.
fn sampling(workshop: &Workshop, out: &str, options: &[&str]) -> serde_json::Value {
    let pattern = format!("{out}/f.####.exr");
    let job = ["render", "in", "-o", &pattern, "--size", "96x54", "--samples", "4"];
    workshop.run(&[&job[..], options].concat()).expect(0);
    workshop.report(out)["frames"][0]["sampling"].clone()
}

#[test]
fn pictures_take_as_many_samples_as_their_noise_needs() {
    let workshop = Workshop::new();
    dam_break(&workshop.join("in"), 5..=5);
    // None without a limit
    assert!(sampling(&workshop, "plain", &[]).is_null());
    // Fewer samples with a higher limit; the same bytes on any threads
    let samples = |value: &serde_json::Value| value["samples"].as_f64().expect("a number");
    let low = sampling(&workshop, "low", &["--noise", "0.04", "--threads", "1"]);
    let same = sampling(&workshop, "same", &["--noise", "0.04", "--threads", "4"]);
    let high = sampling(&workshop, "high", &["--noise", "0.3"]);
    assert_eq!(low, same);
    let [one, other] = ["low", "same"].map(|out| images(&workshop.join(out)));
    assert_eq!(one, other);
    assert!(samples(&low) > 2.0 * samples(&high) && samples(&high) >= 4.0, "{low} {high}");
    assert_eq!(low["noisy"], 0.0);
    // A limit that the maximum number cannot reach: stills print a note
    let bounded = ["--noise", "1e-4", "--set", "image.max_samples=8"];
    let most = sampling(&workshop, "most", &bounded);
    assert!(most["noisy"].as_f64() > Some(0.2), "{most}");
    let still = ["still", "in", "--size", "96x54", "--samples", "4", "-o", "a.png"];
    let made = workshop.run(&[&still[..], &bounded].concat()).expect(0);
    assert!(made.errors().contains("samples per pixel; "), "{}", made.errors());
    // The first pass has enough samples for the denoiser
    let one = ["--samples", "1", "--noise", "0.3"];
    workshop
        .run(&[&["still", "in", "--size", "96x54", "-o", "a.png"], &one[..]].concat())
        .expect(0);
    // The range of samples, and the error for a maximum below the least number
    let range = ["check", "in", "-o", "r/f.####.exr", "--samples", "5", "--noise", "0.04"];
    let shown = workshop.run(&range).expect(0);
    assert!(shown.text().contains(", 6 to 1024 samples (noise 0.04)"), "{}", shown.text());
    let below = workshop.run(&[&range[..], &["--set", "image.max_samples=4"]].concat()).expect(2);
    let expected = "image.max_samples=4: 4 is below image.samples, which is 5";
    assert!(below.errors().contains(expected), "{}", below.errors());
    // Drafts have a fixed number, unless an option overrides it
    assert!(sampling(&workshop, "draft", &["--noise", "0.04", "--draft"]).is_object());
    fs::write(workshop.join("job.toml"), "input.path = \"in\"\nrender.noise = 0.04\n").unwrap();
    let plan = workshop.run(&["check", "job.toml", "--draft", "-o", "d/f.####.exr"]).expect(0);
    assert!(plan.text().contains(", 4 samples per pixel"), "{}", plan.text());
}
