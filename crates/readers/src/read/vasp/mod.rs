//! Files of VASP: structures (`POSCAR`, `CONTCAR`, the heads of `CHGCAR` and `LOCPOT`) and trajectories (`XDATCAR`).
//!
//! Text: a title, a scale, three edges of the cell, names of species (which version 4 lacks), their counts, perhaps
//! `Selective dynamics`, the kind of the coordinates, positions, perhaps velocities. Trajectories have
//! `Direct configuration= 1` in place of the kind, and repeat all that precedes it if the cell changes. After the pages
//! `POSCAR` and `XDATCAR` of the VASP wiki. Lengths are A, velocities A/fs.

use glam::{DMat3, DVec3};

use crate::format::Format;
use crate::read::atoms::{AtomTable, ELEMENT};
use crate::read::fixed_rows::RowNumbers;
use crate::read::input::TextInput;
use crate::read::line_words::{LineWords, next_line};
use crate::read::sniff::is_text;
use crate::read::text::{self, Line};
use crate::read::{ByteSource, Step, notes};
use crate::reader::{Confidence, FormatInfo, Reader, StreamUnit};
use spherule_frame::{
    Attribute, AttributeData, MemoryBudget, ParseError, RawParticles, SimulationCell,
};

mod head;
#[cfg(test)]
mod tests;

use head::Head;

/// Files of VASP.
pub const FORMAT: Format = Format::new(&Vasp);

struct Vasp;

impl Reader for Vasp {
    fn info(&self) -> FormatInfo {
        FormatInfo::molecular("vasp", &["vasp", "poscar", "contcar", "xdatcar"])
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        let mut text = TextInput::whole(head);
        let has_head = is_text(head) && Head::read(&mut text).is_ok();
        // Other kinds than these stand for direct coordinates, but are hardly ever written
        let mode = text.peek_line().and_then(|line| line.text.trim_ascii_start().first().copied());
        let is_mode = mode.is_some_and(|mode| b"cCkKdDsS".contains(&mode));
        Ok(if has_head && is_mode {
            Confidence::Signature
        } else if is_text(head) {
            Confidence::IfNamed
        } else {
            Confidence::No
        })
    }

    fn stream_unit(&self, _head: &[u8]) -> Option<StreamUnit> {
        Some(StreamUnit::Words)
    }

    /// Trajectories with a constant cell have it at their beginning.
    fn reads_steps_alone(&self, head: &[u8]) -> bool {
        Head::read(&mut TextInput::whole(head)).is_ok()
    }

    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let budget = source.budget();
        steps(source.text(), budget)
    }

    fn read(&self, source: &mut ByteSource<'_>, step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        read(source.text(), step, budget)
    }

    fn notes(&self, _head: &[u8]) -> Vec<String> {
        vec![notes::units("angstroms", Some("angstroms/fs"), None), notes::cell_note(None)]
    }
}

/// The number of a frame of a trajectory, if `line` begins one.
fn configuration(line: Line<'_>) -> Option<Option<i64>> {
    let start = line.text.iter().position(|byte| *byte == b'=')?;
    let (words, number) = line.text.split_at(start);
    let mut words = text::words(words);
    let is_kind = words.next().is_some_and(is_kind);
    (is_kind && words.next().is_some_and(|word| word.eq_ignore_ascii_case(b"configuration")))
        .then(|| text::integer(number.get(1..).unwrap_or_default().trim_ascii()))
}

fn is_kind(word: &[u8]) -> bool {
    word.eq_ignore_ascii_case(b"direct") || word.eq_ignore_ascii_case(b"cartesian")
}

/// The structure, or the frames of a trajectory. Text that is not a frame becomes a last step: reading that
/// step reports the error.
fn steps(text: &mut TextInput<'_>, budget: MemoryBudget) -> Result<Vec<Step>, ParseError> {
    let mut steps = Vec::new();
    let (mut count, mut start) = (0, text.at());
    loop {
        if text.peek_line().and_then(configuration).is_none() {
            count = Head::read(text).as_ref().map_or(usize::MAX, Head::count);
        }
        let number = text.peek_line().and_then(configuration);
        // A structure reaches to the end of the file
        let lines = if number.is_some() { count.saturating_add(1) } else { usize::MAX };
        text.pass_lines(lines);
        Step::push(&mut steps, start..text.at(), budget)?;
        if let Some(step) = steps.last_mut() {
            step.number = number.flatten();
        }
        text.pass_blank_lines(usize::MAX);
        start = text.at();
        if text.is_at_end() {
            Step::keep_increasing_numbers(&mut steps);
            return Ok(steps);
        }
    }
}

