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
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use sagnac_log::threads::{STACK_BYTES, spawn};
use sagnac_units::format::printable;

use crate::files::interrupt;
use crate::files::log_paths::expanded;
use crate::output::console::{self, Console, Outcome};

const EXAMPLES: &str = "\
Examples:
  sagnac calibrate cycle-1.csv cycle-2.csv --arcsec-per-count 1.059 --serial RLG-7 -o unit.cal.json --report unit.html
  sagnac verify unit.cal.json cycle-3.csv --limits limits.toml --report retest.html
  sagnac export unit.cal.json --to image -o unit.img
  sagnac compensate unit.img cycle-3.csv -o corrected.csv

Exit status: 0 done, 1 limits not met, 2 bad usage or input, 3 refused by the data.";

const ABOUT: &str =
    "Makes ring laser gyroscopes hold still over temperature: fits, proves and corrects their thermal drift";

/// The command line.
#[derive(Parser)]
#[command(name = "sagnac", version, about = ABOUT, after_help = EXAMPLES)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Calibrate(verbs::calibrate::Args),
    Verify(verbs::verify::Args),
    Compare(verbs::compare::Args),
    Compensate(verbs::compensate::Args),
    Window(verbs::window::Args),
    Allan(verbs::allan::Args),
    Inspect(verbs::inspect::Args),
    Evaluate(verbs::evaluate::Args),
    Fleet(verbs::fleet::Args),
    Plan(verbs::plan::Args),
    #[cfg(feature = "full")]
    Bench(verbs::bench::Args),
    Export(verbs::export::Args),
    #[cfg(feature = "full")]
    Frames(verbs::line::read::Args),
    Key(verbs::key::Args),
    Line(verbs::line::Args),
    Import(verbs::import::Args),
    Init(verbs::init::Args),
    Demo(verbs::simulate::paper::Args),
    Simulate(verbs::simulate::Args),
    Manual(verbs::manual::Args),
}

fn main() -> ExitCode {
    // Files are decoded on a stack of a stated size. Where the machine allows no further thread, this one does the work.
    match spawn("sagnac", begin) {
        Ok(thread) => thread.join().unwrap_or_else(|_| Console::new(false).complain(&console::internal_error())),
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
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(said) => return arguments_said(&said),
    };
    let json = match &cli.command {
        Command::Calibrate(args) => args.json,
        Command::Verify(args) => args.json,
        Command::Allan(args) => args.json,
        Command::Compare(args) => args.json,
        Command::Inspect(args) => args.json,
        Command::Evaluate(args) => args.json,
        Command::Fleet(args) => args.is_json(),
        Command::Plan(args) => args.json,
        _ => false,
    };
    let mut console = Console::new(json);
    console::keep_panics_quiet();
    interrupt::leave_nothing_behind();
    let ran = std::panic::catch_unwind(|| {
        on_all_processors(|| {
            let mut console = Console::new(json);
            let ran = run(cli.command, &mut console);
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
    let plain = said.render().to_string();
    let written = match printable(&plain) {
        std::borrow::Cow::Borrowed(_) => said.print().and_then(|()| std::io::stdout().flush()),
        std::borrow::Cow::Owned(escaped) => write!(std::io::stderr(), "{escaped}"),
    };
    match written {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Console::new(false).complain(&sagnac::Error::io("standard output", "write", &error))
        }
        _ => ExitCode::from(u8::try_from(said.exit_code()).unwrap_or(2)),
    }
}

/// The arguments that are logs: a folder or a pattern stands for the logs in it.
fn logs_of(command: &mut Command) -> Option<&mut Vec<PathBuf>> {
    match command {
        Command::Calibrate(args) => Some(&mut args.logs),
        Command::Verify(args) => Some(&mut args.retests),
        Command::Window(args) => Some(&mut args.logs),
        Command::Allan(args) => Some(&mut args.logs),
        Command::Inspect(args) => Some(&mut args.files),
        _ => None,
    }
}

fn run(mut command: Command, console: &mut Console) -> console::Ran {
    if let Some(logs) = logs_of(&mut command) {
        *logs = expanded(logs, console)?;
    }
    match command {
        Command::Calibrate(args) => verbs::calibrate::run(&args, console),
        Command::Verify(args) => verbs::verify::run(&args, console),
        Command::Compensate(args) => verbs::compensate::run(&args, console),
        Command::Window(args) => verbs::window::run(&args, console),
        Command::Allan(args) => verbs::allan::run(&args, console),
        Command::Compare(args) => verbs::compare::run(&args, console),
        Command::Inspect(args) => verbs::inspect::run(&args, console),
        Command::Evaluate(args) => verbs::evaluate::run(&args, console),
        Command::Fleet(args) => verbs::fleet::run(&args, console),
        Command::Plan(args) => verbs::plan::run(&args, console),
        #[cfg(feature = "full")]
        Command::Bench(args) => verbs::bench::run(&args, console),
        Command::Export(args) => verbs::export::run(&args, console),
        #[cfg(feature = "full")]
        Command::Frames(args) => verbs::line::read::run(&args, console),
        Command::Key(args) => verbs::key::run(&args, console),
        Command::Line(args) => verbs::line::run(&args, console),
        Command::Import(args) => verbs::import::run(&args, console),
        Command::Init(args) => verbs::init::run(&args, console),
        Command::Demo(args) => verbs::simulate::paper::run(&args, console),
        Command::Simulate(args) => verbs::simulate::run(&args, console),
        Command::Manual(args) => verbs::manual::run(&args, <Cli as clap::CommandFactory>::command(), console),
    }
}
