//! Running pages in headless Chromium, with its software renderer, and getting numbers back.
//!
//! A page is served by a server in this process, together with what it asks for: files in memory under `/`, and packages of npm under
//! `/tools/` (the folder that KILN_TEST_TOOLS names). It hands results over by `POST /result/NAME`, of whatever bytes, and ends by
//! `POST /done`; an error anywhere ends it too, and fails the test. Where there is no Chromium the test is skipped.

use super::tools;
use std::collections::HashMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// What a page posted, by name.
pub type Results = HashMap<String, Vec<u8>>;

/// A browser that starts on a busy machine, compiles shaders and renders without a GPU.
const PATIENCE: Duration = Duration::from_secs(240);

/// What every page begins with: errors are reported, `post` and `done` report the rest.
const PRELUDE: &str = r#"<!doctype html><meta charset="utf-8"><link rel="icon" href="data:,"><body><script>
const post = (name, body) => fetch('/result/' + name, { method: 'POST', body });
const fail = (what) => fetch('/error', { method: 'POST', body: String(what) });
addEventListener('error', (e) => fail(e.message + ' at ' + e.filename + ':' + e.lineno));
addEventListener('unhandledrejection', (e) => fail((e.reason && e.reason.stack) || e.reason));
const done = () => fetch('/done', { method: 'POST', body: '' });
const bytes = async (name) => (await fetch('/' + name)).arrayBuffer();
</script>
"#;

/// Libraries ask for modules by name.
const IMPORTS: &str = r#"<script type="importmap">{"imports": {
"three": "/tools/three/build/three.module.js", "three/addons/": "/tools/three/examples/jsm/",
"@babylonjs/core/": "/tools/@babylonjs/core/", "playcanvas": "/tools/playcanvas/build/playcanvas.mjs"}}</script>
"#;

/// Runs a module in a page of its own; what it posted, or nothing where there is no browser.
pub fn run(module: &str, files: HashMap<String, Vec<u8>>) -> Option<Results> {
    let browser = find()?;
    let page = format!("{PRELUDE}{IMPORTS}<script type=\"module\">\n{module}\n</script>");
    let server = Server::start(page, files);
    let profile = tempfile::tempdir().expect("a folder for the browser's profile");
    let started = Instant::now();
    let child = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu-sandbox", "--use-angle=swiftshader"])
        .args(["--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader"])
        .args(["--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run", "--disable-background-networking"])
        .args(["--disable-component-update", "--disable-sync", "--disable-dev-shm-usage", "--window-size=256,256"])
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .arg(format!("http://127.0.0.1:{}/", server.port))
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the browser starts");
    let _closed_at_the_end = Closing(child);
    let mut results = Results::new();
    loop {
        let left = PATIENCE.saturating_sub(started.elapsed());
        match server.posted.recv_timeout(left) {
            Ok(Posted::Result(name, body)) => drop(results.insert(name, body)),
            Ok(Posted::Error(text)) => panic!("the page failed: {text}"),
            Ok(Posted::Done) => return Some(results),
            Err(_) => panic!("the page was not done after {PATIENCE:?}; it posted {:?}", results.keys()),
        }
    }
}

/// The floats that were posted.
pub fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
}

/// Debian's name of the browser, then others'.
fn find() -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let found = names.iter().find_map(|n| std::env::split_paths(&path).map(|p| p.join(n)).find(|p| p.is_file()));
    if found.is_none() {
        tools::skip("no chromium is installed");
    }
    found
}

/// Kills the browser whatever happens.
struct Closing(Child);

impl Drop for Closing {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

enum Posted {
    Result(String, Vec<u8>),
    Error(String),
    Done,
}

struct Server {
    port: u16,
    posted: Receiver<Posted>,
}

struct Served {
    page: String,
    files: HashMap<String, Vec<u8>>,
    tools: Option<PathBuf>,
    posted: Mutex<Sender<Posted>>,
}

impl Server {
    fn start(page: String, files: HashMap<String, Vec<u8>>) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let port = listener.local_addr().expect("an address").port();
        let (sender, posted) = channel();
        let tools = std::env::var_os("KILN_TEST_TOOLS").map(|folder| PathBuf::from(folder).join("node_modules"));
        let served = Arc::new(Served { page, files, tools, posted: Mutex::new(sender) });
        // The thread waits for connections until the tests end; one more costs nothing.
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let served = Arc::clone(&served);
                std::thread::spawn(move || served.answer(stream));
            }
        });
        Self { port, posted }
    }
}

impl Served {
    fn answer(&self, stream: TcpStream) -> Option<()> {
        let mut reader = BufReader::new(stream.try_clone().ok()?);
        let mut line = String::new();
        reader.read_line(&mut line).ok()?;
        let mut words = line.split(' ');
        let (method, path) = (words.next()?.to_owned(), words.next()?.to_owned());
        let mut length = 0;
        loop {
            let mut header = String::new();
            reader.read_line(&mut header).ok()?;
            if header.trim().is_empty() {
                break;
            }
            if let Some(value) = header.to_ascii_lowercase().strip_prefix("content-length:") {
                length = value.trim().parse().ok()?;
            }
        }
        let mut body = vec![0; length];
        reader.read_exact(&mut body).ok()?;
        if method == "POST" {
            let posted = match path.strip_prefix("/result/") {
                Some(name) => Posted::Result(name.to_owned(), body),
                None if path == "/done" => Posted::Done,
                None => Posted::Error(String::from_utf8_lossy(&body).into_owned()),
            };
            // Answered first: a page that is done is closed at once, and its results must be here by then.
            let sent = self.posted.lock().ok()?.send(posted).ok();
            respond(stream, "200 OK", "text/plain", b"");
            return sent;
        }
        match self.content(path.split('?').next()?) {
            Some((kind, content)) => respond(stream, "200 OK", kind, &content),
            None => {
                let _ =
                    self.posted.lock().ok()?.send(Posted::Error(format!("it asked for {path}, which is not there")));
                respond(stream, "404 Not Found", "text/plain", b"");
            }
        }
        Some(())
    }

    fn content(&self, path: &str) -> Option<(&'static str, Vec<u8>)> {
        if path == "/" {
            return Some(("text/html", self.page.clone().into_bytes()));
        }
        if let Some(file) = self.files.get(path.strip_prefix('/')?) {
            return Some(("application/octet-stream", file.clone()));
        }
        let file = self.tools.as_ref()?.join(path.strip_prefix("/tools/")?);
        let kind = match file.extension()?.to_str()? {
            "js" | "mjs" => "text/javascript",
            "json" => "application/json",
            "wasm" => "application/wasm",
            _ => "application/octet-stream",
        };
        Some((kind, std::fs::read(file).ok()?))
    }
}

fn respond(mut stream: TcpStream, status: &str, kind: &str, content: &[u8]) {
    let length = content.len();
    let head =
        format!("HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n");
    let _ = stream.write_all(head.as_bytes()).and_then(|()| stream.write_all(content));
}
