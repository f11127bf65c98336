//! The radii of the particles, and how far they reach.

use super::color::is_text;
use super::error::require_attribute;
use super::{ResolveError, surface};
use crate::manifest::RadiusSetting;
use crate::math::narrow;
use crate::pipeline::RadiusRule;
use crate::surface::SurfaceKind;
use crate::survey::Survey;

/// Minimum radius: its square, and the squares of slightly smaller distances, do not underflow in f32.
const TRACEABLE_RADIUS: f32 = 1e-16;

/// The source of the radii of particles with this surface.
///
/// # Errors
/// There is no such attribute, no radius at all, or one that is too small to trace.
pub(super) fn rule(
    setting: &RadiusSetting,
    kind: SurfaceKind,
    survey: &Survey,
) -> Result<RadiusRule, ResolveError> {
    // Find the source
    let rule = match setting {
        RadiusSetting::Length(radius) => RadiusRule::Common(narrow(*radius)),
        RadiusSetting::Attribute { attribute, scale } => {
            require_attribute(survey, "input.radius", attribute)?;
            if is_text(survey, attribute) {
                let what = format!(
                    "`{attribute}` is text, not a number; give radii by numbers or by elements"
                );
                return Err(ResolveError::Unsupported { key: "input.radius", what });
            }
            RadiusRule::Attribute { name: attribute.clone(), scale: narrow(*scale) }
        }
        RadiusSetting::Table { attribute, table, scale } => {
            require_attribute(survey, "input.radius", attribute)?;
            RadiusRule::Table {
                name: attribute.clone(),
                table: table.clone(),
                scale: scale * survey.unit_of(table),
            }
        }
        RadiusSetting::Auto => match surface::radius(kind, survey) {
            Some(radius) => RadiusRule::FileOr(radius),
            // All frames contain radii, or there are no particles.
            None if survey.has_radii || survey.most_particles == 0 => RadiusRule::FileOr(0.0),
            None => return Err(ResolveError::NoRadius),
        },
    };
    // Refuse radii that are too small for single precision
    match rule {
        RadiusRule::Common(radius) | RadiusRule::FileOr(radius)
            if radius > 0.0 && radius < TRACEABLE_RADIUS =>
        {
            Err(ResolveError::TinyRadius(radius))
        }
        _ => Ok(rule),
    }
}

/// Extent of the spheres beyond their centres.
pub(super) fn reach(rule: &RadiusRule, survey: &Survey) -> f32 {
    match rule {
        RadiusRule::Common(radius) => *radius,
        RadiusRule::FileOr(radius) => radius.max(survey.reach),
        RadiusRule::Attribute { .. } | RadiusRule::Table { .. } => survey.reach,
    }
}
