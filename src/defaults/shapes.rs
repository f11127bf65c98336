//! Particles with shapes of their own.

use toml::{Table, Value};

use super::Rules;
use super::radius::three_digits;
use crate::manifest::{Manifest, OpacitySetting, Override, RadiusSetting, Style, StyleDraw};
use crate::surface::SurfaceKind;

/// The key of styles.
const STYLE: &str = "style";

/// The style that the rule adds.
pub(super) fn grains(shown: &str) -> Option<Override> {
    let item = Table::from_iter([("draw".to_owned(), Value::from("grains"))]);
    Override::append(STYLE, item, shown).ok()
}

/// Whether the `planned` settings of a job have the style that the rule adds, and no other.
pub(super) fn has_grains(planned: &[(String, String)]) -> bool {
    let is_of_style = |(key, _): &&(String, String)| key.starts_with("style.");
    let style = Style { draw: StyleDraw::Grains, ..Style::default() };
    let ours = Manifest { styles: vec![style], ..Manifest::new("") }.settings();
    let ours = ours.iter().filter(is_of_style).all(|setting| planned.contains(setting));
    ours && !planned.iter().filter(is_of_style).any(|(key, _)| !key.starts_with("style.0."))
}

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
            self.found.settings.extend(grains("the defaults"));
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
