//! The meshes of a job: which files they are, and those that all images share.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use glam::DVec3;
use spherule_formats::FrameError;
use spherule_jobs::Fingerprint;

use super::RunError;
use crate::manifest::{Manifest, MeshPath, named_place};
use crate::pipeline::{LoadedMesh, PictureMesh, load_mesh};
use crate::reading::read_budget;
use crate::resolve::mesh_settings;
use crate::survey::Survey;

/// The meshes that all images share. Their files are read once.
#[derive(Debug, Clone, Default)]
pub(super) struct JobMeshes {
    loaded: OnceLock<SharedMeshes>,
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
        let limit = manifest.render.memory_limit.map(|limit| limit.0);
        let ceiling = manifest.job.memory_ceiling.map(|limit| limit.0);
        let settings = mesh_settings(manifest, survey, read_budget(limit, ceiling));
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
        let known = self
            .loaded
            .get()
            .filter(|known| known.origin == survey.origin);
        let shared = match known {
            Some(known) => known.clone(),
            None => {
                let loaded = load()?;
                let _ = self.loaded.set(loaded.clone());
                loaded
            }
        };
        let meshes = settings.into_iter().zip(shared.meshes);
        let picture_mesh = |(settings, loaded): (_, Option<LoadedMesh>)| PictureMesh {
            settings,
            tree: loaded.map(|loaded| loaded.tree),
        };
        Ok(meshes.map(picture_mesh).collect())
    }

    /// Notes for the user on those that have been read.
    pub(super) fn notes(&self) -> Vec<String> {
        let meshes = self.loaded.get().into_iter().flat_map(|l| l.meshes.iter());
        meshes
            .flatten()
            .flat_map(|mesh| mesh.notes.clone())
            .collect()
    }
}

/// The file of a mesh that all images share; `dir` need not exist yet.
fn shared_file(path: &MeshPath, dir: &Path) -> Option<PathBuf> {
    (!path.has_number()).then(|| named_place(&dir.join(path.as_str())))
}

/// The files of the meshes that only `frame` has.
pub(super) fn frame_files(manifest: &Manifest, dir: &Path, frame: i64) -> Vec<PathBuf> {
    let own = manifest.meshes.iter().filter(|mesh| mesh.path.has_number());
    own.map(|mesh| named_place(&dir.join(mesh.path.path_for(frame))))
        .collect()
}

/// Replaces the paths of meshes that all images share in `settings` by their fingerprints. Those of a frame are among
/// its inputs.
pub(super) fn identify(
    manifest: &Manifest,
    dir: &Path,
    settings: &mut [(String, String)],
) -> Result<(), RunError> {
    for (index, mesh) in manifest.meshes.iter().enumerate() {
        let key = format!("mesh.{index}.path");
        let setting = settings.iter_mut().find(|(name, _)| *name == key);
        if let (Some(path), Some((_, value))) = (shared_file(&mesh.path, dir), setting) {
            let found = Fingerprint::of_file(&path);
            let found = found.map_err(|source| RunError::Mesh {
                index,
                source: FrameError::io(&path, source).into(),
            })?;
            *value = format!("blake3 {}", found.blake3);
        }
    }
    Ok(())
}
