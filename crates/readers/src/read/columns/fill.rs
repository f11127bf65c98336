//! Runs of particles out of columns: numbers as they are, as bytes, or as positions.

use glam::DVec3;
use rayon::prelude::*;

use super::{BLOCK, ComponentStride, ParticleLayout, StridedColumn, divided};
use spherule_frame::{AttributeData, Endian, with_number_type, with_values};

impl ParticleLayout {
    /// Reads the positions of the particles from `first` on. `bytes` are those of a file that
    /// [`Self::check`] was asked about, and it has the particles.
    pub fn read_positions(&self, bytes: &[u8], first: usize, to: &mut [DVec3]) {
        to.par_chunks_mut(BLOCK).enumerate().for_each(|(block, to)| {
            self.block_positions(bytes, first + block * BLOCK, to);
        });
    }

    fn block_positions(&self, bytes: &[u8], first: usize, to: &mut [DVec3]) {
        match self.axes.as_slice() {
            [column] if column.component_strides.len() == 3 => {
                fill_f64(
                    bytemuck::cast_slice_mut(to),
                    bytes,
                    column,
                    &column.component_strides,
                    first,
                );
            }
            columns => {
                to.fill(DVec3::ZERO);
                let mut numbers = [0.0; BLOCK];
                let numbers = &mut numbers[..to.len()];
                let component_strides = columns.iter().flat_map(|c| {
                    c.component_strides.iter().map(move |component_stride| (c, *component_stride))
                });
                for (axis, (column, component_stride)) in component_strides.take(3).enumerate() {
                    fill_f64(numbers, bytes, column, &[component_stride], first);
                    for (position, number) in to.iter_mut().zip(&*numbers) {
                        position[axis] = *number;
                    }
                }
            }
        }
        if let Some(weight) = &self.weight {
            let mut numbers = [0.0; BLOCK];
            let numbers = &mut numbers[..to.len()];
            fill_f64(numbers, bytes, weight, &weight.component_strides, first);
            for (position, w) in to.iter_mut().zip(numbers) {
                #[expect(clippy::cast_possible_truncation, reason = "both are stored as f32")]
                let exact = divided(position.as_vec3(), *w as f32);
                *position = exact.as_dvec3();
            }
        }
    }
}

impl StridedColumn {
    /// Reads the values of the particles from `first` on, little-endian: all components of one, then of the
    /// next. `bytes` are those of a file in which the column fits, and `to` holds whole particles of it.
    pub fn read_values(&self, bytes: &[u8], first: usize, to: &mut [u8]) {
        let width = self.component_strides.len() * self.scalar.size();
        to.par_chunks_mut(BLOCK * width.max(1)).enumerate().for_each(|(block, to)| {
            let first = first + block * BLOCK;
            match self.scalar.size() {
                1 => self.block_values::<1>(bytes, first, to),
                2 => self.block_values::<2>(bytes, first, to),
                4 => self.block_values::<4>(bytes, first, to),
                _ => self.block_values::<8>(bytes, first, to),
            }
        });
    }

    fn block_values<const S: usize>(&self, bytes: &[u8], first: usize, to: &mut [u8]) {
        let (numbers, _) = to.as_chunks_mut::<S>();
        match self.endian {
            Endian::Little => {
                fill_block(numbers, bytes, &self.component_strides, first, |stored: [u8; S]| stored)
            }
            Endian::Big => {
                fill_block(numbers, bytes, &self.component_strides, first, |mut stored: [u8; S]| {
                    stored.reverse();
                    stored
                })
            }
        }
    }
}

/// Decodes `components` of a column, from particle `first` on, as f64.
#[expect(
    clippy::cast_precision_loss,
    clippy::cast_lossless,
    clippy::unnecessary_cast,
    reason = "one body for ten types, and no wider type to keep integers of 64 bits in"
)]
fn fill_f64(
    to: &mut [f64],
    bytes: &[u8],
    column: &StridedColumn,
    component_strides: &[ComponentStride],
    first: usize,
) {
    with_number_type!(column.scalar, Number => match column.endian {
        Endian::Little => {
            fill_block(to, bytes, component_strides, first, |b| Number::from_le_bytes(b) as f64);
        }
        Endian::Big => {
            fill_block(to, bytes, component_strides, first, |b| Number::from_be_bytes(b) as f64);
        }
    });
}

/// Decodes particles `first..end` of a column that [`StridedColumn::fits`].
pub(super) fn fill(
    data: &mut AttributeData,
    bytes: &[u8],
    column: &StridedColumn,
    first: usize,
    end: usize,
) {
    let width = column.component_strides.len();
    with_values!(data, v: Number => {
        let block =
            v.get_mut(first * width..end * width).expect("gather made room for every particle");
        let strides = &column.component_strides;
        match column.endian {
            Endian::Little => fill_block(block, bytes, strides, first, Number::from_le_bytes),
            Endian::Big => fill_block(block, bytes, strides, first, Number::from_be_bytes),
        }
    });
}

/// Writes the block that starts at particle `first`; `S` is the size of a stored number.
fn fill_block<T, const S: usize>(
    block: &mut [T],
    bytes: &[u8],
    component_strides: &[ComponentStride],
    first: usize,
    decode: impl Fn([u8; S]) -> T,
) {
    let width = component_strides.len();
    let tail = |component_stride: &ComponentStride| {
        bytes.get(component_stride.start + first * component_stride.stride..).unwrap_or_default()
    };
    match adjacent_run::<S>(component_strides) {
        Some(run) if run.stride == width * S => {
            for (number, stored) in block.iter_mut().zip(tail(&run).as_chunks().0) {
                *number = decode(*stored);
            }
        }
        Some(run) => {
            let records = tail(&run).chunks(run.stride.max(1));
            for (group, record) in block.chunks_exact_mut(width).zip(records) {
                for (number, stored) in group.iter_mut().zip(record.as_chunks().0) {
                    *number = decode(*stored);
                }
            }
        }
        None => {
            for (component, component_stride) in component_strides.iter().enumerate() {
                let numbers = block.iter_mut().skip(component).step_by(width);
                let records = tail(component_stride).chunks(component_stride.stride.max(1));
                for (number, record) in numbers.zip(records) {
                    if let Some(stored) = record.first_chunk() {
                        *number = decode(*stored);
                    }
                }
            }
        }
    }
}

/// The first component, if the others follow it byte by byte within a record.
fn adjacent_run<const S: usize>(component_strides: &[ComponentStride]) -> Option<ComponentStride> {
    let first = *component_strides.first()?;
    let adjacent = component_strides.iter().enumerate().all(|(component, component_stride)| {
        component_stride.stride == first.stride
            && component_stride.start == first.start + component * S
    });
    (adjacent && component_strides.len() * S <= first.stride).then_some(first)
}
