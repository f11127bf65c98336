//! Serves the page of an [`Explorer`] over HTTP, by default only to this machine.
//!
//! The address has a secret token, without which every request is refused; so is one from the page of another site,
//! and one that names this machine by another name than its own, as pages can whose name resolves to it. Nothing but
//! this page is served, and it needs nothing else.

use std::io::{self, Read, Write as _};
use std::net::{IpAddr, SocketAddr};
use std::path::PathBuf;
use std::sync::Arc;
use std::thread;

use tiny_http::{Method, Request, Response};

use super::explorer::Explorer;
use super::save::SavedFiles;

mod guard;
mod route;

pub use guard::Token;
use guard::refusal;
use route::Reply;

/// Threads that answer: each page waits with one of them for its next picture.
const THREADS: usize = 24;

/// Longest body of a request, bytes: many times the length of all settings.
const MAX_BODY: u64 = 1 << 20;

/// What is served.
#[derive(Debug)]
pub struct Service {
    /// Renders the pictures.
    pub explorer: Explorer,
    /// The frames of the sequence.
    pub frames: Vec<i64>,
    /// What the page is about, for its title.
    pub title: String,
    /// The program that renders jobs.
    pub program: PathBuf,
    /// Files that were saved.
    pub files: SavedFiles,
}

/// A server that listens, but does not answer yet.
pub struct Server {
    server: tiny_http::Server,
    address: SocketAddr,
    token: Token,
}

impl std::fmt::Debug for Server {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Server").field("address", &self.address).finish_non_exhaustive()
    }
}

impl Server {
    /// Listens at `ip`, at a free port if that is 0.
    ///
    /// # Errors
    /// The port is in use, or the system has no random numbers.
    pub fn bind(ip: IpAddr, port: u16, token: Token) -> io::Result<Self> {
        let server = tiny_http::Server::http(SocketAddr::new(ip, port));
        let server = server.map_err(io::Error::other)?;
        let address = server.server_addr().to_ip();
        let address = address.ok_or_else(|| io::Error::other("no address"))?;
        Ok(Self { server, address, token })
    }

    /// The port.
    pub const fn port(&self) -> u16 {
        self.address.port()
    }

    /// The address of the page for a browser on this machine.
    pub fn url(&self) -> String {
        let host = if self.address.ip().is_unspecified() {
            format!("127.0.0.1:{}", self.address.port())
        } else {
            self.address.to_string()
        };
        format!("http://{host}/{}/", self.token.as_str())
    }

    /// Answers requests until the process ends.
    ///
    /// # Errors
    /// There are no threads.
    pub fn run(self, service: Service) -> io::Result<()> {
        let (server, service) = (Arc::new(self.server), Arc::new(service));
        let is_local = self.address.ip().is_loopback();
        let mut threads = Vec::new();
        for _ in 0..THREADS {
            let (server, service, token) =
                (Arc::clone(&server), Arc::clone(&service), self.token.clone());
            let serve = move || {
                while let Ok(request) = server.recv() {
                    answer(request, &service, (&token, is_local));
                }
            };
            threads.push(thread::Builder::new().name("page".to_owned()).spawn(serve)?);
        }
        for thread in threads {
            // A panic was reported where it happened
            let _ = thread.join();
        }
        Ok(())
    }
}

/// Answers `request`.
fn answer(mut request: Request, service: &Service, (token, is_local): (&Token, bool)) {
    // The token is known to be there when the path is used
    let path = request.url().get(token.as_str().len() + 2..).unwrap_or_default().to_owned();
    let reply = match refusal(&request, token, is_local) {
        Some(refused) => refused,
        None => match body(&mut request) {
            Ok(body) => {
                let is_post = *request.method() == Method::Post;
                route::reply(service, is_post, &path, &body)
            }
            Err(refused) => refused,
        },
    };
    let name = path.split('?').next().unwrap_or_default();
    // The page may have gone
    let _ = if KEPT.contains(&name) { send(request, reply) } else { send_last(request, &reply) };
}

/// Requests that follow one another fast, after which the connection stays open. The others end it: a browser opens
/// several at once for the files of the page, and `tiny_http` may leave a new one without a thread until one of the others
/// ends.
const KEPT: [&str; 3] = ["wish", "picture", "particle"];

/// Sends a reply.
fn send(request: Request, reply: Reply) -> io::Result<()> {
    let Reply { status, mime, headers, bytes } = reply;
    let mut response = Response::from_data(bytes).with_status_code(status);
    for (name, value) in guard::HEADERS.into_iter().chain([("Content-Type", mime)]) {
        response.add_header(header(name, value));
    }
    for (name, value) in headers {
        response.add_header(header(name, &value));
    }
    request.respond(response)
}

/// Sends a reply that ends its connection, which a [`Response`] cannot.
fn send_last(request: Request, reply: &Reply) -> io::Result<()> {
    let Reply { status, mime, headers, bytes } = reply;
    let mut head = format!("HTTP/1.1 {status} \r\nContent-Length: {}\r\n", bytes.len());
    let own = headers.iter().map(|(name, value)| (*name, value.as_str()));
    let common = [("Content-Type", *mime), ("Connection", "close")];
    for (name, value) in guard::HEADERS.into_iter().chain(common).chain(own) {
        head += &format!("{name}: {value}\r\n");
    }
    head += "\r\n";
    let mut writer = request.into_writer();
    writer.write_all(head.as_bytes())?;
    writer.write_all(bytes)?;
    writer.flush()
}

/// A header whose value has no control characters.
fn header(name: &str, value: &str) -> tiny_http::Header {
    tiny_http::Header::from_bytes(name, value).expect("names and values are ASCII")
}

/// The body of `request`.
fn body(request: &mut Request) -> Result<Vec<u8>, Reply> {
    if *request.method() == Method::Get {
        return Ok(Vec::new());
    }
    if request.body_length().is_some_and(|length| length as u64 > MAX_BODY) {
        return Err(Reply::refused(413, "the request is too long"));
    }
    let mut body = Vec::new();
    let read = request.as_reader().take(MAX_BODY + 1).read_to_end(&mut body);
    match read {
        Ok(length) if length as u64 <= MAX_BODY => Ok(body),
        Ok(_) => Err(Reply::refused(413, "the request is too long")),
        Err(_) => Err(Reply::refused(400, "the request is incomplete")),
    }
}
