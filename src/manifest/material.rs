//! `[material]`: the material of the particles.

use glam::Vec3;

use super::color::ColorSetting;
use super::key::{Keys, keys};
use super::value::named;
use crate::scene::{self, Fresnel};

named!(Fresnel: Schlick = "schlick", Exact = "exact");

pub(super) const ABOUT: &[&str] = &["Material of the particles"];

/// `[material]`, the terms of the thesis's equations 4.1 to 4.3.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// Source of the colours.
    pub color: ColorSetting,
    /// The constants, except `fresnel` and `extinction`, which follow from the fields below.
    pub constants: scene::Material,
    /// The Fresnel equations; by default Schlick's approximation for spheres, as in the thesis, and the exact ones
    /// for a union or a smooth surface.
    pub fresnel: Option<Fresnel>,
    /// Transmittance of white light over [`Self::absorption_length`] inside, linear RGB.
    pub absorption: Vec3,
    /// The length for `absorption`; by default it depends on the extent of the particles.
    pub absorption_length: Option<f64>,
}

impl Default for Material {
    fn default() -> Self {
        Self {
            color: ColorSetting::Auto,
            constants: scene::Material::DEFAULT,
            fresnel: None,
            absorption: Vec3::ONE,
            absorption_length: None,
        }
    }
}

impl Material {
    pub(super) fn keys(&mut self, keys: &mut Keys<'_>) {
        let constants = &mut self.constants;
        keys!(keys:
            /// Colour: auto (by speed), linear RGB, or { attribute = "velocity", map = "viridis", range = [0.0, 4.0] }
            color => self.color;
            /// Weight of ambient light
            ambient => constants.ambient, from(0);
            /// Weight of diffuse reflection
            diffuse => constants.diffuse, from(0);
            /// Weight of specular highlights
            specular => constants.specular, from(0);
            /// Exponent of specular highlights
            shininess => constants.shininess, above(0);
            /// Index of refraction; water is 1.33
            ior => constants.ior, above(0);
            /// Weight of reflected rays, 0 to 1; a factor on the Fresnel reflectance
            reflection => constants.reflection, from(0), to(1);
            /// Weight of refracted rays, 0 (opaque) to 1; a factor on the Fresnel transmittance
            transmission => constants.transmission, from(0), to(1);
            /// Fresnel equations: auto | schlick | exact; auto is schlick for spheres, exact for union and smooth
            fresnel => self.fresnel, or("auto");
            /// Colour of white light after absorption_length inside, linear RGB; [1, 1, 1] is clear
            absorption => self.absorption, to(1);
            /// Distance after which white light has the colour absorption, or auto
            absorption_length => self.absorption_length, or("auto"), unit("a length"), above(0), single();
        );
    }
}
