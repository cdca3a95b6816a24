//! `sagnac fleet`: a factory's gyros.

mod calibrate;
mod demo;
mod prior;
mod report;

use crate::output::console::{Console, Ran};

/// Calibrate a factory's gyros, and learn from them what the next one is like
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(clap::Subcommand)]
enum Command {
    Calibrate(Box<calibrate::Args>),
    Prior(prior::Args),
    Report(report::Args),
    Demo(demo::Args),
}

impl Args {
    pub(crate) fn is_json(&self) -> bool {
        match &self.command {
            Command::Calibrate(args) => args.json,
            Command::Prior(args) => args.json,
            Command::Report(_) | Command::Demo(_) => false,
        }
    }
}

pub(crate) fn run(args: &Args, console: &mut Console) -> Ran {
    match &args.command {
        Command::Calibrate(args) => calibrate::run(args, console),
        Command::Prior(args) => prior::run(args, console),
        Command::Report(args) => report::run(args, console),
        Command::Demo(args) => demo::run(args, console),
    }
}
