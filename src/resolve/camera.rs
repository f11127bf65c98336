//! The camera path, and checks that every view along it is valid.

use std::borrow::Cow;

use glam::DVec3;
use spherule_formats::SimulationCell;

use super::{Extent, ResolveError, shutter};
use crate::manifest::{
    self, BoxSetting, CameraMode, FitSetting, FocusSetting, Manifest, ProjectionKind,
};
use crate::pipeline::{PictureMesh, Setup, ViewSettings};
use crate::scene::{
    Aperture, Bounds, Camera, CameraError, CameraKey, CameraPath, CameraView, Convergence, Focus,
    Framed, Framing, KeyedPath, LensSettings, Projection, StereoSettings,
};
use crate::survey::{Fit, Survey};

/// The camera, and what it follows from.
pub(super) struct PlacedCamera {
    pub view: ViewSettings,
    /// The camera at the start of the path, without its lens.
    pub camera: Camera,
}

/// The camera that the manifest describes.
///
/// # Errors
/// There is no view, or a key of the path is invalid.
pub(super) fn placed(
    manifest: &Manifest,
    survey: &Survey,
    extent: &Extent,
) -> Result<PlacedCamera, ResolveError> {
    // Find the path and the projection
    let [width, height] = manifest.image.size();
    let aspect = f64::from(width) / f64::from(height);
    let framed = framed(manifest, survey, &extent.bounds, extent.reach);
    let (path, projection) = path(manifest, &framed, extent.up, aspect)?;
    let stereo = stereo(manifest);
    // Check the first view
    let camera = at_start(&path, |view| {
        let camera = Camera::projected(view, projection, aspect, survey.origin)?;
        let stereo = stereo.map(|stereo| stereo.stereo(view)).transpose()?;
        Ok(camera.with_stereo(stereo))
    })?;
    // Collect what holds for all views
    let view = ViewSettings {
        up: extent.up,
        projection,
        stereo,
        unframed: unframed(manifest, survey),
        lens: lens(manifest, &path, aspect)?,
        shutter: shutter::shutter(manifest, survey)?,
        aspect,
        path,
    };
    Ok(PlacedCamera { view, camera })
}

/// The path and the projection that the manifest describes; `up` is the default upward direction.
fn path(
    manifest: &Manifest,
    framed: &Framed,
    up: DVec3,
    aspect: f64,
) -> Result<(CameraPath, Projection), ResolveError> {
    let camera = &manifest.camera;
    // Fit the particles, or take the given path
    let up = camera.up.unwrap_or(up);
    let [azimuth, elevation] = camera.angles(up);
    let framing = Framing { up, azimuth, elevation, fov: camera.fov, aspect };
    let (path, fitted) = fitted_path(camera, framed, &framing)?;
    // Apply zoom and centre to the path
    let zoomed = path.zoomed(camera.zoom);
    let path = match camera.center {
        Some(center) => zoomed.centered(center),
        None => zoomed,
    };
    // Zoom a parallel projection by its height
    let projection = match camera.projection {
        ProjectionKind::Perspective => Projection::Perspective,
        ProjectionKind::Orthographic => {
            Projection::Orthographic { height: camera.height.unwrap_or(fitted) / camera.zoom }
        }
        ProjectionKind::Equirectangular => Projection::Equirectangular,
    };
    Ok((path, projection))
}

/// The path before the zoom, and the height of a parallel projection that shows all; 0 for other projections.
fn fitted_path(
    camera: &manifest::Camera,
    framed: &Framed,
    framing: &Framing,
) -> Result<(CameraPath, f64), ResolveError> {
    let Framing { up, aspect, .. } = *framing;
    Ok(match (camera.mode, camera.projection) {
        (CameraMode::Auto, ProjectionKind::Perspective) => {
            (CameraPath::Still(framed.view(framing)), 0.0)
        }
        (CameraMode::Auto, ProjectionKind::Orthographic) => {
            let (view, height) = framed.parallel_view(framing);
            (CameraPath::Still(view), height)
        }
        (CameraMode::Auto, ProjectionKind::Equirectangular) => {
            (CameraPath::Still(framed.panorama(framing)), 0.0)
        }
        (CameraMode::Turntable, ProjectionKind::Orthographic) => {
            CameraPath::parallel_turntable(framed, framing, camera.degrees_per_frame)
        }
        (CameraMode::Turntable, _) => {
            let path = CameraPath::turntable(framed, framing, camera.degrees_per_frame);
            (path, 0.0)
        }
        (CameraMode::Fixed, _) => {
            let view = CameraView {
                eye: camera.eye.unwrap_or_default(),
                look_at: camera.look_at.unwrap_or_default(),
                up,
                fov: camera.fov,
            };
            (CameraPath::Still(view), framed.height_around(&view, aspect))
        }
        (CameraMode::Keys, _) => {
            let keys: Vec<CameraKey> =
                camera.keys.iter().map(|key| keyed(key, up, camera.fov)).collect();
            let heights = keys.iter().map(|key| framed.height_around(&key.view, aspect));
            let height = heights.fold(0.0, f64::max);
            (CameraPath::through(keys)?, height)
        }
    })
}

/// The eyes of stereo pairs.
fn stereo(manifest: &Manifest) -> Option<StereoSettings> {
    let camera = &manifest.camera;
    camera.stereo.then_some(StereoSettings {
        eye_distance: camera.eye_distance,
        convergence: match camera.projection {
            ProjectionKind::Equirectangular => Convergence::Parallel,
            _ => camera.convergence.0,
        },
    })
}

