//! The page of `sagnac bench` in a real browser: Debian's Chromium, driven by WebDriver.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

/// Longest wait for something that must happen.
const PATIENCE: Duration = Duration::from_secs(60);

/// A process that ends with its test.
struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Chromium's driver and its address.
fn driver() -> (Process, String) {
    let started = Command::new("chromedriver").arg("--port=0").stdout(Stdio::piped()).stderr(Stdio::null()).spawn();
    let mut child = started.expect("chromedriver is missing; on Debian: apt-get install chromium chromium-driver");
    let mut said = BufReader::new(child.stdout.take().unwrap()).lines();
    let port = said.find_map(|line| {
        let line = line.ok()?;
        Some(line.split_once("started successfully on port ")?.1.trim_end_matches('.').to_owned())
    });
    let address = format!("127.0.0.1:{}", port.expect("chromedriver names its port"));
    // It goes on to talk; nobody listens.
    std::thread::spawn(move || said.for_each(drop));
    (Process(child), address)
}

/// A browser, by the WebDriver protocol (W3C): each command is one HTTP request with JSON.
struct Browser {
    driver: String,
    session: String,
}

impl Browser {
    fn begin(driver: &str, profile: &Path) -> Self {
        let args = [
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-quic",
            "--no-first-run",
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
            "--window-size=390,844",
            "--force-dark-mode",
            &format!("--user-data-dir={}", profile.display()),
        ];
        let wanted = json!({ "capabilities": { "alwaysMatch": { "goog:chromeOptions": { "args": args } } } });
        let made = ask(driver, "POST", "/session", &wanted).unwrap();
        Self { driver: driver.to_owned(), session: made["sessionId"].as_str().unwrap().to_owned() }
    }

    fn command(&self, path: &str, body: &Value) -> Result<Value, String> {
        ask(&self.driver, "POST", &format!("/session/{}/{path}", self.session), body)
    }

    fn goto(&self, address: &str) -> Result<Value, String> {
        self.command("url", &json!({ "url": address }))
    }

    fn run(&self, script: &str) -> Value {
        self.command("execute/sync", &json!({ "script": script, "args": [] })).unwrap()
    }

    /// Gives the page a size, px.
    fn resize(&self, width: u64, height: u64) {
        let metrics = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false });
        let command = json!({ "cmd": "Emulation.setDeviceMetricsOverride", "params": metrics });
        self.command("goog/cdp/execute", &command).unwrap();
    }

    /// Types a key into whatever has the focus.
    fn key(&self, key: &str) {
        let press = json!([{ "type": "keyDown", "value": key }, { "type": "keyUp", "value": key }]);
        self.command("actions", &json!({ "actions": [{ "type": "key", "id": "keys", "actions": press }] })).unwrap();
    }

    /// Waits until a script returns true.
    fn until(&self, what: &str, script: &str) {
        let begun = Instant::now();
        while self.run(script) != Value::Bool(true) {
            if begun.elapsed() > PATIENCE {
                let seen = self.run("return document.body.innerText");
                panic!("{what} did not happen; the page says:\n{}", seen.as_str().unwrap_or_default());
            }
        }
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = ask(&self.driver, "DELETE", &format!("/session/{}", self.session), &Value::Null);
    }
}

/// The value of an answer, or the error that the driver states.
fn ask(driver: &str, method: &str, path: &str, body: &Value) -> Result<Value, String> {
    let mut line = TcpStream::connect(driver).map_err(|e| e.to_string())?;
    let body = body.to_string();
    let head = format!(
        "{method} {path} HTTP/1.1\r\nHost: {driver}\r\nConnection: close\r\nContent-Type: application/json\r\nContent-Length: {}\r\n\r\n",
        body.len()
    );
    line.write_all((head + &body).as_bytes()).map_err(|e| e.to_string())?;
    let mut answer = BufReader::new(line);
    let (mut status, mut length) = (String::new(), 0);
    answer.read_line(&mut status).map_err(|e| e.to_string())?;
    loop {
        let mut header = String::new();
        answer.read_line(&mut header).map_err(|e| e.to_string())?;
        match header.trim_end().split_once(':') {
            Some((name, value)) if name.eq_ignore_ascii_case("content-length") => {
                length = value.trim().parse().unwrap()
            }
            Some(_) => {}
            None => break,
        }
    }
    let mut text = vec![0; length];
    answer.read_exact(&mut text).map_err(|e| e.to_string())?;
    let mut answer: Value = serde_json::from_slice(&text).map_err(|e| e.to_string())?;
    let value = answer["value"].take();
    if status.contains(" 200 ") { Ok(value) } else { Err(value.to_string()) }
}

/// True where each figure has a canvas with something drawn in it.
const DRAWN: &str = "
    return ['rate', 'temperature', 'residual', 'known', 'allan'].every((name) => {
        const canvas = document.querySelector('#figure-' + name + ' canvas');
        if (!canvas) return false;
        const pixels = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
        let drawn = 0;
        for (let i = 3; i < pixels.length; i += 4) if (pixels[i] > 0) drawn++;
        return drawn > 500;
    });";

/// True where verdict, temperature, time of the end and warnings are 40 px high or more.
const LARGE: &str = "
    return ['#verdict-word', '#temperature', '#end-time', '#warnings li:not(.over) b'].every((place) =>
        [...document.querySelectorAll(place)].every((e) => parseFloat(getComputedStyle(e).fontSize) >= 40));";

