//! MDL files: molecules with their bonds, one (`.mol`) or many (`.sdf`), versions V2000 and V3000.
//!
//! Three lines of a heading, a line of counts, then atoms and bonds: in columns of equal width (V2000), or as words in
//! lines that begin with `M  V30` (V3000). Old files state no version and are as V2000. Each record ends with `$$$$` and
//! is a frame. After "CTfile Formats" (BIOVIA, 2020). Lengths are A.

use super::atoms::{self, AtomTable, ELEMENT, coordinate, field};
use super::input::TextInput;
use super::line_words::{AtomNumbers, BondList, LineWords, next_line};
use super::sniff::is_text;
use super::text::{self, Line, Lines};
use super::{ByteSource, CUT_SHORT, Step, notes};
use crate::format::Format;
use crate::reader::{Confidence, FormatInfo, Reader, StreamUnit};
use spherule_frame::{MemoryBudget, ParseError, RawParticles};

/// MDL files.
pub const FORMAT: Format = Format::new(&Sdf);

struct Sdf;

/// Lines before the counts.
const HEADING: usize = 3;
const RECORD_END: &[u8] = b"$$$$";
/// Where the third coordinate of an atom of V2000 ends.
const Z_END: usize = 30;
/// What lines of V3000 begin with.
const V3000: &[u8] = b"M  V30 ";
/// Longest line of V3000 that is continued, bytes.
const MAX_LINE: usize = 1 << 16;

impl Reader for Sdf {
    fn info(&self) -> FormatInfo {
        FormatInfo::molecular("sdf", &["sdf", "mol", "mdl"])
    }

    fn sniff(&self, head: &[u8]) -> Result<Confidence, ParseError> {
        let counts = Lines::new(head, 0..head.len()).nth(HEADING);
        Ok(match counts.and_then(version).filter(|_| is_text(head)) {
            None => Confidence::No,
            Some(Version::Unstated) => Confidence::IfNamed,
            Some(Version::V2000 | Version::V3000) => Confidence::Signature,
        })
    }

    fn stream_unit(&self, _head: &[u8]) -> Option<StreamUnit> {
        Some(StreamUnit::Words)
    }

    /// A frame for each record.
    fn steps(&self, source: &mut ByteSource<'_>) -> Result<Vec<Step>, ParseError> {
        let budget = source.budget();
        let text = source.text();
        let mut steps = Vec::new();
        loop {
            let start = text.at();
            while text.line().is_some_and(|line| !line.text.starts_with(RECORD_END)) {}
            Step::push(&mut steps, start..text.at(), budget)?;
            // Headings may be blank, but blank lines may also end the file
            let is_end = text.ahead(|text| {
                text.pass_blanks();
                text.is_at_end()
            });
            if is_end {
                return Ok(steps);
            }
        }
    }

    fn read(&self, source: &mut ByteSource<'_>, step: &Step) -> Result<RawParticles, ParseError> {
        let budget = source.budget();
        let text = source.text();
        let range = step.byte_range().cloned().unwrap_or_default();
        text.go_to(range.start);
        text.end_at(range.end);
        text.pass_lines(HEADING);
        let line = next_line(text, "line of counts")?;
        match version(line) {
            Some(Version::V2000 | Version::Unstated) => {
                let counts = [count(line, 0)?, count(line, 3)?];
                read_columns(text, counts, budget)
            }
            Some(Version::V3000) => read_words(text, budget),
            None => {
                let what = format!(
                    "{} is not a line of counts that ends with V2000 or V3000",
                    text::shown(line.text)
                );
                Err(ParseError::malformed(line.at, what))
            }
        }
    }

    fn notes(&self, _head: &[u8]) -> Vec<String> {
        vec![notes::units("angstroms", None, None)]
    }
}

enum Version {
    V2000,
    V3000,
    /// As [`Self::V2000`], in files that are older than the numbers of versions.
    Unstated,
}

