//! `cargo xtask fpga`: the Verilog export, built and checked.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use sagnac::export::{Widths, verilog_files};
use sagnac_core::{Description, Image};
use xtask::debian::{self, need};
use xtask::shell::{output, root, stdout_of, text};

use super::{Spoiled, image, loops, spoiled, write};
use crate::generated::vectors;

/// The Verilog export: lint, benches in two simulators, latches, cells; with `place`, place and route too.
pub(crate) fn fpga(place: bool) -> Result<()> {
    need(debian::FPGA)?;
    let folder = root().join("target/fpga");
    let mut early = 0;
    // Widths of each: the default, the smallest that fit, or the largest.
    for (name, raw, increment) in [
        ("compensator-full", 16, 48),
        ("compensator-paper", 3, 34),
        ("compensator-edges", 32, 48),
        ("compensator-advance", 32, 48),
        ("compensator-inputs", 16, 48),
        ("compensator-harmonic", 16, 48),
        ("compensator-lags", 16, 48),
        ("compensator-warm-up", 16, 48),
    ] {
        let here = folder.join(name);
        let widths = Widths { raw, increment };
        write(&here, &verilog_files(&image(name)?, Some(&loops()?), widths)?)?;
        lint(&here, &["sagnac_fast", "sagnac_series"])?;
        early += simulate(&here, name, "tb_compensator", &["sagnac_fast.v", "sagnac_series.v"])?;
    }
    ensure!(early >= 4, "only {early} runs end where ticks that come too early can be tried");
    without_slew(&folder)?;
    let here = folder.join("compensator-full");
    lint(&here, &["sagnac_quadrature", "sagnac_path_length"])?;
    simulate(&here, "quadrature", "tb_quadrature", &["sagnac_quadrature.v"])?;
    simulate(&here, "path-length-mirror", "tb_path_length", &["sagnac_path_length.v"])?;
    synthesise(&folder)?;
    if place {
        place_and_route(&folder)?;
    }
    println!("fpga: every check passed");
    Ok(())
}

fn lint(folder: &Path, modules: &[&str]) -> Result<()> {
    for module in modules {
        let file = format!("{module}.v");
        let lint = output(120, "verilator", &["--lint-only", "-Wall", "-I.", &file], folder)?;
        let stderr = String::from_utf8_lossy(&lint.stderr);
        ensure!(lint.status.success() && stderr.trim().is_empty(), "{file}: {stderr}");
    }
    println!("check: Verilog: {} lint clean (verilator -Wall)", modules.join(", "));
    Ok(())
}

/// An image that does not slew leaves no warning either.
fn without_slew(folder: &Path) -> Result<()> {
    let own = image("compensator-full")?;
    let image = Image::new(Description { slew_ticks: 0, ..*own.description() })?;
    let here = folder.join("compensator-without-slew");
    write(&here, &verilog_files(&image, Some(&loops()?), Widths::default())?)?;
    lint(&here, &["sagnac_fast", "sagnac_series"])
}

/// A test bench in both simulators; with one changed bit of the vectors both must fail. How many of the runs tried early ticks.
fn simulate(folder: &Path, vectors_name: &str, bench: &str, modules: &[&str]) -> Result<usize> {
    let mut early = 0;
    let top = format!("{bench}.v");
    let iverilog = ["-g2005", "-Wall", "-I.", "-o", bench, &top];
    stdout_of(120, "iverilog", &[&iverilog[..], modules].concat(), folder)?;
    let built = format!("obj_{bench}");
    let quiet = ["--binary", "-j", "2", "-Wno-fatal", "-Wno-lint", "-Wno-style", "-I.", "--top-module", bench];
    stdout_of(600, "verilator", &[&quiet[..], &["-Mdir", &built, &top], modules].concat(), folder)?;
    let program = format!("{built}/V{bench}");
    let good = vectors::folder().join(vectors_name).with_extension("hex");
    for (simulator, command, first) in [("iverilog", "vvp", Some(bench)), ("verilator", program.as_str(), None)] {
        let run = |path: &Path| -> Result<String> {
            let vectors = format!("+vectors={}", text(path)?);
            let args: Vec<&str> = first.into_iter().chain([vectors.as_str()]).collect();
            stdout_of(600, command, &args, folder)
        };
        let stdout = run(&good)?;
        let verdict =
            stdout.lines().find(|line| line.starts_with("PASSED")).with_context(|| format!("{bench}: {stdout}"))?;
        println!("check: Verilog, {simulator}, {vectors_name}: {verdict}");
        early += usize::from(verdict.contains("early ticks refused"));
        let which = if simulator == "iverilog" { Spoiled::Early } else { Spoiled::Last };
        let stdout = run(&spoiled(vectors_name, folder, which)?)?;
        ensure!(
            stdout.contains("FAILED: record"),
            "{bench} in {simulator}: a changed bit of the vectors is not noticed"
        );
    }
    Ok(early)
}

