//! OpenEXR images, block by block: their colours as a picture, and selected planes at every n-th pixel.

use std::io::{Read, Seek};
use std::path::Path;

use exr::block::UncompressedBlock;
use exr::block::lines::LineRef;
use exr::meta::MetaData;
use exr::meta::attribute::{ChannelDescription, SampleType};
use exr::meta::header::Header;
use glam::Vec3;

use super::{Picture, check_size};
use crate::file::{Fault, ImageReadError, read};
use crate::output::view::{DisplayView, byte_from_linear, dither_threshold};

/// The extension of OpenEXR images.
pub const EXR_EXTENSION: &str = "exr";

/// Maximum size of an uncompressed block, bytes.
const MAX_BLOCK_BYTES: u64 = 1 << 28;

/// Samples of a plane, row by row from the top.
#[derive(Debug, Clone, PartialEq)]
pub enum PlaneSamples {
    /// Half-floats and floats.
    Float(Vec<f32>),
    /// Integers, such as ids.
    Integer(Vec<u32>),
}

/// Planes of an image at every n-th pixel.
#[derive(Debug, Clone, PartialEq)]
pub struct SampledPlanes {
    /// Width and height in samples.
    pub size: [usize; 2],
    /// Width and height of the image in pixels.
    pub image_size: [usize; 2],
    /// Distance between samples in pixels. The first is half of it from the left and the top.
    pub step: usize,
    /// Names and samples, in the order of the file.
    pub planes: Vec<(String, PlaneSamples)>,
}

impl SampledPlanes {
    /// The samples of the plane `name`.
    pub fn plane(&self, name: &str) -> Option<&PlaneSamples> {
        let mut planes = self.planes.iter();
        planes.find(|(other, _)| other == name).map(|(_, samples)| samples)
    }

    /// The samples of the plane `name`, if they are floats.
    pub fn floats(&self, name: &str) -> Option<&[f32]> {
        match self.plane(name)? {
            PlaneSamples::Float(samples) => Some(samples),
            PlaneSamples::Integer(_) => None,
        }
    }

    /// The samples of the plane `name`, if they are integers.
    pub fn integers(&self, name: &str) -> Option<&[u32]> {
        match self.plane(name)? {
            PlaneSamples::Integer(samples) => Some(samples),
            PlaneSamples::Float(_) => None,
        }
    }
}

/// Reads those planes of the image at `path` that `is_wanted` selects by their name, with the smallest step that
/// gives at most `max_width` samples in a row.
///
/// # Errors
/// See [`ImageReadError`]; messages begin with the path.
pub fn read_planes(
    path: &Path,
    is_wanted: impl Fn(&str) -> bool + std::panic::UnwindSafe,
    max_width: usize,
) -> Result<SampledPlanes, ImageReadError> {
    read(path, |file| decode(file, is_wanted, |width| width.div_ceil(max_width.max(1))))
}

/// The colours of a file through the view transform, like a preview. An image without background is in front of
/// black.
pub(super) fn picture(file: impl Read + Seek, view: DisplayView) -> Result<Picture, Fault> {
    let planes = decode(file, |name| ["R", "G", "B"].contains(&name), |_| 1)?;
    let floats = |name| planes.floats(name);
    let (Some(red), Some(green), Some(blue)) = (floats("R"), floats("G"), floats("B")) else {
        return Err(Fault::Other("has no channels R, G and B".to_owned()));
    };
    let display = view.conversion();
    let [width, height] = planes.size;
    let mut rgb = Vec::with_capacity(3 * red.len());
    for (y, row) in (0_u32..).zip(0..height) {
        for (x, i) in (0_u32..).zip(row * width..(row + 1) * width) {
            let color = display(Vec3::new(red[i], green[i], blue[i]));
            let threshold = dither_threshold(x, y);
            rgb.extend(color.to_array().map(|v| byte_from_linear(v, threshold)));
        }
    }
    Ok(Picture::new(width, height, rgb))
}

/// Where the samples of a channel go.
#[derive(Clone, Copy)]
struct Target {
    part: usize,
    channel: usize,
    plane: usize,
}

