//! Particles in memory, as the readers return them.

use std::io;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::places;
use crate::convert::{ParticleSource, SourceAttribute};
use crate::native::FrameDetails;
use crate::{
    Attribute, FrameError, Labels, PositionSlice, Positions, RawParticles, SimulationCell,
};
use spherule_frame::with_values;

/// A step that is completely in memory.
#[derive(Debug)]
pub struct RawSource<'a> {
    path: PathBuf,
    positions: PositionSlice<'a>,
    raw_attributes: &'a [Attribute],
    time: Option<f64>,
    step: Option<i64>,
    details: FrameDetails,
    attributes: Vec<SourceAttribute>,
}

impl<'a> RawSource<'a> {
    /// The particles of `raw`; `path` is the file that they were read from.
    ///
    /// # Errors
    /// If an attribute does not have all of its components for each particle.
    pub fn new(path: &Path, raw: &'a RawParticles) -> Result<Self, FrameError> {
        let positions = match &raw.positions {
            Positions::F32(v) => PositionSlice::F32(v),
            Positions::F64(v) => PositionSlice::F64(v),
        };
        Self::build(path, positions, raw)
    }

    /// The particles of `raw`, whose positions belong to a caller; `path` is their name in messages.
    ///
    /// # Errors
    /// Same as [`RawSource::new`].
    pub fn borrowed(
        path: &Path,
        raw: &'a RawParticles<PositionSlice<'a>>,
    ) -> Result<Self, FrameError> {
        Self::build(path, raw.positions, raw)
    }

    fn build<P>(
        path: &Path,
        positions: PositionSlice<'a>,
        raw: &'a RawParticles<P>,
    ) -> Result<Self, FrameError> {
        let count = positions.len();
        // Refuse attributes that have not as many values as the particles need
        let fits = |a: &&Attribute| {
            a.components > 0 && count.checked_mul(a.components) == Some(a.data.len())
        };
        if let Some(a) = raw.attributes.iter().find(|a| !fits(a)) {
            let (name, values, components) = (&a.name, a.data.len(), a.components);
            let what = format!(
                "attribute {name} has {values} values of {components} components for {count} particles"
            );
            let source = io::Error::new(io::ErrorKind::InvalidInput, what);
            return Err(FrameError::io(path, source));
        }
        // Describe the attributes
        let attributes = raw.attributes.iter().map(|a| SourceAttribute {
            name: a.name.clone(),
            components: a.components,
            scalar: a.data.scalar_type(),
        });
        Ok(Self {
            path: path.to_owned(),
            positions,
            raw_attributes: &raw.attributes,
            time: raw.time,
            step: raw.step,
            details: FrameDetails { labels: raw.labels.clone(), cell: raw.cell },
            attributes: attributes.collect(),
        })
    }

    fn places(&self, first: u64, len: usize) -> Result<std::ops::Range<usize>, FrameError> {
        places(&self.path, first, len, self.count())
    }
}

impl ParticleSource for RawSource<'_> {
    fn count(&self) -> u64 {
        self.positions.len() as u64
    }

    fn attributes(&self) -> &[SourceAttribute] {
        &self.attributes
    }

    fn time(&self) -> Option<f64> {
        self.time
    }

    fn step(&self) -> Option<i64> {
        self.step
    }

    fn cell(&self) -> Option<SimulationCell> {
        self.details.cell
    }

    fn labels(&self) -> Labels {
        self.details.labels.clone()
    }

    fn read_positions(&self, first: u64, to: &mut [DVec3]) -> Result<(), FrameError> {
        let places = self.places(first, to.len())?;
        match self.positions {
            PositionSlice::F32(all) => {
                let own = all[places].iter().map(|p| p.as_dvec3());
                to.iter_mut().zip(own).for_each(|(to, p)| *to = p);
            }
            PositionSlice::F64(all) => to.copy_from_slice(&all[places]),
        }
        Ok(())
    }

    fn read_values(&self, attribute: usize, first: u64, to: &mut [u8]) -> Result<(), FrameError> {
        let width = self.attributes[attribute].width();
        let places = self.places(first, to.len() / width.max(1))?;
        let attribute = &self.raw_attributes[attribute];
        let scalars = places.start * attribute.components..places.end * attribute.components;
        with_values!(&attribute.data, values => {
            let size = attribute.data.scalar_type().size();
            for (to, value) in to.chunks_exact_mut(size).zip(&values[scalars]) {
                to.copy_from_slice(&value.to_le_bytes());
            }
        });
        Ok(())
    }
}
