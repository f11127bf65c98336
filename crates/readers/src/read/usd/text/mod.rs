//! Text USD files (`.usda`): prims in braces, with attributes and their values.
//!
//! After the grammar in the documentation of OpenUSD. Prims in one another are kept in a list, so that no depth of
//! braces is too much; values are skipped, and read when they are needed.

mod lexer;
mod values;

use std::ops::Range;

use self::lexer::Lexer;
pub(super) use self::values::TextFile;
use super::prim::{
    MAX_LEVELS, Metadata, Prim, PrimKind, PrimTree, Property, Samples, TextValue, Value, is_needed,
    of_prims,
};
use crate::read::text::number;
use spherule_frame::{MemoryBudget, ParseError};

/// The first bytes.
pub(super) const MAGIC: &[u8] = b"#usda ";

/// Least bytes of a prim or property, and most memory for it.
const MIN_LEN: u64 = 8;
const ENTRY_LEN: u64 = 200;

/// Reads the text file `bytes`.
///
/// # Errors
/// [`ParseError::Malformed`] if it is damaged; [`ParseError::TooLarge`] if its lists may not fit into `budget`.
pub(super) fn read(
    bytes: &[u8],
    budget: MemoryBudget,
) -> Result<(TextFile<'_>, PrimTree), ParseError> {
    let mut parser = Parser {
        bytes,
        lexer: Lexer::new(bytes, 0..bytes.len()),
        prims: Vec::new(),
        properties: Vec::new(),
        open: vec![0],
        metadata: Metadata::default(),
        budget,
    };
    parser.run()?;
    let properties = of_prims(parser.properties, &mut parser.prims, bytes);
    let tree = PrimTree { prims: parser.prims, properties, metadata: parser.metadata };
    Ok((TextFile::new(bytes), tree))
}

struct Parser<'a> {
    bytes: &'a [u8],
    lexer: Lexer<'a>,
    prims: Vec<Prim>,
    /// With the index of the prim.
    properties: Vec<(usize, Property)>,
    /// The prims whose braces are open, the innermost last.
    open: Vec<usize>,
    metadata: Metadata,
    budget: MemoryBudget,
}