/// Decodes the planes that `is_wanted` selects from all parts.
fn decode(
    file: impl Read + Seek,
    is_wanted: impl Fn(&str) -> bool,
    step_of: impl Fn(usize) -> usize,
) -> Result<SampledPlanes, Fault> {
    // Read the headers, and choose which pixels are kept
    let reader = exr::block::read(file, false)?;
    let meta = reader.meta_data().clone();
    let image_size = check(&meta)?;
    let step = step_of(image_size[0]).max(1);
    let size = image_size.map(|side| count(side, step));
    // Find the channels and allocate their planes
    let mut planes = Vec::new();
    let mut targets = Vec::new();
    for (part, header) in meta.headers.iter().enumerate() {
        for (channel, description) in header.channels.list.iter().enumerate() {
            let name = description.name.to_string();
            if !is_wanted(&name) {
                continue;
            }
            targets.push(Target { part, channel, plane: planes.len() });
            let samples = match description.sample_type {
                SampleType::U32 => PlaneSamples::Integer(vec![0; size[0] * size[1]]),
                _ => PlaneSamples::Float(vec![0.0; size[0] * size[1]]),
            };
            planes.push((name, samples));
        }
    }
    let mut sampled = SampledPlanes { size, image_size, step, planes };
    // Decode the blocks of their parts
    let is_read = |part: usize| targets.iter().any(|target| target.part == part);
    let chunks = reader.filter_chunks(false, |_, _, block| {
        is_read(block.layer) && block.level.x() == 0 && block.level.y() == 0
    })?;
    for chunk in chunks {
        let block = UncompressedBlock::decompress_chunk(chunk?, &meta, false)?;
        let channels = &meta.headers[block.index.layer].channels;
        for line in block.lines(channels) {
            let mut found = targets.iter();
            let found =
                found.find(|t| t.part == block.index.layer && t.channel == line.location.channel);
            if let Some(target) = found {
                let kind = channels.list[target.channel].sample_type;
                sampled.put(target.plane, &line, kind)?;
            }
        }
    }
    Ok(sampled)
}

/// Number of samples of a side.
const fn count(side: usize, step: usize) -> usize {
    // The first sample is at half a step, but there is always one
    let count = (side + step - 1 - step / 2) / step;
    if count == 0 { 1 } else { count }
}

impl SampledPlanes {
    /// Keeps the samples of `line` that belong to a plane.
    fn put(&mut self, plane: usize, line: &LineRef<'_>, kind: SampleType) -> Result<(), Fault> {
        let (x, y) = (line.location.position.x(), line.location.position.y());
        // The pixels of samples in a direction; the last pixel of sides shorter than half a step
        let half = |side: usize| (self.step / 2).min(side.saturating_sub(1));
        let [left, top] = self.image_size.map(half);
        let Some(below) = y.checked_sub(top).filter(|y| y % self.step == 0) else {
            return Ok(());
        };
        let start = below / self.step * self.size[0];
        let [width, step] = [self.size[0], self.step];
        let at = |i: usize| {
            let column = (x + i).checked_sub(left).filter(|x| x % step == 0)? / step;
            (column < width).then_some(start + column)
        };
        // Convert the samples that are kept
        match &mut self.planes[plane].1 {
            PlaneSamples::Integer(samples) => {
                for (i, value) in line.read_samples::<u32>().enumerate() {
                    let slot = at(i).and_then(|i| samples.get_mut(i));
                    if let (Some(slot), value) = (slot, value?) {
                        *slot = value;
                    }
                }
            }
            PlaneSamples::Float(samples) if kind == SampleType::F16 => {
                for (i, value) in line.read_samples::<half::f16>().enumerate() {
                    let slot = at(i).and_then(|i| samples.get_mut(i));
                    if let (Some(slot), value) = (slot, value?) {
                        *slot = value.to_f32();
                    }
                }
            }
            PlaneSamples::Float(samples) => {
                for (i, value) in line.read_samples::<f32>().enumerate() {
                    let slot = at(i).and_then(|i| samples.get_mut(i));
                    if let (Some(slot), value) = (slot, value?) {
                        *slot = value;
                    }
                }
            }
        }
        Ok(())
    }
}

/// Checks all parts, and returns their common size.
fn check(meta: &MetaData) -> Result<[usize; 2], Fault> {
    let size = |header: &Header| [header.layer_size.x(), header.layer_size.y()];
    let first = meta.headers.first().map(size);
    let Some(first) = first.filter(|first| meta.headers.iter().all(|h| size(h) == *first)) else {
        return Err(Fault::Other("has parts of several sizes".to_owned()));
    };
    check_size(first[0], first[1])?;
    let is_whole = |c: &ChannelDescription| c.sampling.x() == 1 && c.sampling.y() == 1;
    for header in &meta.headers {
        if header.deep || !header.channels.list.iter().all(is_whole) {
            return Err(Fault::Other("has deep or subsampled pixels".to_owned()));
        }
        if header.max_block_byte_size() as u64 > MAX_BLOCK_BYTES {
            return Err(Fault::Other("has blocks of more than 256 MiB".to_owned()));
        }
    }
    Ok(first)
}
