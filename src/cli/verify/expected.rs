//! The expected outputs of a job, from the settings in its plan.

use std::collections::BTreeSet;

use spherule_jobs::Plan;

use crate::cli::pictures::may_have_strips;
use crate::job::KIND;
use crate::manifest::{
    ATTRIBUTE_CHANNEL as ATTRIBUTE, Camera, Image, PixelBounds, ProjectionKind, Side,
};
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
        let find = |name: &str| {
            let found = settings.iter().find(|(key, _)| key == name);
            found.map(|(_, value)| value.as_str())
        };
        if find(KIND).is_some() {
            return Ok(Self::Frames);
        }
        let value = |key: &str| {
            let table = format!("value = {}", find(key)?).parse::<toml::Table>();
            table.ok()?.remove("value")
        };
        let wrong = |key| InvalidSetting { key };
        let side = |key: &'static str| {
            let side = value(key).and_then(|v| u32::try_from(v.as_integer()?).ok());
            side.ok_or_else(|| wrong(key))
        };
        let channels = || {
            let list = value("output.channels")?;
            let names =
                list.as_array()?.iter().map(|name| name.as_str()).collect::<Option<Vec<_>>>()?;
            let attributes: Vec<String> = names
                .iter()
                .filter_map(|name| name.strip_prefix(ATTRIBUTE))
                .map(str::to_owned)
                .collect();
            let is_named = |name: &&str| !name.starts_with(ATTRIBUTE);
            let mut channels = Channels::from_names(names.into_iter().filter(is_named)).ok()?;
            // Jobs of earlier versions have no levels
            if let Some(levels) = value("output.cryptomatte_levels") {
                let levels = u32::try_from(levels.as_integer()?).ok()?;
                channels.layers.mattes.set_levels(levels);
            }
            // Settings have the groups only if there are layers for them
            let is_group = |key: &str| {
                let light = key.strip_prefix("light.").and_then(|key| key.split_once('.'));
                key == "environment.group" || light.is_some_and(|(_, name)| name == "group")
            };
            let keys = settings.iter().filter(|(key, _)| is_group(key));
            let names = keys.map(|(key, _)| Some(value(key)?.as_str()?.to_owned()));
            let groups = names.collect::<Option<BTreeSet<String>>>()?;
            channels.layers.set_light_groups(groups.len());
            Some((channels, attributes, groups.into_iter().collect()))
        };
        // Plans of older versions have neither crop nor overscan
        let crop = find("image.crop").map(|_| {
            let list = value("image.crop")?;
            let pixel = |v: &toml::Value| i32::try_from(v.as_integer()?).ok();
            let pixels: Option<Vec<i32>> = list.as_array()?.iter().map(pixel).collect();
            pixels?.try_into().ok().map(PixelBounds)
        });
        let crop = crop.map(|crop| crop.ok_or_else(|| wrong("image.crop")));
        let image = Image {
            width: Side::Pixels(side("image.width")?),
            height: Side::Pixels(side("image.height")?),
            crop: crop.transpose()?,
            overscan: match find("image.overscan") {
                Some(_) => side("image.overscan")?,
                None => 0,
            },
            ..Image::default()
        };
        // Plans of older versions have one eye
        let camera = Camera {
            stereo: find("camera.stereo") == Some("true"),
            projection: match find("camera.projection") {
                Some("\"equirectangular\"") => ProjectionKind::Equirectangular,
                _ => ProjectionKind::Perspective,
            },
            ..Camera::default()
        };
        let image = image.of_eyes(camera.eyes());
        let [width, height] = image.data_size().ok_or_else(|| wrong("image.crop"))?;
        let (channels, attributes, light_groups) =
            channels().ok_or_else(|| wrong("output.channels"))?;
        Ok(Self::Images(ImageShape {
            width,
            height,
            window: image.data_window(),
            channels,
            attributes,
            light_groups,
            has_data_part: find("output.data_compression")
                .is_some_and(|data| find("output.compression") != Some(data)),
            is_on_page: may_have_strips(settings),
        }))
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
