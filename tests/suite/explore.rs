//! `spherule explore` over HTTP: pictures, particles and saved files for the page, and nothing for others. `.ci/explore`
//! operates the page in a browser.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Stdio};

use serde_json::{Value, json};

use crate::harness::{Workshop, dam_break};

/// The program with its page.
struct Explored {
    child: Child,
    port: String,
    /// The path of the page, with the token.
    root: String,
    shop: Workshop,
}

/// An answer.
struct Answer {
    status: u16,
    head: String,
    body: Vec<u8>,
}

impl Explored {
    fn start() -> Self {
        let shop = Workshop::new();
        dam_break(&shop.join("in"), [5, 7]);
        let small = ["--width=48", "--height=27", "--samples=4", "--no-browser"];
        let mut command = shop.command(&[&["explore", "in"][..], &small].concat());
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null());
        let mut child = command.spawn().expect("the program");
        let mut url = String::new();
        let out = child.stdout.take().expect("piped");
        BufReader::new(out).read_line(&mut url).expect("an address");
        let place = url.trim().strip_prefix("http://127.0.0.1:").expect("a local address");
        let (port, root) = place.split_once('/').expect("a path");
        let (port, root) = (port.to_owned(), format!("/{root}"));
        Self { child, port, root, shop }
    }

    /// Sends bytes and returns what comes back.
    fn send(&self, request: &[u8]) -> Answer {
        let mut stream =
            TcpStream::connect(format!("127.0.0.1:{}", self.port)).expect("the server");
        // A server that refuses a long body closes the connection while it is sent
        let _ = stream.write_all(request);
        let mut bytes = Vec::new();
        let _ = stream.read_to_end(&mut bytes);
        let end = bytes.windows(4).position(|four| four == b"\r\n\r\n").expect("a head");
        let head = String::from_utf8(bytes[..end].to_vec()).expect("ASCII");
        let status = head.split(' ').nth(1).and_then(|code| code.parse().ok()).expect("a status");
        Answer { status, head, body: bytes[end + 4..].to_vec() }
    }

    fn ask(&self, method: &str, path: &str, headers: &str, body: &[u8]) -> Answer {
        let host = if headers.contains("Host:") { "" } else { "Host: localhost\r\n" };
        let length = body.len();
        let head = format!(
            "{method} {path} HTTP/1.0\r\n{host}{headers}Connection: close\r\nContent-Length: {length}\r\n\r\n"
        );
        self.send(&[head.as_bytes(), body].concat())
    }

    fn get(&self, path: &str) -> Answer {
        self.ask("GET", &format!("{}{path}", self.root), "", b"")
    }

    fn post(&self, path: &str, body: &Value) -> Answer {
        self.ask("POST", &format!("{}{path}", self.root), "", body.to_string().as_bytes())
    }

    /// The last picture of frame 7 with these settings, and what belongs to it.
    fn last(&self, settings: &Value) -> (Vec<u8>, Value) {
        let wish = json!({ "page": 3, "wish": { "frame": 7, "settings": settings } });
        let number = self.post("wish", &wish).json()["wish"].as_u64().expect("a number");
        let mut after = 0;
        for _ in 0..50 {
            let answer = self.get(&format!("picture?page=3&after={after}"));
            let about = answer.header("X-Picture").expect("a picture");
            let about: Value = serde_json::from_str(about).expect("JSON");
            after = about["number"].as_u64().expect("a number");
            if about["wish"] == number && about["facts"]["is_last"] == true {
                return (answer.body, about["facts"].clone());
            }
        }
        panic!("no last picture");
    }
}

impl Drop for Explored {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Answer {
    fn json(&self) -> Value {
        serde_json::from_slice(&self.body).expect("JSON")
    }

