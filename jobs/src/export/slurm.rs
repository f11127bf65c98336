//! A script that Slurm runs as an array of tasks, each with a chunk of the frames.
//!
//! Sources: the manual pages of `sbatch` and `scontrol`, and what Slurm 22.05 was seen to do.

use super::chunks::counted;
use super::quote::{one_line, shell_word};
use super::{ChunkChoice, Chunks, ExportError, TimeLimit};
use crate::range::FrameRange;

/// Tasks that an array may have where nobody has set `MaxArraySize` (1001, and numbers begin at 0).
pub const MOST_TASKS: usize = 1000;

/// Seconds by which Slurm can be told to signal ahead of the time limit.
const MOST_AHEAD: u32 = 65_535;

/// How often a task may be put back without having made a frame: to make room for others, say.
const SPARE_RESTARTS: usize = 20;

/// An array of tasks that call one program.
#[derive(Debug, Clone)]
pub struct ArrayScript<'a> {
    /// The job's name in the queue; what is no letter, digit, `.`, `_` or `-` becomes `-`.
    pub name: &'a str,
    /// What is done, for the first line: `Renders out/job.toml`.
    pub title: &'a str,
    /// What each task runs.
    pub command: FrameCommand<'a>,
    /// The frames of the tasks.
    pub chunks: &'a Chunks,
    /// What each task gets of a node.
    pub resources: Resources<'a>,
    /// Seconds before the time limit at which a task is told to finish.
    pub signal_ahead: u32,
    /// Where logs go, absolute. Slurm does not make it.
    pub log_dir: &'a str,
}

/// A program that does some frames, all in one directory, and ends with 75 when TERM has stopped it.
#[derive(Debug, Clone)]
pub struct FrameCommand<'a> {
    /// Its path.
    pub program: &'a str,
    /// The environment variable that names another one.
    pub variable: &'a str,
    /// What comes first; then `--frames RANGE --threads N` and perhaps `--memory-limit SIZE`.
    pub arguments: &'a [&'a str],
    /// Whether the program is told what memory Slurm gives the task.
    pub limit_memory: bool,
}

/// What a task asks of the cluster; what is not said is up to the cluster.
#[derive(Debug, Clone, Default)]
pub struct Resources<'a> {
    /// Processors.
    pub cpus: u16,
    /// Bytes of memory.
    pub memory: Option<u64>,
    /// Time for one chunk.
    pub time: Option<TimeLimit>,
    /// Tasks that may run at once.
    pub concurrent: Option<u32>,
    /// Partitions, with commas.
    pub partition: Option<&'a str>,
    /// Whom to charge.
    pub account: Option<&'a str>,
}

impl ArrayScript<'_> {
    /// The script.
    ///
    /// # Errors
    /// A path or name that it cannot hold, or a time limit that leaves no time to work.
    pub fn text(&self) -> Result<String, ExportError> {
        self.check_times()?;
        let parts = [
            self.heading()?,
            self.directives()?,
            self.settings()?,
            TASK.to_owned(),
            self.call()?,
            WAIT.to_owned(),
        ];
        Ok(parts.concat())
    }

    fn check_times(&self) -> Result<(), ExportError> {
        let ahead = self.signal_ahead;
        if !(1..=MOST_AHEAD).contains(&ahead) {
            return Err(ExportError::Settings(format!(
                "the signal can come 1 to {MOST_AHEAD} seconds ahead of the time limit, not {ahead}"
            )));
        }
        match self.resources.time {
            Some(time) if time.seconds <= u64::from(ahead) => Err(ExportError::Settings(format!(
                "a time limit of {time} leaves no time to work with a signal {ahead} s ahead of it"
            ))),
            _ => Ok(()),
        }
    }

    fn heading(&self) -> Result<String, ExportError> {
        let chunks = self.chunks;
        let mut text = format!(
            "#!/bin/bash\n\
             # {}\n\
             # as a Slurm array of {}; submit this file with sbatch. Submitted again, it does what is\n\
             # missing: finished frames are kept.\n\
             # {} a task, {}.\n",
            one_line("title", self.title)?,
            counted(chunks.ranges.len(), "task"),
            counted(chunks.size, "frame"),
            chunks.choice
        );
        if chunks.choice != ChunkChoice::Asked {
            text += "# Five to thirty minutes a task suit most clusters: --chunk sets the frames of a task.\n";
        }
        Ok(text)
    }

    fn directives(&self) -> Result<String, ExportError> {
        let Resources {
            cpus,
            memory,
            time,
            concurrent,
            partition,
            account,
        } = &self.resources;
        let last = self.chunks.ranges.len().saturating_sub(1);
        let at_once = concurrent.map_or_else(String::new, |n| format!("%{n}"));
        let mut all = vec![
            format!("job-name={}", job_name(self.name)),
            format!("array=0-{last}{at_once}"),
            "nodes=1".to_owned(),
            "ntasks=1".to_owned(),
            format!("cpus-per-task={cpus}"),
        ];
        all.extend(memory.map(|bytes| format!("mem={}M", bytes.div_ceil(1 << 20).max(1))));
        all.extend(time.map(|time| format!("time={time}")));
        for (key, value) in [("partition", partition), ("account", account)] {
            if let Some(value) = value {
                all.push(format!("{key}={}", slurm_name(key, value)?));
            }
        }
        let all: Vec<String> = all.iter().map(|d| format!("#SBATCH --{d}\n")).collect();
        Ok(format!(
            "{}\
             # Ahead of the time limit, TERM: the frame in hand is finished, and the task put back.\n\
             #SBATCH --signal=B:TERM@{}\n\
             #SBATCH --requeue\n\
             #SBATCH --open-mode=append\n\
             # Slurm does not make this directory, and without it tasks fail and leave no word.\n\
             #SBATCH --output=\"{}/%A_%a.log\"\n",
            all.concat(),
            self.signal_ahead,
            log_dir(self.log_dir)?
        ))
    }

    fn settings(&self) -> Result<String, ExportError> {
        let variable = self.command.variable;
        Ok(format!(
            "\n\
             # The program; {variable} in the environment names another one.\n\
             program=${variable}\n\
             [ -n \"$program\" ] || program={}\n\
             # The frames of each task.\n\
             chunks=(\n{})\n\
             # A run makes a frame at least, if nothing disturbs it: put back more often, a task gets nowhere.\n\
             most_restarts={}\n",
            shell_word("program", self.command.program)?,
            columns(&self.chunks.ranges),
            self.chunks.size + SPARE_RESTARTS
        ))
    }

    fn call(&self) -> Result<String, ExportError> {
        let words = self.command.arguments.iter();
        let words = words
            .map(|word| Ok(format!(" {}", shell_word("argument", word)?)))
            .collect::<Result<String, ExportError>>()?;
        let limit = match self.command.limit_memory {
            true => LIMIT_MEMORY,
            false => "",
        };
        Ok(format!(
            "\n\
             set -- --frames \"$frames\" --threads \"${{SLURM_CPUS_PER_TASK:-1}}\"\n\
             {limit}\
             exec \"$program\"{words} \"$@\" &\n"
        ))
    }
}

