//! Numbers with fixed strides in a file, gathered into one array a property.
//!
//! Interleaved records (BGEO, binary PLY, structured NPY), planes one after another (Fortran order)
//! and plain rows are all described alike: a [`StridedColumn`] has for each of its components the offset of the
//! first number is and how far it is to the next particle's. Parsing headers is left to the readers.

mod fill;

use glam::{DVec3, Vec3};

use self::fill::fill;
use spherule_frame::names::RECORD_VECTORS;
use spherule_frame::{
    Attribute, AttributeData, Endian, MemoryBudget, ParseError, Positions, RawParticles, ScalarType,
};

/// Particles decoded for all columns before moving on: the bytes of a block stay in the cache, so
/// that a file with many properties still crosses the memory bus once.
const BLOCK: usize = 4096;

/// Offset and stride of one component: particle `i` has it at byte `start + i * stride`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ComponentStride {
    /// Byte of particle 0.
    pub start: usize,
    /// Bytes from one particle to the next.
    pub stride: usize,
}

/// One property of all particles.
#[derive(Debug, Clone, PartialEq)]
pub struct StridedColumn {
    /// Name in the file.
    pub name: String,
    /// Stored type of every component.
    pub scalar: ScalarType,
    /// Stored byte order of every component.
    pub endian: Endian,
    /// One per component.
    pub component_strides: Vec<ComponentStride>,
}

impl StridedColumn {
    /// A column of `components` numbers that are adjacent in each record; `first` is the first of them.
    pub fn interleaved(
        name: impl Into<String>,
        (scalar, endian): (ScalarType, Endian),
        components: usize,
        first: ComponentStride,
    ) -> Self {
        let component = |index: usize| ComponentStride {
            start: first.start + index * scalar.size(),
            stride: first.stride,
        };
        Self {
            name: name.into(),
            scalar,
            endian,
            component_strides: (0..components).map(component).collect(),
        }
    }

    fn same_storage(&self, other: &Self) -> bool {
        self.scalar == other.scalar && self.endian == other.endian
    }

    /// Whether all of `count` particles are within `len` bytes.
    fn fits(&self, count: usize, len: usize) -> bool {
        self.component_strides.iter().all(|component_stride| {
            count == 0
                || (count - 1)
                    .checked_mul(component_stride.stride)
                    .and_then(|last| last.checked_add(component_stride.start))
                    .and_then(|last| last.checked_add(self.scalar.size()))
                    .is_some_and(|end| end <= len)
        })
    }
}

