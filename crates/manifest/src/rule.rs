//! Rules between keys: where some keys pass tests, others have to pass one as well.
//!
//! A rule is data. The message of the reader ([`Section::check`]) and the condition in the JSON schema ([`conditions`])
//! both follow from it. Rules that need arithmetic, lists or the particles are code.

use serde_json::{Value as Json, json};

use super::reader::Section;
use super::tree::{Kind, TomlNode};

/// A test of a key. Values are written as for `--set`, with text without quotes.
#[derive(Debug, Clone, Copy)]
pub(super) enum Test {
    /// It is given.
    Given,
    /// It is not given.
    Missing,
    /// It is given and has one of these values.
    Is(&'static [&'static str]),
    /// It is given and has none of these values.
    IsNot(&'static [&'static str]),
    /// It is not given, or has one of these values.
    MissingOr(&'static [&'static str]),
    /// It is not given, or has none of these values.
    MissingOrNot(&'static [&'static str]),
}

/// A rule. Keys may have dots, which lead to tables in the table.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rule {
    /// It applies if all of these keys pass their tests.
    pub(super) when: &'static [(&'static str, Test)],
    /// Then each of these keys must pass this test.
    pub(super) keys: &'static [&'static str],
    pub(super) then: Test,
    /// The message about a key that does not.
    pub(super) message: &'static str,
}

/// Declares rules: `"key" Test, ... => "key", ... Test: message;`.
macro_rules! rules {
    ($($($when:literal $test:ident $([$($word:literal),+])?),+
        => $($key:literal),+ $then:ident $([$($value:literal),+])?: $message:expr;)+) => {
        &[$($crate::rule::Rule {
            when: &[$(($when, $crate::rule::Test::$test $((&[$($word),+]))?)),+],
            keys: &[$($key),+],
            then: $crate::rule::Test::$then $((&[$($value),+]))?,
            message: $message,
        }),+]
    };
}
pub(super) use rules;

impl Test {
    /// Whether a missing key fails.
    const fn needs_key(self) -> bool {
        matches!(self, Self::Given | Self::Is(_) | Self::IsNot(_))
    }

    fn holds(self, value: Option<&TomlNode>) -> bool {
        match (self, value) {
            (_, None) => !self.needs_key(),
            (Self::Given, _) => true,
            (Self::Missing, _) => false,
            (Self::Is(words) | Self::MissingOr(words), Some(node)) => is_one_of(node, words),
            (Self::IsNot(words) | Self::MissingOrNot(words), Some(node)) => !is_one_of(node, words),
        }
    }

    /// The schema of a value that passes.
    fn schema(self) -> Json {
        // A word that is valid JSON is a number, true or false
        let value = |word: &&str| serde_json::from_str(word).unwrap_or_else(|_| json!(word));
        let values = |words: &[&str]| words.iter().map(value).collect::<Vec<Json>>();
        match self {
            Self::Given => json!(true),
            Self::Missing => json!(false),
            Self::Is(words) | Self::MissingOr(words) => json!({ "enum": values(words) }),
            Self::IsNot(words) | Self::MissingOrNot(words) => {
                json!({ "not": { "enum": values(words) } })
            }
        }
    }

    /// The schema of a table whose `key` passes.
    fn schema_of_table(self, key: &str) -> Json {
        let (name, value) = match key.split_once('.') {
            Some((table, rest)) => (table, self.schema_of_table(rest)),
            None => (key, self.schema()),
        };
        let mut table = json!({ "properties": { name: value } });
        if self.needs_key() {
            table["required"] = json!([name]);
        }
        table
    }
}

fn is_one_of(node: &TomlNode, words: &[&str]) -> bool {
    words.iter().any(|word| match &node.kind {
        Kind::Text(text) => text == word,
        Kind::Integer(i) => word.parse() == Ok(*i),
        Kind::Float(f) => word.parse() == Ok(*f),
        Kind::Bool(b) => word.parse() == Ok(*b),
        Kind::Array(_) | Kind::Table(_) | Kind::Other => false,
    })
}

impl Section<'_> {
    /// Reports each key that breaks one of `rules`, once. Keys whose values are invalid are not considered.
    pub(super) fn check(&self, rules: &[Rule]) {
        for rule in rules {
            let passes =
                |(key, test): &(&str, Test)| !self.has_problem(key) && test.holds(self.value(key));
            if !rule.when.iter().all(passes) {
                continue;
            }
            for key in rule.keys.iter().filter(|key| !self.has_problem(key)) {
                match self.value(key) {
                    value if rule.then.holds(value) => {}
                    Some(_) => self.wrong(key, rule.message),
                    None => self.missing(key, rule.message),
                }
            }
        }
    }
}

/// The conditions for tables that obey `rules`, as a list for `allOf`.
pub(super) fn conditions(rules: &[Rule]) -> Json {
    let condition = |rule: &Rule| {
        let when = rule.when.iter().map(|(key, test)| test.schema_of_table(key));
        let then = rule.keys.iter().map(|key| rule.then.schema_of_table(key));
        json!({ "if": all_of(when.collect()), "then": all_of(then.collect()) })
    };
    rules.iter().map(condition).collect()
}

fn all_of(mut schemas: Vec<Json>) -> Json {
    match schemas.len() {
        1 => schemas.remove(0),
        _ => json!({ "allOf": schemas }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{camera, check, color, environment, ground, input, job_schema, mesh, work};

    /// All rules, with the table whose keys they name, in the schema.
    const ALL: [(&str, &[Rule]); 8] = [
        ("", check::RULES),
        ("/properties/camera", camera::RULES),
        ("/properties/environment", environment::RULES),
        ("/properties/job", work::RULES),
        ("/properties/mesh/items", mesh::RULES),
        ("/properties/material/properties/color/anyOf/2", color::RULES),
        ("/properties/input/properties/radius/anyOf/2", input::RULES),
        ("/properties/render/properties/ground/anyOf/3", ground::RULES),
    ];

    /// Keys that have another value than their default if other keys are given.
    const DEPENDENT: [&str; 2] = ["/properties/camera/mode", "/properties/environment/type"];

    // For each value that a rule names, the whole schema is made and compiled again.
    #[test]
    fn rules_name_keys_values_and_defaults() {
        let schema = job_schema();
        for (table, rules) in ALL {
            assert_eq!(schema.pointer(table).unwrap()["allOf"], conditions(rules), "{table}");
            let tests = rules.iter().flat_map(|rule| {
                rule.when.iter().copied().chain(rule.keys.iter().map(|key| (*key, rule.then)))
            });
            for (key, test) in tests {
                let at = format!("{table}/properties/{}", key.replace('.', "/properties/"));
                let property = schema.pointer(&at).expect(&at);
                // The values are values of the key
                let is_valid = |schema: &Json, value: &Json| {
                    let mut schema = schema.clone();
                    schema["$defs"] = job_schema()["$defs"].clone();
                    jsonschema::is_valid(&schema, value)
                };
                let passing = test.schema();
                let values = [passing.get("enum"), passing.pointer("/not/enum")];
                for value in values.into_iter().flatten().flat_map(|v| v.as_array().unwrap()) {
                    assert!(is_valid(property, value), "{at}: {value}");
                }
                // A missing key passes if and only if its default does
                if let (Some(default), Some(_)) = (property.get("default"), passing.as_object())
                    && !DEPENDENT.contains(&&*format!("{table}/{key}"))
                {
                    assert_eq!(is_valid(&passing, default), !test.needs_key(), "{at}");
                }
            }
        }
    }
}
