//! `sagnac import`: makes a calibration from existing coefficients.

use std::path::PathBuf;

use sagnac::export::{Polynomial, import};
use sagnac::{Error, Result};
use sagnac_log::setup::Setup;
use sagnac_log::write::write_bytes;
use sagnac_units::format::significant;

use crate::args::setup::numbers;
use crate::output::console::{Console, Outcome, Ran};
use crate::verbs::verb::Verb;

/// Turn an old polynomial correction into a calibration, for example to verify it
#[derive(clap::Args)]
#[command(after_help = "\
Example (the paper's curve):
  sagnac import --polynomial 0.85,-46,1043.39 --window 100 --span 17.94,36.18 --arcsec-per-count 1.059 -o old.cal.json")]
pub(crate) struct Args {
    /// Counts per window over °C, highest power first: A,B,C for A·T² + B·T + C
    #[arg(long, allow_hyphen_values = true)]
    polynomial: String,
    /// Window of the summed counts, s
    #[arg(long, value_name = "S")]
    window: f64,
    /// Temperature range of the polynomial, °C: LO,HI
    #[arg(long, allow_hyphen_values = true)]
    span: String,
    /// Nominal scale factor, arcsec per count
    #[arg(long, value_name = "ARCSEC")]
    arcsec_per_count: f64,
    /// Smallest step of the counts column, counts
    #[arg(long, value_name = "COUNTS")]
    quantum: Option<f64>,
    /// Serial number of the gyro
    #[arg(long)]
    serial: Option<String>,
    /// Axis letter
    #[arg(long)]
    axis: Option<char>,
    /// Temperature at which the correction is zero, °C
    #[arg(long, value_name = "C", allow_negative_numbers = true)]
    reference: Option<f64>,
    /// Calibration to write
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
}

impl Verb for Args {
    fn run(&self, console: &mut Console) -> Ran {
        let setup = Setup {
            serial: self.serial.clone(),
            axis: self.axis,
            arcsec_per_count: Some(self.arcsec_per_count),
            quantum: self.quantum,
            reference_c: self.reference,
            ..Setup::default()
        };
        let polynomial = Polynomial {
            coefficients: numbers("--polynomial", &self.polynomial)?,
            window_s: self.window,
            span_c: span(&self.span)?,
        };
        let calibration = import(&polynomial, &setup)?;
        write_bytes(&self.output, calibration.to_json()?.as_bytes())?;
        for axis in &calibration.axes {
            let at_reference: f64 = axis.run_offsets.iter().map(|c| c.value_dph).sum();
            console.say(format!(
                "axis {}: `{}`, {} °/h at {} °C",
                axis.axis,
                axis.correction.model,
                significant(at_reference, 6),
                axis.reference_c()
            ));
        }
        console.say(format!("wrote {}", self.output.display()));
        Ok(Outcome::Done)
    }
}

fn span(text: &str) -> Result<[f64; 2]> {
    let parsed = numbers("--span", text)?;
    parsed.try_into().map_err(|_| {
        Error::input("must be two temperatures", "write it like --span -20,60").column("--span").value(text)
    })
}
