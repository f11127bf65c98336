//! Arrows of vector attributes, and trails.

use super::{ResolveError, color, narrow, require_attribute};
use crate::manifest::{ColorMapping, ColorSetting, Manifest, RangeSetting, ScaleKind};
use crate::pipeline::{ArrowStyle, ColorRule, TrailStyle};
use crate::scene::mesh::DEFAULT_COLOR;
use crate::scene::{Finish, MeshFinish, MeshMaterial, Scene};
use crate::surface::MaterialId;
use crate::survey::{ColorRange, Survey};

const ATTRIBUTE: &str = "arrows.attribute";
const COLOR: &str = "arrows.color";
const TRAIL_COLOR: &str = "trails.color";

/// Automatic radius of the shafts in radii of the particles.
const RADIUS: f64 = 1.0 / 3.0;

/// Automatic radius of trails in radii of the particles.
const TRAIL_RADIUS: f64 = 0.5;

/// How arrows are drawn. `particles`: the colours of the particles; `reach`: their radius. Adds their materials to
/// those of the meshes of `scene`.
///
/// # Errors
/// The particles have no such attribute, or colours are not determined.
pub(super) fn arrows(
    scene: &mut Scene,
    manifest: &Manifest,
    survey: &Survey,
    particles: &ColorRule,
    reach: f64,
) -> Result<Vec<ArrowStyle>, ResolveError> {
    let mut styles = Vec::new();
    for own in &manifest.arrows {
        check_attribute(survey, &own.attribute)?;
        // The manifest has no more of them than there are materials
        let Some(material) = add_material(scene, &own.color) else {
            break;
        };
        styles.push(ArrowStyle {
            attribute: own.attribute.clone(),
            scale: own.scale,
            radius: own.radius.unwrap_or_else(|| narrow(RADIUS * reach)),
            every: own.every,
            anchor: own.anchor,
            color: rule(&own.color, particles, survey, &own.attribute, COLOR)?,
            material,
        });
    }
    Ok(styles)
}

/// How trails are drawn, if they are; see [`arrows`].
///
/// # Errors
/// The job follows a simulation, or colours are not determined.
pub(super) fn trails(
    scene: &mut Scene,
    manifest: &Manifest,
    survey: &Survey,
    particles: &ColorRule,
    reach: f64,
) -> Result<Option<TrailStyle>, ResolveError> {
    let own = &manifest.trails;
    if own.frames == 0 {
        return Ok(None);
    }
    if manifest.job.follow {
        return Err(ResolveError::Unsupported {
            key: "trails.frames",
            what: "earlier frames may be completed later when job.follow is set; render the sequence when it is \
                   complete"
                .to_owned(),
        });
    }
    let color = rule(&own.color, particles, survey, "velocity", TRAIL_COLOR)?;
    let style = |material| TrailStyle {
        frames: own.frames,
        radius: own.radius.unwrap_or_else(|| narrow(TRAIL_RADIUS * reach)),
        every: own.every,
        color,
        material,
    };
    Ok(add_material(scene, &own.color).map(style))
}

/// Adds the material of rods of this colour to those of the meshes of `scene`; None if there are too many.
pub(super) fn add_material(scene: &mut Scene, color: &ColorSetting) -> Option<MaterialId> {
    let id = MaterialId::of_mesh(scene.meshes.len())?;
    scene.meshes.push(MeshMaterial {
        color: match color {
            ColorSetting::Rgb(color) => *color,
            ColorSetting::Auto | ColorSetting::Mapped(_) => DEFAULT_COLOR,
        },
        finish: MeshFinish::Opaque(Finish::Matte),
        is_holdout: false,
    });
    Some(id)
}

/// Refuses attributes that do not exist or are no vectors.
fn check_attribute(survey: &Survey, name: &str) -> Result<(), ResolveError> {
    require_attribute(survey, ATTRIBUTE, name)?;
    let mut known = survey.attributes.iter().zip(&survey.components);
    match known.find(|(known, _)| known.eq_ignore_ascii_case(name)) {
        Some((_, components)) if *components != 3 => Err(ResolveError::Unsupported {
            key: ATTRIBUTE,
            what: format!(
                "`{name}` has {components} per particle, but arrows need an attribute with three components",
                components = match components {
                    1 => "1 number".to_owned(),
                    several => format!("{several} numbers"),
                }
            ),
        }),
        _ => Ok(()),
    }
}

/// Colours of rods for each of their particles, if they have not all the same: by default those of `particles`, else by
/// a value, by default the attribute `own`. `key`: the setting.
pub(super) fn rule(
    color: &ColorSetting,
    particles: &ColorRule,
    survey: &Survey,
    own: &str,
    key: &'static str,
) -> Result<Option<ColorRule>, ResolveError> {
    Ok(match color {
        ColorSetting::Rgb(_) => None,
        ColorSetting::Auto => Some(particles.clone()),
        ColorSetting::Mapped(by) => Some(mapped(by, survey, own, key)?),
    })
}

/// Colours by a value, by default the attribute `own`.
fn mapped(
    by: &ColorMapping,
    survey: &Survey,
    own: &str,
    key: &'static str,
) -> Result<ColorRule, ResolveError> {
    let name = by.attribute.as_deref().unwrap_or(own);
    let value = color::value_of(survey, name, key)?;
    let surveyed = survey.color.as_ref();
    let surveyed = surveyed.filter(|range| range.attribute.eq_ignore_ascii_case(name));
    let is_given = matches!(by.range, Some(RangeSetting::Values(_)));
    let range = match surveyed {
        Some(range) if by.range.is_none() => range.clone(),
        _ if is_given && by.scale() != ScaleKind::Categorical => ColorRange {
            attribute: name.to_owned(),
            low: 0.0,
            high: 1.0,
            left_out: false,
            categories: None,
        },
        _ => {
            return Err(ResolveError::Unsupported {
                key,
                what: format!(
                    "the range of `{name}` is not known; give it as range = [low, high], or colour the particles by \
                     the same value (material.color)"
                ),
            });
        }
    };
    color::mapped(by, &range, true, value.needs_geometry())
}
