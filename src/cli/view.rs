//! `spherule view`: a page that plays the finished pictures of a job.

use std::path::PathBuf;

use clap::Args;
use spherule_jobs::publish;

use super::pictures::{JobPictures, PicturesArgs};
use super::{CliError, Outcome, print};
use crate::manifest::Channel;
use crate::movie::FrameRate;
use crate::output::PictureFormat;
use crate::report::job::JobReport;
use crate::viewer::{PageContent, ViewerError, ViewerFrame, ViewerSettings, viewer_page};

const EXAMPLES: &str = "\
Examples:
  spherule view out
      Writes out/view.html, which shows the previews beside it
  spherule view out --embed --width 960 -o dam.html
      One file to send, with small pictures in it
  spherule view out/job.toml --frames 1-200x10 --fps 5
      Some frames, at five pictures per second";

/// Name of the page beside the images.
const FILE: &str = "view.html";

#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct ViewArgs {
    #[command(flatten)]
    pictures: PicturesArgs,
    /// Page to write [default: view.html beside the images].
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Put the pictures into the page instead of linking them.
    #[arg(long)]
    embed: bool,
    /// Width to which larger embedded pictures are scaled, in pixels.
    #[arg(long, value_name = "PIXELS", requires = "embed", value_parser = clap::value_parser!(u16).range(1..))]
    width: Option<u16>,
    /// Pictures per second when the page plays.
    #[arg(long, value_name = "RATE", default_value = "10", allow_negative_numbers = true)]
    fps: FrameRate,
    /// Leave out particle ids, values and channels, which make the page larger.
    #[arg(long)]
    no_data: bool,
    /// Replace a file that was not made by this command.
    #[arg(long)]
    force: bool,
}

pub(super) fn run(args: &ViewArgs) -> Result<Outcome, CliError> {
    // Read the finished frames
    let pictures = JobPictures::read(&args.pictures)?;
    pictures.require_any()?;
    let gaps = pictures.gaps();
    if let Some(gaps) = &gaps {
        message!("{gaps}; the page shows what is there");
    }
    let output = args.output.clone().unwrap_or_else(|| pictures.state.dir().join(FILE));
    pictures.guard(&output, args.force)?;
    // Collect their pictures
    let frames: Vec<ViewerFrame> = pictures
        .pictures
        .iter()
        .map(|picture| ViewerFrame {
            number: picture.number,
            picture: picture.picture.clone(),
            image: picture.image.clone(),
        })
        .collect();
    if !pictures.has_previews && !args.embed {
        message!("the job has no previews: pictures are made from the images, into the page");
    }
    // Make the page, with the plots of the job's report
    let settings = settings(args, &pictures, &frames);
    let report = JobReport::of_plan(&pictures.state);
    let made = viewer_page(&frames, &settings, &output, gaps.as_deref(), &report.plots());
    let (html, content) = made.map_err(|error| match error {
        ViewerError::Picture(_) => pictures.explain(&error),
        error => CliError::other(format!("{}: {error}", output.display())),
    })?;
    // Publish it, and say what it has
    publish(&output, html.as_bytes()).map_err(CliError::io(&output))?;
    for note in &content.notes {
        message!("{note}");
    }
    print::lines([format!(
        "{}: {} frames{}, {} bytes",
        output.display(),
        frames.len(),
        describe(&content),
        html.len()
    )])?;
    Ok(Outcome::Done)
}

/// How the page is made. Overlays in strips, which no channel fits, are reported.
fn settings(args: &ViewArgs, pictures: &JobPictures, frames: &[ViewerFrame]) -> ViewerSettings {
    let format_of = |frame: &ViewerFrame| PictureFormat::of(&frame.image);
    let has_exr = frames.iter().any(|frame| format_of(frame) == Some(PictureFormat::Exr));
    let has_strips = has_exr && pictures.have_strips();
    if has_strips && !args.no_data {
        message!(
            "overlays are beside the pictures, which the channels of the images would not fit: the page has none"
        );
    }
    ViewerSettings {
        title: title(pictures),
        rate: args.fps.per_second(),
        embed: args.embed || !pictures.has_previews,
        width: args.width.map(usize::from),
        view: pictures.view,
        data: !args.no_data && has_exr && !has_strips,
        attributes: attributes(pictures),
    }
}

/// What the page has besides the pictures.
fn describe(content: &PageContent) -> String {
    let mut text = String::new();
    if let Some(width) = content.id_width {
        text += &format!(", ids at {width} pixels");
        if !content.values.is_empty() {
            text += &format!(" with {}", content.values.join(", "));
        }
    }
    if !content.channels.is_empty() {
        text += &format!(", channels {}", content.channels.join(", "));
    }
    text
}

/// Directory and name of the images, by which users know the job.
fn title(pictures: &JobPictures) -> String {
    let path = setting(pictures, "output.path");
    let name = path
        .and_then(|value| value.as_str().map(str::to_owned))
        .unwrap_or_else(|| "Pictures".to_owned());
    let real = pictures.state.dir().canonicalize().ok();
    let dir = real.as_deref().and_then(|dir| dir.file_name());
    match dir {
        Some(dir) => format!("{}/{name}", dir.to_string_lossy()),
        None => name,
    }
}

/// Attributes among the channels.
fn attributes(pictures: &JobPictures) -> Vec<String> {
    let stored = setting(pictures, "output.channels");
    let channels = stored.as_ref().and_then(|value| value.as_array());
    let names = channels.into_iter().flatten().filter_map(|channel| channel.as_str());
    let channels: Vec<Channel> = names.filter_map(Channel::from_name).collect();
    channels.iter().filter_map(Channel::attribute).map(str::to_owned).collect()
}

/// A setting of the plan.
fn setting(pictures: &JobPictures, key: &str) -> Option<toml::Value> {
    let settings = pictures.state.plan().settings();
    let (_, text) = settings.iter().find(|(name, _)| name == key)?;
    let table = format!("value = {text}").parse::<toml::Table>();
    table.ok()?.remove("value")
}
