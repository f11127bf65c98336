//! Brings the particles of one part into tree order and writes them run by run.

use std::ops::Range;

use glam::Vec3;
use rayon::prelude::*;

use super::account::MemoryAccount;
use super::columns::{RadiusColumn, StoredColumns};
use crate::native::{FrameWriter, Run, arrange};
use crate::order::kd;

/// Particles that are ordered together.
#[derive(Debug, Default)]
pub(super) struct PartData {
    pub(super) positions: Vec<Vec3>,
    /// A row for each particle.
    pub(super) rows: Vec<u8>,
}

impl PartData {
    pub(super) fn len(&self) -> usize {
        self.positions.len()
    }

    pub(super) fn bytes(&self) -> u64 {
        (self.positions.capacity() * size_of::<Vec3>() + self.rows.capacity()) as u64
    }

    /// Room for `len` particles with rows of `width` bytes.
    pub(super) fn with_room(len: usize, width: usize) -> Self {
        Self { positions: Vec::with_capacity(len), rows: Vec::with_capacity(len * width) }
    }

    pub(super) fn clear(&mut self) {
        self.positions.clear();
        self.rows.clear();
    }

    /// Inserts all of `other` before the present particles: among coincident particles, those of an earlier
    /// part come first.
    pub(super) fn prepend(&mut self, other: &mut Self) {
        let (positions, rows) = (other.positions.len(), other.rows.len());
        self.positions.append(&mut other.positions);
        self.rows.append(&mut other.rows);
        self.positions.rotate_right(positions);
        self.rows.rotate_right(rows);
    }

    /// Removes and returns the particles with these indices, which must increase. The others keep their order.
    pub(super) fn take(&mut self, numbers: &[u32], width: usize) -> Self {
        let mut taken = Self::default();
        let mut kept = 0;
        for (nth, number) in numbers.iter().enumerate() {
            let number = *number as usize;
            // Take out the particle
            taken.positions.push(self.positions[number]);
            taken.rows.extend_from_slice(&self.rows[number * width..][..width]);
            let next = numbers.get(nth + 1).map_or(self.len(), |n| *n as usize);
            if nth == 0 {
                kept = number;
            }
            // Close the gap up to the next one
            let staying = number + 1..next;
            self.positions.copy_within(staying.clone(), kept);
            self.rows.copy_within(staying.start * width..staying.end * width, kept * width);
            kept += staying.len();
        }
        let left = self.len() - numbers.len();
        self.positions.truncate(left);
        self.rows.truncate(left * width);
        taken
    }
}

/// Buffers to order parts, reused for each part.
#[derive(Debug, Default)]
pub(super) struct OrderedPart {
    /// Positions in tree order.
    pub(super) positions: Vec<Vec3>,
    /// Index in the part of each position; empty if there are no rows.
    indices: Vec<u32>,
    /// Rows of a run.
    rows: Vec<u8>,
    radii: Vec<f32>,
    attributes: Vec<Vec<u8>>,
}

/// Particles whose rows one task gathers.
const TASK: usize = 4096;

impl OrderedPart {
    /// Room to order parts of `len` particles with rows of `width` bytes.
    pub(super) fn with_room(len: usize, width: usize) -> Self {
        Self {
            positions: Vec::with_capacity(len),
            indices: Vec::with_capacity(if width > 0 { len } else { 0 }),
            ..Self::default()
        }
    }

    /// Computes the order of `part`.
    pub(super) fn order(&mut self, part: &PartData, account: &MemoryAccount) {
        let len = part.len();
        self.positions.resize(len, Vec3::ZERO);
        let is_followed = !part.rows.is_empty();
        self.indices.resize(if is_followed { len } else { 0 }, 0);
        let held = self.bytes();
        account.hold(held);
        let scratch =
            kd::order_into(&part.positions, &mut self.positions, &mut self.indices, |_| ());
        account.hold(scratch);
        account.let_go(scratch + held);
        arrange(&mut self.positions, &mut self.indices);
    }

    /// Writes particles `run` of `part`, which must be ordered already.
    pub(super) fn push(
        &mut self,
        part: &PartData,
        columns: &StoredColumns,
        run: Range<usize>,
        writer: &mut FrameWriter,
    ) -> std::io::Result<()> {
        self.gather(part, columns, &run);
        let attributes: Vec<&[u8]> = self.attributes.iter().map(Vec::as_slice).collect();
        writer.push(&Run {
            positions: &self.positions[run],
            radii: columns.radius.map(|_| &self.radii[..]),
            attributes: &attributes,
        })
    }

    fn gather(&mut self, part: &PartData, columns: &StoredColumns, run: &Range<usize>) {
        let width = columns.width();
        self.attributes.resize(columns.attributes.len(), Vec::new());
        if width == 0 {
            return;
        }
        // Gather the rows in tree order
        self.rows.resize(run.len() * width, 0);
        self.rows
            .par_chunks_mut(TASK * width)
            .zip(self.indices[run.clone()].par_chunks(TASK))
            .for_each(|(rows, indices)| {
                for (row, index) in rows.chunks_exact_mut(width).zip(indices) {
                    row.copy_from_slice(&part.rows[*index as usize * width..][..width]);
                }
            });
        // Split off the radii
        let rows = &self.rows;
        let mut at = 0;
        if columns.radius.is_some() {
            self.radii.resize(run.len(), 0.0);
            let radii = self.radii.par_chunks_mut(TASK);
            radii.zip(rows.par_chunks(TASK * width)).for_each(|(radii, rows)| {
                for (radius, row) in radii.iter_mut().zip(rows.chunks_exact(width)) {
                    *radius = f32::from_le_bytes(std::array::from_fn(|i| row[i]));
                }
            });
            at += RadiusColumn::WIDTH;
        }
        // Split the rows into attributes
        for (column, values) in columns.attributes.iter().zip(&mut self.attributes) {
            let own = at..at + column.width();
            values.resize(run.len() * own.len(), 0);
            values.par_chunks_mut(TASK * own.len()).zip(rows.par_chunks(TASK * width)).for_each(
                |(values, rows)| {
                    let values = values.chunks_exact_mut(own.len());
                    for (to, row) in values.zip(rows.chunks_exact(width)) {
                        to.copy_from_slice(&row[own.clone()]);
                    }
                },
            );
            at = own.end;
        }
    }

    fn bytes(&self) -> u64 {
        let positions = self.positions.capacity() * size_of::<Vec3>();
        (positions + self.indices.capacity() * size_of::<u32>()) as u64
    }
}
