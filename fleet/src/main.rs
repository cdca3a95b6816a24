//! `sagnac-fleet`: a factory's gyros on a cluster and from object stores.
//!
//! ```text
//! SOURCE: folder, pattern, manifest, s3://… ─▶ units ─┬─ local threads ───────────────────────┬─▶ Results: records, proofs, fleet.parquet
//!                                                     └─ Ballista: calibrate_unit(recipe, unit) ┘
//! ```
//!
//! The function of one unit is [`sagnac::fleet::answer`], wherever it runs: the engine only sends units and brings answers back. No row of a
//! log goes over the wire; an executor reads the logs itself, from a path that it shares with the others or from an object store.

mod calibrate;
mod cluster;
mod function;
mod serve;
mod sql;
mod store;

use std::process::ExitCode;

use clap::Parser;
use sagnac::{Error, ErrorKind};

/// Calibrate all gyros of a factory on a cluster and from object stores
#[derive(Parser)]
#[command(name = "sagnac-fleet", version, max_term_width = 120)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(clap::Subcommand)]
enum Command {
    Calibrate(calibrate::Args),
    Sql(sql::Args),
    Scheduler(serve::SchedulerArgs),
    Executor(serve::ExecutorArgs),
}

fn main() -> ExitCode {
    let ran = match Cli::parse().command {
        Command::Calibrate(args) => calibrate::run(&args),
        Command::Sql(args) => sql::run(&args).map(|()| true),
        Command::Scheduler(args) => serve::scheduler(&args).map(|()| true),
        Command::Executor(args) => serve::executor(&args).map(|()| true),
    };
    match ran {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(e) => refused(&e),
    }
}

/// The message, and the exit status of `sagnac`: 2 for bad usage or input, 3 for a refusal.
fn refused(error: &Error) -> ExitCode {
    let (word, status) = if error.kind == ErrorKind::Refused { ("refused", 3) } else { ("error", 2) };
    eprintln!("{word}: {error}");
    eprintln!("help: {}", error.help);
    ExitCode::from(status)
}

/// Threads for the network; what calculates has its own.
fn runtime() -> sagnac::Result<tokio::runtime::Runtime> {
    tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .thread_stack_size(sagnac_log::threads::STACK_BYTES)
        .build()
        .map_err(|e| {
            Error::input(
                format!("the machine allows no threads for the network: {e}"),
                "raise the limit of threads (`ulimit -u`)",
            )
        })
}