/// True where each limit shows its bound within the screen, with its unit.
const BOUND: &str = "
    const cells = [...document.querySelectorAll('#limits tbody td:nth-child(3)')];
    return cells.length >= 3 && cells.every((e) => {
        const box = e.getBoundingClientRect();
        return box.left >= 0 && box.right <= innerWidth && /[0-9]/.test(e.textContent);
    });";

/// Rows of a triangle over 50 °C with a drift, 10 s each.
fn rows(from: u32, to: u32) -> String {
    let row = |i: u32| {
        let celsius = 45.0 - 50.0 * (f64::from(i % 2000) / 1000.0 - 1.0).abs();
        let noise = f64::from(i.wrapping_mul(2_654_435_761) >> 16) / 65_536.0 - 0.5;
        let counts = ((4.5 + 0.02 * (celsius - 20.0)) * 10.0 / 0.6 + 8.0 * noise).round();
        format!("{},{counts},{celsius:.3}\n", 10 * (i + 1))
    };
    (from..to).map(row).collect()
}

fn start(folder: &Path, address: &str, more: &[&str]) -> Process {
    let program = Command::new(env!("CARGO_BIN_EXE_sagnac"))
        .current_dir(folder)
        .args(["bench", "bench.toml", "-o", "run.parquet", "--source", "file:live.csv", "--page", address])
        .args(more)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    Process(program.unwrap())
}

/// Figures are drawn, a warning and an event are shown, and the page goes on after the bench was killed and resumed.
#[test]
fn the_page_is_drawn_and_comes_back() {
    let (_driver, webdriver) = driver();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    std::fs::write(
        path.join("bench.toml"),
        "serial = \"RLG-<b>7</b>\"\narcsec_per_count = 0.6\n[bench]\nlimits = \"navigation-grade\"\n",
    )
    .unwrap();
    let mut log = File::create(path.join("live.csv")).unwrap();
    log.write_all(("time_s,counts,temperature_c\n".to_owned() + &rows(0, 4000)).as_bytes()).unwrap();
    let address = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let mut bench = start(path, &address, &[]);
    let page = Browser::begin(&webdriver, &path.join("profile"));
    let begun = Instant::now();
    while page.goto(&format!("http://{address}/")).is_err() {
        assert!(begun.elapsed() < PATIENCE);
    }
    page.until("the title", "return document.getElementById('title').textContent === 'RLG-<b>7</b> on the bench'");
    page.until("figures", DRAWN);
    page.until("the dark", "return document.documentElement.className === 'dark'");
    page.until("limits", "return document.querySelectorAll('#limits tbody tr').length >= 3");
    page.until("an event", "return document.getElementById('events').textContent.includes('connected')");
    page.until("the hours to go", "return /to go|end/.test(document.getElementById('end-time').textContent)");
    page.until("the temperature", "return / °C$/.test(document.getElementById('temperature').textContent)");
    // From a phone to a large screen: words to be read across the laboratory, the bound, and the end in reach.
    for (width, columns) in [(380, 1), (768, 1), (1280, 2), (1920, 2)] {
        page.resize(width, 800);
        page.until(
            "the width",
            &format!(
                "return Math.abs(innerWidth - {width}) <= 16 && document.documentElement.scrollWidth <= innerWidth"
            ),
        );
        page.until("large words", LARGE);
        page.until(
            "columns",
            &format!("return new Set([...document.querySelectorAll('.figures figure')].map((e) => Math.round(e.getBoundingClientRect().left))).size === {columns}"),
        );
        page.until("the bound", BOUND);
        page.until(
            "the end in reach",
            // This browser has no right to end the recording, so the button is shown for the look.
            "document.getElementById('control').hidden = false; const box = document.getElementById('stop').getBoundingClientRect(); return box.height > 20 && box.bottom <= innerHeight && box.right <= innerWidth",
        );
    }
    page.resize(390, 844);
    // Keys reach the figures.
    page.key("3");
    page.until("focus", "return document.activeElement.closest('figure')?.id === 'figure-residual'");
    // The counter stops: a warning comes while the page is open.
    log.write_all((4000..4200).map(|i| format!("{},75,20.000\n", 10 * (i + 1))).collect::<String>().as_bytes())
        .unwrap();
    page.until(
        "a warning",
        "return document.querySelector('#warnings li:not(.over) b')?.textContent.includes('are stuck')",
    );
    page.until("a large warning", LARGE);
    // Killed: the page says so. Resumed: it goes on by itself, with what came meanwhile.
    bench.0.kill().unwrap();
    bench.0.wait().unwrap();
    page.until("the loss", "return document.getElementById('link').className === 'bad'");
    log.write_all(rows(4200, 4300).as_bytes()).unwrap();
    let _resumed = start(path, &address, &["--resume"]);
    page.until("the return", "return document.getElementById('link').textContent === 'live'");
    page.until(
        "the rest",
        "return [...document.querySelectorAll('.tile .unit')].some((unit) => unit.textContent === '4300 rows')",
    );
    page.until("figures again", DRAWN);
    page.until("the event", "return document.getElementById('events').textContent.includes('the recording goes on')");
}