fn read(
    text: &mut TextInput<'_>,
    step: &Step,
    budget: MemoryBudget,
) -> Result<RawParticles, ParseError> {
    let range = step.byte_range().cloned().unwrap_or_default();
    let first_head = Head::read(&mut TextInput::whole(text.head()));
    text.go_to(range.start);
    text.end_at(range.end);
    let is_bare = text.peek_line().and_then(configuration).is_some();
    let head = if is_bare { first_head? } else { Head::read(text)? };
    // Read how coordinates are meant
    let mut line = next_line(text, "kind of coordinates")?;
    let begins = |line: Line<'_>, letters: &[u8]| {
        line.text.trim_ascii_start().first().is_some_and(|first| letters.contains(first))
    };
    let is_selective = begins(line, b"sS");
    if is_selective {
        line = next_line(text, "kind of coordinates")?;
    }
    let is_cartesian = begins(line, b"cCkK");
    let is_structure = configuration(line).is_none();
    let world = if is_cartesian { DMat3::from_diagonal(head.scale) } else { head.edges };
    // Read the atoms
    let species = if head.species.is_empty() { "type" } else { ELEMENT };
    let mut atoms = AtomTable::new(&[species], &[], &[], budget);
    let mut fixed = Vec::new();
    let count = head.count();
    for code in head.species_of_atoms() {
        let line = next_line(text, "atom where the head of the file counts one")?;
        let mut words = LineWords::new(line);
        let position = world * DVec3::from_array(words.vector("a coordinate")?);
        atoms.push(position.to_array(), &[code], &[], &[])?;
        if is_selective {
            fixed.extend([(); 3].map(|()| u8::from(is_false(words.next()))));
        }
    }
    let velocities =
        if is_structure && count > 0 { velocities(text, count, budget)? } else { Vec::new() };
    let mut particles = atoms.into_particles();
    let vector =
        |name: &str, data: AttributeData| Attribute { name: name.into(), components: 3, data };
    let attributes = [
        vector("fixed", AttributeData::U8(fixed)),
        vector("velocity", AttributeData::F64(velocities)),
    ];
    particles.attributes.extend(attributes.into_iter().filter(|a| !a.data.is_empty()));
    let [a, b, c] = [head.edges.x_axis, head.edges.y_axis, head.edges.z_axis];
    let cell = SimulationCell::new(DVec3::ZERO, [a, b, c], [true; 3]);
    Ok(RawParticles { step: step.number, cell, ..particles })
}

/// Whether `word` is false as Fortran writes it: `F`, `.FALSE.`.
fn is_false(word: &[u8]) -> bool {
    word.strip_prefix(b".").unwrap_or(word).first().is_some_and(|b| matches!(b, b'f' | b'F'))
}

/// The velocities of `count` atoms behind their positions, if they are there. The line before them is blank, or says that
/// they are Cartesian. Those in units of the cell and the time step are left out, and so is the grid of a `CHGCAR`.
fn velocities(
    text: &mut TextInput<'_>,
    count: usize,
    budget: MemoryBudget,
) -> Result<Vec<f64>, ParseError> {
    let is_heading = |line: Line<'_>| {
        line.is_blank() || matches!(line.text.trim_ascii_start(), [b'c' | b'C', ..])
    };
    let is_row = |line: Line<'_>| {
        let is_real = |word: &[u8]| word.contains(&b'.') && text::number(word).is_some();
        text::words(line.text).take(4).filter(|word| is_real(word)).count() == 3
    };
    let has_heading = text.line().is_some_and(is_heading);
    if !has_heading || !text.peek_line().is_some_and(is_row) {
        return Ok(Vec::new());
    }
    let mut velocities = RowNumbers::new(budget.less(28 * count as u64));
    for _ in 0..count {
        let line = next_line(text, "velocity of each atom")?;
        velocities.push(&LineWords::new(line).vector("a velocity")?)?;
    }
    Ok(velocities.numbers)
}
