//! `sagnac`: thermal calibration of ring laser gyros from the command line.
//!
//! A verb reads its arguments, calls the library and prints (`verbs`). Exit status: 0
//! done, 1 limits not met, 2 bad usage or input, 3 refused because the data cannot support the answer.
#![cfg_attr(not(test), deny(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod args;
mod files;
mod output;
mod verbs;

use std::io::Write;
use std::process::ExitCode;

use clap::{FromArgMatches as _, Parser, Subcommand};
use sagnac_log::read::protect_inputs;
use sagnac_log::threads::{STACK_BYTES, spawn};
use sagnac_units::format::printable;

use crate::files::Files;
use crate::files::interrupt;
use crate::files::log_paths::expanded;
use crate::files::named::named;
use crate::output::console::{self, Console, Loudness, Outcome};
use crate::verbs::{Verbs, manual, old};

const EXAMPLES: &str = "\
Examples:
  sagnac calibrate cycle-1.csv cycle-2.csv --arcsec-per-count 1.059 --serial RLG-7 -o unit.cal.json --report unit.html
  sagnac verify unit.cal.json retest.csv --limits limits.toml --report retest.html
  sagnac export unit.cal.json --to image -o unit.img
  sagnac compensate unit.img retest.csv -o corrected.csv

Exit status: 0 done, 1 limits not met, 2 bad usage or input, 3 refused by the data.";

const ABOUT: &str = "Temperature compensation for gyroscopes: fit, verify, export";

/// The command line.
#[derive(Parser)]
#[command(name = "sagnac", version, about = ABOUT, after_help = EXAMPLES)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// Everything that is known: terms, candidates, diagnostics
    #[arg(short, long, global = true, conflicts_with = "quiet")]
    verbose: bool,
    /// Errors alone; the exit status has the verdict
    #[arg(short, long, global = true)]
    quiet: bool,
}

impl Cli {
    fn loudness(&self) -> Loudness {
        match (self.quiet, self.verbose) {
            (true, _) => Loudness::Quiet,
            (_, true) => Loudness::Verbose,
            _ => Loudness::Brief,
        }
    }
}

#[derive(Subcommand)]
enum Command {
    #[command(flatten)]
    Verb(Box<Verbs>),
    #[command(hide = true)]
    Manual(manual::Args),
}

fn main() -> ExitCode {
    // Files are decoded on a stack of a stated size. Where the machine allows no further thread, this one does the work.
    match spawn("sagnac", begin) {
        Ok(thread) => {
            thread.join().unwrap_or_else(|_| Console::new(false, Loudness::Brief).complain(&console::internal_error()))
        }
        Err(_) => begin(),
    }
}

/// Works with a thread for each processor, or with this one alone where the machine allows no further one.
fn on_all_processors<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    match rayon::ThreadPoolBuilder::new().stack_size(STACK_BYTES).build() {
        Ok(pool) => pool.install(work),
        Err(_) => {
            // There is no other pool yet, so this cannot fail.
            let _ = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global();
            work()
        }
    }
}

fn begin() -> ExitCode {
    let program = <Cli as clap::CommandFactory>::command();
    let parsed = program.clone().try_get_matches();
    let (mut cli, named) = match parsed.and_then(|found| Ok((Cli::from_arg_matches(&found)?, named(&program, &found))))
    {
        Ok(parsed) => parsed,
        Err(said) => return arguments_said(&said),
    };
    let json = match &mut cli.command {
        Command::Verb(verbs) => verbs.verb().json(),
        Command::Manual(_) => false,
    };
    let loudness = cli.loudness();
    let mut console = Console::new(json, loudness);
    console::keep_panics_quiet();
    interrupt::leave_nothing_behind();
    protect_inputs();
    let ran = std::panic::catch_unwind(|| {
        on_all_processors(|| {
            let mut console = Console::new(json, loudness);
            let ran = run(cli.command, named, &mut console);
            console.ended(ran)
        })
    });
    match ran {
        Ok(Ok(Outcome::Done)) => ExitCode::SUCCESS,
        Ok(Ok(Outcome::LimitsNotMet | Outcome::SomeFailed)) => ExitCode::from(1),
        Ok(Err(error)) => console.complain(&error),
        Err(_) => console.complain(&console::internal_error()),
    }
}

/// Help, the version, or what is wrong with the arguments. Text that cannot be written is an error, and an argument does not control the
/// terminal.
fn arguments_said(said: &clap::Error) -> ExitCode {
    let words: Vec<String> = std::env::args_os().skip(1).map(|word| word.to_string_lossy().into_owned()).collect();
    if let Some(error) = old::answer(&words) {
        return Console::new(false, Loudness::Brief).complain(&error);
    }
    let plain = said.render().to_string();
    let written = match printable(&plain) {
        std::borrow::Cow::Borrowed(_) => said.print().and_then(|()| std::io::stdout().flush()),
        std::borrow::Cow::Owned(escaped) => write!(std::io::stderr(), "{escaped}"),
    };
    match written {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Console::new(false, Loudness::Brief).complain(&sagnac::Error::io("standard output", "write", &error))
        }
        _ => ExitCode::from(u8::try_from(said.exit_code()).unwrap_or(2)),
    }
}

fn run(command: Command, mut named: Files, console: &mut Console) -> console::Ran {
    match command {
        Command::Verb(mut verbs) => {
            let verb = verbs.verb();
            if let Some(logs) = verb.logs() {
                *logs = expanded(logs, console)?;
                named = named.reads(logs.iter());
            }
            named.check()?;
            verb.run(console)
        }
        Command::Manual(args) => manual::run(&args, <Cli as clap::CommandFactory>::command(), console),
    }
}
