//! The words and signs of a condition.

use super::error::ConditionError;

/// A word or sign.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Token {
    Number(f64),
    /// A name of a value, or of a function.
    Name(String),
    /// Text in quotes.
    Text(String),
    Sign(&'static str),
}

/// A token and its first character, from 1.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Placed {
    pub(super) token: Token,
    pub(super) column: usize,
}

/// Signs, longer ones before those that they begin with.
const SIGNS: [&str; 18] = [
    "&&", "||", "==", "!=", "<=", ">=", "<", ">", "!", "+", "-", "*", "/", "(", ")", ",", "[", "]",
];

/// Signs of other languages, and what to write instead.
const FOREIGN: [(&str, &str); 4] = [
    ("**", "multiply instead"),
    ("&", "write &&"),
    ("|", "write ||"),
    ("=", "write == to compare"),
];

/// Splits `text` into tokens.
pub(super) fn tokens(text: &str) -> Result<Vec<Placed>, ConditionError> {
    let mut tokens = Vec::new();
    let (mut rest, mut column) = (text, 1);
    while let Some(first) = rest.chars().next() {
        let start = rest;
        if first.is_whitespace() {
            rest = &rest[first.len_utf8()..];
        } else {
            let fail = |what: String| ConditionError { column, what };
            let (token, after) = token(rest, first).map_err(fail)?;
            tokens.push(Placed { token, column });
            rest = after;
        }
        column += start[..start.len() - rest.len()].chars().count();
    }
    Ok(tokens)
}

/// The token at the start of `text`, and the text after it.
fn token(text: &str, first: char) -> Result<(Token, &str), String> {
    // Numbers, names and texts show by their first character
    if first.is_ascii_digit() || first == '.' {
        return number(text);
    }
    if is_name(first) || first == '`' {
        return name(text);
    }
    if let Some(rest) = text.strip_prefix(['"', '\'']) {
        let (quoted, rest) = rest.split_once(first).ok_or("a quote has no second one")?;
        return Ok((Token::Text(quoted.to_owned()), rest));
    }
    // Signs of other languages get a hint, unless they begin a longer sign of this one
    let foreign = FOREIGN.iter().find(|(sign, _)| text.starts_with(sign));
    let sign = SIGNS.iter().find(|sign| text.starts_with(**sign));
    match (sign, foreign) {
        (Some(sign), None) => Ok((Token::Sign(sign), &text[sign.len()..])),
        (Some(sign), Some((other, _))) if sign.len() > other.len() => {
            Ok((Token::Sign(sign), &text[sign.len()..]))
        }
        (_, Some((other, remedy))) => {
            Err(format!("`{other}` is not a sign of conditions: {remedy}"))
        }
        (None, None) => Err(format!("unexpected character `{}`", first.escape_debug())),
    }
}

fn number(text: &str) -> Result<(Token, &str), String> {
    let bytes = text.as_bytes();
    let digits = |from: usize| bytes[from..].iter().take_while(|b| b.is_ascii_digit()).count();
    let mut end = digits(0);
    if bytes.get(end) == Some(&b'.') {
        end += 1 + digits(end + 1);
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
        let exponent = digits((end + 1 + sign).min(bytes.len()));
        if exponent > 0 {
            end += 1 + sign + exponent;
        }
    }
    let (shown, rest) = text.split_at(end);
    match shown.parse::<f64>() {
        Ok(value) if value.is_finite() => Ok((Token::Number(value), rest)),
        _ => Err(format!("`{shown}` is not a finite number")),
    }
}

fn is_name(c: char) -> bool {
    c.is_alphabetic() || c == '_'
}

/// A name with its component: `velocity`, `velocity.x`, `` `total energy` ``. Brackets are read by the parser.
fn name(text: &str) -> Result<(Token, &str), String> {
    let is_part = |c: char| is_name(c) || c.is_numeric() || c == '.';
    if let Some(quoted) = text.strip_prefix('`') {
        let (name, rest) = quoted.split_once('`').ok_or("a backquote has no second one")?;
        let end = if rest.starts_with('.') {
            rest.find(|c| !is_part(c)).unwrap_or(rest.len())
        } else {
            0
        };
        let name = format!("{name}{}", &rest[..end]);
        return Ok((Token::Name(name), &rest[end..]));
    }
    let end = text.find(|c| !is_part(c)).unwrap_or(text.len());
    Ok((Token::Name(text[..end].to_owned()), &text[end..]))
}
