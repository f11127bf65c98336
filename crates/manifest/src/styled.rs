//! Styles as they are drawn: groups of particles, among them those of `[[material.part]]` and those without a style.

use spherule_selection::{Claim, Condition, Division};
use spherule_surface::SurfaceKind;

use super::Manifest;
use super::bonds::BondSearch;
use super::color::ColorSetting;
use super::input::RadiusSetting;
use super::material::MaterialKind;
use super::part::{Part, PartKind};
use super::style::{Style, StyleDraw, StyleMaterial, StyleMaterialKind};

/// Styles as they are drawn. If any particles are clear, the first group is: the particles without a style if these are,
/// else those of the first clear style; see [`Manifest::styled`].
#[derive(Debug, Clone, PartialEq)]
pub struct StyledManifest {
    /// The settings, with `[material]`, `[surface]`, `input.radius` and `[bonds]` of the first group.
    pub manifest: Manifest,
    /// The settings as they are, from which styles take what they do not say.
    pub usual: Manifest,
    /// The styles of the other groups, in the order of these.
    pub styles: Vec<DrawnStyle>,
    /// Which particles belong to which group. The claims are in the order of the manifest's styles, without hidden ones.
    pub division: Division,
    /// Whether a style of the manifest has become the first group.
    pub has_first: bool,
    /// Whether the first group is seen in the colours of `[material]`.
    pub first_shares: bool,
}

/// The style of a group of particles.
#[derive(Debug, Clone, PartialEq)]
pub struct DrawnStyle {
    /// Where it is from.
    pub source: StyleSource,
    /// How the particles are drawn, with all settings of colours in [`Style::color`].
    pub style: Style,
    /// Whether they have the colours of `[material]`, with one scale for all such groups.
    pub shares_colors: bool,
}

/// Where the manifest has a style.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StyleSource {
    /// In `[[style]]`, at this place.
    Style(usize),
    /// In `[[material.part]]`, at this place.
    Part(usize),
    /// In `[material]` and others: particles without a style beside clear ones.
    Rest,
}

impl DrawnStyle {
    /// How it is called in legends and messages.
    pub fn title(&self) -> String {
        match self.source {
            StyleSource::Part(place) => format!("material.part.{place}"),
            StyleSource::Style(_) | StyleSource::Rest => self.style.title(),
        }
    }

    /// The order of groups by what they draw: spheres, bodies, others.
    fn rank(&self) -> u8 {
        match self.style.surface() {
            _ if self.style.draw == StyleDraw::Grains => 1,
            Some(SurfaceKind::Spheres) => 0,
            Some(SurfaceKind::Union | SurfaceKind::Smooth) => 1,
            None => 2,
        }
    }
}

impl Manifest {
    /// The groups of particles that are drawn in different ways: first those without a style, or those of the first clear
    /// style if the others are opaque.
    pub fn styled(&self) -> StyledManifest {
        // The settings without a style are one of the other groups if a style takes their place
        let mut drawn = self.drawn_styles();
        let is_first = |drawn: &&DrawnStyle| drawn.style.is_clear() && !self.material.is_clear();
        let first = drawn.iter().find(is_first).cloned();
        if first.is_some() && drawn.iter().all(|drawn| drawn.style.condition.is_some()) {
            drawn.push(self.drawn(StyleSource::Rest, self.style_of_rest()));
        }
        let first_source = first.as_ref().map(|first| first.source);
        // Bring the others into the order of what they draw
        let mut styles: Vec<DrawnStyle> =
            drawn.iter().filter(|drawn| Some(drawn.source) != first_source).cloned().collect();
        styles.sort_by_key(DrawnStyle::rank);
        let group_of = |source: StyleSource| {
            let place = styles.iter().position(|other| other.source == source);
            place.map_or(0, |place| place + 1)
        };
        let claims = drawn
            .into_iter()
            .map(|drawn| Claim { condition: drawn.style.condition, group: group_of(drawn.source) });
        let division = Division { claims: claims.collect(), groups: styles.len() + 1, up: None };
        let mut manifest = self.clone();
        if let Some(first) = &first {
            manifest.take_style(&first.style);
        }
        let has_usual_colors = first.as_ref().is_none_or(|first| first.shares_colors);
        StyledManifest {
            first_shares: has_usual_colors && manifest.material.shows_colors(),
            manifest,
            usual: self.clone(),
            styles,
            division,
            has_first: first.is_some(),
        }
    }

