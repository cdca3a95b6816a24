//! Checks that CI runs. Each stops at the first failure and says what to do.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::docs;
use crate::exports;
use crate::firmware::firmware;
use anyhow::{Context, Result, bail, ensure};
use sagnac_core::{Compensator, Description, Image, Kind, Multiplier, Scale, Shape, State, Term, Thermometer};

/// The workspace's folder.
pub(crate) fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new(".")).to_owned()
}

pub(crate) fn sh(program: &str, args: &[&str]) -> Result<()> {
    sh_in(&root(), program, args, &[])
}

pub(crate) fn sh_in(folder: &Path, program: &str, args: &[&str], env: &[(&str, &str)]) -> Result<()> {
    println!("$ {program} {}", args.join(" "));
    let status = Command::new(program).args(args).current_dir(folder).envs(env.iter().copied()).status();
    let status = status.with_context(|| format!("cannot start {program}"))?;
    ensure!(status.success(), "{program} {} failed ({status})", args.join(" "));
    Ok(())
}

/// Everything.
pub(crate) fn ci() -> Result<()> {
    sh("cargo", &["fmt", "--all", "--check"])?;
    sh("cargo", &["clippy", "--workspace", "--all-targets", "--locked", "--", "-D", "warnings"])?;
    docs::docs(true)?;
    deny()?;
    no_panic()?;
    conserve()?;
    sh("cargo", &["test", "--workspace", "--locked"])?;
    exports::c()?;
    exports::fpga(false)?;
    firmware()
}

/// Licences, bans, sources.
pub(crate) fn deny() -> Result<()> {
    let found = Command::new("cargo").args(["deny", "--version"]).output().is_ok_and(|out| out.status.success());
    if !found {
        sh("cargo", &["install", "cargo-deny", "--locked"])?;
    }
    // For every platform, so that the check itself needs no network.
    sh("cargo", &["fetch", "--locked"])?;
    sh("cargo", &["deny", "--offline", "check", "licenses", "bans", "sources"])
}

/// The README's first command.
pub(crate) fn example() -> Result<()> {
    sh("cargo", &["build", "--release", "--locked", "--package", "sagnac-cli"])?;
    let cycle = |n: u8| format!("testdata/chamber/cycle-{n}.csv.gz");
    let setup = "testdata/chamber/bench.toml";
    let sagnac = "target/release/sagnac";
    let (one, two, three) = (cycle(1), cycle(2), cycle(3));
    sh(sagnac, &["calibrate", &one, &two, "--setup", setup, "-o", "target/unit.cal.json"])?;
    sh(sagnac, &["export", "target/unit.cal.json", "--to", "image", "-o", "target/unit.img"])?;
    sh(sagnac, &["verify", "target/unit.cal.json", &three, "--limits", "testdata/chamber/limits.toml"])
}

/// Links core, loops and board with a panic handler that does not exist; with a panic put in on purpose, the same
/// links must fail.
pub(crate) fn no_panic() -> Result<()> {
    const ENTRIES: [(&str, &str); 3] = [
        ("sagnac-core", "sagnac_core_everything"),
        ("sagnac-loops", "sagnac_loops_everything"),
        ("sagnac-board", "sagnac_board_everything"),
    ];
    let target = root().join("target/no-panic");
    let library = target.join("release/libsagnac_no_panic.a");
    build_no_panic(&target, &["--features", "broken"])?;
    for (name, entry) in ENTRIES {
        ensure!(link(&library, entry).is_err(), "{name} with a panic path links; the check checks nothing");
    }
    build_no_panic(&target, &[])?;
    for (name, entry) in ENTRIES {
        link(&library, entry).with_context(|| format!("{name} has a panic path"))?;
        println!("no-panic: {name} links without a panic path, and does not with one");
    }
    Ok(())
}

