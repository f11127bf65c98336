//! Writes a frame in memory to a native file.

use std::io;
use std::path::Path;

use glam::Vec3;
use rayon::prelude::*;

use super::write::{AttributeSpec, FrameSpec, FrameWriter, RadiusSpec, Run};
use super::{
    Bound, Encoding, FrameDetails, FrameIndex, RadiusRange, StoredType, arrange, wide_blocks,
};
use crate::blocks::Block;
use crate::names::RADIUS;
use crate::order::kd;
use crate::{Attribute, AttributeData, FrameError, ParticleFrame, Radius, is_near, is_radius};
use spherule_frame::gather::gather;
use spherule_frame::with_values;

/// How a frame is stored.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StoreSettings {
    /// How positions are stored; `None` chooses the encoding that needs the fewest bytes within the bound.
    pub encoding: Option<Encoding>,
    /// Largest distance of stored positions from those of the frame, and largest difference of stored radii.
    pub bound: Bound,
    /// Distance of the frame's positions from the true ones ([`crate::Positions::rounding`]), scene units.
    pub rounding: f64,
}

impl StoreSettings {
    /// Stores positions and radii without loss.
    pub const EXACT: Self =
        Self { encoding: Some(Encoding::F32), bound: Bound::None, rounding: 0.0 };
}

/// Writes `frame` to `path` in tree order, without loss.
///
/// # Errors
/// As [`store`].
pub fn write(path: &Path, frame: &ParticleFrame, step: Option<i64>) -> Result<(), FrameError> {
    store(path, frame, step, &StoreSettings::EXACT).map(|_| ())
}

/// Writes `frame` to `path` in tree order.
///
/// # Errors
/// [`FrameError::Io`] if attributes or radii do not match the particles, if one of them is not finite, or if
/// the file cannot be written. No file is left behind in these cases.
pub fn store(
    path: &Path,
    frame: &ParticleFrame,
    step: Option<i64>,
    settings: &StoreSettings,
) -> Result<FrameIndex, FrameError> {
    check(frame)
        .and_then(|()| store_checked(path, frame, step, settings))
        .map_err(|e| FrameError::io(path, e))
}

fn store_checked(
    path: &Path,
    frame: &ParticleFrame,
    step: Option<i64>,
    settings: &StoreSettings,
) -> io::Result<FrameIndex> {
    // Choose the attributes and radii to store
    let is_kept = |a: &&Attribute| frame.radius.is_none() || !holds_radii(a);
    let kept: Vec<&Attribute> = frame.attributes.iter().filter(is_kept).collect();
    let own_radii = match &frame.radius {
        Some(Radius::PerParticle(radii)) => Some(&radii[..]),
        _ => None,
    };
    // Bring the particles into tree order
    let (positions, indices) = tree_order(frame, own_radii.is_some() || !kept.is_empty());

    // Choose the encoding
    let radii: Option<Vec<f32>> = own_radii.map(|radii| gather(radii, 1, &indices));
    let common = match &frame.radius {
        Some(Radius::Common(radius)) => Some(*radius),
        _ => radii.as_deref().map(smallest),
    };
    let encoding =
        settings.encoding.unwrap_or_else(|| smallest_encoding(&positions, settings.bound, common));
    // Describe the frame
    let spec = FrameSpec {
        is_y_up: false,
        count: frame.len() as u64,
        encoding,
        bound: settings.bound,
        origin: frame.origin,
        rounding: settings.rounding,
        radius: radius_spec(frame, radii.as_deref(), encoding, settings.bound),
        attributes: kept.iter().map(|a| spec_of(a)).collect::<io::Result<_>>()?,
        time: frame.time,
        step,
        dropped: frame.dropped,
        details: FrameDetails { cell: frame.cell, ..FrameDetails::default() },
    };
    // Write it
    let values: Vec<Vec<u8>> = kept.iter().map(|a| in_order(a, &indices)).collect();
    let mut writer = FrameWriter::create(path, spec)?;
    writer.push(&Run {
        positions: &positions,
        radii: radii.as_deref(),
        attributes: &values.iter().map(Vec::as_slice).collect::<Vec<_>>(),
    })?;
    writer.finish()
}

