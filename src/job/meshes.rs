//! The meshes of a job: which files they are, and those that all images share.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use glam::DVec3;
use spherule_formats::FrameError;
use spherule_jobs::contents_hash;

use super::RunError;
use super::manifest_file::reading_budget;
use crate::manifest::{Manifest, MeshPath, named_place};
use crate::pipeline::{GrainMeshes, LoadedMesh, PictureMesh, load_mesh};
use crate::resolve::mesh_settings;
use crate::survey::Survey;

/// The meshes that all images share. Their files are read once.
#[derive(Debug, Clone, Default)]
pub(super) struct JobMeshes {
    loaded: OnceLock<SharedMeshes>,
    of_grains: OnceLock<GrainMeshes>,
}

#[derive(Debug, Clone)]
struct SharedMeshes {
    /// The origin that they are relative to.
    origin: DVec3,
    /// By index in the manifest; None for those that each frame has for itself.
    meshes: Vec<Option<LoadedMesh>>,
}

impl JobMeshes {
    /// All meshes of `manifest`, whose paths are relative to `dir`.
    ///
    /// # Errors
    /// One cannot be read.
    pub(super) fn get(
        &self,
        manifest: &Manifest,
        dir: &Path,
        survey: &Survey,
    ) -> Result<Vec<PictureMesh>, RunError> {
        if manifest.meshes.is_empty() {
            return Ok(Vec::new());
        }
        let settings = mesh_settings(manifest, survey, reading_budget(manifest));
        // Read the files, unless they have been read for the same origin
        let load = || -> Result<_, RunError> {
            let mut meshes = Vec::with_capacity(settings.len());
            for (index, settings) in settings.iter().enumerate() {
                let path = shared_file(&manifest.meshes[index].path, dir);
                let loaded = path.map(|path| load_mesh(&path, settings)).transpose();
                meshes.push(loaded.map_err(|source| RunError::Mesh { index, source })?);
            }
            let origin = survey.origin;
            Ok(SharedMeshes { origin, meshes })
        };
        let known = self.loaded.get().filter(|known| known.origin == survey.origin);
        let shared = match known {
            Some(known) => known.clone(),
            None => {
                let loaded = load()?;
                let _ = self.loaded.set(loaded.clone());
                loaded
            }
        };
        // Join settings and triangles
        let meshes = settings.into_iter().zip(shared.meshes);
        let picture_mesh = |(settings, loaded): (_, Option<LoadedMesh>)| PictureMesh {
            settings,
            tree: loaded.map(|loaded| loaded.tree),
        };
        Ok(meshes.map(picture_mesh).collect())
    }

    /// The meshes of grains of `manifest`, whose paths are relative to `dir`.
    ///
    /// # Errors
    /// One cannot be read, or is not the surface of a body.
    pub(super) fn of_grains(
        &self,
        manifest: &Manifest,
        dir: &Path,
    ) -> Result<GrainMeshes, RunError> {
        if let Some(known) = self.of_grains.get() {
            return Ok(known.clone());
        }
        let mut meshes = GrainMeshes::default();
        for (index, path) in grain_files(manifest, dir) {
            let style = &manifest.styles[index];
            let added = meshes.add(style, &path, reading_budget(manifest));
            added.map_err(|source| RunError::GrainMesh { index, source })?;
        }
        Ok(self.of_grains.get_or_init(|| meshes).clone())
    }

    /// Notes for the user on those that have been read.
    pub(super) fn notes(&self) -> Vec<String> {
        let meshes = self.loaded.get().into_iter().flat_map(|l| l.meshes.iter());
        meshes.flatten().flat_map(|mesh| mesh.notes.clone()).collect()
    }
}

/// The file of a mesh that all images share; `dir` need not exist yet.
fn shared_file(path: &MeshPath, dir: &Path) -> Option<PathBuf> {
    (!path.has_number()).then(|| named_place(&dir.join(path.as_str())))
}

/// The files of the meshes that only `frame` has.
pub(super) fn frame_files(manifest: &Manifest, dir: &Path, frame: i64) -> Vec<PathBuf> {
    let own = manifest.meshes.iter().filter(|mesh| mesh.path.has_number());
    own.map(|mesh| named_place(&dir.join(mesh.path.path_for(frame)))).collect()
}

/// The files of the meshes of grains, with the indices of their styles.
fn grain_files(manifest: &Manifest, dir: &Path) -> impl Iterator<Item = (usize, PathBuf)> {
    let styles = manifest.styles.iter().enumerate();
    styles.filter_map(|(index, style)| Some((index, shared_file(style.mesh.as_ref()?, dir)?)))
}

/// Hashes of the meshes that all images share, by the keys of their paths. Those of a frame are among its inputs.
pub(super) fn identities(
    manifest: &Manifest,
    dir: &Path,
) -> Result<Vec<(String, String)>, RunError> {
    let mut identities = Vec::new();
    for (index, mesh) in manifest.meshes.iter().enumerate() {
        if let Some(path) = shared_file(&mesh.path, dir) {
            let found = identity(&path).map_err(|source| RunError::Mesh {
                index,
                source: FrameError::io(&path, source).into(),
            })?;
            identities.push((format!("mesh.{index}.path"), found));
        }
    }
    for (index, path) in grain_files(manifest, dir) {
        let found = identity(&path).map_err(|source| RunError::GrainMesh {
            index,
            source: FrameError::io(&path, source).into(),
        })?;
        identities.push((format!("style.{index}.mesh"), found));
    }
    Ok(identities)
}

/// What stands for a file in the settings of a job.
pub(super) fn identity(path: &Path) -> io::Result<String> {
    Ok(format!("blake3 {}", contents_hash(path)?))
}
