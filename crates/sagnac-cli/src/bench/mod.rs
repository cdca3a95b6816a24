//! `sagnac bench`: a thermal test recorded as it runs.

use std::path::PathBuf;
use std::time::Duration;

use sagnac::calibration::program;
use sagnac::fit::{FitOptions, Model, calibrate_with_report_data};
use sagnac::{Error, Result};
use sagnac_bench::{Finished, Session, finish, journal_of};
use sagnac_log::setup::Setup;
use sagnac_log::write::write_bytes;
use sagnac_report::calibration_report;
use sagnac_units::format::significant;

use crate::calibrate::source_date_epoch;
use crate::console::{Console, Outcome, Ran};
use crate::files::Files;
use crate::interrupt;
use crate::loading;
use crate::progress::of_fit;
use crate::report_args::ReportArgs;
use crate::setup_args::SetupArgs;

/// Record a thermal test as it runs, show it, and say when enough is known
///
/// Every byte goes to the journal beside the log first (LOG.journal), so that `kill -9` and a power cut cost at most a second, and --resume goes
/// on. Ctrl-C ends the recording: the log is written as Parquet, and calibrated. A second Ctrl-C leaves at once; --resume or --finish go on then.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  sagnac bench bench.toml --source serial:/dev/ttyUSB0 -o run.parquet --calibration unit.cal.json
  sagnac bench bench.toml --source tcp://192.168.1.20:4001 -o run.parquet --resume
  sagnac simulate scenarios/paper/paper.toml | sagnac bench bench.toml --source - -o run.parquet")]
pub(crate) struct Args {
    /// Setup file, whose [bench] names the sources
    #[arg(value_name = "SETUP")]
    bench: Option<PathBuf>,
    /// Log to write when the test has ended: Parquet
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Where the gyro's bytes come from, in place of the setup's
    #[arg(long, value_name = "SOURCE")]
    source: Option<String>,
    /// Go on with the recording of this log
    #[arg(long)]
    resume: bool,
    /// Record nothing more: make the log of what was recorded
    #[arg(long, conflicts_with_all = ["resume", "source"])]
    finish: bool,
    /// Calibration to write at the end
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    #[command(flatten)]
    report: ReportArgs,
    /// `auto`, or orders: "bias 3, rate 1"
    #[arg(long, default_value = "auto")]
    model: String,
    #[command(flatten)]
    setup: SetupArgs,
}

/// How often it is looked whether the recording has ended.
const LOOK: Duration = Duration::from_millis(200);

pub(crate) fn run(args: &Args, console: &mut Console) -> Ran {
    if !loading::has_extension(&args.output, "parquet") {
        return Err(Error::input("a recording is written as Parquet: give it the ending .parquet")
            .file(args.output.display().to_string()));
    }
    let journal = journal_of(&args.output);
    let files = Files::new().reads(&args.bench).reads(&args.setup.setup).writes([&args.output]);
    args.report.check_with(files.writes(&args.calibration))?;
    let model: Model = args.model.parse()?;
    if !args.finish {
        if args.output.exists() && !args.resume {
            return Err(Error::input("a log of this name is there already")
                .file(args.output.display().to_string())
                .help("give another -o; --resume goes on with its recording"));
        }
        record(args, &journal, console)?;
    }
    let finished = finish(&journal, &args.output)?;
    describe(&finished, console);
    console.say(format!("wrote {}", args.output.display()));
    calibrate(args, model, console)
}

fn setup_of(args: &Args) -> Result<Setup> {
    let base = args.bench.as_deref().map_or_else(|| Ok(Setup::default()), Setup::read)?;
    let mut setup = args.setup.over(base)?;
    if let Some(source) = &args.source {
        setup.bench.source = Some(source.clone());
    }
    Ok(setup)
}

/// Records until the source ends, or somebody ends it.
fn record(args: &Args, journal: &std::path::Path, console: &mut Console) -> Result<()> {
    let setup = setup_of(args)?;
    let session = Session::begin(&setup, &program(), journal, args.resume)?;
    let stop = session.stop.clone();
    interrupt::first(move || stop.stop());
    console.note(format!("recording {} to {}", session.start.sources.join(", "), journal.display()));
    while !session.is_ended() {
        session.stop.wait(LOOK);
    }
    session.join()
}

fn describe(finished: &Finished, console: &mut Console) {
    let counts = finished.counts;
    console.say(format!("{} rows of {} bytes", counts.rows, counts.bytes));
    let mut odd = |number: u64, what: &str| {
        if number > 0 {
            console.note(format!("{number} {what}"));
        }
    };
    odd(counts.cut_lines, "lines have another number of fields than the headers: cut or damaged");
    odd(counts.missing_frames, "frames are missing between those that came");
    odd(counts.lost_bytes, "bytes are in no row; the journal has them");
    odd(finished.damaged_bytes, "bytes of the journal are damaged");
    let clock = finished.clock;
    let drift =
        clock.drift_ppm.map_or(String::new(), |ppm| format!(", the gyro's clock is {} ppm fast", significant(ppm, 2)));
    console.note(format!("rows and instruments are aligned to within {} s{drift}", significant(clock.jitter_s, 2)));
}

/// Calibrates the finished log, as `calibrate` does.
fn calibrate(args: &Args, model: Model, console: &mut Console) -> Ran {
    let setup = Setup { bench: Default::default(), ..setup_of(args)? };
    let windows = loading::windows_of(std::slice::from_ref(&args.output), &setup)?;
    let options = FitOptions::new(model).source_date_epoch(source_date_epoch()?).progress(of_fit());
    let (calibration, report_data) = calibrate_with_report_data(windows, &setup, &options)?;
    drop(options);
    for axis in &calibration.axes {
        crate::calibrate::describe(console, axis);
    }
    if let Some(path) = &args.calibration {
        write_bytes(path, calibration.to_json()?.as_bytes())?;
        console.say(format!("wrote {}", path.display()));
    }
    args.report.write(console, || calibration_report(&calibration, &report_data))?;
    Ok(Outcome::Done)
}
