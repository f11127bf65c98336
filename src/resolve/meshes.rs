//! The meshes next to the particles.

use glam::Vec3;
use spherule_formats::MemoryBudget;

use super::cell;
use crate::manifest::{self, Manifest, MeshShading};
use crate::pipeline::{CREASE_ANGLE, MeshSettings, MeshThing, PictureMesh, Setup};
use crate::scene::{Bounds, DEFAULT_MESH_COLOR, Finish, Material, Scene};
use crate::surface::mesh::MeshNormals;
use crate::survey::Survey;

/// Distance of the ground below a mesh, as a fraction of its size, so that rays do not hit both at once.
const GROUND_GAP: f32 = 1e-4;

/// How the files of the meshes of `manifest` become shapes. `budget` is for reading one of them.
pub fn mesh_settings(
    manifest: &Manifest,
    survey: &Survey,
    budget: MemoryBudget,
) -> Vec<MeshSettings> {
    // The extent of the particles shows whether a mesh has their unit
    let particles = Bounds { min: survey.min, max: survey.max };
    let settings = |mesh: &manifest::Mesh| MeshSettings {
        scale: mesh.scale,
        translate: mesh.translate,
        origin: survey.origin,
        normals: match mesh.normals {
            MeshShading::Smooth => MeshNormals::Smooth(CREASE_ANGLE.to_radians()),
            MeshShading::Flat => MeshNormals::Flat,
        },
        faces: mesh.faces,
        particle_extent: match survey.most_particles {
            0 => 0.0,
            _ => particles.diagonal(),
        },
        budget,
    };
    manifest.meshes.iter().map(settings).collect()
}

/// The `meshes` of the manifest, one for each of its entries, with their materials, which are added to `scene`.
pub(super) fn things(
    scene: &mut Scene,
    manifest: &Manifest,
    meshes: &[PictureMesh],
) -> Vec<MeshThing> {
    let own = manifest.meshes.iter();
    let materials: Vec<_> = own.map_while(|mesh| scene.add(material(mesh))).collect();
    let meshes = meshes.iter().cloned().zip(materials);
    meshes.map(|(mesh, material)| MeshThing { mesh, material }).collect()
}

/// Lowers an automatic ground below the cell, and below meshes that are the same in all frames.
pub(super) fn lower_ground(setup: &mut Setup, manifest: &Manifest, survey: &Survey) {
    let scene = &mut setup.picture.scene;
    // Lower the ground, and leave a gap
    if let Some(ground) = &mut scene.ground
        && manifest.render.ground_height.is_none()
    {
        let meshes = setup.picture.things.meshes.iter();
        let trees = meshes.filter_map(|thing| thing.mesh.tree.as_ref());
        let boxes = trees.filter_map(|tree| tree.bounds());
        let cells = cell::boxes(setup.picture.things.cell.as_ref(), survey);
        for [min, max] in boxes.chain(cells) {
            let lowest = Vec3::select(ground.up.cmpgt(Vec3::ZERO), min, max).dot(ground.up);
            let below = lowest - GROUND_GAP * (max - min).length();
            if below < ground.height {
                ground.raise(below - ground.height);
            }
        }
    }
}

fn material(mesh: &manifest::Mesh) -> Material {
    let roughness = mesh.roughness;
    let (color, finish) = match mesh.material {
        manifest::MeshMaterial::Matte => (DEFAULT_MESH_COLOR, Finish::Matte),
        manifest::MeshMaterial::Plastic => (DEFAULT_MESH_COLOR, Finish::Plastic { roughness }),
        manifest::MeshMaterial::Metal => (DEFAULT_MESH_COLOR, Finish::Metal { roughness }),
        manifest::MeshMaterial::Glass => (Vec3::ONE, Finish::Pane),
    };
    Material { finish, is_holdout: mesh.holdout, ..Material::matte(mesh.color.unwrap_or(color)) }
}
