//! Photons near a point, as estimates of the light there use them.

use glam::Vec3;

/// Photons of an estimate.
pub(super) const NEIGHBOURS: usize = 48;

/// A photon in an estimate: the square of its distance, and its index.
pub(super) type Neighbour = (f32, u32);

/// A photon near a point.
#[derive(Debug, Clone, Copy)]
pub(super) struct NearPhoton {
    /// Unit vector to where its light comes from.
    pub(super) to_light: Vec3,
    pub(super) irradiance: Vec3,
    /// Its light group.
    pub(super) group: usize,
}

/// The photons near a point.
pub(super) type NearPhotons = Vec<NearPhoton>;
