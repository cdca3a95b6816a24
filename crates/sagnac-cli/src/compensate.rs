//! `sagnac compensate`: a log in, the corrected log out.

use std::io::Write;
use std::path::PathBuf;

use sagnac::Result;
use sagnac::verify::{CorrectedFormat, Correction, compensate};
use sagnac_log::ingest::{LogSummary, ReadMode};
use sagnac_log::setup::Setup;
use sagnac_log::write::write_atomically;

use crate::calibrate::excluded;
use crate::console::{Console, Outcome, Ran};
use crate::files::Files;
use crate::loading;
use crate::pipe::PipeAware;
use crate::progress::open_log;
use crate::setup_args::SetupArgs;

/// Correct a log as the gyro's processor would, row by row
///
/// From standard input to standard output it answers line by line.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  sagnac compensate unit.img cycle-3.csv -o corrected.csv
  tail -f live.csv | sagnac compensate unit.cal.json")]
pub(crate) struct Args {
    /// Calibration or image
    correction: PathBuf,
    /// Log; standard input by default
    #[arg(default_value = "-")]
    log: PathBuf,
    /// Corrected log: CSV, or Parquet for a name in .parquet; standard output by default
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    setup: SetupArgs,
}

pub(crate) fn run(args: &Args, console: &mut Console) -> Ran {
    args.output.iter().try_for_each(|path| loading::check_output_name(path, "CSV, or Parquet for .parquet"))?;
    Files::new().reads([&args.correction, &args.log]).reads(&args.setup.setup).writes(&args.output).check()?;
    let correction = loading::correction(&args.correction)?;
    let setup = args.setup.over(correction.setup())?;
    let summary = match &args.output {
        Some(path) => {
            let mut summary = None;
            let written = write_atomically(path, |out| {
                summary = Some(pour(args, &correction, &setup, out)?);
                Ok(())
            });
            written.map_err(|e| e.file(path.display().to_string()))?;
            summary
        }
        None => pour_to_stdout(args, &correction, &setup)?,
    };
    for line in summary.iter().flat_map(|s| excluded(&s.tallies.list())) {
        console.note(line);
    }
    Ok(Outcome::Done)
}

fn pour(args: &Args, correction: &Correction, setup: &Setup, out: &mut (dyn Write + Send)) -> Result<LogSummary> {
    let live = args.log.as_os_str() == "-";
    let pace = if live { ReadMode::LineByLine } else { ReadMode::BulkWithText };
    let mut setup = setup.clone();
    if live {
        // A pipe shows too few rows to take the interval from; the calibration knows it.
        let known = correction.calibration.as_ref().map(|c| c.sample_interval_s);
        setup.sample_interval_s = setup.sample_interval_s.or(known);
    }
    let mut log = open_log(&args.log, &setup, pace)?;
    let format = match &args.output {
        Some(path) if loading::has_extension(path, "parquet") => CorrectedFormat::Parquet,
        _ => CorrectedFormat::Csv,
    };
    compensate(correction, &mut log, &setup, format, out)
}

/// `None` when the reader has closed the pipe: then there is nothing more to do.
fn pour_to_stdout(args: &Args, correction: &Correction, setup: &Setup) -> Result<Option<LogSummary>> {
    let mut out = PipeAware::new(std::io::stdout());
    let poured = pour(args, correction, setup, &mut out);
    if out.closed() { Ok(None) } else { poured.map(Some).map_err(|e| e.file("standard output")) }
}
