//! `sagnac inspect`: what a file is, and what a log is good for.

mod image;
mod log;
mod results;

use std::path::PathBuf;

use sagnac::Error;
use sagnac::calibration::Calibration;

use crate::args::report::ReportArgs;
use crate::args::setup::LogArgs;
use crate::files::Files;
use crate::files::loading::{self, Kind};
use crate::output::calibration::describe;
use crate::output::console::{Console, Outcome, Ran};
use crate::verbs::verb::Verb;

/// Say what a file is, and of a log what it is good for
///
/// A log or window table gets a verdict: good for calibration, for noise only, or for nothing. No model is searched for.
#[derive(clap::Args)]
#[command(after_help = "\
Example:
  sagnac inspect cycle-1.csv --arcsec-per-count 1.059 --report cycle-1.html")]
pub(crate) struct Args {
    /// Any file; several logs, a folder or a pattern of them are surveyed together
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    #[command(flatten)]
    report: ReportArgs,
    /// One JSON object on standard output, text on standard error
    #[arg(long)]
    json: bool,
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
        self.report.check_with(Files::new().reads(&self.files).reads(&self.reading.setup.setup))?;
        let [file] = self.files.as_slice() else {
            log::several(&self.files, &self.reading, &self.report, console)?;
            return Ok(Outcome::Done);
        };
        let kind = loading::kind_of(file)?;
        if self.report.is_asked() && !matches!(kind, Kind::Log | Kind::WindowTable) {
            return Err(Error::input("a report is made of a log or window table").file(file.display().to_string()));
        }
        match kind {
            Kind::Image => image::image(file, console)?,
            Kind::Calibration => match results::json(file, console)? {
                true => {}
                false => {
                    let calibration: Calibration = loading::calibration(file)?;
                    console
                        .say(format!("a calibration of {} by {}", calibration.serial, calibration.provenance.program));
                    calibration.axes.iter().for_each(|axis| describe(console, axis));
                    console.object(&calibration)?;
                }
            },
            Kind::WindowTable => log::window_table(file, &self.reading, &self.report, console)?,
            Kind::Log => {
                if !results::recognised(file, console)? {
                    log::log(file, &self.reading, &self.report, console)?;
                }
            }
        }
        Ok(Outcome::Done)
    }
}
