//! Whether and how noise is removed from the images.

use super::ResolveError;
use crate::denoise::DenoiseSettings;
use crate::manifest::Manifest;
use crate::render::IntegratorKind;
use crate::scene::Material;

/// The settings of the filter, if the images are denoised.
///
/// # Errors
/// There are too few samples.
pub(super) fn settings(
    manifest: &Manifest,
    material: &Material,
) -> Result<Option<DenoiseSettings>, ResolveError> {
    let has_samples = manifest.image.samples >= 2;
    let is_path = manifest.integrator() == IntegratorKind::Path;
    if manifest.render.denoise == Some(true) && !has_samples {
        return Err(ResolveError::Unsupported {
            key: "render.denoise",
            what:
                "needs at least 2 samples per pixel (image.samples), whose difference is the noise"
                    .to_owned(),
        });
    }
    let is_wanted = manifest.render.denoise.unwrap_or(is_path && has_samples);
    let settings =
        if material.transmission > 0.0 { DenoiseSettings::WATER } else { DenoiseSettings::OPAQUE };
    Ok(is_wanted.then_some(settings))
}
