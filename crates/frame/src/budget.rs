//! Memory limit for reading one file.
//!
//! A file of a few hundred kilobytes can expand to gigabytes: as gzip, as a member of an archive, as a block of
//! VTK XML, or as text of short numbers. The caller sets the limit. A file that needs more fails with an error
//! that names it, before the memory is allocated.

use crate::ParseError;

/// The memory that one file may use while it is read: the part of the file that is in memory, and the decoded
/// numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MemoryBudget {
    bytes: u64,
    remedy: &'static str,
}

impl MemoryBudget {
    /// No limit except that of the machine.
    pub const UNLIMITED: Self = Self::new(u64::MAX, "free some memory");

    /// A budget of `bytes`. Error messages end with `remedy`, for example `raise the limit`.
    pub const fn new(bytes: u64, remedy: &'static str) -> Self {
        Self { bytes, remedy }
    }

    /// The limit in bytes.
    pub const fn bytes(self) -> u64 {
        self.bytes
    }

    /// The same budget, limited to `bytes`.
    #[must_use]
    pub fn at_least(self, bytes: u64) -> Self {
        Self { bytes: self.bytes.max(bytes), ..self }
    }

    /// The budget minus `held` bytes.
    pub const fn less(self, held: u64) -> Self {
        Self { bytes: self.bytes.saturating_sub(held), ..self }
    }

    /// The share for the bytes of a file that must be in memory as a whole. The other half is for the numbers.
    pub const fn for_content(self) -> Self {
        Self { bytes: self.bytes / 2, ..self }
    }

    /// Checks that the budget allows `need` bytes. `what` begins the message, for example `decompressed it is`.
    ///
    /// # Errors
    /// [`ParseError::TooLarge`].
    pub fn check(self, need: u64, what: &str) -> Result<(), ParseError> {
        if need <= self.bytes { Ok(()) } else { Err(self.exceeded(what)) }
    }

    /// The error for a file that needs more than the budget.
    pub fn exceeded(self, what: &str) -> ParseError {
        let limit = match self.bytes >> 20 {
            0 => format!("{} bytes", self.bytes),
            mebibytes => format!("{mebibytes} MiB"),
        };
        ParseError::too_large(format!("{what} larger than {limit}; {}", self.remedy))
    }
}

impl Default for MemoryBudget {
    fn default() -> Self {
        Self::UNLIMITED
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn remaining_time_has_readable_units() {
        let budget = MemoryBudget::new(64 << 20, "raise the limit");
        assert_eq!(budget.check(64 << 20, "it is"), Ok(()));
        let error = |budget: MemoryBudget| budget.check(u64::MAX, "it is").unwrap_err().to_string();
        assert_eq!(error(budget), "it is larger than 64 MiB; raise the limit");
        assert_eq!(error(budget.for_content()), "it is larger than 32 MiB; raise the limit");
        let little = budget.less((64 << 20) - 5);
        assert_eq!(error(little), "it is larger than 5 bytes; raise the limit");
        assert_eq!(budget.less(u64::MAX).bytes(), 0);
        assert_eq!(MemoryBudget::default().check(u64::MAX, ""), Ok(()));
    }
}
