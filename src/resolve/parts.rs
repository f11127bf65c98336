//! The materials of parts of the particles.

use super::ResolveError;
use crate::manifest::Manifest;
use crate::pipeline::attribute_list;
use crate::scene::Scene;
use crate::survey::{PART_NAMES, Survey};

/// Adds the materials of `[[material.part]]` to `scene`.
///
/// # Errors
/// The particles have no parts.
pub(super) fn add(
    scene: &mut Scene,
    manifest: &Manifest,
    survey: &Survey,
) -> Result<(), ResolveError> {
    let parts = &manifest.material.parts;
    if parts.is_empty() {
        return Ok(());
    }
    // Find the attribute that divides the particles
    let is_part = |(name, components): (&String, Option<&usize>)| {
        components.is_none_or(|components| *components == 1)
            && PART_NAMES.iter().any(|part| name.eq_ignore_ascii_case(part))
    };
    let components = survey.components.iter().map(Some).chain(std::iter::repeat(None));
    if survey.most_particles > 0 && !survey.attributes.iter().zip(components).any(is_part) {
        let names = PART_NAMES.map(|name| format!("`{name}`")).join(", ");
        let what = format!(
            "no attribute says which part a particle is of: it would be called one of {names}; available: {}",
            attribute_list(survey.attributes.iter().map(String::as_str))
        );
        return Err(ResolveError::Unsupported { key: "material.part", what });
    }
    // The manifest has no more of them than there are materials
    for part in parts {
        scene.add_part(&part.parts, part.resolved());
    }
    Ok(())
}
