//! Materials: reflection and refraction at surfaces.
//!
//! To add a material, add a file here and a line in [`materials_of`].

use crate::scene::{Scene, ground};

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

/// The materials of `scene` by [`MaterialId`](crate::surface::MaterialId). `is_connected`: the particles bound one
/// body. Ground, spray and meshes are matte.
pub(super) fn materials_of(scene: &Scene, is_connected: bool) -> Vec<Box<dyn Material>> {
    let matte = || -> Box<dyn Material> {
        let constants =
            WhittedMaterial::matte(ground::AMBIENT, ground::DIFFUSE, scene.ambient_light);
        Box::new(TwoSided(constants))
    };
    let mut constants = WhittedMaterial::new(&scene.material, scene.ambient_light);
    let particles: Box<dyn Material> = if is_connected && constants.dielectric.transmission > 0.0 {
        if !constants.has_color() {
            constants.min_highlight = MIN_HIGHLIGHT;
        }
        Box::new(Interface(constants))
    } else {
        Box::new(TwoSided(constants))
    };
    let others = (0..2 + scene.meshes.len()).map(|_| matte());
    std::iter::once(particles).chain(others).collect()
}
