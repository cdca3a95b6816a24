//! `cargo xtask fpga`: the Verilog export, built and checked.

mod images;
mod synthesis;
mod verdict;

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use sagnac_ports::verilog_files;
use xtask::debian::{self, need};
use xtask::shell::{output, root, stdout_of, text};

use self::verdict::Hardware;
use crate::places;
use crate::targets::faults;
use crate::targets::vector_files::{Spoiled, image, loops, spoiled, table, write};

/// The modules of the correction behind its plain bus.
const CORRECTION: [&str; 5] =
    ["sagnac_correction.v", "sagnac_image.v", "sagnac_series.v", "sagnac_fast.v", "sagnac_increments.v"];
/// Vectors of the correction, and the smallest width of the counts that they fit. `compensator-limits` advances many ticks at once,
/// which no hardware does.
const FILES: [(&str, u32); 8] = [
    ("compensator-full", 16),
    ("compensator-paper", 3),
    ("compensator-edges", 32),
    ("compensator-advance", 32),
    ("compensator-inputs", 16),
    ("compensator-harmonic", 16),
    ("compensator-lags", 16),
    ("compensator-warm-up", 16),
];
/// Records that slow runs have of a file: another simulator, a netlist. The fast one runs every record, through both buses.
const SLOW_RECORDS: &str = "+records=20";
const SLOW: [&str; 2] = ["iverilog", "verilator-netlist"];
/// The fast simulator begins with ones in every register and with AXI4-Lite with zeros, so that one of the two finds a register that nothing
/// resets. The slow one knows bits without a value.
const ONES: &str = "+verilator+rand+reset+1";
/// The compiler's level for Verilator's C++: that of the netlist compiles in three quarters of the time, and runs as fast.
const QUICKLY: [&str; 2] = ["-MAKEFLAGS", "OPT_FAST=-O1 OPT_SLOW=-O0 OPT_GLOBAL=-O1"];
/// The vectors that the slow simulator runs in hardware with an image of its own, and not once more with an image that is loaded.
const PRESET: &str = "compensator-lags";
/// Random images with records, and images alone, most of them changed.
const RANDOM_IMAGES: u64 = 1000;
const IMAGES_ALONE: u64 = 4000;
/// Runs of faults that the bench's memory holds at once.
const MOST_FAULTS: usize = 100;
/// Images alone that the netlist is given, which is slow.
const NETLIST_IMAGES: u64 = 300;

/// The Verilog export: lint, benches in two simulators, random images, latches, cells and the netlist of one family. With `place`: the whole
/// correction and the other families alone, and place and route.
pub(crate) fn fpga(place: bool) -> Result<()> {
    need(debian::FPGA)?;
    let folder = root().join("target/fpga");
    write(&folder, &verilog_files(&image("compensator-full")?, Some(&loops()?)))?;
    if place {
        synthesis::families(&folder)?;
        return synthesis::place_and_route(&folder);
    }
    lint(&folder)?;
    correction(&folder)?;
    for (name, bench, modules) in [
        ("quadrature", "tb_quadrature", &["sagnac_quadrature.v"][..]),
        ("path-length-mirror", "tb_path_length", &["sagnac_path_length.v"]),
        ("watch", "tb_watch", &["sagnac_watch.v", "sagnac_vote.v"]),
    ] {
        let bench = Bench { folder: &folder, top: bench, modules };
        for built in [bench.in_iverilog(&[])?, bench.in_verilator("", &[])?] {
            built.run_vectors(name)?;
        }
    }
    synthesis::one_family(&folder)?;
    println!("fpga: every check passed");
    Ok(())
}

/// Every width, both buses, with everything that can be left out and without it.
fn lint(folder: &Path) -> Result<()> {
    let small = Hardware::SMALL.parameters().map(|(name, value)| format!("-G{name}={value}"));
    let small: Vec<&str> = small.iter().map(String::as_str).chain(["-GSTATE_WORDS=0", "-GSTEP_LIMITS=0"]).collect();
    for (module, parameters) in [
        ("sagnac_axi4_lite", &[][..]),
        ("sagnac_axi4_lite", &["-GRAW_BITS=2"]),
        ("sagnac_axi4_lite", &["-GRAW_BITS=32"]),
        ("sagnac_axi4_lite", &["-GIMAGE=\"sagnac_image.hex\""]),
        ("sagnac_correction", &small),
        ("sagnac_correction", &["-GQUEUE_BITS=1"]),
        ("sagnac_correction", &["-GQUEUE_BITS=10"]),
        ("sagnac_quadrature", &[]),
        ("sagnac_path_length", &[]),
        ("sagnac_watch", &[]),
        ("sagnac_vote", &[]),
        ("sagnac_vote", &["-GVOTERS=2"]),
        ("sagnac_vote", &["-GVOTERS=8"]),
    ] {
        let file = format!("{module}.v");
        let args = [&["--lint-only", "-Wall", "-I."], parameters, &[&file]].concat();
        let lint = output(120, "verilator", &args, folder)?;
        let stderr = String::from_utf8_lossy(&lint.stderr);
        ensure!(lint.status.success() && stderr.trim().is_empty(), "{file} {parameters:?}: {stderr}");
    }
    println!("check: Verilog: every module lint clean (verilator -Wall), whole and small");
    Ok(())
}

