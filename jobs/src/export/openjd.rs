//! A job template of Open Job Description, revision 2023-09, with the extension `TASK_CHUNKING`. The render farm
//! divides the frames into tasks and runs the program for each task.
//!
//! Source: "Template Schemas 2023-09" of the Open Job Description specifications.

use super::quote::one_line;
use super::tree::{Field, YamlNode, field};
use super::{Chunks, ExportError};
use crate::range::FrameRange;

/// Placeholder in an argument: the frames of the task.
pub const FRAMES: &str = "{{Task.Param.Frame}}";

/// Longest time of a task, seconds. Without a limit a farm would wait forever for a hung host.
const MAX_TASK_SECONDS: u64 = 24 * 60 * 60;
/// Seconds between the request to stop and the kill. A frame may take this long.
pub const NOTIFY_SECONDS: u64 = 120;
/// Longest job name, characters.
const MAX_NAME: usize = 128;
/// Longest description, characters.
const MAX_DESCRIPTION: usize = 2048;
/// Longest value of a parameter, characters.
const MAX_VALUE: usize = 1024;

/// A job that runs one program for the frames of each task.
#[derive(Debug, Clone)]
pub struct JobTemplate<'a> {
    /// Name of the job.
    pub name: &'a str,
    /// Description of the job.
    pub description: String,
    /// Name of its only step.
    pub step: &'static str,
    /// The program: name of the parameter and path.
    pub program: (&'static str, &'a str),
    /// Files and directories that the job reads and writes.
    pub paths: Vec<PathParameter>,
    /// Arguments of the program, made with [`FRAMES`], [`parameter`] and [`literal`].
    pub arguments: Vec<String>,
    /// All frames.
    pub frames: &'a [i64],
    /// Chunks of frames; gives the number of frames per task.
    pub chunks: &'a Chunks,
    /// Requirements on the hosts.
    pub host: HostRequirements,
}

/// A path that the engine may map to another one, or copy.
#[derive(Debug, Clone)]
pub struct PathParameter {
    /// Name in the template.
    pub name: &'static str,
    /// Description.
    pub description: &'static str,
    /// Path relative to the template, in its directory: engines accept no other defaults. If None, the submitter
    /// must set it.
    pub default: Option<String>,
    /// Whether the path is a directory.
    pub is_directory: bool,
    /// Whether the job writes there. Otherwise it reads.
    pub is_output: bool,
}

/// Requirements on the hosts of the tasks. The farm decides everything that is not set.
#[derive(Debug, Clone, Default)]
pub struct HostRequirements {
    /// `linux`, `macos` or `windows`.
    pub system: Option<&'static str>,
    /// Number of processors.
    pub cpus: Option<u16>,
    /// Memory, bytes.
    pub memory: Option<u64>,
}

/// File format of a template.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TemplateFormat {
    /// YAML with comments.
    Yaml,
    /// JSON.
    Json,
}

/// Placeholder in an argument: the value of a parameter.
pub fn parameter(name: &str) -> String {
    format!("{{{{Param.{name}}}}}")
}

/// A literal text in an argument.
///
/// # Errors
/// The text contains `{{`, which starts an expression and cannot be escaped.
pub fn literal<'a>(what: &'static str, text: &'a str) -> Result<&'a str, ExportError> {
    if text.contains("{{") {
        let why = "contains {{, which starts an expression in a template; rename it";
        return Err(ExportError::text(what, text, why));
    }
    one_line(what, text)
}

