//! Materials: reflection and refraction at surfaces.
//!
//! To add a material, add a file here and a line in [`material_of`].

use crate::scene::{MaterialId, Scene};

mod blinn_phong;
mod dielectric;
mod interface;
mod material;
mod points;
mod rough;
mod two_sided;
mod whitted;

pub(super) use blinn_phong::reflect_lights;
pub(super) use dielectric::{Dielectric, attenuate, cross_straight, leaving};
use interface::Interface;
pub(super) use material::Material;
pub(super) use points::ShadingPoints;
pub(super) use rough::RoughInterface;
use two_sided::TwoSided;
pub(super) use whitted::WhittedMaterial;

/// Highlights of clear bodies below this fraction of the light count as dark.
const MIN_HIGHLIGHT: f32 = 1.0 / 4096.0;

/// The material `id` of `scene`. `is_connected`: the particles bound one body.
pub(super) fn material_of(scene: &Scene, id: MaterialId, is_connected: bool) -> Box<dyn Material> {
    let mut constants = WhittedMaterial::new(scene.material(id), scene.ambient_light);
    let is_clear = constants.dielectric.transmission > 0.0;
    if id == MaterialId::PARTICLES && is_connected && is_clear {
        if !constants.has_color() {
            constants.min_highlight = MIN_HIGHLIGHT;
        }
        return Box::new(Interface(constants));
    }
    Box::new(TwoSided(constants))
}
