//! Quotes texts for scripts and templates, and rejects what they cannot contain.

use std::borrow::Cow;

use super::ExportError;

/// Rejects line breaks: a path with one could become a command or a key of its own.
pub(super) fn one_line<'a>(what: &'static str, text: &'a str) -> Result<&'a str, ExportError> {
    // In YAML the Unicode line and paragraph separators are line breaks too
    let breaks = |c: char| c.is_control() || matches!(c, '\u{2028}' | '\u{2029}' | '\u{feff}');
    match text.chars().find(|c| breaks(*c)) {
        None => Ok(text),
        Some(found) => Err(ExportError::text(
            what,
            text,
            format!("has a line break or control character ({found:?}); rename it"),
        )),
    }
}

/// Quotes `text` as one word of a POSIX shell.
pub(super) fn shell_word<'a>(
    what: &'static str,
    text: &'a str,
) -> Result<Cow<'a, str>, ExportError> {
    let text = one_line(what, text)?;
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "/._-+,:@%=".contains(c);
    // A leading `=` would make the word an assignment
    if !text.is_empty() && !text.starts_with('=') && text.chars().all(is_plain) {
        return Ok(Cow::Borrowed(text));
    }
    Ok(Cow::Owned(format!("'{}'", text.replace('\'', r"'\''"))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words() {
        let word = |text| shell_word("path", text).unwrap();
        assert_eq!(word("/data/run_1/job.toml"), "/data/run_1/job.toml");
        assert_eq!(word(""), "''");
        assert_eq!(word("a b"), "'a b'");
        assert_eq!(word("it's"), r"'it'\''s'");
        assert_eq!(word("$HOME `x` \\ \"~"), "'$HOME `x` \\ \"~'");
        assert_eq!(word("größe"), "'größe'");
    }

    #[test]
    fn line_breaks_are_rejected() {
        for text in ["a\nb", "a\rb", "a\0b", "a\tb", "\u{85}", "\u{2028}", "\u{1b}[0m"] {
            let error = shell_word("manifest", text).unwrap_err().to_string();
            assert!(error.starts_with("manifest: "), "{error}");
            assert!(!error.contains(char::is_control), "{error:?}");
        }
    }
}
