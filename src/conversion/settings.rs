//! The settings of a conversion: those of the user, and those from the survey of the sequence.

use glam::DVec3;
use spherule_files::Bytes;
use spherule_formats::native::layout::VERSION;
use spherule_formats::native::{Bound, Encoding};

use super::attributes::AttributeChoices;
use super::error::UnknownAttribute;
use crate::survey::{Question, RadiusQuestion, Survey};

/// The settings of the user.
#[derive(Debug, Clone, PartialEq)]
pub struct ConvertSettings {
    /// Encoding of positions; `None` uses the smallest one within the bound.
    pub encoding: Option<Encoding>,
    /// Error bound of positions.
    pub bound: Bound,
    /// Replaces the radii of the files, scene units.
    pub radius: Option<f32>,
    /// Storage of attributes.
    pub attributes: AttributeChoices,
    /// Whether the index of each particle in its file is stored, if there is no attribute `id`.
    pub keep_ids: bool,
    /// Memory limit. Frames that do not fit are sorted in parts, whose boundaries depend on it.
    pub memory: Option<Bytes>,
}

impl ConvertSettings {
    /// Everything that the frames depend on, for the plan: key and value.
    pub fn settings(&self) -> Vec<(String, String)> {
        let encoding = match self.encoding {
            Some(encoding) => encoding.to_string(),
            None => "smallest".to_owned(),
        };
        let mut settings =
            vec![("version".to_owned(), VERSION.to_string()), ("encoding".to_owned(), encoding)];
        // Exact positions do not depend on the bound
        match self.bound {
            _ if self.encoding == Some(Encoding::F32) => {}
            Bound::None => {}
            Bound::OfRadius(fraction) => {
                settings.push(("max-error".to_owned(), fraction.to_string()));
            }
            Bound::Length(length) => {
                settings.push(("max-error-length".to_owned(), length.to_string()));
            }
        }
        // Add what all conversions have
        let radius = self.radius.map_or_else(|| "auto".to_owned(), |r| r.to_string());
        settings.push(("radius".to_owned(), radius));
        settings.push(("attributes".to_owned(), self.attributes.to_string()));
        if self.keep_ids {
            settings.push(("ids".to_owned(), "true".to_owned()));
        }
        settings
    }

    /// The properties that the survey must determine.
    pub const fn question(&self) -> Question<'static> {
        let radius = match self.radius {
            Some(_) => RadiusQuestion::None,
            None => RadiusQuestion::Auto,
        };
        Question { radius, ..Question::NOTHING }
    }
}

/// Settings for converting the frames of a job.
#[derive(Debug, Clone, PartialEq)]
pub struct Conversion {
    /// The settings of the user.
    pub settings: ConvertSettings,
    /// World position that stored positions are relative to.
    pub origin: DVec3,
    /// Whether y is the usual up direction of the format.
    pub is_y_up: bool,
    /// Radius for frames without one, scene units.
    pub estimate: Option<f32>,
}

impl Conversion {
    /// Combines the settings of the user with the survey.
    ///
    /// # Errors
    /// The settings name an attribute that no frame has.
    pub fn new(settings: ConvertSettings, survey: &Survey) -> Result<Self, UnknownAttribute> {
        if let Some(name) = settings.attributes.unknown(&survey.attributes) {
            return Err(UnknownAttribute {
                name: name.to_owned(),
                known: crate::pipeline::attribute_list(survey.attributes.iter().map(|n| &n[..])),
            });
        }
        Ok(Self {
            estimate: survey.radius.filter(|_| settings.radius.is_none()),
            origin: survey.origin,
            is_y_up: survey.up == DVec3::Y,
            settings,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(encoding: Option<Encoding>, bound: Bound) -> Vec<(String, String)> {
        let settings = ConvertSettings {
            encoding,
            bound,
            radius: None,
            attributes: AttributeChoices::default(),
            keep_ids: false,
            memory: None,
        };
        settings.settings()
    }

    #[test]
    fn settings_without_effect_are_omitted() {
        let exact = settings(Some(Encoding::F32), Bound::None);
        assert_eq!(settings(Some(Encoding::F32), Bound::OfRadius(0.02)), exact);
        let coded = settings(Some(Encoding::Q16), Bound::OfRadius(0.02));
        assert_ne!(settings(Some(Encoding::Q16), Bound::Length(0.02)), coded);
        assert_ne!(settings(None, Bound::OfRadius(0.02)), coded);
    }
}
