//! Measures the program, checks its exports, and makes the generated files of the project. `cargo xtask` builds the
//! program `lab` with `sagnac` and runs it; the tests of the program check the generated files by [`bless::stale`].

pub mod bless;
mod corpus;
mod hunts;
mod made;
mod makes;
mod measures;
mod places;
mod program;
mod targets;

use anyhow::{Context, Result, bail};

pub use makes::pages::parse_commands;
pub use program::Program;

/// A task by its name, with its arguments.
pub fn run(args: &[&str]) -> Result<()> {
    let (task, rest) = args.split_first().context("no task; `cargo xtask help` lists them")?;
    match *task {
        "bench" => measures::bench::bench(rest.first().copied()),
        "bless" => bless::bless(rest),
        "c" => targets::c(),
        "closed-loop" => targets::closed_loop::closed_loop(rest),
        "compare" => measures::compare::compare(),
        "conserve" => targets::conserve::conserve(),
        "corpus" => {
            let folder = rest.first().context("corpus: into which folder?")?;
            makes::errors::keep(&Program::beside_the_lab()?, folder.as_ref())
        }
        "firmware" => targets::firmware::firmware(),
        "formats" => measures::formats::formats(),
        "fpga" => targets::fpga(rest.contains(&"place")),
        "hunt" => hunts::hunt(rest),
        "pictures" => measures::pictures::pictures(),
        "same" => measures::same::same(rest),
        other => bail!("no such task: {other}; `cargo xtask help` lists them"),
    }
}
