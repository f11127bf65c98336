//! `[output]`: which images, with what in them.

use super::named;
use super::pattern::OutputPattern;
use super::reader::{Field, Section};
use super::write::{Entries, Toml};

named! {
    /// What an image can hold.
    Channel {
        /// Colour and coverage, premultiplied.
        Rgba = "RGBA",
        /// Distance along the view axis.
        Z = "Z",
        /// Normal.
        N = "N",
        /// Particle.
        Id = "id",
        /// Position in the world.
        P = "P",
        /// Velocity.
        V = "V",
        /// Colour before light.
        Albedo = "albedo",
    }
}

named! {
    /// How an EXR file is compressed, without loss.
    Compression {
        /// Not.
        None = "none",
        /// By runs.
        Rle = "rle",
        /// 16 lines at a time.
        Zip = "zip",
        /// Each line alone.
        Zips = "zips",
        /// By wavelets: good for noise.
        Piz = "piz",
    }
}

/// `[output]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Output {
    /// Names of the images; relative to the manifest.
    pub path: OutputPattern,
    /// What is in them; each once, never empty.
    pub channels: Vec<Channel>,
    /// How they are compressed.
    pub compression: Compression,
    /// Whether a PNG is written beside each image.
    pub preview: bool,
    /// Brightness of the PNG, stops.
    pub preview_exposure: f32,
    /// Leaves the background out of the images, so that they lie over others; previews show it.
    pub transparent: bool,
    /// Frames per second, noted in the images.
    pub fps: Option<f64>,
}

impl Default for Output {
    fn default() -> Self {
        Self {
            path: OutputPattern::parse("out/frame.####.exr").expect("a good pattern"),
            channels: vec![Channel::Rgba, Channel::Z, Channel::N, Channel::Id],
            compression: Compression::Zip,
            preview: true,
            preview_exposure: 0.0,
            transparent: false,
            fps: None,
        }
    }
}

impl Output {
    pub(super) fn read(mut section: Section<'_>) -> Self {
        let default = Self::default();
        let output = Self {
            path: section.value("path", default.path, |f| {
                OutputPattern::parse(&f.text()?)
                    .map_err(|what| f.fail(&what))
                    .ok()
            }),
            channels: section.value("channels", default.channels, read_channels),
            compression: section.value("compression", default.compression, |f| {
                f.choice(Compression::ALL)
            }),
            preview: section.value("preview", default.preview, Field::bool),
            preview_exposure: section.value("preview_exposure", default.preview_exposure, |f| {
                f.number32("stops from -100 to 100", |v| v.abs() <= 100.0)
            }),
            transparent: section.value("transparent", default.transparent, Field::bool),
            fps: section.optional("fps", |f| f.number("a number above 0", |v| v > 0.0)),
        };
        section.finish();
        output
    }

    pub(super) fn entries(&self, out: &mut Entries) {
        out.section("output");
        out.put(
            "path",
            self.path.as_str(),
            "#### or %04d is the frame number",
        );
        // A job may be moved together with its images.
        out.depends_on(Some(self.path.file_name().toml()));
        out.put("channels", &self.channels, "RGBA, Z, N, id, P, V, albedo");
        out.put(
            "compression",
            &self.compression,
            "none | rle | zip | zips | piz",
        );
        out.put("preview", &self.preview, "PNG beside each image");
        out.put("preview_exposure", &self.preview_exposure, "stops");
        out.put(
            "transparent",
            &self.transparent,
            "leaves the background out of the EXR, to lay it over something else",
        );
        out.maybe(
            "fps",
            self.fps.as_ref(),
            "24.0",
            "frames per second, noted in the images",
        );
    }
}

fn read_channels(field: &Field<'_>) -> Option<Vec<Channel>> {
    let items = field.items().filter(|items| !items.is_empty());
    let items = field.or_wants(items, "a list of channels, as [\"RGBA\", \"Z\"]")?;
    let mut channels = Vec::new();
    for item in items {
        let channel = item.choice(Channel::ALL)?;
        if channels.contains(&channel) {
            item.fail(&format!("{} is there twice", channel.name()));
            return None;
        }
        channels.push(channel);
    }
    Some(channels)
}
