//! What the layouts of groups and data sets of different programs have in common.

use super::table::ParticleTable;
use spherule_frame::{MemoryBudget, ParseError};
use spherule_readers::ValueNames;

/// A time step as its dialect lists it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct StepInfo {
    pub(super) number: Option<i64>,
    /// Simulation time, if it is cheap to find.
    pub(super) time: Option<f64>,
}

/// The particles of a file, by its layout.
pub(super) trait Dialect {
    /// The time steps.
    ///
    /// # Errors
    /// [`ParseError`] if the file is damaged.
    fn steps(&self, budget: MemoryBudget) -> Result<Vec<StepInfo>, ParseError>;

    /// The particles of the step at this index.
    ///
    /// # Errors
    /// [`ParseError`] if the file is damaged, or has no such step.
    fn table(&self, step: usize, budget: MemoryBudget) -> Result<ParticleTable, ParseError>;

    /// What users should know: the layout and its version first, then parts and units.
    fn notes(&self) -> Vec<String>;

    /// Names behind the numbers of attributes, beside those of parts.
    fn value_names(&self) -> Vec<ValueNames> {
        Vec::new()
    }
}

/// The error for a step that the file does not have.
pub(super) fn no_step(step: usize, count: usize) -> ParseError {
    ParseError::malformed(0, format!("step {step} is not among the {count} of the file"))
}

/// A list of names for a note, the first dozen of them.
pub(super) fn listed(names: &[String]) -> String {
    const LISTED: usize = 12;
    let more = match names.len().saturating_sub(LISTED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    format!("{}{more}", names[..names.len().min(LISTED)].join(", "))
}

/// The note that tells the values of the attribute `part`.
pub(super) fn part_names<'a>(names: impl Iterator<Item = (u32, &'a str)>) -> String {
    let names: Vec<String> = names.map(|(value, name)| format!("{value} = {name}")).collect();
    format!("attribute `part` tells parts apart: {}", listed(&names))
}

/// The note that tells units.
pub(super) fn units(units: &[String]) -> Option<String> {
    (!units.is_empty()).then(|| format!("units: {}", listed(units)))
}

/// An integer from an attribute or a small data set, which are read as f64.
pub(super) fn integer(value: f64) -> Option<i64> {
    /// From here on, f64 does not hold all integers.
    const MAX: f64 = 9_007_199_254_740_992.0;
    let is_integer = value.fract() == 0.0 && value.abs() <= MAX;
    #[expect(clippy::cast_possible_truncation, reason = "an integer of up to 53 bits")]
    is_integer.then_some(value as i64)
}
