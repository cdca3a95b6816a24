//! The pictures of the README, of docs/tutorial/real-log.md and docs/explanation/simulator.md: figures of reports,
//! drawn by Chromium.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};
use xtask::shell::{root, sh, text};

use crate::places::PICTURES;
use crate::program::Program;

/// Figures of the worked example: identifier in the report, and file.
const FIGURES: [(&str, &str); 4] = [
    ("drift-x", "drift.png"),
    ("time-x", "time.png"),
    ("profile-x", "profile.png"),
    ("hysteresis-x", "hysteresis.png"),
];
const SIZE: [u32; 2] = [860, 350];

/// Makes all pictures; the recorded log is in the folder next to the checkout.
pub(crate) fn pictures() -> Result<()> {
    let work = root().join("target/pictures");
    fs::create_dir_all(&work)?;
    let report = |name: &str| work.join(name).display().to_string();
    let cycle = |n: u8| format!("testdata/chamber/cycle-{n}.csv.gz");
    let program = Program::beside_the_lab()?;
    let sagnac = text(program.path())?;
    let (fit, sweep) = (report("fit.html"), report("sweep.html"));
    sh(sagnac, &["calibrate", &cycle(1), &cycle(2), "--setup", "testdata/chamber/bench.toml", "--report", &fit])?;
    let log = "../shared/data/mems-chamber-sweep/imu_raw_data.csv";
    let setup = "testdata/mems-chamber-sweep/bench.toml";
    sh(sagnac, &["calibrate", log, "--setup", setup, "--report", &sweep])?;
    shoot(Path::new(&fit), [1020, 872], &root().join(PICTURES).join("report.png"))?;
    let folder = root().join(PICTURES).join("real-log");
    fs::create_dir_all(&folder)?;
    let page = fs::read_to_string(&sweep)?;
    for (id, file) in FIGURES {
        picture(&work, &page, id, &folder.join(file))?;
    }
    loops(&work, sagnac)
}

/// The mirror of docs/explanation/simulator.md: a loop that keeps lock, and one that is too slow.
fn loops(work: &Path, sagnac: &str) -> Result<()> {
    let quick = fs::read_to_string(root().join("scenarios/loop-design/loop-design.toml"))?;
    let slow = quick.replace("bandwidth_hz = 20.0", "bandwidth_hz = 1.0");
    ensure!(slow != quick, "the scenario has another bandwidth");
    let folder = root().join(PICTURES).join("simulator");
    fs::create_dir_all(&folder)?;
    for (name, design) in [("held", &quick), ("broken", &slow)] {
        let (scenario, report) = (work.join(format!("{name}.toml")), work.join(format!("{name}.html")));
        fs::write(&scenario, design)?;
        let (scenario, report) = (scenario.display().to_string(), report.display().to_string());
        sh(sagnac, &["simulate", &scenario, "--report", &report])?;
        picture(work, &fs::read_to_string(&report)?, "actuator", &folder.join(format!("{name}.png")))?;
    }
    Ok(())
}

/// One figure of a page as a picture.
fn picture(work: &Path, page: &str, id: &str, file: &Path) -> Result<()> {
    let alone = work.join(format!("{id}.html"));
    fs::write(&alone, format!("<style>body{{margin:0}}svg{{display:block}}</style>{}", drawing(page, id)?))?;
    shoot(&alone, SIZE, file)
}

/// The print version of one figure.
fn drawing<'a>(page: &'a str, id: &str) -> Result<&'a str> {
    let from = page.split_once(&format!("id=\"{id}\">")).with_context(|| format!("no figure {id} in the report"))?.1;
    let end = from.find("</svg>").context("a figure without an end")? + "</svg>".len();
    Ok(&from[..end])
}

fn shoot(page: &Path, [width, height]: [u32; 2], picture: &Path) -> Result<()> {
    let profile: PathBuf = root().join("target/pictures/profile");
    let output = Command::new("chromium")
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--virtual-time-budget=4000"])
        .arg(format!("--user-data-dir={}", profile.display()))
        .arg(format!("--window-size={width},{height}"))
        .arg(format!("--screenshot={}", picture.display()))
        .arg(format!("file://{}", page.display()))
        .output()
        .context("cannot start chromium; on Debian: apt-get install chromium")?;
    ensure!(output.status.success() && picture.exists(), "{}", String::from_utf8_lossy(&output.stderr));
    println!("wrote {}", picture.display());
    Ok(())
}
