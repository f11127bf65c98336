//! Escapes text for HTML.

use std::borrow::Cow;

use spherule_files::is_control;

/// Text for elements and quoted attributes of HTML. Control characters, which HTML forbids, and characters that
/// change the direction of text are replaced by escape sequences.
pub(super) fn escaped(text: &str) -> Cow<'_, str> {
    let is_odd = |c: char| is_control(c) && c != '\n' && c != '\t';
    if !text.chars().any(|c| matches!(c, '&' | '<' | '>' | '"' | '\'') || is_odd(c)) {
        return Cow::Borrowed(text);
    }
    let mut html = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match c {
            '&' => html += "&amp;",
            '<' => html += "&lt;",
            '>' => html += "&gt;",
            '"' => html += "&quot;",
            '\'' => html += "&#39;",
            c if is_odd(c) => html.extend(c.escape_unicode()),
            c => html.push(c),
        }
    }
    Cow::Owned(html)
}
