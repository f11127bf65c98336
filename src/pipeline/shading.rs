//! Where renderers look up the colours, opacities and attributes of decoded particles.

use spherule_formats::order::index_u32;

use super::decoded::DecodedShading;
use super::setup::{ColorRule, OpacityRule, Picture};
use crate::render::{Colors, Opacities, ParticleShading, StyleShading};
use crate::scene::material::DEFAULT_COLOR;

/// The values of particles in memory, as the rules of `picture` use them.
pub(super) fn particle_shading<'a>(
    picture: &'a Picture,
    shading: &'a DecodedShading,
) -> ParticleShading<'a> {
    // Choose the source of the colours; without an attribute it is a constant
    let values = &shading.values;
    let colors = |rule: &'a ColorRule| match rule {
        ColorRule::Constant(color) => Colors::Constant(*color),
        ColorRule::Rgb { .. } if shading.colors.is_empty() => Colors::Constant(DEFAULT_COLOR),
        ColorRule::Rgb { .. } => Colors::PerParticle(&shading.colors),
        ColorRule::Attribute { .. } if values.is_empty() => Colors::Constant(DEFAULT_COLOR),
        ColorRule::Attribute { map, .. } => Colors::Mapped { values, map },
    };
    let opacities = |rule: &OpacityRule| match *rule {
        OpacityRule::Constant(opacity) => Opacities::Constant(opacity),
        OpacityRule::Value { range, .. } => Opacities::Mapped { values: &shading.opacities, range },
    };
    // Styles follow each other in the order of the particles
    let rules = &picture.particles;
    let styles = rules.styles.iter().enumerate().skip(1).map(|(index, style)| StyleShading {
        first: index_u32(shading.ranges.of(index).start),
        material: style.material,
        colors: colors(&style.color),
        opacities: opacities(&style.opacity),
    });
    ParticleShading {
        colors: colors(&rules.first().color),
        opacities: opacities(&rules.first().opacity),
        styles: styles.collect(),
        ids: shading.ids.as_deref(),
        velocities: shading.velocities.as_deref(),
        parts: shading.parts.as_ref().map(|(name, parts)| (name.as_str(), &parts[..])),
        attributes: &shading.attributes,
    }
}
