//! The lines before the first section: how many things of each kind there are, and the box.

use glam::DVec3;

use crate::read::input::TextInput;
use crate::read::text::{self, Line};
use spherule_frame::{ParseError, SimulationCell};

/// What the header says.
#[derive(Debug, Default)]
pub(super) struct DataHeader {
    /// Atoms.
    pub(super) atoms: usize,
    /// Bonds.
    pub(super) bonds: usize,
    /// Atoms that are ellipsoids.
    pub(super) ellipsoids: usize,
    /// Atom types, if the header has their number.
    pub(super) types: Option<usize>,
    /// The style of particles that have a shape of their own, if there are any.
    pub(super) shape: Option<&'static str>,
    /// The system of units (`units = real`), if the title names it.
    pub(super) units: Option<String>,
    has_atoms: bool,
    axes: [Option<[f64; 2]>; 3],
    tilts: [f64; 3],
    vectors: [Option<DVec3>; 3],
    origin: DVec3,
}

/// Objects of the header that imply an atom style, with that.
const SHAPES: [(&[u8], &str); 4] =
    [(b"ellipsoids", "ellipsoid"), (b"lines", "line"), (b"triangles", "tri"), (b"bodies", "body")];

/// The part of a line before a comment.
pub(super) fn code(line: &[u8]) -> &[u8] {
    line.split(|byte| *byte == b'#').next().unwrap_or_default().trim_ascii()
}

impl DataHeader {
    /// Reads the title and all lines up to the first heading.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if a count or a bound is not a number, or the number of atoms is missing.
    pub(super) fn parse(text: &mut TextInput<'_>) -> Result<Self, ParseError> {
        let units = text.line().and_then(|title| units(title.text));
        let mut header = Self { units, ..Self::default() };
        while let Some(line) = text.peek_line() {
            if code(line.text).first().is_some_and(u8::is_ascii_alphabetic) {
                break;
            }
            header.add(line)?;
            text.line();
        }
        if header.has_atoms {
            return Ok(header);
        }
        Err(ParseError::malformed(
            text.at(),
            "no line with the number of atoms, such as `12 atoms`",
        ))
    }

    fn add(&mut self, line: Line<'_>) -> Result<(), ParseError> {
        let words: Vec<&[u8]> = text::words(code(line.text)).take(8).collect();
        match *words.as_slice() {
            [n, b"atoms"] => (self.atoms, self.has_atoms) = (count(line, n)?, true),
            [n, b"bonds"] => self.bonds = count(line, n)?,
            [n, b"atom", b"types"] => self.types = Some(count(line, n)?),
            [n, shape] => {
                if let Some((name, style)) = SHAPES.iter().find(|(name, _)| *name == shape) {
                    let count = count(line, n)?;
                    self.shape = if count > 0 { Some(*style) } else { self.shape };
                    self.ellipsoids = if *name == b"ellipsoids" { count } else { self.ellipsoids };
                }
            }
            [lo, hi, b"xlo", b"xhi"] => self.axes[0] = Some(range(line, [lo, hi])?),
            [lo, hi, b"ylo", b"yhi"] => self.axes[1] = Some(range(line, [lo, hi])?),
            [lo, hi, b"zlo", b"zhi"] => self.axes[2] = Some(range(line, [lo, hi])?),
            [x, y, z, b"xy", b"xz", b"yz"] => self.tilts = numbers(line, [x, y, z])?,
            [x, y, z, b"avec"] => self.vectors[0] = Some(numbers(line, [x, y, z])?.into()),
            [x, y, z, b"bvec"] => self.vectors[1] = Some(numbers(line, [x, y, z])?.into()),
            [x, y, z, b"cvec"] => self.vectors[2] = Some(numbers(line, [x, y, z])?.into()),
            [x, y, z, b"abc", b"origin"] => self.origin = numbers(line, [x, y, z])?.into(),
            _ => {}
        }
        Ok(())
    }

    /// Whether `number` may be that of an atom type.
    pub(super) fn is_type(&self, number: i64) -> bool {
        let number = usize::try_from(number).unwrap_or_default();
        number > 0 && self.types.is_none_or(|types| number <= types)
    }

    /// The cell: that of a general triclinic box, or one with an edge along x. Files do not say which boundaries are
    /// periodic; all are, as is the default of LAMMPS.
    pub(super) fn cell(&self) -> Option<SimulationCell> {
        let periodic = [true; 3];
        if let [Some(a), Some(b), Some(c)] = self.vectors {
            return SimulationCell::new(self.origin, [a, b, c], periodic);
        }
        let [[xlo, xhi], [ylo, yhi], [zlo, zhi]] = [self.axes[0]?, self.axes[1]?, self.axes[2]?];
        let [xy, xz, yz] = self.tilts;
        let edges = [
            DVec3::new(xhi - xlo, 0.0, 0.0),
            DVec3::new(xy, yhi - ylo, 0.0),
            DVec3::new(xz, yz, zhi - zlo),
        ];
        SimulationCell::new(DVec3::new(xlo, ylo, zlo), edges, periodic)
    }
}

/// The word behind `units =` in a title that LAMMPS wrote.
fn units(title: &[u8]) -> Option<String> {
    let at = memchr::memmem::find(title, b"units = ")?;
    let word = text::words(title.get(at + 8..)?).next()?;
    Some(String::from_utf8_lossy(word).into_owned())
}

fn count(line: Line<'_>, word: &[u8]) -> Result<usize, ParseError> {
    let count = text::integer(word).and_then(|count| usize::try_from(count).ok());
    count.ok_or_else(|| {
        let what = format!("{} in {} is not a count", text::shown(word), text::shown(line.text));
        ParseError::malformed(line.at, what)
    })
}

fn range(line: Line<'_>, words: [&[u8]; 2]) -> Result<[f64; 2], ParseError> {
    let [lo, hi] = numbers(line, words)?;
    if hi < lo {
        let what = format!("the box ends before it begins: {}", text::shown(line.text));
        return Err(ParseError::malformed(line.at, what));
    }
    Ok([lo, hi])
}

fn numbers<const N: usize>(line: Line<'_>, words: [&[u8]; N]) -> Result<[f64; N], ParseError> {
    let mut numbers = [0.0; N];
    for (number, word) in numbers.iter_mut().zip(words) {
        *number = text::number(word).ok_or_else(|| {
            let what = format!("{} in a line of the box is not a number", text::shown(word));
            ParseError::malformed(line.at, what)
        })?;
    }
    Ok(numbers)
}
