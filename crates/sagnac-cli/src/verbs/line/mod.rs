//! `sagnac line`: a gyro's serial line. `read` shows what the gyro said, `send` says something to it.

#[cfg(feature = "full")]
mod read;
pub(crate) mod send;

use crate::output::console::{Console, Ran};
use crate::verbs::verb::Verb;

/// Read a gyro's serial line, or send it a message
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(clap::Subcommand)]
enum Command {
    #[cfg(feature = "full")]
    Read(read::Args),
    Send(send::Args),
}

impl Verb for Args {
    fn run(&self, console: &mut Console) -> Ran {
        match &self.command {
            #[cfg(feature = "full")]
            Command::Read(args) => args.run(console),
            Command::Send(args) => args.run(console),
        }
    }
}
