//! `sagnac allan`: the noise of a record, term by term.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use sagnac::allan::{NoiseBudget, Request, budget_of_curves, is_curve, noise_budget, read_curve};
use sagnac::{Error, Result};
use sagnac_log::setup::{RateUnit, Setup};
use sagnac_log::write::write_bytes;
use sagnac_noise::{AllanTerm, AxisBudget, Taus, TermValue};
use sagnac_report::{noise_report, reason_text, row_notes, term_text};
use sagnac_units::format::significant;

use crate::args::report::ReportArgs;
use crate::args::setup::{SetupArgs, numbers};
use crate::args::units::UnitsArgs;
use crate::files::loading;
use crate::output::console::{Console, Outcome, Ran};
use crate::output::noise_brief::noise_brief;
use crate::output::tables::excluded;
use crate::output::terminal::table;
use crate::verbs::verb::Verb;

/// τ in the table on the terminal.
const SHOWN_TAUS: usize = 12;

/// Split the noise of a record at rest into its terms: Q, N, B, K, R
///
/// Each LOG is a run. A cumulative counter keeps its angle across gaps, and single lost rows are bridged while they are few. Rows
/// far from those around them are named, and excluded while they are at most 0.5 %. A table of tau_s and adev_dph from any program
/// can replace the logs.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  sagnac allan static.csv --arcsec-per-count 1.059 --report allan.html
  sagnac allan static.csv --arcsec-per-count 1.059 --taus 1,10,100 --json
  sagnac allan curve.csv --duration 7200")]
pub(crate) struct Args {
    /// Logs of the gyro at rest, a folder or a pattern of them, or one table of tau_s and adev_dph
    #[arg(required = true)]
    logs: Vec<PathBuf>,
    /// τ to show: seconds separated by commas, `octave`, `all`, or `log` for ten per decade
    #[arg(long, default_value = "log")]
    taus: String,
    /// Full overlap at every τ, with 8 bytes of memory per row and axis
    #[arg(long)]
    exact: bool,
    /// Remove the drift with temperature first
    #[arg(long, value_enum)]
    detrend: Option<Detrend>,
    /// Use the longest part of the record without motion, and name it
    #[arg(long)]
    at_rest: bool,
    /// Length of the record behind a bare curve, s: gives it intervals
    #[arg(long, value_name = "S")]
    duration: Option<f64>,
    /// Curve to write: CSV
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    report: ReportArgs,
    /// One JSON object on standard output, text on standard error
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    units: UnitsArgs,
    #[command(flatten)]
    setup: SetupArgs,
}

/// Drift that can be removed first.
#[derive(Clone, Copy, clap::ValueEnum)]
enum Detrend {
    Temperature,
}

impl Verb for Args {
    fn json(&self) -> bool {
        self.json
    }

    fn logs(&mut self) -> Option<&mut Vec<PathBuf>> {
        Some(&mut self.logs)
    }

    fn run(&self, console: &mut Console) -> Ran {
        self.report.check_name()?;
        if let Some(path) = &self.output {
            loading::check_output_name(path, "CSV")?;
        }
        let budget = match self.logs.as_slice() {
            [path] if is_curve_file(path)? => of_curve(path, self)?,
            _ => of_logs(self)?,
        };
        let units = self.units.over(&self.setup.over(Setup::default())?);
        let mut wrote = Vec::new();
        if let Some(path) = &self.output {
            write_bytes(path, curve_csv(&budget).as_bytes())?;
            wrote.push(path.display().to_string());
        }
        wrote.extend(self.report.written(|| noise_report(&budget, units))?);
        let of_rows =
            |axis: &AxisBudget| row_notes(axis, units).into_iter().map(|note| (axis.axis, note)).collect::<Vec<_>>();
        let notes: Vec<(char, String)> = budget.axes.iter().flat_map(of_rows).collect();
        let brief = noise_brief(&budget, &notes, &wrote, units);
        brief.say(console, |console| {
            budget.warnings.iter().for_each(|warning| console.note(format!("warning: {warning}")));
            budget.axes.iter().for_each(|axis| describe(console, axis, units));
            excluded(&budget.excluded).iter().for_each(|line| console.say(line));
        });
        console.object(&budget)?;
        Ok(Outcome::Done)
    }
}

/// True for a file that begins like a curve; pipes are logs.
fn is_curve_file(path: &Path) -> Result<bool> {
    Ok(path.is_file()
        && matches!(loading::kind_of(path)?, loading::FileKind::Log)
        && is_curve(&loading::first_bytes(path)?))
}

fn of_curve(path: &Path, args: &Args) -> Result<NoiseBudget> {
    if args.taus != "log" || args.exact || args.detrend.is_some() || args.at_rest {
        return Err(Error::input(
            "--taus, --exact, --detrend and --at-rest need a log, and this is a bare curve",
            "remove these flags, or give the log",
        )
        .file(path.display().to_string()));
    }
    let (curves, input) = read_curve(path)?;
    budget_of_curves(&curves, args.duration, input)
}

