//! An axis to and from the flat object of the file.

use crate::calibration::axis::{AxisCalibration, AxisCorrection, FitDiagnostics};
use crate::calibration::axis_record::AxisRecord;

impl From<AxisCalibration> for AxisRecord {
    fn from(axis: AxisCalibration) -> Self {
        let main = axis.correction.inputs.first();
        let (lag_s, rate_span_cpm) = (main.and_then(|m| m.lag_s), main.and_then(|m| m.rate_span_per_min));
        let (reference_c, span_c) = main.map_or((f64::NAN, [f64::NAN; 2]), |m| (m.reference, m.span));
        let AxisCalibration { axis, correction, run_offsets, monomial, zones, fit } = axis;
        let AxisCorrection { model, inputs, terms, warm_up } = correction;
        let mut record = Self {
            axis,
            model,
            terms,
            warm_up,
            lag_s,
            reference_c,
            span_c,
            rate_span_cpm,
            inputs,
            run_offsets,
            monomial,
            zones,
            collinearity: None,
            correction_noise: None,
            rejected_inputs: Vec::new(),
            rejected_models: Vec::new(),
            model_search: Vec::new(),
            scale_factor: None,
            misalignment: Vec::new(),
            residual: None,
            noise_floor: None,
            hysteresis: None,
            ramp_rates_cpm: None,
            curve_spread: None,
            lack_of_fit: None,
            slow_noise: None,
            noise_exceeds_setup: false,
            time_effects: Vec::new(),
            entanglement: Vec::new(),
            prior: None,
            hidden_in_offsets_dph: None,
            soak: None,
            cross_validation: None,
            candidates: Vec::new(),
            excluded: Vec::new(),
            covariance: Vec::new(),
            covariance_of: Vec::new(),
        };
        if let Some(fit) = fit {
            record.add(fit);
        }
        record
    }
}

impl AxisRecord {
    fn add(&mut self, fit: FitDiagnostics) {
        let FitDiagnostics {
            residual,
            noise_floor,
            cross_validation,
            collinearity,
            correction_noise,
            hysteresis,
            ramp_rates_cpm,
            curve_spread,
            lack_of_fit,
            slow_noise,
            noise_exceeds_setup,
            time_effects,
            entanglement,
            prior,
            hidden_in_offsets_dph,
            soak,
            scale_factor,
            misalignment,
            candidates,
            model_search,
            rejected_inputs,
            rejected_models,
            excluded,
            covariance,
            covariance_of,
        } = fit;
        self.residual = Some(residual);
        (self.noise_floor, self.cross_validation, self.collinearity) = (noise_floor, cross_validation, collinearity);
        (self.correction_noise, self.hysteresis, self.soak) = (correction_noise, hysteresis, soak);
        (self.curve_spread, self.lack_of_fit, self.slow_noise) = (curve_spread, lack_of_fit, slow_noise);
        self.noise_exceeds_setup = noise_exceeds_setup;
        (self.time_effects, self.entanglement, self.prior) = (time_effects, entanglement, prior);
        (self.ramp_rates_cpm, self.hidden_in_offsets_dph) = (ramp_rates_cpm, hidden_in_offsets_dph);
        (self.scale_factor, self.misalignment) = (scale_factor, misalignment);
        (self.candidates, self.model_search, self.rejected_inputs) = (candidates, model_search, rejected_inputs);
        self.rejected_models = rejected_models;
        (self.excluded, self.covariance, self.covariance_of) = (excluded, covariance, covariance_of);
    }
}

impl TryFrom<AxisRecord> for AxisCalibration {
    type Error = String;

    fn try_from(record: AxisRecord) -> Result<Self, String> {
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
        let AxisRecord {
            axis,
            model,
            terms,
            warm_up,
            lag_s: _,
            reference_c: _,
            span_c: _,
            rate_span_cpm: _,
            inputs,
            run_offsets,
            monomial,
            zones,
            collinearity,
            correction_noise,
            rejected_inputs,
            rejected_models,
            model_search,
            scale_factor,
            misalignment,
            residual,
            noise_floor,
            hysteresis,
            ramp_rates_cpm,
            curve_spread,
            lack_of_fit,
            slow_noise,
            noise_exceeds_setup,
            time_effects,
            entanglement,
            prior,
            hidden_in_offsets_dph,
            soak,
            cross_validation,
            candidates,
            excluded,
            covariance,
            covariance_of,
        } = record;
        let fit = residual.map(|residual| FitDiagnostics {
            residual,
            noise_floor,
            cross_validation,
            collinearity,
            correction_noise,
            hysteresis,
            ramp_rates_cpm,
            curve_spread,
            lack_of_fit,
            slow_noise,
            noise_exceeds_setup,
            time_effects,
            entanglement,
            prior,
            hidden_in_offsets_dph,
            soak,
            scale_factor,
            misalignment,
            candidates,
            model_search,
            rejected_inputs,
            rejected_models,
            excluded,
            covariance,
            covariance_of,
        });
        let correction = AxisCorrection { model, inputs, terms, warm_up };
        Ok(Self { axis, correction, run_offsets, monomial, zones, fit })
    }
}
