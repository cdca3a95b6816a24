//! `cargo xtask c` and `cargo xtask fpga`: the exported C and Verilog, built as by a user and checked against the vectors.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use sagnac::export::{TextFile, Widths, c_files, verilog_files};
use sagnac_core::{Image, Watch, WatchSpec};
use sagnac_loops::LoopTable;
use sagnac_vectors::{MAX_TABLE, Words};
use xtask::debian::{self, need};
use xtask::shell::{output, root, stdout_of, text};

use crate::generated::vectors;

const STRICT: [&str; 9] =
    ["-std=c99", "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Wshadow", "-Werror"];
const MODULES: [&str; 5] =
    ["sagnac_integer.c", "sagnac_compensator.c", "sagnac_path_length.c", "sagnac_intensity.c", "sagnac_watch.c"];
/// Accepted findings of cppcheck's MISRA add-on: rule and count. docs/explanation/on-target.md gives the reasons.
const JUSTIFIED: [(&str, usize); 2] = [("misra-c2012-8.7", 7), ("misra-c2012-9.3", 2)];

/// The table of a vector file.
fn table(name: &str) -> Result<Vec<u8>> {
    let bytes = fs::read(vectors::folder().join(name).with_extension("hex"))?;
    let mut words = Words::new(&bytes);
    let head = words.head()?;
    let mut room = [0; MAX_TABLE];
    Ok(words.table(&head, &mut room)?.to_vec())
}

fn image(name: &str) -> Result<Image> {
    Ok(Image::decode(&table(name)?)?)
}

fn loops() -> Result<LoopTable> {
    Ok(LoopTable::decode(&table("path-length-mirror")?)?)
}

fn write(folder: &Path, files: &[TextFile]) -> Result<()> {
    fs::create_dir_all(folder)?;
    files.iter().try_for_each(|file| Ok(fs::write(folder.join(&file.name), &file.text)?))
}

/// A copy of a vector file with the last output changed: every check of it must fail.
fn spoiled(name: &str, folder: &Path) -> Result<PathBuf> {
    let text = fs::read_to_string(vectors::folder().join(name).with_extension("hex"))?;
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    // For the path-length loop the last record in which it is closed: the hardware's bench reads only such records.
    let closed = |line: &String| {
        line.split(' ').nth(8).and_then(|word| u32::from_str_radix(word, 16).ok()).is_some_and(|f| f & 256 != 0)
    };
    let is_loop = name.starts_with("path-length");
    let last = lines.iter_mut().rfind(|line| !is_loop || closed(line)).context("an empty file")?;
    // The first output: a bit of the first word behind operation and inputs.
    let digit = if last.as_bytes()[9 * 9 + 7] == b'0' { "1" } else { "0" };
    last.replace_range(9 * 9 + 7..9 * 9 + 8, digit);
    let path = folder.join(format!("{name}-spoiled.hex"));
    fs::write(&path, lines.join("\n"))?;
    Ok(path)
}

fn files() -> Result<Vec<PathBuf>> {
    let entries = fs::read_dir(vectors::folder()).context("testdata/vectors: run cargo xtask vectors")?;
    let mut paths: Vec<PathBuf> = entries.map(|entry| Ok(entry?.path())).collect::<Result<_>>()?;
    paths.sort();
    Ok(paths)
}

/// The C export: warnings, MISRA, constants, vectors on this machine (64 and 32 bits) and on an emulated Cortex-M4F.
pub(crate) fn c() -> Result<()> {
    need(debian::C)?;
    let folder = root().join("target/c");
    write(&folder, &c_files(&[image("compensator-full")?], Some(&loops()?)))?;
    no_other_types(&folder)?;
    misra(&folder)?;
    constants(&folder)?;
    loaders(&folder)?;
    watches(&folder)?;
    let runner = root().join("firmware/c/check_vectors.c");
    for (name, flags) in [("64-bit", vec!["-fsanitize=undefined", "-fno-sanitize-recover"]), ("32-bit", vec!["-m32"])] {
        let program = folder.join(format!("check-{name}"));
        let all = [&STRICT[..], &flags, &["-I.", text(&runner)?], &MODULES, &["-o", text(&program)?]].concat();
        stdout_of(300, "gcc", &all, &folder)?;
        for path in files()? {
            let line = stdout_of(300, text(&program)?, &[text(&path)?], &folder)?;
            println!("check: C, {name}: {}", short(&line));
        }
        let bad = spoiled("compensator-full", &folder)?;
        let failed = output(300, text(&program)?, &[text(&bad)?], &folder)?;
        ensure!(failed.status.code() == Some(1), "C, {name}: a changed bit of the vectors is not noticed");
    }
    c_on_target(&folder, &runner)?;
    println!("c: every check passed");
    Ok(())
}

