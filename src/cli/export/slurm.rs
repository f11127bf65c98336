//! `spherule export slurm`: an array script.

use std::fs;
use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::Args;
use spherule_jobs::export::TimeLimit;
use spherule_jobs::export::slurm::{ArrayScript, FrameCommand, MOST_TASKS, Resources};

use super::super::paths::absolute;
use super::super::{CliError, Outcome};
use super::{CommonArgs, Work, deliver, grace, text, tidy};
use crate::manifest::MAX_THREADS;
use crate::metrics::Bytes;

#[derive(Debug, Args)]
pub(super) struct SlurmArgs {
    #[command(flatten)]
    common: CommonArgs,
    /// Processors for a task, and threads of it.
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u16).range(1..=i64::from(MAX_THREADS)))]
    cpus: u16,
    /// Time for a task: 02:00:00, 1-12:00:00, or minutes [default: the partition's]
    #[arg(long, value_name = "TIME")]
    time: Option<TimeLimit>,
    /// Tasks that may run at once.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    concurrent: Option<u32>,
    /// Partition to run in.
    #[arg(long, value_name = "NAME")]
    partition: Option<String>,
    /// Account to charge.
    #[arg(long, value_name = "NAME")]
    account: Option<String>,
    /// Seconds before the time limit at which a task is told to finish its frame.
    ///
    /// Longer than a frame takes.
    #[arg(long, value_name = "SECONDS", default_value_t = 120)]
    signal_ahead: u32,
    /// Directory for the tasks' logs [default: slurm-logs beside the manifest]
    #[arg(long, value_name = "DIR")]
    logs: Option<PathBuf>,
    /// Tasks that an array may have at this cluster: its MaxArraySize less 1.
    ///
    /// With more, tasks get more frames.
    #[arg(long, value_name = "N", default_value_t = usual_most())]
    max_tasks: NonZeroUsize,
}

const fn usual_most() -> NonZeroUsize {
    NonZeroUsize::new(MOST_TASKS).expect("arrays may have tasks")
}

pub(super) fn run(args: &SlurmArgs) -> Result<Outcome, CliError> {
    let work = Work::read(&args.common, args.max_tasks)?;
    let beside = || work.manifest_file.with_file_name("slurm-logs");
    let logs = args.logs.as_deref().map(absolute).transpose()?;
    let logs = logs.map_or_else(beside, |dir| tidy(&dir));
    let script = script(args, &work, text(&logs)?)?;
    match &args.common.output {
        // A script whose logs have no place fails without a word.
        Some(_) => fs::create_dir_all(&logs).map_err(CliError::io(&logs))?,
        None => say!(
            "note: before it is submitted: mkdir -p '{}'",
            logs.display()
        ),
    }
    deliver(&args.common, &script)?;
    say!("{}", work.chunks);
    if let Some(path) = &args.common.output {
        say!("submit with: sbatch {}", path.display());
        say!("logs: {}", logs.display());
    }
    Ok(Outcome::Done)
}

fn script(args: &SlurmArgs, work: &Work, logs: &str) -> Result<String, CliError> {
    let (asked, limit) = (args.common.mem, work.memory_limit);
    // Without --mem what the manifest allows, and a tenth for what its limit does not count.
    let memory = asked.or(limit.map(|l| Bytes(l.0.saturating_add(l.0 / 9))));
    let grace = grace(args.signal_ahead.into());
    let script = ArrayScript {
        name: &work.name,
        title: &work.title(),
        command: FrameCommand {
            program: text(&work.program)?,
            variable: "SPHERULE",
            arguments: &["render", text(&work.manifest_file)?, "--grace", &grace],
            // The manifest's own limit holds unless it is the larger one.
            limit_memory: limit.is_none_or(|limit| asked.is_some_and(|asked| asked <= limit)),
        },
        chunks: &work.chunks,
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
