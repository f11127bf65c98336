//! A script for a Slurm job array. Each task of the array processes a chunk of the frames.
//!
//! Sources: the manual pages of `sbatch` and `scontrol`, and experiments with Slurm 22.05.

use super::chunks::counted;
use super::quote::{one_line, shell_word};
use super::{ChunkChoice, Chunks, ExportError, TimeLimit};
use crate::range::FrameRange;

/// Largest number of tasks of an array with the default `MaxArraySize` (1001; indices start at 0).
pub const MAX_TASKS: usize = 1000;

/// Longest time between signal and time limit that Slurm accepts, seconds.
const MAX_SIGNAL_AHEAD: u32 = 65_535;

/// How often a task may be requeued without having finished a frame, for example because it was preempted.
const SPARE_RESTARTS: usize = 20;

/// A job array whose tasks run one program.
#[derive(Debug, Clone)]
pub struct ArrayScript<'a> {
    /// Name of the job in the queue. Characters other than letters, digits, `.`, `_` and `-` become `-`.
    pub name: &'a str,
    /// Description for the first line: `Renders out/job.toml`.
    pub title: &'a str,
    /// The command of each task.
    pub command: FrameCommand<'a>,
    /// The frames of the tasks.
    pub chunks: &'a Chunks,
    /// Resources of each task.
    pub resources: Resources<'a>,
    /// Time between the signal to finish and the time limit, seconds.
    pub signal_ahead: u32,
    /// Directory of the logs, absolute. Slurm does not create it.
    pub log_dir: &'a str,
}

/// A program that processes some frames. It exits with 75 if TERM stopped it.
#[derive(Debug, Clone)]
pub struct FrameCommand<'a> {
    /// Path of the program.
    pub program: &'a str,
    /// Environment variable that overrides the path.
    pub variable: &'a str,
    /// First arguments. `--frames RANGE --threads N` and possibly `--memory-limit SIZE` follow.
    pub arguments: &'a [&'a str],
    /// Whether to pass the memory limit of the task to the program.
    pub limit_memory: bool,
}

/// Resources of a task. The cluster decides everything that is not set.
#[derive(Debug, Clone, Default)]
pub struct Resources<'a> {
    /// Number of processors.
    pub cpus: u16,
    /// Memory, bytes.
    pub memory: Option<u64>,
    /// Time limit of a task.
    pub time: Option<TimeLimit>,
    /// Largest number of tasks that run at the same time.
    pub concurrent: Option<u32>,
    /// Partitions, comma-separated.
    pub partition: Option<&'a str>,
    /// Account to charge.
    pub account: Option<&'a str>,
}

impl ArrayScript<'_> {
    /// The text of the script.
    ///
    /// # Errors
    /// A path or name that a script cannot contain, or a time limit that leaves no time to work.
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
        if !(1..=MAX_SIGNAL_AHEAD).contains(&ahead) {
            return Err(ExportError::SignalAhead { seconds: ahead, max: MAX_SIGNAL_AHEAD });
        }
        match self.resources.time {
            Some(time) if time.seconds <= u64::from(ahead) => {
                Err(ExportError::NoTimeToWork { limit: time, signal_ahead: ahead })
            }
            _ => Ok(()),
        }
    }

    fn heading(&self) -> Result<String, ExportError> {
        let chunks = self.chunks;
        let mut text = format!(
            "#!/bin/bash\n\
             # {}\n\
             # as a Slurm array of {}. Submit this file with sbatch. If it is submitted again, finished\n\
             # frames are kept.\n\
             # {} per task, {}.\n",
            one_line("title", self.title)?,
            counted(chunks.ranges.len(), "task"),
            counted(chunks.size, "frame"),
            chunks.choice
        );
        if chunks.choice != ChunkChoice::Requested {
            text += "# Five to thirty minutes per task suit most clusters. --chunk sets the number of frames per task.\n";
        }
        Ok(text)
    }

    fn directives(&self) -> Result<String, ExportError> {
        let Resources { cpus, memory, time, concurrent, partition, account } = &self.resources;
        let last = self.chunks.ranges.len().saturating_sub(1);
        let at_once = concurrent.map_or_else(String::new, |n| format!("%{n}"));
        // Collect the directives that every job has, then those that were requested
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
        // Write them, with those for interruption
        Ok(format!(
            "{}\
             # TERM before the time limit: the frame in progress is finished, and the task is requeued.\n\
             #SBATCH --signal=B:TERM@{}\n\
             #SBATCH --requeue\n\
             #SBATCH --open-mode=append\n\
             # Slurm does not create this directory. Without it tasks fail without a message.\n\
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
             # The program; the environment variable {variable} overrides it.\n\
             program=${variable}\n\
             [ -n \"$program\" ] || program={}\n\
             # The frames of each task.\n\
             chunks=(\n{})\n\
             # Each run finishes at least one frame unless it is preempted. More restarts are of no use.\n\
             max_restarts={}\n",
            shell_word("program", self.command.program)?,
            wrapped_words(&self.chunks.ranges),
            self.chunks.size + SPARE_RESTARTS
        ))
    }

    fn call(&self) -> Result<String, ExportError> {
        let words = self
            .command
            .arguments
            .iter()
            .map(|word| Ok(format!(" {}", shell_word("argument", word)?)))
            .collect::<Result<String, ExportError>>()?;
        let limit = if self.command.limit_memory { LIMIT_MEMORY } else { "" };
        Ok(format!(
            "\n\
             set -- --frames \"$frames\" --threads \"${{SLURM_CPUS_PER_TASK:-1}}\"\n\
             {limit}\
             exec \"$program\"{words} \"$@\" &\n"
        ))
    }
}

