//! `sagnac evaluate`: the correction at temperatures of one's choice, with its interval.

use std::ops::RangeInclusive;
use std::path::PathBuf;

use sagnac::calibration::{AxisCalibration, Evaluation};
use sagnac::{Error, Result};
use sagnac_log::ingest::Content;
use sagnac_log::setup::RateUnit;
use sagnac_log::write::write_rows;
use sagnac_units::format::{counted, plain, significant};
use serde::Serialize;

use crate::args::units::UnitsArgs;
use crate::files::loading;
use crate::output::console::{Console, Outcome, Ran};
use crate::output::terminal::table;
use crate::verbs::verb::Verb;

/// Most temperatures of one call.
const MOST_POINTS: usize = 1_000_000;

/// Evaluate the correction at given temperatures: drift with its 95 % interval, scale factor
///
/// The drift is zero at the reference temperature and at rest. Other inputs are at their references. Outside the calibrated range the
/// correction keeps its border value, as on the target.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  sagnac evaluate unit.cal.json --at -40:70:5
  sagnac evaluate unit.cal.json --at 20,25,30 --rate-cpm 1 --json
  sagnac evaluate unit.cal.json --at -40:70:0.1 -o curve.parquet")]
pub(crate) struct Args {
    /// Calibration
    calibration: PathBuf,
    /// Temperatures, °C: FROM:TO:STEP, or a list with commas
    #[arg(long, value_name = "C", allow_hyphen_values = true)]
    at: String,
    /// Temperature rate, °C/min
    #[arg(long, value_name = "R", default_value_t = 0.0, allow_negative_numbers = true)]
    rate_cpm: f64,
    /// Table to write: CSV, or Parquet for a name in .parquet
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    units: UnitsArgs,
    /// One JSON object on standard output, text on standard error
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Evaluated {
    axes: Vec<EvaluatedAxis>,
}

#[derive(Serialize)]
struct EvaluatedAxis {
    axis: char,
    points: Vec<Evaluation>,
}

impl Verb for Args {
    fn json(&self) -> bool {
        self.json
    }

