//! The constants of Whitted's illumination model.

use glam::Vec3;

use super::dielectric::Dielectric;
use crate::scene;

/// The constants of eq. 4.1 to 4.3 for a scene.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct WhittedMaterial {
    /// `Ka` times the ambient light, linear RGB.
    pub(in crate::render) ambient: Vec3,
    pub(in crate::render) diffuse: f32,
    pub(in crate::render) specular: f32,
    pub(in crate::render) shininess: f32,
    /// Highlights up to this fraction of the light are ignored.
    pub(in crate::render) min_highlight: f32,
    /// Weight of the reflected ray.
    pub(in crate::render) reflection: f32,
    /// Fresnel terms, and the weight of the refracted ray.
    pub(in crate::render) dielectric: Dielectric,
}

impl WhittedMaterial {
    pub(in crate::render) fn new(material: &scene::Material, ambient_light: Vec3) -> Self {
        Self {
            ambient: material.ambient * ambient_light,
            diffuse: material.diffuse,
            specular: material.specular,
            shininess: material.shininess,
            min_highlight: 0.0,
            reflection: material.reflection,
            dielectric: Dielectric::new(material),
        }
    }

    /// Whether its base colour is visible.
    pub(in crate::render) fn has_color(&self) -> bool {
        self.ambient != Vec3::ZERO || self.diffuse > 0.0
    }

    /// Whether it reflects direct light.
    pub(in crate::render) fn scatters(&self) -> bool {
        self.diffuse > 0.0 || self.specular > 0.0
    }

    /// Whether reflected or refracted rays leave it.
    pub(in crate::render) fn sends_rays(&self) -> bool {
        self.reflection > 0.0 || self.dielectric.transmission > 0.0
    }
}
