//! Binary snapshots of GADGET-1 and GADGET-2, and of codes that write the same: both byte orders, blocks with and without
//! names.
//!
//! Blocks are between two lengths of four bytes each, as Fortran writes them. The first is the header with the numbers and
//! the masses of six types of particles. Blocks with a name (format 2) have another one before them. Without names
//! (format 1) their order is fixed, and what follows density depends on the code. After the "User guide for GADGET-2"
//! (Springel, 2005). HDF5 snapshots are read elsewhere; names of attributes are those of such files.

use glam::{DMat3, DVec3};

use super::columns::{self, ComponentStride, ParticleLayout, StridedColumn};
use super::notes::cell_note;
use super::numbers::NumberReader;
use super::{ByteSource, CUT_SHORT, Step};
use crate::format::Format;
use crate::reader::{Confidence, FormatInfo, Reader, ValueNames};
use crate::shared::SharedBytes;
use spherule_frame::{
    Attribute, AttributeData, Endian, MemoryBudget, ParseError, RawParticles, ScalarType,
    SimulationCell,
};

/// Binary snapshots of GADGET.
pub const FORMAT: Format = Format::new(&Gadget);

struct Gadget;

/// Types of particles, and the attribute that has them.
const TYPES: usize = 6;
const PART: &str = "part";
const MASSES: &str = "Masses";
/// Bytes of the header, of the length before and behind a block, and of a block with a name.
const HEADER: usize = 256;
const LENGTH: usize = 4;
const NAME: usize = 8;
/// Most blocks; files have about ten, and some codes write a hundred.
const MAX_BLOCKS: usize = 1000;

/// Names of blocks with those of their attributes, and the numbers of a particle.
const BLOCKS: [(&[u8; 4], &str, usize); 14] = [
    (b"VEL ", "Velocities", 3),
    (b"ID  ", "ParticleIDs", 1),
    (b"MASS", MASSES, 1),
    (b"U   ", "InternalEnergy", 1),
    (b"RHO ", "Density", 1),
    (b"NE  ", "ElectronAbundance", 1),
    (b"NH  ", "NeutralHydrogenAbundance", 1),
    (b"HSML", "SmoothingLength", 1),
    (b"SFR ", "StarFormationRate", 1),
    (b"AGE ", "StellarFormationTime", 1),
    (b"POT ", "Potential", 1),
    (b"ACCE", "Acceleration", 3),
    (b"ENDT", "RateOfChangeOfEntropy", 1),
    (b"TSTP", "TimeStep", 1),
];

/// The order of blocks without names.
const ORDER: [&[u8; 4]; 6] = [b"POS ", b"VEL ", b"ID  ", b"MASS", b"U   ", b"RHO "];

impl Reader for Gadget {
    fn info(&self) -> FormatInfo {
        FormatInfo { notes_need_whole_file: true, ..FormatInfo::new("gadget", &["gadget", "gdt"]) }
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        Ok(Confidence::signature_if(Layout::find(head).is_some()))
    }

    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let bytes = source.bytes();
        let mut step = Step::whole(bytes.len());
        step.time = Header::read(bytes).ok().map(|header| header.time);
        Ok(vec![step])
    }

    fn read(&self, source: &mut ByteSource<'_>, _step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        read(source.bytes(), budget)
    }

    fn piece_count(&self, file: &SharedBytes) -> u64 {
        let header = Header::read(file);
        header.map_or(1, |header| u64::try_from(header.file_count).unwrap_or(1).max(1))
    }

    fn value_names(&self, file: &SharedBytes) -> Vec<ValueNames> {
        let Ok(header) = Header::read(file) else { return Vec::new() };
        let names = header.types().map(|(number, _)| (number, part_name(number)));
        vec![ValueNames { attribute: PART.to_owned(), names: names.collect() }]
    }

    fn notes(&self, bytes: &[u8]) -> Vec<String> {
        let Ok(header) = Header::read(bytes) else { return Vec::new() };
        let format = if header.layout.has_names { 2 } else { 1 };
        let described = header
            .types()
            .map(|(number, count)| format!("{number} = {} ({count})", part_name(number)));
        let types = described.collect::<Vec<String>>().join(", ");
        let mut notes = vec![
            format!("snapshot of GADGET, format {format}"),
            format!("attribute `part` is the number of the type: {types}"),
        ];
        if !header.layout.has_names {
            let what = "blocks have no names; those behind the density are left out";
            notes.push(what.to_owned());
        }
        if header.file_count > 1 {
            notes.push(format!(
                "one of {} files of a snapshot; give their directory, or a pattern such as snap_010.*, to read them \
                 together",
                header.file_count
            ));
        }
        notes.extend(header.cell().map(|_| cell_note(None)));
        notes
    }
}

