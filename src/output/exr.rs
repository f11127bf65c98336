//! OpenEXR by the crate `exr`: one part, planar channels, scanlines.
//!
//! `R G B A` are half, data channels float, `id.I` is uint. With scanlines in increasing order and
//! at most one custom attribute (several would be written in random order) a film always gives the
//! same bytes, however many threads compress. Nothing here looks at the clock.

use std::io::{self, Cursor, Seek, Write};

use exr::meta::attribute::SampleType;
use exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Blocks, Compression as Codec, Encoding, FlatSamples,
    Image, ImageAttributes, IntegerBounds, Layer, LayerAttributes, LineOrder, SmallVec, Text,
    WritableImage, f16,
};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::render::{Channels, Film};

/// Largest finite half.
const HALF_MAX: f32 = 65_504.0;

/// Longest attribute name the format has room for.
const NAME_MAX: usize = 255;

/// How an EXR file is compressed; all of these are lossless.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Compression {
    /// Not at all.
    None,
    /// Run lengths.
    Rle,
    /// Deflate over 16 rows.
    #[default]
    Zip,
    /// Deflate row by row: larger, but a viewer gets at single rows.
    Zips,
    /// Wavelets: good for grainy images.
    Piz,
}

/// The file's one attribute that the standard does not know.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CustomAttribute {
    /// Name, at most 255 bytes.
    pub name: String,
    /// A JSON text.
    pub json: String,
}

/// What goes into an EXR file beside the film.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ExrOptions {
    /// Compression of all channels.
    pub compression: Compression,
    /// `framesPerSecond` as numerator and denominator.
    pub frames_per_second: Option<(i32, u32)>,
    /// `worldToCamera`, from [`crate::scene::Camera::world_to_camera`].
    pub world_to_camera: Option<[f32; 16]>,
    /// `comments`.
    pub comments: Option<String>,
    /// One more attribute.
    pub custom: Option<CustomAttribute>,
    /// Compresses on one thread; by default on as many as the machine has. The bytes are the same.
    pub single_thread: bool,
}

/// An encoded image.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EncodedExr {
    /// The file.
    pub bytes: Vec<u8>,
    /// Values of `R G B A` that half cannot hold: beyond 65504 (written as that), or NaN (written as
    /// 0).
    pub clamped: u64,
}

