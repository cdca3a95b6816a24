//! The checks of a record, before it is used or written: anyone may have edited the file.

use sagnac_log::error::{Error, Result};
use sagnac_log::setup::{RateUnit, ThermometerSetup, check_thermometer, is_serial, not_a_serial};

use crate::calibration::{AxisCalibration, Calibration, CorrectionTerm, Input, InputSource};

/// Largest value of an input.
const MOST_OF_INPUT: f64 = 1e13;

/// The remedy for a record with broken values.
const BROKEN: &str = "calibrate again, or copy the file again from its source";

impl Calibration {
    /// Checks every value against its range; names the first that fails.
    pub(super) fn check(&self) -> Result<()> {
        self.setup.check()?;
        let positive = [
            ("window_s", self.window_s),
            ("sample_interval_s", self.sample_interval_s),
            ("unit", self.unit.arcsec_per_lsb()),
            ("target.tick_ns", f64::from(self.target.tick_ns)),
            ("target.period_ticks", f64::from(self.target.period_ticks)),
        ];
        for (name, value) in positive {
            if value <= 0.0 || !value.is_finite() {
                return Err(Error::input("must be a positive number", BROKEN).column(name).value(value.to_string()));
            }
        }
        let serial = &self.serial;
        if !is_serial(serial) {
            return Err(not_a_serial(serial));
        }
        if self.axes.is_empty() {
            return Err(Error::input("the calibration has no axis", BROKEN).column("axes"));
        }
        for (i, axis) in self.axes.iter().enumerate() {
            if !axis.axis.is_ascii_alphanumeric() || self.axes[..i].iter().any(|a| a.axis == axis.axis) {
                let what = "axes are letters or digits, each once";
                return Err(Error::input(what, BROKEN).column("axes").value(axis.axis.to_string()));
            }
        }
        if self.provenance.noise_trace.as_ref().is_some_and(|noise| noise.trace().is_none()) {
            let what = "must be the differences of at most 8,192 parts of a positive length";
            return Err(Error::input(what, BROKEN).column("provenance.noise_trace"));
        }
        self.axes.iter().try_for_each(AxisCalibration::check)
    }
}

impl AxisCalibration {
    fn check(&self) -> Result<()> {
        let named = |field: &str| format!("axes[{}].{field}", self.axis);
        let Some(main) = self.correction.inputs.first() else {
            return Err(
                Error::input("the first input must be the thermometer of the fit", BROKEN).column(named("inputs"))
            );
        };
        if let Some(warm_up) = &self.correction.warm_up {
            let sound = warm_up.value_dph.is_finite() && warm_up.tau_s.value > 0.0 && warm_up.tau_s.value.is_finite();
            if !sound {
                return Err(Error::input("a warm-up must have a finite size and a time constant above zero", BROKEN)
                    .column(named("warm_up"))
                    .value(warm_up.words(RateUnit::DegPerHour)));
            }
        }
        let [lo, hi] = main.span;
        if !(lo < hi && lo.is_finite() && hi.is_finite()) {
            return Err(Error::input("must be an interval", BROKEN)
                .column(named("span_c"))
                .value(format!("{:?}", main.span)));
        }
        if !(lo..=hi).contains(&main.reference) {
            let what = "must lie within span_c";
            return Err(Error::input(what, BROKEN).column(named("reference_c")).value(main.reference.to_string()));
        }
        let InputSource::Thermometer(name) = &main.source else {
            return Err(
                Error::input("the first input must be the thermometer of the fit", BROKEN).column(named("inputs"))
            );
        };
        check_thermometer(&ThermometerSetup {
            name: name.clone(),
            valid_range_c: main.valid_range,
            stale_after_s: main.stale_after_s,
            max_step_c: Some(main.max_step),
            offset_c: Some(main.offset),
            gain_c_per_code: Some(main.gain_per_code),
        })?;
        self.correction.inputs.iter().enumerate().try_for_each(|(at, input)| self.check_input(at, input))?;
        (0..self.correction.terms.len()).try_for_each(|at| self.check_term(at))
    }