/// Has the program keep within what Slurm gives the task.
const LIMIT_MEMORY: &str = r#"# A tenth is left to what is not counted.
if [ -n "$SLURM_MEM_PER_NODE" ]; then
  set -- "$@" --memory-limit "$((SLURM_MEM_PER_NODE * 9 / 10))MiB"
fi
"#;

/// From the task's number to its frames, and what to do on TERM.
const TASK: &str = r#"
if [ -z "$SLURM_ARRAY_TASK_ID" ]; then
  echo "submit this script with sbatch: it is an array of tasks" >&2
  exit 2
fi
task=${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID
frames=${chunks[SLURM_ARRAY_TASK_ID]}
if [ -z "$frames" ]; then
  echo "task $task: there are ${#chunks[@]} tasks, from 0" >&2
  exit 2
fi
restarts=${SLURM_RESTART_COUNT:-0}
echo "$(date '+%F %T') $HOSTNAME: task $task, frames $frames, restarts $restarts"

# TERM reaches this shell alone, which passes it on.
child=
terms=0
# shellcheck disable=SC2317 # called by the trap
pass_on() {
  terms=$((terms + 1))
  [ -z "$child" ] || kill -TERM "$child" 2>/dev/null
}
trap pass_on TERM
"#;

/// Waiting for the program, and putting the task back if it was stopped.
const WAIT: &str = r#"child=$!
[ "$terms" -eq 0 ] || kill -TERM "$child" 2>/dev/null
# A signal cuts the waiting short.
while
  before=$terms
  wait "$child"
  code=$?
  [ "$terms" -gt "$before" ]
do :; done

# 143: stopped before it could listen.
if [ "$code" -eq 75 ] || { [ "$code" -eq 143 ] && [ "$terms" -gt 0 ]; }; then
  # A task that was cancelled is not put back. By array and number: the plain id of an array's last
  # task means the whole array.
  case $(squeue --noheader --jobs="$task" --format='%T %r') in
    RUNNING*|*TimeLimit*)
      if [ "$restarts" -lt "$most_restarts" ]; then
        scontrol requeue "$task"
      else
        echo "task $task: put back $restarts times already: allow more --time or fewer frames" >&2
      fi
      ;;
  esac
fi
exit "$code"
"#;

/// Ranges as words, in lines of a length that people can read.
fn columns(ranges: &[FrameRange]) -> String {
    let mut text = String::new();
    let mut column = 0;
    for range in ranges {
        let word = format!(" {range}");
        if column > 0 && column + word.len() > 98 {
            text.push('\n');
            column = 0;
        }
        text += if column == 0 { " " } else { "" };
        text += &word;
        column += 1 + word.len();
    }
    text + "\n"
}

/// `name` with nothing in it that means something to Slurm.
fn job_name(name: &str) -> String {
    let plain = |c: char| match c {
        c if c.is_ascii_alphanumeric() || "._-".contains(c) => c,
        _ => '-',
    };
    let name: String = name.chars().take(64).map(plain).collect();
    match name.trim_matches('-') {
        "" => "frames".to_owned(),
        name => name.to_owned(),
    }
}

/// A partition or an account.
fn slurm_name<'a>(what: &'static str, name: &'a str) -> Result<&'a str, ExportError> {
    let plain = |c: char| c.is_ascii_alphanumeric() || "._-,:@+/".contains(c);
    if name.is_empty() || !name.chars().all(plain) {
        let why = "is not a name that Slurm knows: letters, digits and ._-,:@+/ are";
        return Err(ExportError::text(what, name, why));
    }
    Ok(name)
}

/// A directory inside the double quotes of `--output`, where `%` begins a placeholder.
fn log_dir(dir: &str) -> Result<String, ExportError> {
    let dir = one_line("log directory", dir)?;
    if dir.contains(['"', '\\']) {
        let why =
            "has a quote or a backslash, which Slurm takes for something else; choose another";
        return Err(ExportError::text("log directory", dir, why));
    }
    Ok(dir.replace('%', "%%"))
}
