//! File name patterns: `dump.#.vtk`, `frame_####.bgeo`, `%04d`, `*`, `?`.
//!
//! `#` (any number of them) and `%d` stand for the frame number, however many digits it has:
//! padding differs between tools, and between frame 9999 and 10000 of the same tool. `*` is any
//! text, `?` any one character. Wildcards work in the file name only, not in directories.

use std::collections::HashSet;
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::SequenceError;
use super::name::sign_may_follow;

/// A parsed pattern.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Pattern {
    /// Where the files are.
    pub directory: PathBuf,
    tokens: Vec<PatternToken>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum PatternToken {
    Char(char),
    AnyText,
    AnyChar,
    Number,
}

/// A name that fits: where in it the frame number is, if the pattern has one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct PatternMatch {
    pub number: Option<Range<usize>>,
}

impl Pattern {
    /// Takes `text` apart.
    pub(super) fn parse(text: &Path) -> Result<Self, SequenceError> {
        let bad = |what: &str| SequenceError::BadPattern {
            pattern: text.display().to_string(),
            what: what.to_owned(),
        };
        let name = text.file_name().ok_or_else(|| bad("a pattern needs a file name at its end"))?;
        let directory = match text.parent() {
            Some(parent) if parent != Path::new("") => parent.to_owned(),
            _ => PathBuf::from("."),
        };
        if !directory.exists() && has_wildcards(&directory) {
            return Err(bad("wildcards work in the file name only; give one directory at a time"));
        }
        let tokens = tokens(&name.to_string_lossy());
        if tokens.iter().filter(|t| **t == PatternToken::Number).count() > 1 {
            return Err(bad("only one # can be the frame number; write * for the other numbers"));
        }
        Ok(Self { directory, tokens })
    }

    /// Fits the pattern to a whole file name.
    pub(super) fn fit(&self, name: &str) -> Option<PatternMatch> {
        let mut search =
            PatternSearch { name, fit: PatternMatch { number: None }, dead_ends: HashSet::new() };
        search.fits(&self.tokens, 0).then_some(search.fit)
    }
}

/// True if the file name of `path` has something that stands for other text.
pub(super) fn has_wildcards(path: &Path) -> bool {
    path.components().any(|component| {
        tokens(&component.as_os_str().to_string_lossy())
            .iter()
            .any(|t| !matches!(t, PatternToken::Char(_)))
    })
}

fn tokens(text: &str) -> Vec<PatternToken> {
    let mut tokens = Vec::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let (token, len) = match first {
            '#' => (PatternToken::Number, rest.len() - rest.trim_start_matches('#').len()),
            '*' => (PatternToken::AnyText, rest.len() - rest.trim_start_matches('*').len()),
            '?' => (PatternToken::AnyChar, 1),
            '%' => match printf_len(rest) {
                Some(len) => (PatternToken::Number, len),
                None => (PatternToken::Char('%'), 1),
            },
            other => (PatternToken::Char(other), other.len_utf8()),
        };
        tokens.push(token);
        rest = &rest[len..];
    }
    tokens
}

/// Length of `%d`, `%4d` or `%04d` at the start of `text`.
fn printf_len(text: &str) -> Option<usize> {
    let rest = text.strip_prefix('%')?;
    let width = rest.bytes().take_while(u8::is_ascii_digit).count();
    rest[width..].starts_with('d').then_some(width + 2)
}

/// A name under way to its fit.
struct PatternSearch<'a> {
    name: &'a str,
    fit: PatternMatch,
    /// Remaining tokens and offset in the name of what does not match. Each is tried once: without that, a pattern with
    /// many `*` would take time that grows exponentially.
    dead_ends: HashSet<(usize, usize)>,
}

