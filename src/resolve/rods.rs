//! Materials and colours of rods: of the simulation cell, arrows, trails and bonds.

use super::{ResolveError, color};
use crate::manifest::{ColorMapping, ColorSetting, RangeSetting, ScaleKind};
use crate::pipeline::ColorRule;
use crate::scene::mesh::DEFAULT_COLOR;
use crate::scene::{Finish, MeshFinish, MeshMaterial, Scene};
use crate::surface::MaterialId;
use crate::survey::{ColorRange, Survey};

/// Adds the material of rods of this colour to those of the meshes of `scene`; None if there are too many.
pub(super) fn add_material(scene: &mut Scene, color: &ColorSetting) -> Option<MaterialId> {
    let id = MaterialId::of_mesh(scene.meshes.len())?;
    scene.meshes.push(MeshMaterial {
        color: match color {
            ColorSetting::Rgb(color) => *color,
            ColorSetting::Auto | ColorSetting::Mapped(_) => DEFAULT_COLOR,
        },
        finish: MeshFinish::Opaque(Finish::Matte),
        is_holdout: false,
    });
    Some(id)
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
