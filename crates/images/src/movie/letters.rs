//! Letters of panels: (a), (b) and so on.

use std::fmt;
use std::str::FromStr;

/// How pictures are numbered: `(a)`, `a`, `A)`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LetterStyle {
    before: String,
    is_capital: bool,
    after: String,
}

/// A text is no [`LetterStyle`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LetterStyleError(String);

impl fmt::Display for LetterStyleError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "`{}` is no style of letters; examples: (a), a, a), A, (A)", self.0)
    }
}

impl std::error::Error for LetterStyleError {}

impl FromStr for LetterStyle {
    type Err = LetterStyleError;

    fn from_str(text: &str) -> Result<Self, LetterStyleError> {
        let lower = text.split_once('a').map(|parts| (parts, false));
        let parts = lower.or_else(|| text.split_once('A').map(|parts| (parts, true)));
        let is_mark = |c: char| "()[]<>.:,-/ ".contains(c);
        let is_good = |part: &str| part.len() <= 2 && part.chars().all(is_mark);
        match parts {
            Some(((before, after), is_capital)) if is_good(before) && is_good(after) => {
                Ok(Self { before: before.to_owned(), is_capital, after: after.to_owned() })
            }
            _ => Err(LetterStyleError(text.to_owned())),
        }
    }
}

impl LetterStyle {
    /// The letters of picture number `index`: a to z, then aa, ab and so on.
    pub fn of(&self, index: usize) -> String {
        let first = if self.is_capital { b'A' } else { b'a' };
        let mut letters = Vec::new();
        let mut rest = index + 1;
        while rest > 0 {
            rest -= 1;
            let digit = u8::try_from(rest % 26).unwrap_or(0);
            letters.push(char::from(first + digit));
            rest /= 26;
        }
        let letters: String = letters.into_iter().rev().collect();
        format!("{}{letters}{}", self.before, self.after)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_go_on_after_z() {
        let style: LetterStyle = "(a)".parse().unwrap();
        let all: Vec<String> = [0, 1, 25, 26, 27, 29, 701, 702].map(|i| style.of(i)).into();
        assert_eq!(all, ["(a)", "(b)", "(z)", "(aa)", "(ab)", "(ad)", "(zz)", "(aaa)"]);
        let capital: LetterStyle = "A.".parse().unwrap();
        assert_eq!(capital.of(3), "D.");
        for wrong in ["", "b", "{a}", "abc", "a a", "(((a)", "1"] {
            assert!(wrong.parse::<LetterStyle>().is_err(), "{wrong}");
        }
    }
}
