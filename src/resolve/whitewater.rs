//! Whitewater: the speed that its speeds are relative to, the same for all frames.

use glam::DVec3;
use spherule_formats::names;

use super::ResolveError;
use super::channels::has_velocities;
use crate::manifest::Manifest;
use crate::math::narrow;
use crate::pipeline::attribute_list;
use crate::surface::SurfaceSettings;
use crate::surface::whitewater::violent_speed;
use crate::survey::Survey;

/// The surface of `manifest`, with the speed of violent water if it has whitewater.
///
/// # Errors
/// The sampled frames have no velocities.
pub(super) fn with_speed(
    manifest: &Manifest,
    survey: &Survey,
    up: DVec3,
) -> Result<SurfaceSettings, ResolveError> {
    let surface = manifest.surface;
    if !manifest.has_whitewater() {
        return Ok(SurfaceSettings { whitewater: false, ..surface });
    }
    if survey.most_particles > 0 && !has_velocities(survey) {
        return Err(ResolveError::Unsupported {
            key: "surface.whitewater",
            what: format!(
                "whitewater needs velocities, an attribute with three components called {}, and the sampled frames have \
                 none; available: {}",
                names::VELOCITY.join(", "),
                attribute_list(survey.attributes.iter().map(String::as_str))
            ),
        });
    }
    let height = narrow((up * (survey.max - survey.min)).abs().element_sum());
    let automatic = violent_speed(survey.speed.unwrap_or(0.0), height);
    let speed = surface.whitewater_speed.unwrap_or(automatic);
    Ok(SurfaceSettings { whitewater_speed: Some(speed), ..surface })
}
