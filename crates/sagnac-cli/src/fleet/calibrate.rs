//! `sagnac fleet calibrate`: the same for a factory's gyros, unit by unit.

use std::collections::BTreeMap;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use sagnac::Error;
use sagnac::fit::FitOptions;
use sagnac::fleet::{self, Acceptance, AxisResult, Done, PriorFile, Refusal, TABLE, UnitResult, Work, units_of};
use sagnac::verify::Limits;
use sagnac_log::setup::Setup;
use sagnac_units::format::{counted, significant};
use serde::Serialize;

use crate::calibrate::source_date_epoch;
use crate::console::{Console, Outcome, Ran};
use crate::files::Files;
use crate::progress::Units;
use crate::setup_args::SetupArgs;

/// Calibrate every unit of a folder or a manifest
///
/// Records are those of `sagnac calibrate`, byte for byte. A unit without a calibration is a row with its reason, and exit status 1. A
/// second run does only what has changed.
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
    /// What is known of the units before their tests: a file of `sagnac fleet prior`, whose model they take
    #[arg(long, value_name = "FILE", conflicts_with = "model")]
    prior: Option<PathBuf>,
    /// Limits that retests are to meet: a TOML file, or `navigation-grade` or `paper`
    #[arg(long, value_name = "FILE|SET")]
    limits: Option<String>,
    /// Does every unit, also those that have not changed
    #[arg(long)]
    again: bool,
    /// Units at a time [default: one for each processor]
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
    /// One JSON object on standard output, text on standard error
    #[arg(long)]
    pub(super) json: bool,
    #[command(flatten)]
    setup: SetupArgs,
}

/// What a run of a fleet came to.
#[derive(Default, Serialize)]
struct Summary {
    units: usize,
    calibrated: usize,
    refused: usize,
    failed: usize,
    /// Of those with a retest and limits: how many met them, and how many did not or could not be judged.
    met: usize,
    not_met: usize,
    /// Not done again, because nothing had changed.
    unchanged: usize,
    /// Each unit, for scripts.
    results: Vec<UnitResult>,
}

pub(crate) fn run(args: &Args, console: &mut Console) -> Ran {
    Files::new().reads(&args.setup.setup).reads(&args.prior).check()?;
    if is_within(&args.output, &args.source) {
        return Err(Error::input("the results would stand among the units")
            .column("--output")
            .value(args.output.display().to_string())
            .help("give a folder beside that of the units"));
    }
    let units = units_of(&args.source)?;
    let setup = args.setup.over(Setup::default())?;
    if setup.serial.is_some() {
        return Err(Error::input("one serial number for all units")
            .column("serial")
            .help("take it out: each unit has its name, or the serial number of its own setup"));
    }
    let prior = args.prior.as_deref().map(PriorFile::read).transpose()?;
    let limits = args.limits.as_deref().map(Limits::named_or_read).transpose()?;
    let (model, epoch_s) = (args.model.parse()?, source_date_epoch()?);
    let options = || FitOptions::new(sagnac::Model::clone(&model)).source_date_epoch(epoch_s);
    let threads = args.threads.or_else(|| std::thread::available_parallelism().ok()).map_or(1, NonZeroUsize::get);
    let (prior, limits) = (prior.as_ref(), limits.as_ref());
    let work = Work { setup: &setup, options: &options, prior, limits, threads, again: args.again };
    let width = units.iter().map(|unit| unit.name.len()).max().unwrap_or(0);
    let bar = Units::new(units.len());
    let (waiting, summary) = (BTreeMap::new(), Summary::default());
    let lines = Mutex::new(Lines { console, width, bar, waiting, next: 0, summary, is_json: args.json });
    let report = |done: Done| lines.lock().unwrap_or_else(PoisonError::into_inner).take(done);
    let ran = fleet::calibrate(&units, &work, &args.output, &report);
    let Lines { console, summary, .. } = lines.into_inner().unwrap_or_else(PoisonError::into_inner);
    ran?;
    console.say(summary.words());
    console.say(format!("wrote {}", args.output.join(TABLE).display()));
    console.object(&summary)?;
    let is_good = summary.calibrated == summary.units && summary.not_met == 0;
    Ok(if is_good { Outcome::Done } else { Outcome::SomeFailed })
}

