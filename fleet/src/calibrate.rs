//! `sagnac-fleet calibrate`: `sagnac fleet calibrate` with units in an object store, and on a cluster.

use std::io::{IsTerminal, Write};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use sagnac::fleet::{
    Answer, Done, FleetWork, InOrder, PriorFile, Recipe, Results, TABLE, Unit, answer, calibrate_by, check_output,
    units_among, units_in_manifest, units_of,
};
use sagnac::verify::Limits;
use sagnac::{Error, Result};
use sagnac_log::setup::Setup;

use crate::cluster::{self, Cluster};
use crate::function::by_files;
use crate::store::{Patience, Stores, is_object};

/// Calibrate every unit of a folder, a manifest or an object store, on this machine or on a cluster
///
/// Records equal those of `sagnac calibrate`, byte for byte, on every machine.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  sagnac-fleet calibrate s3://rlg/units --setup bench.toml -o fleet/ --limits navigation-grade
  sagnac-fleet calibrate /share/units --setup bench.toml -o fleet/ --cluster df://scheduler:50050
  sagnac-fleet calibrate 's3://rlg/{lot}/unit={unit}/run={run}.parquet' --setup bench.toml -o fleet/")]
pub(crate) struct Args {
    /// Units, as for `sagnac fleet calibrate`: a folder, a pattern of logs with {unit}, a manifest; each also as s3://bucket/…
    source: String,
    /// Folder for records/, proofs/, units/ and the table fleet.parquet
    #[arg(short, long, value_name = "FOLDER")]
    output: PathBuf,
    /// Setup file for the logs (bench.toml)
    #[arg(long, value_name = "FILE")]
    setup: Option<PathBuf>,
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
    /// Scheduler of a cluster: df://host:port
    #[arg(long, value_name = "URL")]
    cluster: Option<String>,
    /// Units to send to a cluster at a time
    #[arg(long, default_value = "64", value_name = "N", requires = "cluster")]
    batch: NonZeroUsize,
    /// Units in a task of a cluster, one after the other: more where units are quick and executors many
    #[arg(long, default_value = "1", value_name = "N", requires = "cluster")]
    per_task: NonZeroUsize,
    /// Units at a time on this machine [default: one for each processor]
    #[arg(long, value_name = "N", conflicts_with = "cluster")]
    threads: Option<NonZeroUsize>,
    /// One JSON object on standard output, text on standard error
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    patience: Patience,
}

pub(crate) fn run(args: &Args) -> Result<bool> {
    let stores = Stores::new(args.patience)?;
    check_output(&args.output, Path::new(&args.source))?;
    let units = units(&args.source, &stores)?;
    let recipe = recipe(args)?;
    let told = Mutex::new(Told::new(&units, args.json));
    let report = |done: Done| told.lock().unwrap_or_else(PoisonError::into_inner).take(done);
    let ran = match &args.cluster {
        Some(url) => {
            let cluster = Cluster { url, batch: args.batch.get(), per_task: args.per_task.get() };
            on_cluster(&cluster, &units, &recipe, args, report)
        }
        None => here(&units, &recipe, args, &report),
    };
    let Told { lines, bar, .. } = told.into_inner().unwrap_or_else(PoisonError::into_inner);
    bar.finish_and_clear();
    ran?;
    let summary = lines.summary();
    say(args.json, &format!("{}\nwrote {}", summary.words(), args.output.join(TABLE).display()));
    if args.json {
        let text =
            serde_json::to_string_pretty(&summary).map_err(|e| Error::defect(format!("cannot write JSON: {e}")))?;
        let _ = writeln!(std::io::stdout(), "{text}");
    }
    Ok(summary.is_good())
}

/// The units of a source, which may be in an object store.
fn units(source: &str, stores: &Stores) -> Result<Vec<Unit>> {
    let path = Path::new(source);
    if !is_object(path) {
        return units_of(path);
    }
    let source = source.trim_end_matches('/');
    if path.extension().is_some_and(|ending| ending == "csv") && !source.contains(['{', '*', '?', '[']) {
        let (_folder, manifest) = stores.fetch_manifest(source)?;
        return units_in_manifest(&manifest, path.parent().unwrap_or(path));
    }
    units_among(source, stores.list(source)?)
}

fn recipe(args: &Args) -> Result<Recipe> {
    let setup = args.setup.as_deref().map(Setup::read).transpose()?.unwrap_or_default();
    if setup.serial.is_some() {
        return Err(Error::input(
            "one serial number is given for all units",
            "remove it: each unit uses its name, or the serial number in its own setup",
        )
        .column("serial"));
    }
    let epoch = std::env::var("SOURCE_DATE_EPOCH").ok().filter(|text| !text.is_empty()).map(|text| {
        text.parse().map_err(|_| {
            Error::input("must be whole seconds", "set it to seconds since 1970: SOURCE_DATE_EPOCH=$(date +%s)")
                .column("SOURCE_DATE_EPOCH")
                .value(&text)
        })
    });
    let prior = args.prior.as_deref().map(PriorFile::read).transpose()?;
    let limits = args.limits.as_deref().map(Limits::named_or_read).transpose()?;
    Ok(Recipe::new(setup, args.model.parse()?).source_date_epoch(epoch.transpose()?).prior(prior).limits(limits))
}

fn on_cluster(
    cluster: &Cluster<'_>,
    units: &[Unit],
    recipe: &Recipe,
    args: &Args,
    report: impl FnMut(Done),
) -> Result<()> {
    let results = Results::open(&args.output)?;
    cluster::calibrate(cluster, units, recipe, args.again, &results, report)?;
    results.write_table()
}

fn here(units: &[Unit], recipe: &Recipe, args: &Args, report: &(dyn Fn(Done) + Sync)) -> Result<()> {
    let threads = args.threads.or_else(|| std::thread::available_parallelism().ok()).map_or(1, NonZeroUsize::get);
    let work = FleetWork { recipe, threads, again: args.again };
    let by_unit = |unit: &Unit, before: Option<&str>| {
        let done = Stores::new(args.patience)
            .and_then(|stores| by_files(&stores, unit, &|unit| answer(unit, recipe, recipe.setup.memory, before)));
        done.unwrap_or_else(|e| Answer::failed(unit, e))
    };
    calibrate_by(units, &work, &args.output, report, &by_unit)
}

/// Prints a line for each finished unit.
struct Told {
    lines: InOrder,
    bar: ProgressBar,
    is_json: bool,
}

impl Told {
    fn new(units: &[Unit], is_json: bool) -> Self {
        let target =
            if std::io::stderr().is_terminal() { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(units.len() as u64), target);
        if let Ok(style) = ProgressStyle::with_template("{pos} of {len} units {wide_bar} {elapsed}, {eta} to go") {
            bar.set_style(style);
        }
        Self { lines: InOrder::new(units, is_json), bar, is_json }
    }

    fn take(&mut self, done: Done) {
        self.bar.inc(1);
        for line in self.lines.take(done) {
            self.bar.suspend(|| say(self.is_json, &line));
        }
    }
}

/// Where people read: standard error next to JSON. A reader that has gone is no failure.
fn say(is_json: bool, text: &str) {
    let _ = if is_json { writeln!(std::io::stderr(), "{text}") } else { writeln!(std::io::stdout(), "{text}") };
}
