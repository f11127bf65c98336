use std::fs;

use serde_json::{Value, json};
use spherule_jobs::FrameRange;

use super::{FRAMES, job};
use crate::harness::{Ran, Workshop};

fn export(workshop: &Workshop, options: &[&str]) -> Ran {
    workshop.run(&[&["export", "openjd"], options].concat())
}

/// The template that `options` write into `name`.
fn template(workshop: &Workshop, name: &str, options: &[&str]) -> (Value, Ran) {
    let ran = export(workshop, &[options, &["-o", name]].concat()).expect(0);
    let text = fs::read_to_string(workshop.join(name)).expect("a template");
    (serde_json::from_str(&text).expect("JSON"), ran)
}

fn parameter<'a>(template: &'a Value, name: &str) -> &'a Value {
    let all = template["parameterDefinitions"].as_array().expect("a list");
    let found = all.iter().find(|p| p["name"] == name);
    found.unwrap_or_else(|| panic!("no {name}"))
}

#[test]
fn all_frames_are_in_the_template() {
    let workshop = Workshop::new();
    job(&workshop, "data", &FRAMES);
    let (found, _) = template(&workshop, "t.json", &["data/job.toml", "--chunk", "4"]);
    let frames = parameter(&found, "Frames")["default"].as_str().expect("text");
    let range: FrameRange = frames.parse().expect("a range");
    assert_eq!(range.iter().collect::<Vec<_>>(), FRAMES);
    assert!(frames.contains(':') && !frames.contains('x'), "{frames}");
    assert_eq!(parameter(&found, "ChunkSize")["default"], 4);
    assert_eq!(found["name"], "data");
    let some = &["data/job.toml", "--frames=-4--3,10"];
    let (found, _) = template(&workshop, "t.json", some);
    assert_eq!(parameter(&found, "Frames")["default"], "-4--3,10");
    assert_eq!(parameter(&found, "ChunkSize")["default"], 1);
}

#[test]
fn paths_are_relative_to_the_template() {
    let workshop = Workshop::new();
    job(&workshop, "data", &[1, 2]);
    let defaults = |found: &Value| {
        ["Manifest", "InputDir", "OutDir"].map(|name| parameter(found, name)["default"].clone())
    };
    let (found, ran) = template(&workshop, "data/t.json", &["data/job.toml"]);
    assert_eq!(defaults(&found), ["job.toml", "in", "out"]);
    assert!(!ran.errors().contains(" -p "), "{}", ran.errors());
    let (found, _) = template(&workshop, "t.json", &["data/job.toml"]);
    assert_eq!(defaults(&found), ["data/job.toml", "data/in", "data/out"]);
    let flows = ["Manifest", "InputDir", "OutDir"].map(|name| {
        let p = parameter(&found, name);
        [&p["type"], &p["objectType"], &p["dataFlow"]].map(|v| v.as_str().expect("text").to_owned())
    });
    assert_eq!(flows[0], ["PATH", "FILE", "IN"]);
    assert_eq!(flows[1], ["PATH", "DIRECTORY", "IN"]);
    assert_eq!(flows[2], ["PATH", "DIRECTORY", "OUT"]);
    // Paths outside the template have no default; a note names the option.
    fs::create_dir(workshop.join("elsewhere")).expect("a directory");
    let (found, ran) = template(&workshop, "elsewhere/t.json", &["data/job.toml"]);
    assert_eq!(defaults(&found), [Value::Null, Value::Null, Value::Null]);
    let place = workshop.path().canonicalize().expect("a path");
    for (name, path) in [("Manifest", "job.toml"), ("InputDir", "in"), ("OutDir", "out")] {
        let errors = ran.errors();
        let option = errors.split(" -p ").find(|o| o.starts_with(&format!("'{name}=")));
        let path = place.join("data").join(path);
        let message = option.unwrap_or_else(|| panic!("no {name} in {errors}"));
        assert!(message.contains(&path.display().to_string()), "{message}");
    }
    // By the manifest beside the images, the images are where the manifest is.
    workshop.run(&["render", "data/job.toml"]).expect(0);
    let (found, _) = template(&workshop, "data/t.json", &["data/out/job.toml"]);
    assert_eq!(defaults(&found), ["out/job.toml", "in", "out"]);
}

#[test]
fn tasks_call_render() {
    let workshop = Workshop::new();
    job(&workshop, "data", &[1, 2]);
    let options = ["data/job.toml", "--cpus", "4", "--mem", "2GiB"];
    let (found, _) = template(&workshop, "t.json", &options);
    let step = &found["steps"][0];
    assert_eq!(step["name"], "Render");
    let run = &step["script"]["actions"]["onRun"];
    assert_eq!(run["command"], "{{Param.Spherule}}");
    assert_eq!(
        run["args"],
        json!([
            "render",
            "{{Param.Manifest}}",
            "--frames",
            "{{Task.Param.Frame}}",
            "--output",
            "{{Param.OutDir}}/f.####.exr",
            "--progress",
            "openjd",
            "--grace",
            "108"
        ])
    );
    let program = parameter(&found, "Spherule")["default"].as_str().expect("text");
    assert!(fs::exists(program).expect("a path"), "{program}");
    assert_eq!(
        step["hostRequirements"]["amounts"],
        json!([
            {"name": "amount.worker.vcpu", "min": 4},
            {"name": "amount.worker.memory", "min": 2048}
        ])
    );
}

#[test]
fn directories_may_contain_percent_signs() {
    let workshop = Workshop::new();
    job(&workshop, "100%~x", &[1]);
    let arguments = ["export", "openjd", "100%~x/job.toml"];
    let text = workshop.run(&arguments).expect(0).text();
    assert!(text.contains("100%~x"), "{text}");
}

#[test]
fn default_output_is_yaml() {
    let workshop = Workshop::new();
    job(&workshop, "it's \"so\": {x}, y", &[1, 2]);
    let manifest = "it's \"so\": {x}, y/job.toml";
    let printed = export(&workshop, &[manifest]).expect(0);
    assert!(printed.text().contains("specificationVersion: jobtemplate-2023-09\n"));
    // Named from the manifest's directory, where it may be put.
    assert!(printed.text().contains("    default: \"job.toml\"\n"));
    let name = "it's \\\"so\\\": {x}, y";
    assert!(printed.text().contains(&format!("name: \"{name}\"\n")));
}