/// The name of a type, where all codes mean the same by it.
fn part_name(number: i64) -> String {
    match number {
        0 => "gas".to_owned(),
        1 => "dark matter".to_owned(),
        4 => "stars".to_owned(),
        5 => "black holes".to_owned(),
        _ => format!("PartType{number}"),
    }
}

/// How blocks are written.
#[derive(Debug, Clone, Copy)]
struct Layout {
    endian: Endian,
    has_names: bool,
}

impl Layout {
    /// The layout of a file with a header between its lengths.
    fn find(head: &[u8]) -> Option<Self> {
        [Endian::Little, Endian::Big].into_iter().find_map(|endian| {
            let length = |at| NumberReader::new(head, at, endian).count("length").ok();
            let has_names = length(0) == Some(NAME)
                && head.get(LENGTH..).is_some_and(|rest| rest.starts_with(b"HEAD"));
            let start = if has_names { NAME + 2 * LENGTH } else { 0 };
            let is_header =
                length(start) == Some(HEADER) && length(start + LENGTH + HEADER) == Some(HEADER);
            is_header.then_some(Self { endian, has_names })
        })
    }

    const fn header_start(self) -> usize {
        if self.has_names { NAME + 3 * LENGTH } else { LENGTH }
    }
}

struct Header {
    layout: Layout,
    counts: [usize; TYPES],
    masses: [f64; TYPES],
    time: f64,
    file_count: i32,
    box_size: f64,
}

impl Header {
    fn read(bytes: &[u8]) -> Result<Self, ParseError> {
        let layout = Layout::find(bytes).ok_or_else(|| {
            ParseError::malformed(0, "no header of 256 bytes of a GADGET snapshot")
        })?;
        let start = layout.header_start();
        let mut numbers = NumberReader::new(bytes, start, layout.endian);
        let mut counts = [0; TYPES];
        for count in &mut counts {
            *count = u32::from_le_bytes(numbers.array()?) as usize;
        }
        let mut masses = [0.0; TYPES];
        for mass in &mut masses {
            *mass = numbers.f64()?;
        }
        let time = numbers.f64()?;
        let mut numbers = NumberReader::new(bytes, start + 124, layout.endian);
        let (file_count, box_size) = (numbers.i32()?, numbers.f64()?);
        Ok(Self { layout, counts, masses, time, file_count, box_size })
    }

    fn total(&self) -> usize {
        self.counts.iter().fold(0, |sum, count| sum.saturating_add(*count))
    }

    /// Numbers of types that have particles, with their counts.
    fn types(&self) -> impl Iterator<Item = (i64, usize)> {
        (0..).zip(self.counts).filter(|(_, count)| *count > 0)
    }

    /// Whether particles of the type `index` have masses of their own.
    fn has_own_masses(&self, index: usize) -> bool {
        self.masses.get(index) == Some(&0.0)
    }

    /// Particles with masses of their own.
    fn own_mass_count(&self) -> usize {
        let own = (0..TYPES).filter(|index| self.has_own_masses(*index));
        own.map(|index| self.counts[index]).fold(0, usize::saturating_add)
    }

    fn cell(&self) -> Option<SimulationCell> {
        let matrix = DMat3::from_diagonal(DVec3::splat(self.box_size));
        let edges = [matrix.x_axis, matrix.y_axis, matrix.z_axis];
        let cell = SimulationCell::new(DVec3::ZERO, edges, [true; 3]);
        cell.filter(|_| self.box_size > 0.0)
    }
}

/// A block: its name, and where its bytes are.
struct Block {
    name: [u8; 4],
    start: usize,
    len: usize,
}

