//! Styles: the rules by which their particles are drawn.

use glam::DVec3;

use super::bonds::bond_rule;
use super::rods::look;
use super::{ResolveError, arrows, color, opacity, radius, surface};
use crate::manifest::{
    BondSearch, ColorSetting, DrawnStyle, GrainNumbers, Manifest, RadiusSetting, Style, StyleDraw,
    StyleMaterial, StyleSource,
};
use crate::math::narrow;
use crate::pipeline::{
    ArrowStyle, BondStyle, ColorRule, GrainMeshes, GrainRules, ParticleStyle, RadiusRule,
    StyleForm, TrailStyle,
};
use crate::scene::{Bounds, Camera, Fresnel, Material, MaterialId, Owner, Scene};
use crate::surface::{SurfaceKind, SurfaceSettings};
use crate::survey::{ELEMENT, Survey};

/// Radius of balls, in radii of the particles.
const BALL: f32 = 0.25;

/// Radius of sticks, in radii of the largest particles.
const STICK: f64 = 0.125;

/// Radius of the sticks between balls, in radii of the largest balls.
const STICK_OF_BALLS: f64 = 0.5;

/// The style of the first group, with its radii, colours and bonds.
///
/// # Errors
/// The particles do not have the value that opacities follow from.
pub(super) fn first(
    manifest: &Manifest,
    survey: &Survey,
    (radius, color, bonds): (RadiusRule, ColorRule, Option<BondStyle>),
) -> Result<ParticleStyle, ResolveError> {
    Ok(ParticleStyle {
        name: "particles".to_owned(),
        is_named: false,
        is_of_rest: true,
        shares_colors: true,
        form: StyleForm::of(manifest.surface),
        opacity: opacity::opacity(&manifest.material.opacity, survey)?,
        material: MaterialId::PARTICLES,
        radius_factor: 1.0,
        radius,
        color,
        bonds,
    })
}

/// What the looks of styles depend on.
pub(super) struct Looks<'a> {
    pub(super) manifest: &'a Manifest,
    /// The style of the first group.
    pub(super) first: &'a ParticleStyle,
    /// Whether it is seen in the colours of the material.
    pub(super) first_shares: bool,
    pub(super) survey: &'a Survey,
    pub(super) camera: &'a Camera,
    pub(super) meshes: &'a GrainMeshes,
    /// Radius of the largest particles.
    pub(super) reach: f64,
    /// Bounds of the spheres.
    pub(super) bounds: Bounds,
    /// Priority of clear styles over the particles without one.
    pub(super) priority: u8,
}

