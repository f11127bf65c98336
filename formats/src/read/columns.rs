//! Numbers that sit at fixed steps in a file, gathered into one array a property.
//!
//! Interleaved records (BGEO, binary PLY, structured NPY), planes one after another (Fortran order)
//! and plain rows are all the same to it: a [`Column`] says for each of its components where the
//! first number is and how far it is to the next particle's. Parsing headers is left to the readers.

use glam::{DVec3, Vec3};

use crate::{Attribute, AttributeData, Endian, ParseError, Positions, RawParticles, ScalarType};

/// Particles decoded for all columns before moving on: the bytes of a block stay in the cache, so
/// that a file with many properties still crosses the memory bus once.
const BLOCK: usize = 4096;

/// Where one component is: particle `i` has it at byte `start + i * stride`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Lane {
    /// Byte of particle 0.
    pub(super) start: usize,
    /// Bytes from one particle to the next.
    pub(super) stride: usize,
}

/// One property of all particles.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Column {
    /// Name in the file.
    pub(super) name: String,
    /// Stored type of every component.
    pub(super) scalar: ScalarType,
    /// Stored byte order of every component.
    pub(super) endian: Endian,
    /// One per component.
    pub(super) lanes: Vec<Lane>,
}

impl Column {
    fn same_storage(&self, other: &Self) -> bool {
        self.scalar == other.scalar && self.endian == other.endian
    }

    /// Whether all of `count` particles lie within `len` bytes.
    fn fits(&self, count: usize, len: usize) -> bool {
        self.lanes.iter().all(|lane| {
            count == 0
                || (count - 1)
                    .checked_mul(lane.stride)
                    .and_then(|last| last.checked_add(lane.start))
                    .and_then(|last| last.checked_add(self.scalar.size()))
                    .is_some_and(|end| end <= len)
        })
    }
}

/// Refuses `count` particles of at least `each` bytes, from byte `at` on, that cannot be in a file
/// of `len` bytes.
///
/// # Errors
/// [`ParseError::Malformed`] at `at`, with the bytes needed and the bytes there.
pub(super) fn check_room(
    at: usize,
    count: usize,
    each: usize,
    len: usize,
) -> Result<(), ParseError> {
    let available = len.saturating_sub(at);
    match count.checked_mul(each) {
        Some(need) if need <= available => Ok(()),
        Some(need) => Err(ParseError::malformed(
            at,
            format!("{count} particles need {need} bytes, file has {available} left"),
        )),
        None => Err(ParseError::malformed(
            at,
            format!(
                "{count} particles of {each} bytes are more than memory, file has {available} left"
            ),
        )),
    }
}

/// Reads `axes` (two or three components in all, x first) as positions and `attributes` as they
/// are. A missing third component is 0: a run in the plane.
///
/// # Errors
/// [`ParseError::Malformed`] if a column reaches past the end of `bytes`.
pub(super) fn particles(
    bytes: &[u8],
    count: usize,
    axes: Vec<Column>,
    attributes: Vec<Column>,
) -> Result<RawParticles, ParseError> {
    let mut columns = join_alike(axes);
    let axes = columns.len();
    columns.extend(attributes);
    let mut gathered = gather(bytes, count, &columns)?;
    let data = gathered.split_off(axes);
    let attributes = columns
        .drain(axes..)
        .zip(data)
        .filter(|(column, _)| !column.lanes.is_empty())
        .map(|(column, data)| Attribute {
            name: column.name,
            components: column.lanes.len(),
            data,
        })
        .collect();
    Ok(RawParticles {
        positions: positions(gathered, count),
        attributes,
        time: None,
        step: None,
    })
}

/// x, y and z of one type become one column, which decodes without a detour.
fn join_alike(axes: Vec<Column>) -> Vec<Column> {
    match axes.split_first() {
        Some((first, rest)) if rest.iter().all(|c| c.same_storage(first)) => {
            let mut joined = first.clone();
            joined.lanes = axes.into_iter().flat_map(|c| c.lanes).collect();
            vec![joined]
        }
        _ => axes,
    }
}

/// Decodes all `columns` of `count` particles.
fn gather(
    bytes: &[u8],
    count: usize,
    columns: &[Column],
) -> Result<Vec<AttributeData>, ParseError> {
    if let Some(column) = columns.iter().find(|c| !c.fits(count, bytes.len())) {
        return Err(ParseError::malformed(
            bytes.len(),
            format!("file ends before {} of {count} particles", column.name),
        ));
    }
    let mut gathered: Vec<AttributeData> = columns
        .iter()
        .map(|c| zeros(c.scalar, c.lanes.len() * count))
        .collect();
    for first in (0..count).step_by(BLOCK) {
        let end = count.min(first + BLOCK);
        for (column, data) in columns.iter().zip(&mut gathered) {
            fill(data, bytes, column, first, end);
        }
    }
    Ok(gathered)
}

/// The storage of a column; untouched pages cost nothing yet.
fn zeros(scalar: ScalarType, len: usize) -> AttributeData {
    match scalar {
        ScalarType::I8 => AttributeData::I8(vec![0; len]),
        ScalarType::U8 => AttributeData::U8(vec![0; len]),
        ScalarType::I16 => AttributeData::I16(vec![0; len]),
        ScalarType::U16 => AttributeData::U16(vec![0; len]),
        ScalarType::I32 => AttributeData::I32(vec![0; len]),
        ScalarType::U32 => AttributeData::U32(vec![0; len]),
        ScalarType::I64 => AttributeData::I64(vec![0; len]),
        ScalarType::U64 => AttributeData::U64(vec![0; len]),
        ScalarType::F32 => AttributeData::F32(vec![0.0; len]),
        ScalarType::F64 => AttributeData::F64(vec![0.0; len]),
    }
}

