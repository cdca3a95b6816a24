//! The checking programs on emulated processors: a Cortex-M4F, and an AVR, whose `int` has 16 bits and whose memory 16 KB.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use xtask::shell::{output, root, stdout_of, text};

use super::{Given, MODULES, STRICT, banks, short};
use crate::targets::vector_files::files;

/// What the flash of the AVR holds next to the program, bytes.
const AVR_FILE: usize = 40_000;
/// Ticks of a vector file there: the loops take a thousand times as long as here.
const AVR_TICKS: u64 = 60_000;
const AVR: &str = "atmega1284p";

fn source(name: &str) -> PathBuf {
    root().join("firmware/c").join(name)
}

/// Every vector file, and the banks.
pub(super) fn cortex_m(folder: &Path) -> Result<()> {
    let part = ["-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"];
    // Strict for the exported modules and the check; the start code of a processor casts addresses.
    let strict: Vec<&str> = STRICT.iter().copied().filter(|flag| *flag != "-Wpedantic").collect();
    let (start, few) = (source("vectors_mps2.c"), banks::records(folder, 10)?);
    let mut runs: Vec<(&str, PathBuf)> = files()?.into_iter().map(|path| ("check_vectors", path)).collect();
    runs.push(("check_banks", few));
    for program in ["check_vectors", "check_banks"] {
        let (runner, elf) = (source(program).with_extension("c"), folder.join(program).with_extension("elf"));
        let link = ["--specs=rdimon.specs", "-Wl,--section-start=.vectors=0x0", "-o", text(&elf)?];
        let sources = ["-I.", text(&runner)?, text(&start)?];
        stdout_of(300, "arm-none-eabi-gcc", &[&part[..], &strict, &sources, &MODULES, &link].concat(), folder)?;
        for (_, path) in runs.iter().filter(|(of, _)| *of == program) {
            // The emulator passes only a short command line to the target.
            let name = path.file_name().and_then(|name| name.to_str()).context("a name")?;
            let hosting = format!("enable=on,target=native,arg=check,arg={name}");
            let machine =
                ["-M", "mps2-an386", "-cpu", "cortex-m4", "-nographic", "-monitor", "none", "-serial", "null"];
            let args = [&machine[..], &["-semihosting-config", &hosting, "-kernel", text(&elf)?]].concat();
            let line = stdout_of(300, "qemu-system-arm", &args, path.parent().context("a folder")?)?;
            ensure!(line.contains("records equal") || line.contains(" 0 differ"), "{name} on the target: {line}");
            println!("check: C, Cortex-M4F: {}", short(&line));
        }
    }
    Ok(())
}

/// The first records of every file.
pub(super) fn avr(folder: &Path, given: &Given) -> Result<()> {
    let small = folder.join("avr");
    // Objects of older sources have other structures.
    if small.exists() {
        fs::remove_dir_all(&small)?;
    }
    fs::create_dir_all(&small)?;
    for path in files()? {
        let name = path.file_name().and_then(|name| name.to_str()).context("a name")?;
        let (text, records) = first_vectors(&fs::read_to_string(&path)?)?;
        fs::write(small.join(name), text)?;
        run_avr(&small, "check_vectors", name, &format!("{records} records equal"))?;
    }
    // Records of verdicts say their length; those of the watch have 24 words.
    let verdict = |bytes: &[u8]| 4 + usize::from(u16::from_le_bytes([bytes[2], bytes[3]]));
    for (program, from) in [("check_loader", &given.verdicts), ("check_watch", &given.watches)] {
        let (bytes, mut end) = (fs::read(from)?, 0);
        let length = |at: usize| if program == "check_watch" { 96 } else { verdict(&bytes[at..]) };
        while end + length(end) <= AVR_FILE {
            end += length(end);
        }
        fs::write(small.join("first.bin"), &bytes[..end])?;
        run_avr(&small, program, "first.bin", " 0 ")?;
    }
    let banks = banks::records_within(&small, AVR_FILE)?;
    run_avr(&small, "check_banks", text(&banks)?, " 0 differ")
}

