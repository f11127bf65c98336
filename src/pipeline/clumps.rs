//! What flies fast and apart from the rest of a smooth surface while the shutter is open.

use glam::Vec3;
use spherule_formats::Radius;
use spherule_frame::gather::keep;

use super::bodies::{common_radius, memory_left};
use super::decoded::DecodedFrame;
use super::setup::Setup;
use crate::surface::clumps::{ExposedParticles, FastClumps, MovingClumps};
use crate::surface::smooth::{SmoothError, SmoothReport};

/// Builds the surface of the clumps of `frame`, which is in the middle of the exposure, and leaves only the other particles
/// in `frame` and in `displacements`. There are none without motion blur.
///
/// # Errors
/// [`SmoothError`] if it does not fit.
pub(super) fn take_clumps(
    setup: &Setup,
    frame: &mut DecodedFrame<'_>,
    displacements: &mut Vec<Vec3>,
) -> Result<(MovingClumps, SmoothReport), SmoothError> {
    let Some(shutter) = setup.picture.view.shutter else {
        return Ok(Default::default());
    };
    // Find them
    let settings = &setup.picture.surface;
    let radius = common_radius(&frame.radius);
    let particles = ExposedParticles {
        centers: &frame.centers,
        displacements,
        radius,
        support: settings.support() * radius,
        slices: shutter.slices,
    };
    let found = FastClumps::of(&particles);
    if found.is_empty() {
        return Ok(Default::default());
    }
    // Build their surface, and leave the others
    let left = memory_left(setup.run.memory_limit);
    let (clumps, made) = MovingClumps::build(found, &particles, settings, left)?;
    keep(frame.centers.to_mut(), 1, clumps.rest());
    keep(displacements, 1, clumps.rest());
    if let Radius::PerParticle(radii) = &mut frame.radius {
        keep(radii, 1, clumps.rest());
    }
    Ok((clumps, made))
}
