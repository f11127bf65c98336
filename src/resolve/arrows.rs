//! Arrows of vector attributes, and trails.

use super::{ResolveError, color, narrow, require_attribute};
use crate::manifest::{BondSearch, ColorMapping, ColorSetting, Manifest, RangeSetting, ScaleKind};
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

/// How arrows are drawn. `particles`: the colours of the particles; `reach`: their radius. Their materials follow those
/// of the meshes and of the cell.
///
/// # Errors
/// The particles have no such attribute, or colours are not determined.
pub(super) fn arrows(
    manifest: &Manifest,
    survey: &Survey,
    particles: &ColorRule,
    reach: f64,
) -> Result<Vec<ArrowStyle>, ResolveError> {
    let first = manifest.meshes.len() + usize::from(manifest.cell.visible);
    // The manifest has no more of them than there are materials
    let styles = manifest
        .arrows
        .iter()
        .zip((first..).map_while(MaterialId::of_mesh));
    let style = |(own, material): (&crate::manifest::Arrows, MaterialId)| {
        check_attribute(survey, &own.attribute)?;
        let color = match &own.color {
            ColorSetting::Rgb(_) => None,
            ColorSetting::Auto => Some(particles.clone()),
            ColorSetting::Mapped(by) => Some(mapped(by, survey, &own.attribute, COLOR)?),
        };
        Ok(ArrowStyle {
            attribute: own.attribute.clone(),
            scale: own.scale,
            radius: own.radius.unwrap_or_else(|| narrow(RADIUS * reach)),
            every: own.every,
            anchor: own.anchor,
            color,
            material,
        })
    };
    styles.map(style).collect()
}

/// How trails are drawn, if they are; see [`arrows`]. Their material follows those of the arrows.
///
/// # Errors
/// The job follows a simulation, or colours are not determined.
pub(super) fn trails(
    manifest: &Manifest,
    survey: &Survey,
    particles: &ColorRule,
    reach: f64,
) -> Result<Option<TrailStyle>, ResolveError> {
    let own = &manifest.trails;
    let others = manifest.meshes.len() + usize::from(manifest.cell.visible) + manifest.arrows.len();
    let Some(material) = MaterialId::of_mesh(others).filter(|_| own.frames > 0) else {
        return Ok(None);
    };
    if manifest.job.follow {
        return Err(ResolveError::Unsupported {
            key: "trails.frames",
            what: "earlier frames may be completed later when job.follow is set; render the sequence when it is \
                   complete"
                .to_owned(),
        });
    }
    Ok(Some(TrailStyle {
        frames: own.frames,
        radius: own.radius.unwrap_or_else(|| narrow(TRAIL_RADIUS * reach)),
        every: own.every,
        color: match &own.color {
            ColorSetting::Rgb(_) => None,
            ColorSetting::Auto => Some(particles.clone()),
            ColorSetting::Mapped(by) => Some(mapped(by, survey, "velocity", TRAIL_COLOR)?),
        },
        material,
    }))
}

/// Adds the materials of arrows, trails and bonds to those of the meshes of `scene`.
pub(super) fn add_materials(scene: &mut Scene, manifest: &Manifest) {
    let trails = Some(&manifest.trails).filter(|own| own.frames > 0);
    let bonds = Some(&manifest.bonds).filter(|own| own.find != BondSearch::None);
    let arrows = manifest.arrows.iter().map(|own| &own.color);
    let materials = arrows
        .chain(trails.map(|own| &own.color))
        .chain(bonds.map(|own| &own.color))
        .map(|color| MeshMaterial {
            color: match color {
                ColorSetting::Rgb(color) => *color,
                ColorSetting::Auto | ColorSetting::Mapped(_) => DEFAULT_COLOR,
            },
            finish: MeshFinish::Opaque(Finish::Matte),
            is_holdout: false,
        });
    scene.meshes.extend(materials);
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

/// Colours by a value, by default that of the arrows themselves.
pub(super) fn mapped(
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
