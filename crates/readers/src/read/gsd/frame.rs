//! The particles of a frame by the schema `hoomd`: which chunks it has, and what stands for those it has not.
//!
//! A chunk that is missing in a frame is that of frame 0, if both have the same number of particles. If frame 0
//! has none either, the schema has a value for all particles. Writers leave out whatever has that value.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DVec3;

use super::file::{GsdFile, IndexEntry, until_zero};
use super::shapes;
use crate::read::Step;
use crate::read::columns::{ComponentStride, ParticleLayout, StridedColumn};
use spherule_frame::{
    Attribute, AttributeData, Bond, Endian, MemoryBudget, ParseError, RawParticles, ScalarType,
    SimulationCell, TypeShapes,
};

/// Name of the chunk with the number of the time step.
pub(super) const STEP: &str = "configuration/step";
/// Name of the chunk with the number of particles.
const COUNT: &str = "particles/N";
/// Name of the chunk with the cell.
pub(super) const BOX: &str = "configuration/box";
const POSITION: &str = "particles/position";
/// Name of the chunk with the shapes of types.
pub(super) const TYPE_SHAPES: &str = "particles/type_shapes";
/// Name of the chunk with the particles of each bond.
const BONDS: &str = "bonds/group";
/// What the names of chunks of the schema's particles begin with.
pub(super) const PARTICLES: &str = "particles/";
/// What the names of logged values of particles begin with.
pub(super) const LOGGED: &str = "log/particles/";
/// Most numbers a particle of a logged value.
const MAX_LOGGED_COMPONENTS: u32 = 16;

/// What stands for values that are not in the file.
#[derive(Debug, Clone, Copy)]
enum DefaultValue {
    F32(f32),
    I32(i32),
    U32(u32),
    /// The quaternion 1, 0, 0, 0.
    Upright,
}

/// A property of particles that becomes an attribute.
#[derive(Debug, Clone, Copy)]
pub(super) struct Field {
    /// Name of the attribute; that of the chunk begins with [`PARTICLES`].
    pub(super) name: &'static str,
    components: u32,
    default: DefaultValue,
}

impl Field {
    const fn new(name: &'static str, components: u32, default: DefaultValue) -> Self {
        Self { name, components, default }
    }

    fn chunk_name(&self) -> String {
        format!("{PARTICLES}{}", self.name)
    }

    /// Whether numbers of type `scalar` can be its values.
    fn takes(&self, scalar: ScalarType) -> bool {
        match self.default {
            DefaultValue::F32(_) | DefaultValue::Upright => {
                matches!(scalar, ScalarType::F32 | ScalarType::F64)
            }
            DefaultValue::I32(_) | DefaultValue::U32(_) => {
                !matches!(scalar, ScalarType::F32 | ScalarType::F64)
            }
        }
    }

    /// The value of the schema for `count` particles.
    fn defaults(&self, count: usize) -> Attribute {
        let components = self.components as usize;
        let len = components * count;
        Attribute {
            name: self.name.to_owned(),
            components,
            data: match self.default {
                DefaultValue::F32(value) => AttributeData::F32(vec![value; len]),
                DefaultValue::Upright => AttributeData::F32([1.0, 0.0, 0.0, 0.0].repeat(count)),
                DefaultValue::I32(value) => AttributeData::I32(vec![value; len]),
                DefaultValue::U32(value) => AttributeData::U32(vec![value; len]),
            },
        }
    }

    /// Bytes of [`Self::defaults`].
    const fn defaults_len(&self, count: usize) -> u64 {
        (count as u64).saturating_mul(4 * self.components as u64)
    }
}

/// The numbers of types.
pub(super) const TYPE: &str = "typeid";

/// The diameter is there in every frame: the radius of all particles is 0.5 if the file says nothing else.
pub(super) const DIAMETER: &str = "diameter";

/// Properties in the order of the schema.
pub(super) const FIELDS: [Field; 10] = [
    Field::new(TYPE, 1, DefaultValue::U32(0)),
    Field::new("mass", 1, DefaultValue::F32(1.0)),
    Field::new("charge", 1, DefaultValue::F32(0.0)),
    Field::new(DIAMETER, 1, DefaultValue::F32(1.0)),
    Field::new("body", 1, DefaultValue::I32(-1)),
    Field::new("moment_inertia", 3, DefaultValue::F32(0.0)),
    Field::new("orientation", 4, DefaultValue::Upright),
    Field::new("velocity", 3, DefaultValue::F32(0.0)),
    Field::new("angmom", 4, DefaultValue::F32(0.0)),
    Field::new("image", 3, DefaultValue::I32(0)),
];

/// Positions, as a property.
const POSITIONS: Field = Field::new("position", 3, DefaultValue::F32(0.0));