impl<'a> Parser<'a> {
    fn text(&self, range: &Range<usize>) -> &'a [u8] {
        self.bytes.get(range.clone()).unwrap_or_default()
    }

    fn run(&mut self) -> Result<(), ParseError> {
        self.push_prim(0..0, PrimKind::Other, None, false)?;
        if self.lexer.take(b'(') {
            self.metadata(0)?;
        }
        loop {
            while self.lexer.take(b';') {}
            match self.lexer.peek() {
                None if self.open.len() > 1 => return Err(self.lexer.unexpected("`}`")),
                None => return Ok(()),
                Some(b'}') if self.open.len() > 1 => {
                    self.lexer.expect(b'}')?;
                    self.open.pop();
                }
                Some(_) => self.statement()?,
            }
        }
    }

    fn push_prim(
        &mut self,
        name: Range<usize>,
        kind: PrimKind,
        parent: Option<usize>,
        is_dormant: bool,
    ) -> Result<(), ParseError> {
        self.check_list()?;
        self.prims.push(Prim { name, parent, kind, is_dormant, has_arcs: false, properties: 0..0 });
        Ok(())
    }

    /// Checks that another entry of the lists fits into the budget.
    fn check_list(&self) -> Result<(), ParseError> {
        let count = (self.prims.len() + self.properties.len()) as u64 + MIN_LEN;
        self.budget.check(count * ENTRY_LEN, "the list of its prims is")
    }

    /// The innermost prim.
    fn innermost(&self) -> usize {
        self.open.last().copied().unwrap_or(0)
    }

    /// A prim, a property, or something that is skipped.
    fn statement(&mut self) -> Result<(), ParseError> {
        let word = self.lexer.word();
        match self.text(&word) {
            b"" => Err(self.lexer.unexpected("a prim or a property")),
            b"def" => self.prim(false),
            b"over" | b"class" => self.prim(true),
            b"variantSet" => {
                self.lexer.string()?;
                self.lexer.expect(b'=')?;
                self.lexer.value()?;
                let prim = self.innermost();
                self.prims[prim].has_arcs = true;
                Ok(())
            }
            b"reorder" => {
                self.lexer.word();
                self.lexer.expect(b'=')?;
                self.lexer.value().map(|_| ())
            }
            _ => self.property(word),
        }
    }

    /// A prim after its specifier, up to the brace.
    fn prim(&mut self, is_dormant: bool) -> Result<(), ParseError> {
        let type_name = self.lexer.word();
        let kind = PrimKind::of(self.text(&type_name));
        let at = self.lexer.at();
        let name = self.lexer.string()?;
        if self.open.len() > MAX_LEVELS {
            let what = format!("prims in more than {MAX_LEVELS} others are not read");
            return Err(ParseError::malformed(at, what));
        }
        let prim = self.prims.len();
        self.push_prim(name, kind, Some(self.innermost()), is_dormant)?;
        if self.lexer.take(b'(') {
            self.metadata(prim)?;
        }
        self.lexer.expect(b'{')?;
        self.open.push(prim);
        Ok(())
    }

    /// Metadata of a prim or, for the first one, of the file, after the opening parenthesis.
    fn metadata(&mut self, prim: usize) -> Result<(), ParseError> {
        loop {
            while self.lexer.take(b';') || self.lexer.take(b',') {}
            match self.lexer.peek() {
                Some(b')') => return self.lexer.expect(b')'),
                // A comment
                Some(b'"' | b'\'') => {
                    self.lexer.string()?;
                    continue;
                }
                _ => {}
            }
            let mut key = self.lexer.word();
            if key.is_empty() {
                return Err(self.lexer.unexpected("`)`"));
            }
            if is_list_edit(self.text(&key)) {
                key = self.lexer.word();
            }
            if self.lexer.take(b'=') {
                let value = self.lexer.value()?;
                // The offset of a reference
                if self.lexer.take(b'(') {
                    self.skip_parentheses()?;
                }
                self.set_metadata(prim, &key, &value);
            }
        }
    }

    /// Skips the rest of what is between parentheses.
    fn skip_parentheses(&mut self) -> Result<(), ParseError> {
        while !self.lexer.take(b')') {
            let is_separator = [b'=', b',', b';'].iter().any(|byte| self.lexer.take(*byte));
            if !is_separator {
                self.lexer.value()?;
            }
        }
        Ok(())
    }

    fn set_metadata(&mut self, prim: usize, key: &Range<usize>, value: &Range<usize>) {
        let (key, value) = (self.text(key), self.text(value));
        match key {
            b"references" | b"payload" | b"inherits" | b"specializes" | b"variantSets"
            | b"clips" | b"clipSets" | b"subLayers" | b"relocates"
                if value != b"None" =>
            {
                self.prims[prim].has_arcs = true;
            }
            b"active" if matches!(value, b"false" | b"0") => self.prims[prim].is_dormant = true,
            _ if prim != 0 => {}
            b"upAxis" => self.metadata.is_z_up = matches!(value, b"\"Z\"" | b"'Z'"),
            b"metersPerUnit" => self.metadata.meters_per_unit = number(value),
            b"timeCodesPerSecond" => self.metadata.time_codes_per_second = number(value),
            b"framesPerSecond" => self.metadata.frames_per_second = number(value),
            _ => {}
        }
    }

    /// A property, whose first word is `word`: an attribute or a relationship.
    fn property(&mut self, mut word: Range<usize>) -> Result<(), ParseError> {
        while is_list_edit(self.text(&word))
            || matches!(self.text(&word), b"custom" | b"uniform" | b"varying" | b"config")
        {
            word = self.lexer.word();
        }
        let type_name = word;
        let name = self.lexer.word();
        if name.is_empty() {
            return Err(self.lexer.unexpected("the name of a property"));
        }
        let text = self.text(&name);
        let dot = memchr::memchr(b'.', text).unwrap_or(text.len());
        let (plain, field) = text.split_at(dot);
        let prim = self.innermost();
        let is_read = prim != 0 && is_needed(plain) && self.text(&type_name) != b"rel";
        let mut property = Property {
            name: name.start..name.start + dot,
            default: None,
            samples: None,
            has_spline: field == b".spline",
        };
        if self.lexer.take(b'=') {
            match field {
                b"" => {
                    let range = self.lexer.value()?;
                    property.default = Some(Value::Text(TextValue { type_name, range }));
                }
                b".timeSamples" => {
                    property.samples = Some(Samples::Text(self.samples(&type_name)?));
                }
                _ => {
                    self.lexer.value()?;
                }
            }
        }
        if self.lexer.take(b'(') {
            self.skip_parentheses()?;
        }
        if is_read {
            self.check_list()?;
            self.properties.push((prim, property));
        }
        Ok(())
    }

    /// Times and their values, sorted by time.
    fn samples(&mut self, type_name: &Range<usize>) -> Result<Vec<(f64, TextValue)>, ParseError> {
        self.lexer.expect(b'{')?;
        let mut samples = Vec::new();
        while !self.lexer.take(b'}') {
            let at = self.lexer.at();
            let time = self.lexer.word();
            let text = self.text(&time);
            // The colon may be part of the word
            let (text, has_colon) = match text.strip_suffix(b":") {
                Some(text) => (text, true),
                None => (text, false),
            };
            let time = number(text).filter(|time| time.is_finite());
            let time = time.ok_or_else(|| {
                let what = format!("{} is not a time", crate::read::text::shown(text));
                ParseError::malformed(at, what)
            })?;
            if !has_colon && self.lexer.word().len() != 1 {
                return Err(self.lexer.unexpected("`:`"));
            }
            let range = self.lexer.value()?;
            let need = (samples.len() as u64 + 1) * 2 * ENTRY_LEN;
            self.budget.check(need, "the list of its samples is")?;
            let type_name = type_name.clone();
            samples.push((time, TextValue { type_name, range }));
            self.lexer.take(b',');
        }
        samples.sort_by(|a, b| a.0.total_cmp(&b.0));
        samples.dedup_by(|a, b| a.0.total_cmp(&b.0).is_eq());
        Ok(samples)
    }
}

/// Whether a word says how a list is changed.
fn is_list_edit(word: &[u8]) -> bool {
    matches!(word, b"prepend" | b"append" | b"add" | b"delete" | b"reorder")
}
