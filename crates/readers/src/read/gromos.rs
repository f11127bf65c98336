//! Files of GROMOS (`.g96`, `.trc`), which GROMACS writes, too: structures and trajectories in text.
//!
//! Blocks of a name, lines, and `END`. Read are `TIMESTEP`, `POSITION` (with names, in columns), `POSITIONRED`, `VELOCITY`,
//! `VELOCITYRED`, `BOX` (lengths, or components of edges as in `.gro` files) and `GENBOX`. After the manuals of GROMOS
//! and the page `g96` of GROMACS. Lengths are nm, times ps.

use super::atoms::{self, AtomTable, ELEMENT, RESIDUE, field};
use super::beads::Beads;
use super::fixed_rows::RowNumbers;
use super::gro;
use super::input::TextInput;
use super::line_words::{LineWords, next_line};
use super::sniff::is_text;
use super::text::{self, Line, Lines};
use super::{ByteSource, Step, notes};
use crate::format::Format;
use crate::reader::{Confidence, FormatInfo, Reader, StreamUnit};
use spherule_frame::{
    Attribute, AttributeData, MemoryBudget, ParseError, RawParticles, SimulationCell, names,
};

/// Files of GROMOS.
pub const FORMAT: Format = Format::new(&Gromos);

struct Gromos;

const END: &[u8] = b"END";
/// Columns of the names of an atom, which its coordinates follow.
const NAMES: usize = 24;

impl Reader for Gromos {
    fn info(&self) -> FormatInfo {
        FormatInfo {
            angstrom: 0.1,
            time_unit: Some("ps"),
            ..FormatInfo::molecular("gromos", &["g96", "trc"])
        }
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        let mut lines = Lines::new(head, 0..head.len()).map(|line| line.text.trim_ascii_end());
        let opens = is_text(head)
            && lines
                .next()
                .is_some_and(|line| matches!(line, b"TITLE" | b"POSITION" | b"TIMESTEP"));
        let is_block = lines.any(|line| line == END);
        Ok(if opens && is_block {
            Confidence::Signature
        } else if opens {
            Confidence::IfNamed
        } else {
            Confidence::No
        })
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
        read(source.text(), step, budget)
    }

    fn notes(&self, head: &[u8]) -> Vec<String> {
        let has = |name: &[u8]| Lines::new(head, 0..head.len()).any(|line| line.text == name);
        let mut notes = vec![notes::units("nm", Some("nm/ps"), Some("ps"))];
        if has(b"POSITION") {
            notes.push(notes::GUESSED_ELEMENTS.to_owned());
        }
        if has(b"BOX") || has(b"GENBOX") {
            notes.push(notes::cell_note(None));
        }
        notes
    }
}

/// The next line of a block; None at its end.
fn row<'t>(text: &'t mut TextInput<'_>) -> Result<Option<Line<'t>>, ParseError> {
    while text.peek_line().is_some_and(|line| line.text.starts_with(b"#")) {
        text.line();
    }
    let line = next_line(text, "line END of a block")?;
    Ok((line.text.trim_ascii_end() != END).then_some(line))
}

fn is_position(name: &[u8]) -> bool {
    matches!(name, b"POSITION" | b"POSITIONRED")
}

/// Step and time in the line of a block `TIMESTEP`.
fn step_and_time(line: Line<'_>) -> (Option<i64>, Option<f64>) {
    let mut words = LineWords::new(line);
    let (number, time) = (text::integer(words.next()), text::number(words.next()));
    (number, time.filter(|time| time.is_finite()))
}

/// The frames: each begins with a block `TIMESTEP`, or with one of positions behind another one. One without positions is
/// listed, too, so that reading it gives the error.
fn steps(text: &mut TextInput<'_>, budget: MemoryBudget) -> Result<Vec<Step>, ParseError> {
    let mut steps = Vec::new();
    let (mut start, mut has_positions, mut has_time) = (text.at(), false, false);
    let mut numbers = (None, None);
    let push = |steps: &mut Vec<Step>, range, (number, time)| {
        Step::push(steps, range, budget)?;
        if let Some(step) = steps.last_mut() {
            (step.number, step.time) = (number, time);
        }
        Ok::<(), ParseError>(())
    };
    while let Some(line) = text.line() {
        let (at, name) = (line.at, line.text.trim_ascii_end());
        let (is_time, is_position) = (name == b"TIMESTEP", is_position(name));
        if name.is_empty() || name == END {
            continue;
        }
        if (has_positions && is_position) || ((has_positions || has_time) && is_time) {
            push(&mut steps, start..at, numbers)?;
            (start, has_positions, numbers) = (at, false, (None, None));
            has_time = false;
        }
        has_positions |= is_position;
        has_time |= is_time;
        if is_time {
            numbers = text.peek_line().map(step_and_time).unwrap_or_default();
        }
        while text.line().is_some_and(|line| line.text.trim_ascii_end() != END) {}
    }
    push(&mut steps, start..text.at(), numbers)?;
    Step::keep_increasing_numbers(&mut steps);
    Ok(steps)
}

