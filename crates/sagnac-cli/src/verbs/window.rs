//! `sagnac window`: the window table as Parquet.

use std::path::PathBuf;

use sagnac::window::{write_table, write_table_csv};
use sagnac_log::write::write_bytes;
use sagnac_units::format::counted;

use crate::args::setup::LogArgs;
use crate::files::{Files, loading};
use crate::output::console::{Console, Outcome, Ran};
use crate::output::tables::excluded;
use crate::verbs::verb::Verb;

/// Sum logs into analysis windows and write them as a Parquet table, or CSV to look at
#[derive(clap::Args)]
#[command(after_help = "\
Example:
  sagnac window cycle-1.csv cycle-2.csv --setup bench.toml -o w.parquet && sagnac calibrate w.parquet -o unit.cal.json")]
pub(crate) struct Args {
    /// Logs, each a run; a folder or a pattern stands for its logs
    #[arg(required = true)]
    logs: Vec<PathBuf>,
    /// Table to write: Parquet, which calibrate takes in place of logs, or CSV for a name in .csv
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    #[command(flatten)]
    reading: LogArgs,
}

impl Verb for Args {
    fn logs(&mut self) -> Option<&mut Vec<PathBuf>> {
        Some(&mut self.logs)
    }

    fn run(&self, console: &mut Console) -> Ran {
        loading::check_output_name(&self.output, "Parquet, or CSV for .csv")?;
        Files::new().reads(&self.logs).reads(&self.reading.setup.setup).writes([&self.output]).check()?;
        let (windows, setup) = self.reading.windows(&self.logs)?;
        let mut bytes = Vec::new();
        if loading::has_extension(&self.output, "csv") {
            write_table_csv(&windows, &setup, &mut bytes)?;
        } else {
            write_table(&windows, &setup, &mut bytes)?;
        }
        write_bytes(&self.output, &bytes)?;
        let used = windows.rows.excluded.iter().filter(|reason| reason.is_none()).count();
        console.say(format!(
            "wrote {}: {} of {}, {used} to be used",
            self.output.display(),
            counted(windows.len(), "window", "windows"),
            counted(windows.runs.len(), "run", "runs")
        ));
        for line in excluded(&windows.tallies.list()) {
            console.say(line);
        }
        Ok(Outcome::Done)
    }
}
