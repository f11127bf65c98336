//! A batch of particles read from the source: the finite ones, relative to the origin, with their rows.

use std::sync::Mutex;

use glam::{DVec3, Vec3};

use super::columns::{RadiusColumn, StoredColumns};
use super::source::ParticleSource;
use crate::{FrameError, is_near};

/// The particles of one range of the source, and the buffers to read them.
#[derive(Debug, Default)]
pub(super) struct Batch {
    /// Finite positions, relative to the origin.
    pub(super) positions: Vec<Vec3>,
    /// One row for each position.
    pub(super) rows: Vec<u8>,
    /// Index in the range of each position; empty if all positions of the range are finite.
    kept: Vec<u32>,
    /// World positions of the whole range, in the order of the source.
    pub(super) world: Vec<DVec3>,
    /// Values of one attribute for the whole range.
    pub(super) values: Vec<u8>,
}

/// A range of particles of the source.
#[derive(Debug, Clone, Copy)]
pub(super) struct ParticleRange {
    pub(super) first: u64,
    pub(super) len: usize,
}

impl ParticleRange {
    /// Range number `number` when `count` particles are cut into ranges of `len`.
    pub(super) fn nth(number: u64, len: usize, count: u64) -> Self {
        let first = number * len as u64;
        let left = usize::try_from(count - first).unwrap_or(usize::MAX);
        Self { first, len: left.min(len) }
    }
}

impl Batch {
    /// Reads the positions of `stretch`.
    pub(super) fn read_positions(
        &mut self,
        source: &dyn ParticleSource,
        origin: DVec3,
        stretch: ParticleRange,
    ) -> Result<(), FrameError> {
        self.world.resize(stretch.len, DVec3::ZERO);
        source.read_positions(stretch.first, &mut self.world)?;
        self.positions.clear();
        self.kept.clear();
        let relative = |p: &DVec3| (*p - origin).as_vec3();
        self.positions.extend(self.world.iter().map(relative));
        if self.positions.iter().all(is_near) {
            return Ok(());
        }
        let numbered = (0..).zip(&self.positions);
        let finite = numbered.filter(|(_, p)| is_near(p));
        self.kept.extend(finite.map(|(number, _)| number));
        self.positions.retain(is_near);
        Ok(())
    }

    /// Calls `see` with the index in the batch of each particle that is kept.
    pub(super) fn for_each_place(&self, mut see: impl FnMut(usize)) {
        if self.kept.len() == self.positions.len() {
            self.kept.iter().for_each(|place| see(*place as usize));
        } else {
            (0..self.positions.len()).for_each(see);
        }
    }

    /// Reads the values of attribute `attribute`, `width` bytes for each particle of `stretch`.
    pub(super) fn read_values(
        &mut self,
        source: &dyn ParticleSource,
        attribute: usize,
        width: usize,
        stretch: ParticleRange,
    ) -> Result<(), FrameError> {
        self.values.resize(stretch.len * width, 0);
        source.read_values(attribute, stretch.first, &mut self.values)
    }

    /// Reads the rows of the particles whose positions were read. Raises each of `errors` to the largest error
    /// of its attribute.
    pub(super) fn read_rows(
        &mut self,
        source: &dyn ParticleSource,
        columns: &StoredColumns,
        stretch: ParticleRange,
        errors: &mut [f64],
    ) -> Result<(), FrameError> {
        // Make room for the rows
        let width = columns.width();
        self.rows.resize(self.positions.len() * width, 0);
        if width == 0 {
            return Ok(());
        }
        let mut rows = std::mem::take(&mut self.rows);
        let mut at = 0;
        // Store the radii first
        if let Some(radius) = &columns.radius {
            let size = source.attributes()[radius.attribute].width();
            self.read_values(source, radius.attribute, size, stretch)?;
            let mut row = rows.chunks_exact_mut(width);
            self.for_each_place(|place| {
                let value = &self.values[place * size..][..size];
                let own = radius.radii(value).zip(row.next());
                own.for_each(|(radius, row)| row[..4].copy_from_slice(&radius.to_le_bytes()));
            });
            at += RadiusColumn::WIDTH;
        }
        // Store the attributes behind them
        for (column, error) in columns.attributes.iter().zip(errors) {
            // Read the values, or number the particles
            let size = column.source_width();
            match column.attribute {
                Some(attribute) => self.read_values(source, attribute, size, stretch)?,
                None => self.fill_places(size, stretch),
            }
            // Encode the value of each kept particle
            let own = at..at + column.width();
            let mut row = rows.chunks_exact_mut(width);
            self.for_each_place(|place| {
                let value = &self.values[place * size..][..size];
                if let Some(row) = row.next() {
                    *error = error.max(column.store(value, &mut row[own.clone()]));
                }
            });
            at = own.end;
        }
        self.rows = rows;
        Ok(())
    }

    /// Fills `values` with the indices of the particles in the source, `size` bytes each.
    fn fill_places(&mut self, size: usize, stretch: ParticleRange) {
        self.values.clear();
        for place in stretch.first..stretch.first + stretch.len as u64 {
            self.values.extend_from_slice(&place.to_le_bytes()[..size]);
        }
    }
}

/// Buffers for reuse. The pool allocates only as many as are in use at the same time.
#[derive(Debug, Default)]
pub(super) struct BufferPool<T>(Mutex<Vec<T>>);

impl<T: Default> BufferPool<T> {
    pub(super) fn take(&self) -> T {
        let mut all = self.0.lock().unwrap_or_else(|e| e.into_inner());
        all.pop().unwrap_or_default()
    }

    pub(super) fn put(&self, thing: T) {
        let mut all = self.0.lock().unwrap_or_else(|e| e.into_inner());
        all.push(thing);
    }
}