fn read(
    text: &mut TextInput<'_>,
    step: &Step,
    budget: MemoryBudget,
) -> Result<RawParticles, ParseError> {
    let range = step.byte_range().cloned().unwrap_or_default();
    text.go_to(range.start);
    text.end_at(range.end);
    let (mut found, mut velocities, mut cell) = (None, None, None);
    let (mut number, mut time) = (None, None);
    while let Some(line) = text.line() {
        match line.text.trim_ascii_end() {
            b"" => {}
            b"POSITION" => found = Some(read_named(text, budget)?),
            b"POSITIONRED" => found = Some(read_bare(text, budget)?),
            b"VELOCITY" => velocities = Some((line.at, read_vectors(text, NAMES, budget)?)),
            b"VELOCITYRED" => velocities = Some((line.at, read_vectors(text, 0, budget)?)),
            b"TIMESTEP" => (number, time) = text.peek_line().map(step_and_time).unwrap_or_default(),
            b"BOX" => {
                cell = None;
                while let Some(line) = row(text)? {
                    cell = cell.or_else(|| gro::cell(line));
                }
            }
            b"GENBOX" => cell = read_general_box(text)?,
            _ => while row(text)?.is_some() {},
        }
    }
    let Some(mut particles) = found else {
        let what = "a GROMOS file without a block POSITION or POSITIONRED: it has no positions";
        return Err(ParseError::malformed(text.at(), what));
    };
    if let Some((at, velocities)) = velocities {
        let (found, count) = (velocities.len() / 3, particles.positions.len());
        if found != count {
            let what = format!("{found} velocities of {count} atoms");
            return Err(ParseError::malformed(at, what));
        }
        let data = AttributeData::F64(velocities);
        particles.attributes.push(Attribute { name: "velocity".to_owned(), components: 3, data });
    }
    Ok(RawParticles { cell, step: number, time, ..particles })
}

/// Reads atoms with names: number and name of the residue, name and number of the atom, x, y, z.
fn read_named(text: &mut TextInput<'_>, budget: MemoryBudget) -> Result<RawParticles, ParseError> {
    let texts = [names::RESIDUE_NAME, names::ATOM_NAME];
    let mut table = AtomTable::new(&[ELEMENT, RESIDUE], &[], &texts, budget);
    let mut beads = Beads::default();
    while let Some(line) = row(text)? {
        let position = vector(line, NAMES)?;
        let (residue_name, name) = (field(line.text, 6, 11), field(line.text, 12, 17));
        let residue = atoms::residue(field(line.text, 0, 5));
        let element = atoms::element(b"", name, residue_name);
        table.push(position, &[element, residue], &[], &[residue_name, name])?;
        beads.push(name, residue_name);
    }
    let mut particles = table.into_particles();
    particles.attributes.extend(beads.attribute());
    Ok(particles)
}

/// Reads positions without names.
fn read_bare(text: &mut TextInput<'_>, budget: MemoryBudget) -> Result<RawParticles, ParseError> {
    let mut table = AtomTable::new(&[], &[], &[], budget);
    while let Some(line) = row(text)? {
        table.push(vector(line, 0)?, &[], &[], &[])?;
    }
    Ok(table.into_particles())
}

/// Reads vectors behind the first columns of each line.
fn read_vectors(
    text: &mut TextInput<'_>,
    start: usize,
    budget: MemoryBudget,
) -> Result<Vec<f64>, ParseError> {
    let mut vectors = RowNumbers::new(budget);
    while let Some(line) = row(text)? {
        vectors.push(&vector(line, start)?)?;
    }
    Ok(vectors.numbers)
}

/// The vector behind the first columns of a line.
fn vector(line: Line<'_>, start: usize) -> Result<[f64; 3], ParseError> {
    let text = line.text.get(start..).unwrap_or_default();
    LineWords::new(Line { text, ..line }).vector("a component")
}

