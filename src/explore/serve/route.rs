//! What is served under which path.

use std::time::Duration;

use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use super::Service;
use crate::explore::error::{ExploreError, Fault};
use crate::explore::save::SaveError;
use crate::explore::shared::PageId;
use crate::explore::wish::{Setting, Wish};
use crate::manifest::job_schema;

/// The files of the page.
const FILES: [(&str, &str, &str); 6] = [
    ("", "text/html; charset=utf-8", include_str!("../page/index.html")),
    ("page.css", "text/css; charset=utf-8", include_str!("../page/page.css")),
    ("handles.js", "text/javascript; charset=utf-8", include_str!("../page/handles.js")),
    ("placed.js", "text/javascript; charset=utf-8", include_str!("../page/placed.js")),
    ("lists.js", "text/javascript; charset=utf-8", include_str!("../page/lists.js")),
    ("page.js", "text/javascript; charset=utf-8", include_str!("../page/page.js")),
];

/// How long a page waits for its next picture before it asks again.
const PATIENCE: Duration = Duration::from_secs(20);

/// An answer.
pub(super) struct Reply {
    pub(super) status: u16,
    pub(super) mime: &'static str,
    pub(super) headers: Vec<(&'static str, String)>,
    pub(super) bytes: Vec<u8>,
}

impl Reply {
    /// A refusal with its reason.
    pub(super) fn refused(status: u16, why: &str) -> Self {
        let bytes = format!("{why}\n").into_bytes();
        Self { status, mime: "text/plain; charset=utf-8", headers: Vec::new(), bytes }
    }

    fn json(value: &Value) -> Self {
        let bytes = value.to_string().into_bytes();
        Self { status: 200, mime: "application/json", headers: Vec::new(), bytes }
    }

