//! The page as its clients see it: who may look, who may end the recording, what every answer says, and events for ten at once.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::{Duration, Instant};

use sagnac_bench::live::{Live, LiveRequest};
use sagnac_bench::page::{Page, PageOf};
use sagnac_bench::{JournalRows, Session, journal_of};
use sagnac_log::setup::{RateUnit, Setup};

const PATIENCE: Duration = Duration::from_secs(30);

/// A running test with its page.
struct Running {
    _folder: tempfile::TempDir,
    session: Session,
    page: Option<Page>,
    gyro: TcpStream,
}

impl Running {
    fn begin(serial: &str, columns: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let source = format!("[bench]\nsource = \"tcp://{}\"", listener.local_addr().unwrap());
        let setup = Setup::parse(&format!("serial = \"{serial}\"\narcsec_per_count = 0.6\n{source}")).unwrap();
        let journal = journal_of(&folder.path().join("run.parquet"));
        let session = Session::begin(&setup, "test", &journal, false).unwrap();
        let (mut gyro, _) = listener.accept().unwrap();
        gyro.write_all(format!("{columns}\n").as_bytes()).unwrap();
        let live = Live::default();
        let request = LiveRequest { model: "auto".parse().unwrap(), enough: None, every_minute: false };
        live.begin(JournalRows::follow(&journal, session.published.clone()).unwrap(), &setup, request).unwrap();
        let of = PageOf {
            title: serial.to_owned(),
            subtitle: "a test".to_owned(),
            live,
            sources: session.sources.clone(),
            clock: session.clock,
            stop: session.stop.clone(),
            share: None,
            units: RateUnit::DegPerHour,
            is_replay: false,
        };
        let page = Page::begin(of, SocketAddr::from(([127, 0, 0, 1], 0))).unwrap();
        Self { _folder: folder, session, page: Some(page), gyro }
    }

    fn address(&self) -> SocketAddr {
        self.page.as_ref().unwrap().address
    }

    fn token(&self) -> String {
        self.page.as_ref().unwrap().token.clone()
    }

    /// An answer: status line and headers, body.
    fn ask(&self, method: &str, path: &str, headers: &[(&str, &str)]) -> (String, String) {
        let mut line = TcpStream::connect(self.address()).unwrap();
        line.set_read_timeout(Some(PATIENCE)).unwrap();
        let mut text = format!("{method} {path} HTTP/1.1\r\nConnection: close\r\nContent-Length: 0\r\n");
        if !headers.iter().any(|(name, _)| *name == "Host") {
            text += &format!("Host: {}\r\n", self.address());
        }
        headers.iter().for_each(|(name, value)| text += &format!("{name}: {value}\r\n"));
        line.write_all((text + "\r\n").as_bytes()).unwrap();
        let mut answer = String::new();
        line.read_to_string(&mut answer).unwrap();
        let (head, body) = answer.split_once("\r\n\r\n").unwrap_or((&answer, ""));
        (head.to_lowercase(), body.to_owned())
    }

    fn end(mut self) {
        self.session.stop.stop();
        self.page.take().unwrap().end();
        self.session.join().unwrap();
    }
}

fn rows(from: u32, to: u32) -> String {
    (from..to).map(|i| format!("{i},7,{:.2}\n", f64::from(i) / 100.0)).collect()
}

const COLUMNS: &str = "time_s,counts,temperature_c";

#[test]
fn only_its_own_names_are_answered() {
    let running = Running::begin("T", COLUMNS);
    let port = running.address().port();
    for own in [format!("127.0.0.1:{port}"), format!("localhost:{port}"), "localhost".to_owned()] {
        assert!(running.ask("GET", "/", &[("Host", &own)]).0.starts_with("http/1.1 200"), "{own}");
    }
    for foreign in ["evil.example", "127.0.0.1.evil.example", "localhost.evil.example", "", "10.0.0.1"] {
        for path in ["/", "/state.json", "/events", "/bench.js"] {
            let (head, body) = running.ask("GET", path, &[("Host", foreign)]);
            assert!(head.starts_with("http/1.1 421") || head.starts_with("http/1.1 400"), "{foreign} {path}: {head}");
            assert!(!body.contains("serial"), "{body}");
        }
    }
    running.end();
}

#[test]
fn every_answer_has_its_security_headers() {
    let running = Running::begin("T", COLUMNS);
    for path in [
        "/",
        "/state.json",
        "/bench.js",
        "/uplot.js",
        "/report.css",
        "/nothing-there",
        "/../Cargo.toml",
        "/%2e%2e/etc/passwd",
    ] {
        let (head, _) = running.ask("GET", path, &[]);
        for header in [
            "content-security-policy: default-src 'none'",
            "x-content-type-options: nosniff",
            "cache-control: no-store",
            "x-frame-options: deny",
            "referrer-policy: no-referrer",
        ] {
            assert!(head.contains(header), "{path}: {head}");
        }
        let is_there = !path.contains("nothing") && !path.contains("..") && !path.contains("%2e");
        assert_eq!(head.starts_with("http/1.1 200"), is_there, "{path}: {head}");
    }
    running.end();
}

