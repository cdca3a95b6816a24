//! `sagnac compensate`: a log in, the corrected log out.

use std::io::Write;
use std::path::PathBuf;

use sagnac::Result;
use sagnac::verify::{Compensated, CorrectedFormat, Correction, compensate};
use sagnac_log::ingest::ReadMode;
use sagnac_log::setup::Setup;
use sagnac_log::write::write_atomically;
use sagnac_units::format::significant;

use crate::args::setup::SetupArgs;
use crate::files::loading;
use crate::files::pipe::PipeAware;
use crate::output::console::{Console, Outcome, Ran};
use crate::output::progress::open_log;
use crate::output::tables::not_replayed;
use crate::verbs::verb::Verb;

/// Correct a log row by row, as the gyro's processor does
///
/// From standard input to standard output, each row is answered at once. Exit status is 1 if too few rows (--corrected-min) fall inside
/// the calibrated range. The corrected log is written anyway.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  sagnac compensate unit.img retest.csv -o corrected.csv
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
    /// Smallest part of the rows to correct within the calibrated range, 0 to 1
    #[arg(long, value_name = "PART", default_value_t = 0.9, value_parser = part)]
    corrected_min: f64,
    #[command(flatten)]
    setup: SetupArgs,
}

impl Verb for Args {
    fn run(&self, console: &mut Console) -> Ran {
        self.output.iter().try_for_each(|path| loading::check_output_name(path, "CSV, or Parquet for .parquet"))?;
        let correction = loading::correction(&self.correction)?;
        let setup = self.setup.over(correction.setup())?;
        let done = match &self.output {
            Some(path) => {
                let mut done = None;
                let written = write_atomically(path, |out| {
                    done = Some(pour(self, &correction, &setup, out)?);
                    Ok(())
                });
                written.map_err(|e| e.file(path.display().to_string()))?;
                done
            }
            None => pour_to_stdout(self, &correction, &setup)?,
        };
        // A reader that went away has seen what it wanted.
        let Some(done) = done else { return Ok(Outcome::Done) };
        for line in not_replayed(&done.log.tallies.list()) {
            console.note(line);
        }
        console.note(words(&done));
        if done.fraction() >= self.corrected_min {
            return Ok(Outcome::Done);
        }
        console.note(format!(
            "LESS THAN {} % CORRECTED (--corrected-min {}): wrong units, another thermometer or another test",
            significant(100.0 * self.corrected_min, 3),
            self.corrected_min
        ));
        Ok(Outcome::LimitsNotMet)
    }
}

/// How much was corrected, and why the rest was not.
fn words(done: &Compensated) -> String {
    let all = done.log.rows;
    let unread = all.saturating_sub(done.rows);
    let rest = [
        (done.out_of_span, "outside the span of the fit, with the correction of its border"),
        (done.uncorrected, "without a temperature for the correction"),
        (unread, "not read"),
    ];
    let rest = rest.into_iter().filter(|(rows, _)| *rows > 0).map(|(rows, why)| format!("; {rows} {why}"));
    let percent = significant(100.0 * done.fraction(), 4);
    format!("corrected {} of {all} rows, {percent} %{}", done.corrected(), rest.collect::<String>())
}

/// A part of a whole.
fn part(text: &str) -> std::result::Result<f64, String> {
    text.parse().ok().filter(|part| (0.0..=1.0).contains(part)).ok_or_else(|| "a number from 0 to 1".to_owned())
}

fn pour(args: &Args, correction: &Correction, setup: &Setup, out: &mut (dyn Write + Send)) -> Result<Compensated> {
    let live = args.log.as_os_str() == "-";
    let pace = if live { ReadMode::LineByLine } else { ReadMode::BulkWithText };
    let mut setup = setup.clone();
    if live {
        // A pipe shows too few rows to take the interval from; the calibration knows it.
        let known = correction.calibration.as_ref().map(|c| c.sample_interval_s);
        setup.sample_interval_s = setup.sample_interval_s.or(known);
    }
    let mut log = open_log(&args.log, &setup, pace, "correcting")?;
    let format = match &args.output {
        Some(path) if loading::has_extension(path, "parquet") => CorrectedFormat::Parquet,
        _ => CorrectedFormat::Csv,
    };
    compensate(correction, &mut log, &setup, format, out)
}

/// `None` when the reader has closed the pipe: then there is nothing more to do.
fn pour_to_stdout(args: &Args, correction: &Correction, setup: &Setup) -> Result<Option<Compensated>> {
    let mut out = PipeAware::new(std::io::stdout());
    let poured = pour(args, correction, setup, &mut out);
    if out.closed() { Ok(None) } else { poured.map(Some).map_err(|e| e.file("standard output")) }
}