/// The cell in a block of a code, lengths, angles, and others.
fn read_general_box(text: &mut TextInput<'_>) -> Result<Option<SimulationCell>, ParseError> {
    let Some(line) = row(text)? else { return Ok(None) };
    let kind = LineWords::new(line).integer("the code of a box")?;
    // Lengths, angles, Euler angles of the cell, its origin
    let mut vectors = [[0.0; 3]; 4];
    for numbers in &mut vectors {
        let Some(line) = row(text)? else { return Ok(None) };
        *numbers = vector(line, 0)?;
    }
    while row(text)?.is_some() {}
    let [lengths, angles, rotation, origin] = vectors;
    let is_usual = [rotation, origin].as_flattened().iter().all(|number| number.abs() < 1e-3);
    // 1 is rectangular, 2 triclinic; 0 is none, and truncated octahedra (-1) have more faces
    let cell = SimulationCell::from_angles(lengths, angles);
    Ok(cell.filter(|_| matches!(kind, 1 | 2) && is_usual))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::damage::{TestedReader, attribute, coordinates, names, numbers};
    use crate::read::pieces;

    fn steps(bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
        pieces::steps(FORMAT, bytes)
    }

    fn particles(bytes: &[u8], step: &Step) -> Result<RawParticles, ParseError> {
        pieces::read(FORMAT, bytes, step)
    }

    const READER: TestedReader = TestedReader { steps, read: particles };

    const TITLE: &str = "TITLE\nPOSITION of water\nEND\n";
    const NAMED: &str = "POSITION\n# names\n    1 SOL   OW         1    0.500000000   -1.250000000    3.000000000\n\
        \x20   1 SOL   HW1        2    1.000000000    2.000000000    3.000000000\nEND\n";
    const BARE: &str = "POSITIONRED\n 0.5 -1.25 3\n#  10\n 1 2 3\nEND\n";

    #[test]
    fn frames_have_names_times_and_boxes() {
        let velocities = NAMED.replace("POSITION", "VELOCITY");
        let tail = "BOX\n 10 20 30\nEND\n";
        let frame =
            |number: i64| format!("TIMESTEP\n {number} {number}.5\nEND\n{NAMED}{velocities}{tail}");
        let text = TITLE.to_owned() + &frame(1) + &frame(2);
        for text in [&text, &text.replace('\n', "\r\n")] {
            assert_eq!(FORMAT.reader().sniff(text.as_bytes()), Ok(Confidence::Signature));
            let frames = READER.all(text.as_bytes()).expect("frames");
            assert_eq!((frames.len(), frames[1].step, frames[1].time), (2, Some(2), Some(2.5)));
            for found in &frames {
                let all = ["element", "residue", "residue_name", "atom_name", "velocity"];
                assert_eq!(names(found), all);
                assert_eq!(numbers(&attribute(found, "element").data), [8.0, 1.0]);
                assert_eq!(coordinates(&found.positions)[0], [0.5, -1.25, 3.0]);
                assert_eq!(numbers(&attribute(found, "velocity").data)[..3], [0.5, -1.25, 3.0]);
                assert_eq!(found.cell.expect("a cell").vectors[2].z, 30.0);
            }
        }
    }

    #[test]
    fn frames_may_be_positions_alone() {
        let general = "GENBOX\n 1\n 4 5 6\n 90 90 90\n 0 0 0\n 0 0 0\nEND\n";
        let text = format!("{TITLE}{BARE}{general}{BARE}{general}");
        let frames = READER.all(text.as_bytes()).expect("frames");
        assert_eq!(frames.len(), 2);
        for found in frames {
            assert!(found.attributes.is_empty());
            assert_eq!(coordinates(&found.positions), [[0.5, -1.25, 3.0], [1.0, 2.0, 3.0]]);
            assert_eq!(found.cell.expect("a cell").vectors[1].y, 5.0);
        }
    }

    #[test]
    fn damage_is_named() {
        let good = format!("{TITLE}{NAMED}VELOCITYRED\n1 2 3\n4 5 6\nEND\n");
        for (from, to, message) in [
            ("4 5 6\n", "", "1 velocities of 2 atoms"),
            ("3.000000000", "x", "found \"x\" where a component is expected"),
            ("4 5 6\nEND\n", "4 5 6\n", "no line END of a block: the file is cut short"),
            ("\nPOSITION\n", "\nPOSITIONS\n", "without a block POSITION or POSITIONRED"),
        ] {
            let error = READER.error_inside(good.replacen(from, to, 1).as_bytes()).to_string();
            assert!(error.contains(message), "{error} | {message}");
        }
        READER.survives_truncation(good.as_bytes(), &[3, 8, 40, 60], 0);
        let tight = MemoryBudget::new(100, "take care");
        let mut source = ByteSource::whole(good.as_bytes());
        assert!(FORMAT.read_within(&mut source, &Step::whole(good.len()), tight).is_err());
    }
}
