//! Motion blur: when the shutter is open, and where the motion of the particles comes from.

use spherule_formats::names;

use super::ResolveError;
use super::channels::{UNKNOWN_STEP, has_velocities, step_to_next};
use crate::manifest::{CameraMode, Manifest};
use crate::pipeline::{FrameStep, Shutter, attribute_list};
use crate::survey::Survey;

/// The shutter, if there is motion blur.
///
/// # Errors
/// There are neither velocities nor ids with another frame, or the time between frames is unknown.
pub(super) fn shutter(
    manifest: &Manifest,
    survey: &Survey,
) -> Result<Option<Shutter>, ResolveError> {
    let camera = &manifest.camera;
    if camera.shutter == 0.0 {
        return Ok(None);
    }
    let unsupported = |what: String| ResolveError::Unsupported { key: "camera.shutter", what };
    let has_velocities = has_velocities(survey);
    check_motion_source(manifest, survey, has_velocities)?;
    // Without velocities, particles move from one frame to the next whatever the time is
    let without_time = (!has_velocities)
        .then(|| FrameStep { time: 1.0, numbers: survey.frame_numbers.unwrap_or(1) });
    let step = step_to_next(&manifest.output, survey)
        .or(without_time)
        .ok_or_else(|| unsupported(format!("motion blur needs {UNKNOWN_STEP}")))?;
    let open = camera.shutter_offset.unwrap_or(-0.5 * camera.shutter);
    Ok(Some(Shutter {
        open,
        close: open + camera.shutter,
        step,
        has_velocities,
        slices: camera.shutter_slices,
    }))
}

/// Checks that there are velocities, or another frame in which the particles can be found.
fn check_motion_source(
    manifest: &Manifest,
    survey: &Survey,
    has_velocities: bool,
) -> Result<(), ResolveError> {
    let unsupported = |what: String| ResolveError::Unsupported { key: "camera.shutter", what };
    // Particles have to be found in the next frame
    let is_id = |name: &String| names::ID.iter().any(|known| name.eq_ignore_ascii_case(known));
    if survey.most_particles > 0 && !has_velocities && !survey.attributes.iter().any(is_id) {
        return Err(unsupported(format!(
            "motion blur needs velocities, or ids to find the particles in the next frame, and the sampled frames \
             have neither; available: {}",
            attribute_list(survey.attributes.iter().map(String::as_str))
        )));
    }
    // There has to be a next frame, unless only the camera moves
    let mode = manifest.camera.mode;
    let is_camera_still = matches!(mode, CameraMode::Auto | CameraMode::Fixed);
    if survey.frames == 1 && survey.frame_numbers.is_none() && !has_velocities && is_camera_still {
        return Err(unsupported(
            "motion blur without velocities needs another frame, and there is only one".to_owned(),
        ));
    }
    // It has to exist already
    if manifest.job.follow && !has_velocities {
        return Err(unsupported(
            "motion blur without velocities needs the next frame, which is not there yet when job.follow is set; \
             render the sequence when it is complete"
                .to_owned(),
        ));
    }
    Ok(())
}
