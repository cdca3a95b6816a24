//! `sagnac verify`: a retest log through the decoded image, compared before and after.

use std::path::PathBuf;

use chrono::NaiveDate;
use sagnac::verify::{
    AxisVerification, BiasRepeatability, DriftValues, Estimate, Judged, Limits, PositionError, Proof, REPEATED_PROFILE,
    ScaleProof, ScaleValues, Verification, VerifyOptions, verify,
};
use sagnac::{Error, Result};
use sagnac_log::setup::RateUnit;
use sagnac_report::{Sheet, verification_report};
use sagnac_units::format::{significant, with_sigma};

use crate::args::report::ReportArgs;
use crate::args::setup::SetupArgs;
use crate::args::units::UnitsArgs;
use crate::files::loading;
use crate::output::console::{Console, Outcome, Ran};
use crate::output::tables::{limits_table, not_replayed};
use crate::output::terminal::table;
use crate::output::verification_brief::{new_clock, unseen, verification_brief};
use crate::verbs::verb::Verb;

/// Verify a correction on a separate test
///
/// Runs the retest through the firmware code, at the true tick, from the exact image that you will ship.
#[derive(clap::Args)]
#[command(after_help = "\
Example:
  sagnac verify unit.cal.json retest.csv --limits limits.toml --report retest.html")]
pub(crate) struct Args {
    /// Calibration or image
    correction: PathBuf,
    /// Logs that the fit did not see; a folder or a pattern stands for its logs
    #[arg(required = true)]
    retests: Vec<PathBuf>,
    /// Limits to be met: a TOML file, or `navigation-grade` or `paper`
    #[arg(long, value_name = "FILE|SET")]
    limits: Option<String>,
    #[command(flatten)]
    report: ReportArgs,
    #[command(flatten)]
    sheet: SheetArgs,
    /// One JSON object on standard output, text on standard error
    #[arg(long)]
    json: bool,
    /// Leave out what looks like bumps, steps or start-up (`outliers`), or the discarded start of each run (`start`): for a bench
    /// that was bumped. How much is left out is a limit of its own
    #[arg(long, value_enum, value_delimiter = ',', value_name = "WHAT")]
    exclude: Vec<Exclude>,
    #[command(flatten)]
    units: UnitsArgs,
    #[command(flatten)]
    setup: SetupArgs,
}

/// What a retest may be judged without.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Exclude {
    Outliers,
    Start,
}

/// The head of an acceptance report.
#[derive(clap::Args, Clone, Default)]
#[command(next_help_heading = "Head of an acceptance report (default: blank lines)")]
struct SheetArgs {
    /// Number of the document
    #[arg(long, value_name = "NUMBER", hide_short_help = true)]
    document: Option<String>,
    /// Who ran the test
    #[arg(long, value_name = "NAME", hide_short_help = true)]
    operator: Option<String>,
    /// Test date, such as 2024-02-29
    #[arg(long, value_name = "DATE", hide_short_help = true)]
    test_date: Option<NaiveDate>,
    /// Report date (never taken from the system clock)
    #[arg(long, value_name = "DATE", hide_short_help = true)]
    report_date: Option<NaiveDate>,
}

/// Longest entry of the head.
const MOST_ENTRY_CHARS: usize = 80;

impl SheetArgs {
    fn sheet(&self) -> Result<Sheet> {
        let text = |flag: &str, text: &Option<String>| match text {
            Some(text) if text.chars().count() > MOST_ENTRY_CHARS || text.chars().any(char::is_control) => {
                Err(Error::input(
                    format!("must have at most {MOST_ENTRY_CHARS} characters, and no control characters"),
                    "shorten the text",
                )
                .column(flag))
            }
            text => Ok(text.clone()),
        };
        if let (Some(test), Some(report)) = (self.test_date, self.report_date)
            && test > report
        {
            return Err(Error::input("the report is dated before its test", "correct --report-date or --test-date")
                .column("--report-date"));
        }
        Ok(Sheet {
            document: text("--document", &self.document)?,
            operator: text("--operator", &self.operator)?,
            test_date: self.test_date.map(|date| date.to_string()),
            report_date: self.report_date.map(|date| date.to_string()),
        })
    }
}

impl Verb for Args {
    fn json(&self) -> bool {
        self.json
    }

    fn logs(&mut self) -> Option<&mut Vec<PathBuf>> {
        Some(&mut self.retests)
    }

