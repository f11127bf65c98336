//! The particles of one time step as columns over all parts: which values they have and where these are.

use super::file::H5File;
use super::piece::{Piece, encoded};
use super::values::Cache;
use spherule_frame::join::{self, ColumnShape, JoinedColumn, PART, PartColumns};
use spherule_frame::{
    Attribute, AttributeData, Labels, MemoryBudget, ParseError, RawParticles, ScalarType,
    SimulationCell,
};
use spherule_readers::read::columns::{StridedColumn, positions};

/// Particles that belong together in a file: a species, a type, an array.
#[derive(Debug)]
pub(super) struct Part {
    /// Value of the attribute `part`.
    pub(super) value: u32,
    /// Name in the file.
    pub(super) name: String,
    /// Number of particles.
    pub(super) count: u64,
    /// Three components in all, or two for particles in a plane.
    pub(super) positions: Vec<Piece>,
    /// Names and values. The components of a vector may be several pieces.
    pub(super) attributes: Vec<(String, Vec<Piece>)>,
}

/// A property of all particles.
#[derive(Debug)]
pub(super) struct Column {
    pub(super) name: String,
    /// Numbers per particle.
    pub(super) components: usize,
    pub(super) scalar: ScalarType,
    /// Values in each part; none in parts that do not have the property.
    cells: Vec<Vec<Piece>>,
}

/// The particles of one time step.
#[derive(Debug)]
pub(super) struct ParticleTable {
    /// Value of `part` and number of particles.
    parts: Vec<(u32, u64)>,
    positions: Column,
    attributes: Vec<Column>,
    /// Whether particles get the attribute `part`.
    is_divided: bool,
    time: Option<f64>,
    step: Option<i64>,
    cell: Option<SimulationCell>,
    /// Which attributes are not in all parts.
    notes: Vec<String>,
    /// Names of parts.
    labels: Labels,
}

impl ParticleTable {
    /// The particles of `parts`; `is_divided` if the file may have several parts, which get numbers then.
    pub(super) fn new(mut parts: Vec<Part>, is_divided: bool) -> Self {
        let names = parts.iter().map(|part| (i64::from(part.value), part.name.clone())).collect();
        let labels = is_divided.then(|| (PART.to_owned(), names));
        parts.retain(|part| part.count > 0);
        let counts = parts.iter().map(|part| (part.value, part.count)).collect();
        let cells: Vec<Vec<Piece>> =
            parts.iter_mut().map(|part| with_three(std::mem::take(&mut part.positions))).collect();
        let is_single = cells.iter().flatten().all(|p| p.scalar().is_exact_in_f32());
        let positions = Column {
            name: "positions".to_owned(),
            components: 3,
            scalar: if is_single { ScalarType::F32 } else { ScalarType::F64 },
            cells,
        };
        if is_divided {
            parts.iter_mut().for_each(|part| part.attributes.retain(|(name, _)| name != PART));
        }
        let layouts: Vec<PartColumns<'_>> = parts.iter().map(Part::columns).collect();
        let plan = join::plan(&layouts);
        let attributes = plan.columns.into_iter().map(|column| Column::of(column, &mut parts));
        Self {
            attributes: attributes.collect(),
            parts: counts,
            positions,
            is_divided,
            time: None,
            step: None,
            cell: None,
            notes: plan.notes,
            labels: labels.into_iter().collect(),
        }
    }

    /// The same particles at this time and step.
    pub(super) fn at(self, time: Option<f64>, step: Option<i64>) -> Self {
        Self { time, step, ..self }
    }

    /// The same particles in this simulation cell.
    pub(super) fn in_cell(self, cell: Option<SimulationCell>) -> Self {
        Self { cell, ..self }
    }

    /// Number of particles.
    pub(super) fn count(&self) -> u64 {
        let counts = self.parts.iter().map(|(_, count)| *count);
        counts.fold(0, u64::saturating_add)
    }

    /// The attributes, without `part`.
    pub(super) fn attributes(&self) -> &[Column] {
        &self.attributes
    }

    /// Whether particles get the attribute `part`.
    pub(super) const fn is_divided(&self) -> bool {
        self.is_divided
    }