/// Only a page that was opened with the token, and only itself, may end the recording.
#[test]
fn the_recording_is_ended_only_with_the_token() {
    let running = Running::begin("T", COLUMNS);
    let own = format!("http://{}", running.address());
    let (head, _) = running.ask("GET", "/?token=00000000000000000000000000000000", &[]);
    assert!(head.starts_with("http/1.1 401"), "{head}");
    let (head, _) = running.ask("GET", &format!("/?token={}", running.token()), &[]);
    assert!(head.starts_with("http/1.1 303") && head.contains("httponly; samesite=strict"), "{head}");
    let port = running.address().port();
    let (cookie, wrong) = (format!("sagnac-bench-{port}={}", running.token()), format!("sagnac-bench-{port}=1234"));
    // The right token under the name of a bench on another port.
    let of_another = format!("sagnac-bench-{}={}", port ^ 1, running.token());
    let refused = [
        vec![("Origin", own.as_str())],
        vec![("Origin", own.as_str()), ("Cookie", wrong.as_str())],
        vec![("Origin", own.as_str()), ("Cookie", of_another.as_str())],
        vec![("Cookie", cookie.as_str())],
        vec![("Cookie", cookie.as_str()), ("Origin", "http://evil.example")],
        vec![("Cookie", cookie.as_str()), ("Origin", "null")],
        vec![("Cookie", cookie.as_str()), ("Origin", "http://127.0.0.1")],
    ];
    for headers in refused {
        let (head, _) = running.ask("POST", "/stop", &headers);
        assert!(head.starts_with("http/1.1 403"), "{headers:?}: {head}");
        assert!(!running.session.stop.is_stopped());
    }
    assert!(running.ask("GET", "/stop", &[("Cookie", &cookie), ("Origin", &own)]).0.starts_with("http/1.1 405"));
    let (head, _) = running.ask("POST", "/stop", &[("Cookie", &cookie), ("Origin", &own)]);
    assert!(head.starts_with("http/1.1 204"), "{head}");
    assert!(running.session.stop.is_stopped());
    running.end();
}

/// Ten browsers listen, one of them never reads: the others get events, and the recording does not wait.
#[test]
fn ten_browsers_at_once_cost_nothing() {
    let mut running = Running::begin("T", COLUMNS);
    let listen = || {
        let mut line = TcpStream::connect(running.address()).unwrap();
        line.set_read_timeout(Some(PATIENCE)).unwrap();
        write!(line, "GET /events HTTP/1.1\r\nHost: {}\r\n\r\n", running.address()).unwrap();
        line
    };
    let asleep = listen();
    let listening: Vec<TcpStream> = (0..9).map(|_| listen()).collect();
    running.gyro.write_all(rows(1, 500).as_bytes()).unwrap();
    for line in listening {
        let mut events = BufReader::new(line).lines();
        let now = events.find_map(|line| line.ok().filter(|line| line.contains("\"now\""))).unwrap();
        let told: serde_json::Value = serde_json::from_str(now.strip_prefix("data: ").unwrap()).unwrap();
        assert!(told["sources"][0]["state"].is_string(), "{told}");
    }
    let begun = Instant::now();
    while running.session.sources.now()[0].bytes < 5000 {
        assert!(begun.elapsed() < PATIENCE);
    }
    drop(asleep);
    // Neither a stream that is open nor half a request keeps the page from ending.
    let open = listen_once(&running);
    let mut half = TcpStream::connect(running.address()).unwrap();
    half.write_all(b"GET / HTTP/1.1\r\nHo").unwrap();
    let begun = Instant::now();
    running.end();
    assert!(begun.elapsed() < PATIENCE);
    drop((open, half));
}

fn listen_once(running: &Running) -> TcpStream {
    let mut line = TcpStream::connect(running.address()).unwrap();
    write!(line, "GET /events HTTP/1.1\r\nHost: {}\r\n\r\n", running.address()).unwrap();
    line
}

/// Markup in a header of a log or a serial is text in the state, and the page has no place where text becomes markup.
#[test]
fn nothing_of_a_log_is_markup() {
    let mut running =
        Running::begin("<img src=x onerror=alert(1)>", "time_s,counts,temperature_c_<script>alert(2)</script>");
    running.gyro.write_all(rows(1, 50).as_bytes()).unwrap();
    let (head, body) = running.ask("GET", "/state.json", &[]);
    assert!(head.contains("content-type: application/json"), "{head}");
    assert!(serde_json::from_str::<serde_json::Value>(&body).is_ok());
    let (_, script) = running.ask("GET", "/bench.js", &[]);
    for way in ["innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", "eval(", "new Function"] {
        assert!(!script.contains(way), "{way}");
    }
    let (_, page) = running.ask("GET", "/", &[]);
    assert!(!page.contains("onerror") && !page.contains("http://") && !page.contains("https://"), "{page}");
    running.end();
}
