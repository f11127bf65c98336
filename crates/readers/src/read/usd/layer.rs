//! One layer of a scene: its prims, and their values in a binary or text file.

use super::number_type::Numbers;
use super::prim::{MAX_LEVELS, Metadata, Name, Prim, PrimTree, Property, Samples, Value, ValueRep};
use super::{binary, text};
use spherule_frame::{MemoryBudget, ParseError};

/// A layer.
#[derive(Debug)]
pub(super) struct Layer<'a> {
    source: Source<'a>,
    /// The first one is the root of all others.
    pub(super) prims: Vec<Prim>,
    pub(super) properties: Vec<Property>,
    pub(super) metadata: Metadata,
}

/// The file of a layer.
#[derive(Debug)]
enum Source<'a> {
    Binary(Box<binary::CrateFile<'a>>),
    Text(text::TextFile<'a>),
}

impl<'a> Layer<'a> {
    /// Reads the prims of the file `bytes`, binary or text.
    ///
    /// # Errors
    /// [`ParseError`] if it is damaged, of another kind, or does not fit into `budget`.
    pub(super) fn open(bytes: &'a [u8], budget: MemoryBudget) -> Result<Self, ParseError> {
        let (source, tree) = if bytes.starts_with(binary::MAGIC) {
            let (file, tree) = binary::read(bytes, budget)?;
            (Source::Binary(Box::new(file)), tree)
        } else if bytes.starts_with(text::MAGIC) {
            let (file, tree) = text::read(bytes, budget)?;
            (Source::Text(file), tree)
        } else {
            let what = "not a USD file: it begins neither with PXR-USDC nor with #usda";
            return Err(ParseError::malformed(0, what));
        };
        let PrimTree { prims, properties, metadata } = tree;
        Ok(Self { source, prims, properties, metadata })
    }
}

impl Layer<'_> {
    /// The text of a name.
    pub(super) fn text(&self, name: &Name) -> &[u8] {
        let text = match &self.source {
            Source::Binary(file) => file.token_text(),
            Source::Text(file) => file.bytes(),
        };
        text.get(name.clone()).unwrap_or_default()
    }

    /// The properties of a prim.
    pub(super) fn properties(&self, prim: &Prim) -> &[Property] {
        self.properties.get(prim.properties.clone()).unwrap_or_default()
    }

    /// The property `name` of a prim.
    pub(super) fn property(&self, prim: &Prim, name: &[u8]) -> Option<&Property> {
        let properties = self.properties(prim);
        let found = properties.binary_search_by(|property| self.text(&property.name).cmp(name));
        properties.get(found.ok()?)
    }

    /// The prims from the one below the root to `prim`; `None` if it is in a variant or too deep.
    pub(super) fn chain(&self, prim: usize) -> Option<Vec<usize>> {
        let mut chain = Vec::new();
        let mut at = prim;
        while at != 0 {
            if chain.len() == MAX_LEVELS {
                return None;
            }
            chain.push(at);
            at = self.prims.get(at)?.parent?;
        }
        chain.reverse();
        Some(chain)
    }

    /// The path of the last prim of a chain, for messages.
    pub(super) fn path(&self, chain: &[usize]) -> String {
        let prims = chain.iter().filter_map(|index| self.prims.get(*index));
        let names = prims.map(|prim| {
            let name = self.text(&prim.name);
            format!("/{}", String::from_utf8_lossy(name.get(..80).unwrap_or(name)))
        });
        names.collect()
    }

    /// Number of samples.
    pub(super) fn sample_count(&self, samples: &Samples) -> usize {
        match samples {
            Samples::Binary { times, .. } => times.len() / 8,
            Samples::Text(list) => list.len(),
        }
    }

    /// Time code of a sample.
    pub(super) fn sample_time(&self, samples: &Samples, index: usize) -> f64 {
        match (samples, &self.source) {
            (Samples::Binary { times, .. }, Source::Binary(file)) => {
                f64::from_bits(file.u64_at(times.start + 8 * index))
            }
            (Samples::Text(list), _) => list.get(index).map_or(0.0, |(time, _)| *time),
            _ => 0.0,
        }
    }

    /// Value of a sample.
    pub(super) fn sample_value(&self, samples: &Samples, index: usize) -> Option<Value> {
        match (samples, &self.source) {
            (Samples::Binary { values, .. }, Source::Binary(file)) => {
                let rep = file.u64_at(values.start + 8 * index);
                Some(Value::Binary(ValueRep(rep)))
            }
            (Samples::Text(list), _) => {
                let (_, value) = list.get(index)?;
                Some(Value::Text(value.clone()))
            }
            _ => None,
        }
    }

    /// The numbers of `value`; `None` if it has none.
    ///
    /// # Errors
    /// [`ParseError::Malformed`] if it is damaged, [`ParseError::TooLarge`] if it does not fit into `budget`.
    pub(super) fn numbers(
        &self,
        value: &Value,
        budget: MemoryBudget,
    ) -> Result<Option<Numbers>, ParseError> {
        match (value, &self.source) {
            (Value::Binary(rep), Source::Binary(file)) => file.numbers(*rep, budget),
            (Value::Text(value), Source::Text(file)) => file.numbers(value, budget),
            _ => Ok(None),
        }
    }

    /// The type of the values of `property`, if that is not one of numbers.
    pub(super) fn foreign_type(&self, property: &Property) -> Option<String> {
        let samples = property.samples.as_ref();
        let sample = samples.and_then(|samples| self.sample_value(samples, 0));
        let mut values = [sample, property.default.clone()].into_iter().flatten();
        values.find_map(|value| match (&value, &self.source) {
            (Value::Binary(rep), Source::Binary(_)) => binary::CrateFile::foreign_type(*rep),
            (Value::Text(value), Source::Text(file)) => file.foreign_type(value),
            _ => None,
        })
    }

    /// The words of `value`, an array of tokens or a single one; none if it has other values.
    ///
    /// # Errors
    /// As [`Self::numbers`].
    pub(super) fn tokens(&self, value: &Value) -> Result<Vec<&[u8]>, ParseError> {
        match (value, &self.source) {
            (Value::Binary(rep), Source::Binary(file)) => file.tokens(*rep),
            (Value::Text(value), Source::Text(file)) => Ok(file.tokens(value)),
            _ => Ok(Vec::new()),
        }
    }
}
