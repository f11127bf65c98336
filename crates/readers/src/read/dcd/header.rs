//! The first records of a DCD file: numbers of the simulation, a title, the number of atoms, and which of them move.

use std::ops::Range;

use super::cut_short;
use crate::read::numbers::NumberReader;
use spherule_frame::{Endian, ParseError, SimulationCell};

/// Bytes of the first record: `CORD` and 20 numbers.
const FIRST_LEN: usize = 84;
/// Bytes of a title.
const TITLE_LEN: usize = 80;
/// Bytes of the unit cell.
pub(super) const CELL_LEN: usize = 48;
/// The first version of CHARMM whose cells are symmetric matrices. Other programs write 24, or 0 as X-PLOR.
const MATRIX_VERSION: i32 = 25;
/// The unit of time of CHARMM, ps: where kcal/mol, A and atomic mass units have no factors.
const AKMA: f64 = 0.048_888_21;

/// Records with their lengths before and after them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Records {
    /// Offset of the next record.
    pub(super) at: usize,
    pub(super) endian: Endian,
    /// Bytes of a length: 4, or 8 with some compilers.
    marker: usize,
}

/// The records of a file that begins with `head`; `None` if it is not DCD.
pub(super) fn records(head: &[u8]) -> Option<Records> {
    let kinds = [Endian::Little, Endian::Big].map(|endian| [4, 8].map(|marker| (endian, marker)));
    kinds.into_iter().flatten().find_map(|(endian, marker)| {
        let records = Records { at: 0, endian, marker };
        let len = { records }.marker(head)?;
        let name = head.get(marker..marker + 4)?;
        (len == FIRST_LEN as u64 && matches!(name, b"CORD" | b"VELD")).then_some(records)
    })
}

impl Records {
    /// The length at the offset, which is passed.
    fn marker(&mut self, bytes: &[u8]) -> Option<u64> {
        let mut numbers = NumberReader::new(bytes, self.at, self.endian);
        self.at += self.marker;
        match self.marker {
            8 => numbers.u64().ok(),
            _ => numbers.i32().ok().map(|len| len.cast_unsigned().into()),
        }
    }

    /// Passes a record and returns its bytes in the file. `name` is for errors.
    fn next(&mut self, bytes: &[u8], name: &str) -> Result<Range<usize>, ParseError> {
        let at = self.at;
        let len = self.marker(bytes);
        let len =
            len.ok_or_else(|| cut_short(at.min(bytes.len()), &format!("no record of the {name}")))?;
        let start = self.at;
        let end = usize::try_from(len).ok().and_then(|len| start.checked_add(len));
        let Some(end) = end.filter(|end| *end <= bytes.len().saturating_sub(self.marker)) else {
            let left = bytes.len().saturating_sub(start);
            let what = format!("the record of the {name} has {len} bytes, file has {left} left");
            return Err(cut_short(at, &what));
        };
        self.at = end;
        if self.marker(bytes) != Some(len) {
            let what = format!(
                "the record of the {name} does not end with its length: the file is damaged here"
            );
            return Err(ParseError::malformed(end, what));
        }
        Ok(start..end)
    }

    /// Passes the titles. Some programs have written lengths of the record that do not agree with the number of titles,
    /// which other readers go by.
    fn pass_titles(&mut self, bytes: &[u8]) -> Result<(), ParseError> {
        let start = *self;
        let passed = self.next(bytes, "title");
        if passed.is_err() {
            let numbers = NumberReader::new(bytes, start.at + start.marker, start.endian);
            let len = { numbers }.i32().ok().and_then(|count| usize::try_from(count).ok());
            let len = len.map(|count| count.saturating_mul(TITLE_LEN).saturating_add(4));
            let end = len.map(|len| start.at.saturating_add(start.whole_len(len)));
            self.at = match end.filter(|end| *end < bytes.len()) {
                Some(end) => end,
                None => return passed.map(|_| ()),
            };
        }
        Ok(())
    }

    /// Passes a record that must have `len` bytes and returns where they begin.
    pub(super) fn expect(
        &mut self,
        bytes: &[u8],
        len: usize,
        name: &str,
    ) -> Result<usize, ParseError> {
        let at = self.at;
        let record = self.next(bytes, name)?;
        if record.len() != len {
            let what = format!(
                "the record of the {name} has {} bytes, {len} expected: the file is damaged here",
                record.len()
            );
            return Err(ParseError::malformed(at, what));
        }
        Ok(record.start)
    }

