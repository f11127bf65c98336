//! The files that all images of a manifest share, each read once: the images of environment, ground and
//! overlays, and meshes.

use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use super::RunError;
use super::meshes::{self, JobMeshes, identity};
use crate::hdr::{read_radiance_map, read_texture};
use crate::manifest::{EnvironmentKind, GROUND_IMAGE, Manifest, OverlayKind, named_place};
use crate::overlay::RgbaPixels;
use crate::picture::read_rgba;
use crate::pipeline::Setup;
use crate::resolve::{self, EnvironmentMap, KeptEnvironment, SceneInputs, check_views};
use crate::scene::Texture;
use crate::survey::Survey;
use spherule_images::file::ImageReadError;

/// See the module. One value belongs to one manifest, whose paths are relative to `dir`.
#[derive(Debug, Clone)]
pub struct SceneFiles {
    dir: PathBuf,
    /// See [`SceneFiles::environment_image`].
    environment_image: OnceLock<Option<EnvironmentMap>>,
    /// See [`SceneFiles::ground_image`].
    ground_image: OnceLock<Option<Arc<Texture>>>,
    /// See [`SceneFiles::overlay_images`].
    overlay_images: OnceLock<Vec<Arc<RgbaPixels>>>,
    meshes: JobMeshes,
    /// The environment of the manifest, if it is kept for other views.
    environment: Option<Arc<OnceLock<KeptEnvironment>>>,
}

impl SceneFiles {
    /// Files relative to `dir`, which need not exist yet.
    pub fn new(dir: impl Into<PathBuf>) -> Self {
        Self {
            dir: dir.into(),
            environment_image: OnceLock::new(),
            ground_image: OnceLock::new(),
            overlay_images: OnceLock::new(),
            meshes: JobMeshes::default(),
            environment: None,
        }
    }

    /// Keeps the environment, so that it is made once for many views. It takes some megabytes.
    pub(super) fn keep_environment(&mut self) {
        self.environment = Some(Arc::default());
    }

    /// Whether these are the files of `other`, for these two manifests.
    pub(super) fn are_those_of(&self, other: &Self, [one, two]: [&Manifest; 2]) -> bool {
        let ground =
            |manifest: &Manifest| (ground_path(manifest, &self.dir), manifest.render.ground_color);
        self.dir == other.dir
            && one.integrator() == two.integrator()
            && one.environment == two.environment
            && ground(one) == ground(two)
            && one.overlays == two.overlays
            && one.meshes == two.meshes
            && one.styles == two.styles
    }

    /// The setup of `frames`, if the view is valid along the whole camera path.
    ///
    /// # Errors
    /// A file cannot be read, or the settings and the particles do not go together.
    pub fn setup(
        &self,
        manifest: &Manifest,
        survey: &Survey,
        frames: impl Iterator<Item = i64>,
    ) -> Result<Setup, RunError> {
        let inputs = SceneInputs {
            environment: self.environment_image(manifest)?,
            kept: self.environment.as_deref(),
            overlays: self.overlay_images(manifest)?,
            ground: self.ground_image(manifest)?,
            meshes: self.meshes.get(manifest, &self.dir, survey)?,
            grain_meshes: self.meshes.of_grains(manifest, &self.dir)?,
        };
        let setup = resolve::setup(manifest, survey, inputs)?;
        check_views(&setup, frames)?;
        Ok(setup)
    }

    /// Notes for the user on the image of the environment, and on meshes that have been read for a setup.
    ///
    /// # Errors
    /// The image cannot be read.
    pub fn notes(&self, manifest: &Manifest) -> Result<Vec<String>, RunError> {
        let image = self.environment_image(manifest)?.zip(environment_path(manifest, &self.dir));
        let of_image = image.map(|(image, path)| image.notes(&path)).unwrap_or_default();
        Ok(of_image.into_iter().chain(self.meshes.notes()).collect())
    }

    /// The files of the meshes that only `frame` has.
    pub fn frame_meshes(&self, manifest: &Manifest, frame: i64) -> Vec<PathBuf> {
        meshes::frame_files(manifest, &self.dir, frame)
    }