/// The line without the leading folder.
fn short(line: &str) -> &str {
    let line = line.trim();
    line.rfind('/').map_or(line, |at| &line[at + 1..])
}

/// Nothing but stdint.h, no 8-bit type, no floating point, no allocation.
fn no_other_types(folder: &Path) -> Result<()> {
    for name in MODULES.iter().chain(&["sagnac_unit.c"]).flat_map(|name| [(*name).to_owned(), name.replace(".c", ".h")])
    {
        let text = fs::read_to_string(folder.join(&name))?;
        for line in text.lines().filter(|line| line.starts_with("#include <")) {
            ensure!(line == "#include <stdint.h>", "{name}: {line}");
        }
        // Comments may contain the refused words.
        let mut code = text.clone();
        while let (Some(from), Some(to)) = (code.find("/*"), code.find("*/")) {
            code.replace_range(from..to + 2, "");
        }
        for word in code.split(|c: char| !c.is_alphanumeric() && c != '_') {
            let refused = ["int8_t", "uint8_t", "char", "short", "float", "double", "malloc", "free"];
            ensure!(!refused.contains(&word), "{name} uses {word}");
        }
    }
    println!("check: C: only stdint.h, no 8-bit type, no floating point, no allocation");
    Ok(())
}

fn misra(folder: &Path) -> Result<()> {
    let args = ["--addon=misra", "--enable=style,warning,portability", "--std=c99", "-q", "--template={id}"];
    let all = [&args[..], &MODULES, &["sagnac_unit.c"]].concat();
    let found = output(600, "cppcheck", &all, folder)?;
    ensure!(found.status.success(), "cppcheck: {}", found.status);
    let stderr = String::from_utf8_lossy(&found.stderr);
    let mut findings: Vec<&str> = stderr.lines().filter(|line| !line.trim().is_empty()).collect();
    findings.sort_unstable();
    let mut left = findings.clone();
    for (rule, times) in JUSTIFIED {
        let count = left.iter().filter(|id| **id == rule).count();
        ensure!(count == times, "cppcheck: {rule} {count} times, docs/explanation/on-target.md justifies {times}");
        left.retain(|id| *id != rule);
    }
    ensure!(left.is_empty(), "cppcheck: {left:?}");
    println!(
        "check: C: cppcheck with MISRA C:2012: {} findings, all justified in docs/explanation/on-target.md",
        findings.len()
    );
    Ok(())
}

/// The compiled constants equal the loaded ones.
fn constants(folder: &Path) -> Result<()> {
    let (unit_image, unit_loops) = (folder.join("unit.img"), folder.join("unit.loops"));
    fs::write(&unit_image, table("compensator-full")?)?;
    fs::write(&unit_loops, table("path-length-mirror")?)?;
    let source = root().join("firmware/c/check_constants.c");
    let program = folder.join("check-constants");
    let given = ["-DIMAGE=sagnac_image_x", "-I.", "sagnac_unit.c", text(&source)?, "-o", text(&program)?];
    stdout_of(300, "gcc", &[&STRICT[..], &given, &MODULES].concat(), folder)?;
    stdout_of(60, text(&program)?, &[text(&unit_image)?, text(&unit_loops)?], folder)?;
    println!("check: C: the constants of sagnac_unit.c are what the loaders read");
    Ok(())
}