/// The blocks behind the header. Those of the file are there as a whole.
fn blocks(bytes: &[u8], header: &Header) -> Result<Vec<Block>, ParseError> {
    let Layout { endian, has_names } = header.layout;
    let mut numbers =
        NumberReader::new(bytes, header.layout.header_start() + HEADER + LENGTH, endian);
    let mut unnamed = ORDER.into_iter().filter(|name| match *name {
        b"MASS" => header.own_mass_count() > 0,
        b"U   " | b"RHO " => header.counts[0] > 0,
        _ => true,
    });
    let mut blocks = Vec::new();
    while numbers.at() < bytes.len() && blocks.len() < MAX_BLOCKS {
        let name = if has_names {
            let (_, name) = block(&mut numbers)?;
            name.first_chunk::<4>().copied()
        } else {
            unnamed.next().copied()
        };
        let Some(name) = name else { break };
        let (start, body) = block(&mut numbers)?;
        blocks.push(Block { name, start, len: body.len() });
    }
    Ok(blocks)
}

/// The bytes of the next block, and where they are.
fn block<'a>(numbers: &mut NumberReader<'a>) -> Result<(usize, &'a [u8]), ParseError> {
    let at = numbers.at();
    let len = u32::from_le_bytes(numbers.array()?);
    let start = numbers.at();
    let body = numbers.take(len as usize)?;
    let end = u32::from_le_bytes(numbers.array()?);
    if end != len {
        let what = format!(
            "a block has the length {len} before it, and {end} behind it: the file is damaged"
        );
        return Err(ParseError::malformed(at, what));
    }
    Ok((start, body))
}

impl Block {
    /// The numbers of the block for `count` particles of `components` each. The length tells their type.
    fn column(
        &self,
        header: &Header,
        count: usize,
        (name, components): (&str, usize),
    ) -> Option<StridedColumn> {
        let values = count.checked_mul(components).filter(|values| *values > 0)?;
        let is_whole = name == "ParticleIDs";
        let types = if is_whole {
            [ScalarType::U32, ScalarType::U64]
        } else {
            [ScalarType::F32, ScalarType::F64]
        };
        let fits = |scalar: &ScalarType| scalar.size().checked_mul(values) == Some(self.len);
        let scalar = types.into_iter().find(fits)?;
        let first = ComponentStride { start: self.start, stride: scalar.size() * components };
        Some(StridedColumn::interleaved(name, (scalar, header.layout.endian), components, first))
    }
}

fn read(bytes: &[u8], budget: MemoryBudget) -> Result<RawParticles, ParseError> {
    let header = Header::read(bytes)?;
    let blocks = blocks(bytes, &header)?;
    let total = header.total();
    // Find the columns of all particles, and those of gas and of masses
    let (mut axes, mut attributes, mut partial) = (None, Vec::new(), Vec::new());
    let mut notes = Vec::new();
    for block in &blocks {
        if &block.name == b"POS " {
            axes = block.column(&header, total, ("positions", 3));
            continue;
        }
        let known = BLOCKS.iter().find(|(name, ..)| **name == block.name);
        let own_name = String::from_utf8_lossy(&block.name).trim().escape_default().to_string();
        let (name, components) = known.map_or((own_name.as_str(), 1), |known| (known.1, known.2));
        let own_masses = header.own_mass_count();
        if name == MASSES && own_masses < total {
            partial.extend(block.column(&header, own_masses, (name, 1)));
        } else if let Some(column) = block.column(&header, total, (name, components)) {
            attributes.push(column);
        } else if let Some(column) = block.column(&header, header.counts[0], (name, components)) {
            partial.push(column);
        } else if block.len > 0 && total > 0 {
            notes.push(format!("the block `{own_name}` has {} bytes: left out", block.len));
        }
    }
    if axes.is_none() && total > 0 {
        let what = format!("no block with positions of {total} particles: {CUT_SHORT}");
        return Err(ParseError::malformed(bytes.len(), what));
    }
    // What is not in the file as it is: masses, types, and values of gas
    let has_masses = partial.iter().chain(&attributes).any(|column| column.name == MASSES);
    let is_in_header = |index| header.counts[index] > 0 && !header.has_own_masses(index);
    let has_header_masses = (0..TYPES).any(is_in_header);
    let constant = u64::from(has_header_masses && !has_masses);
    let each: u64 = partial.iter().map(|c| (c.component_strides.len() * 8) as u64).sum();
    let layout = ParticleLayout {
        time: Some(header.time).filter(|time| time.is_finite()),
        ..ParticleLayout::new(total, axes.into_iter().collect(), attributes)
    };
    let more = (4 + each + 8 * constant).saturating_mul(total as u64);
    budget.check(layout.byte_len().saturating_add(more), "its numbers in memory are")?;
    let mut particles = layout.particles(bytes)?;
    for column in partial {
        particles.attributes.push(partial_attribute(bytes, &header, &column)?);
    }
    if constant > 0 {
        let data = AttributeData::F64(masses(&header, &mut std::iter::empty()));
        particles.attributes.push(Attribute { name: MASSES.to_owned(), components: 1, data });
    }
    let of_type = (0..).zip(header.counts);
    let parts = of_type.flat_map(|(number, count)| std::iter::repeat_n(number, count)).collect();
    let part = Attribute { name: PART.to_owned(), components: 1, data: AttributeData::U32(parts) };
    particles.attributes.push(part);
    let names = header.types().map(|(number, _)| (number, format!("PartType{number}")));
    particles.labels.insert(PART.to_owned(), names.collect());
    Ok(RawParticles { cell: header.cell(), notes, ..particles })
}

