//! Runs of particles out of columns: numbers as they are, as bytes, or as positions.

use glam::DVec3;
use rayon::prelude::*;

use super::{BLOCK, ComponentStride, ParticleLayout, StridedColumn, divided};
use spherule_frame::{AttributeData, Endian, ScalarType};

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
    reason = "one body for ten types, and no wider type to keep integers of 64 bits in"
)]
fn fill_f64(
    to: &mut [f64],
    bytes: &[u8],
    column: &StridedColumn,
    component_strides: &[ComponentStride],
    first: usize,
) {
    macro_rules! fill {
        ($ty:ty) => {
            match column.endian {
                Endian::Little => fill_block(to, bytes, component_strides, first, |b| {
                    <$ty>::from_le_bytes(b) as f64
                }),
                Endian::Big => fill_block(to, bytes, component_strides, first, |b| {
                    <$ty>::from_be_bytes(b) as f64
                }),
            }
        };
    }
    match column.scalar {
        ScalarType::I8 => fill!(i8),
        ScalarType::U8 => fill!(u8),
        ScalarType::I16 => fill!(i16),
        ScalarType::U16 => fill!(u16),
        ScalarType::I32 => fill!(i32),
        ScalarType::U32 => fill!(u32),
        ScalarType::I64 => fill!(i64),
        ScalarType::U64 => fill!(u64),
        ScalarType::F32 => fill!(f32),
        ScalarType::F64 => fill!(f64),
    }
}

/// Decodes particles `first..end` of a column that [`StridedColumn::fits`].
pub(super) fn fill(
    data: &mut AttributeData,
    bytes: &[u8],
    column: &StridedColumn,
    first: usize,
    end: usize,
) {
    macro_rules! fill {
        ($v:expr, $ty:ty) => {{
            let width = column.component_strides.len();
            let block = $v
                .get_mut(first * width..end * width)
                .expect("gather made room for every particle");
            match column.endian {
                Endian::Little => {
                    fill_block(block, bytes, &column.component_strides, first, <$ty>::from_le_bytes)
                }
                Endian::Big => {
                    fill_block(block, bytes, &column.component_strides, first, <$ty>::from_be_bytes)
                }
            }
        }};
    }
    match data {
        AttributeData::I8(v) => fill!(v, i8),
        AttributeData::U8(v) => fill!(v, u8),
        AttributeData::I16(v) => fill!(v, i16),
        AttributeData::U16(v) => fill!(v, u16),
        AttributeData::I32(v) => fill!(v, i32),
        AttributeData::U32(v) => fill!(v, u32),
        AttributeData::I64(v) => fill!(v, i64),
        AttributeData::U64(v) => fill!(v, u64),
        AttributeData::F32(v) => fill!(v, f32),
        AttributeData::F64(v) => fill!(v, f64),
    }
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
