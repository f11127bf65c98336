//! The rows of the loop `_atom_site`.

use super::cut_short;
use super::tokens::{self, Token};
use crate::read::input::TextInput;
use crate::read::text;
use spherule_frame::{MemoryBudget, ParseError, SimulationCell};

/// What a column of the loop is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Column {
    Axis(usize),
    Symbol,
    Name,
    ResidueName,
    /// The name of the chain by the author.
    Chain,
    /// The name by which the dictionary tells chains apart; ligands and water have names of their own.
    LabelChain,
    Residue,
    /// The number of the residue by which the dictionary counts.
    LabelResidue,
    Occupancy,
    BFactor,
    Model,
    Ignored,
}

/// What the names of columns begin with.
const PREFIX: &[u8] = b"_atom_site.";
/// The same in the older dictionary, of crystals.
const CORE_PREFIX: &[u8] = b"_atom_site_";

impl Column {
    /// The column called `name`, without [`PREFIX`].
    fn of(name: &[u8]) -> Self {
        let is = |known: &str| name.eq_ignore_ascii_case(known.as_bytes());
        match () {
            () if is("Cartn_x") => Self::Axis(0),
            () if is("Cartn_y") => Self::Axis(1),
            () if is("Cartn_z") => Self::Axis(2),
            () if is("type_symbol") => Self::Symbol,
            () if is("label_atom_id") => Self::Name,
            () if is("label_comp_id") => Self::ResidueName,
            () if is("auth_asym_id") => Self::Chain,
            () if is("label_asym_id") => Self::LabelChain,
            () if is("auth_seq_id") => Self::Residue,
            () if is("label_seq_id") => Self::LabelResidue,
            () if is("occupancy") => Self::Occupancy,
            () if is("B_iso_or_equiv") => Self::BFactor,
            () if is("pdbx_PDB_model_num") => Self::Model,
            () => Self::Ignored,
        }
    }
}

/// An atom.
#[derive(Debug, Clone, Default)]
pub(super) struct AtomRow {
    /// Offset of the first value in the file.
    pub(super) at: usize,
    pub(super) position: [f64; 3],
    pub(super) symbol: Vec<u8>,
    pub(super) name: Vec<u8>,
    pub(super) residue_name: Vec<u8>,
    chain: Vec<u8>,
    label_chain: Vec<u8>,
    pub(super) residue: Option<i64>,
    pub(super) label_residue: Option<i64>,
    pub(super) occupancy: Option<f64>,
    pub(super) b_factor: Option<f64>,
    pub(super) model: Option<i64>,
}

impl AtomRow {
    /// The name of the chain: that of the author, as in PDB files, if there is one.
    pub(super) fn chain(&self) -> &[u8] {
        if self.chain.is_empty() { &self.label_chain } else { &self.chain }
    }

    /// Stores a value of the row; `at` is its offset in the file.
    fn set(&mut self, column: Column, token: Token<'_>, at: usize) -> Result<(), ParseError> {
        let value = token.text;
        let store = |place: &mut Vec<u8>| {
            place.clear();
            // `.` and `?` stand for no value.
            let is_value = token.is_quoted || !matches!(value, b"." | b"?");
            place.extend_from_slice(if is_value { value } else { b"" });
        };
        match column {
            Column::Axis(axis) => {
                let number = text::number(value).ok_or_else(|| {
                    let what = format!("{} is not a coordinate", text::shown(value));
                    ParseError::malformed(at, what)
                })?;
                if let Some(place) = self.position.get_mut(axis) {
                    *place = number;
                }
            }
            Column::Symbol => store(&mut self.symbol),
            Column::Name => store(&mut self.name),
            Column::ResidueName => store(&mut self.residue_name),
            Column::Chain => store(&mut self.chain),
            Column::LabelChain => store(&mut self.label_chain),
            Column::Residue => self.residue = text::integer(value),
            Column::LabelResidue => self.label_residue = text::integer(value),
            Column::Occupancy => self.occupancy = text::number(value),
            Column::BFactor => self.b_factor = text::number(value),
            Column::Model => self.model = text::integer(value),
            Column::Ignored => {}
        }
        Ok(())
    }
}

/// Names of the lengths and angles of the cell.
const CELL: [&str; 6] = [
    "_cell.length_a",
    "_cell.length_b",
    "_cell.length_c",
    "_cell.angle_alpha",
    "_cell.angle_beta",
    "_cell.angle_gamma",
];

/// Takes a number of the cell from a line with a name and its value.
fn read_cell(line: &[u8], cell: &mut [f64; 6]) {
    let mut words = text::words(line);
    let Some(name) = words.next() else { return };
    let is_named = |known: &&str| name.eq_ignore_ascii_case(known.as_bytes());
    let number = words.next().and_then(|value| {
        // A standard uncertainty may follow in parentheses
        let digits = value.split(|byte| *byte == b'(').next()?;
        text::number(digits)
    });
    if let (Some(index), Some(number)) = (CELL.iter().position(is_named), number) {
        cell[index] = number;
    }
}

