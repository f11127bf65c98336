//! How much each sphere covers of what is behind it.

use super::{ResolveError, color};
use crate::manifest::{Manifest, OpacitySetting};
use crate::math::narrow;
use crate::pipeline::OpacityRule;
use crate::surface::SurfaceKind;
use crate::survey::Survey;

const KEY: &str = "material.opacity";

/// The opacity of `manifest`. `is_clear`: the particles are transmissive.
///
/// # Errors
/// The surface or the material cannot have one, or the particles have no such value.
pub(super) fn opacity(
    manifest: &Manifest,
    survey: &Survey,
    is_clear: bool,
) -> Result<OpacityRule, ResolveError> {
    let unsupported =
        |what: &str| Err(ResolveError::Unsupported { key: KEY, what: what.to_owned() });
    // Opaque particles are possible with everything
    let setting = &manifest.material.opacity;
    if *setting == OpacitySetting::Constant(1.0) {
        return Ok(OpacityRule::OPAQUE);
    }
    // Refuse surfaces and materials that cannot fade
    if manifest.surface.kind != SurfaceKind::Spheres {
        return unsupported(
            "only separate spheres have an opacity; set render.surface to \"spheres\", or make the body of glass or \
             water (material.type)",
        );
    }
    if is_clear {
        return unsupported(
            "glass and water are transparent already; choose matte, plastic or metal, or leave the opacity out",
        );
    }
    // Take the constant, or the value of each particle
    Ok(match setting {
        OpacitySetting::Constant(opacity) => OpacityRule::Constant(*opacity),
        OpacitySetting::Attribute { attribute, range } => OpacityRule::Value {
            needs_geometry: color::value_of(survey, attribute, KEY)?.needs_geometry(),
            name: attribute.clone(),
            range: range.map(narrow),
        },
    })
}