    /// Bytes of a record with `len` bytes between its lengths.
    const fn whole_len(&self, len: usize) -> usize {
        len.saturating_add(2 * self.marker)
    }
}

/// What the first records say.
#[derive(Debug, Clone)]
pub(super) struct DcdHeader {
    pub(super) records: Records,
    /// Atoms.
    pub(super) count: usize,
    pub(super) has_cell: bool,
    has_fourth_axis: bool,
    /// The record with the numbers of the atoms that move, if not all do.
    pub(super) free: Option<Range<usize>>,
    /// Where the first frame begins.
    pub(super) frames_at: usize,
    is_charmm: bool,
    /// Version of CHARMM, or what other programs write for it.
    version: i32,
    /// First time step, and steps between frames.
    first_step: i32,
    interval: i32,
    /// Length of a time step, AKMA.
    delta: f64,
}

/// The cell in a, gamma, b, beta, alpha, c: lengths, and angles in degrees or their cosines, as NAMD and CHARMM up to
/// version 24 write them.
fn cell_of_angles([a, gamma, b, beta, alpha, c]: [f64; 6]) -> Option<SimulationCell> {
    let (lengths, angles) = ([a, b, c], [alpha, beta, gamma]);
    if angles.iter().all(|angle| angle.abs() < 1.0) {
        SimulationCell::from_cosines(lengths, angles)
    } else {
        SimulationCell::from_angles(lengths, angles)
    }
}

/// The cell whose edges are the rows of a symmetric matrix, given by its lower half, as newer versions of CHARMM write
/// it. None if the matrix is not one of a cell: those have no negative eigenvalues. Right angles in degrees may look like
/// one.
fn cell_of_matrix(half: [f64; 6]) -> Option<SimulationCell> {
    let [xx, xy, yy, xz, yz, zz] = half;
    if [xy, xz, yz] == [90.0; 3] {
        return None;
    }
    let minor = xx * yy - xy * xy;
    let determinant = zz * minor - yz * (xx * yz - xy * xz) + xz * (xy * yz - yy * xz);
    let is_positive = xx > 0.0 && minor > 0.0 && determinant > 0.0;
    is_positive
        .then(|| SimulationCell::from_components([xx, xy, xz, xy, yy, yz, xz, yz, zz]))
        .flatten()
}

impl DcdHeader {
    /// Reads the header.
    ///
    /// # Errors
    /// [`ParseError`] if it is damaged, or one of a file of velocities.
    pub(super) fn parse(bytes: &[u8]) -> Result<Self, ParseError> {
        let Some(mut records) = records(bytes) else {
            let what = "a DCD file begins with a record of 84 bytes that begins with CORD";
            return Err(ParseError::malformed(0, what));
        };
        let first = records.expect(bytes, FIRST_LEN, "header")?;
        if bytes.get(first..first + 4) == Some(b"VELD") {
            let what = "a DCD file of velocities, which is not read; give that of positions";
            return Err(ParseError::unsupported(what));
        }
        let number =
            |index: usize| NumberReader::new(bytes, first + 4 + 4 * index, records.endian).i32();
        let version = number(19)?;
        let is_charmm = version != 0;
        let mut delta = NumberReader::new(bytes, first + 4 + 4 * 9, records.endian);
        let delta = if is_charmm { delta.f32()?.into() } else { delta.f64()? };
        let (first_step, interval, fixed) = (number(1)?, number(2)?, number(8)?);
        let flag = |index| Ok::<_, ParseError>(is_charmm && number(index)? == 1);
        let (has_cell, has_fourth_axis) = (flag(10)?, flag(11)?);
        records.pass_titles(bytes)?;
        let count_at = records.expect(bytes, 4, "number of atoms")?;
        let count = NumberReader::new(bytes, count_at, records.endian).count("number of atoms")?;
        let fixed = usize::try_from(fixed).ok().filter(|fixed| *fixed <= count);
        let fixed = fixed.ok_or_else(|| {
            let what = format!("the number of fixed atoms is not in 0..{count}");
            ParseError::malformed(first + 36, what)
        })?;
        let free = if fixed == 0 {
            None
        } else {
            let len = 4 * (count - fixed);
            let start = records.expect(bytes, len, "atoms that move")?;
            Some(start..start + len)
        };
        Ok(Self {
            records,
            count,
            has_cell,
            has_fourth_axis,
            free,
            frames_at: records.at,
            is_charmm,
            version,
            first_step,
            interval,
            delta,
        })
    }

