//! The expected outputs of a job, from the settings in its plan.

use std::collections::BTreeSet;

use spherule_jobs::Plan;

use crate::cli::pictures::may_have_strips;
use crate::job::KIND;
use crate::manifest::{Camera, Channel, Image, PixelBounds, ProjectionKind, Side};
use crate::output::ImageShape;
use crate::render::Channels;

/// The kind of files that a job writes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum ExpectedOutput {
    /// Images, and previews of the same size.
    Images(ImageShape),
    /// Native frames.
    Frames,
}

/// A setting of the plan is missing or invalid.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
#[error("the plan's setting {key} is missing or invalid")]
pub(super) struct InvalidSetting {
    key: &'static str,
}

impl ExpectedOutput {
    /// Reads the settings of `plan`.
    ///
    /// # Errors
    /// A setting is missing or invalid.
    pub(super) fn of(plan: &Plan) -> Result<Self, InvalidSetting> {
        Self::of_settings(plan.settings())
    }

    fn of_settings(settings: &[(String, String)]) -> Result<Self, InvalidSetting> {
        let stored = StoredSettings(settings);
        if stored.find(KIND).is_some() {
            return Ok(Self::Frames);
        }
        let image = stored.image()?.of_eyes(stored.camera().eyes());
        let [width, height] = image.data_size().ok_or(InvalidSetting { key: "image.crop" })?;
        let found = stored.channels().ok_or(InvalidSetting { key: "output.channels" })?;
        Ok(Self::Images(ImageShape {
            width,
            height,
            window: image.data_window(),
            channels: found.channels,
            attributes: found.attributes,
            light_groups: found.light_groups,
            has_data_part: stored
                .find("output.data_compression")
                .is_some_and(|data| stored.find("output.compression") != Some(data)),
            is_on_page: may_have_strips(settings),
        }))
    }
}

/// The settings of a plan: keys of the manifest, and their values as TOML.
#[derive(Clone, Copy)]
struct StoredSettings<'a>(&'a [(String, String)]);

/// The channels of images, with the names that some of them follow from.
struct StoredChannels {
    channels: Channels,
    attributes: Vec<String>,
    light_groups: Vec<String>,
}

