//! Templates of Open Job Description. `.ci/openjd` runs such templates.

use std::num::NonZeroUsize;

use serde_json::{Value, json};
use spherule_jobs::export::Chunks;
use spherule_jobs::export::openjd::{
    FRAMES, HostRequirements, JobTemplate, PathParameter, TemplateFormat, literal, parameter,
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
        paths: vec![path("Manifest", false, Some("job.toml")), path("OutDir", true, None)],
        arguments: vec![parameter("Manifest"), "--frames".into(), FRAMES.into()],
        frames,
        chunks,
        host: HostRequirements { system: Some("linux"), cpus: Some(4), memory: Some(1 << 30) },
    }
}

const WHOLE: &str = r#"# Paths are relative to the directory of this file.
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
    description: "Frames to render: 7, 1-10, 1-10:2, -5--2, and comma-separated lists."
    default: "-2-1"
  - name: ChunkSize
    type: INT
    description: "Frames per task."
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
            # A task may contain frames with gaps.
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
          # On a request to stop, the program finishes the frame in progress.
          cancelation:
            mode: NOTIFY_THEN_TERMINATE
            notifyPeriodInSeconds: 120
"#;

#[test]
fn the_yaml_of_a_template() {
    let frames = [-2, -1, 0, 1];
    let chunks = chunks(&frames, 2);
    let text = template(&frames, &chunks).text(TemplateFormat::Yaml).unwrap();
    assert_eq!(text, WHOLE);
}

/// The JSON template for these frames.
fn read(frames: &[i64]) -> Value {
    let chunks = chunks(frames, 1);
    let text = template(frames, &chunks).text(TemplateFormat::Json).unwrap();
    serde_json::from_str(&text).unwrap()
}

#[test]
fn frames_are_written_in_the_notation_of_openjd() {
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
fn unset_requirements_are_omitted() {
    let chunks = chunks(&[1], 1);
    let mut template = template(&[1], &chunks);
    template.host = HostRequirements::default();
    let text = template.text(TemplateFormat::Json).unwrap();
    let found: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(found["steps"][0]["hostRequirements"], Value::Null);
    template.host.memory = Some(1);
    let text = template.text(TemplateFormat::Json).unwrap();
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
    let error = template.text(TemplateFormat::Yaml).unwrap_err().to_string();
    assert!(error.contains(what), "{error}");
}

#[test]
fn texts_that_a_template_cannot_contain_are_rejected() {
    refused("starts an expression", |t| t.name = "{{x}}");
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
    assert!(error.starts_with("image: \"a{{b\" contains {{"), "{error}");
}

#[test]
fn a_frame_list_beyond_the_length_limit_is_rejected() {
    let frames: Vec<i64> = (0..2000).filter(|n| n % 7 < 2 && n % 11 != 0).collect();
    let chunks = chunks(&frames, 1);
    let error = template(&frames, &chunks).text(TemplateFormat::Yaml).unwrap_err().to_string();
    assert!(error.contains("exceeds the 1024 characters"), "{error}");
}
