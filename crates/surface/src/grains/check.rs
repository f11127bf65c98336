//! Checks grains and brings them into the form of the tree. What is wrong with a grain is counted.

use glam::Vec3;
use rayon::prelude::*;
use thiserror::Error;

use super::instance::{Instance, Motion, unit_rows};
use super::{GrainShape, GrainSizes, Grains};

/// Greatest number of grains: a leaf of the tree has an index of 31 bits.
pub(super) const MAX_GRAINS: usize = 1 << 31;

/// The largest deviation of the length of a quaternion from 1 that counts as rounding.
const MAX_ROUNDING: f32 = 1e-3;

/// The largest coordinate of a centre, and the largest semi-axis, scene units. Their squares are finite.
const MAX_LENGTH: f32 = 1e15;
/// The smallest semi-axis, scene units.
const MIN_LENGTH: f32 = 1e-15;

/// Why grains cannot be drawn.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum GrainError {
    /// An array has not one element per grain.
    #[error("{found} {name} for {expected} grains")]
    Length {
        /// What is in the array.
        name: &'static str,
        /// Its length.
        found: usize,
        /// The number of grains.
        expected: usize,
    },
    /// There are more grains than the tree can have.
    #[error("{0} grains, but the limit is {MAX_GRAINS}")]
    TooMany(usize),
}

/// What was wrong with grains, in numbers of grains.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct GrainReport {
    /// Grains in the tree.
    pub grains: u64,
    /// Quaternions whose length differed from 1 by more than 1e-3. They were normalised.
    pub not_normalised: u64,
    /// Quaternions that were zero or not finite. These grains are not rotated.
    pub no_orientation: u64,
    /// Semi-axes that were not positive, not finite, or beyond 1e-15 to 1e15. These grains are left out.
    pub bad_sizes: u64,
    /// Centres that were not finite or beyond 1e15. These grains are left out.
    pub bad_centers: u64,
    /// Exponents that were below 1 or not finite. These grains are ellipsoids.
    pub bad_exponents: u64,
    /// Displacements or rotations that were not finite. These grains do not move or do not rotate.
    pub bad_motions: u64,
}

impl GrainReport {
    /// Whether nothing was wrong.
    pub fn is_clean(&self) -> bool {
        *self == Self { grains: self.grains, ..Self::default() }
    }

    /// The sum of both.
    fn plus(self, other: Self) -> Self {
        Self {
            grains: self.grains + other.grains,
            not_normalised: self.not_normalised + other.not_normalised,
            no_orientation: self.no_orientation + other.no_orientation,
            bad_sizes: self.bad_sizes + other.bad_sizes,
            bad_centers: self.bad_centers + other.bad_centers,
            bad_exponents: self.bad_exponents + other.bad_exponents,
            bad_motions: self.bad_motions + other.bad_motions,
        }
    }
}

/// Grains that can be drawn.
pub(super) struct Checked {
    pub(super) instances: Vec<Instance>,
    /// Exponents of superquadrics; half the length between the centres of the caps of capsules. Empty for other shapes,
    /// and for superquadrics with common exponents.
    pub(super) parameters: Vec<[f32; 2]>,
    /// Motions; empty if nothing moves.
    pub(super) motions: Vec<Motion>,
    pub(super) report: GrainReport,
}

