//! The radii of the particles of a frame.

use spherule_formats::{Attribute, Radius, is_radius};

use super::super::SharedFrame;
use super::super::load_error::LoadError;
use super::super::setup::{RadiusRule, Setup};
use super::{attribute, magnitudes};
use crate::scene::RadiusTable;

/// The radii of a frame.
pub(super) struct FrameRadii {
    pub(super) radius: Radius,
    /// Number of radii that were raised to the minimum.
    pub(super) raised: u64,
    /// Number of particles that are no elements with a published radius.
    pub(super) unknown: u64,
}

/// The radii of `frame`, which was read from `file`.
pub(super) fn radii(
    setup: &Setup,
    frame: &SharedFrame<'_>,
    file: &str,
) -> Result<FrameRadii, LoadError> {
    // Select the source of the radii
    let least = setup.picture.particles.least_radius;
    let mut unknown = 0;
    let mut radius = match &setup.picture.particles.radius {
        RadiusRule::Common(radius) => Radius::Common(*radius),
        RadiusRule::FileOr(radius) => frame.radius.clone().unwrap_or(Radius::Common(*radius)),
        RadiusRule::Attribute { name, scale } => {
            let found = attribute(frame, name, "the radius", file)?;
            found.map_or(Radius::Common(least), |found| {
                Radius::PerParticle(magnitudes(found, f64::from(*scale)))
            })
        }
        RadiusRule::Table { name, table, scale } => {
            match attribute(frame, name, "the radius", file)? {
                Some(found) => {
                    let (radii, others) = from_table(found, table, *scale, file)?;
                    unknown = others;
                    Radius::PerParticle(radii)
                }
                None => Radius::Common(least),
            }
        }
    };
    // Raise radii that are too small or invalid
    let mut raised = 0;
    let mut raise = |radius: &mut f32| {
        // Written as `!(a >= b)` so that NaN is raised as well.
        if !(*radius >= least && is_radius(*radius)) {
            *radius = least;
            raised += 1;
        }
    };
    match &mut radius {
        _ if frame.is_empty() => {}
        Radius::Common(radius) => raise(radius),
        Radius::PerParticle(radii) => radii.iter_mut().for_each(raise),
    }
    Ok(FrameRadii { radius, raised, unknown })
}

/// Radii by the values of `attribute`, times `scale`, and the number of particles without one in the table.
#[expect(clippy::cast_possible_truncation, reason = "radii are f32 in the renderer")]
fn from_table(
    attribute: &Attribute,
    table: &RadiusTable,
    scale: f64,
    file: &str,
) -> Result<(Vec<f32>, u64), LoadError> {
    let mut unknown = 0;
    // Look each value up, and count those that have no radius in the table
    let radius = |index| {
        let value = attribute.magnitude(index);
        let found = table
            .radius(value)
            .or_else(|| {
                unknown += 1;
                table.other_radius()
            })
            .ok_or_else(|| LoadError::NoRadius {
                file: file.to_owned(),
                name: attribute.name.clone(),
                value,
            })?;
        Ok((found * scale) as f32)
    };
    let radii: Result<Vec<f32>, LoadError> = (0..attribute.count()).map(radius).collect();
    Ok((radii?, unknown))
}
