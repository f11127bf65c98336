//! A mapped file whose numbers have fixed strides, as a source of particles.

use glam::DVec3;

use crate::convert::{ParticleSource, SourceAttribute};
use crate::native::MappedFile;
use crate::read::columns::{ParticleLayout, StridedColumn};
use crate::{FrameError, ParseError};

/// The particles of a mapped file.
#[derive(Debug)]
pub(super) struct ColumnSource {
    file: MappedFile,
    /// Checked against the length of the file.
    layout: ParticleLayout,
    attributes: Vec<SourceAttribute>,
}

impl ColumnSource {
    /// The particles of `file`. `layout` describes it and fits into it.
    pub(super) fn new(file: MappedFile, layout: ParticleLayout) -> Self {
        let attribute = |column: &StridedColumn| SourceAttribute {
            name: column.name.clone(),
            components: column.component_strides.len(),
            scalar: column.scalar,
        };
        file.advise_sequential();
        Self { attributes: layout.attributes.iter().map(attribute).collect(), file, layout }
    }

    /// The index of particle `first`, if `count` particles follow.
    fn place(&self, first: u64, count: usize) -> Result<usize, FrameError> {
        let place = usize::try_from(first).ok();
        let fits = |place: &usize| {
            let end = place.checked_add(count);
            end.is_some_and(|end| end <= self.layout.count)
        };
        place.filter(fits).ok_or_else(|| {
            let all = self.layout.count;
            self.bad(format!("{count} particles from {first} on do not exist, the file has {all}"))
        })
    }

    fn bad(&self, what: String) -> FrameError {
        ParseError::malformed(0, what).in_file(self.file.path())
    }
}

impl ParticleSource for ColumnSource {
    fn count(&self) -> u64 {
        self.layout.count as u64
    }

    fn attributes(&self) -> &[SourceAttribute] {
        &self.attributes
    }

    fn time(&self) -> Option<f64> {
        self.layout.time
    }

    fn step(&self) -> Option<i64> {
        self.layout.step
    }

    fn read_positions(&self, first: u64, to: &mut [DVec3]) -> Result<(), FrameError> {
        let first = self.place(first, to.len())?;
        self.layout.read_positions(self.file.bytes(), first, to);
        Ok(())
    }

    fn read_values(&self, attribute: usize, first: u64, to: &mut [u8]) -> Result<(), FrameError> {
        let (column, described) = self
            .layout
            .attributes
            .get(attribute)
            .zip(self.attributes.get(attribute))
            .ok_or_else(|| self.bad(format!("there is no attribute number {attribute}")))?;
        let width = described.width();
        if !to.len().is_multiple_of(width) {
            let (len, name) = (to.len(), &described.name);
            return Err(self.bad(format!(
                "{len} bytes are not a whole number of {width}, which {name} has for a particle"
            )));
        }
        let first = self.place(first, to.len() / width)?;
        column.read_values(self.file.bytes(), first, to);
        Ok(())
    }

    fn check(&self) -> Result<(), FrameError> {
        self.file.check()
    }
}
