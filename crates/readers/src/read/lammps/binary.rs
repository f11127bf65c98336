//! LAMMPS binary dumps (`dump atom` and `dump custom` to a file `*.bin` or `*.lammpsbin`), one or many steps a file.
//!
//! A step is a header and a block of f64 for each process that wrote. Since revision 2 (LAMMPS of 2020) the header has
//! the names of the columns; older dumps have none, so they cannot be read. After `dump.cpp` in the programmer's
//! documentation of LAMMPS and the page `dump`.

use rayon::prelude::*;

use super::columns::DumpColumns;
use super::header::DumpHeader;
use super::{Bounds, MAGICS};
use crate::format::Format;
use crate::read::columns::{ComponentStride, GrowingParticles, ParticleLayout, StridedColumn};
use crate::read::notes::cell_note;
use crate::read::numbers::NumberReader;
use crate::read::{ByteSource, Step, text};
use crate::reader::{Confidence, FormatInfo, Reader};
use spherule_frame::names::{LAMMPS_CATEGORIES, LAMMPS_INTEGERS};
use spherule_frame::{
    Attribute, AttributeData, Endian, MemoryBudget, ParseError, Positions, RawParticles, ScalarType,
};

/// LAMMPS binary dumps.
pub const FORMAT: Format = Format::new(&LammpsBinary);

struct LammpsBinary;

/// Bytes of a number of an atom.
const F64: usize = 8;
/// First revision whose header has names of columns.
const REVISION: i32 = 2;

impl Reader for LammpsBinary {
    fn info(&self) -> FormatInfo {
        FormatInfo { may_hold_many_steps: true, ..FormatInfo::new("lammps-binary", &["lammpsbin"]) }
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        Ok(Confidence::signature_if(byte_order(head).is_some()))
    }

    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let budget = source.budget();
        let bytes = source.bytes();
        let mut steps: Vec<Step> = Vec::new();
        let mut at = 0;
        while at < bytes.len() {
            let frame = Frame::parse(bytes, at, budget);
            let end =
                frame.as_ref().ok().and_then(|frame| frame.end(bytes).ok()).unwrap_or(bytes.len());
            Step::push(&mut steps, at..end, budget)?;
            if let (Some(step), Ok(frame)) = (steps.last_mut(), frame) {
                (step.number, step.time) = (Some(frame.number), frame.time);
            }
            at = end;
        }
        Step::keep_increasing_numbers(&mut steps);
        Ok(steps)
    }

    fn read(&self, source: &mut ByteSource<'_>, step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        let bytes = source.bytes();
        Frame::parse(bytes, step.start(), budget)?.particles(bytes, budget)
    }

    fn notes(&self, head: &[u8]) -> Vec<String> {
        let mut notes = vec![cell_note(None)];
        if let Ok(frame) = Frame::parse(head, 0, MemoryBudget::UNLIMITED)
            && !frame.units.is_empty()
        {
            notes.insert(0, format!("units of LAMMPS: {}", text::shown(frame.units)));
        }
        notes
    }
}

/// The byte order of a file that begins with the negative length of a name, and the name.
fn byte_order(head: &[u8]) -> Option<Endian> {
    [Endian::Little, Endian::Big].into_iter().find(|endian| {
        let len = NumberReader::new(head, 0, *endian).i64();
        let name = head.get(8..).unwrap_or_default();
        MAGICS.iter().any(|magic| name.starts_with(magic) && len == Ok(-(magic.len() as i64)))
    })
}

/// The header of a step.
struct Frame<'a> {
    endian: Endian,
    number: i64,
    time: Option<f64>,
    count: usize,
    /// Where the count is.
    count_at: usize,
    bounds: Bounds,
    /// Whether the cell repeats along each edge.
    periodic: [bool; 3],
    units: &'a [u8],
    /// Names of the columns, and where they are.
    names: Vec<Vec<u8>>,
    names_at: usize,
    /// Blocks of numbers, and where the first one begins.
    blocks: usize,
    blocks_at: usize,
}

