//! The layout of an image in its file: parts with their headers, channels, and blocks of rows.

use exr::image::write::layers::WritableLayers;
use exr::meta::attribute::Chromaticities;
use exr::meta::header::Header;
use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression as Codec, Encoding, FlatSamples, ImageAttributes,
    IntegerBounds, Layer, LayerAttributes, LineOrder, SampleType, Text, Vec2,
};

use super::planes::{ExrChannel, channels_in_file, parts};
use super::{Compression, ExrOptions, OutputError, TextAttribute, attributes};
use crate::render::{Channels, DataWindow, Film, FilmRows};

/// Minimum number of rows in a band: the height of the renderer's tiles.
const BAND_ROWS: u32 = 16;

/// Primaries and white of all colours: those of sRGB and Rec. 709.
pub(super) const PRIMARIES: Chromaticities = Chromaticities {
    red: Vec2(0.64, 0.33),
    green: Vec2(0.30, 0.60),
    blue: Vec2(0.15, 0.06),
    white: Vec2(0.3127, 0.3290),
};

/// Names of the parts of a file with several ones: of colours, and of data.
const PART_NAMES: [&str; 2] = ["color", "data"];

/// The layout of an image file, which all of its blocks share.
#[derive(Debug, Clone)]
pub struct ExrLayout {
    pub(super) parts: Vec<ExrPart>,
}

/// The layout of a part of an image file: some of its channels.
#[derive(Debug, Clone)]
pub(super) struct ExrPart {
    pub(super) header: Header,
    pub(super) compression: Compression,
    /// The channels in the order of the file.
    pub(super) channels: Vec<ExrChannel>,
    /// Attributes after those of `header`, in the order of the file.
    pub(super) texts: Vec<TextAttribute>,
}

/// A block of rows in a part of an image.
#[derive(Debug, Clone, Copy)]
pub struct ExrBlock<'a> {
    /// Index of the part.
    pub(super) part: usize,
    pub(super) rows: FilmRows<'a>,
}

impl ExrLayout {
    /// The layout of images of `width` x `height` pixels with `channels`.
    ///
    /// # Errors
    /// If an attribute cannot be stored.
    pub fn new(
        width: u32,
        height: u32,
        channels: Channels,
        options: &ExrOptions,
    ) -> Result<Self, OutputError> {
        // Divide the channels between parts
        let in_file = channels_in_file(channels, &options.names);
        let parts = parts(in_file, options.has_data_part());
        let count = parts.len();
        let data = options.data_compression.unwrap_or(options.compression);
        let names = PART_NAMES.into_iter().zip([options.compression, data]);
        // Make a header for each part
        let mut all = Vec::new();
        for (channels, (name, compression)) in parts.into_iter().zip(names) {
            let mut attributes = attributes(options)?;
            attributes.layer_name = (count > 1).then(|| Text::from(name));
            all.push(ExrPart {
                header: header(width, height, &channels, compression, attributes, options),
                compression,
                channels,
                texts: Vec::new(),
            });
        }
        // They describe data
        if let Some(last) = all.last_mut() {
            last.texts.clone_from(&options.texts);
        }
        Ok(Self { parts: all })
    }

    /// The layout of images with the size and the channels of `film`.
    ///
    /// # Errors
    /// If an attribute cannot be stored.
    pub fn of(film: &Film, options: &ExrOptions) -> Result<Self, OutputError> {
        Self::new(film.width, film.height, film.channels(), options)
    }

    /// Number of rows in a band, the unit of work of a thread: one or more whole blocks of each part.
    pub fn rows_per_band(&self) -> u32 {
        let rows = self.parts.iter().map(ExrPart::rows_per_block);
        rows.fold(BAND_ROWS, u32::max)
    }

    /// The blocks of `band`, part by part. It must begin and end at the border of a block.
    pub fn blocks<'a>(&self, band: FilmRows<'a>) -> impl Iterator<Item = ExrBlock<'a>> + use<'a> {
        let rows: Vec<u32> = self.parts.iter().map(ExrPart::rows_per_block).collect();
        rows.into_iter().enumerate().flat_map(move |(part, rows)| {
            let tops = (band.top..band.top + band.height).step_by(rows as usize);
            tops.map(move |top| ExrBlock { part, rows: band.part(top, rows) })
        })
    }
}

/// The header of a part.
fn header(
    width: u32,
    height: u32,
    channels: &[ExrChannel],
    compression: Compression,
    mut attributes: LayerAttributes,
    options: &ExrOptions,
) -> Header {
    // Describe the channels; the header needs only names and types, so the samples may be empty
    let described = channels.iter().map(|channel| {
        let samples = match channel.sample_type() {
            SampleType::F16 => FlatSamples::F16(Vec::new()),
            SampleType::F32 => FlatSamples::F32(Vec::new()),
            SampleType::U32 => FlatSamples::U32(Vec::new()),
        };
        AnyChannel::new(&*channel.name, samples)
    });
    let encoding = Encoding {
        compression: compression.codec(),
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let size = (width as usize, height as usize);
    let described = AnyChannels::sort(described.collect());
    // Place it in the image
    let DataWindow { left, top, image } =
        options.window.unwrap_or(DataWindow::whole(width, height));
    attributes.layer_position = Vec2(left, top);
    let layer = Layer::new(size, attributes, encoding, described);
    let display = IntegerBounds::from_dimensions((image[0] as usize, image[1] as usize));
    let image =
        ImageAttributes { chromaticities: Some(PRIMARIES), ..ImageAttributes::new(display) };
    layer.infer_headers(&image).remove(0)
}

impl ExrPart {
    /// Row of the image in which the film begins.
    pub(super) fn top(&self) -> i32 {
        self.header.own_attributes.layer_position.y()
    }

    /// Number of rows in a block: 1, 16 or 32. The last block of an image may have fewer.
    fn rows_per_block(&self) -> u32 {
        self.compression.rows_per_block()
    }

    /// Number of bytes of all samples in `rows` rows.
    pub(super) fn bytes(&self, rows: u32) -> usize {
        self.header.layer_size.x() * rows as usize * self.header.channels.bytes_per_pixel
    }
}

impl ExrOptions {
    /// Number of rows in a band of a film with these options, see [`ExrLayout::rows_per_band`].
    pub(super) fn rows_per_band(&self) -> u32 {
        let data = self.data_compression.map_or(0, Compression::rows_per_block);
        BAND_ROWS.max(self.compression.rows_per_block()).max(data)
    }
}

impl Compression {
    /// Number of rows that are compressed together.
    fn rows_per_block(self) -> u32 {
        let rows = self.codec().scan_lines_per_block();
        u32::try_from(rows).expect("blocks have at most 256 rows")
    }

    pub(super) const fn codec(self) -> Codec {
        match self {
            Self::None => Codec::Uncompressed,
            Self::Rle => Codec::RLE,
            Self::Zip => Codec::ZIP16,
            Self::Zips => Codec::ZIP1,
            Self::Piz => Codec::PIZ,
        }
    }
}
