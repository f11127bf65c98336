//! Flags for `[job]`, how the work is gone about.

use clap::Args;

use super::CliError;
use super::job::{over, path_as_typed};
use super::numbers::{seconds, whole};
use crate::manifest::{Override, ProgressMode};

/// Laid over the manifest's `[job]`.
#[derive(Debug, Args)]
#[command(next_help_heading = "Job")]
pub(super) struct JobArgs {
    /// Threads to use: all, or how many up to 1024 [default: all]
    ///
    /// At most 4 for each processor are used: more only keep one another from working.
    #[arg(long, value_name = "COUNT", allow_hyphen_values = true)]
    threads: Option<String>,
    /// How progress is shown [default: auto]
    #[arg(long, value_enum)]
    progress: Option<ProgressMode>,
    /// Make each frame in a process of its own.
    #[arg(long)]
    isolate: bool,
    /// Most anonymous memory of such a process: 4GiB, 512MiB [default: no limit]
    #[arg(long, value_name = "SIZE", allow_hyphen_values = true)]
    memory_ceiling: Option<String>,
    /// How often a frame whose process died is tried again in this run [default: 1]
    #[arg(long, value_name = "COUNT", allow_negative_numbers = true, value_parser = whole)]
    retries: Option<i64>,
    /// Seconds without a sign of life after which another machine's frames are taken over [default: 60]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = seconds)]
    takeover_after: Option<f64>,
    /// Seconds that a frame may take after TERM or Ctrl-C; then it is dropped [default: 30].
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true)]
    grace: Option<f64>,
    /// Go on with frames that a running simulation writes.
    #[arg(long)]
    follow: bool,
    /// Seconds without a new frame after which following ends [default: 600]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = seconds)]
    idle: Option<f64>,
    /// Seconds that a file must have stood unchanged to count as complete [default: 2]
    #[arg(long, value_name = "SECONDS", allow_negative_numbers = true, value_parser = seconds)]
    settle: Option<f64>,
    /// Following ends when this file appears [default: job.stop beside the images]
    #[arg(long, value_name = "FILE")]
    stop_file: Option<String>,
}

impl JobArgs {
    /// What was asked for; `from_file` if it goes over a manifest from a file.
    pub(super) fn add_overrides(
        &self,
        list: &mut Vec<Override>,
        from_file: bool,
    ) -> Result<(), CliError> {
        let number = |text: &String| {
            let number = text.parse().map(|count: i64| toml::Value::from(count));
            number.unwrap_or_else(|_| toml::Value::from(text.clone()))
        };
        let seconds = |value: Option<f64>| value.map(toml::Value::from);
        let name = |mode: ProgressMode| toml::Value::from(mode.name());
        let stop_file = self.stop_file.as_ref();
        let stop_file = stop_file.map(|path| path_as_typed(path, from_file));
        let asked = [
            ("threads", self.threads.as_ref().map(number), "--threads"),
            ("progress", self.progress.map(name), "--progress"),
            ("isolate", self.isolate.then_some(true.into()), "--isolate"),
            (
                "memory_ceiling",
                self.memory_ceiling.clone().map(toml::Value::from),
                "--memory-ceiling",
            ),
            ("retries", self.retries.map(toml::Value::from), "--retries"),
            (
                "takeover_after",
                seconds(self.takeover_after),
                "--takeover-after",
            ),
            ("grace", seconds(self.grace), "--grace"),
            ("follow", self.follow.then_some(true.into()), "--follow"),
            ("idle", seconds(self.idle), "--idle"),
            ("settle", seconds(self.settle), "--settle"),
            (
                "stop_file",
                stop_file.transpose()?.map(toml::Value::from),
                "--stop-file",
            ),
        ];
        for (key, value, shown) in asked {
            if let Some(value) = value {
                list.push(over(&format!("job.{key}"), value, shown)?);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
#[path = "job_args_tests.rs"]
mod tests;