    pub(super) const fn time(&self) -> Option<f64> {
        self.time
    }

    pub(super) const fn step(&self) -> Option<i64> {
        self.step
    }

    pub(super) const fn cell(&self) -> Option<SimulationCell> {
        self.cell
    }

    /// Which attributes are not in all parts.
    pub(super) fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Names of parts.
    pub(super) const fn labels(&self) -> &Labels {
        &self.labels
    }

    /// Bytes of the largest chunk of each column.
    pub(super) fn chunk_lens(&self) -> impl Iterator<Item = u64> {
        let columns = std::iter::once(&self.positions).chain(&self.attributes);
        columns.map(Column::chunk_len)
    }

    /// Whether positions are stored as integers.
    pub(super) fn has_integer_positions(&self) -> bool {
        let mut pieces = self.positions.cells.iter().flatten();
        pieces.any(|piece| {
            let is_stored = !piece.stored().is_empty();
            is_stored && !matches!(piece.scalar(), ScalarType::F32 | ScalarType::F64)
        })
    }

    /// Bytes of positions of one particle in memory.
    pub(super) const fn position_len(&self) -> u64 {
        3 * self.positions.scalar.size() as u64
    }

    /// Reads all particles.
    ///
    /// # Errors
    /// [`ParseError::TooLarge`], [`ParseError::Malformed`] if a chunk is damaged.
    pub(super) fn read_all(&self, budget: MemoryBudget) -> Result<RawParticles, ParseError> {
        let count = self.count();
        let columns = || std::iter::once(&self.positions).chain(&self.attributes);
        let width = columns().map(|column| (column.components * column.scalar.size()) as u64);
        let part = if self.is_divided { 4 } else { 0 };
        let width = width.fold(part, u64::saturating_add);
        let chunk = self.chunk_lens().max().unwrap_or(0);
        let need = width.saturating_mul(count).saturating_add(2 * chunk);
        budget.check(need, "its numbers in memory are")?;
        let count = usize::try_from(count).unwrap_or(usize::MAX);
        let read = |column: &Column| {
            let mut data = AttributeData::zeros(column.scalar, column.components * count);
            let to = data.as_bytes_mut();
            self.read(column, None, 0, to, column.scalar)?;
            data.decode_little_endian();
            Ok::<_, ParseError>(data)
        };
        let places = read(&self.positions)?;
        let mut attributes = Vec::with_capacity(self.attributes.len() + 1);
        for column in &self.attributes {
            attributes.push(Attribute {
                name: column.name.clone(),
                components: column.components,
                data: read(column)?,
            });
        }
        if self.is_divided {
            let mut part = Vec::with_capacity(count);
            for (value, count) in &self.parts {
                part.resize(part.len() + usize::try_from(*count).unwrap_or(0), *value);
            }
            attributes.push(Attribute {
                name: PART.to_owned(),
                components: 1,
                data: AttributeData::U32(part),
            });
        }
        Ok(RawParticles {
            positions: positions(vec![places], count),
            attributes,
            time: self.time,
            step: self.step,
            cell: self.cell,
            notes: self.notes.clone(),
            labels: self.labels.clone(),
            ..RawParticles::default()
        })
    }

    /// Reads the positions of the particles from `first` on, as f64.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if a chunk is damaged.
    pub(super) fn read_positions(
        &self,
        cache: Cache<'_>,
        first: u64,
        to: &mut [u8],
    ) -> Result<(), ParseError> {
        self.read(&self.positions, cache, first, to, ScalarType::F64)
    }

    /// Reads the values of `column` of the particles from `first` on, little-endian in type `scalar`.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if a chunk is damaged.
    pub(super) fn read(
        &self,
        column: &Column,
        cache: Cache<'_>,
        first: u64,
        to: &mut [u8],
        scalar: ScalarType,
    ) -> Result<(), ParseError> {
        let record = column.components * scalar.size();
        let mut left = to;
        let (mut start, mut first) = (0, first);
        for ((_, count), cell) in self.parts.iter().zip(&column.cells) {
            let end = start + count;
            if first < end && !left.is_empty() {
                let rows = usize::try_from(end - first).unwrap_or(usize::MAX);
                let (own, rest) = left.split_at_mut(rows.saturating_mul(record).min(left.len()));
                column.read_cell(cell, cache, first - start, own, scalar)?;
                first += (own.len() / record) as u64;
                left = rest;
            }
            start = end;
        }
        Ok(())
    }