    /// Atoms that are stored in frame `index`.
    pub(super) fn frame_count(&self, index: usize) -> usize {
        match &self.free {
            Some(free) if index > 0 => free.len() / 4,
            _ => self.count,
        }
    }

    /// Bytes of frame `index`.
    pub(super) fn frame_len(&self, index: usize) -> usize {
        let cell = if self.has_cell { self.records.whole_len(CELL_LEN) } else { 0 };
        let axes = if self.has_fourth_axis { 4_usize } else { 3 };
        let axis = self.records.whole_len(self.frame_count(index).saturating_mul(4));
        axes.saturating_mul(axis).saturating_add(cell)
    }

    /// The cell of the frame at byte `at`. None if the numbers are no cell.
    pub(super) fn cell(&self, bytes: &[u8], at: usize) -> Option<SimulationCell> {
        let mut records = Records { at, ..self.records };
        if !self.has_cell {
            return None;
        }
        let start = records.expect(bytes, CELL_LEN, "unit cell").ok()?;
        let mut numbers = NumberReader::new(bytes, start, records.endian);
        let mut all = [0.0; 6];
        for number in &mut all {
            *number = numbers.f64().ok()?;
        }
        let by_angles = || cell_of_angles(all);
        if self.version >= MATRIX_VERSION {
            cell_of_matrix(all).or_else(by_angles)
        } else {
            by_angles().or_else(|| cell_of_matrix(all))
        }
    }

    /// Whether frames have a cell, by the first one if that is among `bytes`, the beginning of the file.
    pub(super) fn shows_cell(&self, bytes: &[u8]) -> bool {
        let is_there = bytes.len() >= self.frames_at + self.records.whole_len(CELL_LEN);
        self.has_cell && (!is_there || self.cell(bytes, self.frames_at).is_some())
    }

    /// The time step of frame `index`.
    pub(super) fn number(&self, index: usize) -> Option<i64> {
        let steps = i64::try_from(index).ok()?.checked_mul(self.interval.into())?;
        (self.interval > 0).then(|| i64::from(self.first_step) + steps)
    }

    /// The time of frame `index`, ps; `None` if the file has no length of a time step.
    pub(super) fn time(&self, index: usize) -> Option<f64> {
        let is_known = self.delta > 0.0 && self.delta.is_finite();
        #[expect(clippy::cast_precision_loss, reason = "time steps are below 2^53")]
        let steps = self.number(index).filter(|_| is_known)? as f64;
        Some(steps * self.delta * AKMA)
    }

    /// Places of the atoms that are stored in frames after the first.
    pub(super) fn free_atoms<'a>(
        &self,
        bytes: &'a [u8],
    ) -> impl Iterator<Item = Result<usize, ParseError>> + use<'a> {
        let (endian, count) = (self.records.endian, self.count);
        let free = self.free.clone().unwrap_or_default();
        free.step_by(4).map(move |at| {
            let number = NumberReader::new(bytes, at, endian).i32()?;
            let index = usize::try_from(number).ok().and_then(|n| n.checked_sub(1));
            index.filter(|index| *index < count).ok_or_else(|| {
                let what = format!("atom {number} moves, the file has 1 to {count}");
                ParseError::malformed(at, what)
            })
        })
    }

    /// What kind of file it is.
    pub(super) fn notes(&self) -> Vec<String> {
        let kind = if self.is_charmm { "CHARMM" } else { "X-PLOR" };
        let order = match self.records.endian {
            Endian::Little => "little-endian",
            Endian::Big => "big-endian",
        };
        let mut notes = vec![format!("DCD file as {kind} writes it, {order}")];
        if self.time(0).is_some() {
            notes.push(
                "times are those of CHARMM and NAMD, whose unit is 0.04888821 ps; other programs may have written others"
                    .to_owned(),
            );
        }
        if self.free.is_some() {
            notes.push(
                "some atoms are fixed: their positions are in the first frame alone".to_owned(),
            );
        }
        notes
    }
}
