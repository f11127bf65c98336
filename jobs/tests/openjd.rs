//! Templates of Open Job Description, which `.ci/openjd` runs.

use std::num::NonZeroUsize;

use serde_json::{Value, json};
use spherule_jobs::export::Chunks;
use spherule_jobs::export::openjd::{
    FRAMES, HostRequirements, JobTemplate, PathParameter, Spelling, literal, parameter,
};

fn chunks(frames: &[i64], size: usize) -> Chunks {
    Chunks::of(frames, NonZeroUsize::new(size), NonZeroUsize::MAX).unwrap()
}

fn template<'a>(frames: &'a [i64], chunks: &'a Chunks) -> JobTemplate<'a> {
    let path = |name, is_output, default: Option<&str>| PathParameter {
        name,
        description: "A path.",
        default: default.map(str::to_owned),
        is_directory: is_output,
        is_output,
    };
    JobTemplate {
        name: "dam",
        description: "Renders \"it\".".to_owned(),
        step: "Render",
        program: ("Program", "/opt/it's/render"),
        paths: vec![
            path("Manifest", false, Some("job.toml")),
            path("OutDir", true, None),
        ],
        arguments: vec![parameter("Manifest"), "--frames".into(), FRAMES.into()],
        frames,
        chunks,
        host: HostRequirements {
            system: Some("linux"),
            cpus: Some(4),
            memory: Some(1 << 30),
        },
    }
}

const WHOLE: &str = r#"# Relative paths begin at the directory of this file.
specificationVersion: jobtemplate-2023-09
extensions: [TASK_CHUNKING]
name: dam
description: "Renders \"it\"."
parameterDefinitions:
  - name: Manifest
    type: PATH
    objectType: FILE
    dataFlow: IN
    description: "A path."
    default: "job.toml"
  - name: OutDir
    type: PATH
    objectType: DIRECTORY
    dataFlow: OUT
    description: "A path."
  - name: Frames
    type: STRING
    description: "Frames to do: 7, 1-10, 1-10:2, -5--2, and lists with commas."
    default: "-2-1"
  - name: ChunkSize
    type: INT
    description: "Frames in a task."
    minValue: 1
    default: 2
  - name: Program
    type: STRING
    description: "The program on the hosts: a path, or a name on the PATH."
    default: "/opt/it's/render"
steps:
  - name: Render
    parameterSpace:
      taskParameterDefinitions:
        - name: Frame
          type: "CHUNK[INT]"
          range: "{{Param.Frames}}"
          chunks:
            defaultTaskCount: "{{Param.ChunkSize}}"
            # Frames with gaps make tasks as large.
            rangeConstraint: NONCONTIGUOUS
    hostRequirements:
      amounts:
        - name: "amount.worker.vcpu"
          min: 4
        - name: "amount.worker.memory"
          min: 1024
      attributes:
        - name: "attr.worker.os.family"
          anyOf: [linux]
    script:
      actions:
        onRun:
          command: "{{Param.Program}}"
          args: ["{{Param.Manifest}}", "--frames", "{{Task.Param.Frame}}"]
          # Seconds.
          timeout: 86400
          # When told to stop, the frame in hand is finished.
          cancelation:
            mode: NOTIFY_THEN_TERMINATE
            notifyPeriodInSeconds: 120
"#;

#[test]
fn a_template_as_people_read_it() {
    let frames = [-2, -1, 0, 1];
    let chunks = chunks(&frames, 2);
    let text = template(&frames, &chunks).text(Spelling::Yaml).unwrap();
    assert_eq!(text, WHOLE);
}

/// The template for these frames, as programs read it.
fn read(frames: &[i64]) -> Value {
    let chunks = chunks(frames, 1);
    let text = template(frames, &chunks).text(Spelling::Json).unwrap();
    serde_json::from_str(&text).unwrap()
}

#[test]
fn frames_are_written_as_engines_write_them() {
    for (frames, shown) in [
        (&[7][..], "7"),
        (&[1, 3, 5, 9, 20], "1-5:2,9,20"),
        (&[-5, -4, -3, 0], "-5--3,0"),
        (&[9, 6, 3], "3-9:3"),
    ] {
        let found = read(frames)["parameterDefinitions"][2].clone();
        assert_eq!(found["name"], "Frames");
        assert_eq!(found["default"], shown);
    }
}

#[test]
fn requirements_that_nobody_has_are_left_out() {
    let chunks = chunks(&[1], 1);
    let mut template = template(&[1], &chunks);
    template.host = HostRequirements::default();
    let text = template.text(Spelling::Json).unwrap();
    let found: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(found["steps"][0]["hostRequirements"], Value::Null);
    template.host.memory = Some(1);
    let text = template.text(Spelling::Json).unwrap();
    let found: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(
        found["steps"][0]["hostRequirements"],
        json!({"amounts": [{"name": "amount.worker.memory", "min": 1}]})
    );
}

#[track_caller]
fn refused(what: &str, change: impl FnOnce(&mut JobTemplate)) {
    let chunks = chunks(&[1], 1);
    let mut template = template(&[1], &chunks);
    change(&mut template);
    let error = template.text(Spelling::Yaml).unwrap_err().to_string();
    assert!(error.contains(what), "{error}");
}

#[test]
fn what_a_template_cannot_hold_is_refused() {
    refused("begins an expression", |t| t.name = "{{x}}");
    refused("line break", |t| t.description = "a\nb".to_owned());
    refused("line break", |t| {
        t.arguments.push("a\u{2028}b".to_owned());
    });
    let long = "x".repeat(1025);
    refused("longer than the 1024 characters", |t| {
        t.paths[0].default = Some(long);
    });
    refused("no frames", |t| t.frames = &[]);
    assert_eq!(literal("image", "f.####.exr").unwrap(), "f.####.exr");
    let error = literal("image", "a{{b").unwrap_err().to_string();
    assert!(error.starts_with("image: \"a{{b\" has {{"), "{error}");
}

#[test]
fn a_list_of_frames_too_long_for_a_parameter_is_refused() {
    let frames: Vec<i64> = (0..2000).filter(|n| n % 7 < 2 && n % 11 != 0).collect();
    let chunks = chunks(&frames, 1);
    let error = template(&frames, &chunks).text(Spelling::Yaml);
    let error = error.unwrap_err().to_string();
    assert!(error.contains("in parts with --frames"), "{error}");
}
