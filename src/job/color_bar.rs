//! The colour bar of a job, from its plan.

use spherule_jobs::JobState;
use toml::Table;

use super::RunError;
use super::target::stored_survey;
use crate::manifest::{ManifestSource, Override};
use crate::overlay::ColorBar;
use crate::resolve::color_bar_of;

/// The colour bar of the pictures of a job, or None if their colours are not those of a colour map. No other file is read.
///
/// # Errors
/// The plan has no valid survey, or the range of the colours depends on the camera.
pub fn color_bar(state: &JobState) -> Result<Option<ColorBar>, RunError> {
    let plan = state.plan();
    let survey = stored_survey(plan.resolved(), state.dir())?;
    let mut overrides: Vec<Override> =
        Override::new("input.path", "data", "the plan").into_iter().collect();
    for (key, text) in plan.settings() {
        if key.starts_with("material.color") {
            overrides
                .extend(value(text).and_then(|value| Override::new(key, value, "the plan").ok()));
        }
    }
    overrides.extend(own_bar(plan.settings()));
    let name = state.dir().display().to_string();
    let source = ManifestSource::new("look = \"none\"", name.as_ref(), overrides);
    let (manifest, _) = source.parse()?;
    Ok(color_bar_of(&manifest, &survey)?)
}

/// The first colour bar among the overlays of a plan.
fn own_bar(settings: &[(String, String)]) -> Option<Override> {
    let is_bar = |(key, value): &&(String, String)| {
        key.starts_with("overlay.") && key.ends_with(".type") && value == "\"colorbar\""
    };
    let (key, _) = settings.iter().find(is_bar)?;
    let prefix = key.strip_suffix("type")?;
    let keys = settings
        .iter()
        .filter_map(|(key, text)| Some((key.strip_prefix(prefix)?.to_owned(), value(text)?)));
    Override::append("overlay", Table::from_iter(keys), "the plan").ok()
}

/// A value that was written as TOML.
fn value(text: &str) -> Option<toml::Value> {
    let mut table: Table = format!("value = {text}").parse().ok()?;
    table.remove("value")
}