/// Rejects `count` particles of at least `each` bytes, from byte `at` on, that do not fit into a file
/// of `len` bytes.
///
/// # Errors
/// [`ParseError::Malformed`] at `at`, or at the end of the file if `at` is beyond it, with the bytes needed and the
/// bytes there.
pub(super) fn check_room(
    at: usize,
    count: usize,
    each: usize,
    len: usize,
) -> Result<(), ParseError> {
    let at = at.min(len);
    let available = len - at;
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

/// Offsets and strides of the particles of one time step, without their values.
#[derive(Debug, Clone, PartialEq)]
pub struct ParticleLayout {
    /// Particles.
    pub count: usize,
    /// Positions: two or three components in all, x first. A missing third is 0: a run in the plane.
    pub axes: Vec<StridedColumn>,
    /// The homogeneous coordinate, one f32, by which positions of f32 are divided unless it is 0 or 1.
    pub weight: Option<StridedColumn>,
    /// Other properties, each of at least one component.
    pub attributes: Vec<StridedColumn>,
    /// Simulation time, if the file has it.
    pub time: Option<f64>,
    /// Step number, if the file has it.
    pub step: Option<i64>,
}

impl ParticleLayout {
    /// `count` particles with these `axes` and `attributes`; those without components are left out.
    pub fn new(count: usize, axes: Vec<StridedColumn>, mut attributes: Vec<StridedColumn>) -> Self {
        attributes.retain(|column| !column.component_strides.is_empty());
        Self { count, axes: join_alike(axes), weight: None, attributes, time: None, step: None }
    }

    /// Rejects columns that reach past the end of a file of `len` bytes.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] at the end of the file, with the name of the column.
    pub fn check(&self, len: usize) -> Result<(), ParseError> {
        let columns = self.axes.iter().chain(&self.weight);
        check_columns(columns.chain(&self.attributes), self.count, len)
    }

    /// Bytes that the numbers take in memory.
    pub(super) fn byte_len(&self) -> u64 {
        let each = self
            .columns()
            .map(|c| c.component_strides.len() * c.scalar.size())
            .fold(0, usize::saturating_add);
        (each as u64).saturating_mul(self.count as u64)
    }

    /// Reads everything: positions in the precision of the file, attributes as they are.
    ///
    /// # Errors
    /// As [`Self::check`].
    pub(super) fn particles(self, bytes: &[u8]) -> Result<RawParticles, ParseError> {
        self.check(bytes.len())?;
        let columns: Vec<StridedColumn> = self.columns().cloned().collect();
        let gathered = gather(bytes, self.count, &columns);
        Ok(self.assemble(gathered))
    }

    /// Axes, the homogeneous coordinate, attributes.
    fn columns(&self) -> impl Iterator<Item = &StridedColumn> {
        let columns = self.axes.iter().chain(&self.weight);
        columns.chain(&self.attributes)
    }

    /// The particles whose [`Self::columns`] have been decoded.
    fn assemble(self, mut gathered: Vec<AttributeData>) -> RawParticles {
        let axes = self.axes.len();
        let data = gathered.split_off(axes + usize::from(self.weight.is_some()));
        let weight = gathered.split_off(axes).pop();
        let attributes = self
            .attributes
            .into_iter()
            .zip(data)
            .map(|(column, data)| Attribute {
                name: column.name,
                components: column.component_strides.len(),
                data,
            })
            .collect();
        let mut positions = positions(gathered, self.count);
        if let Some(weight) = weight {
            divide(&mut positions, weight);
        }
        RawParticles {
            positions,
            attributes,
            time: self.time,
            step: self.step,
            ..RawParticles::default()
        }
    }
}

/// Particles that are decoded some at a time, within a budget.
pub(super) struct GrowingParticles {
    layout: ParticleLayout,
    data: Vec<AttributeData>,
    /// Particles so far.
    count: usize,
    budget: MemoryBudget,
}

impl GrowingParticles {
    /// No particles yet, with capacity for an estimate of `room` if `budget` allows it.
    pub(super) fn new(layout: ParticleLayout, room: usize, budget: MemoryBudget) -> Self {
        let each = layout.columns().map(|c| c.component_strides.len() * c.scalar.size());
        let need = each.fold(0, usize::saturating_add).saturating_mul(room);
        let room = if need as u64 <= budget.bytes() { room } else { 0 };
        let empty = |column: &StridedColumn| {
            let mut data = AttributeData::zeros(column.scalar, 0);
            data.reserve(column.component_strides.len().saturating_mul(room));
            data
        };
        Self { data: layout.columns().map(empty).collect(), layout, count: 0, budget }
    }

    /// Adds the `count` particles of `records`, which begin at its first byte.
    ///
    /// # Errors
    /// [`ParseError::TooLarge`].
    pub(super) fn append(&mut self, records: &[u8], count: usize) -> Result<(), ParseError> {
        self.count += count;
        let held: u64 = self.data.iter().map(AttributeData::byte_len).sum();
        let more =
            self.layout.columns().map(|c| c.component_strides.len() * c.scalar.size() * count);
        self.budget.check(held + more.sum::<usize>() as u64, "its numbers in memory are")?;
        for (column, data) in self.layout.columns().zip(&mut self.data) {
            let mut block =
                AttributeData::zeros(column.scalar, column.component_strides.len() * count);
            fill(&mut block, records, column, 0, count);
            data.append(block);
        }
        Ok(())
    }

    pub(super) fn into_particles(mut self) -> RawParticles {
        self.data.iter_mut().for_each(AttributeData::shrink);
        self.layout.count = self.count;
        self.layout.assemble(self.data)
    }
}

/// Applies the homogeneous coordinate.
fn divide(positions: &mut Positions, weight: AttributeData) {
    if let (AttributeData::F32(weight), Positions::F32(positions)) = (weight, positions) {
        for (position, w) in positions.iter_mut().zip(weight) {
            *position = divided(*position, w);
        }
    }
}

fn divided(position: Vec3, w: f32) -> Vec3 {
    if w != 1.0 && w != 0.0 { position / w } else { position }
}

/// Reads one column by itself.
///
/// # Errors
/// As [`ParticleLayout::check`].
pub(super) fn values(
    bytes: &[u8],
    count: usize,
    column: &StridedColumn,
) -> Result<AttributeData, ParseError> {
    check_columns([column], count, bytes.len())?;
    let mut gathered = gather(bytes, count, std::slice::from_ref(column));
    Ok(gathered.pop().expect("one column was gathered"))
}

/// x, y and z of one type become one column, which decodes without a detour.
fn join_alike(axes: Vec<StridedColumn>) -> Vec<StridedColumn> {
    match axes.split_first() {
        Some((first, rest)) if rest.iter().all(|c| c.same_storage(first)) => {
            let mut joined = first.clone();
            joined.component_strides = axes.into_iter().flat_map(|c| c.component_strides).collect();
            vec![joined]
        }
        _ => axes,
    }
}

fn check_columns<'c>(
    columns: impl IntoIterator<Item = &'c StridedColumn>,
    count: usize,
    len: usize,
) -> Result<(), ParseError> {
    match columns.into_iter().find(|c| !c.fits(count, len)) {
        None => Ok(()),
        Some(column) => Err(ParseError::malformed(
            len,
            format!("file ends before {} of {count} particles", column.name),
        )),
    }
}