    /// The styles that are not hidden, and those of parts.
    fn drawn_styles(&self) -> Vec<DrawnStyle> {
        let styles = (self.styles.iter().enumerate())
            .filter(|(_, style)| style.draw != StyleDraw::Hidden)
            .map(|(place, style)| (StyleSource::Style(place), style.clone()));
        let parts = (self.material.parts.iter().enumerate())
            .map(|(place, part)| (StyleSource::Part(place), self.style_of_part(part)));
        styles.chain(parts).map(|(source, style)| self.drawn(source, style)).collect()
    }

    /// A style with its colours.
    fn drawn(&self, source: StyleSource, style: Style) -> DrawnStyle {
        let has_own = style.color != ColorSetting::Auto || style.color_by.is_some();
        let shares_colors = match source {
            StyleSource::Rest => true,
            _ => !has_own && !style.is_thin_glass(),
        };
        let color = style.colors(&self.material.color);
        let style = Style { color, color_by: None, map: None, range: None, ..style };
        DrawnStyle { source, style, shares_colors }
    }

    /// A material of parts of the particles, as a style.
    fn style_of_part(&self, part: &Part) -> Style {
        let conditions = part.parts.iter().map(|part| format!("part == {part}"));
        let conditions =
            conditions.map(|condition| Condition::parse(&condition).expect("a condition"));
        Style {
            condition: conditions.reduce(Condition::or),
            color: part.color.map_or(ColorSetting::Auto, ColorSetting::Rgb),
            opacity: self.material.opacity.clone(),
            material: Some(StyleMaterial {
                kind: match part.kind {
                    PartKind::Matte => StyleMaterialKind::Matte,
                    PartKind::Plastic => StyleMaterialKind::Plastic,
                    PartKind::Metal => StyleMaterialKind::Metal,
                },
                roughness: Some(part.roughness),
                ..StyleMaterial::default()
            }),
            ..Style::default()
        }
    }

    /// The settings of particles without a style, as a style.
    fn style_of_rest(&self) -> Style {
        let kind = match self.material.kind {
            Some(MaterialKind::Plastic) => StyleMaterialKind::Plastic,
            Some(MaterialKind::Metal) => StyleMaterialKind::Metal,
            _ => StyleMaterialKind::Matte,
        };
        let roughness = Some(self.material.roughness);
        Style {
            draw: match self.surface.kind {
                SurfaceKind::Spheres => StyleDraw::Spheres,
                SurfaceKind::Union => StyleDraw::Union,
                SurfaceKind::Smooth => StyleDraw::Smooth,
            },
            radius: self.input.radius.clone(),
            color: self.material.color.clone(),
            opacity: self.material.opacity.clone(),
            material: Some(StyleMaterial { kind, roughness, ..StyleMaterial::default() }),
            ..Style::default()
        }
    }

    /// Draws the particles without a style like those of `style`.
    fn take_style(&mut self, style: &Style) {
        if let Some(kind) = style.surface() {
            self.surface.kind = kind;
        }
        if style.radius != RadiusSetting::Auto {
            self.input.radius = style.radius.clone();
        }
        self.bonds.find = BondSearch::None;
        let usual = std::mem::take(&mut self.material);
        self.material = match &style.material {
            None => usual,
            Some(own) => own.as_material(&usual, usual.constants.ior),
        };
        self.material.color = style.color.clone();
        self.material.opacity = style.opacity.clone();
    }
}

#[cfg(test)]
#[path = "styled_tests.rs"]
mod tests;
