//! `sagnac fleet calibrate`: the same for a factory's gyros, unit by unit.

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

use sagnac::Error;
use sagnac::fleet::{self, Done, FleetWork, InOrder, PriorFile, Recipe, TABLE, outputs_of, units_of};
use sagnac::verify::Limits;
use sagnac_log::setup::Setup;

use crate::args::setup::SetupArgs;
use crate::args::setup::source_date_epoch;
use crate::files::Files;
use crate::output::console::{Console, Outcome, Ran};
use crate::output::progress::UnitProgress;
use crate::verbs::verb::Verb;

/// Calibrate every unit of a folder or a manifest
///
/// Records equal those of `sagnac calibrate`, byte for byte. A unit without a calibration gets a row with its reason, and exit status is 1.
/// A second run works only on changed units.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  sagnac fleet calibrate units/ --setup bench.toml -o fleet/ --limits navigation-grade
  sagnac fleet calibrate 'data/{lot}/unit={unit}/{use}-{run}.parquet' --setup bench.toml -o fleet/
  sagnac fleet calibrate manifest.csv -o fleet/")]
pub(crate) struct Args {
    /// Units: a folder with a folder for each (its logs, those in retest/, its bench.toml), a pattern of logs with {unit}, or a
    /// manifest, CSV with the columns unit, run, and lot, rig, use (calibrate or verify), setup
    source: PathBuf,
    /// Folder for records/, proofs/, units/ and the table fleet.parquet
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// `auto`, or orders: "bias 3, rate 1"
    #[arg(long, default_value = "auto")]
    model: String,
    /// Prior knowledge of the units, with its model: a file of `sagnac fleet prior`
    #[arg(long, value_name = "FILE", conflicts_with = "model")]
    prior: Option<PathBuf>,
    /// Limits for the retests: a TOML file, or `navigation-grade` or `paper`
    #[arg(long, value_name = "FILE|SET")]
    limits: Option<String>,
    /// Calibrate all units again, unchanged ones too
    #[arg(long)]
    again: bool,
    /// Units at a time [default: one for each processor]
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
    /// One JSON object on standard output, text on standard error
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    setup: SetupArgs,
}

impl Verb for Args {
    fn json(&self) -> bool {
        self.json
    }

    fn run(&self, console: &mut Console) -> Ran {
        fleet::check_output(&self.output, &self.source)?;
        let units = units_of(&self.source)?;
        let logs = units.iter().flat_map(|unit| unit.runs.iter().chain(&unit.retests).chain(&unit.setup));
        let inputs = Files::new()
            .reads([&self.source])
            .reads(&self.setup.setup)
            .reads(&self.prior)
            .reads(&self.limits)
            .reads(logs);
        inputs
            .writes(units.iter().flat_map(|unit| outputs_of(unit, &self.output)).chain([self.output.join(TABLE)]))
            .compare()?;
        let setup = self.setup.over(Setup::default())?;
        if setup.serial.is_some() {
            return Err(Error::input(
                "one serial number is given for all units",
                "remove it: each unit uses its name, or the serial number in its own setup",
            )
            .column("serial"));
        }
        let prior = self.prior.as_deref().map(PriorFile::read).transpose()?;
        let limits = self.limits.as_deref().map(Limits::named_or_read).transpose()?;
        let (model, epoch_s) = (self.model.parse()?, source_date_epoch()?);
        let recipe = Recipe::new(setup, model).source_date_epoch(epoch_s).prior(prior).limits(limits);
        let threads = self.threads.or_else(|| std::thread::available_parallelism().ok()).map_or(1, NonZeroUsize::get);
        let work = FleetWork { recipe: &recipe, threads, again: self.again };
        let bar = UnitProgress::new(units.len());
        let told = Mutex::new((console, InOrder::new(&units, self.json)));
        let report = |done: Done| {
            let (console, lines) = &mut *told.lock().unwrap_or_else(PoisonError::into_inner);
            bar.one_more();
            lines.take(done).into_iter().for_each(|line| bar.while_hidden(|| console.say(line)));
        };
        let ran = fleet::calibrate(&units, &work, &self.output, &report);
        drop(bar);
        let (console, lines) = told.into_inner().unwrap_or_else(PoisonError::into_inner);
        ran?;
        let summary = lines.summary();
        console.say(summary.words());
        console.say(format!("wrote {}", self.output.join(TABLE).display()));
        console.object(&summary)?;
        Ok(if summary.is_good() { Outcome::Done } else { Outcome::SomeFailed })
    }
}
