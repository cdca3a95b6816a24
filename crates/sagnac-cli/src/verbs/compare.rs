//! `sagnac compare`: compares calibrations of one unit, and checks the changes against limits.

use std::path::PathBuf;

use sagnac::calibration::Calibration;
use sagnac::compare::{ComparedAxis, ComparedCurve, ComparedNumber, Comparison, compare};
use sagnac::verify::{Judged, Limits};
use sagnac::{Error, Result};
use sagnac_report::comparison_report;
use sagnac_units::format;

use crate::args::report::ReportArgs;
use crate::args::units::UnitsArgs;
use crate::files::loading;
use crate::output::comparison_brief::comparison_brief;
use crate::output::console::{Console, Outcome, Ran};
use crate::output::tables::limits_table;
use crate::output::terminal::table;
use crate::verbs::verb::Verb;

/// Compare calibrations of the same unit across cycles, turn-ons or months
#[derive(clap::Args)]
#[command(after_help = "\
Example:
  sagnac compare january.cal.json may.cal.json september.cal.json --limits navigation-grade --report change.html")]
pub(crate) struct Args {
    /// Calibrations of one serial number, two or more
    #[arg(required = true, num_args = 2..)]
    calibrations: Vec<PathBuf>,
    /// Limits of what may change from record to record: a TOML file, or `navigation-grade` or `paper`. Exit status 1 unless every
    /// limit that is asked is met
    #[arg(long, value_name = "FILE|SET")]
    limits: Option<String>,
    #[command(flatten)]
    report: ReportArgs,
    #[command(flatten)]
    units: UnitsArgs,
    /// One JSON object on standard output, text on standard error
    #[arg(long)]
    json: bool,
}

impl Verb for Args {
    fn json(&self) -> bool {
        self.json
    }

    fn run(&self, console: &mut Console) -> Ran {
        self.report.check_name()?;
        let read =
            |path: &PathBuf| -> Result<(String, Calibration)> {
                let name = path.display().to_string();
                match loading::kind_of(path)? {
                    loading::FileKind::Calibration => Ok((name, loading::calibration(path)?)),
                    _ => Err(Error::input("no calibration is given", "give files that `sagnac calibrate -o` wrote")
                        .file(name)),
                }
            };
        let records: Result<Vec<(String, Calibration)>> = self.calibrations.iter().map(read).collect();
        let limits = self.limits.as_deref().map(Limits::named_or_read).transpose()?;
        let records = records?;
        let comparison = compare(&records, limits.as_ref())?;
        let units = records.first().map_or_else(Default::default, |(_, first)| self.units.over(&first.setup));
        let shown = comparison.shown_in(units);
        let wrote = self.report.written(|| comparison_report(&shown))?;
        let brief = comparison_brief(&shown, &wrote);
        brief.say(console, |console| say_everything(console, &shown));
        console.object(&comparison)?;
        Ok(if comparison.passed() { Outcome::Done } else { Outcome::LimitsNotMet })
    }
}

/// Warnings, changes, limits and values, axis by axis.
fn say_everything(console: &mut Console, comparison: &Comparison) {
    if !comparison.shared_logs.is_empty() {
        let logs = comparison.shared_logs.join(", ");
        console
            .note(format!("warning: records made from the same log ({logs}) are not independent and agree too well"));
    }
    if !comparison.untested_axes.is_empty() {
        let axes: Vec<String> = comparison.untested_axes.iter().map(char::to_string).collect();
        console.note(format!("warning: not every record has axis {}, which is not compared", axes.join(", ")));
    }
    for change in &comparison.changes {
        console.say(format!("{}: {}", comparison.records[change.record].0, change.words()));
    }
    for axis in &comparison.axes {
        if let Some(words) = verdict(axis, comparison) {
            console.say(format!("axis {}: {words}", axis.axis));
            console.say(limits_table(&axis.limits, false));
        }
        describe(console, comparison, axis);
        for words in axis.numbers.iter().filter_map(ComparedNumber::verdict) {
            console.say(format!("axis {}: {words}", axis.axis));
        }
    }
}

/// The verdict of an axis in words; `None` without limits.
fn verdict(axis: &ComparedAxis, comparison: &Comparison) -> Option<String> {
    let judged = Judged::of(&axis.limits);
    let words = judged.words_of("a comparison");
    let verdict = match axis.pass? {
        _ if !comparison.shared_logs.is_empty() => "NOT ACCEPTED: records were made from the same log; ",
        _ if !comparison.untested_axes.is_empty() => "NOT ACCEPTED: an axis is not in every record; ",
        true => "",
        false if judged.not_met > 0 => "LIMITS NOT MET: ",
        false if judged.not_decided > 0 => "LIMITS NOT DECIDED: ",
        false => "NOT ACCEPTED: no limit is asked; ",
    };
    let blind = axis.limits.iter().any(|limit| limit.name == "bias_repeatability_dph_max" && limit.pass.is_none());
    let blind = if blind { " (the fixed bias is NOT judged)" } else { "" };
    Some(format!("{verdict}{words}{blind}"))
}

fn describe(console: &mut Console, comparison: &Comparison, axis: &ComparedAxis) {
    for curve in &axis.curves {
        console.say(format!("axis {}: {}", axis.axis, curve.verdict(&comparison.records)));
        if let Some(words) = curve.change(&comparison.records) {
            console.say(format!("axis {}: {words}", axis.axis));
        }
        console.say(values(comparison, curve));
    }
    console.say(numbers(comparison, &axis.numbers));
}

fn values(comparison: &Comparison, curve: &ComparedCurve) -> String {
    let title = format!("{}, {}", curve.quantity, format::unit(&curve.unit));
    let titles = curve.titles(&comparison.records);
    let header: Vec<&str> = [title.as_str()].into_iter().chain(titles.iter().map(String::as_str)).collect();
    let rows = curve.by_change().into_iter().map(|at| {
        let mut row = vec![format!("{} °C", format::celsius(curve.temperatures_c[at]))];
        row.extend(curve.row(at));
        row
    });
    table(&header, rows)
}

fn numbers(comparison: &Comparison, all: &[ComparedNumber]) -> String {
    let mut header = vec![""];
    header.extend(comparison.records.iter().map(|(name, _)| name.as_str()));
    header.extend(["unit", "farthest apart, σ"]);
    table(&header, all.iter().map(ComparedNumber::row))
}
