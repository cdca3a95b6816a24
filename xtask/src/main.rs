//! `cargo xtask`: what CI runs, and what makes the files that the project made.

mod checks;
mod docs;
mod fuzz;
mod layers;

use std::process::ExitCode;

use anyhow::{Result, bail};

/// Tasks that need our crates; the lab does them.
const LAB: [&str; 13] = [
    "bench", "c", "cli", "compare", "conserve", "errors", "firmware", "fpga", "hexdump", "pictures", "schema",
    "testdata", "vectors",
];

const HELP: &str = "\
cargo xtask ci         everything that CI runs: fmt, clippy, docs, deny, no-panic, conserve, tests, c, fpga, firmware
cargo xtask example    the main job on the log in testdata/: calibrate, export, verify
cargo xtask no-panic   link check: sagnac-core, sagnac-loops and sagnac-board have no panic path
cargo xtask conserve   1e9 ticks (27.8 h): every count accounted for
cargo xtask layers     the imports of the code against the drawing in ARCHITECTURE.md
cargo xtask deny       licences, bans and sources of the dependencies (installs cargo-deny if missing)
cargo xtask testdata   make the logs in testdata/ anew
cargo xtask bench      [simulator | allan] time and memory beside the peers, to docs/explanation/performance.md (10 minutes, 4 GB in target/bench; needs python3-venv)
cargo xtask compare    ours and the peers' fits on one set of logs with a known truth, to docs/explanation/comparison.md (needs python3-venv)
cargo xtask fuzz       a million executions of every fuzz target, or of those named (installs cargo-fuzz if missing)
cargo xtask pictures   make the pictures of the README and of docs/ anew (needs chromium)
cargo xtask errors     make docs/reference/errors.md anew
cargo xtask docs       [--check] the site of docs/ in target/site, with search, equations and rustdoc, for reading without a network (installs mdbook if missing)
cargo xtask cli        make docs/reference/cli.md anew
cargo xtask firmware   build the firmware, run it in QEMU, compare it with the host bit for bit (needs Debian's packages; installs them)
cargo xtask c          the exported C: warnings, MISRA, vectors on this machine and on an emulated Cortex-M4F (installs Debian's packages)
cargo xtask fpga       [place] the exported Verilog: lint, vectors in two simulators, synthesis (installs Debian's packages)
cargo xtask vectors    make the reference vectors in testdata/vectors/ anew: only after a change of the target that is meant
cargo xtask schema     make docs/reference/calibration.schema.json anew
cargo xtask hexdump    make the worked example of docs/reference/image-format.md anew (testdata/image/)";

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
        ["ci"] => checks::ci(),
        ["example"] => checks::example(),
        ["no-panic"] => checks::no_panic(),
        ["deny"] => checks::deny(),
        ["layers"] => layers::layers(),
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
