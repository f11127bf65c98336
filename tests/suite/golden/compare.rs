//! Two images channel by channel, and pictures of where they differ.

use std::collections::BTreeSet;
use std::env;
use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

use spherule::output::{PreviewOptions, encode_preview};
use spherule::render::{Channels, Film};

use crate::picture::{Picture, Plane};

/// What two images may differ by and still be the same.
pub(super) struct Limits {
    /// Of `R G B A`: two steps of half just under 1.
    pub(super) color: f32,
    /// Of data channels, relative to the value where that is above 1.
    pub(super) data: f32,
    /// Pixels of a channel that may be off further: an edge that falls on the other side of a sample.
    pub(super) pixels: usize,
}

/// Machines differ in the last bit of a hit (the portable kernel) and of `powf`; at
/// silhouettes that can turn a sample over.
pub(super) const LIMITS: Limits = Limits { color: 0.002, data: 1e-5, pixels: 3 };

/// A channel that is not the same.
pub(super) struct Difference {
    pub(super) channel: String,
    what: String,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "  {}: {}", self.channel, self.what)
    }
}

/// The channels in which `actual` is not `expected`.
pub(super) fn differences(
    expected: &Picture,
    actual: &Picture,
    limits: &Limits,
) -> Vec<Difference> {
    if (expected.width, expected.height) != (actual.width, actual.height) {
        return vec![Difference {
            channel: "size".to_owned(),
            what: format!("{}x{}", actual.width, actual.height),
        }];
    }
    let names: BTreeSet<&String> = expected.planes.keys().chain(actual.planes.keys()).collect();
    let one = |name: &String| {
        let what = match (expected.planes.get(name), actual.planes.get(name)) {
            (Some(a), Some(b)) => compare(name, a, b, expected.width, limits)?,
            (None, _) => "is new".to_owned(),
            (_, None) => "is missing".to_owned(),
        };
        let channel = name.clone();
        Some(Difference { channel, what })
    };
    names.into_iter().filter_map(one).collect()
}

/// How a plane is off, if it is.
fn compare(name: &str, a: &Plane, b: &Plane, width: usize, limits: &Limits) -> Option<String> {
    let beyond: Vec<(usize, String)> = match (a, b) {
        (Plane::Float(a), Plane::Float(b)) => {
            let allowed = |expected: f32| {
                if ["R", "G", "B", "A"].contains(&name) {
                    limits.color
                } else {
                    limits.data * expected.abs().max(1.0)
                }
            };
            let pairs = a.iter().zip(b).enumerate();
            // Infinite depths are equal but have no difference; NaN is never right.
            pairs
                .filter(|(_, (a, b))| !(a == b || (**a - **b).abs() <= allowed(**a)))
                .map(|(at, (a, b))| (at, format!("{b} for {a}")))
                .collect()
        }
        (Plane::Uint(a), Plane::Uint(b)) => {
            let pairs = a.iter().zip(b).enumerate().filter(|(_, (a, b))| a != b);
            pairs.map(|(at, (a, b))| (at, format!("{b} for {a}"))).collect()
        }
        _ => return Some("has another type".to_owned()),
    };
    let (at, example) = beyond.first().filter(|_| beyond.len() > limits.pixels)?;
    let (x, y) = (at % width, at / width);
    Some(format!("{} pixels differ, as ({x}, {y}): {example}", beyond.len()))
}

/// Writes both images and their difference as PNG: colours always, and every data channel that
/// differs. Returns the folder.
pub(super) fn write_failure(
    name: &str,
    expected: &Picture,
    actual: &Picture,
    differing: &[Difference],
) -> PathBuf {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent();
    let folder = target.expect("the target directory").join("golden-failures");
    fs::create_dir_all(&folder).expect("a folder for failures");
    let colors = [["R", "G", "B"].map(str::to_owned)];
    let data = differing
        .iter()
        .map(|d| &d.channel)
        .filter(|c| !["R", "G", "B"].contains(&c.as_str()))
        .map(|c| [0; 3].map(|_| c.clone()));
    for channels in colors.into_iter().chain(data) {
        let label = if channels[0] == "R" { String::new() } else { format!("{}-", channels[0]) };
        let range = range(expected, &channels);
        let (before, after) = (shown(expected, &channels, range), shown(actual, &channels, range));
        let apart = before.iter().zip(&after).map(|(a, b)| {
            // Made visible: a hundredth is a clear grey.
            std::array::from_fn(|c| ((a[c] - b[c]).abs() * 16.0).min(1.0))
        });
        let apart: Vec<[f32; 3]> = apart.collect();
        for (kind, pixels) in [("expected", &before), ("actual", &after), ("difference", &apart)] {
            let path = folder.join(format!("{name}-{label}{kind}.png"));
            fs::write(path, png(pixels, expected)).expect("a picture of a failure");
        }
    }
    folder
}

/// The finite range of data channels; colours are shown as they are.
fn range(picture: &Picture, channels: &[String; 3]) -> (f32, f32) {
    if channels[0] == "R" {
        return (0.0, 1.0);
    }
    let values = values(picture, &channels[0]);
    let finite = values.iter().filter(|v| v.is_finite());
    let range = finite.fold((f32::MAX, f32::MIN), |(a, b), v| (a.min(*v), b.max(*v)));
    if range.0 < range.1 { range } else { (range.0, range.0 + 1.0) }
}

fn values(picture: &Picture, channel: &str) -> Vec<f32> {
    match picture.planes.get(channel) {
        Some(Plane::Float(values)) => values.clone(),
        Some(Plane::Uint(values)) => values.iter().map(|v| *v as f32).collect(),
        None => vec![0.0; picture.width * picture.height],
    }
}

fn shown(picture: &Picture, channels: &[String; 3], (low, high): (f32, f32)) -> Vec<[f32; 3]> {
    let planes = channels.each_ref().map(|c| values(picture, c));
    let scaled = |v: f32| ((v - low) / (high - low)).clamp(0.0, 1.0);
    let pixel = |i| std::array::from_fn(|c| scaled(planes[c].get(i).copied().unwrap_or(0.0)));
    (0..picture.width * picture.height).map(pixel).collect()
}

fn png(pixels: &[[f32; 3]], like: &Picture) -> Vec<u8> {
    let side = |length: usize| u32::try_from(length).expect("a small picture");
    let mut film = Film::new(side(like.width), side(like.height), Channels::COLOR);
    for (slot, [r, g, b]) in film.color.iter_mut().zip(pixels) {
        *slot = [*r, *g, *b, 1.0];
    }
    encode_preview(&film, &PreviewOptions::default(), &[]).expect("a picture")
}
