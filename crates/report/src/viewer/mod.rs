//! A page that plays the pictures of a job: one HTML file with a script and no access to a network.
//!
//! The caller lists the frames; this module reads their pictures, and from OpenEXR images what is under the pointer
//! (`ids`) and small pictures of other channels (`channels`), within limits for the size of the page.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde_json::{Value, json};
use spherule_images::file::ImageReadError;
use spherule_images::output::data_url;
use spherule_images::output::view::DisplayView;
use spherule_images::picture::{MARKER, Picture, SampledPlanes, read_planes};
use thiserror::Error;

use crate::page::Page;
use crate::plots::Plot;

mod channels;
mod ids;
mod link;

pub use channels::ChannelKind;
use channels::{ChannelRanges, channel_picture};
use ids::packed_ids;

/// Most bytes of pictures in a page. Browsers fail with much more.
const MAX_EMBEDDED: usize = 384 << 20;

/// Most bytes of ids, values and channels in a page.
const MAX_DATA: usize = 32 << 20;

/// Frames per thread between two additions to the page.
const FRAMES_PER_THREAD: usize = 2;

/// Widths of ids and channels in samples, best first.
const DATA_WIDTHS: [usize; 4] = [640, 480, 320, 160];

const CSS: &str = include_str!("viewer.css");
const SCRIPT: &str = include_str!("viewer.js");
const MARKUP: &str = include_str!("viewer.html");

/// Images that pages may load besides data in them: those beside them, opened as files or from a server.
const IMAGES: &str = "'self' file:";

/// A frame of the page.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ViewerFrame {
    /// Its number.
    pub number: i64,
    /// Its preview, or its image if there is none.
    pub picture: PathBuf,
    /// Its OpenEXR image.
    pub image: PathBuf,
}

/// Settings of a page.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewerSettings {
    /// Heading.
    pub title: String,
    /// Pictures per second when it plays.
    pub rate: f64,
    /// Whether the pictures are in the page instead of beside it.
    pub embed: bool,
    /// Width to which larger embedded pictures are scaled, in pixels.
    pub width: Option<usize>,
    /// How OpenEXR images are shown.
    pub view: DisplayView,
    /// Whether ids, values and channels are in the page, as far as the images have them.
    pub data: bool,
    /// Attributes among the channels of the images.
    pub attributes: Vec<String>,
}

/// What a page contains.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct PageContent {
    /// Names of channels besides the colours.
    pub channels: Vec<String>,
    /// Width of the ids in samples; None without ids.
    pub id_width: Option<usize>,
    /// Values with the ids.
    pub values: Vec<String>,
    /// What was left out to keep the page small.
    pub notes: Vec<String>,
}

