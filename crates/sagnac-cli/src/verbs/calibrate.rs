//! `sagnac calibrate`: thermal-test logs in, calibration out.

use std::path::{Path, PathBuf};

use sagnac::calibration::AxisCalibration;
use sagnac::fit::{FitOptions, UnitPrior, calibrate_with_report_data, frontier};
use sagnac::fleet::PriorFile;
use sagnac::model::TICK_INSTRUCTIONS;
use sagnac::{Error, Result};
use sagnac_log::setup::RateUnit;
use sagnac_log::write::write_bytes;
use sagnac_report::calibration_report;
use sagnac_units::format::significant;

use crate::args::report::ReportArgs;
use crate::args::setup::{LogArgs, source_date_epoch};
use crate::args::units::UnitsArgs;
use crate::output::brief::Remark;
use crate::output::calibration::describe;
use crate::output::calibration_brief::calibration_brief;
use crate::output::console::{Console, Outcome, Ran};
use crate::output::progress::of_fit;
use crate::output::terminal::table;
use crate::verbs::verb::Verb;

/// Fit how bias and scale factor move with temperature
///
/// Each LOG is one run.
#[derive(clap::Args)]
#[command(
    after_help = "\
Example:
  sagnac calibrate cycle-1.csv cycle-2.csv --setup bench.toml -o unit.cal.json --report unit.html",
    after_long_help = "\
Examples:
  sagnac calibrate cycle-1.csv cycle-2.csv --setup bench.toml -o unit.cal.json --report unit.html
  sagnac calibrate log.csv --arcsec-per-count 1.059 --model \"bias 3, rate 1\" -o unit.cal.json --json
  sagnac calibrate log.csv --setup bench.toml --model \"bias 2, rate 0, bias(cavity - block) 1, steps(mode)\" -o unit.cal.json
  sagnac calibrate log.csv --setup bench.toml --inputs \"cavity - block,path_length_v\" -o unit.cal.json
  sagnac calibrate short.csv --setup bench.toml --prior fleet.prior.json --lot A -o unit.cal.json"
)]
pub(crate) struct Args {
    /// Thermal-test logs: CSV, Parquet, Arrow or PX4 ULog, also gzipped; a folder or a pattern stands for its logs, `-` is standard input
    #[arg(required = true)]
    logs: Vec<PathBuf>,
    /// Calibration to write
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    report: ReportArgs,
    /// `auto`, or orders: "bias 3, rate 1"
    ///
    /// Also "bias 3, rate 1, slow rate 0" (two lags), "bias 2, zones 4", "bias 2, bias(cavity - block) 1, steps(mode)", "bias 2,
    /// harmonic(path_length_v) 25.3" (its period; fitted without one)
    #[arg(long, default_value = "auto")]
    model: String,
    /// What is known of the unit before its test: a file of `sagnac fleet prior`, whose model it takes
    #[arg(long, value_name = "FILE", conflicts_with_all = ["model", "warm_up", "tradeoff"])]
    prior: Option<PathBuf>,
    /// The unit's lot, one of the prior's
    #[arg(long, value_name = "NAME", requires = "prior")]
    lot: Option<String>,
    /// Trade-off of model orders: error on unseen data against run time on the target
    #[arg(long)]
    tradeoff: bool,
    /// Corrects the warm-up since power-on too, where the runs hold one: every log must begin at power-on
    #[arg(long)]
    warm_up: bool,
    /// Remove the fixed bias at T0 too; needs the input rate, 0 included
    #[arg(long)]
    remove_bias: bool,
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
        Some(&mut self.logs)
    }

    fn run(&self, console: &mut Console) -> Ran {
        self.report.check_name()?;
        let prior = self.prior.as_deref().map(|path| of_unit(path, self.lot.as_deref())).transpose()?;
        if let (Some(lot), Some(UnitPrior { lot: None, .. })) = (&self.lot, &prior) {
            console.note(format!(
                "the prior has no lot {lot} of eight axes or more: it is about the mean of all lots, as a new lot is"
            ));
        }
        let options = FitOptions::new(self.model.parse()?)
            .prior(prior)
            .source_date_epoch(source_date_epoch()?)
            .correct_warm_up(self.warm_up)
            .remove_bias(self.remove_bias)
            .progress(of_fit());
        let (windows, setup) = self.reading.windows(&self.logs)?;
        let units = self.units.over(&setup);
        for run in windows.runs.iter().filter(|run| run.files.len() > 1) {
            let by_counter = run.files.iter().any(|file| file.summary.follows_by_counter);
            let why =
                if by_counter { "whose running total goes on although the time restarts" } else { "whose times go on" };
            console.note(format!("one run: {}, {why} (--runs makes each file a run)", run.name()));
        }
        let (calibration, report_data) = calibrate_with_report_data(windows, &setup, &options)?;
        // Its bar goes before the results come.
        drop(options);
        let text = calibration.to_json()?;
        let trades = calibration
            .axes
            .iter()
            .filter(|_| self.tradeoff)
            .map(|axis| tradeoff(axis, units))
            .collect::<Result<Vec<_>>>()?;
        if let Some(path) = &self.output {
            write_bytes(path, text.as_bytes())?;
        }
        let output = self.output.as_ref().map(|path| path.display().to_string());
        let mut wrote: Vec<String> = output.iter().cloned().collect();
        wrote.extend(self.report.written(|| calibration_report(&calibration, &report_data, units))?);
        let mut brief = calibration_brief(&calibration, &report_data, &wrote, output.as_deref(), units);
        let no_warm_up = calibration.axes.iter().filter(|axis| self.warm_up && axis.correction.warm_up.is_none());
        let axes: Vec<char> = no_warm_up.map(|axis| axis.axis).collect();
        if !axes.is_empty() {
            brief.remarks.push(Remark { axes, ..Remark::note("these runs show no warm-up, so none is corrected") });
        }
        brief.say(console, |console| calibration.axes.iter().for_each(|axis| describe(console, axis, units)));
        trades.into_iter().for_each(|trade| console.say(trade));
        console.object(&calibration)?;
        Ok(Outcome::Done)
    }
}

fn of_unit(path: &Path, lot: Option<&str>) -> Result<UnitPrior> {
    PriorFile::read(path)?.of_unit(lot).map_err(|e| e.file(path.display().to_string()))
}

/// The frontier of price and held-out residual, with the knee.
fn tradeoff(axis: &AxisCalibration, units: RateUnit) -> Result<String> {
    let best = frontier(axis);
    if axis.candidates().len() < 2 || best.is_empty() {
        return Err(Error::input("a trade-off needs several models", "remove --model").column("--tradeoff"));
    }
    let floor = axis.noise_floor().map(|floor| floor.value_dph);
    let rows = best.iter().map(|point| {
        vec![
            point.candidate.model.clone(),
            point.instructions.to_string(),
            units.number(point.held_out_dph, 4),
            floor.map_or("-".to_owned(), |floor| significant(point.held_out_dph / floor, 3)),
            if point.knee { "the knee: no larger model is justified" } else { "" }.to_owned(),
        ]
    });
    let held_out = format!("held-out σ, {}", units.name());
    let header = ["cheapest models", "slow update, instructions", &held_out, "over the floor", ""];
    let words = format!(
        "  the tick takes {TICK_INSTRUCTIONS} instructions whatever the model (Cortex-M4F; instructions are not cycles)"
    );
    Ok(format!("{}\n{words}", table(&header, rows)))
}