/// Lists the frames. A frame is numbered by its time step if these increase, else not.
///
/// # Errors
/// [`ParseError::Malformed`] for a damaged index, [`ParseError::TooLarge`] if the list does not fit into `budget`.
pub(super) fn steps(file: &GsdFile<'_>, budget: MemoryBudget) -> Result<Vec<Step>, ParseError> {
    let step_name = file.name(STEP);
    let mut steps = Vec::new();
    // Chunks of the last frame so far.
    let mut chunk_count = 0;
    for (index, entry) in (0..).map_while(|index| Some((index, file.entry(index)?))) {
        file.check(&entry)?;
        let frame = usize::try_from(entry.frame).unwrap_or(usize::MAX);
        if frame + 1 < steps.len() {
            let what = format!(
                "a chunk of frame {frame} follows those of frame {}: the index of the file is damaged",
                steps.len() - 1
            );
            return Err(ParseError::malformed(entry.at, what));
        }
        if frame >= steps.len() {
            chunk_count = 0;
        }
        // Frames without chunks are like frame 0; those behind this entry begin with it, too.
        while steps.len() <= frame {
            Step::push_with_key(&mut steps, index as u64, budget)?;
        }
        chunk_count += 1;
        if chunk_count > file.names().len() {
            let what = format!("frame {frame} has a chunk twice: the index of the file is damaged");
            return Err(ParseError::malformed(entry.at, what));
        }
        if Some(entry.name) == step_name
            && let Some(step) = steps.last_mut()
        {
            step.number = number(file, &entry).ok().and_then(|n| i64::try_from(n).ok());
        }
    }
    if let Some(first) = steps.first_mut() {
        let initial = step_name.map(|_| first.number.unwrap_or(0));
        for step in &mut steps {
            step.number = step.number.or(initial);
        }
    }
    Step::keep_increasing_numbers(&mut steps);
    Ok(steps)
}

/// The number in a chunk of one unsigned integer.
fn number(file: &GsdFile<'_>, entry: &IndexEntry) -> Result<u64, ParseError> {
    let is_unsigned = matches!(
        entry.scalar(),
        Some(ScalarType::U8 | ScalarType::U16 | ScalarType::U32 | ScalarType::U64)
    );
    if !is_unsigned || (entry.rows, entry.columns) != (1, 1) {
        let what = format!("{} is not one unsigned integer", file.name_of(entry));
        return Err(ParseError::malformed(entry.at, what));
    }
    let mut wide = [0; 8];
    for (byte, stored) in wide.iter_mut().zip(file.numbers(entry)?) {
        *byte = *stored;
    }
    Ok(u64::from_le_bytes(wide))
}

/// Chunks of a frame by the numbers of their names.
type Chunks = BTreeMap<u16, IndexEntry>;

/// The chunks that hold the particles of one frame.
pub(super) struct FrameChunks<'f, 'a> {
    file: &'f GsdFile<'a>,
    /// Number of the frame.
    frame: usize,
    own: Chunks,
    /// Chunks of frame 0 that stand for those that the frame does not have.
    first: Chunks,
    /// Number of the time step, if the file has any.
    step: Option<u64>,
    /// Particles.
    count: usize,
}

impl<'f, 'a> FrameChunks<'f, 'a> {
    /// Finds the chunks of `step`, one of [`steps`].
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if the numbers of the step or of its particles are damaged.
    pub(super) fn find(file: &'f GsdFile<'a>, step: &Step) -> Result<Self, ParseError> {
        let own = chunks_of(file, step.index, step.key())?;
        let mut first = match step.index {
            0 => Chunks::new(),
            _ => chunks_of(file, 0, 0)?,
        };
        let value = |chunks: &Chunks, name: &str| {
            let entry = file.name(name).and_then(|name| chunks.get(&name));
            entry.map(|entry| number(file, entry)).transpose()
        };
        let both = |name: &str| Ok::<_, ParseError>((value(&own, name)?, value(&first, name)?));
        let (own_step, first_step) = both(STEP)?;
        let (own_count, first_count) = both(COUNT)?;
        let count = own_count.or(first_count).unwrap_or(0);
        if count != first_count.unwrap_or(0) {
            first.retain(|name, _| {
                [BOX, TYPE_SHAPES].map(|kept| file.name(kept)).contains(&Some(*name))
            });
        }
        Ok(Self {
            file,
            frame: step.index,
            own,
            first,
            step: file.name(STEP).and(own_step.or(first_step).or(Some(0))),
            count: usize::try_from(count).unwrap_or(usize::MAX),
        })
    }

