//! The meshes of pictures: tanks, obstacles and other bodies next to the particles. One that does not change is read
//! once for a run; otherwise each frame reads its own.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DVec3, Vec3};
use spherule_formats::mesh::read_mesh;
use spherule_formats::{FrameError, MemoryBudget};

use super::ImageTask;
use super::shutter::Shutter;
use crate::scene::MaterialId;
use crate::surface::mesh::{MeshError, MeshNormals, MeshTree, TriangleMesh, VisibleFaces};

/// How many times a mesh may be larger or smaller than the particles before that is noted. A tank in millimetres around
/// particles in metres is a thousand times its usual size, which may be a few times larger or smaller than they are.
const USUAL_RATIO: f64 = 300.0;

/// Edges of meshes of a greater angle are sharp, degrees.
pub const CREASE_ANGLE: f32 = 40.0;

/// How the file of a mesh becomes a shape.
#[derive(Debug, Clone, PartialEq)]
pub struct MeshSettings {
    /// Factor on the coordinates of the file.
    pub scale: f64,
    /// Translation after scaling, world units.
    pub translate: DVec3,
    /// World position that all coordinates are relative to.
    pub origin: DVec3,
    /// The normals that shade it.
    pub normals: MeshNormals,
    /// The faces that rays can hit.
    pub faces: VisibleFaces,
    /// Diagonal of the box of the particles, world units; 0 if it is unknown.
    pub particle_extent: f64,
    /// Memory for reading a file.
    pub budget: MemoryBudget,
}

/// A mesh of all pictures with its material.
#[derive(Debug, Clone)]
pub struct MeshThing {
    /// The mesh.
    pub mesh: PictureMesh,
    /// Its material.
    pub material: MaterialId,
}

/// A mesh of all pictures.
#[derive(Debug, Clone)]
pub struct PictureMesh {
    /// How files become shapes.
    pub settings: MeshSettings,
    /// The mesh; None if each frame has its own ([`ImageTask::meshes`]).
    pub tree: Option<Arc<MeshTree>>,
}

/// A mesh that was read.
#[derive(Debug, Clone)]
pub struct LoadedMesh {
    /// The mesh with its hierarchy.
    pub tree: Arc<MeshTree>,
    /// Notes for the user.
    pub notes: Vec<String>,
}

/// Why a mesh cannot be rendered.
#[derive(Debug, thiserror::Error)]
pub enum MeshLoadError {
    /// Its file cannot be read.
    #[error(transparent)]
    File(#[from] FrameError),
    /// The file of a frame does not exist.
    #[error(
        "{}: the mesh of the frame does not exist; write it, or select frames that have one (input.frames)",
        path.display()
    )]
    Missing {
        /// The file.
        path: PathBuf,
    },
    /// No triangle can be seen.
    #[error(
        "{}: no triangle can be rendered: {not_finite} have a coordinate that is not finite or too large, \
         {degenerate} have no area",
        path.display()
    )]
    Invisible {
        /// The file.
        path: PathBuf,
        /// Number of triangles with a coordinate that is not finite in single precision.
        not_finite: usize,
        /// Number of triangles without an area.
        degenerate: usize,
    },
    /// There are too many triangles.
    #[error("{}: {source}", path.display())]
    Mesh {
        /// The file.
        path: PathBuf,
        /// Why.
        source: MeshError,
    },
}

/// The vertices of a file relative to the origin, and its triangles.
struct RawMesh {
    vertices: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

impl RawMesh {
    fn read(path: &Path, settings: &MeshSettings) -> Result<Self, MeshLoadError> {
        let file = read_mesh(path, settings.budget)?;
        let vertex = |v: [f64; 3]| {
            (DVec3::from_array(v) * settings.scale + settings.translate - settings.origin).as_vec3()
        };
        Ok(Self {
            vertices: file.vertices.into_iter().map(vertex).collect(),
            triangles: file.triangles,
        })
    }