/// Passes the memory limit of the task to the program.
const LIMIT_MEMORY: &str = r#"# Reserve a tenth for memory that the program does not count.
if [ -n "$SLURM_MEM_PER_NODE" ]; then
  set -- "$@" --memory-limit "$((SLURM_MEM_PER_NODE * 9 / 10))MiB"
fi
"#;

/// Finds the frames of the task, and handles TERM.
const TASK: &str = r#"
if [ -z "$SLURM_ARRAY_TASK_ID" ]; then
  echo "submit this script with sbatch: it is a job array" >&2
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

# TERM reaches only this shell, which forwards it.
child=
terms=0
# shellcheck disable=SC2317 # called by the trap
forward_term() {
  terms=$((terms + 1))
  [ -z "$child" ] || kill -TERM "$child" 2>/dev/null
}
trap forward_term TERM
"#;

/// Waits for the program, and requeues the task if the program was stopped.
const WAIT: &str = r#"child=$!
[ "$terms" -eq 0 ] || kill -TERM "$child" 2>/dev/null
# A signal interrupts wait.
while
  before=$terms
  wait "$child"
  code=$?
  [ "$terms" -gt "$before" ]
do :; done

# 143: stopped before its signal handler was installed.
if [ "$code" -eq 75 ] || { [ "$code" -eq 143 ] && [ "$terms" -gt 0 ]; }; then
  # Do not requeue a cancelled task. Use array and index: the plain id of the last task of an array
  # means the whole array.
  case $(squeue --noheader --jobs="$task" --format='%T %r') in
    RUNNING*|*TimeLimit*)
      if [ "$restarts" -lt "$max_restarts" ]; then
        scontrol requeue "$task"
      else
        echo "task $task: already requeued $restarts times: allow more --time or fewer frames" >&2
      fi
      ;;
  esac
fi
exit "$code"
"#;

/// Ranges as shell words, wrapped at 100 columns.
fn wrapped_words(ranges: &[FrameRange]) -> String {
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

/// `name` without characters that have a meaning for Slurm.
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

/// Checks the name of a partition or an account.
fn slurm_name<'a>(what: &'static str, name: &'a str) -> Result<&'a str, ExportError> {
    let plain = |c: char| c.is_ascii_alphanumeric() || "._-,:@+/".contains(c);
    if name.is_empty() || !name.chars().all(plain) {
        let why = "is not a valid Slurm name; allowed are letters, digits and ._-,:@+/";
        return Err(ExportError::text(what, name, why));
    }
    Ok(name)
}

/// Escapes a directory for the double quotes of `--output`, where `%` starts a placeholder.
fn log_dir(dir: &str) -> Result<String, ExportError> {
    let dir = one_line("log directory", dir)?;
    if dir.contains(['"', '\\']) {
        let why = "contains a quote or a backslash, which have a meaning for Slurm; choose another";
        return Err(ExportError::text("log directory", dir, why));
    }
    Ok(dir.replace('%', "%%"))
}
