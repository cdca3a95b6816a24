//! `sagnac plan`: the shortest thermal test of the next unit of a fleet.

use std::path::PathBuf;

use sagnac::fleet::PriorFile;
use sagnac::plan::{Chamber, Plan, PlanRequest, plan};
use sagnac::verify::Limits;
use sagnac_log::setup::{RateUnit, Setup, WindowSize};
use sagnac_log::write::write_bytes;
use sagnac_units::format::{celsius, significant};

use crate::args::setup::numbers;
use crate::args::units::UnitsArgs;
use crate::output::console::{Console, Outcome, Ran};
use crate::output::terminal::table;
use crate::verbs::verb::Verb;

/// Find the shortest test likely to qualify the next unit
///
/// Writes temperatures, ramps and soaks for a chamber. Every test rests in mid-span after heating and after cooling. Calibrate the
/// unit with the same prior afterwards.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  sagnac plan --prior fleet.prior.json --limits navigation-grade
  sagnac plan --prior fleet.prior.json --lot A --limits limits.toml --start 22 --ramps 0.5,1 --block-lag 20 -o test.csv")]
pub(crate) struct Args {
    /// Prior knowledge of the unit: a file of `sagnac fleet prior`
    #[arg(long, value_name = "FILE")]
    prior: PathBuf,
    /// Lot of the unit, from the prior
    #[arg(long, value_name = "NAME")]
    lot: Option<String>,
    /// Limits for the unit: a TOML file, or `navigation-grade` or `paper`
    #[arg(long, value_name = "FILE|SET")]
    limits: String,
    /// Setup file: its noise, window and reference temperature override the fleet's
    #[arg(long, value_name = "FILE")]
    setup: Option<PathBuf>,
    /// Temperature at the start of the test, °C
    #[arg(long, default_value_t = 25.0, value_name = "CELSIUS", allow_negative_numbers = true)]
    start: f64,
    /// Ramp rates of the chamber, °C/min
    #[arg(long, default_value = "1", value_name = "RATES")]
    ramps: String,
    /// Lag of the gyro's block behind the chamber, min
    #[arg(long, default_value_t = 0.0, value_name = "MINUTES")]
    block_lag: f64,
    /// Required probability that the unit meets the limits
    #[arg(long, default_value_t = 0.97)]
    probability: f64,
    /// Share of each limit for the correction error; the rest is for the retest's noise
    #[arg(long, default_value_t = 0.5)]
    share: f64,
    /// Longest test, h
    #[arg(long, default_value_t = 24.0, value_name = "HOURS")]
    hours_max: f64,
    /// Steps for the chamber, as CSV
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
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
        let file = PriorFile::read(&self.prior)?;
        let setup = self.setup.as_deref().map(Setup::read).transpose()?.unwrap_or_default();
        let prior = file.of_unit(self.lot.as_deref()).map_err(|e| e.file(self.prior.display().to_string()))?;
        let mut chamber = Chamber::new(self.start, numbers("--ramps", &self.ramps)?);
        chamber.block_lag_min = self.block_lag;
        let noise = setup.noise.unwrap_or_else(|| file.noise());
        let mut request = PlanRequest::new(prior, noise, Limits::named_or_read(&self.limits)?, chamber);
        (request.probability, request.share, request.hours_max) = (self.probability, self.share, self.hours_max);
        request.reference_c = setup.reference_c;
        if let Some(seconds) = setup.window.and_then(WindowSize::seconds) {
            request.window_s = seconds;
        }
        let plan = plan(&request)?;
        console.say(described(&plan, &request, self.units.over(&setup)));
        if let Some(path) = &self.output {
            write_bytes(path, csv(&plan).as_bytes())?;
            console.say(format!("wrote {}", path.display()));
        }
        console.object(&plan)?;
        Ok(Outcome::Done)
    }
}

fn described(plan: &Plan, request: &PlanRequest, units: RateUnit) -> String {
    let mut out = format!(
        "{} h of chamber from {}: the error of the correction takes at most {} of each limit with a probability of {}\n",
        significant(plan.hours, 3),
        celsius(request.chamber.start_c) + " °C",
        significant(request.share, 2),
        significant(plan.probability, 3)
    );
    let steps = plan
        .steps
        .iter()
        .map(|step| vec![celsius(step.to_c), significant(step.rate_cpm, 3), significant(step.soak_min, 3)]);
    out += &table(&["to, °C", "at, °C/min", "then soak, min"], steps);
    out += "\n";
    let limits = plan.expected.iter().map(|limit| {
        let (factor, unit) = units.shown(&limit.unit);
        vec![
            limit.limit.clone(),
            significant(factor * limit.value_95, 2),
            significant(factor * limit.bound, 3),
            format!("{:.0} %", 100.0 * limit.value_95 / limit.bound),
            unit,
        ]
    });
    out += &table(&["limit", "error, 95 %", "bound", "taken", "unit"], limits);
    out += &format!(
        "\n  σ of the correction over temperatures and ramps: {}; {} tests were compared",
        units.text(plan.sigma_dph, 2),
        plan.candidates
    );
    out += &match plan.hours_without_prior {
        Some(hours) => format!("\n  without the prior, its model known: {} h", significant(hours, 3)),
        None => format!("\n  without the prior no test of up to {} h does it", request.hours_max),
    };
    if !plan.not_planned.is_empty() {
        out += &format!("\n  not a matter of the calibration: {}", plan.not_planned.join(", "));
    }
    out
}

/// The steps for a chamber's program.
fn csv(plan: &Plan) -> String {
    let steps = plan.steps.iter().map(|step| format!("{},{},{}\n", step.to_c, step.rate_cpm, step.soak_min));
    "to_c,rate_cpm,soak_min\n".to_owned() + &steps.collect::<String>()
}
