//! A job template of Open Job Description, revision 2023-09 with the extension `TASK_CHUNKING`: render
//! farms split the frames into tasks of several and call the program for each.
//!
//! Source: "Template Schemas 2023-09" of the Open Job Description specifications.

use super::quote::one_line;
use super::tree::{Entry, Node, entry};
use super::{Chunks, ExportError};
use crate::range::FrameRange;

/// In an argument: the frames of a task.
pub const FRAMES: &str = "{{Task.Param.Frame}}";

/// Seconds that a task may take; a farm without a limit would wait for a hung host for ever.
const MOST_SECONDS: u64 = 24 * 60 * 60;
/// Seconds between being told to stop and being stopped: as long as a frame may take.
pub const NOTIFY_SECONDS: u64 = 120;
/// Characters in a job's name.
const LONGEST_NAME: usize = 128;
/// Characters in a description.
const LONGEST_DESCRIPTION: usize = 2048;
/// Characters in the value of a parameter.
const LONGEST_VALUE: usize = 1024;

/// A job that calls one program for the frames of each task.
#[derive(Debug, Clone)]
pub struct JobTemplate<'a> {
    /// The job's name.
    pub name: &'a str,
    /// What it does, for people.
    pub description: String,
    /// The name of its one step.
    pub step: &'static str,
    /// The program: a parameter of this name with this path.
    pub program: (&'static str, &'a str),
    /// Files and directories that come in and go out.
    pub paths: Vec<PathParameter>,
    /// What the program is given, with [`FRAMES`], [`parameter`] and [`literal`].
    pub arguments: Vec<String>,
    /// The frames.
    pub frames: &'a [i64],
    /// How many of them a task has.
    pub chunks: &'a Chunks,
    /// What a host must have.
    pub host: HostRequirements,
}

/// A path that the engine may map to another one, and copy.
#[derive(Debug, Clone)]
pub struct PathParameter {
    /// Its name in the template.
    pub name: &'static str,
    /// What it is, for people.
    pub description: &'static str,
    /// Its path here, relative to the template's directory and in it: engines take no other. None: whoever
    /// submits the job has to say.
    pub default: Option<String>,
    /// Whether it is a directory.
    pub is_directory: bool,
    /// Whether the job writes there; otherwise it reads.
    pub is_output: bool,
}

/// What a host must have to be given a task; what is not said is up to the farm.
#[derive(Debug, Clone, Default)]
pub struct HostRequirements {
    /// `linux`, `macos` or `windows`.
    pub system: Option<&'static str>,
    /// Processors.
    pub cpus: Option<u16>,
    /// Bytes of memory.
    pub memory: Option<u64>,
}

/// How a template is spelt.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Spelling {
    /// With comments, for people.
    Yaml,
    /// For programs.
    Json,
}

/// In an argument: the value of a parameter.
pub fn parameter(name: &str) -> String {
    format!("{{{{Param.{name}}}}}")
}

/// In an argument: `text` as it is.
///
/// # Errors
/// It has `{{`, which begins an expression, and there is no other way to write it.
pub fn literal<'a>(what: &'static str, text: &'a str) -> Result<&'a str, ExportError> {
    if text.contains("{{") {
        let why = "has {{, which begins an expression in a template; rename it";
        return Err(ExportError::text(what, text, why));
    }
    one_line(what, text)
}