/// The version at the end of a line of counts.
fn version(line: Line<'_>) -> Option<Version> {
    let text = line.text.trim_ascii_end();
    if text.ends_with(b"V2000") {
        Some(Version::V2000)
    } else if text.ends_with(b"V3000") {
        Some(Version::V3000)
    } else {
        let has_numbers_alone = text.iter().all(|byte| byte.is_ascii_digit() || *byte == b' ');
        // V3000 has zeros here, so that a line of zeros has lost its version
        let has_counts = count(line, 0).is_ok_and(|count| count > 0) && count(line, 3).is_ok();
        (has_numbers_alone && has_counts).then_some(Version::Unstated)
    }
}

/// A number of three columns, from `start` on.
fn count(line: Line<'_>, start: usize) -> Result<usize, ParseError> {
    let token = field(line.text, start, start + 3);
    let count = text::integer(token).and_then(|count| usize::try_from(count).ok());
    count.ok_or_else(|| {
        let end = start + 3;
        let what =
            format!("columns {} to {end} have {}, not a count", start + 1, text::shown(token));
        ParseError::malformed(line.at, what)
    })
}

/// The number of the element with this symbol; symbols of queries such as `*` are none.
fn element(symbol: &[u8]) -> i64 {
    atoms::element(symbol, symbol, b"")
}

/// Reads the atoms and bonds of V2000.
fn read_columns(
    text: &mut TextInput<'_>,
    [atom_count, bond_count]: [usize; 2],
    budget: MemoryBudget,
) -> Result<RawParticles, ParseError> {
    let mut table = AtomTable::new(&[ELEMENT], &[], &[], budget);
    for _ in 0..atom_count {
        let line = next_line(text, "line of an atom")?;
        // Programs write long numbers in more than ten columns, and so move what follows
        let more = line.text.iter().skip(Z_END).take_while(|byte| byte.is_ascii_digit()).count();
        let z_end = Z_END + more;
        let position =
            [coordinate(line, 0, 10)?, coordinate(line, 10, 20)?, coordinate(line, 20, z_end)?];
        let symbol = field(line.text, z_end + 1, z_end + 4);
        table.push(position, &[element(symbol)], &[], &[])?;
    }
    let particles = table.into_particles();
    let left = budget.less(particles.byte_len());
    let mut bonds = BondList::new(AtomNumbers::counted(atom_count), left);
    for _ in 0..bond_count {
        let line = next_line(text, "line of a bond")?;
        let ends = [count(line, 0)?, count(line, 3)?];
        bonds.push(line.at, ends.map(|end| end as i64))?;
    }
    Ok(RawParticles { bonds: bonds.into_bonds(), ..particles })
}

/// Reads the atoms and bonds of V3000.
fn read_words(text: &mut TextInput<'_>, budget: MemoryBudget) -> Result<RawParticles, ParseError> {
    let mut table = AtomTable::new(&[ELEMENT], &[], &[], budget);
    let mut numbers = AtomNumbers::default();
    let (mut counts, mut found) = (None, 0);
    let mut block = Block::Other;
    let mut bonds = None;
    let mut bond_count = 0;
    while let Some((at, line)) = statement(text)? {
        let line = Line { at, text: &line };
        let mut words = LineWords::new(line);
        match (words.next(), &block) {
            (b"COUNTS", _) => {
                counts =
                    Some([words.count("a number of atoms")?, words.count("a number of bonds")?]);
            }
            (b"BEGIN", _) => block = Block::of(words.next()),
            (b"END", Block::Atoms) => {
                let left = budget.less(32 * found as u64);
                bonds = Some(BondList::new(std::mem::take(&mut numbers), left));
                block = Block::Other;
            }
            (b"END", _) if words.next() == b"CTAB" => break,
            (b"END", _) => block = Block::Other,
            (number, Block::Atoms) => {
                let number = text::integer(number)
                    .ok_or_else(|| words.unexpected(number, "the number of an atom"))?;
                let symbol = words.next_quoted();
                table.push(words.vector("a coordinate")?, &[element(symbol)], &[], &[])?;
                numbers.push(number, budget)?;
                found += 1;
            }
            (_, Block::Bonds) => {
                words.next();
                let ends = [
                    words.integer("the number of an atom")?,
                    words.integer("the number of an atom")?,
                ];
                let bonds = bonds.as_mut().ok_or_else(|| {
                    ParseError::malformed(at, "bonds stand before the block of atoms")
                })?;
                bonds.push(at, ends)?;
                bond_count += 1;
            }
            (_, Block::Other) => {}
        }
    }
    check_counts(text.at(), counts, [found, bond_count])?;
    Ok(RawParticles {
        bonds: bonds.map(BondList::into_bonds).unwrap_or_default(),
        ..table.into_particles()
    })
}