/// The survey with the corners of `meshes` among the outermost particles, if `manifest` says that the camera shows
/// them.
/// `meshes` has one for each entry of the manifest.
pub(super) fn with_framed_meshes<'a>(
    survey: &'a Survey,
    manifest: &Manifest,
    meshes: &[PictureMesh],
) -> Cow<'a, Survey> {
    if !manifest.camera.frame_meshes {
        return Cow::Borrowed(survey);
    }
    let visible = manifest.meshes.iter().zip(meshes);
    let trees = visible.filter_map(|(mesh, own)| own.tree.as_ref().filter(|_| !mesh.holdout));
    let corners = trees.filter_map(|tree| tree.bounds()).flat_map(|bounds| {
        let [min, max] = bounds.map(|corner| corner.as_dvec3());
        Bounds { min, max }.corners()
    });
    let mut survey = survey.clone();
    if let Some(outline) = &mut survey.outline {
        outline.points.extend(corners.map(|corner| corner.as_vec3()));
    }
    Cow::Owned(survey)
}

/// The part of the particles of all frames, or of that of a still, that the automatic camera shows if nothing is said.
const SHARE: f64 = 0.99;

/// The particles that the survey looks for.
pub(super) fn fit(manifest: &Manifest) -> Fit {
    match manifest.camera.fit {
        Some(FitSetting::All) => Fit::All,
        Some(FitSetting::Percent(percent)) => Fit::Share(percent / 100.0),
        Some(FitSetting::This) | None => Fit::Share(SHARE),
    }
}

/// What an automatic camera shows: the box that is given, or the outermost particles of `survey`, or in jobs of earlier versions their `bounds`;
/// and the simulation cell if it is visible.
fn framed(manifest: &Manifest, survey: &Survey, bounds: &Bounds, reach: f64) -> Framed {
    if let Some(BoxSetting { min, max }) = manifest.camera.bounds {
        return Framed::corners(&Bounds { min, max });
    }
    let cells = survey.cells.iter().filter(|_| manifest.cell.visible);
    match &survey.outline {
        Some(outline) => {
            let points = outline.points.iter().map(|p| p.as_dvec3() + survey.origin);
            let corners = cells.flat_map(SimulationCell::corners);
            Framed::spheres(points.chain(corners).collect(), reach)
        }
        None => Framed::corners(bounds),
    }
}

/// Number of particles of a frame that an automatic camera may leave out.
fn unframed(manifest: &Manifest, survey: &Survey) -> u64 {
    let is_panorama = manifest.camera.projection == ProjectionKind::Equirectangular;
    match (manifest.camera.mode, &survey.outline) {
        (CameraMode::Auto | CameraMode::Turntable, Some(outline)) if !is_panorama => {
            outline.outliers
        }
        _ => 0,
    }
}

/// Converts `key`, with defaults for the missing values.
fn keyed(key: &manifest::CameraKey, up: DVec3, fov: f64) -> CameraKey {
    CameraKey {
        frame: key.frame,
        view: CameraView {
            eye: key.eye,
            look_at: key.look_at,
            up: key.up.unwrap_or(up),
            fov: key.fov.unwrap_or(fov),
        },
    }
}

/// The camera at the start of `path`. All keys of a path are checked. `camera` makes one of a view.
fn at_start(
    path: &CameraPath,
    camera: impl Fn(&CameraView) -> Result<Camera, CameraError>,
) -> Result<Camera, ResolveError> {
    if let CameraPath::Keys(keys) = path {
        for key in keys.keys() {
            camera(&key.view).map_err(|source| ResolveError::View {
                place: format!("camera.key: the key of frame {}", key.frame),
                source,
            })?;
        }
    }
    Ok(camera(&path.start())?)
}

/// The lens that the manifest describes, if its aperture is not 0.
fn lens(
    manifest: &Manifest,
    path: &CameraPath,
    aspect: f64,
) -> Result<Option<LensSettings>, ResolveError> {
    let camera = &manifest.camera;
    // Find the aperture; without one everything is in focus
    let aperture = match (camera.aperture, camera.f_stop) {
        (Some(diameter), _) if diameter > 0.0 => Aperture::Diameter(diameter),
        (None, f_stop) if f_stop > 0.0 => {
            Aperture::FStop { f_stop, sensor_width: camera.sensor_width }
        }
        _ => return Ok(None),
    };
    // Find the plane in focus
    let focus = match camera.focus {
        FocusSetting::Auto => Focus::Target,
        FocusSetting::Distance(distance) => Focus::Distance(distance),
        FocusSetting::Particle(id) => Focus::Particle(id),
    };
    // Check the lens at the start of the path
    let settings = LensSettings { aperture, focus };
    settings.lens(&path.start(), aspect, None)?;
    Ok(Some(settings))
}

/// Checks that the camera's view is valid at each of `frames`.
///
/// # Errors
/// [`ResolveError::View`] for the first invalid view, with its frame number and the keys around it.
pub fn check_views(
    setup: &Setup,
    frames: impl IntoIterator<Item = i64>,
) -> Result<(), ResolveError> {
    if setup.picture.view.path.moving().is_empty() {
        return Ok(());
    }
    for frame in frames {
        setup.camera_at(frame).map_err(|source| ResolveError::View {
            place: place(&setup.picture.view.path, frame),
            source,
        })?;
    }
    Ok(())
}

/// Describes the position of `frame` in the path, for messages.
fn place(path: &CameraPath, frame: i64) -> String {
    let around = match path {
        CameraPath::Keys(keys) => KeyedPath::around(keys, frame),
        _ => None,
    };
    match around {
        Some([from, to]) => {
            format!("camera.key: frame {frame}, between the keys of frames {from} and {to}")
        }
        None => format!("camera: frame {frame}"),
    }
}

#[cfg(test)]
#[path = "camera_tests.rs"]
pub(super) mod tests;
