//! Arrows of vector attributes, and trails.

use super::rods::{look, rule};
use super::{ResolveError, require_attribute};
use crate::manifest::{Arrows, Trails};
use crate::math::narrow;
use crate::pipeline::{ArrowStyle, ColorRule, TrailStyle};
use crate::scene::Scene;
use crate::survey::Survey;

const ATTRIBUTE: &str = "arrows.attribute";
const COLOR: &str = "arrows.color";
const TRAIL_COLOR: &str = "trails.color";

/// Automatic radius of the shafts in radii of the particles.
const RADIUS: f64 = 1.0 / 3.0;

/// Automatic radius of trails in radii of the particles.
const TRAIL_RADIUS: f64 = 0.5;

/// How arrows are drawn. `particles`: the colours of the particles; `reach`: their radius. Adds their materials to
/// `scene`.
///
/// # Errors
/// The particles have no such attribute, or colours are not determined.
pub(super) fn arrows(
    scene: &mut Scene,
    arrows: &[Arrows],
    (survey, particles, reach): (&Survey, &ColorRule, f64),
) -> Result<Vec<ArrowStyle>, ResolveError> {
    let mut styles = Vec::new();
    for own in arrows {
        check_attribute(survey, &own.attribute)?;
        let radius = own.radius.unwrap_or_else(|| narrow(RADIUS * reach));
        let color = rule(&own.color, particles, survey, &own.attribute, COLOR)?;
        // The manifest has no more of them than there are materials
        let Some(look) = look(scene, radius, &own.color, color) else {
            break;
        };
        styles.push(ArrowStyle {
            attribute: own.attribute.clone(),
            scale: own.scale,
            every: own.every,
            anchor: own.anchor,
            style: None,
            look,
        });
    }
    Ok(styles)
}

/// How trails are drawn, if they are; see [`arrows`].
///
/// # Errors
/// Colours are not determined.
pub(super) fn trails(
    scene: &mut Scene,
    own: &Trails,
    (survey, particles, reach): (&Survey, &ColorRule, f64),
) -> Result<Vec<TrailStyle>, ResolveError> {
    if own.frames == 0 {
        return Ok(Vec::new());
    }
    // Choose colours, and a radius in proportion to the particles
    let color = rule(&own.color, particles, survey, "velocity", TRAIL_COLOR)?;
    let radius = own.radius.unwrap_or_else(|| narrow(TRAIL_RADIUS * reach));
    let look = look(scene, radius, &own.color, color);
    let style =
        look.map(|look| TrailStyle { frames: own.frames, every: own.every, style: None, look });
    Ok(style.into_iter().collect())
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