fn build_no_panic(target: &Path, features: &[&str]) -> Result<()> {
    let target = target.display().to_string();
    let args = [&["build", "--release", "--locked", "--target-dir", &target], features].concat();
    sh_in(&root().join("firmware/no-panic"), "cargo", &args, &[])
}

/// Links one symbol and all it needs; undefined symbols are errors.
fn link(library: &Path, entry: &str) -> Result<()> {
    let out = library.with_file_name("linked");
    let entry_flag = format!("-Wl,--entry={entry}");
    let keep = format!("-Wl,--undefined={entry}");
    let args = ["-nostdlib", "-static", "-Wl,--gc-sections", &entry_flag, &keep];
    // What every target's runtime provides.
    let runtime = ["memcpy", "memmove", "memset", "memcmp", "bcmp"].map(|name| format!("-Wl,--defsym={name}=0"));
    let output = Command::new("cc")
        .args(args)
        .args(&runtime)
        .arg(library)
        .arg("-o")
        .arg(&out)
        .output()
        .context("cannot start cc")?;
    ensure!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr).trim());
    Ok(())
}

/// 1e9 ticks of a gyro at Earth rate, its temperature swinging: Σ out·2³² + remainder =
/// Σ raw·k − Σ increment, each sum kept apart in 128 bits, tick by tick.
pub(crate) fn conserve() -> Result<()> {
    const TICKS: u64 = 1_000_000_000;
    let gyro = Compensator::new(swinging_image()?);
    let mut state = State::new();
    let (mut out, mut owed, mut pulses) = (0_i128, 0_i128, 0_u64);
    for tick in 0..TICKS {
        if state.ticks_to_update() == 0 {
            // A triangle between −40 and 70 °C every 2.2 h, in steps of 1/16 °C.
            let second = tick / 10_000 % 7920;
            let sixteenths = if second < 3960 { second } else { 7920 - second } * 1760 / 3960;
            let code = (i32::try_from(sixteenths)? - 640) << 20;
            gyro.update(&mut state, &[Some(code)])?;
        }
        // 4.25 counts per second on average, and a burst now and then.
        pulses += 17 + if tick % 100_003 == 0 { 1_000_000 } else { 0 };
        let raw = i32::try_from(pulses / 40_000)?;
        pulses %= 40_000;
        let output = gyro.tick(&mut state, raw)?;
        out += i128::from(output.counts);
        owed += i128::from(raw) * i128::from(state.k_q32()) - i128::from(state.increment());
    }
    let balance = (out << 32) + i128::from(state.remainder()) - owed;
    if balance != 0 {
        bail!("{balance} of 2^-32 counts lost in {TICKS} ticks");
    }
    println!("conserve: {TICKS} ticks (27.8 h), {out} counts out, remainder {}: nothing lost", state.remainder());
    Ok(())
}

/// Bias, rate and scale terms over −40 … 70 °C.
fn swinging_image() -> Result<Image> {
    let mut d = Description::empty();
    let half = 55_i64 << 24;
    d.thermometers[0] = Thermometer {
        gain: Scale { mantissa: 1 << 30, shift: 30 },
        plausible_lo_q24: -(80 << 24),
        plausible_hi_q24: 120 << 24,
        span_lo_q24: -(40 << 24),
        span_hi_q24: 70 << 24,
        x_mantissa: u32::try_from((1_i64 << 61) / half)?,
        x_shift: 14,
        ..Thermometer::UNUSED
    };
    d.thermometer_count = 1;
    let term = |kind, order, mantissa, shift| Term {
        kind,
        sensor: 0,
        shape: Shape::Chebyshev(order),
        multiplier: Multiplier::One,
        mantissa,
        shift,
    };
    d.terms[0] = term(Kind::Bias, 1, 987_654_321, 44);
    d.terms[1] = term(Kind::Bias, 3, -765_432_101, 45);
    d.terms[2] = term(Kind::Scale, 2, 555_555_555, 35);
    d.term_count = 3;
    Ok(Image::new(d)?)
}
