//! Wording of counts in messages.

use std::fmt::Display;

/// `3 frames`, but `1 frame`.
pub fn counted<N: Display + PartialEq + From<u8>>(count: N, what: &str) -> String {
    let plural = if count == N::from(1) { "" } else { "s" };
    format!("{count} {what}{plural}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn single_things_have_no_plural() {
        assert_eq!(counted(1_usize, "column"), "1 column");
        assert_eq!(counted(2_u64, "column"), "2 columns");
        assert_eq!(counted(0_u32, "column"), "0 columns");
    }
}