impl JobTemplate<'_> {
    /// The text of the template.
    ///
    /// # Errors
    /// There are no frames, or a path, a name or the list of frames is too long or contains something that is not
    /// allowed in a template.
    pub fn text(&self, format: TemplateFormat) -> Result<String, ExportError> {
        let tree = self.tree()?;
        Ok(match format {
            TemplateFormat::Yaml => tree.to_yaml(),
            TemplateFormat::Json => {
                let text = serde_json::to_string_pretty(&tree);
                text.map_err(|e| ExportError::Serialize(e.to_string()))? + "\n"
            }
        })
    }

    fn tree(&self) -> Result<YamlNode, ExportError> {
        let name: String = literal("name", self.name)?.chars().take(MAX_NAME).collect();
        let description: String =
            one_line("description", &self.description)?.chars().take(MAX_DESCRIPTION).collect();
        let step = [field("name", self.step), field("parameterSpace", parameter_space())];
        let requirements = self.host.to_field();
        let script = [field("script", self.script()?)];
        let step = step.into_iter().chain(requirements).chain(script);
        Ok(YamlNode::Map(vec![
            field("specificationVersion", "jobtemplate-2023-09")
                .with_comment("Paths are relative to the directory of this file."),
            field("extensions", YamlNode::FlowList(vec!["TASK_CHUNKING".into()])),
            field("name", name),
            field("description", description),
            field("parameterDefinitions", self.parameters()?),
            field("steps", YamlNode::BlockList(vec![YamlNode::Map(step.collect())])),
        ]))
    }

    fn parameters(&self) -> Result<YamlNode, ExportError> {
        let (name, path) = self.program;
        let mut all = Vec::new();
        for path in &self.paths {
            all.push(path.definition()?);
        }
        // Frames and the size of a task can be overridden at submission
        all.push(vec![
            field("name", "Frames"),
            field("type", "STRING"),
            field(
                "description",
                "Frames to render: 7, 1-10, 1-10:2, -5--2, and comma-separated lists.",
            ),
            field("default", frames_text(self.frames)?),
        ]);
        all.push(vec![
            field("name", "ChunkSize"),
            field("type", "INT"),
            field("description", "Frames per task."),
            field("minValue", 1),
            field("default", self.chunks.size as u64),
        ]);
        // The program may be elsewhere on the hosts
        all.push(vec![
            field("name", name),
            field("type", "STRING"),
            field("description", "The program on the hosts: a path, or a name on the PATH."),
            field("default", value("program", path)?),
        ]);
        Ok(YamlNode::BlockList(all.into_iter().map(YamlNode::Map).collect()))
    }

    fn script(&self) -> Result<YamlNode, ExportError> {
        let mut arguments = Vec::new();
        for argument in &self.arguments {
            arguments.push(YamlNode::from(one_line("argument", argument)?));
        }
        let on_run = vec![
            field("command", parameter(self.program.0)),
            field("args", YamlNode::FlowList(arguments)),
            field("timeout", MAX_TASK_SECONDS).with_comment("Seconds."),
            field(
                "cancelation",
                YamlNode::Map(vec![
                    field("mode", "NOTIFY_THEN_TERMINATE"),
                    field("notifyPeriodInSeconds", NOTIFY_SECONDS),
                ]),
            )
            .with_comment("On a request to stop, the program finishes the frame in progress."),
        ];
        let actions = YamlNode::Map(vec![field("onRun", YamlNode::Map(on_run))]);
        Ok(YamlNode::Map(vec![field("actions", actions)]))
    }
}

fn parameter_space() -> YamlNode {
    let chunks = vec![
        field("defaultTaskCount", parameter("ChunkSize")),
        field("rangeConstraint", "NONCONTIGUOUS")
            .with_comment("A task may contain frames with gaps."),
    ];
    let frame = vec![
        field("name", "Frame"),
        field("type", "CHUNK[INT]"),
        field("range", parameter("Frames")),
        field("chunks", YamlNode::Map(chunks)),
    ];
    let all = YamlNode::BlockList(vec![YamlNode::Map(frame)]);
    YamlNode::Map(vec![field("taskParameterDefinitions", all)])
}

impl PathParameter {
    fn definition(&self) -> Result<Vec<Field>, ExportError> {
        let kind = if self.is_directory { "DIRECTORY" } else { "FILE" };
        let mut fields = vec![
            field("name", self.name),
            field("type", "PATH"),
            field("objectType", kind),
            field("dataFlow", if self.is_output { "OUT" } else { "IN" }),
            field("description", self.description),
        ];
        if let Some(default) = &self.default {
            fields.push(field("default", value(self.name, default)?));
        }
        Ok(fields)
    }
}

impl HostRequirements {
    fn to_field(&self) -> Option<Field> {
        // Amounts, in the units of the specification
        let mut amounts = Vec::new();
        let cpus = self.cpus.map(|n| ("amount.worker.vcpu", u64::from(n)));
        // In MiB
        let memory =
            self.memory.map(|bytes| ("amount.worker.memory", bytes.div_ceil(1 << 20).max(1)));
        for (name, min) in cpus.into_iter().chain(memory) {
            amounts.push(YamlNode::Map(vec![field("name", name), field("min", min)]));
        }
        // Attributes
        let system = |name: &str| {
            YamlNode::Map(vec![
                field("name", "attr.worker.os.family"),
                field("anyOf", YamlNode::FlowList(vec![name.into()])),
            ])
        };
        let attributes: Vec<YamlNode> = self.system.map(system).into_iter().collect();
        let all: Vec<Field> = [("amounts", amounts), ("attributes", attributes)]
            .into_iter()
            .filter(|(_, items)| !items.is_empty())
            .map(|(key, items)| field(key, YamlNode::BlockList(items)))
            .collect();
        (!all.is_empty()).then(|| field("hostRequirements", YamlNode::Map(all)))
    }
}

/// `frames` in the notation of the engines, ascending.
fn frames_text(frames: &[i64]) -> Result<String, ExportError> {
    let range = FrameRange::from_frames(frames.iter().copied()).ok_or(ExportError::NoFrames)?;
    // Steps are written with `:`
    let text = range.to_string().replace('x', ":");
    if text.len() > MAX_VALUE {
        return Err(ExportError::TooManyGaps { max: MAX_VALUE });
    }
    Ok(text)
}

/// The default value of a parameter.
fn value<'a>(what: &'static str, text: &'a str) -> Result<&'a str, ExportError> {
    if text.chars().count() > MAX_VALUE {
        let why = format!("is longer than the {MAX_VALUE} characters of a template value");
        return Err(ExportError::text(what, text, why));
    }
    one_line(what, text)
}
