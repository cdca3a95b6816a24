//! `sagnac inspect`: what a file is, and what a log is good for.

mod image;
mod log;
mod results;

use std::path::PathBuf;

use sagnac::Error;
use sagnac::calibration::Calibration;

use crate::args::report::ReportArgs;
use crate::args::setup::LogArgs;
use crate::args::units::UnitsArgs;
use crate::files::loading::{self, FileKind};
use crate::output::calibration::describe;
use crate::output::console::{Console, Outcome, Ran};
use crate::verbs::inspect::log::Wanted;
use crate::verbs::verb::Verb;

/// Identify a file and check what a log can be used for
///
/// A log gets a verdict: good for calibration, good for noise only, or not usable. The check fits no model.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  sagnac inspect cycle-1.csv --arcsec-per-count 1.059 --report cycle-1.html
  sagnac inspect cycle-1.csv cycle-2.csv --setup bench.toml --windows windows.csv")]
pub(crate) struct Args {
    /// Any file. Several logs, a folder or a pattern are checked together
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Window table to write: CSV, or Parquet for a name in .parquet
    #[arg(long, value_name = "FILE")]
    windows: Option<PathBuf>,
    #[command(flatten)]
    report: ReportArgs,
    /// One JSON object on standard output, text on standard error
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    units: UnitsArgs,
    #[command(flatten)]
    reading: LogArgs,
}

impl Verb for Args {
    fn json(&self) -> bool {
        self.json
    }

    fn logs(&mut self) -> Option<&mut Vec<PathBuf>> {
        Some(&mut self.files)
    }

    fn run(&self, console: &mut Console) -> Ran {
        self.report.check_name()?;
        self.windows.iter().try_for_each(|path| loading::check_output_name(path, "CSV, or Parquet for .parquet"))?;
        let (reading, windows) = (&self.reading, self.windows.as_deref());
        let wanted = Wanted { reading, report: &self.report, units: self.units, windows };
        let [file] = self.files.as_slice() else {
            log::several(&self.files, &wanted, console)?;
            return Ok(Outcome::Done);
        };
        let kind = loading::kind_of(file)?;
        let is_more_asked = self.report.is_asked() || self.windows.is_some();
        let no_log = || {
            Error::input("a report and a table of windows need a log", "give a log, or remove --report and --windows")
                .file(file.display().to_string())
        };
        if is_more_asked && !matches!(kind, FileKind::Log) {
            return Err(no_log());
        }
        match kind {
            FileKind::Image => image::image(file, console)?,
            FileKind::Calibration => match results::json(file, console)? {
                true => {}
                false => {
                    let calibration: Calibration = loading::calibration(file)?;
                    console
                        .say(format!("a calibration of {} by {}", calibration.serial, calibration.provenance.program));
                    let units = self.units.over(&calibration.setup);
                    calibration.axes.iter().for_each(|axis| describe(console, axis, units));
                    console.object(&calibration)?;
                }
            },
            FileKind::Log => {
                let is_log = !results::recognised(file, console)? && log::log(file, &wanted, console)?;
                if is_more_asked && !is_log {
                    return Err(no_log());
                }
            }
        }
        Ok(Outcome::Done)
    }
}