impl JobTemplate<'_> {
    /// The template.
    ///
    /// # Errors
    /// There are no frames, or a path, a name or the list of frames is longer than values may be or
    /// has something that a template cannot hold.
    pub fn text(&self, spelling: Spelling) -> Result<String, ExportError> {
        let tree = self.tree()?;
        Ok(match spelling {
            Spelling::Yaml => tree.to_yaml(),
            Spelling::Json => {
                let text = serde_json::to_string_pretty(&tree);
                text.map_err(|e| ExportError::Settings(e.to_string()))? + "\n"
            }
        })
    }

    fn tree(&self) -> Result<Node, ExportError> {
        let name = literal("name", self.name)?;
        let name: String = name.chars().take(LONGEST_NAME).collect();
        let description = one_line("description", &self.description)?;
        let description: String = description.chars().take(LONGEST_DESCRIPTION).collect();
        let step = [
            entry("name", self.step),
            entry("parameterSpace", parameter_space()),
        ];
        let requirements = self.host.entry();
        let script = [entry("script", self.script()?)];
        let step = step.into_iter().chain(requirements).chain(script);
        Ok(Node::Map(vec![
            entry("specificationVersion", "jobtemplate-2023-09")
                .told("Relative paths begin at the directory of this file."),
            entry("extensions", Node::List(vec!["TASK_CHUNKING".into()])),
            entry("name", name),
            entry("description", description),
            entry("parameterDefinitions", self.parameters()?),
            entry("steps", Node::Items(vec![Node::Map(step.collect())])),
        ]))
    }

    fn parameters(&self) -> Result<Node, ExportError> {
        let (name, path) = self.program;
        let mut all = Vec::new();
        for path in &self.paths {
            all.push(path.definition()?);
        }
        all.push(vec![
            entry("name", "Frames"),
            entry("type", "STRING"),
            entry(
                "description",
                "Frames to do: 7, 1-10, 1-10:2, -5--2, and lists with commas.",
            ),
            entry("default", frames_text(self.frames)?),
        ]);
        all.push(vec![
            entry("name", "ChunkSize"),
            entry("type", "INT"),
            entry("description", "Frames in a task."),
            entry("minValue", 1),
            entry("default", self.chunks.size as u64),
        ]);
        all.push(vec![
            entry("name", name),
            entry("type", "STRING"),
            entry(
                "description",
                "The program on the hosts: a path, or a name on the PATH.",
            ),
            entry("default", value("program", path)?),
        ]);
        Ok(Node::Items(all.into_iter().map(Node::Map).collect()))
    }

    fn script(&self) -> Result<Node, ExportError> {
        let mut arguments = Vec::new();
        for argument in &self.arguments {
            arguments.push(Node::from(one_line("argument", argument)?));
        }
        let on_run = vec![
            entry("command", parameter(self.program.0)),
            entry("args", Node::List(arguments)),
            entry("timeout", MOST_SECONDS).told("Seconds."),
            entry(
                "cancelation",
                Node::Map(vec![
                    entry("mode", "NOTIFY_THEN_TERMINATE"),
                    entry("notifyPeriodInSeconds", NOTIFY_SECONDS),
                ]),
            )
            .told("When told to stop, the frame in hand is finished."),
        ];
        let actions = Node::Map(vec![entry("onRun", Node::Map(on_run))]);
        Ok(Node::Map(vec![entry("actions", actions)]))
    }
}

fn parameter_space() -> Node {
    let chunks = vec![
        entry("defaultTaskCount", parameter("ChunkSize")),
        entry("rangeConstraint", "NONCONTIGUOUS").told("Frames with gaps make tasks as large."),
    ];
    let frame = vec![
        entry("name", "Frame"),
        entry("type", "CHUNK[INT]"),
        entry("range", parameter("Frames")),
        entry("chunks", Node::Map(chunks)),
    ];
    let all = Node::Items(vec![Node::Map(frame)]);
    Node::Map(vec![entry("taskParameterDefinitions", all)])
}

impl PathParameter {
    fn definition(&self) -> Result<Vec<Entry>, ExportError> {
        let kind = if self.is_directory {
            "DIRECTORY"
        } else {
            "FILE"
        };
        let mut entries = vec![
            entry("name", self.name),
            entry("type", "PATH"),
            entry("objectType", kind),
            entry("dataFlow", if self.is_output { "OUT" } else { "IN" }),
            entry("description", self.description),
        ];
        if let Some(default) = &self.default {
            entries.push(entry("default", value(self.name, default)?));
        }
        Ok(entries)
    }
}

impl HostRequirements {
    fn entry(&self) -> Option<Entry> {
        let mut amounts = Vec::new();
        let cpus = self.cpus.map(|n| ("amount.worker.vcpu", u64::from(n)));
        // MiB.
        let memory = self
            .memory
            .map(|bytes| ("amount.worker.memory", bytes.div_ceil(1 << 20).max(1)));
        for (name, least) in cpus.into_iter().chain(memory) {
            amounts.push(Node::Map(vec![entry("name", name), entry("min", least)]));
        }
        let system = |name: &str| {
            Node::Map(vec![
                entry("name", "attr.worker.os.family"),
                entry("anyOf", Node::List(vec![name.into()])),
            ])
        };
        let attributes: Vec<Node> = self.system.map(system).into_iter().collect();
        let all: Vec<Entry> = [("amounts", amounts), ("attributes", attributes)]
            .into_iter()
            .filter(|(_, items)| !items.is_empty())
            .map(|(key, items)| entry(key, Node::Items(items)))
            .collect();
        (!all.is_empty()).then(|| entry("hostRequirements", Node::Map(all)))
    }
}

/// `frames` as the engines write them, ascending.
fn frames_text(frames: &[i64]) -> Result<String, ExportError> {
    let range = FrameRange::from_frames(frames.iter().copied()).ok_or(ExportError::NoFrames)?;
    // Their step is `:`.
    let text = range.to_string().replace('x', ":");
    if text.len() > LONGEST_VALUE {
        return Err(ExportError::Settings(format!(
            "the frames have so many gaps that their list is longer than the {LONGEST_VALUE} \
             characters that a template takes; export them in parts with --frames"
        )));
    }
    Ok(text)
}

/// What a parameter is set to where nobody says otherwise.
fn value<'a>(what: &'static str, text: &'a str) -> Result<&'a str, ExportError> {
    if text.chars().count() > LONGEST_VALUE {
        let why = format!("is longer than the {LONGEST_VALUE} characters that a template takes");
        return Err(ExportError::text(what, text, why));
    }
    one_line(what, text)
}
