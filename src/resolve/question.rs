//! What the survey has to determine for the settings of a manifest.

use crate::math::narrow;
use glam::DVec3;

use super::{camera, color, overlay};
use crate::manifest::{ColorSetting, DrawnStyle, Manifest, RadiusSetting, StyledManifest};
use crate::selection::Selection;
use crate::surface::SurfaceKind;
use crate::survey::{Question, RadiusQuestion, StyleQuestions, SurfaceQuestion};

/// What a job needs to know about the particles, with the settings that ask for it.
#[derive(Debug, Clone)]
pub struct Inquiry {
    styled: StyledManifest,
    selection: Selection,
}

impl Inquiry {
    /// What a job of `manifest` needs to know.
    pub fn of(manifest: &Manifest) -> Self {
        Self { styled: manifest.styled(), selection: manifest.selection() }
    }

    /// The colours of the styles as questions, if there are styles.
    pub fn styles(&self) -> Option<StyleQuestions<'_>> {
        let division = &self.styled.division;
        let own = |drawn: &DrawnStyle| !drawn.shares_colors;
        (!division.is_one()).then(|| StyleQuestions {
            division: division.clone(),
            shared: color::question(&self.styled.usual.material.color),
            first_shares: self.styled.first_shares,
            colors: (self.styled.styles.iter())
                .map(|drawn| own(drawn).then(|| color::question(&drawn.style.color)))
                .collect(),
        })
    }

    /// What the survey has to determine; `styles` are [`Self::styles`].
    pub fn question<'a>(&'a self, styles: Option<&'a StyleQuestions<'a>>) -> Question<'a> {
        let (manifest, selection) = (&self.styled.manifest, &self.selection);
        let has_body = manifest.surface.kind != SurfaceKind::Spheres
            || self.styled.styles.iter().any(|drawn| drawn.style.is_body());
        let needs_points = |setting: &ColorSetting| color::is_depth(setting);
        // A clear style may have a radius where the others have none
        let radius = match (&manifest.input.radius, &self.styled.usual.input.radius) {
            (RadiusSetting::Length(_), RadiusSetting::Auto) => &RadiusSetting::Auto,
            (own, _) => own,
        };
        // Ask only for what the manifest leaves open: each answer takes time
        Question {
            color: color::question(&manifest.material.color),
            styles,
            radius: match radius {
                RadiusSetting::Auto if has_body => RadiusQuestion::AutoOfBody,
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
            points: needs_points(&manifest.material.color)
                || self.styled.styles.iter().any(|drawn| needs_points(&drawn.style.color))
                || overlay::needs_points(manifest),
            fit: camera::fit(manifest),
            framed: None,
            surface: surface_question(manifest),
        }
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
