//! What the survey has to determine for the settings of a manifest.

use crate::math::narrow;
use glam::DVec3;

use super::{camera, color, overlay};
use crate::manifest::{Manifest, RadiusSetting};
use crate::selection::Selection;
use crate::surface::SurfaceKind;
use crate::survey::{Question, RadiusQuestion, SurfaceQuestion};

/// What the survey has to determine. `selection` is that of the manifest.
pub fn question<'a>(manifest: &'a Manifest, selection: &'a Selection) -> Question<'a> {
    // Ask only for what the manifest leaves open: each answer takes time
    Question {
        color: color::question(&manifest.material.color),
        radius: match &manifest.input.radius {
            RadiusSetting::Auto if manifest.surface.kind != SurfaceKind::Spheres => {
                RadiusQuestion::AutoOfBody
            }
            RadiusSetting::Auto => RadiusQuestion::Auto,
            RadiusSetting::Length(_) => RadiusQuestion::Given,
            RadiusSetting::Attribute { attribute, scale } => {
                RadiusQuestion::Attribute(attribute, *scale)
            }
            RadiusSetting::Table { attribute, table, scale } => {
                RadiusQuestion::Table(attribute, table, *scale)
            }
        },
        up: manifest.input.up.map(|up| DVec3::from_array(up.vector())),
        selection: Some(selection).filter(|s| !s.is_all() || !s.cuts.is_empty()),
        points: color::is_depth(&manifest.material.color) || overlay::needs_points(manifest),
        fit: camera::fit(manifest),
        framed: None,
        surface: surface_question(manifest),
    }
}

/// What the survey has to determine about the surface, for predictions of memory.
fn surface_question(manifest: &Manifest) -> Option<SurfaceQuestion> {
    let settings = manifest.surface;
    let radius = match manifest.input.radius {
        RadiusSetting::Length(radius) => Some(narrow(radius)),
        _ => None,
    };
    let is_needed = match settings.kind {
        SurfaceKind::Spheres => false,
        SurfaceKind::Union => settings.spray,
        SurfaceKind::Smooth => true,
    };
    is_needed.then_some(SurfaceQuestion { settings, radius })
}