const WHOLE: &str = "read_verilog -I. pins.v sagnac_fast.v sagnac_series.v sagnac_quadrature.v";
const LOOP: &str = "read_verilog -I. sagnac_path_length.v";

fn synthesise(folder: &Path) -> Result<()> {
    for (name, read, top) in [
        ("compensator-paper", WHOLE, "pins"),
        ("compensator-full", WHOLE, "pins"),
        ("compensator-full", LOOP, "sagnac_path_length"),
    ] {
        let here = folder.join(format!("{name}-cells"));
        write(&here, &verilog_files(&image(name)?, Some(&loops()?), Widths::default())?)?;
        fs::copy(root().join("firmware/fpga/pins.v"), here.join("pins.v"))?;
        let latches =
            format!("{read}; hierarchy -top {top}; proc; opt; select -assert-none t:$dlatch t:$adlatch t:$sr");
        stdout_of(300, "yosys", &["-q", "-p", &latches], &here)?;
        println!("check: Verilog: {name}, {top}: no latch");
        for (family, synth, counted) in [
            (
                "iCE40",
                format!("synth_ice40 -dsp -top {top} -json {top}.json"),
                &["SB_LUT4", "SB_DFF", "SB_MAC16", "SB_RAM40_4K"][..],
            ),
            (
                "Xilinx 7",
                format!("synth_xilinx -family xc7 -flatten -top {top}"),
                &["LUT", "FD", "DSP48E1", "CARRY4", "RAM"][..],
            ),
        ] {
            let stat = format!("stat-{top}.txt");
            stdout_of(600, "yosys", &["-q", "-p", &format!("{read}; {synth}; tee -o {stat} stat")], &here)?;
            println!(
                "check: Verilog: {name}, {top}, {family}: {}",
                cells(&fs::read_to_string(here.join(stat))?, counted)
            );
        }
    }
    Ok(())
}

/// Cells whose names begin so, added up.
fn cells(stat: &str, counted: &[&str]) -> String {
    let sum = |prefix: &&str| -> usize {
        let lines = stat.lines().filter_map(|line| line.trim().split_once(' '));
        lines.filter(|(name, _)| name.starts_with(*prefix)).filter_map(|(_, n)| n.trim().parse::<usize>().ok()).sum()
    };
    counted.iter().map(|prefix| format!("{} {prefix}", sum(prefix))).collect::<Vec<_>>().join(", ")
}

/// On an iCE40 UP5K: the paper's image with counting, correction and slow path.
fn place_and_route(folder: &Path) -> Result<()> {
    need(debian::PLACE)?;
    let here = folder.join("compensator-paper-cells");
    let args = ["--up5k", "--package", "sg48", "--json", "pins.json", "--freq", "12"];
    let placed = output(1800, "nextpnr-ice40", &args, &here)?;
    let stderr = String::from_utf8_lossy(&placed.stderr);
    ensure!(placed.status.success(), "it does not fit or is too slow:\n{stderr}");
    let cells = stderr.lines().filter(|line| line.contains("ICESTORM_LC:") || line.contains("ICESTORM_DSP:"));
    let speed = stderr.lines().rfind(|line| line.contains("Max frequency") && line.contains("clk"));
    for line in cells.take(2).chain([speed.context("no frequency")?]) {
        println!("check: Verilog: compensator-paper placed: {}", line.trim_start_matches("Info:").trim());
    }
    Ok(())
}
