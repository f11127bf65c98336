//! `[material]`: what particles are made of.

use super::color::{ColorSetting, rgb_to_1};
use super::length::AutoLength;
use super::named;
use super::reader::{Field, Section};
use super::write::Entries;
use crate::scene;

named! {
    /// How much of the light a surface mirrors, by the angle.
    Fresnel {
        /// By Schlick for spheres, as in the thesis, exactly for one body.
        Auto = "auto",
        /// Schlick's approximation.
        Schlick = "schlick",
        /// The equations of Fresnel for light without polarisation.
        Exact = "exact",
    }
}

/// `[material]`, the terms of the thesis's equations 4.1 to 4.3.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// The particles' colour.
    pub color: ColorSetting,
    /// Weight of light from everywhere.
    pub ambient: f32,
    /// Weight of light that is scattered.
    pub diffuse: f32,
    /// Weight of highlights.
    pub specular: f32,
    /// Exponent of highlights.
    pub shininess: f32,
    /// Index of refraction.
    pub ior: f32,
    /// Weight of what is mirrored, 0 to 1, times what Fresnel says.
    pub reflection: f32,
    /// Weight of what shows through, 0 to 1; 0 is opaque.
    pub transmission: f32,
    /// How much is mirrored at which angle.
    pub fresnel: Fresnel,
    /// What is left of white light after [`Self::absorption_length`] inside, linear RGB.
    pub absorption: [f32; 3],
    /// The way inside for that.
    pub absorption_length: AutoLength,
}

impl Default for Material {
    fn default() -> Self {
        let scene::Material {
            ambient,
            diffuse,
            specular,
            shininess,
            ior,
            reflection,
            transmission,
            fresnel: _,
            extinction: _,
        } = scene::Material::DEFAULT;
        Self {
            color: ColorSetting::Auto,
            ambient,
            diffuse,
            specular,
            shininess,
            ior,
            reflection,
            transmission,
            fresnel: Fresnel::Auto,
            absorption: [1.0; 3],
            absorption_length: AutoLength::Auto,
        }
    }
}

impl Material {
    pub(super) fn read(mut section: Section<'_>) -> Self {
        let default = Self::default();
        let from_0 = |f: &Field<'_>| f.number32("a number from 0", |v| v >= 0.0);
        let above_0 = |f: &Field<'_>| f.number32("a number above 0", |v| v > 0.0);
        let weight =
            |f: &Field<'_>| f.number32("a number from 0 to 1", |v| (0.0..=1.0).contains(&v));
        let material = Self {
            color: section.value("color", default.color, ColorSetting::read),
            ambient: section.value("ambient", default.ambient, from_0),
            diffuse: section.value("diffuse", default.diffuse, from_0),
            specular: section.value("specular", default.specular, from_0),
            shininess: section.value("shininess", default.shininess, above_0),
            ior: section.value("ior", default.ior, above_0),
            reflection: section.value("reflection", default.reflection, weight),
            transmission: section.value("transmission", default.transmission, weight),
            fresnel: section.value("fresnel", default.fresnel, |f| f.choice(Fresnel::ALL)),
            absorption: section.value("absorption", default.absorption, rgb_to_1),
            absorption_length: section.value(
                "absorption_length",
                default.absorption_length,
                AutoLength::read,
            ),
        };
        section.finish();
        material
    }

    pub(super) fn entries(&self, out: &mut Entries) {
        out.section("material");
        out.put(
            "color",
            &self.color,
            "auto (by speed), linear RGB, or { attribute = \"velocity\", map = \"viridis\", range = [0.0, 4.0] }",
        );
        out.put("ambient", &self.ambient, "light from everywhere");
        out.put("diffuse", &self.diffuse, "scattered light");
        out.put("specular", &self.specular, "highlights");
        out.put("shininess", &self.shininess, "exponent of highlights");
        out.put("ior", &self.ior, "index of refraction; water is 1.33");
        out.put(
            "reflection",
            &self.reflection,
            "0 to 1, times the Fresnel term",
        );
        out.put(
            "transmission",
            &self.transmission,
            "0 (opaque) to 1, times the rest of the Fresnel term",
        );
        out.put(
            "fresnel",
            &self.fresnel,
            "auto | schlick | exact; auto is schlick for spheres, exact for one body",
        );
        out.put(
            "absorption",
            &self.absorption,
            "linear RGB that white becomes on its way inside; [1, 1, 1] is clear",
        );
        out.put(
            "absorption_length",
            &self.absorption_length,
            "how long that way is: auto, or a length",
        );
    }
}
