//! The live bench under load: three axes at 4 kHz for three days, fed at a hundred times real time.
//!
//! A thread of this process is the gyro: it writes rows of text to the program's standard input when their time has come, a hundred times as fast as
//! a clock. Memory and processor time are those that the kernel counts for the program (proc(5)), recorder, rows, windows, noise, fits and page
//! together.

use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use xtask::shell::root;

use crate::measures::bench::Bench;

pub(super) const HEADING: &str = "\n## The live bench";
/// Rows in a second of the test.
const RATE: u64 = 4000;
/// Seconds of the test in a second of the clock.
const SPEED: u64 = 100;
/// Hours of the test, unless SAGNAC_LIVE_HOURS says another number.
const HOURS: u64 = 72;
/// Rows written together: 25 ms of the test.
const TOGETHER: u64 = 100;
/// What the issue asks: MiB, and part of a core at real time.
const MOST_MIB: f64 = 64.0;
const MOST_CORE: f64 = 0.05;

/// One look at the program.
struct Look {
    /// Hours of the test so far.
    hours: f64,
    resident_mib: f64,
    /// Processor time so far, s.
    cpu_s: f64,
}

/// Measures and writes the section.
pub(super) fn measure(bench: &Bench, page: &mut String) -> Result<()> {
    let hours =
        std::env::var("SAGNAC_LIVE_HOURS").ok().map_or(Ok(HOURS), |text| text.parse()).context("SAGNAC_LIVE_HOURS")?;
    let folder = bench.file("live");
    fs::create_dir_all(&folder)?;
    for old in ["run.parquet", "run.parquet.journal"] {
        let _ = fs::remove_file(folder.join(old));
    }
    fs::write(folder.join("bench.toml"), "serial = \"LOAD\"\narcsec_per_count = 0.01\nsample_interval_s = 0.00025\n")?;
    let mut program = Command::new(root().join(&bench.sagnac))
        .current_dir(&folder)
        .args(["bench", "bench.toml", "--source", "-", "-o", "run.parquet", "--page", "127.0.0.1:0"])
        .stdin(Stdio::piped())
        .stdout(Stdio::null())
        .stderr(fs::File::create(folder.join("said.txt"))?)
        .spawn()
        .context("cannot start the program")?;
    let mut looks = feed(&mut program, hours)?;
    // What reads rows may be behind the recorder: its work counts until the log is begun.
    while program.try_wait()?.is_none() && !writes(&folder)? {
        looks.push(look(program.id(), hours as f64)?);
        std::thread::sleep(Duration::from_secs(1));
    }
    let begun = Instant::now();
    let status = program.wait()?;
    // Three days at one temperature are no calibration; the log is written all the same.
    ensure!(status.code() == Some(3), "the program ended with {status}");
    let bytes = |name: &str| fs::metadata(folder.join(name)).map(|file| file.len() as f64 / 1e9);
    section(page, hours, &looks, [bytes("run.parquet.journal")?, bytes("run.parquet")?], begun.elapsed())
}

/// Whether the log is being written: it has a temporary name then.
fn writes(folder: &Path) -> Result<bool> {
    let names = fs::read_dir(folder)?.flatten().map(|entry| entry.file_name());
    Ok(names.into_iter().any(|name| name.to_string_lossy().starts_with(".sagnac-")))
}

/// Writes the rows when their time has come.
fn feed(program: &mut Child, hours: u64) -> Result<Vec<Look>> {
    let mut to = program.stdin.take().context("no standard input")?;
    to.write_all(b"time_s,counts_x,counts_y,counts_z,temperature_c\n")?;
    let (begun, rows) = (Instant::now(), hours * 3600 * RATE);
    let (mut looks, mut text, mut seed) = (Vec::new(), String::new(), 1_u64);
    for first in (0..rows).step_by(TOGETHER as usize) {
        text.clear();
        for row in first..first + TOGETHER {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let [x, y, z] = [40, 45, 50].map(|shift| (seed >> shift) % 17);
            let _ = writeln!(text, "{}.{:05},{x},{y},{z},25.1{}", (row + 1) / RATE, (row + 1) % RATE * 25, seed >> 61);
        }
        to.write_all(text.as_bytes()).context("the program reads no more")?;
        let due = Duration::from_micros((first + TOGETHER) * 1_000_000 / RATE / SPEED);
        let early = due.saturating_sub(begun.elapsed());
        if !early.is_zero() {
            std::thread::sleep(early);
        }
        let hours = (first + TOGETHER) as f64 / RATE as f64 / 3600.0;
        if looks.last().is_none_or(|last: &Look| hours - last.hours >= 0.25) {
            looks.push(look(program.id(), hours)?);
        }
    }
    looks.push(look(program.id(), hours as f64)?);
    Ok(looks)
}

/// Resident set and processor time of a process: proc(5).
fn look(process: u32, hours: f64) -> Result<Look> {
    let status = fs::read_to_string(format!("/proc/{process}/status")).context("the program has ended")?;
    let resident =
        status.lines().find_map(|line| line.strip_prefix("VmRSS:")?.trim().strip_suffix(" kB")?.parse::<f64>().ok());
    let stat = fs::read_to_string(format!("/proc/{process}/stat"))?;
    // Behind the name in brackets: fields 14 and 15 are user and system time in hundredths of a second.
    let fields: Vec<&str> = stat.rsplit_once(')').context("no name")?.1.split_whitespace().collect();
    let ticks = |at: usize| fields.get(at).and_then(|field| field.parse::<f64>().ok());
    let cpu_s = (ticks(11).context("no user time")? + ticks(12).context("no system time")?) / 100.0;
    let look = Look { hours, resident_mib: resident.context("no resident set")? / 1024.0, cpu_s };
    println!("{:.2} h of the test: {:.1} MiB, {:.1} s of processor time", look.hours, look.resident_mib, look.cpu_s);
    Ok(look)
}

fn section(page: &mut String, hours: u64, looks: &[Look], gigabytes: [f64; 2], wrote: Duration) -> Result<()> {
    let last = looks.last().context("no look")?;
    let most = looks.iter().map(|look| look.resident_mib).fold(0.0, f64::max);
    let core = last.cpu_s / (3600.0 * last.hours);
    *page += HEADING;
    let _ = writeln!(
        page,
        "\n\nThree axes at {RATE} rows a second for {hours} h, fed at {SPEED} times real time (`cargo xtask bench live`): recorder, rows, windows, \
         noise, fits and page together.\n\n| hours of the test | resident, MiB | processor, s |\n|---|---|---|"
    );
    let every = looks.len().div_ceil(12).max(1);
    for look in looks.iter().step_by(every).chain(std::iter::once(last)) {
        let _ = writeln!(page, "| {:.2} | {:.1} | {:.1} |", look.hours, look.resident_mib, look.cpu_s);
    }
    let met = |is: bool| if is { "met" } else { "**missed**" };
    let _ = writeln!(
        page,
        "\nLargest resident set {most:.1} MiB (below {MOST_MIB} asked: {}); {:.2} % of a core at real time (below {} % asked: {}). \
         The journal has {:.1} GB; the log, {:.1} GB, took {:.0} s to write at the end.",
        met(most < MOST_MIB),
        100.0 * core,
        100.0 * MOST_CORE,
        met(core < MOST_CORE),
        gigabytes[0],
        gigabytes[1],
        wrote.as_secs_f64()
    );
    Ok(())
}
