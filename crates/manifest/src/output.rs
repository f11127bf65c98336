//! `[output]`: the images and their channels.

use serde_json::{Value as Json, json};
use spherule_images::output::Compression;
use spherule_images::output::view::ViewTransform;
use spherule_tracer::render::layers::{DEFAULT_MATTE_LEVELS, MAX_MATTE_LEVELS};
use spherule_tracer::render::{FilmPlane, NamedChannel};

use super::channel::Channel;
use super::field::Field;
use super::key::Key;
use super::keys::section;
use super::pattern::OutputPattern;
use super::value::{Fault, Named, Value, named, quoted};

named!(Compression: None = "none", Rle = "rle", Zip = "zip", Zips = "zips", Piz = "piz");

impl Named for ViewTransform {
    fn names() -> Vec<(Self, &'static str)> {
        Self::NAMES.to_vec()
    }
}

/// Default channels.
const DEFAULT_CHANNELS: [NamedChannel; 4] = [
    NamedChannel::Rgba,
    NamedChannel::Plane(FilmPlane::Depth),
    NamedChannel::Plane(FilmPlane::Normal),
    NamedChannel::Plane(FilmPlane::Id),
];

/// Default names of images.
const DEFAULT_PATH: &str = "out/frame.####.exr";

section! {
    /// Images to write, and their channels
    Output {
        /// Images to write; #### or %04d is the frame number, with at least that many digits
        ///
        /// A name that ends in .png has only the picture: no EXR, no other channels.
        path: OutputPattern = OutputPattern::parse(DEFAULT_PATH).expect("a good pattern"),
            flag("output", "PATTERN", "Output");
        /// Channels: RGBA,Z,N,id,P,V,albedo,lights,light_groups,shadow,motion,cryptomatte,overlay,attribute:NAME
        ///
        /// RGBA is always included. `lights` stands for the light channels diffuse, specular, reflection, refraction,
        /// emission and background, whose sum is `noisy`, the colour before denoising. `light_groups` has a layer for
        /// each `group` of lights, with the same sum. `cryptomatte` stands for crypto_particle, crypto_material and
        /// crypto_part. `overlay` is what `[[overlay]]` draws over previews, linear with alpha. `attribute:density` is
        /// the attribute `density`.
        channels: Vec<Channel> = DEFAULT_CHANNELS.map(Channel::Named).to_vec(),
            example("[\"RGBA\", \"Z\"]"), flag("channels", "LIST", "Output");
        /// Maximum number of objects in a pixel of each Cryptomatte layer, rounded up to an even number
        cryptomatte_levels: u32 = u32::from(DEFAULT_MATTE_LEVELS), from(2), to(MAX_MATTE_LEVELS);
        /// Lossless compression of the EXR: none | rle | zip | zips | piz
        compression: Compression = Compression::Zip;
        /// Lossless compression of data channels: none | rle | zip | zips | piz
        ///
        /// If it differs from `compression`, the EXR has two parts: `color` (RGBA, light channels, light groups, noisy)
        /// and `data` (all other channels).
        data_compression: Option<Compression> = None, example("\"zips\""), unset("the same as compression");
        /// Write a PNG next to each EXR
        preview: bool = true;
        /// Exposure of the PNG, stops
        preview_exposure: f32 = 0.0, from(-100), to(100), unit("stops");
        /// How previews and stills show light: neutral | none | agx | aces
        ///
        /// neutral leaves colours up to white as they are, so that those of a colour map match its legend, and lets
        /// brighter ones fade to white. none cuts off what is brighter than white. agx and aces compress light as film
        /// does: for pictures without a colour map. aces has the tone scale of ACES 2.0. The EXR does not change.
        view_transform: ViewTransform = ViewTransform::Neutral;
        /// Omit the background, for compositing: the EXR and the PNG have alpha
        transparent: bool = false, flag("transparent", "", "Output");
        /// Z where nothing is hit, such as 1e10
        ///
        /// Filters and resizing can turn infinite values into NaN. Blender writes 1e10.
        far_depth: Option<f32> = None, or("infinite"), above(0), single(), unit("a distance");
        /// Time from one frame to the next, for the channel motion
        ///
        /// In the unit of time of the velocities. By default, it comes from the times in the files, or is 1 / fps.
        frame_time: Option<f64> = None, above(0), example("0.04"), unset("from the files, or 1 / fps");
        /// Frames per second, stored in the images
        fps: Option<f64> = None, above(0), example("24.0"), unset("not stored");
    }
}

impl Output {
    /// Whether a PNG is written next to each image.
    pub fn has_previews(&self) -> bool {
        self.preview && !self.path.is_png()
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
        json!({ "type": "string", "pattern": r"[^/\\]\.([eE][xX][rR]|[pP][nN][gG])$" })
    }

    /// Only the file name: a job may be moved together with its images.
    fn setting(&self) -> String {
        quoted(self.file_name())
    }
}