/// Changed images and tables with valid checksums: Rust and C must accept or refuse the same ones.
fn loaders(folder: &Path) -> Result<()> {
    let mut dice = 1_u32;
    let mut throw = |below: usize| {
        dice = dice.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (dice >> 8) as usize % below
    };
    let good = [
        (0_u8, table("compensator-edges")?),
        (0, table("compensator-full")?),
        (0, table("compensator-harmonic")?),
        (0, table("compensator-lags")?),
        (0, table("compensator-warm-up")?),
        (1, table("path-length-heater")?),
    ];
    let edges = [0_u8, 1, 2, 7, 8, 15, 16, 30, 31, 32, 62, 63, 64, 0x7f, 0x80, 0xff];
    let mut records = Vec::new();
    for _ in 0..60_000 {
        let (kind, bytes) = &good[throw(good.len())];
        let mut bytes = bytes.clone();
        for _ in 0..throw(3) {
            let at = throw(bytes.len() - 4);
            // The serial number is text: C does not check it.
            if !(16..48).contains(&at) || *kind == 1 {
                bytes[at] = edges[throw(edges.len())];
            }
        }
        if throw(40) == 0 {
            bytes.truncate(throw(bytes.len()) + 1);
        }
        if let Some(body) = bytes.len().checked_sub(4) {
            let crc = sagnac_core::bytes::crc32(&bytes[..body]);
            bytes[body..].copy_from_slice(&crc.to_le_bytes());
        }
        let accepted = if *kind == 0 { Image::decode(&bytes).is_ok() } else { LoopTable::decode(&bytes).is_ok() };
        records.extend([*kind, accepted.into(), bytes.len() as u8, (bytes.len() >> 8) as u8]);
        records.extend(bytes);
    }
    let file = folder.join("verdicts.bin");
    fs::write(&file, records)?;
    let (source, program) = (root().join("firmware/c/check_loader.c"), folder.join("check-loader"));
    let flags = ["-fsanitize=undefined", "-fno-sanitize-recover", "-I.", text(&source)?, "-o", text(&program)?];
    stdout_of(300, "gcc", &[&STRICT[..], &flags, &MODULES].concat(), folder)?;
    println!("check: C: {}", stdout_of(60, text(&program)?, &[text(&file)?], folder)?.trim());
    Ok(())
}

/// Random walks, stuck values and extremes through the watch and the vote of both languages.
fn watches(folder: &Path) -> Result<()> {
    let mut dice = 1_u32;
    let mut throw = || {
        dice = dice.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        dice >> 4
    };
    let mut records = Vec::new();
    let (mut spec, mut values) = (WatchSpec::default(), [0_i32; 4]);
    let (mut watch, mut shown) = (Watch::<4>::new(spec), 0);
    for number in 0..50_000 {
        let new = number % 500 == 0;
        if new {
            spec = WatchSpec {
                shows: throw() >> (throw() % 28),
                still: throw() >> (throw() % 28),
                command_shows: throw() % 9000,
            };
            watch = Watch::new(spec);
        }
        for value in &mut values {
            *value = match throw() % 40 {
                0 => (throw() << 4).cast_signed(),
                1 => [i32::MIN, i32::MAX][(throw() % 2) as usize],
                2..8 => *value,
                _ => value.wrapping_add((throw() % 20_001).cast_signed() - 10_000),
            };
        }
        let present = (throw() & throw().rotate_left(3)) | (throw() % 16);
        let seen: [Option<i32>; 4] = std::array::from_fn(|at| (present >> at & 1 == 1).then_some(values[at]));
        let (has_command, command) = (throw() % 2, (throw() % 30_000).cast_signed());
        let named = watch.update(&seen, (has_command == 1).then_some(command));
        let codes: [i32; 8] = std::array::from_fn(|at| match throw() % 9 {
            0 => [i32::MIN, i32::MAX, 0][(throw() % 3) as usize],
            _ => values[at % 4].wrapping_add((throw() % 100).cast_signed()),
        });
        let (agree, voters) = (throw() >> (throw() % 28), throw() % 256);
        let cast: Vec<Option<i32>> = (0..8).map(|at| (voters >> at & 1 == 1).then_some(codes[at])).collect();
        let vote = sagnac_core::vote(&cast, agree);
        shown += [u32::from(named != 0), u32::from(vote.outvoted != 0 && vote.code.is_some())].iter().sum::<u32>();
        let word = u32::from(vote.code.is_some()) | u32::from(vote.outvoted) << 8 | u32::from(vote.voters) << 16;
        let first = [spec.shows, spec.still, spec.command_shows, present & 15];
        let rest = [has_command, command.cast_unsigned(), named, u32::from(new), agree, voters];
        let codes = codes.map(i32::cast_unsigned);
        let words = first.into_iter().chain(values.map(i32::cast_unsigned)).chain(rest).chain(codes);
        records.extend(words.chain([word, vote.code.unwrap_or(0).cast_unsigned()]).flat_map(u32::to_le_bytes));
    }
    ensure!(shown > 10_000, "only {shown} records name a thermometer");
    let file = folder.join("watch.bin");
    fs::write(&file, records)?;
    let (source, program) = (root().join("firmware/c/check_watch.c"), folder.join("check-watch"));
    let flags = ["-fsanitize=undefined", "-fno-sanitize-recover", "-I.", text(&source)?, "-o", text(&program)?];
    stdout_of(300, "gcc", &[&STRICT[..], &flags, &MODULES].concat(), folder)?;
    println!("check: C: {}", stdout_of(60, text(&program)?, &[text(&file)?], folder)?.trim());
    Ok(())
}