/// The correction: every vector file through the plain bus in both simulators and through AXI4-Lite in one; random and
/// changed images.
fn correction(folder: &Path) -> Result<()> {
    let bench = Bench { folder, top: "tb_compensator", modules: &CORRECTION };
    let with_bus = [&CORRECTION[..], &["sagnac_axi4_lite.v"]].concat();
    let with_bus = Bench { modules: &with_bus, ..bench };
    let fast = bench.in_verilator("", &["-GRAW_WIDTH=32"])?;
    let axi = with_bus.in_verilator("-axi", &["-GRAW_WIDTH=32", "+define+AXI"])?;
    let path = folder.join("random.hex");
    fs::write(&path, images::random(RANDOM_IMAGES)?)?;
    for built in [&fast, &axi] {
        built.run(&path, "random images")?;
    }
    for file in faults::joined(folder, MOST_FAULTS)? {
        fast.run(&file, "runs of faults")?;
    }
    let preset = folder.join("preset");
    write(&preset, &verilog_files(&image(PRESET)?, None))?;
    let preset = Bench { folder: &preset, ..bench };
    preset.in_iverilog(&["-DPRESET"])?.run_vectors(PRESET)?;
    let own: Vec<Vec<u8>> = FILES.iter().map(|(name, _)| table(name)).collect::<Result<_>>()?;
    let path = folder.join("alone.hex");
    fs::write(&path, images::alone(&own, IMAGES_ALONE, Hardware::WHOLE)?)?;
    fast.run(&path, "images alone")?;
    let (mut early, mut waited) = (0, 0);
    for (name, width) in FILES {
        let width = format!("-Ptb_compensator.RAW_WIDTH={width}");
        let slow = if name == PRESET { None } else { Some(bench.in_iverilog(&[&width])?) };
        for built in slow.iter().chain([&fast, &axi]) {
            let verdict = built.run_vectors(name)?;
            early += usize::from(verdict.contains("early ticks"));
            waited += usize::from(verdict.contains("waited for room"));
        }
    }
    ensure!(waited >= 4, "the queue of increments is full in {waited} runs alone");
    ensure!(early >= 4, "only {early} runs end where ticks that come too early can be tried");
    Ok(())
}

/// A test bench and the modules that it tries.
#[derive(Clone, Copy)]
struct Bench<'a> {
    folder: &'a Path,
    top: &'a str,
    modules: &'a [&'a str],
}

impl Bench<'_> {
    fn in_iverilog(&self, options: &[&str]) -> Result<Built> {
        let file = format!("{}.v", self.top);
        let args = [&["-g2005", "-Wall", "-I.", "-o", self.top, &file], options].concat();
        stdout_of(120, "iverilog", &[&args[..], self.modules].concat(), self.folder)?;
        Ok(Built::new(self, "iverilog", "vvp", &[self.top]))
    }

    /// All in one folder, where Verilator's own library is compiled once.
    fn in_verilator(&self, suffix: &str, options: &[&str]) -> Result<Built> {
        let (file, built) = (format!("{}.v", self.top), format!("V{}{}", self.top, suffix.replace('-', "_")));
        let quiet = ["--binary", "-j", "2", "-Wno-fatal", "-Wno-lint", "-Wno-style", "-I.", "--top-module", self.top];
        let into = ["-Mdir", "obj", "--prefix", &built, &file];
        let args = [&quiet[..], &QUICKLY, options, &into, self.modules].concat();
        stdout_of(1200, "verilator", &args, self.folder)?;
        let begins: &[&str] = if suffix == "-axi" { &[] } else { &[ONES] };
        Ok(Built::new(self, &format!("verilator{suffix}"), &format!("obj/{built}"), begins))
    }
}

/// A bench built for a simulator.
struct Built {
    folder: PathBuf,
    simulator: String,
    command: String,
    args: Vec<String>,
}

impl Built {
    fn new(bench: &Bench<'_>, simulator: &str, command: &str, args: &[&str]) -> Self {
        let args = args.iter().map(|arg| (*arg).to_owned()).collect();
        Self { folder: bench.folder.to_owned(), simulator: simulator.to_owned(), command: command.to_owned(), args }
    }

    fn says(&self, path: &Path) -> Result<String> {
        let vectors = format!("+vectors={}", text(path)?);
        let records = SLOW.contains(&self.simulator.as_str()).then_some(SLOW_RECORDS);
        let args: Vec<&str> = self.args.iter().map(String::as_str).chain([vectors.as_str()]).chain(records).collect();
        stdout_of(900, &self.command, &args, &self.folder)
    }

    /// Must pass; what it said.
    fn run(&self, path: &Path, name: &str) -> Result<String> {
        let stdout = self.says(path)?;
        let verdict = stdout.lines().find(|line| line.starts_with("PASSED"));
        let verdict = verdict.with_context(|| format!("{}, {name}: {stdout}", self.simulator))?;
        println!("check: Verilog, {}, {name}: {verdict}", self.simulator);
        Ok(verdict.to_owned())
    }

    /// A vector file must pass, and fail with one changed bit. The fast simulator reads to the end for it; the bench is the same for all.
    fn run_vectors(&self, name: &str) -> Result<String> {
        let verdict = self.run(&places::vectors().join(name).with_extension("hex"), name)?;
        let which = if self.simulator == "verilator" { Spoiled::Last } else { Spoiled::Early };
        let stdout = self.says(&spoiled(name, &self.folder, which)?)?;
        let noticed = stdout.contains("FAILED: record");
        ensure!(noticed, "{name} in {}: a changed bit of the vectors is not noticed", self.simulator);
        Ok(verdict)
    }
}
