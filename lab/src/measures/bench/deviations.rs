//! Allan deviations: only the computation, alternating with other tools on the same rates.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use xtask::shell::{root, sh};

use crate::measures::bench::{Bench, PAIRS, median, process};

/// Heading of the section.
pub(super) const HEADING: &str = "\n## Allan deviations\n\n";
/// Rates in the file, and rows of the long record.
const RATES: &str = "10000000";
const LONG: &str = "1000000000";

/// allantools as its documentation shows it; only the call is timed.
const PYTHON: &str = "import sys, time, numpy as np, allantools
rates = np.fromfile(sys.argv[1])
n = len(rates)
if sys.argv[2] == 'octave':
    m = 2 ** np.arange(int(np.log2(n / 3)) + 1)
else:
    m = np.round(np.exp(np.log(n / 3) * np.arange(100) / 99))
start = time.perf_counter()
taus, deviations, errors, numbers = allantools.oadev(rates, rate=1.0, data_type='freq', taus=m.astype(float))
print(time.perf_counter() - start, deviations[-1])
";
const MAKE_RATES: &str = "import sys, numpy as np
np.random.default_rng(1).standard_normal(int(sys.argv[2])).tofile(sys.argv[1])
";
const CRATE: &str = "[package]
name = \"allan-peer\"
version = \"0.0.0\"
edition = \"2021\"

[dependencies]
allan-tools = \"=0.1.3\"

[workspace]
";
const CRATE_MAIN: &str = "fn main() {
    let args: Vec<String> = std::env::args().collect();
    let bytes = std::fs::read(&args[1]).unwrap();
    let rates: Vec<f64> = bytes.chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect();
    let last = rates.len() as f64 / 3.0;
    let mut taus: Vec<f64> = if args[2] == \"octave\" {
        (0..40).map(|i| f64::from(i).exp2()).take_while(|m| *m <= last).collect()
    } else {
        (0..100).map(|i| (last.ln() * f64::from(i) / 99.0).exp().round()).collect()
    };
    taus.dedup();
    let start = std::time::Instant::now();
    let (deviations, _) =
        allan_tools::deviation(&rates, &taus, allan_tools::Deviation::Allan, 1.0, true, true).unwrap();
    println!(\"{} {}\", start.elapsed().as_secs_f64(), deviations.last().unwrap());
}
";

/// Octaves and a hundred τ compared with both other tools; a record of 10⁹ rows with Sagnac only.
pub(super) fn measure(bench: &Bench, page: &mut String) -> Result<()> {
    sh("cargo", &["build", "--release", "--locked", "-p", "sagnac-lab", "--bin", "allan_speed"])?;
    let ours = root().join("target/release/allan_speed").display().to_string();
    let theirs = crate_peer(&bench.folder.join("allan-peer"))?;
    let python = bench.file("allantools_peer.py").display().to_string();
    fs::write(&python, PYTHON)?;
    let rates = rates(bench)?;
    *page += HEADING;
    *page += "Overlapping deviations of 10 million rates in memory, two threads, computation only. The three programs run in turn; medians. \
              Target: 8 times faster than allantools at octaves, 10 times at a hundred τ, no slower than the Rust crate.\n\n";
    *page += "| | ours, s | allantools, s | | allan-tools (Rust), s | |\n|---|---|---|---|---|---|\n";
    for (name, taus) in [("octaves", "octave"), ("100 τ, log-spaced", "log")] {
        let mut seconds: [Vec<f64>; 3] = Default::default();
        for _ in 0..PAIRS {
            let runs = [
                seconds_of(&ours, &[&rates, taus])?,
                seconds_of(&bench.python, &[&python, &rates, taus])?,
                seconds_of(&theirs, &[&rates, taus])?,
            ];
            for (all, (seconds, deviation)) in seconds.iter_mut().zip(runs) {
                ensure!((deviation / runs[0].1 - 1.0).abs() < 1e-5, "{deviation} and {}", runs[0].1);
                all.push(seconds);
            }
        }
        let [us, python, rust] = seconds;
        let times = |them: &[f64]| {
            let ratios: Vec<f64> = them.iter().zip(&us).map(|(them, us)| them / us).collect();
            median(&ratios)
        };
        let _ = writeln!(
            page,
            "| {name} | {:.3} | {:.2} | **{:.1} times** | {:.2} | **{:.1} times** |",
            median(&us),
            median(&python),
            times(&python),
            median(&rust),
            times(&rust)
        );
    }
    let (seconds, _) = seconds_of(&ours, &["-", LONG])?;
    let cost = process::measure(&[ours, "-".to_owned(), LONG.to_owned()])?;
    let _ = writeln!(
        page,
        "\nA stream of 1000 million rows (octaves up to a third of the record, no row kept in memory): {seconds:.1} s, peak {:.1} MiB. \
         Target: under 64 MiB.",
        cost.peak_mib
    );
    Ok(())
}

fn crate_peer(folder: &Path) -> Result<String> {
    fs::create_dir_all(folder.join("src"))?;
    fs::write(folder.join("Cargo.toml"), CRATE)?;
    fs::write(folder.join("src/main.rs"), CRATE_MAIN)?;
    let manifest = folder.join("Cargo.toml").display().to_string();
    let target = folder.join("target");
    sh("cargo", &["build", "--release", "--manifest-path", &manifest, "--target-dir", &target.display().to_string()])?;
    Ok(target.join("release/allan-peer").display().to_string())
}

fn rates(bench: &Bench) -> Result<String> {
    let path = bench.file("rates.f64").display().to_string();
    if !Path::new(&path).exists() {
        process::output(&bench.python, &["-c", MAKE_RATES, &path, RATES])?;
    }
    Ok(path)
}

/// What a program prints: its seconds and the last deviation.
fn seconds_of(program: &str, args: &[&str]) -> Result<(f64, f64)> {
    let stdout = process::output(program, args)?;
    let mut numbers = stdout.split_whitespace().map(str::parse);
    let mut next = || numbers.next().context("no number")?.context("no number");
    Ok((next()?, next()?))
}
