//! `sagnac fleet`: a factory's gyros.

mod calibrate;
mod demo;
mod prior;
mod report;

use crate::output::console::{Console, Ran};
use crate::verbs::verb::Verb;

/// Calibrate all gyros of a factory, and predict the next one
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
    fn verb(&self) -> &dyn Verb {
        match &self.command {
            Command::Calibrate(args) => args.as_ref(),
            Command::Prior(args) => args,
            Command::Report(args) => args,
            Command::Demo(args) => args,
        }
    }
}

impl Verb for Args {
    fn json(&self) -> bool {
        self.verb().json()
    }

    fn run(&self, console: &mut Console) -> Ran {
        self.verb().run(console)
    }
}
