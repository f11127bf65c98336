//! The SPH colour field of a frame: `phi(x) = sum_j V_j W(x - x_j)` with `V_j = 1 / sum_k W(x_j - x_k)` (Müller,
//! Charypar and Gross 2003, eq. 12, with masses cancelled). It is about 1 inside, 0 outside, and 1 at the centre of
//! an isolated particle, so that no drop vanishes.
//!
//! Sums that must not vary in any bit are exact: each term is rounded to a multiple of a power of two that is small,
//! but large enough for the sum to fit into f32. So they do not depend on the order of particles.

use glam::Vec3;

pub(crate) mod bins;
mod density;
pub(crate) mod kernel;
mod query;

use bins::Bins;

/// Terms of the field are multiples of 2^-20, so that sums below 16 are exact.
const FIELD_ROUNDING: f32 = 12.0;

/// `term` rounded to a multiple of 2^-20.
#[inline(always)]
pub(crate) fn rounded(term: f32) -> f32 {
    (term + FIELD_ROUNDING) - FIELD_ROUNDING
}

/// The particles of a frame, sorted into bins, with the volumes of those that contribute to the field.
#[derive(Debug, Default)]
pub struct FieldParticles {
    bins: Bins,
    /// Volume of each particle in units of the inverse of the kernel's central value: at most 1, which is the volume
    /// of an isolated particle. 0 if it was not computed.
    volumes: Vec<f32>,
}

impl FieldParticles {
    /// Sorts `centers` for a kernel with `support`, and computes all volumes. Indices are kept for [`Self::nearest`]
    /// and [`Self::neighbours`].
    pub fn new(centers: &[Vec3], support: f32) -> Self {
        let mut field = Self::sorted(centers, support, true);
        field.bins.order_by_position();
        field.find_volumes(|_| true);
        field
    }

    /// Sorts `centers` without computing volumes.
    pub fn sorted(centers: &[Vec3], support: f32, keep_indices: bool) -> Self {
        Self { bins: Bins::sort(centers, support, keep_indices), volumes: Vec::new() }
    }

    /// Removes the particles of all bins with a false flag in `kept`.
    pub(crate) fn retain(&mut self, kept: &[bool]) {
        self.bins.retain(|bin| kept[bin]);
    }

    /// See [`Bins::order_by_position`].
    pub(crate) fn order_by_position(&mut self) {
        self.bins.order_by_position();
    }

    /// Computes the volumes of the particles in the bins for which `is_needed` returns true.
    pub(crate) fn find_volumes(&mut self, is_needed: impl Fn(usize) -> bool + Sync) {
        self.volumes = density::volumes(&self.bins, is_needed);
    }

    /// Radius of the kernel.
    pub fn support(&self) -> f32 {
        self.bins.size()
    }

    /// The sorted particles.
    pub(crate) fn bins(&self) -> &Bins {
        &self.bins
    }

    /// Volume of each particle, in the order of the bins.
    pub(crate) fn volumes(&self) -> &[f32] {
        &self.volumes
    }

    /// Memory in bytes.
    pub fn byte_len(&self) -> u64 {
        self.bins.byte_len() + size_of_val(&self.volumes[..]) as u64
    }
}

#[cfg(test)]
mod tests;