    fn run(&self, console: &mut Console) -> Ran {
        let sheet = self.sheet.sheet()?;
        self.report.check_name()?;
        let correction = loading::correction(&self.correction)?;
        let setup = self.setup.over(correction.setup())?;
        let limits = self.limits.as_deref().map(Limits::named_or_read).transpose()?;
        let logs = loading::logs(&self.retests, &setup, "replaying")?;
        let options = VerifyOptions::default()
            .exclude_outliers(self.exclude.contains(&Exclude::Outliers))
            .exclude_start(self.exclude.contains(&Exclude::Start));
        let proof = verify(&correction, logs, &setup, options)?;
        let Proof { verification, report_data, .. } = match &limits {
            Some(limits) => proof.limits(limits)?,
            None => proof,
        };
        let units = self.units.over(&setup);
        let wrote = self.report.written(|| {
            verification_report(&verification, correction.calibration.as_ref(), &report_data, &sheet, units)
        })?;
        let rule = limits.and_then(|limits| limits.decision).unwrap_or_default();
        let brief = verification_brief(&verification, rule, &wrote, units);
        brief.say(console, |console| {
            reservations(console, &verification, units);
            describe(console, &verification, units);
        });
        console.object(&verification)?;
        Ok(if verification.passed() { Outcome::Done } else { Outcome::LimitsNotMet })
    }
}

/// Warns of what speaks against the retest, whatever its values: a log of the fit proves nothing.
fn reservations(console: &mut Console, verification: &Verification, units: RateUnit) {
    for file in &verification.training_overlap {
        console.note(format!("warning: {file} is a log of the calibration itself, so this is no proof"));
    }
    for objection in &verification.objections {
        console.note(format!("warning: {objection}"));
    }
    for one in &verification.overrides {
        console.note(format!("overridden: {}", one.words(units)));
    }
    for file in &verification.new_clocks {
        console.note(new_clock(file));
    }
    verification.unseen_h.iter().for_each(|hours| console.note(unseen(*hours)));
    for axis in &verification.axes {
        axis.flagged_off
            .iter()
            .for_each(|off| console.note(format!("warning: axis {}: {}", axis.axis, off.words(units))));
    }
    if verification.training_unknown {
        console.note(
            "warning: an image does not name its training logs: verify its calibration for a proof on unseen data",
        );
    }
    if !verification.untested_axes.is_empty() {
        let axes: Vec<String> = verification.untested_axes.iter().map(char::to_string).collect();
        console.note(format!(
            "warning: the retest lacks axis {} of the calibration, so the unit is not accepted",
            axes.join(", ")
        ));
    }
}

fn describe(console: &mut Console, verification: &Verification, units: RateUnit) {
    for axis in &verification.axes {
        console.say(format!("axis {}: {}", axis.axis, verdict(axis, verification)));
        console.say(drift_values(axis, verification, units));
        if axis.about_common_mean {
            console.say("  each run covers little of the temperatures: figures are about the mean of all runs");
        }
        if axis.repeats_profile {
            console.say(format!("  {REPEATED_PROFILE}"));
        }
        if let Some(coverage) = &axis.coverage {
            console.say(format!("  temperatures {}", coverage.words()));
        }
        for (name, windows) in &axis.status_windows {
            console.say(format!("  status {name}: {windows} of {} windows", axis.after.n));
        }
        if let Some(scale) = &axis.scale_factor {
            console.say(scale_factor(scale));
        }
        if let Some(repeatability) = &axis.bias_repeatability {
            console.say(bias_repeatability(repeatability, units));
        }
        for suspect in &axis.suspects {
            let judged = if axis.excluded_fraction.is_some() { "" } else { "; judged with the rest" };
            console.say(format!("  suspected {}{judged}", suspect.words(units)));
        }
        let rows = axis.residual_diagnostics.rows(units);
        if !rows.is_empty() {
            console.say(table(&["residual", "value", "noise alone"], rows));
        }
        if let Some(flight) = &axis.flight {
            console.say(flown(flight));
        }
        if let Some(why) = &axis.flight_unavailable {
            console.say(format!("  the flight is not available: {why}"));
        }
        if !axis.limits.is_empty() {
            console.say(limits_table(&axis.limits, axis.excluded_fraction.is_some()));
        }
    }
    for line in not_replayed(&verification.excluded) {
        console.say(line);
    }
}

/// Result of the stated flight; drift and noise separately.
fn flown(flight: &PositionError) -> String {
    let metres = |e: Estimate| with_sigma(e.value, Some(e.sigma));
    let noise = flight.noise_m.map_or("not known".to_owned(), |m| format!("{} m (σ)", significant(m, 3)));
    format!(
        "  flight of {:.0} min: position error by drift {} m before, {} m after ({} m at most on the way, {} m with two of its σ); angle random walk next to it: {noise}",
        flight.minutes,
        metres(flight.before_m),
        metres(flight.after_m),
        significant(flight.most_after_m, 3),
        significant(flight.bound_after_m, 3)
    )
}