/// Why an image cannot be encoded.
#[derive(Debug, Error)]
pub enum OutputError {
    /// The custom attribute cannot be stored.
    #[error("EXR attribute {name:?} cannot be stored: {why}")]
    Attribute {
        /// Which one.
        name: String,
        /// What is wrong with it.
        why: &'static str,
    },
    /// The EXR encoder refused.
    #[error("the image cannot be encoded as EXR: {0}")]
    Exr(#[source] exr::error::Error),
    /// The PNG encoder refused.
    #[error("the preview cannot be encoded as PNG: {0}")]
    Png(#[source] image::ImageError),
}

impl OutputError {
    /// What the system said, if the file could not be written; else the error itself.
    ///
    /// # Errors
    /// The encoder is to blame.
    pub fn into_io(self) -> Result<io::Error, Self> {
        match self {
            Self::Exr(exr::error::Error::Io(error)) => Ok(error),
            other => Err(other),
        }
    }
}

/// Encodes `film` as an OpenEXR file in memory.
///
/// # Errors
/// If an attribute cannot be stored or the encoder refuses the image.
pub fn encode_exr(film: &Film, options: &ExrOptions) -> Result<EncodedExr, OutputError> {
    let mut file = Cursor::new(Vec::new());
    let clamped = write_exr(film.clone(), options, &mut file)?;
    Ok(EncodedExr {
        bytes: file.into_inner(),
        clamped,
    })
}

/// Writes `film` as an OpenEXR file, block by block: the file is never in memory as a whole, and planes are
/// let go once the file has its own. Returns [`EncodedExr::clamped`].
///
/// # Errors
/// If an attribute cannot be stored, the encoder refuses the image, or `file` does.
pub fn write_exr(
    film: Film,
    options: &ExrOptions,
    file: &mut (impl Write + Seek),
) -> Result<u64, OutputError> {
    let size = (film.width as usize, film.height as usize);
    let (channels, clamped) = channels(film);
    let encoding = Encoding {
        compression: options.compression.codec(),
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let layer = Layer::new(size, attributes(options)?, encoding, channels);
    let window = IntegerBounds::from_dimensions(size);
    let image = Image::empty(ImageAttributes::new(window)).with_layer(layer);

    let writer = image.write();
    let result = if options.single_thread {
        writer.non_parallel().to_buffered(file)
    } else {
        writer.to_buffered(file)
    };
    result.map_err(OutputError::Exr)?;
    Ok(clamped)
}

impl Compression {
    const fn codec(self) -> Codec {
        match self {
            Self::None => Codec::Uncompressed,
            Self::Rle => Codec::RLE,
            Self::Zip => Codec::ZIP16,
            Self::Zips => Codec::ZIP1,
            Self::Piz => Codec::PIZ,
        }
    }
}

fn attributes(options: &ExrOptions) -> Result<LayerAttributes, OutputError> {
    let mut attributes = LayerAttributes {
        software_name: Some(Text::from(concat!("spherule ", env!("CARGO_PKG_VERSION")))),
        frames_per_second: options.frames_per_second,
        world_to_camera: options.world_to_camera,
        ..LayerAttributes::default()
    };
    attributes.comments = options.comments.as_deref().map(text);
    if let Some(CustomAttribute { name, json }) = &options.custom {
        let refuse = |why| OutputError::Attribute {
            name: name.clone(),
            why,
        };
        if name.is_empty() || name.len() > NAME_MAX {
            return Err(refuse("the name must have 1 to 255 bytes"));
        }
        if !name.is_ascii() || name.contains('\0') {
            return Err(refuse("the name must be ASCII"));
        }
        attributes
            .other
            .insert(text(name), AttributeValue::Text(text(json)));
    }
    Ok(attributes)
}

/// Texts are UTF-8 in the file; `exr` itself would write Latin-1.
fn text(value: &str) -> Text {
    Text::from_slice_unchecked(value.as_bytes())
}

type ChannelList = SmallVec<[AnyChannel<FlatSamples>; 4]>;

/// The film's planes as the file wants them, and how many values had to be clamped. Each is let go before
/// the next is turned.
fn channels(film: Film) -> (AnyChannels<FlatSamples>, u64) {
    let mut list = ChannelList::new();
    let mut clamped = 0;
    for (component, name) in ["R", "G", "B", "A"].into_iter().enumerate() {
        let values = film.color.iter().map(|color| color[component]);
        let halves = values.map(|value| to_half(value, &mut clamped)).collect();
        list.push(AnyChannel::new(name, FlatSamples::F16(halves)));
    }
    drop(film.color);
    if let Some(depth) = film.depth {
        list.push(AnyChannel::new("Z", FlatSamples::F32(depth)));
    }
    push_vectors(&mut list, ["N.X", "N.Y", "N.Z"], film.normal);
    push_vectors(&mut list, ["P.X", "P.Y", "P.Z"], film.position);
    push_vectors(&mut list, ["V.X", "V.Y", "V.Z"], film.velocity);
    let albedo = ["albedo.R", "albedo.G", "albedo.B"];
    push_vectors(&mut list, albedo, film.albedo);
    if let Some(id) = film.id {
        list.push(AnyChannel::new("id.I", FlatSamples::U32(id)));
    }
    (AnyChannels::sort(list), clamped)
}

/// Names and types of the planes in a file with `channels`.
pub(super) fn planes(channels: Channels) -> Vec<(String, SampleType)> {
    let vector = |has: bool, layer, axes: [&str; 3]| {
        let names = axes.map(|axis| (format!("{layer}.{axis}"), SampleType::F32));
        has.then_some(names).into_iter().flatten()
    };
    let mut all = ["R", "G", "B", "A"]
        .map(|name| (name.to_owned(), SampleType::F16))
        .to_vec();
    all.extend(channels.depth.then(|| ("Z".to_owned(), SampleType::F32)));
    all.extend(vector(channels.normal, "N", ["X", "Y", "Z"]));
    all.extend(vector(channels.position, "P", ["X", "Y", "Z"]));
    all.extend(vector(channels.velocity, "V", ["X", "Y", "Z"]));
    all.extend(vector(channels.albedo, "albedo", ["R", "G", "B"]));
    all.extend(channels.id.then(|| ("id.I".to_owned(), SampleType::U32)));
    all
}

fn push_vectors(list: &mut ChannelList, names: [&str; 3], plane: Option<Vec<Vec3>>) {
    let Some(plane) = plane else {
        return;
    };
    for (axis, name) in names.into_iter().enumerate() {
        let values = plane.iter().map(|v| v[axis]).collect();
        list.push(AnyChannel::new(name, FlatSamples::F32(values)));
    }
}

/// The nearest half, or the nearest finite one, counted.
fn to_half(value: f32, clamped: &mut u64) -> f16 {
    if value.abs() <= HALF_MAX {
        return f16::from_f32(value);
    }
    *clamped += 1;
    if value.is_nan() {
        f16::ZERO
    } else {
        f16::from_f32(HALF_MAX.copysign(value))
    }
}

#[cfg(test)]
#[path = "exr_tests.rs"]
mod tests;
