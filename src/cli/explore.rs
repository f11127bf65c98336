//! `spherule explore`: serves a page on which the view and the settings of a job are found.

use std::env;
use std::net::{IpAddr, Ipv4Addr};
use std::process::{Command, Stdio};

use clap::Args;

use super::job::use_threads;
use super::manifest_args::{ManifestArgs, open_sequence};
use super::{CliError, Outcome, print, signals};
use crate::explore::serve::{Server, Service, Token};
use crate::explore::{Explorer, SavedFiles};
use crate::job::frames_in;

const EXAMPLES: &str = "\
Examples:
  spherule explore dump
      Prints the address of the page, and opens it if there is a display
  spherule explore out/job.toml --port 8000 --no-browser
      Goes on from a manifest, at a fixed port";

#[derive(Debug, Args)]
#[command(
    after_help = EXAMPLES,
    mut_arg("progress", no_job),
    mut_arg("isolate", no_job),
    mut_arg("memory-ceiling", no_job),
    mut_arg("retries", no_job),
    mut_arg("takeover-after", no_job),
    mut_arg("grace", no_job),
    mut_arg("follow", no_job),
    mut_arg("idle", no_job),
    mut_arg("settle", no_job),
    mut_arg("stop-file", no_job),
)]
pub(super) struct ExploreArgs {
    #[command(flatten)]
    manifest: ManifestArgs,
    /// Port of the page [default: a free one].
    #[arg(long, value_name = "PORT", default_value = "0", hide_default_value = true)]
    port: u16,
    /// Address to listen at, for browsers on other machines
    ///
    /// Whoever can reach it and knows the token can read the data and write pictures here. An ssh tunnel, whose command is
    /// printed, needs no such address.
    #[arg(long, value_name = "ADDRESS", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    bind: IpAddr,
    /// Do not open a browser.
    #[arg(long)]
    no_browser: bool,
}

/// Hides an option that only applies to jobs; it goes to the manifest that is saved.
fn no_job(option: clap::Arg) -> clap::Arg {
    option.hide(true)
}

const SIGNAL_MESSAGES: signals::SignalMessages =
    signals::SignalMessages { stopping: "ending", stopped: "the page has ended; jobs go on" };

pub(super) fn run(args: &ExploreArgs) -> Result<Outcome, CliError> {
    let _signals = signals::listen(SIGNAL_MESSAGES)?;
    // Check the options and open the sequence
    let requested = args.manifest.manifest()?;
    use_threads(requested.manifest.job.threads)?;
    let sequence = open_sequence(&requested)?;
    for note in sequence.notes() {
        note!("{note}");
    }
    let frames = frames_in(&sequence, requested.manifest.input.frames.as_ref())?;
    let title = args.manifest.input.iter().map(|path| path.display().to_string());
    let title = title.collect::<Vec<_>>().join(" ");
    let program = env::current_exe().map_err(|error| CliError::other(error.to_string()))?;
    // Print the address before anything is read
    let listen =
        |error| CliError::other(format!("--bind {} --port {}: {error}", args.bind, args.port));
    let server = Token::new().and_then(|token| Server::bind(args.bind, args.port, token));
    let server = server.map_err(listen)?;
    let url = server.url();
    print::lines([url.clone()])?;
    let port = server.port();
    if args.bind.is_loopback() {
        message!(
            "from another machine: ssh -L {port}:127.0.0.1:{port} THIS_MACHINE, then open the same address there"
        );
    } else {
        note!(
            "whoever reaches {} and knows the address can read the data and write pictures",
            args.bind
        );
    }
    message!("Ctrl-C ends it");
    if !args.no_browser {
        open_browser(&url);
    }
    // Serve it until the end
    let explorer = Explorer::start(requested, sequence).map_err(listen)?;
    let service = Service { explorer, frames, title, program, files: SavedFiles::default() };
    server.run(service).map_err(listen)?;
    Ok(Outcome::Done)
}

/// Opens `url` if there is a display. Users without a browser open it themselves.
fn open_browser(url: &str) {
    let has_display = cfg!(any(target_os = "macos", windows))
        || ["DISPLAY", "WAYLAND_DISPLAY"].iter().any(|name| env::var_os(name).is_some());
    if !has_display || env::var_os("SSH_CONNECTION").is_some() {
        return;
    }
    let program = if cfg!(target_os = "macos") {
        "open"
    } else if cfg!(windows) {
        "explorer"
    } else {
        "xdg-open"
    };
    let mut command = Command::new(program);
    command.arg(url).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    if let Ok(mut child) = command.spawn() {
        // It is waited for, so that it does not remain as a zombie
        std::thread::spawn(move || child.wait());
    }
}
