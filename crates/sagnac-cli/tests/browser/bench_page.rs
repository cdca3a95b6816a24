//! The page of `sagnac bench` in a real browser: Debian's Chromium, driven by WebDriver.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

/// Longest wait for something that must happen.
const PATIENCE: Duration = Duration::from_secs(180);

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

    /// Types a key into whatever has the focus.
    fn key(&self, key: &str) {
        let press = json!([{ "type": "keyDown", "value": key }, { "type": "keyUp", "value": key }]);
        self.command("actions", &json!({ "actions": [{ "type": "key", "id": "keys", "actions": press }] })).unwrap();
    }

    /// Waits until a script returns true.
    fn until(&self, what: &str, script: &str) {
        let begun = Instant::now();
        loop {
            let value = self.run(script);
            if value == Value::Bool(true) {
                return;
            }
            if begun.elapsed() > PATIENCE {
                let seen = self.run("return document.body.innerText");
                panic!("{what} did not happen ({value}), the page says:\n{}", seen.as_str().unwrap_or_default());
            }
        }
    }

    /// Waits for words in a place, and looks at the page on each screen, in the dark and in the light.
    fn shows(&self, place: &str, words: &str) {
        for (width, height) in SCREENS {
            let screen = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 700 });
            let emulate = json!({ "cmd": "Emulation.setDeviceMetricsOverride", "params": screen });
            self.command("goog/cdp/execute", &emulate).unwrap();
            for _ in ["dark", "light"] {
                let page = format!("const WIDTH = {width}, PLACE = '{place}', WORDS = '{words}';{LOOK}");
                self.until(&format!("{words} at {width} px"), &page);
                self.key("d");
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

/// A phone, a tablet, a notebook, a screen in the laboratory: widths and heights in pixels.
const SCREENS: [(u32, u32); 4] = [(380, 800), (768, 1024), (1280, 800), (1920, 1080)];

/// True for a page that is as it should be at its width, else everything that is wrong.
const LOOK: &str = r#"
    const wrong = [], at = (id) => document.getElementById(id), all = (path) => [...document.querySelectorAll(path)];
    const check = (is, words) => { if (!is) wrong.push(words); };
    const box = (e) => e.getBoundingClientRect(), style = (e) => getComputedStyle(e);
    check(all(PLACE).some((e) => e.textContent.includes(WORDS)), 'it does not say ' + WORDS);
    check(innerWidth === WIDTH, 'it is ' + innerWidth + ' px wide');
    check(document.documentElement.scrollWidth <= WIDTH, 'it scrolls sideways');
    for (const e of all('main *')) if (e.checkVisibility() && !e.closest('.u-wrap, .scroll')) check(box(e).right <= WIDTH + 1, 'cut: ' + e.outerHTML.slice(0, 80));
    // Read from across the laboratory, against its ground.
    const rgb = (text) => text.match(/[\d.]+/g).slice(0, 3).map((v) => v / 255).map((v) => (v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4));
    const light = (text) => rgb(text).reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0.05);
    const far = [at('verdict-word'), at('temperature'), at('end'), ...all('#warnings li:not(.over) p:first-child')];
    for (const e of far) {
        const [a, b] = [light(style(e).color), light(style(e.parentElement).backgroundColor)];
        check(parseFloat(style(e).fontSize) >= 40 && e.textContent.trim() !== '', 'small: ' + e.textContent);
        check(Math.max(a, b) / Math.min(a, b) >= 4.5, 'pale: ' + e.textContent);
    }
    const columns = new Set(all('figure').map((e) => Math.round(box(e).left))).size;
    check(columns === (WIDTH >= 1000 ? 2 : 1), columns + ' columns of plots');
    for (const e of all('.tile .number')) check(e.nextSibling.textContent !== '', 'without a unit: ' + e.textContent);
    check(/^(−?\d+\.\d °C|– °C)$/.test(at('temperature').textContent), 'temperature ' + at('temperature').textContent);
    for (const e of all('#verdict, #warnings li, #open, figcaption')) check(!e.textContent.includes(';'), 'semicolon: ' + e.textContent);
    const end = at('end').textContent + ', ' + at('end-in').textContent, verdict = at('verdict-word').textContent;
    const ends = [
        [/to go$/, /^(\w+ )?\d\d:\d\d, in [\d.]+ (s|min|h)$/], [/^Test complete(, with a warning)?$/, /^now, the test is complete$/],
        [/^Ended/, /^\d\d:\d\d, ended$/], [/^No connection/, /^unknown, no connection$/], [/./, /^unknown, $/],
    ].find(([says]) => says.test(verdict))[1];
    check(ends.test(end), 'the end is ' + end);
    // A plot without data says so.
    for (const e of all('.plot')) check(e.querySelector('canvas') || getComputedStyle(e, '::before').content.includes('no data yet'), 'an empty plot');
    for (const e of all('canvas')) check(e.closest('figure').querySelector('.legend').textContent !== '', 'a plot without a legend');
    // A plot fits its card, and the bound its plot.
    for (const e of all('.uplot')) check(box(e).right <= box(e.closest('figure')).right, 'plot beyond its card');
    const limits = all('#limits td:last-child'), line = document.querySelector('#figure-known .u-over .bound');
    check(!limits.length || line, 'no bound');
    for (const e of limits) check(/\d °\/h/.test(e.textContent) && e.checkVisibility() && box(e).right <= box(e.closest('.scroll')).right + 1, 'a bound is cut');
    if (line) {
        const plot = box(line.parentElement), words = box(line.firstChild);
        check(/^bound [\d.]+ °\/h$/.test(line.textContent), 'bound: ' + line.textContent);
        check(box(line).top > plot.top && box(line).bottom <= plot.bottom, 'the bound is off the plot');
        check(words.top >= plot.top && words.bottom <= plot.bottom && words.left >= plot.left && words.right <= plot.right, 'the label of the bound is off the plot');
    }
    for (const to of [document.documentElement.scrollHeight, 0]) {
        scrollTo(0, to);
        const stop = box(at('stop'));
        check(at('stop').hidden === verdict.startsWith('Ended'), 'the button is there: ' + !at('stop').hidden);
        check(at('stop').hidden || (stop.height > 0 && stop.top >= 0 && stop.bottom <= innerHeight && stop.right <= WIDTH), 'the button is out of reach');
    }
    return wrong.length === 0 || wrong;"#;

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

