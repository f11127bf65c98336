//! Materials and colours of rods: of the simulation cell, arrows, trails and bonds.

use super::{ResolveError, color};
use crate::manifest::{ColorMapping, ColorSetting, RangeSetting, ScaleKind};
use crate::pipeline::{ColorRule, RodLook};
use crate::scene::{DEFAULT_MESH_COLOR, Material, Scene};
use crate::survey::{ColorRange, Survey};

/// The look of rods of this `radius`. `rule`: the colours of their particles, if they have not all the same. Adds their
/// material to the scene; None if it has too many.
pub(super) fn look(
    scene: &mut Scene,
    radius: f32,
    color: &ColorSetting,
    rule: Option<ColorRule>,
) -> Option<RodLook> {
    let common = match color {
        ColorSetting::Rgb(color) => *color,
        ColorSetting::Auto | ColorSetting::Mapped(_) => DEFAULT_MESH_COLOR,
    };
    let material = scene.add(Material::matte(common))?;
    Some(RodLook { radius, color: rule, material })
}

/// Colours of rods for each of their particles, if they have not all the same: by default those of `particles`, else by
/// a value, by default the attribute `own`. `key`: the setting.
pub(super) fn rule(
    color: &ColorSetting,
    particles: &ColorRule,
    survey: &Survey,
    own: &str,
    key: &'static str,
) -> Result<Option<ColorRule>, ResolveError> {
    Ok(match color {
        ColorSetting::Rgb(_) => None,
        ColorSetting::Auto => Some(particles.clone()),
        ColorSetting::Mapped(by) => Some(mapped(by, survey, own, key)?),
    })
}

/// Colours by a value, by default the attribute `own`.
fn mapped(
    by: &ColorMapping,
    survey: &Survey,
    own: &str,
    key: &'static str,
) -> Result<ColorRule, ResolveError> {
    // Find the value
    let name = by.attribute.as_deref().unwrap_or(own);
    let value = color::value_of(survey, name, key)?;
    color::require_categories(survey, by, name, key)?;
    // Take the range of the particles if they show the same value, or the given one
    let surveyed = survey.color.as_ref().filter(|range| range.attribute.eq_ignore_ascii_case(name));
    let is_given = matches!(by.range, Some(RangeSetting::Values(_)));
    let range = match surveyed {
        Some(range) if by.range.is_none() => range.clone(),
        _ if is_given && by.scale() != ScaleKind::Categorical => ColorRange {
            attribute: name.to_owned(),
            low: 0.0,
            high: 1.0,
            left_out: false,
            categories: None,
        },
        _ => {
            return Err(ResolveError::Unsupported {
                key,
                what: format!(
                    "the range of `{name}` is not known; give it as range = [low, high], or colour the particles by \
                     the same value (material.color)"
                ),
            });
        }
    };
    color::mapped(by, &range, true, value.needs_geometry())
}
