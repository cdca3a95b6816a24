//! `cargo xtask`: the tasks of CI and the makers of generated files.

mod cargo_tools;
mod checks;
mod ci;
mod deny;
mod dist;
mod docs;
mod features;
mod fleet;
mod fuzz;
mod layers;
mod source;
mod studies;
mod test;
mod wheel;

use std::process::ExitCode;

use anyhow::{Result, bail};

/// Tasks that need our crates; the lab does them.
const LAB: [&str; 12] = [
    "bench",
    "bless",
    "c",
    "closed-loop",
    "compare",
    "conserve",
    "firmware",
    "formats",
    "fpga",
    "hunt",
    "pictures",
    "same",
];

const HELP: &str = "\
cargo xtask example    the main job on the log in testdata/: calibrate, export, verify
cargo xtask test       format, layers, every test, doctest and example, the README's commands, the link without a panic path; needs Rust
                       and a C compiler, nothing else
cargo xtask ci         [--all | --list] the parts that a change can break, by ci/passed.toml; --all: every part; --list: which and why

Parts of test
cargo xtask examples   run every example of every crate (after `cargo test` built them)
cargo xtask layers     check the imports of the code against ARCHITECTURE.md
cargo xtask no-panic   link check: sagnac-core, sagnac-loops and sagnac-board have no panic path

Parts of ci
cargo xtask clippy     lints of everything, warnings denied
cargo xtask studies    fit | verify | noise: coverage, power and risk on all records, rows to docs/explanation/evidence/;
                       hours: those that take hours, which ci leaves out
cargo xtask browser    reports and the page of the bench in Chromium
cargo xtask features   compile every crate that has features without any, and with each single one
cargo xtask docs       [--check] the site of docs/ in target/site, with search, equations and rustdoc, for reading without a network
cargo xtask deny       licences, bans and sources of the dependencies
cargo xtask bless      [--check] [names] make the generated files again, all or those named; --check: fail if one is out of date. Names:
                       testdata, image, vectors (only after an intended change of the target), schema, limits, serial-line, glossary, scenario, first-bytes,
                       circle, requirements, cli, errors, faults, pages
cargo xtask conserve   1e9 ticks (27.8 h): every count accounted for
cargo xtask hunt       [MINUTES] generated inputs of every kind through the program, findings to testdata/found; --cases N: so many;
                       --from N, --case N: one again, --found: only those of earlier hunts
cargo xtask fuzz       [--smoke | --address] [targets] a million executions of every fuzz target or of those named; --smoke: a few
                       seconds of each, in the tests' build; --address: with a sanitizer of memory (needs a nightly compiler)
cargo xtask c          the exported C: warnings, MISRA, vectors on this machine and on an emulated Cortex-M4F
cargo xtask fpga       the exported Verilog: lint, vectors in two simulators, synthesis for one family; place: the other families, place
                       and route, by name before a release
cargo xtask firmware   build the firmware, run it in QEMU, compare it with the host bit for bit
cargo xtask closed-loop  [--picture] the circle with the processor in it: the firmware in QEMU sends, the bench records and fits, the image goes back
                       over the same line, a second cycle runs corrected; --picture: the picture of its page again
cargo xtask formats    files of MATLAB, HDF5, TDMS, MDF, ArduPilot, Excel and SQLite, converted as the program says (needs python3-venv)
cargo xtask fleet      the cluster's program in fleet/: lints, licences, tests with executors and an object store (needs python3-venv)
cargo xtask wheel      the Python package in python/: lints, licences, the wheel, types and tests (needs python3-venv); --notebooks: the
                       notebooks' pages in docs/ again
cargo xtask dist       an archive and a Debian package in target/dist, of a release build for old systems (with zig from PyPI);
                       --check packs the program of the tests instead; both are unpacked or installed, and run

Not in ci
cargo xtask bench      [csv | simulator | allan | fleet | python] time and memory compared with other tools, to docs/explanation/performance.md (10 minutes,
                       4 GB in target/bench; needs python3-venv)
cargo xtask compare    fits of Sagnac and other tools on logs with a known truth, to docs/explanation/comparison.md (needs python3-venv)
cargo xtask same       PROGRAM: does another build of `sagnac` give the same records, verdicts and images on testdata and 200 simulated
                       units? For changes that only move code
cargo xtask pictures   make the pictures of the README and of docs/ again (needs chromium)

Missing cargo tools (cargo-deny, mdbook, cargo-fuzz) are installed. Missing Debian packages are installed as root; for other users the
command is printed.";

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    match run(&args).and_then(|()| ci::tell_processor_time()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("xtask {}: {error:#}", args.join(" "));
            ExitCode::FAILURE
        }
    }
}

fn run(args: &[&str]) -> Result<()> {
    match args {
        ["test"] => test::test(),
        ["ci", flags @ ..] => ci::ci(flags),
        ["clippy"] => checks::clippy(),
        ["browser"] => checks::browser(),
        ["studies", args @ ..] => studies::studies(args),
        ["example"] => checks::example(),
        ["no-panic"] => checks::no_panic(),
        ["deny"] => deny::deny(),
        ["features"] => features::features(),
        ["fleet"] => fleet::fleet(),
        ["wheel"] => wheel::wheel(false),
        ["wheel", "--notebooks"] => wheel::wheel(true),
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
