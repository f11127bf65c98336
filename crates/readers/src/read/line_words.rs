//! Words of a line from front to back, and bonds by the numbers of their atoms: what readers of free text share.

use super::CUT_SHORT;
use std::collections::HashMap;

use super::input::TextInput;
use super::text::{self, Line};
use spherule_frame::{Bond, MemoryBudget, ParseError};

/// The words of a line, from front to back.
pub(super) struct LineWords<'a> {
    line: Line<'a>,
    rest: &'a [u8],
}

impl<'a> LineWords<'a> {
    pub(super) const fn new(line: Line<'a>) -> Self {
        Self { line, rest: line.text }
    }

    /// The next word; empty at the end of the line.
    pub(super) fn next(&mut self) -> &'a [u8] {
        let rest = self.rest.trim_ascii_start();
        let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
        let (word, rest) = rest.split_at(end);
        self.rest = rest;
        word
    }

    /// As [`Self::next`], where quotes may stand around a word with blanks. They are not part of it.
    pub(super) fn next_quoted(&mut self) -> &'a [u8] {
        let quoted = self.rest().strip_prefix(b"\"");
        let end = quoted.and_then(|rest| rest.iter().position(|&byte| byte == b'"'));
        let Some((rest, end)) = quoted.zip(end) else {
            return self.next();
        };
        self.rest = &rest[end + 1..];
        &rest[..end]
    }

    /// What follows, without blanks around it.
    pub(super) const fn rest(&self) -> &'a [u8] {
        self.rest.trim_ascii()
    }

    /// The next word as a number, called `name` in the error.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if it is none.
    pub(super) fn real(&mut self, name: &str) -> Result<f64, ParseError> {
        let word = self.next();
        text::number(word).ok_or_else(|| self.unexpected(word, name))
    }

    /// The next word as an integer.
    ///
    /// # Errors
    /// As [`Self::real`].
    pub(super) fn integer(&mut self, name: &str) -> Result<i64, ParseError> {
        let word = self.next();
        text::integer(word).ok_or_else(|| self.unexpected(word, name))
    }

    /// The next word as a count.
    ///
    /// # Errors
    /// As [`Self::real`].
    pub(super) fn count(&mut self, name: &str) -> Result<usize, ParseError> {
        let word = self.next();
        let count = text::integer(word).and_then(|count| usize::try_from(count).ok());
        count.ok_or_else(|| self.unexpected(word, name))
    }

    /// The next three words as numbers.
    ///
    /// # Errors
    /// As [`Self::real`].
    pub(super) fn vector(&mut self, name: &str) -> Result<[f64; 3], ParseError> {
        Ok([self.real(name)?, self.real(name)?, self.real(name)?])
    }

    /// The error for `word` where the thing called `name` is expected.
    pub(super) fn unexpected(&self, word: &[u8], name: &str) -> ParseError {
        let what = if word.is_empty() {
            format!("the line ends before {name}: the file is damaged, or still being written")
        } else {
            format!("found {} where {name} is expected", text::shown(word))
        };
        ParseError::malformed(self.line.at, what)
    }
}

/// The next line, which has `what`.
///
/// # Errors
/// [`ParseError::Malformed`] at the end of the text.
pub(super) fn next_line<'t>(
    text: &'t mut TextInput<'_>,
    what: &str,
) -> Result<Line<'t>, ParseError> {
    let at = text.at();
    text.line().ok_or_else(|| ParseError::malformed(at, format!("no {what}: {CUT_SHORT}")))
}

/// The numbers by which a file refers to its atoms. Nearly always they count from 1.
#[derive(Debug, Default)]
pub(super) struct AtomNumbers {
    count: usize,
    /// Indices by number, if the numbers do not count from 1.
    indices: Option<HashMap<i64, u32>>,
}

impl AtomNumbers {
    /// Bytes of an atom whose number is not the expected one.
    const LEN: usize = 40;

    /// Numbers from 1 to `count`.
    pub(super) const fn counted(count: usize) -> Self {
        Self { count, indices: None }
    }

    /// Adds the number of the next atom.
    ///
    /// # Errors
    /// [`ParseError::TooLarge`] beyond the budget.
    pub(super) fn push(&mut self, number: i64, budget: MemoryBudget) -> Result<(), ParseError> {
        let index = u32::try_from(self.count).unwrap_or(u32::MAX);
        if self.indices.is_none() && number != i64::from(index) + 1 {
            self.indices = Some((0..index).map(|index| (i64::from(index) + 1, index)).collect());
        }
        self.count += 1;
        if let Some(indices) = &mut self.indices {
            budget.check((Self::LEN * self.count) as u64, "its atoms in memory are")?;
            indices.insert(number, index);
        }
        Ok(())
    }

    fn index(&self, number: i64) -> Option<u32> {
        match &self.indices {
            Some(indices) => indices.get(&number).copied(),
            None => {
                let index = usize::try_from(number.checked_sub(1)?).ok()?;
                u32::try_from(index).ok().filter(|_| index < self.count)
            }
        }
    }
}

/// Bonds between atoms by their numbers, within a budget.
pub(super) struct BondList {
    bonds: Vec<Bond>,
    atoms: AtomNumbers,
    budget: MemoryBudget,
}

impl BondList {
    /// No bonds yet of `atoms`.
    pub(super) const fn new(atoms: AtomNumbers, budget: MemoryBudget) -> Self {
        Self { bonds: Vec::new(), atoms, budget }
    }

    /// Adds the bond in the line at byte `at` between the atoms with the numbers `ends`.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if there is no such atom; [`ParseError::TooLarge`] beyond the budget.
    pub(super) fn push(&mut self, at: usize, ends: [i64; 2]) -> Result<(), ParseError> {
        let [Some(first), Some(second)] = ends.map(|number| self.atoms.index(number)) else {
            let ([first, second], count) = (ends, self.atoms.count);
            let what = format!(
                "a bond between the atoms {first} and {second}, which are not both among the {count} atoms"
            );
            return Err(ParseError::malformed(at, what));
        };
        // A vector that grows holds its old bonds and twice the room for new ones
        let need = 3 * size_of::<Bond>() * (self.bonds.len() + 1);
        self.budget.check(need as u64, "its bonds in memory are")?;
        self.bonds.push([first, second]);
        Ok(())
    }

    pub(super) fn into_bonds(mut self) -> Vec<Bond> {
        self.bonds.shrink_to_fit();
        self.bonds
    }

    /// The bonds of a file that lists each at both of its atoms, or at one.
    pub(super) fn into_distinct_bonds(mut self) -> Vec<Bond> {
        self.bonds.iter_mut().for_each(|bond| bond.sort_unstable());
        self.bonds.sort_unstable();
        self.bonds.dedup();
        self.into_bonds()
    }
}
