//! What precedes the coordinates in files of VASP: the cell and the species.

use glam::{DMat3, DVec3};

use crate::read::category;
use crate::read::input::TextInput;
use crate::read::line_words::{LineWords, next_line};
use crate::read::text::{self, Line};
use spherule_frame::ParseError;

/// Most species; real files have less than 100.
const MAX_SPECIES: usize = 1 << 12;

/// What precedes the coordinates.
pub(super) struct Head {
    /// Factors of x, y and z of the edges and of Cartesian coordinates.
    pub(super) scale: DVec3,
    /// The edges, scaled.
    pub(super) edges: DMat3,
    /// Codes of the species, if they have names.
    pub(super) species: Vec<i64>,
    counts: Vec<usize>,
}

impl Head {
    pub(super) fn read(text: &mut TextInput<'_>) -> Result<Self, ParseError> {
        let title = next_line(text, "title")?.text.to_vec();
        let scale_line = next_line(text, "scale")?;
        let scale_at = scale_line.at;
        let mut words = LineWords::new(scale_line);
        let first = words.real("a scale")?;
        let stated = match text::number(words.next()).zip(text::number(words.next())) {
            Some((second, third)) => DVec3::new(first, second, third),
            None => DVec3::splat(first),
        };
        let mut rows = [DVec3::ZERO; 3];
        for edge in &mut rows {
            let line = next_line(text, "edge of the cell")?;
            *edge = LineWords::new(line).vector("an edge of the cell")?.into();
        }
        let edges = DMat3::from_cols_array_2d(&rows.map(|edge| edge.to_array()));
        let scale = factors(stated, edges).ok_or_else(|| {
            let what = "the scale is neither a positive number, nor three of them, nor minus the volume of the cell";
            ParseError::malformed(scale_at, what)
        })?;
        let line = next_line(text, "names or numbers of species")?;
        let (species, counts) = match counts(line) {
            Some(counts) => (species_in_title(&title, counts.len()), counts),
            None => {
                let names = text::words(code(line.text)).take(MAX_SPECIES + 1);
                let species: Vec<i64> = names.map(species_code).collect();
                if species.len() > MAX_SPECIES {
                    let what = format!("more than {MAX_SPECIES} species: sort the atoms by them");
                    return Err(ParseError::malformed(line.at, what));
                }
                let line = next_line(text, "numbers of atoms")?;
                let counts = counts(line).filter(|counts| counts.len() == species.len());
                let what = format!(
                    "expected {} numbers of atoms, found {}",
                    species.len(),
                    text::shown(line.text)
                );
                (species, counts.ok_or_else(|| ParseError::malformed(line.at, what))?)
            }
        };
        Ok(Self { scale, edges: DMat3::from_diagonal(scale) * edges, species, counts })
    }

    pub(super) fn count(&self) -> usize {
        self.counts.iter().fold(0, |sum, count| sum.saturating_add(*count))
    }

    /// The species of each atom: its code, or its number if it has no name.
    pub(super) fn species_of_atoms(&self) -> impl Iterator<Item = i64> {
        let code = |index: usize| self.species.get(index).copied().unwrap_or(1 + index as i64);
        let counts = self.counts.iter().enumerate();
        counts.flat_map(move |(index, count)| std::iter::repeat_n(code(index), *count))
    }
}

/// Factors of x, y and z by what a file says of `edges`: one number, or three. A negative one is the volume of the cell.
fn factors(scale: DVec3, edges: DMat3) -> Option<DVec3> {
    let factors = if scale.x < 0.0 {
        DVec3::splat(libm::cbrt(-scale.x / edges.determinant().abs()))
    } else {
        scale
    };
    (factors.is_finite() && factors.min_element() > 0.0).then_some(factors)
}

/// A line without a comment at its end.
fn code(line: &[u8]) -> &[u8] {
    line.split(|byte| matches!(byte, b'!' | b'#')).next().unwrap_or_default()
}

/// The numbers of atoms of the species, if the line has nothing else.
fn counts(line: Line<'_>) -> Option<Vec<usize>> {
    let count = |word| text::integer(word).and_then(|count| usize::try_from(count).ok());
    let counts: Option<Vec<usize>> =
        text::words(code(line.text)).take(MAX_SPECIES + 1).map(count).collect();
    counts.filter(|counts| (1..=MAX_SPECIES).contains(&counts.len()))
}

/// The code of a species that is named by its element, perhaps with the potential behind it: `Fe_pv`, `Fe/0a1b`.
fn species_code(name: &[u8]) -> i64 {
    let element = name.split(|byte| matches!(byte, b'_' | b'/' | b'.')).next().unwrap_or_default();
    match category::code(element) {
        code if category::is_element(code) => code,
        _ => category::code(name),
    }
}

/// Files of version 4 often have the elements in their title.
fn species_in_title(title: &[u8], count: usize) -> Vec<i64> {
    let codes: Vec<i64> = text::words(title).take(count + 1).map(species_code).collect();
    let are_elements = codes.len() == count && codes.iter().all(|code| category::is_element(*code));
    if are_elements { codes } else { Vec::new() }
}