/// Compares the numbers of atoms and bonds that are `stated` with those found up to byte `at`.
fn check_counts(
    at: usize,
    stated: Option<[usize; 2]>,
    found: [usize; 2],
) -> Result<(), ParseError> {
    let what = match stated {
        Some(stated) if stated == found => return Ok(()),
        Some([atoms, bonds]) => {
            let [found_atoms, found_bonds] = found;
            format!(
                "{atoms} atoms and {bonds} bonds are stated, {found_atoms} and {found_bonds} follow"
            )
        }
        None => "no line `M  V30 COUNTS`".to_owned(),
    };
    Err(ParseError::malformed(at, format!("{what}: {CUT_SHORT}")))
}

/// The block of V3000 that lines belong to.
enum Block {
    Atoms,
    Bonds,
    Other,
}

impl Block {
    const fn of(name: &[u8]) -> Self {
        match name {
            b"ATOM" => Self::Atoms,
            b"BOND" => Self::Bonds,
            _ => Self::Other,
        }
    }
}

/// The next line of V3000 and where it begins, with those that continue it; none behind the last one.
fn statement(text: &mut TextInput<'_>) -> Result<Option<(usize, Vec<u8>)>, ParseError> {
    let Some(first) = text.line() else {
        return Ok(None);
    };
    let at = first.at;
    let Some(body) = first.text.strip_prefix(V3000) else {
        return Ok(None);
    };
    let mut joined = body.trim_ascii_end().to_vec();
    while joined.last() == Some(&b'-') {
        joined.pop();
        let line = next_line(text, "line that continues the one before")?;
        let more = line.text.strip_prefix(V3000).unwrap_or_default();
        joined.extend_from_slice(more.trim_ascii_end());
        if joined.len() > MAX_LINE {
            let what = format!("a line that is continued has more than {MAX_LINE} bytes");
            return Err(ParseError::malformed(at, what));
        }
    }
    Ok(Some((at, joined)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::damage::{TestedReader, attribute, coordinates, numbers};
    use crate::read::pieces;

    fn steps(bytes: &[u8]) -> Result<Vec<Step>, ParseError> {
        pieces::steps(FORMAT, bytes)
    }

    fn particles(bytes: &[u8], step: &Step) -> Result<RawParticles, ParseError> {
        pieces::read(FORMAT, bytes, step)
    }

    const READER: TestedReader = TestedReader { steps, read: particles };

    const OLD: &str = "methanol\n  by hand\n\n  3  2  0  0  0  0  0  0  0  0999 V2000\n\
        \x20   0.5000   -1.2500    3.0000 C   0  0\n    1.0000    2.0000    3.0000 O   0  0\n\
        -1000.0000-1000.0000-1000.0000 D   0  0\n  1  2  1  0\n  2  3  1  0\nM  END\n";

    const NEW: &str = "\n\n\n  0  0  0     0  0            999 V3000\nM  V30 BEGIN CTAB\nM  V30 COUNTS 3 2 0 0 0\n\
        M  V30 BEGIN ATOM\nM  V30 1 C 0.5 -1.25 -\nM  V30 3 0\nM  V30 2 O 1 2 3 0 CHG=-1\nM  V30 9 D -1000 -1000 -1000 0\n\
        M  V30 END ATOM\nM  V30 BEGIN BOND\nM  V30 1 1 1 2\nM  V30 2 1 2 9\nM  V30 END BOND\nM  V30 END CTAB\nM  END\n";

    #[test]
    fn both_versions_give_the_same() {
        let both = format!("{OLD}> <name>\nx\n\n$$$$\n{NEW}$$$$\n\n");
        for text in [&both, &both.replace('\n', "\r\n")] {
            assert_eq!(FORMAT.reader().sniff(text.as_bytes()), Ok(Confidence::Signature));
            let frames = READER.all(text.as_bytes()).expect("frames");
            assert_eq!(frames.len(), 2);
            for found in frames {
                assert_eq!(numbers(&attribute(&found, "element").data), [6.0, 8.0, 1.0]);
                let positions = coordinates(&found.positions);
                assert_eq!(positions, [[0.5, -1.25, 3.0], [1.0, 2.0, 3.0], [-1000.0; 3]]);
                assert_eq!(found.bonds, [[0, 1], [1, 2]]);
            }
        }
        assert_eq!(READER.one(NEW.as_bytes()).positions.len(), 3);
        let empty = "\n\n\n  0  0  0     0  0            999 V2000\nM  END\n";
        assert_eq!(READER.one(empty.as_bytes()).positions.len(), 0);
    }

    #[test]
    fn symbols_may_be_quoted_and_coordinates_long() {
        let query = NEW.replace("2 O 1", "2 \"NOT [O, N]\" 1");
        let found = READER.one(query.as_bytes());
        assert_eq!(coordinates(&found.positions)[1], [1.0, 2.0, 3.0]);
        assert!(numbers(&attribute(&found, "element").data)[1] > 118.0);
        for (number, z) in [("-15355.5894", -15355.5894), ("123456.1234", 123_456.123_4)] {
            let found =
                READER.one(OLD.replacen("    3.0000 C", &format!("{number} C"), 1).as_bytes());
            assert_eq!(coordinates(&found.positions)[0], [0.5, -1.25, z]);
            assert_eq!(numbers(&attribute(&found, "element").data), [6.0, 8.0, 1.0]);
        }
    }

    #[test]
    fn old_files_state_no_version() {
        for counts in ["  3  2\n", "  3  2  0  0  0  0  0  0  0  0  1 \r\n"] {
            let old = OLD.replace("  3  2  0  0  0  0  0  0  0  0999 V2000\n", counts);
            assert_eq!(FORMAT.reader().sniff(old.as_bytes()), Ok(Confidence::IfNamed));
            assert_eq!(READER.one(old.as_bytes()), READER.one(OLD.as_bytes()));
        }
    }

    #[test]
    fn damage_is_named() {
        for (text, from, to, message) in [
            (OLD, "V2000", "V9000", "is not a line of counts"),
            (OLD, "  3  2", "  3  x", "columns 4 to 6 have \"x\", not a count"),
            (OLD, "  3  2", "999999", "not a coordinate"),
            (OLD, "-1.2500", "- .2500", "not a coordinate"),
            (OLD, "  2  3  1", "  2  4  1", "a bond between the atoms 2 and 4"),
            (NEW, "COUNTS 3 2", "COUNTS 4 2", "4 atoms and 2 bonds are stated, 3 and 2 follow"),
            (NEW, "1 1 1 2", "1 1 1 3", "a bond between the atoms 1 and 3"),
            (NEW, "2 O 1", "2 O x", "found \"x\" where a coordinate is expected"),
            (NEW, "BEGIN ATOM", "BEGIN ATOMS", "bonds stand before the block of atoms"),
        ] {
            let error = READER.error_inside(text.replacen(from, to, 1).as_bytes()).to_string();
            assert!(error.contains(message), "{error} | {message}");
        }
        for text in [OLD, NEW] {
            READER.survives_truncation(text.as_bytes(), &[1, 30, 60, 100, 150], text.len() - 50);
            let tight = MemoryBudget::new(100, "take care");
            let mut source = ByteSource::whole(text.as_bytes());
            assert!(FORMAT.read_within(&mut source, &Step::whole(text.len()), tight).is_err());
        }
        let endless = NEW.replace("0.5 -1.25 -\n", &"0.5 -1.25 -\nM  V30 ".repeat(10_000));
        assert!(READER.error_inside(endless.as_bytes()).to_string().contains("more than 65536"));
    }
}
