//! The radii of the particles of a frame.

use std::ops::Range;

use spherule_formats::{Attribute, Radius, is_radius};

use super::super::SharedFrame;
use super::super::load_error::LoadError;
use super::super::setup::{RadiusRule, Setup};
use super::super::styles::StyleRanges;
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

/// The radii of `frame`, which was read from `file`, in the order of its styles.
pub(super) fn radii(
    setup: &Setup,
    frame: &SharedFrame<'_>,
    ranges: &StyleRanges,
    file: &str,
) -> Result<FrameRadii, LoadError> {
    let of = |index: usize| {
        let style = &setup.picture.particles.styles[index];
        let rule = (&style.radius, style.radius_factor);
        radii_of(setup, rule, frame, ranges.of(index), file)
    };
    let mut all = of(0)?;
    for index in 1..setup.picture.particles.styles.len() {
        // Append those of the style; each particle has its own unless all are alike
        let (own, range) = (of(index)?, ranges.of(index));
        (all.raised, all.unknown) = (all.raised + own.raised, all.unknown + own.unknown);
        all.radius = match (all.radius, own.radius) {
            (Radius::Common(a), Radius::Common(b)) if a == b => Radius::Common(a),
            (_, own) if range.start == 0 => own,
            (all, _) if range.is_empty() => all,
            (all, own) => {
                let mut radii = each(all, range.start);
                radii.extend(each(own, range.len()));
                Radius::PerParticle(radii)
            }
        };
    }
    Ok(all)
}

/// The radii of so many particles, one for each.
fn each(radius: Radius, particles: usize) -> Vec<f32> {
    match radius {
        Radius::Common(radius) => vec![radius; particles],
        Radius::PerParticle(radii) => radii,
    }
}

/// The radii of the particles in `range` of `frame`, by a rule and with a factor.
pub(super) fn radii_of(
    setup: &Setup,
    (rule, factor): (&RadiusRule, f32),
    frame: &SharedFrame<'_>,
    range: Range<usize>,
    file: &str,
) -> Result<FrameRadii, LoadError> {
    // Select the source of the radii
    let least = setup.picture.particles.least_radius;
    let mut unknown = 0;
    let is_empty = range.is_empty();
    let mut radius = match rule {
        RadiusRule::Common(radius) => Radius::Common(*radius),
        RadiusRule::FileOr(radius) => match &frame.radius {
            Some(Radius::PerParticle(radii)) => Radius::PerParticle(radii[range].to_vec()),
            Some(Radius::Common(radius)) => Radius::Common(*radius),
            None => Radius::Common(*radius),
        },
        RadiusRule::Attribute { name, scale } => {
            let found = attribute(frame, name, "the radius", file)?;
            found.map_or(Radius::Common(least), |found| {
                Radius::PerParticle(magnitudes(found, range, f64::from(*scale)))
            })
        }
        RadiusRule::Table { name, table, scale } => {
            match attribute(frame, name, "the radius", file)? {
                Some(found) => {
                    let (radii, others) = from_table((found, range), table, *scale, file)?;
                    unknown = others;
                    Radius::PerParticle(radii)
                }
                None => Radius::Common(least),
            }
        }
    };
    if factor != 1.0 {
        match &mut radius {
            Radius::Common(radius) => *radius *= factor,
            Radius::PerParticle(radii) => radii.iter_mut().for_each(|radius| *radius *= factor),
        }
    }
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
        _ if is_empty => {}
        Radius::Common(radius) => raise(radius),
        Radius::PerParticle(radii) => radii.iter_mut().for_each(raise),
    }
    Ok(FrameRadii { radius, raised, unknown })
}

/// Radii by the values of `attribute` in `range`, times `scale`, and the number of particles without one in the table.
#[expect(clippy::cast_possible_truncation, reason = "radii are f32 in the renderer")]
fn from_table(
    (attribute, range): (&Attribute, Range<usize>),
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
    let radii: Result<Vec<f32>, LoadError> = range.map(radius).collect();
    Ok((radii?, unknown))
}