    /// The mesh on its way to `other`, which has the same triangles: there at 1, beyond it above.
    fn towards(&self, other: &Self, part: f32) -> Self {
        let vertices = self.vertices.iter().zip(&other.vertices);
        Self {
            vertices: vertices.map(|(a, b)| *a + part * (*b - *a)).collect(),
            triangles: self.triangles.clone(),
        }
    }
}

/// Reads the mesh in the file at `path`.
///
/// # Errors
/// See [`MeshLoadError`].
pub fn load_mesh(path: &Path, settings: &MeshSettings) -> Result<LoadedMesh, MeshLoadError> {
    build_mesh(path, RawMesh::read(path, settings)?, settings)
}

/// Builds the mesh of the file at `path`.
fn build_mesh(
    path: &Path,
    file: RawMesh,
    settings: &MeshSettings,
) -> Result<LoadedMesh, MeshLoadError> {
    let vertices = file.vertices;
    // Count the triangles that cannot be seen
    let is_finite = |corners: &[u32; 3]| {
        let mut corners = corners.iter().map(|v| vertices.get(*v as usize));
        corners.all(|v| v.is_some_and(|v| v.is_finite()))
    };
    let total = file.triangles.len();
    let not_finite = total - file.triangles.iter().filter(|t| is_finite(t)).count();
    // Build the mesh and its tree
    let mesh = TriangleMesh::new(vertices, file.triangles, settings.normals)
        .map_err(|source| MeshLoadError::Mesh { path: path.to_owned(), source })?;
    let degenerate = total - mesh.len() - not_finite;
    if mesh.is_empty() {
        return Err(MeshLoadError::Invisible { path: path.to_owned(), not_finite, degenerate });
    }
    let tree = MeshTree::new(mesh);
    // Report what is left out
    let mut notes = Vec::new();
    for (count, why) in
        [(not_finite, "a coordinate is not finite or too large"), (degenerate, "without an area")]
    {
        if count > 0 {
            let path = path.display();
            notes.push(format!("{path}: {count} of {total} triangles left out: {why}"));
        }
    }
    notes.extend(ratio_note(path, &tree, settings.particle_extent));
    Ok(LoadedMesh { tree: Arc::new(tree), notes })
}

/// A note if the mesh is much larger or smaller than the particles, so that its unit is probably another one.
fn ratio_note(path: &Path, tree: &MeshTree, particles: f64) -> Option<String> {
    let [min, max] = tree.bounds()?;
    let extent = (max - min).as_dvec3().length();
    let ratio = extent / particles;
    let is_usual = (1.0 / USUAL_RATIO..USUAL_RATIO).contains(&ratio);
    if is_usual || !(extent > 0.0 && particles > 0.0) {
        return None;
    }
    let path = path.display();
    let (factor, size) = if ratio > 1.0 { (ratio, "larger") } else { (1.0 / ratio, "smaller") };
    Some(format!(
        "{path}: the mesh is {factor:.0} times {size} than the particles; if it is in another unit, set mesh.scale \
         (0.001 for millimetres to metres)"
    ))
}

/// A mesh in each slice of the exposure; one tree if it does not move.
pub type MeshSlices = Vec<Arc<MeshTree>>;

/// The meshes of a picture for the image of `task`: those of all pictures, and its own, which move to those of the
/// next frame while the shutter is open. Passes notes to `notes`.
///
/// # Errors
/// One of its own cannot be read.
pub(super) fn meshes_of(
    things: &[MeshThing],
    shutter: Option<Shutter>,
    task: &ImageTask,
    notes: &mut Vec<String>,
) -> Result<Vec<MeshSlices>, MeshLoadError> {
    let mut own = (0..).zip(&task.meshes);
    let mut all = Vec::with_capacity(things.len());
    // Take the common mesh, or read that of the frame
    for MeshThing { mesh, .. } in things {
        if let Some(tree) = &mesh.tree {
            all.push(vec![Arc::clone(tree)]);
        } else if let Some((number, path)) = own.next() {
            let next = task.next_meshes.as_ref().zip(shutter);
            let slices = match next.and_then(|(next, s)| Some((next.files.get(number)?, next, s))) {
                Some((file, next, shutter)) => {
                    let times =
                        shutter.slice_times().map(|time| time / f64::from(next.steps)).collect();
                    moving_mesh(path, file, times, &mesh.settings, notes)
                }
                None => load_mesh(path, &mesh.settings).map(|mesh| vec![mesh]),
            };
            let slices = slices.map_err(|e| missing(e, path))?;
            notes.extend(slices[0].notes.iter().cloned());
            all.push(slices.into_iter().map(|mesh| mesh.tree).collect());
        }
    }
    Ok(all)
}

/// The mesh at `path` at each of `times` on its way to the one at `next`, at time 1. It does not move if that one has
/// other triangles, or cannot be read.
fn moving_mesh(
    path: &Path,
    next: &Path,
    times: Vec<f64>,
    settings: &MeshSettings,
    notes: &mut Vec<String>,
) -> Result<Vec<LoadedMesh>, MeshLoadError> {
    let file = RawMesh::read(path, settings)?;
    let not_blurred = match RawMesh::read(next, settings) {
        Ok(other) if other.triangles == file.triangles => {
            #[expect(clippy::cast_possible_truncation, reason = "fractions of a step")]
            let slices = times
                .into_iter()
                .map(|time| file.towards(&other, time as f32))
                .map(|slice| build_mesh(path, slice, settings));
            return slices.collect();
        }
        Ok(_) => format!("{} has other triangles", next.display()),
        Err(error) => error.to_string(),
    };
    notes.push(format!("{}: not blurred by motion: {not_blurred}", path.display()));
    Ok(vec![build_mesh(path, file, settings)?])
}

fn missing(error: MeshLoadError, path: &Path) -> MeshLoadError {
    match error {
        MeshLoadError::File(FrameError::Io { source, .. })
            if source.kind() == io::ErrorKind::NotFound =>
        {
            let path = path.to_owned();
            MeshLoadError::Missing { path }
        }
        error => error,
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    /// The settings for particles of extent 1 around the origin of the world.
    const SETTINGS: MeshSettings = MeshSettings {
        scale: 1.0,
        translate: DVec3::ZERO,
        origin: DVec3::ZERO,
        normals: MeshNormals::Flat,
        faces: VisibleFaces::Both,
        particle_extent: 1.0,
        budget: MemoryBudget::UNLIMITED,
    };

    fn load(obj: &str, settings: &MeshSettings) -> Result<LoadedMesh, String> {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("m.obj");
        fs::write(&path, obj).unwrap();
        load_mesh(&path, settings).map_err(|e| e.to_string())
    }

    const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

    #[test]
    fn vertices_are_rounded_relative_to_the_origin() {
        let far = MeshSettings {
            scale: 0.5,
            translate: DVec3::splat(1e9),
            origin: DVec3::splat(1e9 - 2.0),
            ..SETTINGS
        };
        let mesh = load(TRIANGLE, &far).unwrap();
        let bounds = [Vec3::splat(2.0), Vec3::new(2.5, 2.5, 2.0)];
        assert_eq!(mesh.tree.bounds(), Some(bounds));
        assert!(mesh.notes.is_empty());
    }

    #[test]
    fn triangles_that_cannot_be_seen_are_counted() {
        let bad = "v nan 0 0\nv 1e300 0 0\nv 2 0 0\nf 4 2 3\nf 4 5 2\nf 1 2 6\n";
        let mesh = load(&format!("{TRIANGLE}{bad}"), &SETTINGS).unwrap();
        assert_eq!(mesh.tree.mesh().len(), 1);
        let notes = mesh.notes.join("\n");
        assert!(notes.contains("m.obj: 2 of 4 triangles left out: a coordinate is not finite"));
        assert!(notes.contains("m.obj: 1 of 4 triangles left out: without an area"));
        let none = "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 2 3 2\n";
        let error = load(none, &SETTINGS).unwrap_err();
        assert!(error.contains("1 have a coordinate that is not finite"), "{error}");
        assert!(error.contains("1 have no area"), "{error}");
    }

    #[test]
    fn units_that_differ_are_noted() {
        for (particle_extent, part) in [
            (1.0, None),
            (100.0, None),
            (2e3, Some("1414 times smaller")),
            (1e-3, Some("1414 times larger")),
            (0.0, None),
        ] {
            let settings = MeshSettings { particle_extent, ..SETTINGS };
            let notes = load(TRIANGLE, &settings).unwrap().notes;
            let found = notes.first().map_or("", String::as_str);
            match part {
                Some(part) => assert!(found.contains(part) && found.contains("mesh.scale")),
                None => assert_eq!(found, ""),
            }
        }
    }
}
