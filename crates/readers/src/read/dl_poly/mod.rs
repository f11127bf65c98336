//! Files of DL_POLY: structures (`CONFIG`, `REVCON`) and trajectories in text (`HISTORY`).
//!
//! A title, then two codes: what each atom has (0 positions, 1 velocities too, 2 forces too), and the boundaries. In
//! structures the edges of the cell and the atoms follow; frames of trajectories begin with `timestep`. An atom has a line
//! with its name and number, and one for each vector. After the manual of DL_POLY 4. Lengths are A, times ps; the
//! middle of the cell is the origin.

use crate::format::Format;
use crate::read::atoms::{self, AtomTable, ELEMENT};
use crate::read::input::TextInput;
use crate::read::line_words::{LineWords, next_line};
use crate::read::sniff::is_text;
use crate::read::text;
use crate::read::{ByteSource, Step, notes};
use crate::reader::{Confidence, FormatInfo, Reader, StreamUnit};
use spherule_frame::{MemoryBudget, ParseError, RawParticles, masses, names};

mod head;
#[cfg(test)]
mod tests;

use head::{Codes, Frame, has_edges, is_vector};

/// Files of DL_POLY.
pub const FORMAT: Format = Format::new(&DlPoly);

struct DlPoly;

/// What a frame of a trajectory begins with.
const TIME_STEP: &[u8] = b"timestep";
/// Vectors of an atom beside its position, by the code.
const VECTORS: [(&str, usize); 2] = [("velocity", 3), ("force", 3)];
/// Numbers of an atom in a trajectory.
const PROPERTIES: [(&str, usize); 2] = [("mass", 1), ("charge", 1)];

impl Reader for DlPoly {
    fn info(&self) -> FormatInfo {
        FormatInfo {
            time_unit: Some("ps"),
            ..FormatInfo::molecular("dl_poly", &["revcon", "dlpoly", "dlp"])
        }
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        let mut text = TextInput::whole(head);
        text.line();
        let codes = text.line().map(Codes::of).and_then(Result::ok);
        let is_sure = is_text(head)
            && codes.is_some_and(|codes| {
                begins_frame(&mut text) || (codes.edges(&mut text).is_ok() && has_atom(&mut text))
            });
        Ok(if is_sure { Confidence::Signature } else { Confidence::IfNamed })
    }

    fn stream_unit(&self, _head: &[u8]) -> Option<StreamUnit> {
        Some(StreamUnit::Words)
    }

    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let budget = source.budget();
        steps(source.text(), budget)
    }

    fn read(&self, source: &mut ByteSource<'_>, step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        let text = source.text();
        let range = step.byte_range().cloned().unwrap_or_default();
        let codes_of_file = Codes::in_head(text.head());
        text.go_to(range.start);
        text.end_at(range.end);
        if begins_frame(text) {
            let codes = codes_of_file?;
            let frame = Frame::of(next_line(text, "frame")?)?;
            let cell = codes.edges(text)?;
            let particles = read_atoms(text, &codes, Some(frame.count), budget)?;
            return Ok(RawParticles {
                cell,
                time: frame.time,
                step: Some(frame.number),
                ..particles
            });
        }
        text.line();
        let codes = Codes::of(next_line(text, "line of codes")?)?;
        let cell = codes.edges(text)?;
        let mut particles = read_atoms(text, &codes, None, budget)?;
        let count = particles.positions.len();
        // Some versions write the number of the step there
        if let Some(stated) = codes.third.filter(|stated| usize::try_from(*stated) != Ok(count)) {
            particles.notes.push(format!(
                "the file has {count} atoms; {stated} in its second line is the number of the step, or the file is cut short"
            ));
        }
        Ok(RawParticles { cell, ..particles })
    }

    fn notes(&self, head: &[u8]) -> Vec<String> {
        let boundary = Codes::in_head(head).ok().map(|codes| codes.boundary);
        let mut notes = vec![
            notes::units("angstroms", Some("angstroms/ps"), Some("ps")),
            notes::GUESSED_ELEMENTS.to_owned(),
        ];
        match boundary {
            None | Some(0) => {}
            Some(4 | 5 | 7) => {
                let what = "the cell is a truncated octahedron, a rhombic dodecahedron or a hexagonal prism, and is not drawn";
                notes.push(what.to_owned());
            }
            Some(_) => notes.push(notes::cell_note(None)),
        }
        notes
    }
}

