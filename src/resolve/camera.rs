//! The camera path, and checks that every view along it is valid.

use glam::DVec3;
use spherule_formats::SimulationCell;

use super::ResolveError;
use crate::manifest::{self, CameraMode, FocusSetting, Manifest};
use crate::pipeline::Setup;
use crate::scene::framing::{DEFAULT_AZIMUTH, DEFAULT_ELEVATION};
use crate::scene::{
    Aperture, Bounds, Camera, CameraKey, CameraPath, CameraView, Focus, Framed, Framing, KeyedPath,
    LensSettings,
};
use crate::survey::Survey;

/// The path that the manifest describes; `up` is the default upward direction.
pub(super) fn path(
    manifest: &Manifest,
    framed: &Framed,
    up: DVec3,
    aspect: f64,
) -> Result<CameraPath, ResolveError> {
    let camera = &manifest.camera;
    let up = camera.up.unwrap_or(up);
    let framing = Framing {
        up,
        azimuth: camera.azimuth.unwrap_or(DEFAULT_AZIMUTH),
        elevation: camera.elevation.unwrap_or(DEFAULT_ELEVATION),
        fov: camera.fov,
        aspect,
    };
    Ok(match camera.mode {
        CameraMode::Auto => CameraPath::Still(framed.view(&framing)),
        CameraMode::Fixed => CameraPath::Still(CameraView {
            eye: camera.eye.unwrap_or_default(),
            look_at: camera.look_at.unwrap_or_default(),
            up,
            fov: camera.fov,
        }),
        CameraMode::Turntable => CameraPath::turntable(framed, &framing, camera.degrees_per_frame),
        CameraMode::Keys => {
            let keys = camera.keys.iter().map(|key| keyed(key, up, camera.fov));
            CameraPath::through(keys.collect())?
        }
    })
}

/// What an automatic camera shows: the outermost particles of `survey`, or in jobs of earlier versions their `bounds`;
/// and the simulation cell if it is visible.
pub(super) fn framed(manifest: &Manifest, survey: &Survey, bounds: &Bounds, reach: f64) -> Framed {
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
pub(super) fn unframed(manifest: &Manifest, survey: &Survey) -> u64 {
    match (manifest.camera.mode, &survey.outline) {
        (CameraMode::Auto | CameraMode::Turntable, Some(outline)) => outline.outliers,
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

/// The camera at the start of `path`. All keys of a path are checked.
pub(super) fn at_start(
    path: &CameraPath,
    aspect: f64,
    origin: DVec3,
) -> Result<Camera, ResolveError> {
    if let CameraPath::Keys(keys) = path {
        for key in keys.keys() {
            Camera::new(&key.view, aspect, origin).map_err(|source| ResolveError::View {
                place: format!("camera.key: the key of frame {}", key.frame),
                source,
            })?;
        }
    }
    Ok(Camera::new(&path.start(), aspect, origin)?)
}

/// The lens that the manifest describes, if its aperture is not 0.
pub(super) fn lens(
    manifest: &Manifest,
    path: &CameraPath,
    aspect: f64,
) -> Result<Option<LensSettings>, ResolveError> {
    let camera = &manifest.camera;
    let aperture = match (camera.aperture, camera.f_stop) {
        (Some(diameter), _) if diameter > 0.0 => Aperture::Diameter(diameter),
        (None, f_stop) if f_stop > 0.0 => Aperture::FStop {
            f_stop,
            sensor_width: camera.sensor_width,
        },
        _ => return Ok(None),
    };
    let focus = match camera.focus {
        FocusSetting::Auto => Focus::Target,
        FocusSetting::Distance(distance) => Focus::Distance(distance),
        FocusSetting::Particle(id) => Focus::Particle(id),
    };
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
    if setup.picture.path.moving().is_empty() {
        return Ok(());
    }
    for frame in frames {
        setup
            .camera_at(frame)
            .map_err(|source| ResolveError::View {
                place: place(&setup.picture.path, frame),
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