    fn check_term(&self, at: usize) -> Result<()> {
        let named = |field: &str| format!("axes[{}].terms[{at}].{field}", self.axis);
        let term = &self.correction.terms[at];
        if !term.value.is_finite() {
            return Err(Error::input("must be finite", BROKEN).column(named("value")).value(term.value.to_string()));
        }
        let Some(input) = self.input_of(term) else {
            return Err(Error::input("the term names an input that the record does not contain", BROKEN)
                .column(named("input"))
                .value(&term.input));
        };
        let unit = self.unit_of(term);
        if term.unit != unit {
            return Err(Error::input(format!("the unit of such a term must be {unit}"), BROKEN)
                .column(named("unit"))
                .value(&term.unit));
        }
        if let Some(fault) = term.shape.fault(input.scaling(), term.times_rate) {
            return Err(Error::input(fault, BROKEN).column(named("shape")).value(term.shape.words()));
        }
        let same = |other: &CorrectionTerm| other.form() == term.form() && other.input == term.input;
        if self.correction.terms[..at].iter().any(same) {
            return Err(Error::input("the same term twice", BROKEN).column(named("shape")).value(self.name_of(term)));
        }
        if term.times_rate && (input.lag_s.is_none() || input.rate_span_per_min.is_none()) {
            return Err(Error::input("a rate term needs lag_s and rate_span_per_min of its input", BROKEN)
                .column(named("times_rate"))
                .value(&term.input));
        }
        Ok(())
    }

    fn check_input(&self, at: usize, input: &Input) -> Result<()> {
        let all = &self.correction.inputs;
        let interval = |[lo, hi]: [f64; 2]| lo < hi && lo.abs().max(hi.abs()) <= MOST_OF_INPUT;
        // The span of the thermometer of the fit may exceed its range by the rounding to the image's grid.
        let covers = at == 0 || input.valid_range[0] <= input.span[0] && input.valid_range[1] >= input.span[1];
        let rate_span = |[lo, hi]: [f64; 2]| lo <= 0.0 && hi >= 0.0 && interval([lo, hi]);
        let rules = [
            ("name", !input.name.is_empty() && all[..at].iter().all(|other| other.name != input.name)),
            ("source", all[..at].iter().all(|other| other.source != input.source)),
            ("span", interval(input.span)),
            ("valid_range", interval(input.valid_range) && covers),
            ("reference", (input.span[0]..=input.span[1]).contains(&input.reference)),
            ("stale_after_s", (0.0..=1e6).contains(&input.stale_after_s)),
            ("max_step", (0.0..=1e12).contains(&input.max_step)),
            ("max_rate_per_s", (0.0..=1e12).contains(&input.max_rate_per_s)),
            ("offset", input.offset.is_finite()),
            ("gain_per_code", input.gain_per_code != 0.0 && input.gain_per_code.is_finite()),
            ("lag_s", input.lag_s.is_none_or(|lag| lag.value > 0.0 && lag.value.is_finite())),
            ("rate_span_per_min", input.rate_span_per_min.is_none_or(rate_span)),
            ("source", input.repeats().is_none_or(|of| self.is_slower(at, of))),
        ];
        rules.iter().find(|(_, holds)| !holds).map_or(Ok(()), |(field, _)| {
            let what = "must be finite, in order and given once: the valid range contains the span, and a repeat follows an input of \
                        the same span, range and hold time with a shorter lag";
            Err(Error::input(what, BROKEN).column(format!("axes[{}].inputs[{}].{field}", self.axis, input.name)))
        })
    }

    /// Input `at` repeats the input `of` before it, behind a slower lag.
    fn is_slower(&self, at: usize, source: &str) -> bool {
        let all = &self.correction.inputs;
        let slow = &all[at];
        let same = |fast: &Input| {
            (fast.span, fast.valid_range, fast.reference) == (slow.span, slow.valid_range, slow.reference)
                && fast.stale_after_s == slow.stale_after_s
        };
        let slower = |fast: &Input| fast.lag_s.zip(slow.lag_s).is_some_and(|(fast, slow)| fast.value < slow.value);
        let fast = all[..at].iter().find(|other| other.name == source && other.repeats().is_none());
        fast.is_some_and(|fast| same(fast) && slower(fast))
    }
}