    fn header(&self, name: &str) -> Option<&str> {
        let of =
            |line: &'_ str| line.split_once(": ").map(|(key, _)| key.eq_ignore_ascii_case(name));
        let line = self.head.lines().find(|line| of(line) == Some(true))?;
        Some(line.split_once(": ")?.1)
    }
}

#[test]
fn the_page_gets_pictures_particles_and_files() {
    let page = Explored::start();
    let html = page.get("");
    assert_eq!(html.status, 200);
    assert!(html.header("Content-Security-Policy").is_some_and(|own| own.contains("'none'")));
    let start = page.get("start").json();
    assert_eq!(start["frames"], json!([5, 7]));
    assert_eq!(start["schema"], spherule::manifest::job_schema());
    // A picture has its facts, and another one other bytes
    let (first, facts) = page.last(&json!([]));
    assert_eq!((&facts["size"], &facts["samples"]), (&json!([48, 27]), &json!(4)));
    let settings = json!([{ "key": "camera.azimuth", "value": 120.0 }]);
    let (turned, _) = page.last(&settings);
    assert!(first != turned && first.starts_with(b"\x89PNG"));
    let chosen = page.get("chosen").json();
    assert_eq!((&chosen["frame"], &chosen["settings"]), (&json!(7), &settings));
    assert!(chosen["view"]["eye"].is_array(), "{chosen}");
    // One of its pixels shows a particle, whose values are those of the file
    let places = (0..48).map(|x| (f64::from(x) + 0.5) / 48.0);
    let found = places.map(|x| page.get(&format!("particle?page=3&x={x}&y=0.6&values=1")).json());
    let found = found.into_iter().find(|found| !found.is_null()).expect("a particle");
    assert_eq!(found["id"], found["values"]["id"]);
    let names = page.get("names?frame=7").json();
    assert!(names.as_array().is_some_and(|names| names.contains(&json!("velocity"))), "{names}");
    let bars = page.get("histogram?frame=7&name=speed").json();
    let count: u64 =
        bars["counts"].as_array().expect("bars").iter().filter_map(Value::as_u64).sum();
    assert_eq!(facts["particles"].as_u64(), Some(count));
    // The manifest and the picture are saved
    let save = |name: &str| json!({ "settings": settings, "name": name, "frame": 7 });
    let saved = page.post("save", &save("view.toml")).json();
    assert_eq!(saved["path"], json!(page.shop.join("view.toml")));
    let text = fs::read_to_string(page.shop.join("view.toml")).expect("a manifest");
    assert!(text.contains("azimuth = 120.0") && text.contains("width = 48"), "{text}");
    assert_eq!(page.post("save-picture", &save("view.png")).status, 200);
    assert!(fs::read(page.shop.join("view.png")).expect("a picture") == turned);
    // Files of others are not replaced
    fs::write(page.shop.join("mine.toml"), "mine").expect("a file");
    let refused = page.post("save", &save("mine.toml")).json();
    let message = refused["fault"]["message"].as_str().unwrap_or_default();
    assert!(message.contains("choose another name"), "{refused}");
    // A log of somebody else is kept, and nothing is started
    fs::write(page.shop.join("view.log"), "mine").expect("a file");
    assert_eq!(page.post("render", &save("view.toml")).status, 422);
    assert_eq!(fs::read_to_string(page.shop.join("view.log")).expect("a file"), "mine");
    fs::remove_file(page.shop.join("view.log")).expect("removed");
    // A job goes on in the background
    assert_eq!(page.post("render", &save("view.toml")).status, 200);
    let mut progress = Value::Null;
    for _ in 0..600 {
        progress = page.post("progress", &save("")).json();
        if progress["done"] == 2 {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(100));
    }
    assert_eq!((&progress["done"], &progress["frames"]), (&json!(2), &json!(2)), "{progress}");
    assert!(fs::read(page.shop.join("out/frame.0007.png")).expect("a preview") == turned);
}

#[test]
fn others_get_nothing() {
    let page = Explored::start();
    let root = page.root.clone();
    let get = |path: &str, headers: &str| page.ask("GET", path, headers, b"").status;
    assert_eq!(get(&format!("{root}start"), ""), 200);
    assert_eq!(get("/", ""), 403);
    assert_eq!(get(&format!("/{}/start", "0".repeat(32)), ""), 403);
    assert_eq!(get(&format!("{root}start"), "Host: example.org\r\n"), 403);
    assert_eq!(get(&format!("{root}start"), "Origin: http://example.org\r\n"), 403);
    assert_eq!(get(&format!("{root}start"), "Origin: http://localhost\r\n"), 200);
    for (path, status) in [
        ("../../../etc/passwd", 404),
        ("nothing", 404),
        ("picture", 400),
        ("particle?page=1&x=nan", 400),
        ("histogram?frame=7", 400),
    ] {
        assert_eq!(get(&format!("{root}{path}"), ""), status, "{path}");
    }
    assert_eq!(page.ask("PUT", &format!("{root}save"), "", b"").status, 405);
    let post = |body: &[u8]| page.ask("POST", &format!("{root}wish"), "", body).status;
    assert_eq!(post(b"{"), 400);
    assert_eq!(post("[".repeat(100_000).as_bytes()), 400);
    assert_eq!(post(&vec![b' '; 2 << 20]), 413);
    assert_eq!(post(br#"{"page":1,"wish":{"frame":7,"settings":[],"other":1}}"#), 400);
    for name in ["../a.toml", "/tmp/a.toml", "a/b.toml", "a.sh", ".toml", ""] {
        let body = json!({ "settings": [], "name": name });
        let fault = page.post("save", &body);
        assert_eq!(fault.status, 422, "{name}");
        assert!(fault.json()["fault"]["message"].is_string());
    }
    // A setting that is refused is named, and the page goes on
    let settings = json!([{ "key": "image.samples", "value": 0 }]);
    let fault = page.post("values", &json!({ "settings": settings })).json();
    assert_eq!(fault["fault"]["key"], "image.samples");
    assert_eq!(page.last(&json!([])).1["is_last"], true);
    let names: Vec<_> = fs::read_dir(page.shop.path()).expect("a directory").collect();
    assert_eq!(names.len(), 1, "only the input is there: {names:?}");
}

#[test]
fn ports_in_use_and_missing_inputs_are_errors() {
    let page = Explored::start();
    let port = format!("--port={}", page.port);
    let ran = page.shop.run(&["explore", "in", "--no-browser", &port]).expect(2);
    assert!(ran.errors().contains(&format!("--port {}", page.port)), "{}", ran.errors());
    page.shop.run(&["explore", "nowhere", "--no-browser"]).expect(2);
}
