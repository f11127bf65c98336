//! Errors of columns that a user names.

use crate::Attribute;

/// Why columns have no orientations or sizes.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum GrainColumnError {
    /// There is no such column.
    #[error("no column `{name}`; {}", remedy(nearest.as_deref(), columns))]
    Unknown {
        /// What was asked for.
        name: String,
        /// The column with the nearest name, if one is similar.
        nearest: Option<String>,
        /// Names of the columns that there are, up to twelve.
        columns: Vec<String>,
    },
    /// Columns have another number of components.
    #[error("{what} needs {expected} numbers, but {} {}", columns.join(", "), has(columns, *found))]
    Components {
        /// What the columns are for.
        what: &'static str,
        /// The numbers that it may have, in words.
        expected: String,
        /// The number that they have.
        found: usize,
        /// Their names.
        columns: Vec<String>,
    },
}

/// How many columns a message lists.
const MAX_LISTED: usize = 12;

impl GrainColumnError {
    /// No attribute has the `name`.
    pub(super) fn unknown(name: &str, attributes: &[Attribute]) -> Self {
        let names = || attributes.iter().map(|attribute| attribute.name.as_str());
        // The component of a vector is not part of the name
        let stem = name.split(['.', '[']).next().unwrap_or(name).to_lowercase();
        let distance = |known: &&str| strsim::damerau_levenshtein(&stem, &known.to_lowercase());
        let limit = |known: &str| (stem.chars().count().max(known.chars().count()) / 3).max(1);
        let best = names().min_by_key(distance);
        Self::Unknown {
            name: name.to_owned(),
            nearest: best.filter(|best| distance(best) <= limit(best)).map(str::to_owned),
            columns: names().take(MAX_LISTED).map(str::to_owned).collect(),
        }
    }
}

fn remedy(nearest: Option<&str>, columns: &[String]) -> String {
    match nearest {
        Some(nearest) => format!("did you mean `{nearest}`?"),
        None if columns.is_empty() => "the frame has no columns".to_owned(),
        None => format!("columns are {}", columns.join(", ")),
    }
}

fn has(columns: &[String], found: usize) -> String {
    if columns.len() == 1 { format!("has {found}") } else { format!("have {found}") }
}