impl PatternSearch<'_> {
    /// Backtracking match: `*` takes as little as it can, a number as much as it can.
    fn fits(&mut self, tokens: &[PatternToken], at: usize) -> bool {
        let rest = &self.name[at..];
        let Some((token, left)) = tokens.split_first() else {
            return rest.is_empty();
        };
        let next = rest.chars().next();
        match token {
            PatternToken::Char(c) => next == Some(*c) && self.fits(left, at + c.len_utf8()),
            PatternToken::AnyChar => next.is_some_and(|c| self.fits(left, at + c.len_utf8())),
            PatternToken::AnyText if left.is_empty() => true,
            PatternToken::AnyText => {
                // Try each place only once for the same tokens, or long names would take exponential time
                if !self.dead_ends.insert((tokens.len(), at)) {
                    return false;
                }
                let places = rest.char_indices().map(|(i, _)| i).chain([rest.len()]);
                places.into_iter().any(|skipped| self.fits(left, at + skipped))
            }
            PatternToken::Number => {
                // Take all digits, with a sign unless it separates words
                let unsigned = match rest.strip_prefix('-') {
                    Some(unsigned) if sign_may_follow(&self.name[..at]) => unsigned,
                    _ => rest,
                };
                let digits = unsigned.bytes().take_while(u8::is_ascii_digit).count();
                let end = at + rest.len() - unsigned.len() + digits;
                if digits == 0 || !self.fits(left, end) {
                    return false;
                }
                self.fit.number = Some(at..end);
                true
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn number(pattern: &str, name: &str) -> Option<Option<String>> {
        let fit = Pattern::parse(Path::new(pattern)).expect("a pattern").fit(name)?;
        Some(fit.number.map(|range| name[range].to_owned()))
    }

    #[test]
    fn numbers_are_found_whatever_their_width() {
        for pattern in ["d_#.vtk", "d_####.vtk", "d_%d.vtk", "d_%04d.vtk"] {
            assert_eq!(number(pattern, "d_7.vtk"), Some(Some("7".into())), "{pattern}");
            assert_eq!(number(pattern, "d_00123.vtk"), Some(Some("00123".into())));
            assert_eq!(number(pattern, "d_.vtk"), None);
            assert_eq!(number(pattern, "d_7.vtk.gz"), None);
        }
    }

    #[test]
    fn a_number_may_have_a_sign_after_a_separator() {
        assert_eq!(number("d_#.vtk", "d_-07.vtk"), Some(Some("-07".into())));
        assert_eq!(number("*#.vtk", "d_-7.vtk"), Some(Some("-7".into())));
        assert_eq!(number("d_-#.vtk", "d_-7.vtk"), Some(Some("7".into())));
        assert_eq!(number("d#.vtk", "d-7.vtk"), None);
        assert_eq!(number("d_#.vtk", "d_-.vtk"), None);
    }

    #[test]
    fn wildcards_take_any_text() {
        assert_eq!(number("dump.*", "dump.drop.250"), Some(None));
        assert_eq!(number("d_?.vtk", "d_7.vtk"), Some(None));
        assert_eq!(number("d_?.vtk", "d_17.vtk"), None);
        assert_eq!(number("*#.vtk", "a_123.vtk"), Some(Some("123".into())));
        let name = "dam_break_frame_23_24389_particles.bgeo";
        assert_eq!(number("dam_*_#_*_particles.bgeo", name), Some(Some("23".into())));
        assert_eq!(number("100%.vtk", "100%.vtk"), Some(None));
    }

    #[test]
    fn many_wildcards_match_in_linear_time() {
        let name = "a".repeat(250);
        let pattern = "*a?".repeat(80);
        assert_eq!(number(&(pattern.clone() + "b"), &name), None);
        assert_eq!(number(&(pattern + "*"), &name), Some(None));
        let digits = "7".repeat(250);
        assert_eq!(number(&("*7".repeat(80) + "#.vtk"), &digits), None);
        // Longer than any name, and than a stack of calls.
        assert_eq!(number(&"?".repeat(200_000), &name), None);
        assert_eq!(number(&"*?".repeat(200_000), &name), None);
    }

    #[test]
    fn useless_patterns_are_rejected() {
        let error =
            |text: &str| Pattern::parse(Path::new(text)).expect_err("no pattern").to_string();
        assert!(error("a_#_#.vtk").contains("only one #"));
        assert!(error("none_*/a_#.vtk").contains("file name only"));
    }
}
