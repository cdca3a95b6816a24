//! An axis to and from the flat object of the file.

use crate::calibration::axis::{AxisCalibration, AxisCorrection};
use crate::calibration::axis_record::AxisRecord;

impl From<AxisCalibration> for AxisRecord {
    fn from(axis: AxisCalibration) -> Self {
        let main = axis.correction.inputs.first();
        let (lag_s, rate_span_cpm) = (main.and_then(|m| m.lag_s), main.and_then(|m| m.rate_span_per_min));
        let (reference_c, span_c) = main.map_or((f64::NAN, [f64::NAN; 2]), |m| (m.reference, m.span));
        let AxisCalibration { axis, correction, run_offsets, monomial, zones, fit } = axis;
        let AxisCorrection { model, inputs, terms, warm_up, fixed_bias } = correction;
        let record = Self {
            axis,
            model,
            terms,
            warm_up,
            fixed_bias,
            lag_s,
            reference_c,
            span_c,
            rate_span_cpm,
            inputs,
            run_offsets,
            monomial,
            zones,
            ..Self::default()
        };
        match fit {
            Some(fit) => record.with(fit),
            None => record,
        }
    }
}

impl TryFrom<AxisRecord> for AxisCalibration {
    type Error = String;

    fn try_from(mut record: AxisRecord) -> Result<Self, String> {
        let Some(main) = record.inputs.first() else {
            return Err(format!("axis {}: `inputs` has no thermometer of the fit", record.axis));
        };
        let repeated = [
            ("reference_c", record.reference_c == main.reference),
            ("span_c", record.span_c == main.span),
            ("lag_s", record.lag_s == main.lag_s),
            ("rate_span_cpm", record.rate_span_cpm == main.rate_span_per_min),
        ];
        if let Some((name, _)) = repeated.iter().find(|(_, same)| !same) {
            return Err(format!("axis {}: `{name}` is not that of inputs[0], which it repeats", record.axis));
        }
        let fit = record.take_fit();
        let AxisRecord { axis, model, terms, warm_up, fixed_bias, inputs, run_offsets, monomial, zones, .. } = record;
        let correction = AxisCorrection { model, inputs, terms, warm_up, fixed_bias };
        Ok(Self { axis, correction, run_offsets, monomial, zones, fit })
    }
}