impl<'a> Frame<'a> {
    /// The header at byte `at`.
    fn parse(bytes: &'a [u8], at: usize, budget: MemoryBudget) -> Result<Self, ParseError> {
        let rest = bytes.get(at..).unwrap_or_default();
        let Some(endian) = byte_order(rest) else {
            let what = "a step of a binary dump begins with DUMPATOM or DUMPCUSTOM: the file is damaged here, or an \
                        older LAMMPS wrote it, whose files are converted by `binary2txt`";
            return Err(ParseError::malformed(at, what));
        };
        let mut header = NumberReader::new(bytes, at, endian);
        let magic_len = header.i64()?.unsigned_abs();
        header.take(usize::try_from(magic_len).unwrap_or(usize::MAX))?;
        header.i32()?;
        let revision = header.i32()?;
        if revision < REVISION {
            let what = "a LAMMPS binary dump without names of columns; run `binary2txt` on it";
            return Err(ParseError::unsupported(what));
        }
        let number = header.i64()?;
        let count_at = header.at();
        let count = header.i64()?;
        let count = usize::try_from(count)
            .map_err(|_| ParseError::malformed(count_at, format!("{count} atoms")))?;
        let (bounds, periodic) = box_bounds(&mut header)?;
        let size_at = header.at();
        let size = header.count("number of columns")?;
        let len = header.count("length of the units")?;
        let units = header.take(len)?;
        let time = match header.take(1)? {
            [0] => None,
            _ => Some(header.f64()?),
        };
        let len = header.count("length of the names of columns")?;
        let names_at = header.at();
        let names = header.take(len)?;
        budget.check(256 * (len as u64 / 2), "its columns in memory are")?;
        let names: Vec<Vec<u8>> = text::words(names).map(<[u8]>::to_vec).collect();
        if names.len() != size {
            let what = format!("{size} columns with {} names", names.len());
            return Err(ParseError::malformed(size_at, what));
        }
        let blocks = header.count("number of blocks")?;
        Ok(Self {
            endian,
            number,
            time,
            count,
            count_at,
            bounds,
            periodic,
            units,
            names,
            names_at,
            blocks,
            blocks_at: header.at(),
        })
    }

