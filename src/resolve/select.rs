//! Which particles are drawn.

use super::error::similar;
use super::{ResolveError, color};
use crate::manifest::Manifest;
use crate::pipeline::attribute_list;
use crate::selection::{Condition, NameFault, Selection};
use crate::surface::SurfaceKind;
use crate::surface::cut::ConvexRegion;
use crate::survey::{PART_NAMES, Survey};
use spherule_frame::values::{Value, value_names};

/// The selection of `manifest`.
///
/// # Errors
/// The particles have no value with a name in the condition.
pub(super) fn selection(manifest: &Manifest, survey: &Survey) -> Result<Selection, ResolveError> {
    let up = Some(super::up(manifest, survey));
    let of = |condition: &Condition| Selection {
        condition: Some(condition.clone()),
        up,
        ..Selection::default()
    };
    // Check the conditions one by one, so that messages name key and place
    if let Some(condition) = &manifest.select.condition {
        check_names(&of(condition), survey, "select.where")?;
    }
    for (number, style) in manifest.styles.iter().enumerate() {
        if let Some(condition) = &style.condition {
            check_names(&of(condition), survey, &format!("style.{number}.where"))?;
        }
    }
    check_parts(manifest, survey)?;
    Ok(Selection { up, ..manifest.selection() })
}

/// Checks that an attribute divides the particles into parts, if parts have materials.
fn check_parts(manifest: &Manifest, survey: &Survey) -> Result<(), ResolveError> {
    let known = color::known_attributes(survey);
    if manifest.material.parts.is_empty()
        || survey.most_particles == 0
        || Value::named(PART_NAMES[0], &known).is_some()
    {
        return Ok(());
    }
    let names = PART_NAMES.map(|name| format!("`{name}`")).join(", ");
    let what = format!(
        "no attribute says which part a particle is of: it would be called one of {names}; available: {}",
        attribute_list(survey.attributes.iter().map(String::as_str))
    );
    Err(ResolveError::Unsupported { key: "material.part", what })
}

/// Checks that the particles have the values that `selection` names; `key` is that of its condition.
fn check_names(selection: &Selection, survey: &Survey, key: &str) -> Result<(), ResolveError> {
    // Whether files have times shows when they are read
    let known = color::known_attributes(survey);
    let checked = selection.check_names(&known, Some(0.0), &survey.labels);
    match checked {
        // Explain names that are not known, with similar ones
        Ok(()) => Ok(()),
        // Empty frames need no attributes, but no particle may also be left because of a text that none has
        Err(unknown) if survey.most_particles == 0 && !is_known_text(&unknown.fault) => Ok(()),
        Err(unknown) if unknown.fault != NameFault::NoValue => {
            let hint = match &unknown.fault {
                NameFault::NoText { known, .. } => similar(&unknown.name, known),
                NameFault::NoValue | NameFault::NotNumber { .. } => String::new(),
            };
            let what = unknown.text_fault(&hint).unwrap_or_default();
            Err(ResolveError::UnknownText { key: key.to_owned(), column: unknown.column, what })
        }
        Err(unknown) => {
            let all = value_names(&known, |value| match value {
                Value::Radius => survey.has_radii,
                Value::Time => survey.largest_time.is_some(),
                Value::Depth => false,
                _ => true,
            });
            let name = unknown.name.split(['.', '[']).next().unwrap_or_default();
            let hint = match name.to_ascii_lowercase().as_str() {
                "depth" => {
                    " (it depends on the camera, which depends on the particles; conditions have x, y, z and height)"
                        .to_owned()
                }
                _ => similar(name, &all),
            };
            Err(ResolveError::UnknownName {
                key: key.to_owned(),
                column: unknown.column,
                hint,
                has: attribute_list(all.iter().map(String::as_str)),
                name: unknown.name,
            })
        }
    }
}

/// Whether a fault is about a value whose texts are known.
const fn is_known_text(fault: &NameFault) -> bool {
    match fault {
        NameFault::NoValue => false,
        NameFault::NoText { known, .. } => !known.is_empty(),
        NameFault::NotNumber { .. } => true,
    }
}

/// The region that the spheres of `manifest` are cut to.
///
/// # Errors
/// The surface cannot be cut, or a region is not convex.
pub(super) fn cut(manifest: &Manifest, survey: &Survey) -> Result<ConvexRegion, ResolveError> {
    let unsupported = |key, what: &str| ResolveError::Unsupported { key, what: what.to_owned() };
    let cuts = manifest.selection().cuts;
    if !cuts.is_empty() && manifest.surface.kind != SurfaceKind::Spheres {
        let what =
            "\"cut\" is for spheres; set render.surface to \"spheres\", or take \"particles\"";
        return Err(unsupported("clip.mode", what));
    }
    let mut region = ConvexRegion::default();
    for cut in cuts {
        let planes = cut.planes().ok_or_else(|| {
            let what = "\"outside\" has no cut faces: what is left is not convex; set keep to \"inside\", cut with \
                        planes, or set mode to \"particles\"";
            unsupported("clip.keep", what)
        })?;
        for (point, normal) in planes {
            region.cut(point - survey.origin, normal);
        }
    }
    Ok(region)
}