    /// Fills `to` with the values of `part` of the particles from `first` on.
    pub(super) fn read_parts(&self, first: u64, to: &mut [u8]) {
        let mut end = 0;
        let mut parts = self.parts.iter();
        let mut value = 0;
        for (index, to) in (first..).zip(to.as_chunks_mut::<4>().0) {
            while index >= end
                && let Some((next, count)) = parts.next()
            {
                value = *next;
                end += count;
            }
            *to = value.to_le_bytes();
        }
    }
}

impl Part {
    /// Its attributes without their values.
    fn columns(&self) -> PartColumns<'_> {
        let columns = self.attributes.iter().filter(|(_, pieces)| !pieces.is_empty());
        let columns = columns.map(|(name, pieces)| ColumnShape {
            name,
            components: pieces.iter().map(Piece::components).sum(),
            scalar: pieces
                .iter()
                .map(Piece::scalar)
                .reduce(ScalarType::common_with)
                .unwrap_or(ScalarType::F32),
        });
        PartColumns { name: &self.name, count: self.count, columns: columns.collect() }
    }
}

/// Positions with three components.
fn with_three(mut pieces: Vec<Piece>) -> Vec<Piece> {
    let components: usize = pieces.iter().map(Piece::components).sum();
    let scalar = pieces.first().map_or(ScalarType::F32, Piece::scalar);
    for _ in components..3 {
        pieces.push(Piece::zero(scalar));
    }
    pieces
}

impl Column {
    /// A joined property with its values, which are taken from `parts`.
    fn of(column: JoinedColumn, parts: &mut [Part]) -> Self {
        let JoinedColumn { name, components, scalar, cells: places } = column;
        let mut cells = vec![Vec::new(); parts.len()];
        for (part, place) in places {
            cells[part] = std::mem::take(&mut parts[part].attributes[place].1);
        }
        Self { name, components, scalar, cells }
    }

    /// Bytes of its largest chunk.
    fn chunk_len(&self) -> u64 {
        let stored = self.cells.iter().flatten().flat_map(Piece::stored);
        stored.map(|values| values.chunk_len()).max().unwrap_or(0)
    }

    fn read_cell(
        &self,
        cell: &[Piece],
        cache: Cache<'_>,
        first: u64,
        to: &mut [u8],
        scalar: ScalarType,
    ) -> Result<(), ParseError> {
        if cell.is_empty() {
            let number = encoded(f64::NAN, scalar);
            let size = scalar.size();
            for to in to.chunks_exact_mut(size) {
                to.copy_from_slice(&number[..size]);
            }
            return Ok(());
        }
        if let Some((file, column)) = together(cell, scalar) {
            let first = usize::try_from(first).unwrap_or(usize::MAX);
            column.read_values(file.bytes(), first, to);
            return Ok(());
        }
        let mut component = 0;
        for piece in cell {
            let place = (component, self.components, scalar);
            piece.read(cache, first, to, place)?;
            component += piece.components();
        }
        Ok(())
    }
}

/// All pieces as one column of a file, if each is one range of it and they have the type `scalar`.
fn together(cell: &[Piece], scalar: ScalarType) -> Option<(&H5File, StridedColumn)> {
    let columns: Vec<(&H5File, StridedColumn)> = cell
        .iter()
        .map(|piece| match piece {
            Piece::Stored(values) => {
                let column = values.column().filter(|column| column.scalar == scalar);
                column.map(|column| (&values.stored().file, column))
            }
            _ => None,
        })
        .collect::<Option<_>>()?;
    let ((file, first), others) = columns.split_first()?;
    let fits = |(other, column): &(&H5File, StridedColumn)| {
        column.endian == first.endian && other.is_same(file)
    };
    if others.is_empty() || !others.iter().all(fits) {
        return None;
    }
    let mut joined = first.clone();
    for (_, other) in others {
        joined.component_strides.extend_from_slice(&other.component_strides);
    }
    Some((file, joined))
}
