//! The page of `sagnac bench` in a real browser: Debian's Chromium, driven by WebDriver.

use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use fantoccini::{Client, ClientBuilder, Locator};

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

/// Chromium's driver and its address; `None` where it is not installed, which fails under CI.
fn driver() -> Option<(Process, String)> {
    let started = Command::new("chromedriver").arg("--port=0").stdout(Stdio::piped()).stderr(Stdio::null()).spawn();
    let Ok(mut child) = started else {
        assert!(
            std::env::var_os("SAGNAC_REQUIRE_SHARED").is_none(),
            "chromedriver is missing; on Debian: apt-get install chromium chromium-driver"
        );
        println!("skipped: chromedriver is not installed");
        return None;
    };
    let mut said = BufReader::new(child.stdout.take().unwrap()).lines();
    let port = said.find_map(|line| {
        let line = line.ok()?;
        Some(line.split_once("started successfully on port ")?.1.trim_end_matches('.').to_owned())
    });
    let address = format!("http://127.0.0.1:{}", port.expect("chromedriver names its port"));
    // It goes on to talk; nobody listens.
    std::thread::spawn(move || said.for_each(drop));
    Some((Process(child), address))
}

async fn browser(address: &str, profile: &Path, dark: bool) -> Client {
    let mut args = vec![
        "--headless".to_owned(),
        "--no-sandbox".to_owned(),
        "--disable-gpu".to_owned(),
        "--disable-quic".to_owned(),
        "--no-first-run".to_owned(),
        "--disable-background-networking".to_owned(),
        "--disable-component-update".to_owned(),
        "--disable-sync".to_owned(),
        "--window-size=390,844".to_owned(),
        format!("--user-data-dir={}", profile.display()),
    ];
    if dark {
        args.push("--force-dark-mode".to_owned());
    }
    let mut capabilities = serde_json::Map::new();
    capabilities.insert("goog:chromeOptions".to_owned(), serde_json::json!({ "args": args }));
    ClientBuilder::new(hyper_util::client::legacy::connect::HttpConnector::new())
        .capabilities(capabilities)
        .connect(address)
        .await
        .unwrap()
}

/// Waits until a script returns true.
async fn until(page: &Client, what: &str, script: &str) {
    let begun = Instant::now();
    loop {
        let answer = page.execute(script, Vec::new()).await.unwrap();
        if answer == serde_json::Value::Bool(true) {
            return;
        }
        if begun.elapsed() > PATIENCE {
            let seen = page.execute("return document.body.innerText", Vec::new()).await.unwrap();
            panic!("{what} did not happen; the page says:\n{}", seen.as_str().unwrap_or_default());
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
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
    let Some((_driver, webdriver)) = driver() else { return };
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
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    runtime.block_on(async {
        let page = browser(&webdriver, &path.join("profile"), true).await;
        let begun = Instant::now();
        while page.goto(&format!("http://{address}/")).await.is_err()
            || page.title().await.unwrap_or_default().is_empty()
        {
            assert!(begun.elapsed() < PATIENCE);
        }
        until(
            &page,
            "the title",
            "return document.getElementById('title').textContent === 'RLG-<b>7</b> on the bench'",
        )
        .await;
        until(&page, "figures", DRAWN).await;
        until(&page, "the dark", "return document.documentElement.className === 'dark'").await;
        until(&page, "limits", "return document.querySelectorAll('#limits tbody tr').length >= 3").await;
        until(&page, "an event", "return document.getElementById('events').textContent.includes('connected')").await;
        // A phone: nothing is wider than the screen.
        until(&page, "the width", "return document.documentElement.scrollWidth <= innerWidth").await;
        // Keys reach the figures.
        page.find(Locator::Css("body")).await.unwrap().send_keys("3").await.unwrap();
        until(&page, "focus", "return document.activeElement.closest('figure')?.id === 'figure-residual'").await;
        // The counter stops: a warning comes while the page is open.
        log.write_all((4000..4200).map(|i| format!("{},75,20.000\n", 10 * (i + 1))).collect::<String>().as_bytes())
            .unwrap();
        until(
            &page,
            "a warning",
            "return document.querySelector('#warnings li:not(.over) b')?.textContent.includes('stood still')",
        )
        .await;
        // Killed: the page says so. Resumed: it goes on by itself, with what came meanwhile.
        bench.0.kill().unwrap();
        bench.0.wait().unwrap();
        until(&page, "the loss", "return document.getElementById('link').className === 'bad'").await;
        log.write_all(rows(4200, 4300).as_bytes()).unwrap();
        bench = start(path, &address, &["--resume"]);
        until(&page, "the return", "return document.getElementById('link').textContent === 'live'").await;
        until(
            &page,
            "the rest",
            "return [...document.querySelectorAll('.tile .unit')].some((unit) => unit.textContent === '4300 rows')",
        )
        .await;
        until(&page, "figures again", DRAWN).await;
        until(
            &page,
            "the event",
            "return document.getElementById('events').textContent.includes('the recording goes on')",
        )
        .await;
        page.close().await.unwrap();
    });
}