fn of_logs(args: &Args) -> Result<NoiseBudget> {
    if args.duration.is_some() {
        return Err(Error::input(
            "applies to a bare curve only",
            "remove --duration: the program reads the length of a log",
        )
        .column("--duration"));
    }
    for path in &args.logs {
        if !matches!(loading::kind_of(path)?, loading::FileKind::Log) {
            return Err(Error::input(
                "noise is computed from the rows of a log, and this is another file",
                "give the log: sagnac allan run1.csv",
            )
            .file(path.display().to_string()));
        }
    }
    let setup = args.setup.over(Setup::default())?;
    let request = Request {
        exact: args.exact,
        detrend: matches!(args.detrend, Some(Detrend::Temperature)),
        at_rest: args.at_rest,
        ..Request::new(taus(&args.taus)?)
    };
    let reads_twice = request.detrend || request.at_rest;
    if let Some(pipe) = args.logs.iter().find(|path| reads_twice && !path.is_file()) {
        return Err(Error::input(
            "--detrend and --at-rest read the log twice, which a pipe does not allow",
            "save the pipe to a file, and give that",
        )
        .file(pipe.display().to_string()));
    }
    let again = reads_twice.then(|| loading::logs(&args.logs, &setup, "reading")).transpose()?;
    noise_budget(loading::logs(&args.logs, &setup, "reading")?, again, &setup, &request)
}

fn taus(text: &str) -> Result<Taus> {
    match text {
        "log" => Ok(Taus::LogSpaced),
        "octave" => Ok(Taus::Octaves),
        "all" => Ok(Taus::All),
        list => numbers("--taus", list).map(Taus::Given),
    }
}

fn describe(console: &mut Console, axis: &AxisBudget, units: RateUnit) {
    if axis.rows > 0 {
        let stretches = match axis.stretches {
            1 => "one stretch".to_owned(),
            n => format!("{n} stretches, the longest of {} s", significant(axis.longest_s, 5)),
        };
        console.say(format!(
            "axis {}: {} rows of {} s in {stretches}",
            axis.axis,
            axis.rows,
            significant(axis.sample_interval_s, 6)
        ));
    } else {
        console.say(format!("axis {}: a bare curve", axis.axis));
    }
    row_notes(axis, units).iter().for_each(|note| console.say(format!("  {note}")));
    let rows = AllanTerm::ALL.iter().map(|term| {
        let (factor, unit) = units.shown(term.name().1);
        let [value, interval] = term_text(axis.terms.get(*term), factor);
        vec![term.name().0.to_owned(), unit, value, interval]
    });
    console.say(table(&["term", "unit", "value", "95 % interval"], rows));
    for (letter, why) in reasons(axis, units) {
        console.say(format!("  {letter}: {why}"));
    }
    let step = axis.curve.len().div_ceil(SHOWN_TAUS).max(1);
    let end = |value: Option<f64>| value.map_or("-".to_owned(), |dph| units.number(dph, 3));
    let rows = axis
        .curve
        .iter()
        .step_by(step)
        .map(|p| vec![significant(p.tau_s, 4), units.number(p.adev_dph, 4), end(p.lower_dph), end(p.upper_dph)]);
    let title = if step > 1 { format!("τ, s, one in {step} of {}", axis.curve.len()) } else { "τ, s".to_owned() };
    console.say(table(&[&title, &format!("Allan deviation, {}", units.name()), "from", "to (95 %)"], rows));
}

/// Why terms are missing: letters of those with the same reason together.
fn reasons(axis: &AxisBudget, units: RateUnit) -> Vec<(String, String)> {
    let mut out: Vec<(String, String)> = Vec::new();
    for term in AllanTerm::ALL {
        let TermValue::Unresolved { unresolved } = axis.terms.get(term) else { continue };
        let letter = term.name().0.chars().last().unwrap_or_default();
        let unresolved = reason_text(term, unresolved, units);
        match out.iter_mut().find(|(_, why)| *why == unresolved) {
            Some((letters, _)) => {
                letters.push_str(", ");
                letters.push(letter);
            }
            None => out.push((letter.to_string(), unresolved)),
        }
    }
    out
}

/// The curves, a row per τ of an axis; `sagnac allan` reads such a table again, axis by axis.
fn curve_csv(budget: &NoiseBudget) -> String {
    let letters: Vec<char> = budget.axes.iter().map(|axis| axis.axis).collect();
    let mut out = String::from("tau_s");
    for letter in &letters {
        // A String takes all that is written to it.
        let _ = write!(out, ",adev_dph_{letter},lower_dph_{letter},upper_dph_{letter},hdev_dph_{letter}");
    }
    out.push('\n');
    let longest = budget.axes.iter().max_by_key(|axis| axis.curve.len());
    let cell = |value: Option<f64>| value.map_or(String::new(), |v| v.to_string());
    for row in 0..longest.map_or(0, |axis| axis.curve.len()) {
        let tau_s = longest.and_then(|axis| axis.curve.get(row)).map_or(0.0, |point| point.tau_s);
        let _ = write!(out, "{tau_s}");
        for axis in &budget.axes {
            let point = axis.curve.iter().find(|point| point.tau_s == tau_s);
            let hadamard = axis.hadamard.iter().find(|point| point.tau_s == tau_s);
            let _ = write!(
                out,
                ",{},{},{},{}",
                cell(point.map(|p| p.adev_dph)),
                cell(point.and_then(|p| p.lower_dph)),
                cell(point.and_then(|p| p.upper_dph)),
                cell(hadamard.map(|p| p.hdev_dph))
            );
        }
        out.push('\n');
    }
    out
}
