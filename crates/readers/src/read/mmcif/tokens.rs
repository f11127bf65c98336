//! The values in the lines of a CIF file.

/// A word or a quoted value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Token<'a> {
    pub(super) text: &'a [u8],
    /// Place in the line.
    pub(super) at: usize,
    pub(super) is_quoted: bool,
}

impl Token<'_> {
    /// Whether the token ends the rows of a loop: a name, or a keyword.
    pub(super) fn ends_loop(&self) -> bool {
        let begins = |keyword: &[u8]| {
            let head = self.text.get(..keyword.len());
            head.is_some_and(|head| head.eq_ignore_ascii_case(keyword))
        };
        !self.is_quoted
            && (self.text.starts_with(b"_")
                || [&b"loop_"[..], b"data_", b"save_", b"stop_", b"global_"]
                    .into_iter()
                    .any(begins))
    }
}

/// The token that `line` has at or behind `from`, and where to look for the next one.
pub(super) fn next(line: &[u8], from: usize) -> Option<(Token<'_>, usize)> {
    let rest = line.get(from..)?;
    let at = from + rest.iter().position(|b| !b.is_ascii_whitespace())?;
    let rest = line.get(at..)?;
    let first = *rest.first()?;
    if first == b'#' {
        return None;
    }
    // A quotation mark ends a value only before a blank.
    if matches!(first, b'\'' | b'"') {
        let ends = |i: &usize| rest.get(i + 1).is_none_or(u8::is_ascii_whitespace);
        let end = memchr::memchr_iter(first, rest).skip(1).find(ends);
        if let Some(end) = end {
            let token = Token { text: rest.get(1..end).unwrap_or_default(), at, is_quoted: true };
            return Some((token, at + end + 1));
        }
    }
    let end = rest.iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len());
    let token = Token { text: rest.get(..end).unwrap_or_default(), at, is_quoted: false };
    Some((token, at + end))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(line: &str) -> Vec<(&str, bool)> {
        let mut at = 0;
        std::iter::from_fn(|| {
            let (token, next) = next(line.as_bytes(), at)?;
            at = next;
            Some((std::str::from_utf8(token.text).unwrap(), token.is_quoted))
        })
        .collect()
    }

    #[test]
    fn quotes_end_before_blanks() {
        assert_eq!(
            all("ATOM 'O5'' \"a b\" # note"),
            [("ATOM", false), ("O5'", true), ("a b", true)]
        );
        assert_eq!(all("'open end"), [("'open", false), ("end", false)]);
        assert_eq!(all("  \t"), []);
    }
}
