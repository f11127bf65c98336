//! A generated box with a uniform random distribution of particles.

use std::path::Path;

use glam::DVec3;

use super::places;
use crate::FrameError;
use crate::convert::{ParticleSource, SourceAttribute};
use crate::generate::BoxSettings;

/// The particles of [`crate::generate::fill_box`], in the same order.
#[derive(Debug, Clone, Copy)]
pub struct BoxSource {
    settings: BoxSettings,
    radius: Option<f32>,
}

impl BoxSource {
    /// The particles of `settings`, with an optional common radius.
    pub const fn new(settings: BoxSettings, radius: Option<f32>) -> Self {
        Self { settings, radius }
    }
}

impl ParticleSource for BoxSource {
    fn count(&self) -> u64 {
        self.settings.count as u64
    }

    fn attributes(&self) -> &[SourceAttribute] {
        &[]
    }

    fn common_radius(&self) -> Option<f32> {
        self.radius
    }

    fn read_positions(&self, first: u64, to: &mut [DVec3]) -> Result<(), FrameError> {
        let places = places(Path::new("box"), first, to.len(), self.count())?;
        for (to, place) in to.iter_mut().zip(places) {
            *to = self.settings.particle(place as u64).as_dvec3();
        }
        Ok(())
    }

    fn read_values(&self, _attribute: usize, _first: u64, to: &mut [u8]) -> Result<(), FrameError> {
        // The source has no attributes.
        to.fill(0);
        Ok(())
    }
}