/// Starts the bench; its process, and the address of its page with the token.
fn start(folder: &Path, address: &str, more: &[&str]) -> (Process, String) {
    let mut program = Command::new(env!("CARGO_BIN_EXE_sagnac"))
        .current_dir(folder)
        .args(["bench", "bench.toml", "-o", "run.parquet", "--source", "file:live.csv", "--page", address])
        .args(more)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(program.stderr.take().unwrap()).lines().map_while(Result::ok);
    let page = said.find_map(|line| Some(line.split_once("the page: ")?.1.to_owned())).unwrap();
    std::thread::spawn(move || said.for_each(drop));
    (Process(program), page)
}

/// Each verdict is read from afar on every screen. Figures are drawn, and the page goes on after the bench was killed and resumed.
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
    std::fs::write(path.join("limits.toml"), "temperature_residual_dph_max = 0.1\n").unwrap();
    let mut log = File::create(path.join("live.csv")).unwrap();
    let address = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let (mut bench, opened) = start(path, &address, &[]);
    let page = Browser::begin(&webdriver, &path.join("profile"));
    page.goto(&opened).unwrap();
    page.until("the title", "return document.getElementById('title').textContent === 'RLG-<b>7</b> on the bench'");
    page.until("the dark", "return document.documentElement.className === 'dark'");
    page.shows("#verdict-word", "No rows yet");
    log.write_all(("time_s,counts,temperature_c\n".to_owned() + &rows(0, 5)).as_bytes()).unwrap();
    page.until("a temperature", "return document.getElementById('temperature').textContent !== '– °C'");
    page.shows("#verdict-word", "No verdict yet: no fit");
    log.write_all(rows(5, 1500).as_bytes()).unwrap();
    page.shows("#verdict-word", "to go");
    log.write_all(rows(1500, 4000).as_bytes()).unwrap();
    page.until("figures", DRAWN);
    page.until("limits", "return document.querySelectorAll('#limits tbody tr').length >= 3");
    page.until("an event", "return document.getElementById('events').textContent.includes('connected')");
    // Keys reach the figures.
    page.key("3");
    page.until("focus", "return document.activeElement.closest('figure')?.id === 'figure-residual'");
    // The counter stops: a warning comes while the page is open.
    log.write_all((4000..4200).map(|i| format!("{},75,20.000\n", 10 * (i + 1))).collect::<String>().as_bytes())
        .unwrap();
    page.shows("#warnings .far", "are stuck");
    // Killed: the page says so. Resumed: it goes on by itself, with what came meanwhile.
    bench.0.kill().unwrap();
    bench.0.wait().unwrap();
    page.shows("#verdict-word", "No connection to the bench");
    log.write_all(rows(4200, 7000).as_bytes()).unwrap();
    let (_resumed, opened) = start(path, &address, &["--resume", "--limits", "limits.toml"]);
    page.until("the return", "return document.getElementById('link').textContent === 'live'");
    page.until(
        "the rest",
        "return [...document.querySelectorAll('.tile .unit')].some((unit) => unit.textContent === '7000 rows')",
    );
    page.until("figures again", DRAWN);
    page.until("the event", "return document.getElementById('events').textContent.includes('the recording goes on')");
    page.goto(&opened).unwrap();
    page.shows("#verdict-word", "Test complete");
    // The file no longer grows: a warning, so nothing is green.
    page.until(
        "the warning",
        "return document.getElementById('verdict-word').textContent === 'Test complete, with a warning'",
    );
    page.until("no green", "return document.querySelector('.verdict.pass') === null");
    // The button asks before it ends the recording, and the page has the last word of the bench.
    page.run("setTimeout(() => document.getElementById('stop').click())");
    let begun = Instant::now();
    while page.command("alert/accept", &json!({})).is_err() {
        assert!(begun.elapsed() < PATIENCE);
    }
    page.shows("#verdict-word", "Ended: test complete");
    page.until("the green", "return document.querySelector('.verdict.pass') !== null");
}