impl Looks<'_> {
    /// How the particles of `styles` are drawn. Adds their materials to `scene`, and what they draw of arrows and trails
    /// to those of all particles.
    ///
    /// # Errors
    /// The particles do not have what a style shows.
    pub(super) fn styles(
        &self,
        scene: &mut Scene,
        styles: &[DrawnStyle],
        (arrows, trails): (&mut Vec<ArrowStyle>, &mut Vec<TrailStyle>),
    ) -> Result<Vec<ParticleStyle>, ResolveError> {
        let mut looks = Vec::new();
        for (index, drawn) in styles.iter().enumerate() {
            let style = &drawn.style;
            // The manifest has no more of them than there are materials
            let Some(material) = scene.add_owned(self.material(style), self.owner(drawn.source))
            else {
                break;
            };
            let range = self.survey.styles.get(index).and_then(Option::as_ref);
            let color = color::rule(&style.color, range, self.survey, Some(self.camera))?;
            let (radius, radius_factor) = self.radius(style)?;
            let bonds = match drawn.source {
                // They are bound to each other, and to those without a style
                StyleSource::Part(_) => self.first.bonds.clone(),
                _ if style.has_sticks() => {
                    self.bonds(scene, style, &color, (&radius, radius_factor))?
                }
                _ => None,
            };
            let place = (self.survey, &color, self.reach);
            let own = arrows::arrows(scene, style.arrows.as_slice(), place)?;
            // Those without a style come before it
            let number = Some(index + 1);
            arrows.extend(own.into_iter().map(|own| ArrowStyle { style: number, ..own }));
            if let Some(own) = &style.trails {
                let own = arrows::trails(scene, own, place)?;
                trails.extend(own.into_iter().map(|own| TrailStyle { style: number, ..own }));
            }
            looks.push(ParticleStyle {
                name: drawn.title(),
                is_named: style.name.is_some() && !style.is_clear(),
                is_of_rest: style.condition.is_none() && style.name.is_none(),
                shares_colors: drawn.shares_colors && self.first_shares,
                form: self.form(style),
                radius,
                radius_factor,
                color,
                opacity: opacity::opacity(&style.opacity, self.survey)?,
                material,
                bonds,
            });
        }
        Ok(looks)
    }

    /// What has the material of a style: names in Cryptomatte count them in the order of the manifest.
    fn owner(&self, source: StyleSource) -> Owner {
        let number = |place: usize| u16::try_from(place).unwrap_or(u16::MAX);
        match source {
            StyleSource::Style(place) => Owner::Style(number(place)),
            StyleSource::Part(place) => Owner::Part(number(place)),
            StyleSource::Rest => Owner::Style(number(self.manifest.styles.len())),
        }
    }

    /// The material of a style: its own, or else that of the other particles if it is opaque.
    fn material(&self, style: &Style) -> Material {
        let usual = self.manifest.material.resolved(Fresnel::Schlick);
        match &style.material {
            Some(own) if own.is_clear() => {
                let usual = &self.manifest.material;
                let settings = own.as_material(usual, Material::DEFAULT.ior);
                let kind = style.surface().unwrap_or(SurfaceKind::Smooth);
                let found = surface::optics(&settings, kind, &self.bounds);
                Material { priority: self.priority, ..found }
            }
            Some(own) => own.resolved(&style.color),
            None if usual.transmission == 0.0 => usual,
            None => StyleMaterial::default().resolved(&style.color),
        }
    }

    /// What stands for the particles of a style.
    fn form(&self, style: &Style) -> StyleForm {
        match style.surface() {
            _ if style.draw == StyleDraw::Grains => StyleForm::Grains(GrainRules {
                kind: style.shape,
                mesh: self.meshes.of(style).cloned(),
                names: style.grain_names(),
                size: match style.size {
                    Some(GrainNumbers::Numbers(size)) => Some(DVec3::from_array(size).as_vec3()),
                    _ => None,
                },
                exponents: match style.exponents {
                    Some(GrainNumbers::Numbers(exponents)) => Some(exponents.map(narrow)),
                    _ => None,
                },
            }),
            None => StyleForm::Nothing,
            Some(kind) => {
                let usual = self.manifest.surface;
                StyleForm::of(SurfaceSettings { kind, spray: false, whitewater: false, ..usual })
            }
        }
    }

    /// The source of the radii of a style, and the factor on them.
    fn radius(&self, style: &Style) -> Result<(RadiusRule, f32), ResolveError> {
        let kind = style.surface().unwrap_or(SurfaceKind::Spheres);
        let rule = |setting| radius::rule(setting, kind, self.survey);
        let usual = &self.manifest.input.radius;
        Ok(match (&style.radius, style.draw) {
            (RadiusSetting::Auto, StyleDraw::Sticks) => {
                (RadiusRule::Common(narrow(STICK * self.reach)), 1.0)
            }
            (RadiusSetting::Auto, StyleDraw::BallsAndSticks) => (rule(usual)?, BALL),
            (RadiusSetting::Auto, _) => (rule(usual)?, 1.0),
            (own, _) => (rule(own)?, 1.0),
        })
    }

    /// The bonds of a style with this rule and factor for its radii.
    fn bonds(
        &self,
        scene: &mut Scene,
        style: &Style,
        color: &ColorRule,
        (radius, factor): (&RadiusRule, f32),
    ) -> Result<Option<BondStyle>, ResolveError> {
        let own = style.bonds.clone().unwrap_or_default();
        // Find them as in [bonds], or in the file, or by the distances of atoms
        let has_elements = self.survey.attributes.iter().any(|name| name == ELEMENT);
        let search = match own.find.unwrap_or(self.manifest.bonds.find) {
            BondSearch::None if own.find.is_some() => return Ok(None),
            BondSearch::None if self.manifest.input.topology.is_some() || !has_elements => {
                BondSearch::File
            }
            BondSearch::None => BondSearch::Covalent,
            given => given,
        };
        let Some(rule) = bond_rule(search, self.survey, "style.bonds")? else {
            return Ok(None);
        };
        // Atoms of sticks are as thick as these
        let largest = f64::from(radius::reach(radius, self.survey)) * f64::from(factor);
        let radius = own.radius.unwrap_or_else(|| match style.draw {
            StyleDraw::BallsAndSticks => narrow(STICK_OF_BALLS * largest),
            _ => narrow(largest),
        });
        let look = look(scene, radius, &ColorSetting::Auto, Some(color.clone()));
        Ok(look.map(|look| BondStyle { rule, look }))
    }
}