    /// Reads the particles.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if a chunk does not fit the particles or the file, [`ParseError::TooLarge`].
    pub(super) fn particles(self, budget: MemoryBudget) -> Result<RawParticles, ParseError> {
        let (layout, missing) = self.layout()?;
        let defaults = missing.iter().map(|field| field.defaults_len(self.count));
        let bonds = self.bonds()?;
        let bonds_len = size_of_val(&bonds[..]) as u64;
        let need = defaults.fold(layout.byte_len() + bonds_len, u64::saturating_add);
        budget.check(need, "its numbers in memory are")?;
        let mut particles = layout.particles(self.file.bytes)?;
        let defaults = missing.iter().map(|field| field.defaults(self.count));
        particles.attributes.extend(defaults);
        particles.cell = self.cell();
        particles.bonds = bonds;
        particles.shapes = self.shapes(budget.less(need))?;
        particles.step = self.step.and_then(|step| i64::try_from(step).ok());
        Ok(particles)
    }

    /// The cell: three lengths and three tilt factors, around the origin, periodic.
    fn cell(&self) -> Option<SimulationCell> {
        let entry = self.chunk(self.file.name(BOX))?;
        let bytes = self.file.numbers(&entry).ok().filter(|bytes| bytes.len() <= 48)?;
        let data = entry.scalar()?.decode(Endian::Little, bytes).ok()?;
        if data.len() != 6 {
            return None;
        }
        let [lx, ly, lz, xy, xz, yz]: [f64; 6] = std::array::from_fn(|i| data.get_f64(i));
        let vectors = [
            DVec3::new(lx, 0.0, 0.0),
            DVec3::new(xy * ly, ly, 0.0),
            DVec3::new(xz * lz, yz * lz, lz),
        ];
        let center = 0.5 * vectors.into_iter().sum::<DVec3>();
        SimulationCell::new(-center, vectors, [true; 3])
    }

    /// The shapes of types, if the file has them.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if they are not text, [`ParseError::TooLarge`].
    fn shapes(&self, budget: MemoryBudget) -> Result<Option<Arc<TypeShapes>>, ParseError> {
        let Some(entry) = self.chunk(self.file.name(TYPE_SHAPES)) else {
            return Ok(None);
        };
        let is_text = matches!(entry.scalar(), None | Some(ScalarType::I8 | ScalarType::U8));
        if !is_text {
            let what = format!("frame {}: {TYPE_SHAPES} is not text", self.frame);
            return Err(ParseError::malformed(entry.at, what));
        }
        let text = self.file.numbers(&entry)?;
        budget.check(shapes::BYTES_OF_TEXT * text.len() as u64, "the shapes of its types are")?;
        let rows = text.chunks(entry.columns.max(1) as usize).map(until_zero);
        let shapes = rows.map(shapes::of_json).collect();
        Ok(Some(Arc::new(TypeShapes { attribute: TYPE.to_owned(), shapes })))
    }

    /// The bonds, which have no more bytes than the file.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if they are no pairs of particles.
    fn bonds(&self) -> Result<Vec<Bond>, ParseError> {
        let Some(entry) = self.chunk(self.file.name(BONDS)).filter(|entry| entry.rows > 0) else {
            return Ok(Vec::new());
        };
        let malformed = |what: String| {
            let what = format!("frame {}: {BONDS} {what}", self.frame);
            ParseError::malformed(entry.at, what)
        };
        // The schema has unsigned integers, the writer in Python others
        let is_index = matches!(entry.scalar(), Some(ScalarType::U32 | ScalarType::I32));
        if !is_index || entry.columns != 2 {
            return Err(malformed("has no pairs of unsigned integers".to_owned()));
        }
        let (numbers, _) = self.file.numbers(&entry)?.as_chunks();
        let bond = |pair: &[[u8; 4]; 2]| pair.map(u32::from_le_bytes);
        let bonds: Vec<Bond> = numbers.as_chunks().0.iter().map(bond).collect();
        let wrong = bonds.iter().flatten().find(|index| **index as usize >= self.count);
        match wrong {
            None => Ok(bonds),
            Some(index) => Err(malformed(format!(
                "has a bond of particle {index}, but there are {} particles",
                self.count
            ))),
        }
    }

    /// Where the particles are in the file, if all their values are.
    ///
    /// # Errors
    /// As [`Self::particles`].
    pub(super) fn stored_layout(self) -> Result<Option<ParticleLayout>, ParseError> {
        let (layout, missing) = self.layout()?;
        Ok((missing.is_empty() && !layout.axes.is_empty()).then(|| ParticleLayout {
            step: self.step.and_then(|step| i64::try_from(step).ok()),
            ..layout
        }))
    }