/// The values of some particles: masses of those that have their own, or a property of gas. Others have the mass in the
/// header, or NaN.
fn partial_attribute(
    bytes: &[u8],
    header: &Header,
    column: &StridedColumn,
) -> Result<Attribute, ParseError> {
    let components = column.component_strides.len();
    let data = if column.name == MASSES {
        let values = columns::values(bytes, header.own_mass_count(), column)?;
        let mut own = (0..values.len()).map(|index| values.get_f64(index));
        AttributeData::F64(masses(header, &mut own))
    } else {
        let mut data = columns::values(bytes, header.counts[0], column)?;
        data.append_nan((header.total() - header.counts[0]) * components);
        data
    };
    Ok(Attribute { name: column.name.clone(), components, data })
}

/// The masses of all particles: those of the header, or the next of their `own`.
fn masses(header: &Header, own: &mut dyn Iterator<Item = f64>) -> Vec<f64> {
    let mut all = Vec::with_capacity(header.total());
    for (index, count) in header.counts.into_iter().enumerate() {
        if header.has_own_masses(index) {
            all.extend((0..count).map(|_| own.next().unwrap_or(f64::NAN)));
        } else {
            all.resize(all.len() + count, header.masses[index]);
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::damage::{TestedReader, attribute, coordinates, names, numbers};

    const READER: TestedReader = TestedReader {
        steps: |bytes| FORMAT.steps(bytes),
        read: |bytes, step| FORMAT.read(bytes, step),
    };

    /// A writer of blocks.
    #[derive(Clone, Copy)]
    struct Writer {
        is_big: bool,
        has_names: bool,
    }

    impl Writer {
        fn bytes<const N: usize>(self, mut little: [u8; N]) -> Vec<u8> {
            if self.is_big {
                little.reverse();
            }
            little.to_vec()
        }

        fn int(self, number: u32) -> Vec<u8> {
            self.bytes(number.to_le_bytes())
        }

        fn reals(self, numbers: &[f32]) -> Vec<u8> {
            numbers.iter().flat_map(|n| self.bytes(n.to_le_bytes())).collect()
        }

        fn block(self, name: &str, body: &[u8]) -> Vec<u8> {
            let framed = |body: &[u8]| {
                let len = self.int(u32::try_from(body.len()).expect("short"));
                [&len, body, &len].concat()
            };
            let next = self.int(u32::try_from(body.len() + 8).expect("short"));
            let heading = framed(&[name.as_bytes(), &next].concat());
            [if self.has_names { heading } else { Vec::new() }, framed(body)].concat()
        }

        /// Two particles of gas with their own masses, one of dark matter with that of the header.
        fn snapshot(self) -> Vec<u8> {
            let mut header: Vec<u8> = [2, 1, 0, 0, 0, 0].map(|n| self.int(n)).concat();
            header.extend(
                [0.0, 7.5, 0.0, 0.0, 0.0, 0.0, 0.25]
                    .map(|n: f64| self.bytes(n.to_le_bytes()))
                    .concat(),
            );
            header.resize(124, 0);
            header.extend(self.int(4));
            header.extend(self.bytes(100.0_f64.to_le_bytes()));
            header.resize(HEADER, 0);
            let ids: Vec<u8> = [5, 6, 7].map(|n| self.int(n)).concat();
            [
                self.block("HEAD", &header),
                self.block("POS ", &self.reals(&[1., 2., 3., 4., 5., 6., 7., 8., 9.])),
                self.block("VEL ", &self.reals(&[0.5; 9])),
                self.block("ID  ", &ids),
                self.block("MASS", &self.reals(&[1.5, 2.5])),
                self.block("U   ", &self.reals(&[10., 20.])),
                self.block("RHO ", &self.reals(&[30., 40.])),
                self.block("METL", &self.reals(&[50., 60., 70.])),
            ]
            .concat()
        }
    }

    const WRITERS: [Writer; 4] = [
        Writer { is_big: false, has_names: false },
        Writer { is_big: false, has_names: true },
        Writer { is_big: true, has_names: false },
        Writer { is_big: true, has_names: true },
    ];

    #[test]
    fn both_formats_and_byte_orders_are_read() {
        for writer in WRITERS {
            let bytes = writer.snapshot();
            assert_eq!(
                FORMAT.reader().sniff(&bytes[..600.min(bytes.len())]),
                Ok(Confidence::Signature)
            );
            let found = READER.one(&bytes);
            assert_eq!(coordinates(&found.positions)[2], [7.0, 8.0, 9.0]);
            let values = |name: &str| numbers(&attribute(&found, name).data);
            assert_eq!(values("ParticleIDs"), [5.0, 6.0, 7.0]);
            assert_eq!(values("Masses"), [1.5, 2.5, 7.5]);
            assert_eq!(values("part"), [0.0, 0.0, 1.0]);
            assert_eq!(values("Density")[..2], [30.0, 40.0]);
            assert!(values("InternalEnergy")[2].is_nan());
            assert_eq!(names(&found).contains(&"METL"), writer.has_names);
            assert_eq!(found.labels["part"][&1], "PartType1");
            assert_eq!((found.time, found.cell.map(|c| c.vectors[1].y)), (Some(0.25), Some(100.0)));
            let shared = SharedBytes::new(std::sync::Arc::new(bytes));
            assert_eq!(FORMAT.reader().piece_count(&shared), 4);
            assert_eq!(FORMAT.reader().value_names(&shared)[0].names[1].1, "dark matter");
        }
    }

    #[test]
    fn masses_may_be_in_the_header_alone() {
        let writer = WRITERS[0];
        let mut bytes = writer.snapshot();
        bytes[LENGTH + 24..LENGTH + 32].copy_from_slice(&3.5_f64.to_le_bytes());
        // The block of masses is then that of the energy
        let found = READER.one(&bytes);
        assert_eq!(numbers(&attribute(&found, "Masses").data), [3.5, 3.5, 7.5]);
        assert_eq!(numbers(&attribute(&found, "InternalEnergy").data)[..2], [1.5, 2.5]);
    }

    #[test]
    fn damage_is_named() {
        let good = WRITERS[0].snapshot();
        let error = |place: usize, value: u8| {
            let mut bytes = good.clone();
            bytes[place] = value;
            READER.error_inside(&bytes).to_string()
        };
        assert!(error(0, 9).contains("no header of 256 bytes"));
        assert!(error(7, 127).contains("no block with positions of 2130706435 particles"));
        assert!(
            error(264, 37).contains("37 before it, and 134217728 behind it")
                || error(264, 37).contains("before it")
        );
        assert!(error(267, 127).contains("bytes expected here"));
        for writer in WRITERS {
            let bytes = writer.snapshot();
            READER.survives_truncation(&bytes, &[4, 8, 100, 264, 300], 320);
        }
        let tight = MemoryBudget::new(50, "take care");
        let mut source = ByteSource::whole(&good);
        assert!(FORMAT.read_within(&mut source, &Step::whole(good.len()), tight).is_err());
    }
}
