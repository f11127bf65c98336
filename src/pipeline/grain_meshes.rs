//! The meshes of the grains of styles, which all frames share.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DVec3, Vec3};
use spherule_formats::mesh::read_mesh;
use spherule_formats::{FrameError, MemoryBudget};

use super::meshes::CREASE_ANGLE;
use crate::manifest::{GrainKind, MeshPath, Style};
use crate::surface::grains::{GrainMesh, GrainMeshError, MAX_GRAIN_TRIANGLES};
use crate::surface::mesh::MeshNormals;

/// Memory for reading a mesh, bytes: ten times what a mesh with the largest number of triangles needs as binary STL.
const MAX_BYTES: u64 = 1 << 30;

/// What to do about a mesh that needs more.
const SIMPLIFY: &str = "simplify it: grains have at most 1000000 triangles";
const _: () = assert!(MAX_GRAIN_TRIANGLES == 1_000_000, "SIMPLIFY names it");

/// Why a mesh cannot be that of grains.
#[derive(Debug, thiserror::Error)]
pub enum GrainMeshLoadError {
    /// Its file cannot be read.
    #[error(transparent)]
    File(#[from] FrameError),
    /// It is not the surface of a body.
    #[error("{}: {source}{}", path.display(), remedy(source))]
    Mesh {
        /// The file.
        path: PathBuf,
        /// Why.
        source: GrainMeshError,
    },
}

fn remedy(error: &GrainMeshError) -> &'static str {
    match error {
        GrainMeshError::Open { .. } | GrainMeshError::Orientation { .. } => {
            "; repair it, or draw its convex hull (shape = \"convex-hull\")"
        }
        _ => "",
    }
}

/// The meshes of the grains of all styles, each once.
#[derive(Debug, Clone, Default)]
pub struct GrainMeshes(Vec<(MeshPath, GrainKind, Arc<GrainMesh>)>);

impl GrainMeshes {
    /// The mesh of `style`, if it has one.
    pub fn of(&self, style: &Style) -> Option<&Arc<GrainMesh>> {
        let mut all = self.0.iter();
        let is_own = |(path, kind, _): &&(MeshPath, GrainKind, _)| {
            Some(path) == style.mesh.as_ref() && Some(*kind) == style.grain_kind()
        };
        all.find(is_own).map(|(.., mesh)| mesh)
    }

    /// Reads the mesh of `style` in the file at `path`, unless another style has it.
    ///
    /// # Errors
    /// It cannot be read, or is not the surface of a body.
    pub fn add(
        &mut self,
        style: &Style,
        path: &Path,
        budget: MemoryBudget,
    ) -> Result<(), GrainMeshLoadError> {
        let (Some(own), Some(kind)) = (&style.mesh, style.grain_kind()) else { return Ok(()) };
        if self.of(style).is_none() {
            self.0.push((own.clone(), kind, Arc::new(load(path, kind, budget)?)));
        }
        Ok(())
    }
}

/// Reads the mesh in the file at `path`, or its convex hull.
fn load(
    path: &Path,
    kind: GrainKind,
    budget: MemoryBudget,
) -> Result<GrainMesh, GrainMeshLoadError> {
    let limit = MemoryBudget::new(MAX_BYTES, SIMPLIFY);
    let file = read_mesh(path, if budget.bytes() < MAX_BYTES { budget } else { limit })?;
    let vertex = |v: [f64; 3]| DVec3::from_array(v).as_vec3();
    let vertices: Vec<Vec3> = file.vertices.into_iter().map(vertex).collect();
    let mesh = match kind {
        GrainKind::ConvexHull => GrainMesh::convex(&vertices),
        _ => {
            let normals = MeshNormals::Smooth(CREASE_ANGLE.to_radians());
            GrainMesh::new(vertices, file.triangles, normals)
        }
    };
    mesh.map_err(|source| GrainMeshLoadError::Mesh { path: path.to_owned(), source })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TETRAHEDRON: &str =
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";

    fn loaded(obj: &str, kind: GrainKind, budget: MemoryBudget) -> Result<usize, String> {
        let directory = tempfile::tempdir().expect("a directory");
        let path = directory.path().join("grain.obj");
        std::fs::write(&path, obj).expect("a file");
        let mesh = load(&path, kind, budget).map_err(|error| error.to_string());
        mesh.map(|mesh| mesh.triangle_count())
    }

    #[test]
    fn errors_name_the_file_and_a_remedy() {
        let load = |obj: &str, kind| loaded(obj, kind, MemoryBudget::UNLIMITED);
        assert_eq!(load(TETRAHEDRON, GrainKind::Mesh), Ok(4));
        // Without a triangle, it is open
        let open = TETRAHEDRON.replace("f 3 1 4\n", "");
        assert_eq!(load(&open, GrainKind::ConvexHull), Ok(4));
        let fails = |obj: &str, kind, parts: [&str; 2]| {
            let error = load(obj, kind).expect_err("not a grain");
            assert!(error.contains("grain.obj: "), "{error}");
            assert!(parts.iter().all(|part| error.contains(part)), "{error}");
        };
        fails(&open, GrainKind::Mesh, ["is not closed", "shape = \"convex-hull\""]);
        fails("v 0 0 0\nv 1 0 0\nv 0 1 0\n", GrainKind::Mesh, ["no faces", ""]);
        fails("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", GrainKind::ConvexHull, ["in a plane", ""]);
        let turned = TETRAHEDRON.replace("f 3 1 4", "f 1 3 4");
        fails(&turned, GrainKind::Mesh, ["has no outside", "repair it"]);
        let tight = loaded(TETRAHEDRON, GrainKind::Mesh, MemoryBudget::new(99, "take less"));
        assert!(tight.is_err_and(|error| error.contains("take less")));
    }
}
