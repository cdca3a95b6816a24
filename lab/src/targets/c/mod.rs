//! `cargo xtask c`: the C export, built as by a user and checked against the vectors and against the Rust crates, on machines of
//! every kind: 64 and 32 bits, big-endian, 16-bit `int`, and a Cortex-M.
//!
//! ```text
//! Rust crates ─▶ records (verdicts, watches, banks, lines) ─┐
//! testdata/vectors ─────────────────────────────────────────┴─▶ programs of firmware/c on each machine ─▶ equal, or a failure
//! ```

mod banks;
mod board;
mod checks;
mod coverage;
mod kit;
mod line;
mod records;
mod target;

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};
use sagnac_ports::{FixedBias, Part, c_files};
use xtask::debian::{self, need};
use xtask::shell::{output, root, stdout_of, text};

use crate::targets::faults;
use crate::targets::vector_files::{Spoiled, files, image, loops, spoiled, write};

const STRICT: [&str; 9] =
    ["-std=c99", "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Wshadow", "-Werror"];
/// The modules, in the order of their layers.
const MODULES: [&str; 16] = [
    "sagnac_integer.c",
    "sagnac_hash.c",
    "sagnac_compensator.c",
    "sagnac_error_bound.c",
    "sagnac_upset.c",
    "sagnac_watch.c",
    "sagnac_quadrature.c",
    "sagnac_strip.c",
    "sagnac_path_length.c",
    "sagnac_intensity.c",
    "sagnac_identity.c",
    "sagnac_banks.c",
    "sagnac_signature.c",
    "sagnac_frame.c",
    "sagnac_upload.c",
    "sagnac_board.c",
];

/// A compiler, and what runs its programs here.
struct Machine {
    name: &'static str,
    compiler: &'static str,
    flags: &'static [&'static str],
    runner: Option<&'static str>,
}

const MACHINES: [Machine; 3] = [
    Machine {
        name: "64-bit",
        compiler: "gcc",
        flags: &["-fsanitize=undefined,address", "-fno-sanitize-recover"],
        runner: None,
    },
    // The kernel's headers by their folder: the package that links them for 32 bits conflicts with the compiler for PowerPC.
    Machine {
        name: "32-bit",
        compiler: "gcc",
        flags: &["-m32", "-isystem", "/usr/include/x86_64-linux-gnu"],
        runner: None,
    },
    Machine { name: "big-endian", compiler: "powerpc-linux-gnu-gcc-12", flags: &["-static"], runner: Some("qemu-ppc") },
];

/// Everything that a firmware team would ask of the export.
pub(crate) fn c() -> Result<()> {
    need(debian::C)?;
    let folder = root().join("target/c");
    write(&folder, &c_files(&[(image("compensator-full")?, FixedBias::Unknown)], Some(&loops()?), &Part::ALL))?;
    checks::all(&folder)?;
    let given = Given {
        verdicts: records::verdicts(&folder)?,
        watches: records::watches(&folder)?,
        bounds: records::bounds(&folder)?,
        banks: banks::records(&folder, 200)?,
        lines: line::sessions(&folder, 120)?,
        keyed: line::keyed(&folder, 40)?,
        boards: board::records(&folder, 60)?,
        faults: faults::vectors(&folder)?,
    };
    for machine in &MACHINES {
        machine.check(&folder, &given)?;
    }
    line::with_a_key(&MACHINES[0], &folder, &given.keyed)?;
    kit::all(&folder)?;
    target::cortex_m(&folder)?;
    target::avr(&folder, &given)?;
    coverage::coverage(&folder, &given)?;
    println!("c: every check passed");
    Ok(())
}

/// The records that every machine reads.
struct Given {
    verdicts: PathBuf,
    watches: PathBuf,
    bounds: PathBuf,
    banks: PathBuf,
    lines: Vec<line::Session>,
    keyed: Vec<line::Session>,
    boards: PathBuf,
    /// Vector files.
    faults: Vec<PathBuf>,
}