impl<'a> StoredSettings<'a> {
    fn find(self, name: &str) -> Option<&'a str> {
        let found = self.0.iter().find(|(key, _)| key == name);
        found.map(|(_, value)| value.as_str())
    }

    fn value(self, key: &str) -> Option<toml::Value> {
        let table = format!("value = {}", self.find(key)?).parse::<toml::Table>();
        table.ok()?.remove("value")
    }

    /// A number of pixels.
    fn side(self, key: &'static str) -> Result<u32, InvalidSetting> {
        let side = self.value(key).and_then(|v| u32::try_from(v.as_integer()?).ok());
        side.ok_or(InvalidSetting { key })
    }

    /// The size and the parts of the image. Plans of older versions have neither crop nor overscan.
    fn image(self) -> Result<Image, InvalidSetting> {
        let crop = self.find("image.crop").map(|_| {
            let list = self.value("image.crop")?;
            let pixel = |v: &toml::Value| i32::try_from(v.as_integer()?).ok();
            let pixels: Option<Vec<i32>> = list.as_array()?.iter().map(pixel).collect();
            pixels?.try_into().ok().map(PixelBounds)
        });
        let known_crop = crop.map(|crop| crop.ok_or(InvalidSetting { key: "image.crop" }));
        Ok(Image {
            width: Side::Pixels(self.side("image.width")?),
            height: Side::Pixels(self.side("image.height")?),
            crop: known_crop.transpose()?,
            overscan: match self.find("image.overscan") {
                Some(_) => self.side("image.overscan")?,
                None => 0,
            },
            ..Image::default()
        })
    }

    /// The camera, as far as it decides how many eyes share an image. Plans of older versions have one eye.
    fn camera(self) -> Camera {
        Camera {
            stereo: self.find("camera.stereo") == Some("true"),
            projection: match self.find("camera.projection") {
                Some("\"equirectangular\"") => ProjectionKind::Equirectangular,
                _ => ProjectionKind::Perspective,
            },
            ..Camera::default()
        }
    }

    /// The channels; None if a setting that they follow from is missing or invalid.
    fn channels(self) -> Option<StoredChannels> {
        let list = self.value("output.channels")?;
        let names = list.as_array()?.iter().map(|name| Channel::from_name(name.as_str()?));
        let list: Vec<Channel> = names.collect::<Option<_>>()?;
        let mut channels = Channels::of(list.iter().filter_map(Channel::named));
        // Jobs of earlier versions have no levels
        if let Some(levels) = self.value("output.cryptomatte_levels") {
            let levels = u32::try_from(levels.as_integer()?).ok()?;
            channels.layers.set_matte_levels(levels);
        }
        let light_groups = self.light_groups()?;
        channels.layers.set_light_groups(light_groups.len());
        Some(StoredChannels {
            channels,
            attributes: list.iter().filter_map(Channel::attribute).map(str::to_owned).collect(),
            light_groups: light_groups.into_iter().collect(),
        })
    }

    /// The groups of lights. Settings have them only if there are layers for them.
    fn light_groups(self) -> Option<BTreeSet<String>> {
        let is_group = |key: &str| {
            let light = key.strip_prefix("light.").and_then(|key| key.split_once('.'));
            key == "environment.group" || light.is_some_and(|(_, name)| name == "group")
        };
        let keys = self.0.iter().filter(|(key, _)| is_group(key));
        keys.map(|(key, _)| Some(self.value(key)?.as_str()?.to_owned())).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manifest::Manifest;
    use crate::render::DataWindow;

    fn set(settings: &mut [(String, String)], key: &str, value: &str) {
        let found = settings.iter_mut().find(|(k, _)| k == key);
        found.unwrap().1 = value.to_owned();
    }

    #[test]
    fn outputs_of_a_render() {
        let mut settings = Manifest::new("data").settings();
        let shape = ImageShape {
            width: 1920,
            height: 1080,
            window: DataWindow::whole(1920, 1080),
            channels: Channels::from_names(["Z", "N", "id"]).unwrap(),
            attributes: Vec::new(),
            light_groups: Vec::new(),
            has_data_part: false,
            is_on_page: false,
        };
        assert_eq!(
            ExpectedOutput::of_settings(&settings),
            Ok(ExpectedOutput::Images(shape.clone()))
        );
        for (key, value) in [
            ("image.width", "-3"),
            ("image.height", "\"1080\""),
            ("image.height", "]"),
            ("output.channels", "[\"RGBA\", \"depth\"]"),
            ("output.channels", "[3]"),
        ] {
            let mut wrong = settings.clone();
            set(&mut wrong, key, value);
            let error = ExpectedOutput::of_settings(&wrong).unwrap_err();
            assert_eq!(error, InvalidSetting { key });
        }
        // A part of the image, and margins around it
        let mut part = settings.clone();
        part.push(("image.crop".to_owned(), "[-5, 10, 100, 50]".to_owned()));
        set(&mut part, "image.overscan", "5");
        let expected = ImageShape {
            width: 105,
            height: 40,
            window: DataWindow { left: -5, top: 10, image: [1920, 1080] },
            ..shape.clone()
        };
        assert_eq!(ExpectedOutput::of_settings(&part), Ok(ExpectedOutput::Images(expected)));
        for wrong in ["[1, 2, 3]", "[1, 2, 1, 4]", "7"] {
            set(&mut part, "image.crop", wrong);
            let error = ExpectedOutput::of_settings(&part).unwrap_err();
            assert_eq!(error.key, "image.crop", "{wrong}");
        }
        settings.retain(|(key, _)| key != "image.overscan");
        assert_eq!(ExpectedOutput::of_settings(&settings), Ok(ExpectedOutput::Images(shape)));
        settings.retain(|(key, _)| key != "image.width");
        assert!(ExpectedOutput::of_settings(&settings).is_err());
    }

    #[test]
    fn outputs_of_a_conversion() {
        let settings = [(KIND.to_owned(), "convert".to_owned())];
        assert_eq!(ExpectedOutput::of_settings(&settings), Ok(ExpectedOutput::Frames));
    }
}
