//! Measures the program, checks its exports, and makes the generated files of the project. `cargo xtask` builds the
//! program `lab` with `sagnac` and runs it; the tests of the program check the generated files by [`bless::stale`].

mod bench;
pub mod bless;
mod closed_loop;
mod compare;
mod conserve;
mod corpus;
mod exports;
mod firmware;
mod formats;
mod hunt;
mod made;
mod makes;
mod pictures;
mod places;
mod program;
mod same;

use anyhow::{Context, Result, bail};

pub use makes::pages::parse_commands;
pub use program::Program;

/// A task by its name, with its arguments.
pub fn run(args: &[&str]) -> Result<()> {
    let (task, rest) = args.split_first().context("no task; `cargo xtask help` lists them")?;
    match *task {
        "bench" => bench::bench(rest.first().copied()),
        "bless" => bless::bless(rest),
        "c" => exports::c(),
        "closed-loop" => closed_loop::closed_loop(rest),
        "compare" => compare::compare(),
        "conserve" => conserve::conserve(),
        "corpus" => {
            let folder = rest.first().context("corpus: into which folder?")?;
            makes::errors::keep(&Program::beside_the_lab()?, folder.as_ref())
        }
        "firmware" => firmware::firmware(),
        "formats" => formats::formats(),
        "fpga" => exports::fpga(rest.contains(&"place")),
        "hunt" => hunt::hunt(rest),
        "pictures" => pictures::pictures(),
        "same" => same::same(rest),
        other => bail!("no such task: {other}; `cargo xtask help` lists them"),
    }
}