impl Machine {
    /// Compiles the modules, once for all programs.
    fn compile(&self, folder: &Path) -> Result<()> {
        let here = folder.join(self.objects());
        fs::create_dir_all(&here)?;
        let sources = MODULES.map(|module| format!("../{module}"));
        let sources: Vec<&str> = sources.iter().map(String::as_str).collect();
        stdout_of(300, self.compiler, &[&STRICT[..], self.flags, &["-c"], &sources].concat(), &here)?;
        Ok(())
    }

    /// The folder of the compiled modules.
    fn objects(&self) -> String {
        format!("objects-{}", self.name)
    }

    /// Builds one of the programs of firmware/c with all modules; `options` are its own.
    fn build(&self, folder: &Path, program: &str, options: &[&str]) -> Result<PathBuf> {
        let source = root().join("firmware/c").join(program).with_extension("c");
        let made = folder.join(format!("{program}-{}{}", self.name, options.concat()));
        let objects = MODULES.map(|module| format!("{}/{}", self.objects(), module.replace(".c", ".o")));
        let objects: Vec<&str> = objects.iter().map(String::as_str).collect();
        let own = ["-I.", text(&source)?, "-o", text(&made)?];
        stdout_of(300, self.compiler, &[&STRICT[..], self.flags, &own, &objects, options].concat(), folder)?;
        Ok(made)
    }

    fn run(&self, folder: &Path, program: &Path, args: &[&str]) -> Result<String> {
        match self.runner {
            None => stdout_of(300, text(program)?, args, folder),
            Some(runner) => stdout_of(600, runner, &[&[text(program)?], args].concat(), folder),
        }
    }

    fn check(&self, folder: &Path, given: &Given) -> Result<()> {
        self.compile(folder)?;
        let vectors = self.build(folder, "check_vectors", &[])?;
        for path in files()? {
            let line = self.run(folder, &vectors, &[text(&path)?])?;
            println!("check: C, {}: {}", self.name, short(&line));
        }
        let faults: Vec<&str> = given.faults.iter().map(|path| text(path)).collect::<Result<_>>()?;
        let equal = self.run(folder, &vectors, &faults)?.lines().count();
        ensure!(equal == faults.len(), "C, {}: {equal} of {} runs of faults", self.name, faults.len());
        println!("check: C, {}: {equal} runs of faults equal", self.name);
        self.notices(folder, &vectors, &spoiled("compensator-full", folder, Spoiled::Last)?)?;
        for (program, records) in [
            ("check_loader", &given.verdicts),
            ("check_watch", &given.watches),
            ("check_bound", &given.bounds),
            ("check_banks", &given.banks),
            ("check_board", &given.boards),
        ] {
            let built = self.build(folder, program, &[])?;
            println!("check: C, {}: {}", self.name, self.run(folder, &built, &[text(records)?])?.trim());
            // The last record ends with a verdict, or with a number of the last bank.
            let mut bytes = fs::read(records)?;
            if program == "check_loader" {
                bytes[1] ^= 1;
            } else {
                *bytes.last_mut().context("records")? ^= 1;
            }
            let bad = folder.join("spoiled.bin");
            fs::write(&bad, bytes)?;
            self.notices(folder, &built, &bad)?;
        }
        let edges = self.build(folder, "check_edges", &[])?;
        println!("check: C, {}: {}", self.name, self.run(folder, &edges, &["line.loops"])?.trim());
        line::check(self, folder, &given.lines)
    }

    /// A check that cannot fail is none.
    fn notices(&self, folder: &Path, program: &Path, bad: &Path) -> Result<()> {
        let args = [text(program)?, text(bad)?];
        let (program, args) = self.runner.map_or((args[0], &args[1..]), |runner| (runner, &args[..]));
        let failed = output(300, program, args, folder)?;
        ensure!(failed.status.code() == Some(1), "C, {}: a changed bit of {} is not noticed", self.name, bad.display());
        Ok(())
    }
}

/// The line without the leading folder.
fn short(line: &str) -> &str {
    let line = line.trim();
    line.rfind('/').map_or(line, |at| &line[at + 1..])
}
