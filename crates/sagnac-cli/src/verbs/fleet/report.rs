//! `sagnac fleet report`: what a quality engineer watches, as one HTML file.

use std::path::PathBuf;

use sagnac::fleet::{Quality, UnitResult, parts_of, results_in};
use sagnac_log::setup::Setup;
use sagnac_report::fleet_report;
use sagnac_units::format::{significant, unit, with_sigma};

use crate::args::report::ReportArgs;
use crate::args::units::UnitsArgs;
use crate::files::Files;
use crate::output::console::{Console, Outcome, Ran};
use crate::output::terminal::MOST_COLUMNS;
use crate::verbs::verb::Verb;

/// Show a fleet's yield, control charts, outliers, rigs and tight limits
#[derive(clap::Args)]
#[command(after_help = "\
Example:
  sagnac fleet report fleet/ --report fleet.html")]
pub(crate) struct Args {
    /// Folder of `sagnac fleet calibrate`
    fleet: PathBuf,
    #[command(flatten)]
    report: ReportArgs,
    #[command(flatten)]
    units: UnitsArgs,
}

/// Times from this on are dates, s since 1970: no test lasts three years.
const DATES_FROM_S: f64 = 1e8;

impl Verb for Args {
    fn run(&self, console: &mut Console) -> Ran {
        self.report.check_with(Files::new().reads_all_in(parts_of(&self.fleet)))?;
        let mut results = results_in(&self.fleet)?;
        let has_date = |result: &UnitResult| result.time_s.is_none_or(|time_s| time_s >= DATES_FROM_S);
        let dated = results.iter().any(|result| result.time_s.is_some()) && results.iter().all(has_date);
        if dated {
            results.sort_by(|a, b| a.time_s.unwrap_or(0.0).total_cmp(&b.time_s.unwrap_or(0.0)));
        }
        let units = self.units.over(&Setup::default());
        let quality = Quality::of(&results).shown_in(units);
        describe(console, &quality);
        let order = if dated { "the times of their logs" } else { "the names of the units: the logs have no dates" };
        self.report.write(console, || fleet_report(&quality, &results, order, units))?;
        Ok(Outcome::Done)
    }
}

/// At most [`SHOWN`] lines of a kind; the report has all.
fn describe(console: &mut Console, quality: &Quality) {
    let lots = quality.yields.iter().map(|of| {
        let lot = if of.lot.is_empty() { "all lots".to_owned() } else { format!("lot {}", of.lot) };
        let judged = if of.judged > 0 { format!(", limits met by {} of {}", of.met, of.judged) } else { String::new() };
        format!("{lot}: {} of {} units calibrated{judged}", of.calibrated, of.units)
    });
    let rigs = quality.rigs.iter().map(|effect| {
        let size = with_sigma(effect.difference, Some(effect.sigma));
        format!("rig {}: {} differs by {size} {}", effect.rig, effect.quantity, unit(&effect.unit))
    });
    let outliers = quality
        .odd
        .iter()
        .map(|odd| format!("outlier: {}, {} {} σ from the median", odd.of, odd.quantity, significant(odd.sigmas, 2)));
    let refused =
        quality.refusals.iter().map(|(reason, units)| format!("{units} not calibrated or not judged: {reason}"));
    say_some(console, "lots", lots.collect());
    say_some(console, "rigs", rigs.collect());
    say_some(console, "outliers", outliers.collect());
    say_some(console, "reasons", refused.collect());
}

fn say_some(console: &mut Console, kind: &str, lines: Vec<String>) {
    let shown = if console.is_verbose() { lines.len() } else { SHOWN };
    lines.iter().take(shown).for_each(|line| console.say_within(line, MOST_COLUMNS));
    if lines.len() > shown {
        console.say(format!("  {} more {kind}: -v", lines.len() - shown));
    }
}

/// Lines of a kind on the terminal.
const SHOWN: usize = 3;
