//! Grains that are meshes.

use glam::DVec3;

use super::Hit;
use crate::grains::GrainMesh;
use crate::mesh::{MeshSurface, VisibleFaces};
use crate::{MaterialId, Shape, Side};
use spherule_tree::ray::Ray;

/// The first crossing of the surface of `mesh` from distance `from` on. The ray is in the coordinates of the mesh, and
/// `origin` is its point closest to the origin.
pub(super) fn first(mesh: &GrainMesh, origin: DVec3, direction: DVec3, from: f64) -> Option<Hit> {
    // Start at the sphere around the mesh or later, since single precision follows
    let length = direction.length();
    let start = (from * length).max(-1.001 * mesh.radius());
    let unit = direction / length;
    let ray = Ray::new((origin + start * unit).as_vec3(), unit.as_vec3());
    let surface = MeshSurface::new(mesh.tree(), VisibleFaces::Both, MaterialId::PARTICLES);
    let hit = surface.crossing(&ray, Side::Outside)?;
    Some(Hit {
        t: (start + f64::from(hit.t)) / length,
        gradient: hit.normal.as_dvec3(),
        shading: hit.shading.as_dvec3(),
    })
}