/// True for a folder that is another one or lies in it, or will.
fn is_within(folder: &Path, other: &Path) -> bool {
    let Ok(other) = other.canonicalize() else { return false };
    let known = folder.ancestors().find_map(|part| {
        let part = if part.as_os_str().is_empty() { Path::new(".") } else { part };
        part.canonicalize().ok()
    });
    other.is_dir() && known.is_some_and(|known| known.starts_with(&other))
}

impl Summary {
    fn count(&mut self, result: &UnitResult, is_kept: bool) {
        self.units += 1;
        *match result.outcome {
            fleet::Outcome::Calibrated => &mut self.calibrated,
            fleet::Outcome::Refused => &mut self.refused,
            fleet::Outcome::Failed => &mut self.failed,
        } += 1;
        self.met += usize::from(result.acceptance == Acceptance::Met);
        self.not_met += usize::from(result.acceptance.is_bad());
        self.unchanged += usize::from(is_kept);
    }

    fn words(&self) -> String {
        let mut out = format!(
            "{}: {} calibrated, {} refused, {} failed",
            counted(self.units, "unit", "units"),
            self.calibrated,
            self.refused,
            self.failed
        );
        if self.met + self.not_met > 0 {
            out += &format!("; limits met by {} of {}", self.met, self.met + self.not_met);
        }
        if self.unchanged > 0 {
            out += &format!("; {} unchanged since before", self.unchanged);
        }
        out
    }
}

/// Lines in the order of the manifest, whichever unit is done first.
struct Lines<'a> {
    console: &'a mut Console,
    width: usize,
    bar: Units,
    waiting: BTreeMap<usize, (UnitResult, bool)>,
    next: usize,
    summary: Summary,
    is_json: bool,
}

impl Lines<'_> {
    fn take(&mut self, done: Done) {
        self.waiting.insert(done.place, (done.result, done.is_kept));
        self.bar.one_more();
        while let Some((result, is_kept)) = self.waiting.remove(&self.next) {
            let width = self.width;
            let kept = if is_kept { " (unchanged)" } else { "" };
            let said = format!("{:width$}  {}{kept}", result.unit, line(&result));
            let console = &mut *self.console;
            self.bar.beside(|| console.say(said));
            self.summary.count(&result, is_kept);
            if self.is_json {
                self.summary.results.push(result);
            }
            self.next += 1;
        }
    }
}

/// A unit in one line.
pub(crate) fn line(result: &UnitResult) -> String {
    if let Some(refusal) = &result.refusal {
        return format!("{}: {}", result.outcome.name(), words(refusal));
    }
    let axes = result.axes.iter().map(axis).collect::<Vec<_>>().join("; ");
    let judged = match (&result.retest_refusal, result.acceptance) {
        (Some(refusal), _) => format!("; retest not judged: {}", words(refusal)),
        (None, Acceptance::NoRetest | Acceptance::NoLimits) => String::new(),
        (None, acceptance) => format!("; limits {}", acceptance.name()),
    };
    axes + &judged
}

fn words(refusal: &Refusal) -> String {
    let place = if refusal.place.is_empty() { String::new() } else { format!("{}: ", refusal.place) };
    place + &refusal.reason
}

fn axis(of: &AxisResult) -> String {
    let residual = of.residual_dph.map_or(String::new(), |sigma| format!(", residual σ {} °/h", significant(sigma, 3)));
    let floors = of.residual_dph.zip(of.noise_floor_dph).filter(|(_, floor)| *floor > 0.0);
    let floors =
        floors.map_or(String::new(), |(sigma, floor)| format!(" ({} of the floor)", significant(sigma / floor, 3)));
    let not_met = if of.limits_not_met().is_empty() {
        String::new()
    } else {
        format!(", not met: {}", of.limits_not_met().join(" "))
    };
    format!("{} `{}`{residual}{floors}{not_met}", of.axis, of.model)
}