/// Checks that arrays have one element per grain.
///
/// # Errors
/// They have not.
pub(super) fn check_lengths(grains: &Grains<'_>) -> Result<(), GrainError> {
    let expected = grains.centers.len();
    let sizes = match grains.sizes {
        GrainSizes::Common(_) => expected,
        GrainSizes::Each(sizes) => sizes.len(),
    };
    let moved = |of: fn(&super::GrainMotion<'_>) -> usize| grains.motion.as_ref().map_or(0, of);
    // Arrays that may be empty
    let optional = [
        ("orientations", grains.orientations.len()),
        ("exponents", grains.exponents.len()),
        ("displacements", moved(|motion| motion.displacements.len())),
        ("rotations", moved(|motion| motion.rotations.len())),
    ];
    let present = optional.into_iter().filter(|(_, found)| *found > 0);
    for (name, found) in present.chain([("sizes", sizes)]) {
        if found != expected {
            return Err(GrainError::Length { name, found, expected });
        }
    }
    if expected > MAX_GRAINS { Err(GrainError::TooMany(expected)) } else { Ok(()) }
}

/// Number of grains of a task.
const TASK: usize = 1 << 16;

/// The grains that can be drawn; `center` is that of the tree. Lengths have been checked.
pub(super) fn checked(grains: &Grains<'_>, shape: &GrainShape, center: Vec3) -> Checked {
    let count = grains.centers.len();
    let has_parameters = match shape {
        GrainShape::Superquadric { .. } => !grains.exponents.is_empty(),
        GrainShape::Capsule => true,
        _ => false,
    };
    let new = |capacity| Checked::new(capacity, has_parameters, grains.motion.is_some());
    let part = |task: usize| {
        let mut part = new(TASK.min(count));
        for index in task * TASK..((task + 1) * TASK).min(count) {
            part.add(grains, shape, index, center);
        }
        part
    };
    // Check in tasks, and join them in their order
    let parts: Vec<Checked> = (0..count.div_ceil(TASK)).into_par_iter().map(part).collect();
    let mut all = new(parts.iter().map(|part| part.instances.len()).sum());
    for part in parts {
        all.instances.extend(part.instances);
        all.parameters.extend(part.parameters);
        all.motions.extend(part.motions);
        all.report = all.report.plus(part.report);
    }
    all.report.grains = all.instances.len() as u64;
    all
}

impl Checked {
    fn new(capacity: usize, has_parameters: bool, is_moving: bool) -> Self {
        Self {
            instances: Vec::with_capacity(capacity),
            parameters: Vec::with_capacity(if has_parameters { capacity } else { 0 }),
            motions: Vec::with_capacity(if is_moving { capacity } else { 0 }),
            report: GrainReport::default(),
        }
    }

    /// Adds the grain `index` unless it cannot be drawn.
    fn add(&mut self, grains: &Grains<'_>, shape: &GrainShape, index: usize, center: Vec3) {
        let report = &mut self.report;
        // Leave out grains without a place or a size
        let position = grains.centers[index];
        let mut size = match grains.sizes {
            GrainSizes::Common(size) => size.to_array(),
            GrainSizes::Each(sizes) => sizes[index],
        };
        let is_placed = is_bounded(position);
        let is_sized = size.iter().all(|axis| (MIN_LENGTH..=MAX_LENGTH).contains(axis));
        report.bad_centers += u64::from(!is_placed);
        report.bad_sizes += u64::from(!is_sized);
        if !(is_placed && is_sized) {
            return;
        }
        // Bring the parameters of the shape into unit coordinates
        match shape {
            GrainShape::Superquadric { .. } if !grains.exponents.is_empty() => {
                self.parameters.push(valid_exponents(grains.exponents[index], report));
            }
            GrainShape::Capsule => {
                let cap = size[0].min(size[2]);
                self.parameters.push([size[2] / cap - 1.0, 0.0]);
                size[2] = cap;
            }
            _ => {}
        }
        // Take the orientation and the motion, with what is wrong with them corrected
        self.instances.push(Instance {
            center: (position - center).to_array(),
            index: spherule_tree::order::index_u32(index),
            rows: unit_rows(unit(grains.orientations.get(index), report), size),
        });
        if let Some(motion) = &grains.motion {
            let displacement = motion.displacements.get(index).copied().unwrap_or(Vec3::ZERO);
            let rotation = motion.rotations.get(index).copied().unwrap_or(Vec3::ZERO);
            report.bad_motions += u64::from(!(is_bounded(displacement) && rotation.is_finite()));
            self.motions.push(Motion::new(displacement, rotation));
        }
    }
}

/// Whether a centre or a displacement has coordinates that can be drawn.
pub(super) fn is_bounded(vector: Vec3) -> bool {
    vector.is_finite() && vector.abs().max_element() < MAX_LENGTH
}

/// The unit quaternion along `orientation`.
fn unit(orientation: Option<&[f32; 4]>, report: &mut GrainReport) -> [f64; 4] {
    const UPRIGHT: [f64; 4] = [0.0, 0.0, 0.0, 1.0];
    let Some(orientation) = orientation else {
        return UPRIGHT;
    };
    let q = orientation.map(f64::from);
    let length = q.iter().map(|c| c * c).sum::<f64>().sqrt();
    // Written so that NaN has no orientation
    if !(length > 0.0 && length < f64::INFINITY) {
        report.no_orientation += 1;
        return UPRIGHT;
    }
    report.not_normalised += u64::from((length - 1.0).abs() > f64::from(MAX_ROUNDING));
    q.map(|c| c / length)
}

/// `exponents`, or those of an ellipsoid if they are no exponents of a convex body.
pub(super) fn valid_exponents(exponents: [f32; 2], report: &mut GrainReport) -> [f32; 2] {
    let is_valid = exponents.iter().all(|n| *n >= 1.0 && *n < f32::INFINITY);
    report.bad_exponents += u64::from(!is_valid);
    if is_valid { exponents } else { [2.0; 2] }
}
