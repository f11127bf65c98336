//! `spherule export slurm`: an array script.

use std::fs;
use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::Args;
use spherule_files::Bytes;
use spherule_jobs::export::TimeLimit;
use spherule_jobs::export::slurm::{ArrayScript, FrameCommand, MAX_TASKS, Resources};

use super::super::paths::absolute;
use super::super::{CliError, Outcome};
use super::{CommonArgs, ExportJob, grace, normalized, text, write_output};
use crate::manifest::MAX_THREADS;

#[derive(Debug, Args)]
pub(super) struct SlurmArgs {
    #[command(flatten)]
    common: CommonArgs,
    /// Processors per task, and its number of threads.
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u16).range(1..=i64::from(MAX_THREADS)))]
    cpus: u16,
    /// Time limit of a task: 02:00:00, 1-12:00:00, or minutes [default: the partition's]
    #[arg(long, value_name = "TIME")]
    time: Option<TimeLimit>,
    /// Maximum number of tasks that run at the same time.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    concurrent: Option<u32>,
    /// Partition to run in.
    #[arg(long, value_name = "NAME")]
    partition: Option<String>,
    /// Account to charge.
    #[arg(long, value_name = "NAME")]
    account: Option<String>,
    /// Seconds before the time limit at which a task receives the signal to finish its frame.
    ///
    /// Choose a longer time than one frame takes.
    #[arg(long, value_name = "SECONDS", default_value_t = 120)]
    signal_ahead: u32,
    /// Directory for the tasks' logs [default: slurm-logs next to the manifest]
    #[arg(long, value_name = "DIR")]
    logs: Option<PathBuf>,
    /// Maximum number of tasks in an array on this cluster: its MaxArraySize minus 1.
    ///
    /// If there would be more tasks, each task gets more frames.
    #[arg(long, value_name = "N", default_value_t = default_max_tasks())]
    max_tasks: NonZeroUsize,
}

const fn default_max_tasks() -> NonZeroUsize {
    NonZeroUsize::new(MAX_TASKS).expect("the limit is above 0")
}

pub(super) fn run(args: &SlurmArgs) -> Result<Outcome, CliError> {
    let export_job = ExportJob::read(&args.common, args.max_tasks)?;
    let default = || export_job.manifest_file.with_file_name("slurm-logs");
    let logs = args
        .logs
        .as_deref()
        .map(absolute)
        .transpose()?
        .map_or_else(default, |dir| normalized(&dir));
    let script = script(args, &export_job, text(&logs)?)?;
    match &args.common.output {
        // Without the directory the tasks fail without a message
        Some(_) => fs::create_dir_all(&logs).map_err(CliError::io(&logs))?,
        None => message!("note: before you submit the script: mkdir -p '{}'", logs.display()),
    }
    write_output(&args.common, &script)?;
    message!("{}", export_job.chunks);
    if let Some(path) = &args.common.output {
        message!("submit with: sbatch {}", path.display());
        message!("logs: {}", logs.display());
    }
    Ok(Outcome::Done)
}

fn script(args: &SlurmArgs, export_job: &ExportJob, logs: &str) -> Result<String, CliError> {
    let (requested, limit) = (args.common.mem, export_job.memory_limit);
    // Without --mem: the limit of the manifest, plus a tenth for memory that the limit does not count
    let memory = requested.or(limit.map(|l| Bytes(l.0.saturating_add(l.0 / 9))));
    let grace = grace(args.signal_ahead.into());
    let script = ArrayScript {
        name: &export_job.name,
        title: &export_job.title(),
        command: FrameCommand {
            program: text(&export_job.program)?,
            variable: "SPHERULE",
            arguments: &["render", text(&export_job.manifest_file)?, "--grace", &grace],
            // Use the smaller one of both limits
            limit_memory: limit.is_none_or(|limit| requested.is_some_and(|size| size <= limit)),
        },
        chunks: &export_job.chunks,
        resources: Resources {
            cpus: args.cpus,
            memory: memory.map(|size| size.0),
            time: args.time,
            concurrent: args.concurrent,
            partition: args.partition.as_deref(),
            account: args.account.as_deref(),
        },
        signal_ahead: args.signal_ahead,
        log_dir: logs,
    };
    Ok(script.text()?)
}
