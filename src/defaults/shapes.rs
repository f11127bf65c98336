//! Particles with shapes of their own.

use super::Rules;
use super::radius::three_digits;
use super::style::{STYLE, grains, layer};
use crate::manifest::{Manifest, OpacitySetting, RadiusSetting, Style, StyleDraw};
use crate::surface::SurfaceKind;

impl Rules<'_> {
    /// Particles with orientations and sizes along each axis, or with shapes of their types, are drawn as grains.
    pub(super) fn shapes(&mut self) {
        let Manifest { styles, material, surface, clips, bonds, .. } = self.manifest;
        // Opacities, parts, bonds and cuts are those of spheres
        let is_plain = !material.is_clear()
            && material.opacity == OpacitySetting::Constant(1.0)
            && material.parts.is_empty()
            && clips.is_empty()
            && bonds.find == crate::manifest::BondSearch::None
            && !self.facts.has_bonds;
        let draws_spheres = surface.kind == SurfaceKind::Spheres && styles.is_empty();
        let has_radius = self.manifest.input.radius != RadiusSetting::Auto;
        let Some(source) = self.facts.shape_source.as_ref().filter(|_| !has_radius) else { return };
        if is_plain && draws_spheres && self.lacks(STYLE) {
            let line = format!(
                "drawn with their shapes and orientations, by {} (--style ': spheres' draws spheres)",
                source.what
            );
            self.found.settings.extend(layer(grains(), "the defaults"));
            self.found.lines.push(line);
        } else if !matches!(&styles[..], [style] if draws_columns(style)) {
            return;
        }
        // The ground and the camera are where spheres of this radius would be
        if let Some(radius) = source.radius {
            self.set([("input.radius", three_digits(radius).into())], None);
        }
    }
}

/// Whether a style draws all particles as grains with the sizes of columns.
const fn draws_columns(style: &Style) -> bool {
    let is_sized = style.size.is_some() || style.mesh.is_some();
    matches!(style.draw, StyleDraw::Grains) && style.condition.is_none() && !is_sized
}
