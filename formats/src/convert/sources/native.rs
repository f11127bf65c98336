//! A native frame as a source, to encode the same particles differently without loading all of them into memory.

use glam::DVec3;

use super::places;
use crate::blocks::{BLOCK_SIZE, StoredLeaves};
use crate::convert::{ParticleSource, SourceAttribute};
use crate::names::RADIUS;
use crate::native::layout::RadiusIndex;
use crate::native::{NativeFile, StoredType};
use crate::{FrameError, Labels, ParseError, ScalarType, SimulationCell};

/// A native frame that is mapped or read.
#[derive(Debug)]
pub struct NativeSource<'a> {
    file: &'a NativeFile,
    leaves: StoredLeaves<'a>,
    attributes: Vec<SourceAttribute>,
}

impl<'a> NativeSource<'a> {
    /// The particles of `file`.
    ///
    /// # Errors
    /// If a mapped file has changed, or as [`crate::native::NativeFrame::leaves`].
    pub fn new(file: &'a NativeFile) -> Result<Self, FrameError> {
        let frame = file.frame()?;
        let leaves = frame.leaves().map_err(|e| e.in_file(file.path()))?;
        let index = frame.index();
        // List the attributes in the types that they decode to
        let attribute = |a: &crate::native::layout::AttributeIndex| SourceAttribute {
            name: a.name.clone(),
            components: a.components as usize,
            scalar: match StoredType::of_code(a.stored) {
                Some(StoredType::Plain(scalar)) => scalar,
                _ => ScalarType::F32,
            },
        };
        let mut attributes: Vec<SourceAttribute> = index.attributes.iter().map(attribute).collect();
        // Add the radii, if no attribute has their name
        let is_named = |a: &SourceAttribute| a.name.eq_ignore_ascii_case(RADIUS);
        if matches!(index.radius, RadiusIndex::PerParticle(_)) && !attributes.iter().any(is_named) {
            attributes.push(SourceAttribute {
                name: RADIUS.to_owned(),
                components: 1,
                scalar: ScalarType::F32,
            });
        }
        Ok(Self { file, leaves, attributes })
    }

    fn read_radii(&self, places: std::ops::Range<usize>, to: &mut [u8]) {
        let (values, _) = to.as_chunks_mut::<4>();
        let mut block = None;
        for (place, to) in places.zip(values) {
            if place % BLOCK_SIZE == 0 || block.is_none() {
                block = self.leaves.radii.load(place / BLOCK_SIZE);
            }
            let radius = block.map_or(0.0, |b| b.0[place % BLOCK_SIZE]);
            *to = radius.to_le_bytes();
        }
    }
}

impl ParticleSource for NativeSource<'_> {
    fn count(&self) -> u64 {
        self.leaves.count
    }

    fn attributes(&self) -> &[SourceAttribute] {
        &self.attributes
    }

    fn common_radius(&self) -> Option<f32> {
        match self.file.index().radius {
            RadiusIndex::Common(radius) => Some(radius),
            RadiusIndex::None | RadiusIndex::PerParticle(_) => None,
        }
    }

    fn time(&self) -> Option<f64> {
        self.file.index().time
    }

    fn step(&self) -> Option<i64> {
        self.file.index().step
    }

    fn cell(&self) -> Option<SimulationCell> {
        self.file.index().details.cell
    }

    fn labels(&self) -> Labels {
        self.file.index().details.labels.clone()
    }

    fn read_positions(&self, first: u64, to: &mut [DVec3]) -> Result<(), FrameError> {
        let places = places(self.file.path(), first, to.len(), self.count())?;
        let origin = DVec3::from_array(self.file.index().origin);
        let mut block = None;
        for (place, to) in places.zip(to) {
            let lanes = match block.filter(|_| place % BLOCK_SIZE > 0) {
                Some(lanes) => lanes,
                None => *block.insert(self.leaves.block(place / BLOCK_SIZE)),
            };
            *to = lanes.center(place % BLOCK_SIZE).as_dvec3() + origin;
        }
        Ok(())
    }

    fn read_values(&self, attribute: usize, first: u64, to: &mut [u8]) -> Result<(), FrameError> {
        let width = self.attributes[attribute].width();
        let path = self.file.path();
        let places = places(path, first, to.len() / width.max(1), self.count())?;
        let stored = self.file.frame_unchecked().attributes();
        match stored.get(attribute) {
            None => self.read_radii(places, to),
            Some(view) => view.copy_to(places, to).ok_or_else(|| {
                let what = format!("attribute {} has too few values", view.name());
                ParseError::malformed(0, what).in_file(path)
            })?,
        }
        Ok(())
    }

    fn check(&self) -> Result<(), FrameError> {
        self.file.check()
    }
}
