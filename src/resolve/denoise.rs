//! Whether and how noise is removed from the images.

use crate::denoise::DenoiseSettings;
use crate::manifest::Manifest;
use crate::render::IntegratorKind;
use crate::scene::Material;

/// The settings of the filter, if the images are denoised.
pub(super) fn settings(manifest: &Manifest, material: &Material) -> Option<DenoiseSettings> {
    let has_samples = manifest.image.samples >= 2 || manifest.render.noise.is_some();
    let is_path = manifest.integrator() == IntegratorKind::Path;
    let is_wanted = manifest.render.denoise.unwrap_or(is_path && has_samples);
    let settings =
        if material.transmission > 0.0 { DenoiseSettings::WATER } else { DenoiseSettings::OPAQUE };
    is_wanted.then_some(settings)
}
