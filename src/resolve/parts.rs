//! The materials of parts of the particles.

use super::ResolveError;
use crate::manifest::Manifest;
use crate::pipeline::attribute_list;
use crate::render::IntegratorKind;
use crate::scene::Scene;
use crate::surface::SurfaceKind;
use crate::survey::{PART_NAMES, Survey};

/// Adds the materials of `[[material.part]]` to `scene`.
///
/// # Errors
/// The integrator or the surface cannot use them, or the particles have no parts.
pub(super) fn add(
    scene: &mut Scene,
    manifest: &Manifest,
    survey: &Survey,
) -> Result<(), ResolveError> {
    let parts = &manifest.material.parts;
    if parts.is_empty() {
        return Ok(());
    }
    // Refuse settings that have one material only
    let unsupported = |what: String| ResolveError::Unsupported { key: "material.part", what };
    if manifest.integrator() != IntegratorKind::Path {
        return Err(unsupported(
            "render.integrator = \"whitted\" has one material for all particles; choose \"path\" (--integrator path), \
             or leave the parts out"
                .to_owned(),
        ));
    }
    if manifest.surface.kind != SurfaceKind::Spheres {
        return Err(unsupported(
            "one body has one material; set render.surface to \"spheres\", or leave the parts out"
                .to_owned(),
        ));
    }
    // Find the attribute that divides the particles
    let is_part = |(name, components): (&String, Option<&usize>)| {
        components.is_none_or(|components| *components == 1)
            && PART_NAMES.iter().any(|part| name.eq_ignore_ascii_case(part))
    };
    let components = survey.components.iter().map(Some).chain(std::iter::repeat(None));
    if survey.most_particles > 0 && !survey.attributes.iter().zip(components).any(is_part) {
        let names = PART_NAMES.map(|name| format!("`{name}`")).join(", ");
        return Err(unsupported(format!(
            "no attribute says which part a particle is of: it would be called one of {names}; available: {}",
            attribute_list(survey.attributes.iter().map(String::as_str))
        )));
    }
    // The manifest has no more of them than there are materials
    for part in parts {
        scene.add_part(&part.parts, part.resolved());
    }
    Ok(())
}