/// Fixed bias of the runs against the calibration.
fn bias_repeatability(repeatability: &BiasRepeatability, units: RateUnit) -> String {
    let text = |e: Estimate| format!("{} {}", units.with_sigma(e.value, Some(e.sigma)), units.name());
    let mut out = format!(
        "  fixed bias after the correction: calibration {} ({})",
        text(repeatability.calibration_dph),
        repeatability.input_text(units)
    );
    for run in &repeatability.runs {
        let file = sagnac_units::format::file_name(&run.file);
        out += &format!("\n  {file}: {}, {} from the calibration", text(run.bias_dph), text(run.difference_dph));
    }
    if let Some(turn_ons) = repeatability.turn_ons {
        let [sigma, upper] = [turn_ons.sigma_dph, turn_ons.sigma_upper_dph].map(|dph| units.text(dph, 2));
        out += &format!(
            "\n  turn-on to turn-on: σ {sigma} over {} turn-ons, below {upper} with 95 % confidence",
            turn_ons.n
        );
    }
    out
}

/// The scale factor over the plateaus, before and after.
fn scale_factor(scale: &ScaleProof) -> String {
    let row = |name: &str, f: &ScaleValues| {
        let cells = [f.mean_ppm, f.peak_to_peak_ppm, f.sigma_ppm].map(|v| significant(v, 3));
        [vec![name.to_owned()], cells.to_vec()].concat()
    };
    let noise =
        [vec!["noise alone".to_owned(), "-".to_owned(), "-".to_owned()], vec![significant(scale.of_noise_ppm, 3)]];
    let rows = vec![row("before", &scale.before), row("after", &scale.after), noise.concat()];
    let title = format!("scale factor, ppm, {} plateaus", scale.plateaus.len());
    table(&[&title, "mean", "max − min", "σ"], rows)
}

fn verdict(axis: &AxisVerification, verification: &Verification) -> String {
    let times = |ratio: Option<f64>| ratio.map_or("-".to_owned(), |r| format!("{} times", significant(r, 3)));
    let judged = Judged::of(&axis.limits);
    let judged = match axis.pass {
        Some(_) if !verification.training_overlap.is_empty() => "NOT ACCEPTED: the fit has seen this log; ".to_owned(),
        Some(_) if !verification.objections.is_empty() => "NOT ACCEPTED; ".to_owned(),
        Some(true) if !verification.untested_axes.is_empty() => {
            format!("NOT ACCEPTED: an axis is not tested; {} on this one; ", judged.words())
        }
        Some(true) if verification.training_unknown => {
            format!("{}{}, training logs unknown; ", judged.words(), verification.reservations())
        }
        Some(true) if judged.not_asked == 0 && verification.overrides.is_empty() => "all limits met; ".to_owned(),
        Some(true) => format!("{}{}; ", judged.words(), verification.reservations()),
        Some(false) if judged.not_met == 0 => format!("LIMITS NOT DECIDED: {}; ", judged.words()),
        Some(false) => "LIMITS NOT MET; ".to_owned(),
        None => String::new(),
    };
    let floor = axis.noise_floor.as_ref().map_or("noise floor unknown".to_owned(), |floor| {
        format!("σ after is {} of the noise floor", significant(axis.after.sigma_dph / floor.value_dph, 3))
    });
    format!("{judged}max − min improved {}, σ {}; {floor}", times(axis.improvement), times(axis.improvement_sigma))
}

fn drift_values(axis: &AxisVerification, verification: &Verification, units: RateUnit) -> String {
    let (factor, unit) = units.shown(&verification.unit);
    let row = |name: &str, f: &DriftValues| {
        let cells = [f.min, f.max, f.mean, f.peak_to_peak, f.sigma].map(|v| format!("{v:.2}"));
        let precise = [f.min, f.max, f.mean, f.peak_to_peak, f.sigma].map(|v| significant(factor * v, 5));
        let cells = if verification.unit == "deg/h" { precise } else { cells };
        [vec![name.to_owned(), f.n.to_string()], cells.to_vec(), vec![units.number(f.sigma_dph, 3)]].concat()
    };
    let mut rows = vec![row("before", &axis.before), row("after", &axis.after)];
    if let Some(floor) = &axis.noise_floor {
        let blank = String::new;
        rows.push(vec![
            format!("noise floor ({})", floor.source),
            floor.n.to_string(),
            blank(),
            blank(),
            blank(),
            significant(factor * floor.expected_peak_to_peak, 3),
            significant(factor * floor.value, 3),
            units.number(floor.value_dph, 3),
        ]);
    }
    let title = format!("{unit} ({} s)", verification.window_s);
    table(&[&title, "n", "min", "max", "mean", "max − min", "σ", &format!("σ, {}", units.name())], rows)
}
