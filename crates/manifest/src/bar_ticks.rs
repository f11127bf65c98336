//! `ticks` and `format` of colour bars.

use serde_json::{Value as Json, json};
use spherule_images::overlay::{NumberFormat, TickChoice};

use super::field::Field;
use super::key::Key;
use super::value::{Fault, Value, list, quoted};

/// Numbers of labels.
const COUNTS: [u16; 2] = [2, 20];

/// Most values.
const MAX_VALUES: usize = 50;

/// How the numbers of a colour bar are written.
#[derive(Debug, Clone, PartialEq)]
pub struct LabelFormat {
    text: String,
    format: NumberFormat,
}

impl LabelFormat {
    /// The format.
    pub const fn format(&self) -> NumberFormat {
        self.format
    }
}

impl Value for TickChoice {
    fn kind(_: &Key) -> String {
        let [least, most] = COUNTS;
        format!(
            "a number of labels from {least} to {most}, or a list of 1 to {MAX_VALUES} values, such as [0, 2.5, 5]"
        )
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        if let Some(count) = field.as_integer() {
            let whole = u16::try_from(count).ok();
            let count = whole.filter(|count| (COUNTS[0]..=COUNTS[1]).contains(count));
            return count.map(Self::Count).ok_or(Fault::Unwanted);
        }
        let items = field.items().filter(|items| (1..=MAX_VALUES).contains(&items.len()));
        let values: Option<Vec<f64>> = items.and_then(|i| i.iter().map(Field::as_number).collect());
        values.map(Self::Values).ok_or(Fault::Unwanted)
    }

    fn toml(&self) -> String {
        match self {
            Self::Count(count) => count.to_string(),
            Self::Values(values) => list(values.iter().map(|value| format!("{value:?}"))),
        }
    }

    fn schema(_: &Key) -> Json {
        let [least, most] = COUNTS;
        json!({ "anyOf": [
            { "type": "integer", "minimum": least, "maximum": most },
            { "type": "array", "items": { "type": "number" }, "minItems": 1, "maxItems": MAX_VALUES },
        ] })
    }
}

impl Value for LabelFormat {
    fn kind(_: &Key) -> String {
        "a format such as \".2f\" (two decimals), \".1e\" (a power of ten) or \",.0f\" (groups of digits)".to_owned()
    }

    fn parse(field: &Field<'_>, _: &Key) -> Result<Self, Fault> {
        let text =
            field.as_text().filter(|text| !matches!(*text, "" | "%")).ok_or(Fault::Unwanted)?;
        let format = NumberFormat::parse(text).ok_or(Fault::Unwanted)?;
        Ok(Self { text: text.to_owned(), format })
    }

    fn toml(&self) -> String {
        quoted(&self.text)
    }

    fn schema(_: &Key) -> Json {
        // Up to 30 digits
        let digits = "([0-9]|[12][0-9]|30)";
        let pattern = format!(r"^%?((0{digits})?,?(\.{digits}[fe]|d)|0{digits},?|,)$");
        json!({ "type": "string", "pattern": pattern })
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::{Manifest, OverlayKind};

    fn read(keys: &str) -> Result<OverlayKind, String> {
        let text = format!("input.path = \"a\"\n[[overlay]]\ntype = \"colorbar\"\n{keys}");
        let manifest = Manifest::parse(&text, Path::new("job.toml"));
        manifest.map(|m| m.overlays[0].kind.clone()).map_err(|error| error.to_string())
    }

    #[test]
    fn ticks_are_a_count_or_values() {
        for (text, expected) in [
            ("5", TickChoice::Count(5)),
            ("[3]", TickChoice::Values(vec![3.0])),
            ("[0, -2.5, 1e3]", TickChoice::Values(vec![0.0, -2.5, 1000.0])),
        ] {
            let found = read(&format!("ticks = {text}")).unwrap();
            let OverlayKind::ColorBar { ticks, .. } = found else { panic!("{found:?}") };
            assert_eq!(ticks, Some(expected), "{text}");
        }
        let many = format!("ticks = {:?}", vec![1.0; 10_000]);
        for text in ["ticks = 1", "ticks = 10000", "ticks = []", "ticks = [1, nan]", &many] {
            let error = read(text).unwrap_err();
            let expected = "overlay.0.ticks: expected a number of labels from 2 to 20, or a list of 1 to 50 values";
            assert!(error.contains(expected), "{error}");
        }
    }

    #[test]
    fn formats_and_factors_are_checked() {
        for text in [".2f", "%.2e", ",.0f", ",", "d", "03d"] {
            assert!(read(&format!("format = \"{text}\"")).is_ok(), "{text}");
        }
        for text in ["", "%", ".2g", "%s", ".99f", "f", "{:.2f}"] {
            let error = read(&format!("format = \"{text}\"")).unwrap_err();
            assert!(error.contains("overlay.0.format: expected a format such as"), "{error}");
        }
        for text in ["nan", "0", "-1", "inf", "1e-400", "\"kPa\""] {
            let error = read(&format!("factor = {text}")).unwrap_err();
            assert!(error.contains("overlay.0.factor: expected a number from"), "{error}");
        }
    }
}