/// The positions in tree order, and the index of each particle in `frame` if it `is_needed`.
fn tree_order(frame: &ParticleFrame, is_needed: bool) -> (Vec<Vec3>, Vec<u32>) {
    let mut positions = vec![Vec3::ZERO; frame.len()];
    let mut indices = vec![0; if is_needed { frame.len() } else { 0 }];
    kd::order_into(&frame.positions, &mut positions, &mut indices, |_| ());
    arrange(&mut positions, &mut indices);
    (positions, indices)
}

/// How the radii of `frame` are stored; `radii` are those of its particles if they differ.
fn radius_spec(
    frame: &ParticleFrame,
    radii: Option<&[f32]>,
    encoding: Encoding,
    bound: Bound,
) -> RadiusSpec {
    match (&frame.radius, radii) {
        (Some(Radius::Common(radius)), _) => RadiusSpec::Common(*radius),
        (_, Some(radii)) => {
            let low = smallest(radii);
            let high = radii.iter().copied().fold(low, f32::max);
            RadiusSpec::PerParticle(radius_range([low, high], encoding, bound))
        }
        _ => RadiusSpec::None,
    }
}

/// The encoding with the fewest bytes. Blocks that exceed the bound count with their size in f32.
pub fn smallest_encoding(positions: &[Vec3], bound: Bound, radius: Option<f32>) -> Encoding {
    let blocks = positions.len().div_ceil(crate::blocks::BLOCK_SIZE);
    let bytes = |encoding: &Encoding| {
        let wide = wide_blocks(positions, *encoding, bound, radius);
        blocks * encoding.block_len() + wide * size_of::<Block>()
    };
    let best = Encoding::ALL.into_iter().min_by_key(bytes);
    best.unwrap_or_default()
}

/// The code for radii within `ends`. If positions are stored as f32, radii are stored without loss.
pub(crate) fn radius_range(ends: [f32; 2], encoding: Encoding, bound: Bound) -> RadiusRange {
    let [low, high] = ends;
    let bound = match (encoding, bound) {
        (Encoding::F32, _) => 0.0,
        (_, Bound::None) => f64::INFINITY,
        (_, bound) => bound.length(Some(low)),
    };
    RadiusRange::within(low, high, bound)
}

fn smallest(radii: &[f32]) -> f32 {
    let low = radii.iter().copied().fold(f32::INFINITY, f32::min);
    if low.is_finite() { low } else { 0.0 }
}

/// Whether readers take radii from this attribute first, so that the radii need not be stored again.
fn holds_radii(attribute: &Attribute) -> bool {
    let is_float = matches!(attribute.data, AttributeData::F32(_) | AttributeData::F64(_));
    is_float && attribute.components == 1 && attribute.name.eq_ignore_ascii_case(RADIUS)
}

fn spec_of(attribute: &Attribute) -> io::Result<AttributeSpec> {
    Ok(AttributeSpec {
        name: attribute.name.clone(),
        components: u32::try_from(attribute.components).map_err(io::Error::other)?,
        stored: StoredType::Plain(attribute.data.scalar_type()),
        ranges: Vec::new(),
        max_error: 0.0,
    })
}

/// The values of `attribute` in the order of `indices`, little-endian.
fn in_order(attribute: &Attribute, indices: &[u32]) -> Vec<u8> {
    let components = attribute.components;
    with_values!(&attribute.data, values => {
        let ordered = gather(values, components, indices);
        ordered.iter().flat_map(|value| value.to_le_bytes()).collect()
    })
}

fn check(frame: &ParticleFrame) -> io::Result<()> {
    let bad = |what: String| Err(io::Error::new(io::ErrorKind::InvalidInput, what));
    // Check the attributes
    for a in &frame.attributes {
        if a.components == 0 || frame.len().checked_mul(a.components) != Some(a.data.len()) {
            return bad(format!(
                "attribute {} has {} values of {} components for {} particles",
                a.name,
                a.data.len(),
                a.components,
                frame.len()
            ));
        }
    }
    // Check the radii
    if let Some(Radius::PerParticle(radii)) = &frame.radius {
        if radii.len() != frame.len() {
            let (radii, particles) = (radii.len(), frame.len());
            return bad(format!("{radii} radii for {particles} particles"));
        }
        if !radii.iter().all(|r| is_radius(*r)) {
            return bad(
                "a radius is negative, not a number or too large; give one radius for all particles"
                    .to_owned(),
            );
        }
    }
    // Check the positions
    if !frame.positions.par_iter().all(is_near) {
        return bad("a position is not a number or too far away".to_owned());
    }
    Ok(())
}
