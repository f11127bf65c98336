//! `[material]`: the material of the particles.

use std::collections::BTreeMap;

use glam::Vec3;
use spherule_tracer::scene::material::MAX_ANISOTROPY;
use spherule_tracer::scene::{self, Finish, Fresnel};

use super::absorption::Absorption;
use super::color::ColorSetting;
use super::key::{Affects, Key};
use super::keys::{Keys, keys};
use super::opacity::OpacitySetting;
use super::part::{self, Part, ROUGHNESS};
use super::value::named;

named!(Fresnel: Schlick = "schlick", Exact = "exact");

named! {
    /// Kinds of materials.
    MaterialKind {
        /// Light leaves in all directions alike.
        Matte = "matte",
        /// A matte base under a clear coat.
        Plastic = "plastic",
        /// A mirror in the base colour.
        Metal = "metal",
        /// A clear body of glass.
        Glass = "glass",
        /// A clear body of water.
        Water = "water",
        /// The terms of the thesis's model.
        Whitted = "whitted",
    }
}

pub(super) const ABOUT: &[&str] = &["Material of the particles"];

/// The comment of `type`.
const TYPE: &str = "Kind: auto (matte, or clear with transmission) | matte | plastic | metal | glass | water | whitted (as auto)";

/// Details of `type`.
const KINDS: [&str; 3] = [
    "Plastic and metal need integrator = \"path\"; other integrators treat them as whitted. Glass and water set",
    "reflection and transmission to 1 and use the exact Fresnel equations; the index of refraction of glass is 1.5 and",
    "that of water 1.333, unless ior has another value than 1.33.",
];

/// `[material]`, the terms of the thesis's equations 4.1 to 4.3.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// Kind of material; by default that of the terms in [`Self::constants`].
    pub kind: Option<MaterialKind>,
    /// Roughness, 0 to 1. Glass and water are smooth at the default.
    pub roughness: f32,
    /// Source of the colours.
    pub color: ColorSetting,
    /// How much each sphere covers of what is behind it.
    pub opacity: OpacitySetting,
    /// The constants, except `fresnel` and `extinction`, which follow from the fields below.
    pub constants: scene::Material,
    /// The Fresnel equations; by default Schlick's approximation for spheres, as in the thesis, and the exact ones
    /// for a union or a smooth surface.
    pub fresnel: Option<Fresnel>,
    /// Transmittance of white light over [`Self::absorption_length`] inside.
    pub absorption: Absorption,
    /// The length for `absorption`; by default it depends on the extent of the particles.
    pub absorption_length: Option<f64>,
    /// Colour of the light that the medium inside scatters, linear RGB: the scattering coefficient times
    /// [`Self::scattering_length`].
    pub scattering: Vec3,
    /// The mean distance between two scattering events where `scattering` is 1; by default it depends on the extent of the
    /// particles.
    pub scattering_length: Option<f64>,
    /// Mean cosine of the angle by which the medium inside deflects light.
    pub anisotropy: f32,
    /// Materials of parts of the particles.
    pub parts: Vec<Part>,
}

impl Default for Material {
    fn default() -> Self {
        Self {
            kind: None,
            roughness: ROUGHNESS,
            color: ColorSetting::Auto,
            opacity: OpacitySetting::Constant(1.0),
            constants: scene::Material::DEFAULT,
            fresnel: None,
            absorption: Absorption::default(),
            absorption_length: None,
            scattering: Vec3::ZERO,
            scattering_length: None,
            anisotropy: 0.0,
            parts: Vec::new(),
        }
    }
}

/// Indices of refraction.
const GLASS: f32 = 1.5;
const WATER: f32 = 1.333;

impl Material {
    /// Whether light passes through the particles.
    pub fn is_clear(&self) -> bool {
        self.resolved(Fresnel::Exact).transmission > 0.0
    }

    /// Whether the particles are seen in their colours: opaque, or as clear bodies that absorb light by them.
    pub fn shows_colors(&self) -> bool {
        !self.is_clear() || self.absorption == Absorption::OfParticles
    }

