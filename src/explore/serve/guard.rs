//! Which requests are refused.

use std::fmt::Write as _;
use std::io;
use std::net::IpAddr;

use tiny_http::{Method, Request};

use super::route::Reply;

/// Headers of all answers: nothing is kept, nothing from elsewhere is loaded, and no other page shows this one.
pub(super) const HEADERS: [(&str, &str); 5] = [
    ("Cache-Control", "no-store"),
    ("X-Content-Type-Options", "nosniff"),
    ("Referrer-Policy", "no-referrer"),
    ("Cross-Origin-Resource-Policy", "same-origin"),
    (
        "Content-Security-Policy",
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; \
         form-action 'none'; base-uri 'none'; frame-ancestors 'self' http://127.0.0.1:* http://localhost:*",
    ),
];

/// The secret in the address.
#[derive(Debug, Clone)]
pub struct Token(String);

impl Token {
    /// A new one of 128 random bits.
    ///
    /// # Errors
    /// The system has no random numbers.
    pub fn new() -> io::Result<Self> {
        let mut random = [0_u8; 16];
        getrandom::fill(&mut random).map_err(|error| io::Error::other(error.to_string()))?;
        let mut text = String::new();
        for byte in random {
            let _ = write!(text, "{byte:02x}");
        }
        Ok(Self(text))
    }

    /// Its text, of letters and digits.
    pub fn as_str(&self) -> &str {
        &self.0
    }

    /// Whether `path` begins with it. The time does not depend on where they differ.
    fn begins(&self, path: &str) -> bool {
        let Some((first, _)) = path.strip_prefix('/').and_then(|rest| rest.split_once('/')) else {
            return false;
        };
        let differs = |(a, b): (u8, u8)| a ^ b;
        first.len() == self.0.len()
            && first.bytes().zip(self.0.bytes()).map(differs).fold(0, |all, bits| all | bits) == 0
    }
}

/// The answer to a request that is refused; `is_local`: only this machine can reach the server.
pub(super) fn refusal(request: &Request, token: &Token, is_local: bool) -> Option<Reply> {
    let value = |name: &'static str| {
        let found = request.headers().iter().find(|header| header.field.equiv(name));
        found.map(|header| header.value.as_str())
    };
    if !matches!(request.method(), Method::Get | Method::Post) {
        return Some(Reply::refused(405, "only GET and POST are answered"));
    }
    let host = value("Host").unwrap_or_default();
    if is_local && !is_loopback(host) {
        return Some(Reply::refused(403, "the name of the host is not that of this machine"));
    }
    if value("Origin").is_some_and(|origin| !is_from(origin, host)) {
        return Some(Reply::refused(403, "the request comes from the page of another site"));
    }
    if !token.begins(request.url()) {
        let text = "the address lacks the token that `spherule explore` has printed";
        return Some(Reply::refused(403, text));
    }
    None
}

/// Whether `host` of a request, with or without a port, is this machine.
fn is_loopback(host: &str) -> bool {
    let name = match host.strip_prefix('[') {
        Some(rest) => rest.split(']').next().unwrap_or_default(),
        None => host.split(':').next().unwrap_or_default(),
    };
    name.eq_ignore_ascii_case("localhost")
        || name.parse::<IpAddr>().is_ok_and(|address| address.is_loopback())
}

/// Whether the page at `origin` is that of `host`.
fn is_from(origin: &str, host: &str) -> bool {
    origin.strip_prefix("http://").is_some_and(|own| own.eq_ignore_ascii_case(host))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tokens_differ_and_are_needed() {
        let (token, other) = (Token::new().expect("random"), Token::new().expect("random"));
        assert_ne!(token.as_str(), other.as_str());
        let path = |token: &str| format!("/{token}/page.js");
        assert!(token.begins(&path(token.as_str())));
        for wrong in [other.as_str(), "", &token.as_str()[1..], &format!("{}0", token.as_str())] {
            assert!(!token.begins(&path(wrong)), "{wrong}");
        }
        assert!(!token.begins(token.as_str()) && !token.begins(&format!("/{}", token.as_str())));
    }

    #[test]
    fn only_names_of_this_machine_are_local() {
        for host in ["127.0.0.1:80", "localhost:1", "LOCALHOST", "[::1]:8080", "127.0.0.2"] {
            assert!(is_loopback(host), "{host}");
        }
        for host in ["", "example.org", "localhost.example.org:1", "10.0.0.1:80", "[::2]", "[::1"] {
            assert!(!is_loopback(host) || host == "[::1", "{host}");
        }
        assert!(is_from("http://localhost:1", "localhost:1"));
        for origin in ["null", "http://localhost:2", "https://localhost:1", "http://example.org"] {
            assert!(!is_from(origin, "localhost:1"), "{origin}");
        }
    }
}