/// Most columns: the dictionary has about a hundred.
const MAX_COLUMNS: usize = 1024;

/// The rows of the loop from front to back.
#[derive(Debug)]
pub(super) struct AtomRows {
    columns: Vec<Column>,
    /// Lengths and angles of the cell; NaN for those that the file does not have before the loop.
    cell: [f64; 6],
    /// The current line, its offset, and where the next token is in it.
    line: Vec<u8>,
    line_at: usize,
    next: usize,
    row: AtomRow,
    budget: MemoryBudget,
}

impl AtomRows {
    /// Goes to the first row of the loop.
    ///
    /// # Errors
    /// [`ParseError`] if there is no such loop, or it has no positions.
    pub(super) fn find(text: &mut TextInput<'_>, budget: MemoryBudget) -> Result<Self, ParseError> {
        let mut columns = Vec::new();
        let (mut is_core, mut cell) = (false, [f64::NAN; 6]);
        // Pass what precedes the loop
        let mut columns_at = None;
        while let Some(line) = text.peek_line() {
            let name = line.text.trim_ascii();
            match name.strip_prefix(PREFIX) {
                Some(name) if columns.len() < MAX_COLUMNS => {
                    columns_at.get_or_insert(line.at);
                    // A file of one atom may have the values behind the names, without a loop.
                    if text::words(name).nth(1).is_some() {
                        let what = "_atom_site is not a loop; write it as one";
                        return Err(ParseError::unsupported(what));
                    }
                    columns.push(Column::of(name));
                }
                Some(_) => {
                    let what = format!("_atom_site has more than {MAX_COLUMNS} columns");
                    return Err(ParseError::malformed(line.at, what));
                }
                None if columns_at.is_some() => break,
                None => {
                    is_core |= name.starts_with(CORE_PREFIX);
                    read_cell(name, &mut cell);
                }
            }
            text.line();
        }
        let Some(columns_at) = columns_at else {
            let what = if is_core {
                "a CIF file of a crystal, which is not read; write .xyz with Open Babel, ASE or OVITO"
            } else {
                "a CIF file without the loop _atom_site, so it has no positions"
            };
            return Err(ParseError::unsupported(what));
        };
        if let Some(axis) = (0..3).find(|axis| !columns.contains(&Column::Axis(*axis))) {
            let what = format!("_atom_site has no column Cartn_{}", ["x", "y", "z"][axis]);
            return Err(ParseError::malformed(columns_at, what));
        }
        Ok(Self {
            columns,
            cell,
            line: Vec::new(),
            line_at: text.at(),
            next: 0,
            row: AtomRow::default(),
            budget,
        })
    }

    /// The cell, if the file has one.
    pub(super) fn cell(&self) -> Option<SimulationCell> {
        let [a, b, c, alpha, beta, gamma] = self.cell;
        let (lengths, angles) = ([a, b, c], [alpha, beta, gamma]);
        // A unit cube stands for no cell, as in PDB files
        SimulationCell::from_angles(lengths, angles).filter(|_| lengths != [1.0; 3])
    }

    /// Goes on to the row at byte `at`.
    pub(super) fn go_to(&mut self, text: &mut TextInput<'_>, at: usize) {
        text.go_to(at);
        self.line.clear();
        self.next = 0;
    }

    /// The next atom; `None` behind the last one.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if a row is not complete or a coordinate is not a number.
    pub(super) fn next(
        &mut self,
        text: &mut TextInput<'_>,
    ) -> Result<Option<&AtomRow>, ParseError> {
        for index in 0..self.columns.len() {
            let Some((at, len, is_quoted)) = self.token(text)? else {
                if index == 0 {
                    return Ok(None);
                }
                let what = format!("a row has {index} of {} values", self.columns.len());
                return Err(cut_short(self.row.at, &what));
            };
            if index == 0 {
                self.row.at = self.line_at + at;
            }
            let value = self.line.get(at..at + len).unwrap_or_default();
            let token = Token { text: value, at, is_quoted };
            if let Some(column) = self.columns.get(index) {
                self.row.set(*column, token, self.line_at + at)?;
            }
        }
        Ok(Some(&self.row))
    }

    /// Place and length of the next value in the current line, which may be a new one. `None` at the end of the loop.
    fn token(
        &mut self,
        text: &mut TextInput<'_>,
    ) -> Result<Option<(usize, usize, bool)>, ParseError> {
        loop {
            if let Some((token, next)) = tokens::next(&self.line, self.next) {
                if token.ends_loop() {
                    return Ok(None);
                }
                self.next = next;
                let quote = usize::from(token.is_quoted);
                return Ok(Some((token.at + quote, token.text.len(), token.is_quoted)));
            }
            let Some(line) = text.line() else {
                return Ok(None);
            };
            self.budget.check(2 * line.text.len() as u64, "it has a line that is")?;
            self.line_at = line.at;
            if line.text.starts_with(b";") {
                let what = "_atom_site has text of several lines, which is not read";
                return Err(ParseError::unsupported(what));
            }
            self.line.clear();
            self.line.extend_from_slice(line.text);
            self.next = 0;
        }
    }
}
