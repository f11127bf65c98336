//! How much each sphere covers of what is behind it.

use super::{ResolveError, color};
use crate::manifest::OpacitySetting;
use crate::math::narrow;
use crate::pipeline::OpacityRule;
use crate::survey::Survey;

const KEY: &str = "material.opacity";

/// The opacity of a `setting`.
///
/// # Errors
/// The particles have no such value.
pub(super) fn opacity(
    setting: &OpacitySetting,
    survey: &Survey,
) -> Result<OpacityRule, ResolveError> {
    Ok(match setting {
        OpacitySetting::Constant(opacity) => OpacityRule::Constant(*opacity),
        OpacitySetting::Attribute { attribute, range } => OpacityRule::Value {
            needs_geometry: color::value_of(survey, attribute, KEY)?.needs_geometry(),
            name: attribute.clone(),
            range: range.map(narrow),
        },
    })
}