    /// The first term of the thesis's model with another value than its default. All but `transmission` have no effect
    /// on opaque surfaces in path tracing.
    pub(super) fn changed_term(&self) -> Option<&'static str> {
        let (own, usual) = (&self.constants, &scene::Material::DEFAULT);
        let terms = [
            ("ambient", own.ambient, usual.ambient),
            ("diffuse", own.diffuse, usual.diffuse),
            ("specular", own.specular, usual.specular),
            ("shininess", own.shininess, usual.shininess),
            ("reflection", own.reflection, usual.reflection),
            ("transmission", own.transmission, usual.transmission),
        ];
        let changed = terms.iter().find(|(_, own, usual)| own != usual);
        changed.map(|(name, ..)| *name)
    }

    /// The constants, except `extinction`, with those that the kind of material sets. `fresnel` is the formula unless
    /// the kind or a key sets one.
    pub fn resolved(&self, fresnel: Fresnel) -> scene::Material {
        let roughness = self.roughness;
        let opaque = |finish| scene::Material { transmission: 0.0, finish, ..self.constants };
        let clear = |ior| scene::Material {
            reflection: 1.0,
            transmission: 1.0,
            ior: if self.constants.ior == scene::Material::DEFAULT.ior {
                ior
            } else {
                self.constants.ior
            },
            fresnel: Fresnel::Exact,
            // Glass and water of manifests that name every key with its default stay smooth
            interface_roughness: if roughness == ROUGHNESS { 0.0 } else { roughness },
            ..self.constants
        };
        let usual = scene::Material { fresnel, ..self.constants };
        let found = match self.kind {
            None | Some(MaterialKind::Whitted) => usual,
            Some(MaterialKind::Matte) => opaque(Finish::Matte),
            Some(MaterialKind::Plastic) => opaque(Finish::Plastic { roughness }),
            Some(MaterialKind::Metal) => opaque(Finish::Metal { roughness }),
            Some(MaterialKind::Glass) => clear(GLASS),
            Some(MaterialKind::Water) => clear(WATER),
        };
        scene::Material { fresnel: self.fresnel.unwrap_or(found.fresnel), ..found }
    }

    /// All keys, including those of `[[material.part]]`.
    pub(super) fn all_keys(&mut self, keys: &mut Keys<'_>) {
        self.keys(keys);
        let (items, mut named, mut index) = (&mut self.parts, BTreeMap::new(), 0);
        keys.list("part", "material.part", part::ABOUT, items, |part, keys| {
            part.keys(keys, &mut named, index);
            index += 1;
        });
    }

    fn keys(&mut self, keys: &mut Keys<'_>) {
        let constants = &mut self.constants;
        let key = Key::new("type", &[TYPE, "", KINDS[0], KINDS[1], KINDS[2]]).or("auto");
        keys.key(key, &mut self.kind);
        keys!(keys:
            /// Roughness of plastic, metal, glass and water, 0 (smooth) to 1
            ///
            /// Glass and water are smooth unless it has another value than 0.55.
            roughness => self.roughness, from(0), to(1), affects(Affects::PathTracing);
            /// Colour: auto (by speed), linear RGB, or { attribute = "velocity", map = "viridis", range = [0.0, 4.0] }
            ///
            /// `attribute` is an attribute (a vector by its length), a component such as "velocity.x", or speed,
            /// vx, vy, vz, x, y, z, height, depth, index or radius. `range` may be percentiles of the sequence, "1%-99%", or "symmetric" around 0.
            /// `scale` is linear, log, symlog (linear up to `threshold`) or categorical (integers, with `names` such as
            /// { 1 = "water" } and colours of your own, `values` such as { 1 = [0.1, 0.3, 0.8] }). `map` is reversed by
            /// `reverse = true` or a name with _r, and divided into bands by `steps = 8`. "elements" has the usual
            /// colours of chemical elements, by the attribute `element`.
            color => self.color, flag("color", "COLOR", "Look");
            /// Opacity of spheres, 0 to 1, or { attribute = "density", range = [990.0, 1010.0] }
            ///
            /// The values of `range` have the opacities 0 and 1. The attribute is named as for `color`. Glass, water,
            /// unions and smooth surfaces have no opacity.
            opacity => self.opacity, flag("opacity", "OPACITY", "Look");
            /// Weight of ambient light
            ambient => constants.ambient, from(0);
            /// Weight of diffuse reflection
            diffuse => constants.diffuse, from(0);
            /// Weight of specular highlights
            specular => constants.specular, from(0);
            /// Exponent of specular highlights
            shininess => constants.shininess, above(0);
            /// Index of refraction
            ior => constants.ior, above(0);
            /// Weight of reflected rays, 0 to 1; a factor on the Fresnel reflectance
            reflection => constants.reflection, from(0), to(1);
            /// Weight of refracted rays, 0 (opaque) to 1; a factor on the Fresnel transmittance
            transmission => constants.transmission, from(0), to(1);
            /// Fresnel equations: auto | schlick | exact; auto is schlick for spheres, exact for union and smooth
            fresnel => self.fresnel, or("auto");
            /// Colour of white light after absorption_length inside, linear RGB; [1, 1, 1] is clear; "color" is that of color
            ///
            /// With "color", light takes the colours of the particles, by an attribute and a map. Between the points where
            /// a ray enters and leaves the body, absorption is the mean of both.
            absorption => self.absorption, from(0), to(1);
            /// Distance after which white light has the colour absorption, or auto
            absorption_length => self.absorption_length, or("auto"), unit("a length"), above(0), single();
            /// Colour of the light that the medium inside scatters, linear RGB; [0, 0, 0] scatters none
            ///
            /// For glass and water with integrator = "path". The scattering coefficient is scattering divided by
            /// scattering_length.
            scattering => self.scattering, from(0), to(1), affects(Affects::PathTracing);
            /// Mean distance between two scattering events where scattering is 1, or auto
            scattering_length => self.scattering_length, or("auto"), unit("a length"), above(0), single(),
                affects(Affects::PathTracing);
            /// Mean cosine of the angle of scattering: -0.95 (backwards), 0 (to all sides alike) to 0.95 (forwards)
            anisotropy => self.anisotropy, from(-MAX_ANISOTROPY), to(MAX_ANISOTROPY), single(),
                affects(Affects::PathTracing);
        );
    }
}
