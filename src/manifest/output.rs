//! `[output]`: the images and their channels.

use serde_json::{Value as Json, json};

use super::key::{Key, section};
use super::pattern::OutputPattern;
use super::reader::Field;
use super::value::{Fault, Value, named, quoted};
use crate::output::Compression;

named! {
    /// Channels of an image.
    Channel {
        /// Colour and coverage, premultiplied.
        Rgba = "RGBA",
        /// Distance along the view axis.
        Z = "Z",
        /// Normal.
        N = "N",
        /// Particle id.
        Id = "id",
        /// Position in the world.
        P = "P",
        /// Velocity.
        V = "V",
        /// Base colour, before lighting.
        Albedo = "albedo",
    }
}

named!(Compression: None = "none", Rle = "rle", Zip = "zip", Zips = "zips", Piz = "piz");

/// Default names of images.
const DEFAULT_PATH: &str = "out/frame.####.exr";

section! {
    /// Images to write, and their channels
    Output {
        /// Images to write; #### or %04d is the frame number, with at least that many digits
        path: OutputPattern = OutputPattern::parse(DEFAULT_PATH).expect("a good pattern"),
            flag("output", "PATTERN", "Output");
        /// Channels of the images: RGBA,Z,N,id,P,V,albedo
        channels: Vec<Channel> = vec![Channel::Rgba, Channel::Z, Channel::N, Channel::Id],
            example("[\"RGBA\", \"Z\"]"), flag("channels", "LIST", "Output");
        /// Lossless compression of the EXR: none | rle | zip | zips | piz
        compression: Compression = Compression::Zip;
        /// Write a PNG next to each image
        preview: bool = true;
        /// Exposure of the PNG, stops
        preview_exposure: f32 = 0.0, from(-100), to(100), unit("stops");
        /// Leave the background out of the EXR, for compositing; previews show it
        transparent: bool = false;
        /// Frames per second, stored in the images
        fps: Option<f64> = None, above(0), example("24.0"), unset("not stored");
    }
}

impl Value for OutputPattern {
    fn kind(_: &Key) -> String {
        "text in quotes".to_owned()
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        let text = field.as_text().ok_or(Fault::Unwanted)?;
        Self::parse(text).map_err(Fault::Because)
    }

    fn toml(&self) -> String {
        quoted(self.as_str())
    }

    fn schema(_: &Key) -> Json {
        json!({ "type": "string", "pattern": r"[^/\\]\.[eE][xX][rR]$" })
    }

    /// Only the file name: a job may be moved together with its images.
    fn setting(&self) -> String {
        quoted(self.file_name())
    }
}
