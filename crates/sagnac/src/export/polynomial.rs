//! `sagnac import --polynomial`: makes a calibration from existing coefficients, so that an old correction can be
//! verified like a new one.
//!
//! The polynomial is the paper's: counts per window as a function of °C at the rate of that test. Only
//! its variation P(T) − P(T0) is kept; the constant P(T0) becomes the offset of run 0.

use sagnac_core::MAX_ORDER;
use sagnac_log::error::{Error, Result};
use sagnac_log::setup::{Setup, WindowSize};

use crate::calibration::{
    AxisCalibration, AxisCorrection, Calibration, CorrectionTerm, FORMAT, Input, LogUnit, MINOR_VERSION, Monomial,
    Provenance, RunOffset, Target, UNASSIGNED, VERSION, program,
};
use crate::model::powers::series_from_powers;
use crate::model::{Form, Span};

/// An old correction.
#[derive(Clone, Debug, PartialEq)]
pub struct Polynomial {
    /// Counts per window; highest power of °C first, as in the paper.
    pub coefficients: Vec<f64>,
    /// The window, s.
    pub window_s: f64,
    /// Temperatures it was made from, °C.
    pub span_c: [f64; 2],
}

/// Makes a calibration of it; serial, axis, scale factor, quantum and T0 from the setup.
///
/// # Errors
/// No coefficient or too many, an empty span, T0 outside it, no scale factor.
pub fn import(polynomial: &Polynomial, setup: &Setup) -> Result<Calibration> {
    setup.check()?;
    let order = polynomial.coefficients.len().checked_sub(1).filter(|order| *order <= usize::from(MAX_ORDER));
    let order = order.ok_or_else(|| {
        Error::input(format!("needs 1 to {} coefficients", MAX_ORDER + 1), "write it like --polynomial 0.1,-2e-3,5e-6")
            .column("--polynomial")
    })?;
    let [lo_c, hi_c] = polynomial.span_c;
    if !(lo_c < hi_c && lo_c > -127.0 && hi_c < 127.0) {
        return Err(Error::input("must be two temperatures, the lower first", "write it like --span -20,60")
            .column("--span")
            .value(format!("{lo_c},{hi_c}")));
    }
    let sound = (1e-3..=1e6).contains(&polynomial.window_s) && polynomial.coefficients.iter().all(|c| c.is_finite());
    if !sound {
        return Err(Error::input(
            "coefficients must be finite, the window within 0.001 … 1e6 s",
            "correct --polynomial or --window",
        )
        .column("--polynomial"));
    }
    let arcsec_per_count = setup.arcsec_per_count.ok_or_else(|| {
        Error::input("the size of a count in arcsec is not given", "give --arcsec-per-count ARCSEC")
            .column("arcsec_per_count")
    })?;
    let span = Span::on_grid(lo_c, hi_c);
    let reference_c = setup.reference_c();
    if !(lo_c..=hi_c).contains(&reference_c) {
        return Err(Error::refused(
            format!("the reference temperature {reference_c} °C lies outside the span {lo_c} … {hi_c} °C"),
            "set --reference to a temperature in this range",
        )
        .column("reference_c"));
    }
    let ascending: Vec<f64> = polynomial.coefficients.iter().rev().copied().collect();
    let dph_per_count = arcsec_per_count / polynomial.window_s;
    let dph: Vec<f64> = ascending.iter().map(|c| c * dph_per_count).collect();
    let at_reference = dph.iter().rev().fold(0.0, |sum, c| sum * reference_c + c);
    let series = series_from_powers(span, &dph);
    let input = Input::thermometer(setup.thermometer(""), span, reference_c);
    let terms = (1..=order).map(|n| CorrectionTerm::given(Form::bias(n as u8), &input, series[n])).collect();
    let letter = setup.axis.unwrap_or('x');
    let axis = AxisCalibration {
        axis: letter,
        correction: AxisCorrection {
            model: format!("bias {order}"),
            inputs: vec![input],
            terms,
            warm_up: None,
            fixed_bias: None,
        },
        run_offsets: vec![run_offset(at_reference, setup.input_rate_of(letter, 1))],
        monomial: Some(Monomial {
            run: 0,
            unit: "counts per window".to_owned(),
            window_s: polynomial.window_s,
            coefficients: ascending,
            sigma: None,
            range_c: None,
        }),
        zones: Vec::new(),
        fit: None,
    };
    Ok(Calibration {
        format: FORMAT.to_owned(),
        version: VERSION,
        minor_version: MINOR_VERSION,
        serial: setup.serial.clone().unwrap_or_else(|| UNASSIGNED.to_owned()),
        unit: LogUnit::Counts { arcsec_per_count, quantum: setup.quantum.unwrap_or(1.0) },
        target: Target::of(setup)?,
        window: WindowSize::Seconds(polynomial.window_s),
        window_s: polynomial.window_s,
        sample_interval_s: setup.sample_interval_s.unwrap_or(1.0),
        axes: vec![axis],
        setup: setup.clone(),
        provenance: Provenance {
            program: program(),
            time_s: 0.0,
            time_source: "imported coefficients".to_owned(),
            inputs: Vec::new(),
            noise_trace: None,
        },
    })
}

fn run_offset(value_dph: f64, input_dph: Option<f64>) -> RunOffset {
    let fixed_bias_dph = input_dph.map(|input| value_dph - input);
    RunOffset { run: 0, value_dph, sigma_dph: None, fixed_bias_dph }
}
