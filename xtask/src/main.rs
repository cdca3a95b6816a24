//! `cargo xtask`: the tasks of CI and the makers of generated files.

mod cargo_tools;
mod checks;
mod ci;
mod dist;
mod docs;
mod features;
mod fuzz;
mod layers;

use std::process::ExitCode;

use anyhow::{Result, bail};

/// Tasks that need our crates; the lab does them.
const LAB: [&str; 8] = ["bench", "bless", "c", "compare", "conserve", "firmware", "fpga", "pictures"];

const HELP: &str = "\
cargo xtask example    the main job on the log in testdata/: calibrate, export, verify
cargo xtask ci         everything that CI runs: first which Debian packages are missing, last what each part took

Parts of ci
cargo xtask examples   run every example of every crate (after `cargo test --workspace` built them)
cargo xtask layers     the imports of the code against the drawing in ARCHITECTURE.md
cargo xtask features   every crate with features compiles without any, and with each alone
cargo xtask docs       [--check] the site of docs/ in target/site, with search, equations and rustdoc, for reading without a network
cargo xtask deny       licences, bans and sources of the dependencies
cargo xtask no-panic   link check: sagnac-core, sagnac-loops and sagnac-board have no panic path
cargo xtask bless      --check holds the generated files; without it they are made anew, or those named: testdata, image, vectors
                       (only after a change of the target that is meant), schema, glossary, scenario, first-bytes, circle, cli, errors, faults, pages;
                       and evidence, only where it is named: it runs the tests that measure coverage and risk (minutes)
cargo xtask conserve   1e9 ticks (27.8 h): every count accounted for
cargo xtask fuzz       [--smoke] [targets] a million executions of every fuzz target or of those named; --smoke: a few seconds of each
cargo xtask c          the exported C: warnings, MISRA, vectors on this machine and on an emulated Cortex-M4F
cargo xtask fpga       [place] the exported Verilog: lint, vectors in two simulators, synthesis
cargo xtask firmware   build the firmware, run it in QEMU, compare it with the host bit for bit
cargo xtask dist       --check packs the tests' program, installs and runs it; without it: an archive and a Debian package in target/dist,
                       of a release build for old systems (from PyPI: zig; a few minutes)

Not in ci
cargo xtask bench      [simulator | allan] time and memory beside the peers, to the page of figures (10 minutes, 4 GB in target/bench; needs python3-venv)
cargo xtask compare    ours and the peers' fits on one set of logs with a known truth, to its page (needs python3-venv)
cargo xtask pictures   make the pictures of the README and of docs/ anew (needs chromium)

Tools of cargo (cargo-deny, mdbook, cargo-fuzz) are installed where they are missing. Debian's packages are installed for root; anyone else
is told the command.";

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    match run(&args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("xtask {}: {error:#}", args.join(" "));
            ExitCode::FAILURE
        }
    }
}

fn run(args: &[&str]) -> Result<()> {
    match args {
        ["ci"] => ci::ci(),
        ["example"] => checks::example(),
        ["no-panic"] => checks::no_panic(),
        ["deny"] => checks::deny(),
        ["features"] => features::features(),
        ["layers"] => layers::layers(),
        ["dist", args @ ..] => dist::dist(args),
        ["examples"] => checks::examples(),
        ["docs", flags @ ..] => docs::docs(flags.contains(&"--check")),
        ["fuzz", targets @ ..] => fuzz::fuzz(targets),
        [task, ..] if LAB.contains(task) => checks::lab(args),
        [] | ["help"] => {
            println!("{HELP}");
            Ok(())
        }
        other => bail!("no such task: {}\n{HELP}", other.join(" ")),
    }
}