fn c_on_target(folder: &Path, runner: &Path) -> Result<()> {
    let elf = folder.join("check.elf");
    let start = root().join("firmware/c/vectors_mps2.c");
    let part = ["-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"];
    let link = ["--specs=rdimon.specs", "-Wl,--section-start=.vectors=0x0", "-o", text(&elf)?];
    let sources = ["-I.", text(runner)?, text(&start)?];
    // Strict for the exported modules and the check; the start code of a processor casts addresses.
    let strict: Vec<&str> = STRICT.iter().copied().filter(|flag| *flag != "-Wpedantic").collect();
    stdout_of(300, "arm-none-eabi-gcc", &[&part[..], &strict, &sources, &MODULES, &link].concat(), folder)?;
    for path in files()? {
        // The emulator passes only a short command line to the target.
        let name = path.file_name().and_then(|name| name.to_str()).context("a name")?;
        let hosting = format!("enable=on,target=native,arg=check,arg={name}");
        let machine = ["-M", "mps2-an386", "-cpu", "cortex-m4", "-nographic", "-monitor", "none", "-serial", "null"];
        let args = [&machine[..], &["-semihosting-config", &hosting, "-kernel", text(&elf)?]].concat();
        let line = stdout_of(300, "qemu-system-arm", &args, &vectors::folder())?;
        ensure!(line.contains("records equal") || line.contains("skipped"), "{name} on the target: {line}");
        println!("check: C, Cortex-M4F: {}", short(&line));
    }
    Ok(())
}

/// The Verilog export: lint, benches in two simulators, latches, cells; with `place`, place and route too.
pub(crate) fn fpga(place: bool) -> Result<()> {
    need(debian::FPGA)?;
    let folder = root().join("target/fpga");
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
        simulate(&here, name, "tb_compensator", &["sagnac_fast.v", "sagnac_series.v"])?;
    }
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

/// A test bench in both simulators; with one changed bit of the vectors both must fail.
fn simulate(folder: &Path, vectors_name: &str, bench: &str, modules: &[&str]) -> Result<()> {
    let top = format!("{bench}.v");
    let iverilog = ["-g2005", "-Wall", "-I.", "-o", bench, &top];
    stdout_of(120, "iverilog", &[&iverilog[..], modules].concat(), folder)?;
    let built = format!("obj_{bench}");
    let quiet = ["--binary", "-j", "2", "-Wno-fatal", "-Wno-lint", "-Wno-style", "-I.", "--top-module", bench];
    stdout_of(600, "verilator", &[&quiet[..], &["-Mdir", &built, &top], modules].concat(), folder)?;
    let program = format!("{built}/V{bench}");
    let good = vectors::folder().join(vectors_name).with_extension("hex");
    let bad = spoiled(vectors_name, folder)?;
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
        let stdout = run(&bad)?;
        ensure!(
            stdout.contains("FAILED: record"),
            "{bench} in {simulator}: a changed bit of the vectors is not noticed"
        );
    }
    Ok(())
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