/// Why a page cannot be made.
#[derive(Debug, Error)]
pub enum ViewerError {
    /// There are no frames.
    #[error("there are no pictures")]
    Empty,
    /// A picture cannot be read.
    #[error(transparent)]
    Picture(#[from] ImageReadError),
    /// The pictures are too large for one page.
    #[error("the pictures have more than {} MiB, too much for one page; choose a smaller width, fewer frames, or \
        link them", MAX_EMBEDDED >> 20)]
    TooLarge,
    /// A picture cannot be linked from the place of the page.
    #[error("{}: cannot be linked from the page; embed the pictures", .0.display())]
    NoLink(PathBuf),
    /// A picture cannot be written.
    #[error(transparent)]
    Io(#[from] io::Error),
}

/// Makes the page that will be at `path`, with `warning` at its top and `plots` below the pictures.
///
/// # Errors
/// See [`ViewerError`].
pub fn viewer_page(
    frames: &[ViewerFrame],
    settings: &ViewerSettings,
    path: &Path,
    warning: Option<&str>,
    plots: &[Plot],
) -> Result<(String, PageContent), ViewerError> {
    // Link or embed the pictures, and limit the size of the page
    let first = frames.first().ok_or(ViewerError::Empty)?;
    let size = Picture::read(&first.picture, settings.view)?.size();
    let mut all: Vec<Value> = Vec::with_capacity(frames.len());
    let mut embedded = 0;
    for frame in frames {
        let source = source(frame, settings, path)?;
        embedded += source.len();
        if embedded > MAX_EMBEDDED {
            return Err(ViewerError::TooLarge);
        }
        all.push(json!({ "number": frame.number, "source": source }));
    }
    // Add ids and channels
    let content =
        if settings.data { add_data(frames, settings, &mut all)? } else { PageContent::default() };
    let data = json!({
        "generator": MARKER,
        "rate": settings.rate,
        "size": size,
        "frames": all,
        "channels": content.channels,
        "values": content.values,
    });
    // Write the page
    let mut page = Page::new(&settings.title);
    page.style(CSS);
    page.script(SCRIPT, IMAGES);
    if let Some(warning) = warning {
        page.warning(warning);
    }
    page.markup(MARKUP);
    page.data("viewer-data", &data);
    if !plots.is_empty() {
        page.section("plots", "Plots by frame");
        page.plots(plots);
    }
    Ok((page.html(), content))
}

/// The address of a picture: relative to the page, or its data.
fn source(
    frame: &ViewerFrame,
    settings: &ViewerSettings,
    page: &Path,
) -> Result<String, ViewerError> {
    if !settings.embed {
        let link = link::relative(page, &frame.picture);
        return link.ok_or_else(|| ViewerError::NoLink(frame.picture.clone()));
    }
    let is_png = frame.picture.extension().is_some_and(|e| e.eq_ignore_ascii_case("png"));
    if is_png && settings.width.is_none() {
        let bytes = fs::read(&frame.picture)
            .map_err(|source| ImageReadError::Io { path: frame.picture.clone(), source })?;
        return Ok(data_url(&bytes));
    }
    let picture = Picture::read(&frame.picture, settings.view)?;
    let [width, height] = picture.size();
    let picture = match settings.width.filter(|wanted| *wanted < width) {
        Some(wanted) => picture.scaled(wanted, (height * wanted).div_ceil(width)),
        None => picture,
    };
    Ok(data_url(&picture.png(MARKER)?))
}

/// What is read from the images.
struct DataPlan {
    width: usize,
    channels: Vec<ChannelKind>,
    ranges: ChannelRanges,
}

/// Adds ids, values and channels to `all` frames.
fn add_data(
    frames: &[ViewerFrame],
    settings: &ViewerSettings,
    all: &mut [Value],
) -> Result<PageContent, ViewerError> {
    let mut content = PageContent::default();
    let Some(plan) = plan(frames, settings, &mut content)? else {
        return Ok(content);
    };
    let data = |frame: &ViewerFrame| {
        let planes = planes(frame, settings, plan.width)?;
        frame_data(&planes, &plan, settings)
    };
    // Frames in groups, so that few are in memory at a time
    let group = FRAMES_PER_THREAD * rayon::current_num_threads();
    let mut bytes = 0;
    for (frames, values) in frames.chunks(group).zip(all.chunks_mut(group)) {
        let read: Vec<Result<(Value, usize), ViewerError>> = frames.par_iter().map(data).collect();
        for ((frame, value), read) in frames.iter().zip(values).zip(read) {
            let (data, length) = read?;
            bytes += length;
            // Frames may need more than those of the plan
            if bytes > 2 * MAX_DATA {
                let number = frame.number;
                let note = "ids and channels end before frame";
                content.notes.push(format!("{note} {number}, to keep the page small"));
                return Ok(content);
            }
            if let (Value::Object(into), Value::Object(data)) = (value, data) {
                into.extend(data);
            }
        }
    }
    Ok(content)
}

/// Chooses width and channels, so that the data of all frames are within [`MAX_DATA`]. The first, the middle and the
/// last frame stand for all.
fn plan(
    frames: &[ViewerFrame],
    settings: &ViewerSettings,
    content: &mut PageContent,
) -> Result<Option<DataPlan>, ViewerError> {
    let picks = [0, frames.len() / 2, frames.len() - 1].map(|i| &frames[i]);
    // Try one width after the other, until the data are small enough
    for width in DATA_WIDTHS {
        let samples: Vec<SampledPlanes> = picks
            .map(|frame| planes(frame, settings, width))
            .into_iter()
            .collect::<Result<_, _>>()?;
        let mut channels = ChannelKind::in_planes(&samples[0], &settings.attributes);
        let has_ids = channels::ids(&samples[0]).is_some();
        if channels.is_empty() && !has_ids {
            return Ok(None);
        }
        let ranges = ChannelRanges::of(&samples, &channels);
        // Ids are worth more than channels
        for attempt in 0..2 {
            if attempt == 1 {
                channels.clear();
            }
            let plan = DataPlan { width, channels: channels.clone(), ranges: ranges.clone() };
            let lengths = samples.iter().map(|planes| Ok(frame_data(planes, &plan, settings)?.1));
            let longest = lengths.collect::<Result<Vec<usize>, ViewerError>>()?.into_iter().max();
            if longest.unwrap_or(0).saturating_mul(frames.len()) > MAX_DATA {
                continue;
            }
            if attempt == 1 {
                content.notes.push("channels are left out, to keep the page small".to_owned());
            }
            content.channels = channels.iter().map(|kind| kind.name().to_owned()).collect();
            content.id_width = has_ids.then_some(samples[0].size[0]);
            content.values = if has_ids {
                ids::value_names(&samples[0], &settings.attributes)
            } else {
                Vec::new()
            };
            return Ok(Some(plan));
        }
    }
    content.notes.push(
        "ids and channels are left out, to keep the page small; choose fewer frames".to_owned(),
    );
    Ok(None)
}

fn planes(
    frame: &ViewerFrame,
    settings: &ViewerSettings,
    width: usize,
) -> Result<SampledPlanes, ImageReadError> {
    let attributes = settings.attributes.clone();
    let is_wanted = move |name: &str| {
        let base = name.split_once('.').map_or(name, |(base, _)| base);
        channels::SHOWN.iter().any(|plane| plane.name() == base)
            || attributes.iter().any(|a| a == base || a == name)
    };
    read_planes(&frame.image, is_wanted, width)
}

/// Ids, values and channels of a frame, and the length of the text.
fn frame_data(
    planes: &SampledPlanes,
    plan: &DataPlan,
    settings: &ViewerSettings,
) -> Result<(Value, usize), ViewerError> {
    let mut data = serde_json::Map::new();
    let mut length = 0;
    if let Some(ids) = packed_ids(planes, &settings.attributes)? {
        length += ids.len();
        data.insert("ids".to_owned(), json!(ids));
    }
    let mut pictures = serde_json::Map::new();
    for kind in &plan.channels {
        if let Some(picture) = channel_picture(planes, kind, &plan.ranges) {
            let url = data_url(&picture.png(MARKER)?);
            length += url.len();
            pictures.insert(kind.name().to_owned(), json!(url));
        }
    }
    data.insert("pictures".to_owned(), Value::Object(pictures));
    Ok((Value::Object(data), length))
}

#[cfg(test)]
mod tests;