/// Decodes particles `first..end` of a column that [`Column::fits`].
fn fill(data: &mut AttributeData, bytes: &[u8], column: &Column, first: usize, end: usize) {
    macro_rules! fill {
        ($v:expr, $ty:ty) => {{
            let width = column.lanes.len();
            let block = $v
                .get_mut(first * width..end * width)
                .expect("gather made room for every particle");
            match column.endian {
                Endian::Little => {
                    fill_block(block, bytes, &column.lanes, first, <$ty>::from_le_bytes)
                }
                Endian::Big => fill_block(block, bytes, &column.lanes, first, <$ty>::from_be_bytes),
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
    lanes: &[Lane],
    first: usize,
    decode: impl Fn([u8; S]) -> T,
) {
    let width = lanes.len();
    let tail = |lane: &Lane| {
        bytes
            .get(lane.start + first * lane.stride..)
            .unwrap_or_default()
    };
    match adjacent_run::<S>(lanes) {
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
            for (component, lane) in lanes.iter().enumerate() {
                let numbers = block.iter_mut().skip(component).step_by(width);
                let records = tail(lane).chunks(lane.stride.max(1));
                for (number, record) in numbers.zip(records) {
                    if let Some(stored) = record.first_chunk() {
                        *number = decode(*stored);
                    }
                }
            }
        }
    }
}

/// The first lane, if the others follow it byte by byte within a record.
fn adjacent_run<const S: usize>(lanes: &[Lane]) -> Option<Lane> {
    let first = *lanes.first()?;
    let adjacent = lanes.iter().enumerate().all(|(component, lane)| {
        lane.stride == first.stride && lane.start == first.start + component * S
    });
    (adjacent && lanes.len() * S <= first.stride).then_some(first)
}

/// Positions from decoded components, x first; two components lie in the plane z = 0.
///
/// Single precision and short integers stay in f32; anything that f32 would round goes to f64.
pub(super) fn positions(parts: Vec<AttributeData>, count: usize) -> Positions {
    let parts = match <[AttributeData; 1]>::try_from(parts) {
        Ok([AttributeData::F32(v)]) if v.len() == 3 * count => {
            return Positions::F32(bytemuck::allocation::try_cast_vec(v).unwrap_or_else(
                |(_, v)| {
                    v.as_chunks()
                        .0
                        .iter()
                        .map(|p| Vec3::from_array(*p))
                        .collect()
                },
            ));
        }
        Ok([AttributeData::F64(v)]) if v.len() == 3 * count => {
            return Positions::F64(bytemuck::allocation::try_cast_vec(v).unwrap_or_else(
                |(_, v)| {
                    v.as_chunks()
                        .0
                        .iter()
                        .map(|p| DVec3::from_array(*p))
                        .collect()
                },
            ));
        }
        Ok([part]) => vec![part],
        Err(parts) => parts,
    };
    let exact_in_f32 = parts.iter().all(|part| {
        matches!(
            part.scalar_type(),
            ScalarType::F32 | ScalarType::I8 | ScalarType::U8 | ScalarType::I16 | ScalarType::U16
        )
    });
    let wide = (0..count).map(|particle| {
        let mut axes = parts.iter().flat_map(|part| {
            let width = part.len() / count;
            (0..width).map(move |c| part.get_f64(particle * width + c))
        });
        let mut next = || axes.next().unwrap_or(0.0);
        DVec3::new(next(), next(), next())
    });
    if exact_in_f32 {
        Positions::F32(wide.map(|p| p.as_vec3()).collect())
    } else {
        Positions::F64(wide.collect())
    }
}

/// Collects scalars that are known to be the parts of a vector (`vx vy vz`, `nx ny nz`,
/// `red green blue` with or without `alpha`) under the name of the vector. Parts that are missing or
/// of different types stay as they are.
pub(super) fn group_vectors(mut columns: Vec<Column>) -> Vec<Column> {
    const VECTORS: [(&str, &[&str]); 4] = [
        ("velocity", &["vx", "vy", "vz"]),
        ("normal", &["nx", "ny", "nz"]),
        ("color", &["red", "green", "blue", "alpha"]),
        ("color", &["red", "green", "blue"]),
    ];
    for (name, parts) in VECTORS {
        let places: Option<Vec<usize>> = parts
            .iter()
            .map(|part| {
                columns
                    .iter()
                    .position(|c| c.lanes.len() == 1 && c.name.eq_ignore_ascii_case(part))
            })
            .collect();
        if let Some(places) = places {
            merge_columns(&mut columns, &places, name);
        }
    }
    columns
}

/// Replaces the columns at `places` by one called `name`, where the earliest of them was.
fn merge_columns(columns: &mut Vec<Column>, places: &[usize], name: &str) {
    let parts: Vec<Column> = places
        .iter()
        .filter_map(|p| columns.get(*p).cloned())
        .collect();
    let (Some(first), Some(earliest)) = (parts.first(), places.iter().min()) else {
        return;
    };
    if !parts.iter().all(|c| c.same_storage(first)) {
        return;
    }
    let merged = Column {
        name: name.to_owned(),
        scalar: first.scalar,
        endian: first.endian,
        lanes: parts.iter().flat_map(|c| c.lanes.clone()).collect(),
    };
    let mut index = 0;
    columns.retain_mut(|column| {
        let part = places.contains(&index);
        if index == *earliest {
            *column = merged.clone();
        }
        index += 1;
        !part || index == earliest + 1
    });
}
