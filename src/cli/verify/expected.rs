//! The expected outputs of a job, from the settings in its plan.

use spherule_jobs::Plan;

use crate::cli::job::KIND;
use crate::output::ImageShape;
use crate::render::Channels;

/// The kind of files that a job writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
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
        let find = |wanted: &str| {
            let found = settings.iter().find(|(key, _)| key == wanted);
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
            let names = list.as_array()?.iter().map(|name| name.as_str());
            Channels::from_names(names.collect::<Option<Vec<_>>>()?).ok()
        };
        Ok(Self::Images(ImageShape {
            width: side("image.width")?,
            height: side("image.height")?,
            channels: channels().ok_or_else(|| wrong("output.channels"))?,
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manifest::Manifest;

    fn set(settings: &mut [(String, String)], key: &str, value: &str) {
        let found = settings.iter_mut().find(|(k, _)| k == key);
        found.unwrap().1 = value.to_owned();
    }

    #[test]
    fn outputs_of_a_render() {
        let mut settings = Manifest::new("data").settings();
        let wanted = ImageShape {
            width: 1920,
            height: 1080,
            channels: Channels::from_names(["Z", "N", "id"]).unwrap(),
        };
        assert_eq!(
            ExpectedOutput::of_settings(&settings),
            Ok(ExpectedOutput::Images(wanted))
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
        settings.retain(|(key, _)| key != "image.width");
        assert!(ExpectedOutput::of_settings(&settings).is_err());
    }

    #[test]
    fn outputs_of_a_conversion() {
        let settings = [(KIND.to_owned(), "convert".to_owned())];
        assert_eq!(
            ExpectedOutput::of_settings(&settings),
            Ok(ExpectedOutput::Frames)
        );
    }
}