    /// Fingerprints of the files, by the keys of their paths: the files may be moved.
    pub(super) fn identities(
        &self,
        manifest: &Manifest,
    ) -> Result<Vec<(String, String)>, RunError> {
        // Add each file that pictures use, with the key of its path
        let mut identities = meshes::identities(manifest, &self.dir)?;
        if let Some(path) = environment_path(manifest, &self.dir) {
            let found = identity(&path).map_err(|source| ImageReadError::Io { path, source })?;
            identities.push(("environment.image".to_owned(), found));
        }
        if let Some(path) = ground_path(manifest, &self.dir) {
            let identified = identity(&path);
            let found = identified
                .map_err(|source| RunError::GroundImage(ImageReadError::Io { path, source }))?;
            identities.push((GROUND_IMAGE.to_owned(), found));
        }
        for (index, path) in overlay_paths(manifest, &self.dir) {
            let found = identity(&path).map_err(|source| RunError::OverlayImage {
                index,
                source: ImageReadError::Io { path, source },
            })?;
            identities.push((format!("overlay.{index}.path"), found));
        }
        Ok(identities)
    }

    /// The image of the environment, if there is one. Its file is read once.
    fn environment_image(&self, manifest: &Manifest) -> Result<Option<&EnvironmentMap>, RunError> {
        if let Some(map) = self.environment_image.get() {
            return Ok(map.as_ref());
        }
        let path = environment_path(manifest, &self.dir);
        let map = path.map(|path| read_radiance_map(&path)).transpose()?;
        let image = map.map(|map| EnvironmentMap::new(manifest, map));
        Ok(self.environment_image.get_or_init(|| image).as_ref())
    }

    /// The pictures of the overlays of the type image. Their files are read once.
    fn overlay_images(&self, manifest: &Manifest) -> Result<&[Arc<RgbaPixels>], RunError> {
        if let Some(images) = self.overlay_images.get() {
            return Ok(images);
        }
        let read = |(index, path): (usize, PathBuf)| match read_rgba(&path) {
            Ok((width, pixels)) => Ok(Arc::new(RgbaPixels::new(width, pixels))),
            Err(source) => Err(RunError::OverlayImage { index, source }),
        };
        let images =
            overlay_paths(manifest, &self.dir).map(read).collect::<Result<Vec<_>, RunError>>()?;
        Ok(self.overlay_images.get_or_init(|| images))
    }

    /// The picture on the ground, if there is one. Its file is read once.
    fn ground_image(&self, manifest: &Manifest) -> Result<Option<&Arc<Texture>>, RunError> {
        if let Some(texture) = self.ground_image.get() {
            return Ok(texture.as_ref());
        }
        let behind = manifest.render.ground_color;
        let read = |path: PathBuf| read_texture(&path, behind).map_err(RunError::GroundImage);
        let path = ground_path(manifest, &self.dir);
        let texture = path.map(read).transpose()?.map(Arc::new);
        Ok(self.ground_image.get_or_init(|| texture).as_ref())
    }
}

/// The path of the image of the environment, if there is one.
fn environment_path(manifest: &Manifest, dir: &Path) -> Option<PathBuf> {
    let path = manifest.environment.image.as_ref()?;
    // The directory may not exist yet, so that the system cannot follow `..` from it
    manifest.has_environment(EnvironmentKind::Image).then(|| named_place(&dir.join(path)))
}

/// The paths of the overlays of the type image, with the indices of these.
fn overlay_paths(manifest: &Manifest, dir: &Path) -> impl Iterator<Item = (usize, PathBuf)> {
    let overlays = manifest.overlays.iter().enumerate();
    overlays.filter_map(|(index, overlay)| match &overlay.kind {
        OverlayKind::Image { path, .. } => Some((index, named_place(&dir.join(path)))),
        _ => None,
    })
}

/// The path of the picture on the ground, if there is one.
fn ground_path(manifest: &Manifest, dir: &Path) -> Option<PathBuf> {
    let image = manifest.ground_image()?;
    Some(named_place(&dir.join(&image.path)))
}
