//! The numbers that texts in a condition stand for: names of parts, symbols of elements, species, and names of chains,
//! residues and atoms.

use std::collections::BTreeMap;

use spherule_formats::{element_symbol, name_code};
use spherule_frame::values::Value;
use spherule_frame::{Labels, label_code, names};

use super::values::{NameFault, UnknownName};

/// Columns whose numbers readers make from names of elements and species.
const SPECIES: [&str; 4] = ["element", "species", "symbol", "typelabel"];

/// The last atomic number.
const LAST_ELEMENT: i64 = 118;

/// What a text stands for; `V` is a value of particles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum TextValue<V> {
    /// A number of the value that it is compared with.
    Code(f64),
    /// It is not text but the name of a value.
    Value(V),
}

/// What a text of a molecule means that the labels lack.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum MissingText {
    /// An error: the labels are those of a sequence.
    Error,
    /// No particle has it: the labels are those of a frame, and other frames may have it.
    NoParticle,
}

/// The column of `value`; empty for a value without one.
const fn column_of(value: &Value) -> &str {
    match value {
        Value::Magnitude(column) => column.as_str(),
        _ => "",
    }
}

/// Whether `value` may be compared with text that is also the name of a value: a chain may be called X.
pub(super) fn is_text(value: &Value) -> bool {
    names::is_one_of(column_of(value), &names::TEXTS)
}

/// A text of `value`, if it has only text and its numbers mean nothing.
pub(super) fn example<'a>(value: &Value, labels: &'a Labels) -> Option<&'a str> {
    let labels = labels.get(column_of(value)).filter(|_| is_text(value))?;
    let example = labels.values().find(|label| !label.is_empty());
    Some(example.map_or("", String::as_str))
}

/// The number that the `labels` of a column have for `text`.
fn labelled(labels: &BTreeMap<i64, String>, text: &str) -> Option<i64> {
    // Names of groups and prims are paths
    let is_own = |label: &str| {
        let last = label.rsplit('/').next().unwrap_or_default();
        label.eq_ignore_ascii_case(text) || last.eq_ignore_ascii_case(text)
    };
    // Chains `A` and `a` may differ
    let exact = labels.iter().find(|(_, label)| *label == text);
    exact.or_else(|| labels.iter().find(|(_, label)| is_own(label))).map(|(code, _)| *code)
}

/// Whether particles with these `labels` have `text` as `value`, which is a column of text.
pub(super) fn has(value: &Value, text: &str, labels: &Labels) -> bool {
    let own = labels.get(column_of(value)).filter(|_| is_text(value));
    own.is_some_and(|own| labelled(own, text).is_some())
}

/// The number of `text` among those of `value`, which a condition calls `name`.
///
/// # Errors
/// There is none, at this `column` of the condition.
pub(super) fn code_of(
    (name, value): (&str, &Value),
    (text, column): (&str, usize),
    labels: &Labels,
    missing: MissingText,
) -> Result<f64, UnknownName> {
    let values = column_of(value);
    let own = labels.get(values);
    let is_symbol = text.len() <= 2 && text.bytes().all(|byte| byte.is_ascii_alphabetic());
    let code = match own.and_then(|own| labelled(own, text)) {
        Some(code) => Some(code),
        None if names::is_one_of(values, &SPECIES) => {
            Some(name_code(text)).filter(|code| *code <= LAST_ELEMENT || !is_symbol)
        }
        // Native frames have no labels
        None if is_text(value) && own.is_none() => Some(label_code(text).into()),
        // Different from every number
        None if is_text(value) && missing == MissingText::NoParticle => return Ok(f64::NAN),
        None => None,
    };
    // Or say which texts are known
    #[expect(clippy::cast_precision_loss, reason = "values are compared in f64")]
    code.map(|code| code as f64).ok_or_else(|| {
        let symbols = (1..=LAST_ELEMENT).filter_map(element_symbol).map(str::to_owned);
        let known = match own {
            Some(own) => own.values().filter(|label| !label.is_empty()).cloned().collect(),
            None if names::is_one_of(values, &SPECIES) => symbols.collect(),
            None => Vec::new(),
        };
        let fault = NameFault::NoText { of: name.to_owned(), known };
        UnknownName { name: text.to_owned(), column, fault }
    })
}