    /// Calls `block` with the numbers of each block of atoms. Returns where the last one ends.
    fn walk(
        &self,
        bytes: &'a [u8],
        mut block: impl FnMut(&'a [u8], usize) -> Result<(), ParseError>,
    ) -> Result<usize, ParseError> {
        let mut numbers = NumberReader::new(bytes, self.blocks_at, self.endian);
        let mut left = self.count;
        for _ in 0..self.blocks {
            let at = numbers.at();
            let len = numbers.count("length of a block")?;
            let columns = self.names.len().max(1);
            let atoms = len / columns;
            if !len.is_multiple_of(columns) || atoms > left {
                let what = format!(
                    "a block of {len} numbers for {left} atoms of {columns} columns: the file is damaged here"
                );
                return Err(ParseError::malformed(at, what));
            }
            left -= atoms;
            block(numbers.take(len.saturating_mul(F64))?, atoms)?;
        }
        if left > 0 {
            let what =
                format!("{} atoms expected, {} in the blocks", self.count, self.count - left);
            return Err(ParseError::malformed(self.count_at, what));
        }
        Ok(numbers.at())
    }

    fn end(&self, bytes: &'a [u8]) -> Result<usize, ParseError> {
        self.walk(bytes, |_, _| Ok(()))
    }

    fn particles(self, bytes: &'a [u8], budget: MemoryBudget) -> Result<RawParticles, ParseError> {
        let (layout, scaled_by) = self.layout()?;
        let cell = self.bounds.cell(self.periodic);
        // A damaged count may promise more than there is.
        let each = F64 * self.names.len().max(1);
        let room = self.count.min(bytes.len() / each);
        let mut growing = GrowingParticles::new(layout, room, budget);
        self.walk(bytes, |numbers, atoms| growing.append(numbers, atoms))?;
        let mut particles = growing.into_particles();
        if let (Some(bounds), Positions::F64(v)) = (scaled_by, &mut particles.positions) {
            v.par_iter_mut().for_each(|p| *p = bounds.place(*p));
        }
        particles.attributes.iter_mut().for_each(to_integers);
        particles.cell = cell;
        Ok(particles)
    }

    /// Columns of the records of a block, and the box if positions are fractions of it.
    fn layout(&self) -> Result<(ParticleLayout, Option<Bounds>), ParseError> {
        let header = DumpHeader {
            number: Some(self.number),
            time: self.time,
            count: self.count,
            count_at: self.count_at,
            bounds: Some(self.bounds),
            periodic: self.periodic,
            names_at: self.names_at,
            names: self.names.clone(),
        };
        let columns = DumpColumns::find(&header, None)?;
        let mut targets: Vec<StridedColumn> = columns
            .targets
            .iter()
            .map(|target| StridedColumn {
                name: target.name.clone(),
                scalar: ScalarType::F64,
                endian: self.endian,
                component_strides: Vec::new(),
            })
            .collect();
        let mut places = vec![[None; 3]; targets.len()];
        for (column, field) in columns.fields.iter().enumerate() {
            if let Some(field) = field
                && let Some(place) =
                    places.get_mut(field.target).and_then(|places| places.get_mut(field.component))
            {
                *place = Some(column);
            }
        }
        let stride = F64 * self.names.len();
        for (target, places) in targets.iter_mut().zip(places) {
            let places = places.into_iter().flatten();
            let component = |column| ComponentStride { start: F64 * column, stride };
            target.component_strides = places.map(component).collect();
        }
        let attributes = targets.split_off(1);
        // Elements are numbers of types here, not of elements.
        let attributes = attributes
            .into_iter()
            .filter(|column| !LAMMPS_CATEGORIES.contains(&column.name.as_str()));
        let layout = ParticleLayout {
            time: self.time,
            step: Some(self.number),
            ..ParticleLayout::new(self.count, targets, attributes.collect())
        };
        Ok((layout, columns.scaled_by))
    }
}

/// The box, and whether it repeats along its edges: flags, and its sides with tilt factors if it is triclinic.
fn box_bounds(header: &mut NumberReader<'_>) -> Result<(Bounds, [bool; 3]), ParseError> {
    let tilted = header.i32()?;
    // Two flags for each axis, 0 for a periodic boundary
    let mut periodic = [true; 3];
    for periodic in &mut periodic {
        *periodic = [header.i32()?, header.i32()?].contains(&0);
    }
    let [mut lo, mut hi, mut tilt] = [[0.0; 3]; 3];
    for (lo, hi) in lo.iter_mut().zip(&mut hi) {
        (*lo, *hi) = (header.f64()?, header.f64()?);
    }
    match tilted {
        0 => {}
        1 => {
            for tilt in &mut tilt {
                *tilt = header.f64()?;
            }
        }
        _ => {
            let what = "a LAMMPS binary dump with a general triclinic box; run `binary2txt` on it";
            return Err(ParseError::unsupported(what));
        }
    }
    Ok((Bounds::triclinic(lo.into(), hi.into(), tilt), periodic))
}

/// Ids, types and molecules are integers, unless one is not whole.
#[expect(clippy::cast_possible_truncation, reason = "whole numbers within i64")]
fn to_integers(attribute: &mut Attribute) {
    let AttributeData::F64(numbers) = &attribute.data else {
        return;
    };
    let is_whole = |n: &f64| n.fract() == 0.0 && n.abs() < 9.0e18;
    if LAMMPS_INTEGERS.contains(&attribute.name.as_str()) && numbers.iter().all(is_whole) {
        attribute.data = AttributeData::I64(numbers.iter().map(|n| *n as i64).collect());
    }
}
