//! The numbers that texts in a condition stand for: names of parts, symbols of elements, and species.

use spherule_formats::{element_symbol, name_code};
use spherule_frame::values::Value;
use spherule_frame::{Labels, names};

use super::values::UnknownName;

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

/// The number of `text` among those of `value`, which a condition calls `name`.
///
/// # Errors
/// There is none, at this `column` of the condition.
pub(super) fn code_of(
    (name, value): (&str, &Value),
    (text, column): (&str, usize),
    labels: &Labels,
) -> Result<f64, UnknownName> {
    // Find the names of the values
    let values = match value {
        Value::Magnitude(values) => values.as_str(),
        _ => "",
    };
    let own = labels.get(values);
    // Names of groups and prims are paths
    let is_own = |label: &str| {
        let last = label.rsplit('/').next().unwrap_or_default();
        label.eq_ignore_ascii_case(text) || last.eq_ignore_ascii_case(text)
    };
    let found = own.and_then(|own| own.iter().find(|(_, label)| is_own(label)));
    // Find the text among them; elements have names without a file
    let is_symbol = text.len() <= 2 && text.bytes().all(|byte| byte.is_ascii_alphabetic());
    let code = match found {
        Some((code, _)) => Some(*code),
        None if names::is_one_of(values, &SPECIES) => {
            Some(name_code(text)).filter(|code| *code <= LAST_ELEMENT || !is_symbol)
        }
        None => None,
    };
    // Or say which texts are known
    #[expect(clippy::cast_precision_loss, reason = "values are compared in f64")]
    code.map(|code| code as f64).ok_or_else(|| {
        let symbols = (1..=LAST_ELEMENT).filter_map(element_symbol).map(str::to_owned);
        let known = match own {
            Some(own) => own.values().cloned().collect(),
            None if names::is_one_of(values, &SPECIES) => symbols.collect(),
            None => Vec::new(),
        };
        UnknownName { name: text.to_owned(), column, texts: Some((name.to_owned(), known)) }
    })
}