    /// Where the values are that the file has, and the properties whose value is that of the schema.
    fn layout(&self) -> Result<(ParticleLayout, Vec<Field>), ParseError> {
        let mut axes = Vec::new();
        let mut attributes = Vec::new();
        let mut missing = Vec::new();
        match self.chunk_of(&POSITIONS)? {
            Some(entry) => axes.push(self.column("positions", &entry)?),
            // A single particle at the origin has the default position.
            None if self.count > 1 => return Err(self.no_positions()),
            None => {}
        }
        for field in FIELDS {
            match self.chunk_of(&field)? {
                Some(entry) => attributes.push(self.column(field.name, &entry)?),
                // All frames have the attributes that one of them has.
                None if field.name == DIAMETER || self.file.name(&field.chunk_name()).is_some() => {
                    missing.push(field);
                }
                None => {}
            }
        }
        for (name, entry) in self.logged() {
            attributes.push(self.column(&name, &entry)?);
        }
        self.check_overlap(axes.iter().chain(&attributes))?;
        Ok((ParticleLayout::new(self.count, axes, attributes), missing))
    }

    /// The chunk with the values of `field`, if there is one.
    fn chunk_of(&self, field: &Field) -> Result<Option<IndexEntry>, ParseError> {
        let Some(entry) = self.chunk(self.file.name(&field.chunk_name())) else {
            return Ok(None);
        };
        let name = self.file.name_of(&entry);
        let what = match entry.scalar() {
            _ if entry.columns != field.components => {
                format!("{name} has {} columns, not {}", entry.columns, field.components)
            }
            _ if entry.rows != self.count as u64 => {
                format!("{name} has {} rows for {} particles", entry.rows, self.count)
            }
            Some(scalar) if field.takes(scalar) => return Ok(Some(entry)),
            Some(scalar) => format!("{name} has numbers of type {}", scalar.name()),
            None => format!("{name} is text"),
        };
        Err(ParseError::malformed(entry.at, format!("frame {}: {what}", self.frame)))
    }

    /// The chunk with a name of this number, of the frame or of frame 0.
    fn chunk(&self, name: Option<u16>) -> Option<IndexEntry> {
        let name = name?;
        self.own.get(&name).or_else(|| self.first.get(&name)).copied()
    }

    /// Logged values of the particles, with their names. Those of other shapes are left out.
    fn logged(&self) -> Vec<(String, IndexEntry)> {
        let mut all = Vec::new();
        for (number, name) in (0..).zip(self.file.names()) {
            let Some(name) = name.strip_prefix(LOGGED.as_bytes()) else {
                continue;
            };
            let entry = self.chunk(Some(number)).filter(|entry| {
                entry.rows == self.count as u64
                    && (1..=MAX_LOGGED_COMPONENTS).contains(&entry.columns)
                    && entry.scalar().is_some()
            });
            if let Some(entry) = entry {
                all.push((String::from_utf8_lossy(name).into_owned(), entry));
            }
        }
        all
    }

    /// The values of `entry`, which has numbers.
    fn column(&self, name: &str, entry: &IndexEntry) -> Result<StridedColumn, ParseError> {
        let range = self.file.range(entry)?;
        let scalar = entry.scalar().unwrap_or(ScalarType::U8);
        let components = entry.columns as usize;
        let first = ComponentStride { start: range.start, stride: components * scalar.size() };
        let scalar = (scalar, Endian::Little);
        Ok(StridedColumn::interleaved(name, scalar, components, first))
    }

    /// Rejects chunks that are longer together than the file: many names for the same bytes would take memory
    /// without end.
    fn check_overlap<'c>(
        &self,
        columns: impl Iterator<Item = &'c StridedColumn>,
    ) -> Result<(), ParseError> {
        let each = columns.map(|c| c.component_strides.len() * c.scalar.size());
        let need = each.sum::<usize>().saturating_mul(self.count);
        if need <= self.file.bytes.len() {
            return Ok(());
        }
        let what = format!(
            "frame {}: its chunks have {need} bytes together, the file has {}: the index of the file is damaged",
            self.frame,
            self.file.bytes.len()
        );
        Err(ParseError::malformed(self.file.bytes.len(), what))
    }

    fn no_positions(&self) -> ParseError {
        let at = self.chunk(self.file.name(COUNT)).map_or(0, |entry| entry.at);
        let what = format!(
            "frame {} has {} particles and no {POSITION}, which puts all of them at the origin; write positions",
            self.frame, self.count
        );
        ParseError::malformed(at, what)
    }
}

/// The chunks of frame `frame`, whose entries begin at `first` in the index.
fn chunks_of(file: &GsdFile<'_>, frame: usize, first: u64) -> Result<Chunks, ParseError> {
    let first = usize::try_from(first).unwrap_or(usize::MAX);
    let mut chunks = Chunks::new();
    let entries = (first..).map_while(|index| file.entry(index));
    for entry in entries.take_while(|entry| entry.frame == frame as u64) {
        file.check(&entry)?;
        chunks.insert(entry.name, entry);
    }
    Ok(chunks)
}