/// Decodes all `columns` of `count` particles, which fit.
fn gather(bytes: &[u8], count: usize, columns: &[StridedColumn]) -> Vec<AttributeData> {
    let mut gathered: Vec<AttributeData> = columns
        .iter()
        .map(|c| AttributeData::zeros(c.scalar, c.component_strides.len() * count))
        .collect();
    for first in (0..count).step_by(BLOCK) {
        let end = count.min(first + BLOCK);
        for (column, data) in columns.iter().zip(&mut gathered) {
            fill(data, bytes, column, first, end);
        }
    }
    gathered
}

/// Positions from decoded components, x first; two components lie in the plane z = 0.
///
/// Single precision and short integers stay in f32; anything that f32 would round goes to f64.
pub fn positions(parts: Vec<AttributeData>, count: usize) -> Positions {
    let parts = match <[AttributeData; 1]>::try_from(parts) {
        Ok([AttributeData::F32(v)]) if v.len() == 3 * count => {
            return Positions::F32(bytemuck::allocation::try_cast_vec(v).unwrap_or_else(
                |(_, v)| v.as_chunks().0.iter().map(|p| Vec3::from_array(*p)).collect(),
            ));
        }
        Ok([AttributeData::F64(v)]) if v.len() == 3 * count => {
            return Positions::F64(bytemuck::allocation::try_cast_vec(v).unwrap_or_else(
                |(_, v)| v.as_chunks().0.iter().map(|p| DVec3::from_array(*p)).collect(),
            ));
        }
        Ok([part]) => vec![part],
        Err(parts) => parts,
    };
    let exact_in_f32 = parts.iter().all(|part| part.scalar_type().is_exact_in_f32());
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
/// `red green blue` with or without `alpha`, `r g b`) under the name of the vector. Parts that are missing or
/// of different types stay as they are.
pub(super) fn group_vectors(mut columns: Vec<StridedColumn>) -> Vec<StridedColumn> {
    for (name, parts) in RECORD_VECTORS {
        let places: Option<Vec<usize>> = parts
            .iter()
            .map(|part| {
                columns.iter().position(|c| {
                    c.component_strides.len() == 1 && c.name.eq_ignore_ascii_case(part)
                })
            })
            .collect();
        if let Some(places) = places {
            merge_columns(&mut columns, &places, name);
        }
    }
    columns
}

/// Replaces the columns at `places` by one called `name`, where the earliest of them was.
fn merge_columns(columns: &mut Vec<StridedColumn>, places: &[usize], name: &str) {
    let parts: Vec<StridedColumn> =
        places.iter().filter_map(|p| columns.get(*p).cloned()).collect();
    let (Some(first), Some(earliest)) = (parts.first(), places.iter().min()) else {
        return;
    };
    if !parts.iter().all(|c| c.same_storage(first)) {
        return;
    }
    let merged = StridedColumn {
        name: name.to_owned(),
        scalar: first.scalar,
        endian: first.endian,
        component_strides: parts.iter().flat_map(|c| c.component_strides.clone()).collect(),
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