/// A vector file with as many of its records as fit, and how many.
fn first_vectors(whole: &str) -> Result<(String, usize)> {
    let head = whole.lines().position(|line| !line.starts_with("//")).context("a head")?;
    let lines: Vec<&str> = whole.lines().collect();
    let words = |line: &str| line.split(' ').map(str::to_owned).collect::<Vec<_>>();
    let mut first = words(lines[head]);
    let table_lines = usize::from_str_radix(&first[2], 16)?.div_ceil(32);
    let table = &lines[head + 1..head + 1 + table_lines];
    let records = &lines[head + 1 + table_lines..];
    let (fit, run) =
        (AVR_FILE / (records[0].len() + 1), if first[1].ends_with('1') { "00000002 " } else { "00000001 " });
    let (mut kept, mut ticks) = (0, 0);
    while kept < records.len().min(fit) && ticks < AVR_TICKS {
        if let Some(inputs) = records[kept].strip_prefix(run) {
            ticks += u64::from_str_radix(inputs.split(' ').next().unwrap_or_default(), 16)?;
        }
        kept += 1;
    }
    first[3] = format!("{kept:08x}");
    let first = first.join(" ");
    let all = [&[first.as_str()], table, &records[..kept], &[""]].concat();
    Ok((all.join("\n"), kept))
}

/// Builds the program with the file in its flash, and runs it in simavr.
fn run_avr(folder: &Path, program: &str, file: &str, wanted: &str) -> Result<()> {
    let exported = folder.parent().context("the exported folder")?;
    let (elf, define) = (folder.join(program).with_extension("elf"), format!("-DHELD_FILE=\"{file}\""));
    let include = format!("-I{}", text(exported)?);
    let part = [&format!("-mmcu={AVR}"), "-O2", "-Wall", "-Wextra", "-ffunction-sections", &include];
    let objects: Vec<String> = MODULES.iter().map(|module| format!("avr_{}", module.replace(".c", ".o"))).collect();
    for (module, object) in MODULES.iter().zip(&objects).filter(|(_, object)| !folder.join(object).exists()) {
        let flags = ["-std=c99", "-Wconversion", "-Wsign-conversion", "-Wshadow", "-Wpedantic", "-Werror", "-c"];
        let module = exported.join(module);
        stdout_of(300, "avr-gcc", &[&part[..], &flags, &[text(&module)?, "-o", object]].concat(), folder)?;
    }
    let objects: Vec<&str> = objects.iter().map(String::as_str).collect();
    let check = source(program).with_extension("c");
    let (start, holder) = (source("avr.c"), source("avr_file.S"));
    let own = ["-std=gnu99", "-Dmain=check_main", &define, text(&check)?, text(&start)?, text(&holder)?];
    let link = ["-Wl,--gc-sections", "-Wl,--undefined=file_from", "-o", text(&elf)?];
    stdout_of(300, "avr-gcc", &[&part[..], &own, &objects, &link].concat(), folder)?;
    let ran = output(600, "simavr", &["-m", AVR, "-f", "20000000", text(&elf)?], folder)?;
    let said = plain(&[ran.stdout, ran.stderr].concat());
    ensure!(said.contains("END 0"), "{program} of {file} on an AVR: {said}");
    let line = said.lines().find(|line| line.contains(wanted)).with_context(|| format!("{program}: {said}"))?;
    println!("check: C, 16-bit int (AVR): {}", line.trim_end_matches('.').replace("file", file));
    Ok(())
}

/// The emulator's log without its colours.
fn plain(log: &[u8]) -> String {
    String::from_utf8_lossy(log).replace("\u{1b}[32m", "").replace("\u{1b}[0m", "")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shortened_file_says_how_many_records_it_has() {
        let whole = "// about\n5a67ac01 00000004 00000000 00000002\n0 1\n2 3\n";
        assert_eq!(first_vectors(whole).unwrap(), ("5a67ac01 00000004 00000000 00000002\n0 1\n2 3\n".to_owned(), 2));
        assert_eq!(plain(b"\x1b[32mEND 0.\n\x1b[0m"), "END 0.\n");
    }
}
