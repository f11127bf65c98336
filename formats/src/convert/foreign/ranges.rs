//! A mapped file whose particles its reader decodes range by range, as a source of particles.

use std::sync::Arc;

use glam::DVec3;

use crate::convert::sources::places;
use crate::convert::{ParticleSource, SourceAttribute};
use crate::native::MappedFile;
use crate::open::SiblingFiles;
use crate::{FrameError, Labels, SimulationCell};
use spherule_readers::ranges::ParticleRanges;

/// The particles of a mapped file.
#[derive(Debug)]
pub(super) struct RangeSource {
    file: Arc<MappedFile>,
    siblings: SiblingFiles,
    ranges: Box<dyn ParticleRanges>,
    attributes: Vec<SourceAttribute>,
}

impl RangeSource {
    /// The particles of `ranges`, which reads `file` and some of its `siblings`.
    pub(super) fn new(
        file: Arc<MappedFile>,
        siblings: SiblingFiles,
        ranges: Box<dyn ParticleRanges>,
    ) -> Self {
        let attributes = ranges.attributes().into_iter().map(|attribute| SourceAttribute {
            name: attribute.name,
            components: attribute.components,
            scalar: attribute.scalar,
        });
        Self { attributes: attributes.collect(), file, siblings, ranges }
    }

    fn check_range(&self, first: u64, count: usize) -> Result<(), FrameError> {
        places(self.file.path(), first, count, self.ranges.count()).map(|_| ())
    }
}

impl ParticleSource for RangeSource {
    fn count(&self) -> u64 {
        self.ranges.count()
    }

    fn attributes(&self) -> &[SourceAttribute] {
        &self.attributes
    }

    fn time(&self) -> Option<f64> {
        self.ranges.time()
    }

    fn cell(&self) -> Option<SimulationCell> {
        self.ranges.cell()
    }

    fn step(&self) -> Option<i64> {
        self.ranges.step()
    }

    fn notes(&self) -> &[String] {
        self.ranges.notes()
    }

    fn labels(&self) -> Labels {
        self.ranges.labels().clone()
    }

    fn position_len(&self) -> Option<u64> {
        Some(self.ranges.position_len())
    }

    fn read_positions(&self, first: u64, to: &mut [DVec3]) -> Result<(), FrameError> {
        self.check_range(first, to.len())?;
        let read = self.ranges.read_positions(first, to);
        read.map_err(|e| e.in_file(self.file.path()))
    }

    fn read_values(&self, attribute: usize, first: u64, to: &mut [u8]) -> Result<(), FrameError> {
        let width = self.attributes.get(attribute).map_or(1, SourceAttribute::width);
        self.check_range(first, to.len() / width.max(1))?;
        let read = self.ranges.read_values(attribute, first, to);
        read.map_err(|e| e.in_file(self.file.path()))
    }

    fn check(&self) -> Result<(), FrameError> {
        self.file.check()?;
        self.siblings.check()
    }
}