    fn run(&self, console: &mut Console) -> Ran {
        let calibration = loading::calibration(&self.calibration)?;
        let units = self.units.over(&calibration.setup);
        let temperatures = temperatures(&self.at)?;
        if !self.rate_cpm.is_finite() {
            return Err(Error::input("must be a number", "give a temperature rate in °C/min, such as --rate-cpm 0.5")
                .column("--rate-cpm")
                .value(self.rate_cpm.to_string()));
        }
        let of_axis = |axis: &AxisCalibration| EvaluatedAxis {
            axis: axis.axis,
            points: temperatures.iter().map(|celsius| axis.evaluate(*celsius, self.rate_cpm)).collect(),
        };
        let evaluated = Evaluated { axes: calibration.axes.iter().map(of_axis).collect() };
        if let Some(path) = &self.output {
            loading::check_output_name(path, "CSV, or Parquet for .parquet")?;
            let content = |name: &str| if name == "axis" { Content::Text } else { Content::Number };
            let columns = HEADER.iter().map(|name| ((*name).to_owned(), content(name))).collect();
            write_rows(
                path,
                columns,
                evaluated.axes.iter().flat_map(|axis| axis.points.iter().map(|point| cells(axis.axis, point))),
            )?;
            console.say(format!(
                "wrote {}: {} of {}",
                path.display(),
                counted(temperatures.len(), "point", "points"),
                counted(evaluated.axes.len(), "axis", "axes")
            ));
        } else {
            evaluated.axes.iter().for_each(|axis| console.say(describe(axis, units)));
            let memory = |axis: &AxisCalibration| axis.fit.as_ref()?.memory?.note(units);
            for axis in &calibration.axes {
                memory(axis).iter().for_each(|text| console.note(format!("axis {}: {text}", axis.axis)));
            }
        }
        console.object(&evaluated)?;
        Ok(Outcome::Done)
    }
}

/// Temperatures that a gyro may have, °C.
const CELSIUS: RangeInclusive<f64> = -273.15..=1000.0;

/// `FROM:TO:STEP` with both ends, or a list.
fn temperatures(text: &str) -> Result<Vec<f64>> {
    let bad =
        |what: &str| Error::input(what, "write it like --at -40:70:5 or --at -40,25,70").column("--at").value(text);
    // A negative zero is none.
    let number =
        |part: &str| part.trim().parse::<f64>().ok().filter(|value| value.is_finite()).map(|value| value + 0.0);
    let numbers = |separator: char| text.split(separator).map(number).collect::<Option<Vec<f64>>>();
    let all = if text.contains(':') {
        match numbers(':').as_deref() {
            Some(&[from, to, step]) if step > 0.0 && to >= from => {
                let count = ((to - from) / step + 1e-9).floor();
                if count >= MOST_POINTS as f64 {
                    return Err(bad("more than a million temperatures"));
                }
                (0..=count as usize).map(|i| from + step * i as f64).collect()
            }
            _ => return Err(bad("a range is FROM:TO:STEP with a step above zero and TO not below FROM")),
        }
    } else {
        numbers(',').ok_or_else(|| bad("temperatures are numbers with commas between them"))?
    };
    let can_be = all.iter().all(|celsius| CELSIUS.contains(celsius));
    if can_be { Ok(all) } else { Err(bad("temperatures are from -273.15 to 1000 °C")) }
}

const HEADER: [&str; 7] = ["axis", "temperature_c", "rate_cpm", "drift_dph", "lower_dph", "upper_dph", "scale_ppm"];

/// The numbers of a point; empty where there is no interval.
fn cells(axis: char, point: &Evaluation) -> Vec<String> {
    let Evaluation { temperature_c, rate_cpm, drift_dph, lower_dph, upper_dph, scale_ppm, .. } = *point;
    let end = |end: Option<f64>| end.map_or(String::new(), |end| end.to_string());
    vec![
        axis.to_string(),
        temperature_c.to_string(),
        rate_cpm.to_string(),
        drift_dph.to_string(),
        end(lower_dph),
        end(upper_dph),
        scale_ppm.to_string(),
    ]
}

fn describe(axis: &EvaluatedAxis, units: RateUnit) -> String {
    let rows = axis.points.iter().map(|point| {
        let interval = match (point.lower_dph, point.upper_dph) {
            (Some(lower), Some(upper)) => format!("{} … {}", units.number(lower, 3), units.number(upper, 3)),
            _ => "not known".to_owned(),
        };
        vec![
            plain(point.temperature_c),
            units.number(point.drift_dph, 4),
            interval,
            significant(point.scale_ppm, 4),
            if point.in_span { String::new() } else { "outside the tested temperatures or rates".to_owned() },
        ]
    });
    let title = format!("axis {}: °C", axis.axis);
    let rate = axis.points.first().map_or(0.0, |point| point.rate_cpm);
    let drift = format!("drift, {}, at {} °C/min", units.name(), plain(rate));
    table(&[&title, &drift, "95 % interval", "scale factor, ppm", ""], rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_hold_both_ends_and_lists_are_as_given() {
        assert_eq!(temperatures("-40:70:55").unwrap(), [-40.0, 15.0, 70.0]);
        assert_eq!(temperatures("0:0.3:0.1").unwrap().len(), 4);
        assert_eq!(temperatures("25").unwrap(), [25.0]);
        assert_eq!(temperatures("20, -3.5").unwrap(), [20.0, -3.5]);
        assert!(temperatures("-0.0").unwrap()[0].is_sign_positive());
        for text in [
            "",
            "1:2",
            "70:-40:5",
            "0:1:0",
            "0:1:-1",
            "a",
            "1,,2",
            "nan",
            "0:1e9:1e-3",
            "1e308",
            "-300",
            "0:2000:1",
            "0:1000:1e-4",
        ] {
            assert!(temperatures(text).is_err(), "{text}");
        }
    }
}