fn begins_frame(text: &mut TextInput<'_>) -> bool {
    text.peek_line().is_some_and(|line| line.text.trim_ascii_start().starts_with(TIME_STEP))
}

/// Whether an atom of a structure follows: a name, perhaps with a number, then its position.
fn has_atom(text: &mut TextInput<'_>) -> bool {
    let is_name = text.line().is_some_and(|line| {
        let mut words = LineWords::new(line);
        let (name, number) = (words.next(), words.next());
        let is_number = number.is_empty() || text::integer(number).is_some();
        !name.is_empty() && text::number(name).is_none() && is_number
    });
    is_name && text.line().is_some_and(is_vector)
}

/// The frames of a trajectory, or the structure. Text that is not a frame becomes a last step: reading that
/// step reports the error.
fn steps(text: &mut TextInput<'_>, budget: MemoryBudget) -> Result<Vec<Step>, ParseError> {
    let mut steps = Vec::new();
    let codes = Codes::in_head(text.head());
    text.pass_lines(2);
    if !begins_frame(text) {
        text.pass_lines(usize::MAX);
        return Ok(vec![Step::at_bytes(0, 0..text.at())]);
    }
    while !text.is_at_end() {
        let is_frame = begins_frame(text);
        let Some(line) = text.line() else { break };
        let start = line.at;
        let frame = Frame::of(line).ok().filter(|_| is_frame);
        let has_edges = has_edges(text);
        let known = frame.as_ref().zip(codes.as_ref().ok());
        let lines = known.map(|(frame, codes)| frame.lines(codes, has_edges));
        text.pass_lines(lines.unwrap_or(usize::MAX));
        Step::push(&mut steps, start..text.at(), budget)?;
        if let (Some(step), Some(frame)) = (steps.last_mut(), frame) {
            (step.number, step.time) = (Some(frame.number), frame.time);
        }
        text.pass_blank_lines(usize::MAX);
    }
    Step::keep_increasing_numbers(&mut steps);
    Ok(steps)
}

/// Reads the `count` atoms of a frame of a trajectory, which have masses and charges; or all of a structure.
fn read_atoms(
    text: &mut TextInput<'_>,
    codes: &Codes,
    count: Option<usize>,
    budget: MemoryBudget,
) -> Result<RawParticles, ParseError> {
    let in_trajectory = count.is_some();
    let properties = if in_trajectory { &PROPERTIES[..] } else { &[] };
    let real = [properties, &VECTORS[..codes.vectors]].concat();
    // Numbers of atoms may be missing
    let has_number = text.peek_line().is_some_and(|line| text::words(line.text).nth(1).is_some());
    let whole_count = 1 + usize::from(has_number);
    let whole = [ELEMENT, "id"];
    let mut table = AtomTable::new(&whole[..whole_count], &real, &[names::ATOM_NAME], budget);
    let mut numbers = Vec::with_capacity(8);
    let mut found = 0;
    while count.map_or_else(|| !is_blank_end(text), |count| found < count) {
        let line = next_line(text, "line of each atom")?;
        let mut words = LineWords::new(line);
        let word = words.next();
        if word.is_empty() {
            return Err(words.unexpected(word, "the name of an atom"));
        }
        // Names have at most eight bytes
        let mut copy = [0; 64];
        let name_len = word.len().min(copy.len());
        copy[..name_len].copy_from_slice(&word[..name_len]);
        let name = &copy[..name_len];
        let id = if has_number { words.integer("the number of an atom")? } else { 0 };
        numbers.clear();
        for (property, _) in properties {
            numbers.push(words.real(property)?);
        }
        let position = LineWords::new(next_line(text, "position")?).vector("a coordinate")?;
        for (name, _) in &VECTORS[..codes.vectors] {
            numbers.extend(LineWords::new(next_line(text, name)?).vector("a component")?);
        }
        let by_mass = numbers.first().filter(|_| in_trajectory).and_then(|m| masses::element(*m));
        let element = by_mass.map_or_else(|| atoms::element_without_residue(name), i64::from);
        table.push(position, &[element, id][..whole_count], &numbers, &[name])?;
        found += 1;
    }
    Ok(table.into_particles())
}

/// Whether nothing but blank lines follows.
fn is_blank_end(text: &mut TextInput<'_>) -> bool {
    text.pass_blank_lines(usize::MAX);
    text.is_at_end()
}