    /// Why a request has failed, for its place on the page.
    fn fault(fault: &Fault) -> Self {
        let reply = Self::json(&json!({ "fault": fault }));
        Self { status: 422, ..reply }
    }
}

/// A wish with its page.
#[derive(Deserialize)]
struct PageWish {
    page: PageId,
    wish: Wish,
}

/// Settings, and the name of a file for them.
#[derive(Deserialize)]
struct Save {
    #[serde(default)]
    frame: i64,
    settings: Vec<Setting>,
    #[serde(default)]
    name: String,
}

/// The answer to the request for `path`, without the token.
pub(super) fn reply(service: &Service, is_post: bool, path: &str, body: &[u8]) -> Reply {
    let (path, query) = path.split_once('?').unwrap_or((path, ""));
    let explorer = &service.explorer;
    if !is_post && let Some((_, mime, text)) = FILES.iter().find(|(name, ..)| *name == path) {
        let bytes = text.as_bytes().to_vec();
        return Reply { status: 200, mime, headers: Vec::new(), bytes };
    }
    match (is_post, path) {
        (false, "start") => Reply::json(&start(service)),
        (false, "chosen") => Reply::json(&chosen(service)),
        (false, "picture") => picture(service, query),
        (false, "particle") => particle(service, query),
        (false, "histogram") => {
            let (frame, name) = (number(query, "frame"), text(query, "name"));
            let (Some(frame), Some(name)) = (frame, name) else {
                return Reply::refused(400, "frame and name are needed");
            };
            shown(explorer.histogram(frame, name))
        }
        (false, "names") => match number(query, "frame") {
            Some(frame) => shown(explorer.names(frame)),
            None => Reply::refused(400, "a frame is needed"),
        },
        (true, "wish") => read(body, |PageWish { page, wish }| {
            Reply::json(&json!({ "wish": explorer.wish(page, wish) }))
        }),
        (true, "values") => read(body, |save: Save| {
            let found = explorer.values(save.settings);
            shown(found)
        }),
        (true, "manifest") => read(body, |save: Save| saved(explorer.manifest(save.settings))),
        (true, "save") => read(body, |save: Save| {
            saved(explorer.save_manifest(save.settings, &save.name, &service.files))
        }),
        (true, "save-picture") => read(body, |save: Save| {
            let wish = Wish { frame: save.frame, settings: save.settings, is_moving: false };
            saved(explorer.save_picture(wish, &save.name, &service.files))
        }),
        (true, "render") => read(body, |save: Save| {
            let Save { settings, name, .. } = save;
            saved(explorer.start_job(settings, &name, &service.files, &service.program))
        }),
        (true, "progress") => read(body, |save: Save| saved(explorer.job_progress(save.settings))),
        _ => Reply::refused(404, "there is nothing under this address"),
    }
}

/// What a page needs at its start.
fn start(service: &Service) -> Value {
    json!({
        "title": service.title,
        "frames": service.frames,
        "schema": job_schema(),
        "version": env!("CARGO_PKG_VERSION"),
    })
}

/// What was chosen on the page that was used last, and the view of its picture, for other programs.
fn chosen(service: &Service) -> Value {
    let Some((wish, answer)) = service.explorer.newest() else {
        return Value::Null;
    };
    let shown = answer.as_ref().and_then(|answer| answer.result.as_ref().ok());
    let view = shown.map(|shown| &shown.facts["view"]);
    json!({ "frame": wish.frame, "settings": wish.settings, "view": view })
}

/// The next picture of a page: its facts in a header, and its file.
fn picture(service: &Service, query: &str) -> Reply {
    let (page, after) = (number(query, "page"), number(query, "after"));
    let (Some(page), Some(after)) = (page, after) else {
        return Reply::refused(400, "page and after are needed");
    };
    let Some(answer) = service.explorer.answer(page, after, PATIENCE) else {
        return Reply { status: 204, ..Reply::json(&Value::Null) };
    };
    let about =
        |facts: &Value| json!({ "number": answer.number, "wish": answer.wish, "facts": facts });
    match &answer.result {
        Ok(shown) => Reply {
            status: 200,
            mime: shown.mime,
            headers: vec![("X-Picture", ascii(&about(&shown.facts)))],
            bytes: shown.bytes.clone(),
        },
        Err(fault) => Reply::json(&json!({
            "number": answer.number, "wish": answer.wish, "fault": fault,
        })),
    }
}

/// The particle at a place of the picture.
fn particle(service: &Service, query: &str) -> Reply {
    let place = number(query, "page").zip(number(query, "x").zip(number(query, "y")));
    let Some((page, (x, y))) = place else {
        return Reply::refused(400, "page, x and y are needed");
    };
    let explorer = &service.explorer;
    let Some((id, point)) = explorer.under(page, [x, y]) else {
        return Reply::json(&Value::Null);
    };
    // Its values only if they are asked for: reading them may take long
    if text(query, "values").is_none() {
        return Reply::json(&json!({ "id": id, "point": point }));
    }
    let Some(wish) = explorer.wish_of(page) else {
        return Reply::json(&Value::Null);
    };
    match explorer.particle(wish.frame, id) {
        Some(Ok(values)) => Reply::json(&json!({ "id": id, "point": point, "values": values })),
        Some(Err(error)) => Reply::fault(&error.fault()),
        None => Reply::refused(503, "the program is ending"),
    }
}

/// The answer to a question for the thread that renders.
fn shown<T: serde::Serialize>(found: Option<Result<T, ExploreError>>) -> Reply {
    match found {
        Some(Ok(value)) => Reply::json(&json!(value)),
        Some(Err(error)) => Reply::fault(&error.fault()),
        None => Reply::refused(503, "the program is ending"),
    }
}

fn saved<T: serde::Serialize>(made: Result<T, SaveError>) -> Reply {
    match made {
        Ok(value) => Reply::json(&json!(value)),
        Err(SaveError::Explore(error)) => Reply::fault(&error.fault()),
        Err(error) => Reply::fault(&Fault { message: error.to_string(), key: None }),
    }
}

/// Answers a request with a JSON `body`.
fn read<T: DeserializeOwned>(body: &[u8], answer: impl FnOnce(T) -> Reply) -> Reply {
    match serde_json::from_slice(body) {
        Ok(value) => answer(value),
        Err(error) => Reply::refused(400, &format!("the request is malformed: {error}")),
    }
}

/// The value of `name` in a query, decoded.
fn text(query: &str, name: &str) -> Option<String> {
    let mut pairs = query.split('&').filter_map(|pair| pair.split_once('='));
    let (_, value) = pairs.find(|(own, _)| *own == name)?;
    let mut bytes = Vec::new();
    let mut rest = value.bytes();
    while let Some(byte) = rest.next() {
        bytes.push(match byte {
            b'%' => {
                let mut digit = || char::from(rest.next()?).to_digit(16);
                u8::try_from(digit()? * 16 + digit()?).ok()?
            }
            b'+' => b' ',
            byte => byte,
        });
    }
    String::from_utf8(bytes).ok()
}

fn number<T: std::str::FromStr>(query: &str, name: &str) -> Option<T> {
    text(query, name)?.parse().ok()
}

/// JSON as ASCII, as headers need it.
fn ascii(value: &Value) -> String {
    let mut text = String::new();
    for c in value.to_string().chars() {
        if c.is_ascii() {
            text.push(c);
            continue;
        }
        let mut units = [0; 2];
        for unit in c.encode_utf16(&mut units) {
            text += &format!("\\u{unit:04x}");
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn queries_are_decoded() {
        let query = "page=3&name=a%20b%26c+d&x=0.5";
        assert_eq!(text(query, "name").as_deref(), Some("a b&c d"));
        assert_eq!(number::<f64>(query, "x"), Some(0.5));
        assert_eq!(number::<u64>(query, "page"), Some(3));
        for bad in ["name=%", "name=%4", "name=%zz", "name=%ff", "names=1", ""] {
            assert_eq!(text(bad, "name"), None, "{bad}");
        }
    }

    #[test]
    fn headers_are_ascii() {
        let text = ascii(&json!({ "a": "\u{e9}\n\u{1f600}" }));
        assert_eq!(text, r#"{"a":"\u00e9\n\ud83d\ude00"}"#);
        assert_eq!(serde_json::from_str::<Value>(&text).expect("JSON")["a"], "\u{e9}\n\u{1f600}");
    }
}
