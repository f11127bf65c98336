//! The error of parsers of single values: names, numbers and sizes on a command line or in a manifest.

/// The text of a value is not acceptable.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("expected {expected}, found {found:?}{}", suggestion(.similar.as_deref()))]
pub struct ValueError {
    /// Description of acceptable values.
    pub expected: String,
    /// The text of the value.
    pub found: String,
    /// A similar acceptable value.
    pub similar: Option<String>,
}

impl ValueError {
    /// The text `found` is not `expected`.
    pub fn new(expected: impl Into<String>, found: impl Into<String>) -> Self {
        Self { expected: expected.into(), found: found.into(), similar: None }
    }

    /// The text `found` is none of `names`.
    pub fn one_of(names: &[&str], found: &str) -> Self {
        Self::new(format!("one of {}", names.join(", ")), found)
    }

    /// Adds a similar acceptable value, if there is one.
    #[must_use]
    pub fn with_similar(mut self, similar: Option<&str>) -> Self {
        self.similar = similar.map(str::to_owned);
        self
    }
}

fn suggestion(similar: Option<&str>) -> String {
    similar.map_or_else(String::new, |name| format!("; did you mean {name}?"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_have_expected_and_found_values() {
        let error = ValueError::one_of(&["q16", "q10"], "q1\n");
        assert_eq!(error.to_string(), r#"expected one of q16, q10, found "q1\n""#);
        let error = error.with_similar(Some("q16"));
        assert!(error.to_string().ends_with("; did you mean q16?"));
    }
}
