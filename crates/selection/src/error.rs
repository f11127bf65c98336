//! What is wrong with the text of a condition.

/// Why a text is not a condition.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("character {column}: {what}")]
pub struct ConditionError {
    /// Position, in characters from 1.
    pub column: usize,
    /// What is wrong, and the remedy.
    pub what: String,
}
