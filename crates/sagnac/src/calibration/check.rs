//! What a record must be before anything is made of it: read from a file that anyone may have edited, or about to be written.

use crate::calibration::{AxisCalibration, Calibration, InputSource, Term, TermKind};
use sagnac_log::error::{Error, Result};

/// Values of an input beyond this are none.
const MOST_OF_INPUT: f64 = 1e13;

impl Calibration {
    /// Every value against what it may be, the first broken one by name.
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
                return Err(Error::input("must be a positive number").column(name).value(value.to_string()));
            }
        }
        let serial = &self.serial;
        if serial.is_empty() || serial.len() > 32 || serial.contains('\0') {
            return Err(Error::input("a serial has 1 to 32 bytes").column("serial").value(serial));
        }
        self.thermometer.check()?;
        if self.axes.is_empty() {
            return Err(Error::input("a calibration without an axis").column("axes"));
        }
        for (i, axis) in self.axes.iter().enumerate() {
            if !axis.axis.is_ascii_alphanumeric() || self.axes[..i].iter().any(|a| a.axis == axis.axis) {
                let what = "axes are letters or digits, each once";
                return Err(Error::input(what).column("axes").value(axis.axis.to_string()));
            }
        }
        for axis in &self.axes {
            axis.check()?;
            let main = &self.thermometer.name;
            if let Some(input) = axis.inputs.iter().find(|input| input.source == InputSource::Thermometer(main.clone()))
            {
                return Err(Error::input("the thermometer of the fit is no further input")
                    .column(format!("axes[{}].inputs", axis.axis))
                    .value(&input.name));
            }
            let stray = |term: &&Term| axis.is_main(term) && term.sensor != *main;
            if let Some(term) = axis.terms.iter().find(stray) {
                return Err(Error::input("a term over an input that the record does not have")
                    .column(format!("axes[{}].terms.sensor", axis.axis))
                    .value(&term.sensor));
            }
        }
        Ok(())
    }
}

impl AxisCalibration {
    fn check(&self) -> Result<()> {
        let named = |field: &str| format!("axes[{}].{field}", self.axis);
        let [lo, hi] = self.span_c;
        if !(lo < hi && lo.is_finite() && hi.is_finite()) {
            return Err(Error::input("must be an interval")
                .column(named("span_c"))
                .value(format!("{:?}", self.span_c)));
        }
        if !(lo..=hi).contains(&self.reference_c) {
            let what = "must lie within span_c";
            return Err(Error::input(what).column(named("reference_c")).value(self.reference_c.to_string()));
        }
        if let Some(term) = self.terms.iter().find(|term| !term.value.is_finite()) {
            return Err(Error::input("must be finite").column(named("terms")).value(term.value.to_string()));
        }
        if let Some([lo, hi]) = self.rate_span_cpm
            && !(lo <= 0.0 && hi >= 0.0 && lo < hi && (hi - lo).is_finite())
        {
            let what = "must be an interval about zero";
            return Err(Error::input(what).column(named("rate_span_cpm")).value(format!("{lo}, {hi}")));
        }
        if self.lag_s.is_some_and(|lag| !(lag.value > 0.0 && lag.value.is_finite())) {
            return Err(Error::input("must be a positive time").column(named("lag_s")));
        }
        for (i, term) in self.terms.iter().enumerate() {
            let unit = self.unit_of(term);
            if term.unit != unit {
                let what = format!("{:?} terms are in {unit}", term.kind);
                return Err(Error::input(what).column(named("terms")).value(&term.unit));
            }
            let piece = matches!(term.kind, TermKind::Zone | TermKind::Step);
            let span = self.input_of(term).map_or(self.span_c, |input| input.span);
            let begins = |at: f64| at > span[0] && at < span[1];
            if piece != term.at.is_some() || !term.at.is_none_or(begins) {
                let what = "zones and steps, and no other terms, begin at a value within the span of their input";
                return Err(Error::input(what).column(named("terms.at")).value(format!("{:?}", term.at)));
            }
            if term.kind == TermKind::Zone && !(self.is_main(term) && term.order == 2) {
                let what = "zones are of order 2, over the thermometer of the fit";
                return Err(Error::input(what).column(named("terms")).value(term.order.to_string()));
            }
            let lowest = u8::from(!matches!(term.kind, TermKind::Rate | TermKind::Step));
            let same = |t: &&Term| (t.kind, t.order, &t.sensor, t.at) == (term.kind, term.order, &term.sensor, term.at);
            let twice = self.terms[..i].iter().any(|t| same(&t));
            if !(lowest..=sagnac_core::MAX_ORDER).contains(&term.order) || twice {
                let what =
                    format!("{:?} terms have orders {lowest} to {}, each once", term.kind, sagnac_core::MAX_ORDER);
                return Err(Error::input(what).column(named("terms")).value(term.order.to_string()));
            }
        }
        let main_rate = self.terms.iter().any(|term| term.kind == TermKind::Rate && self.is_main(term));
        if main_rate && (self.lag_s.is_none() || self.rate_span_cpm.is_none()) {
            return Err(Error::input("a rate term needs lag_s and rate_span_cpm").column(named("lag_s")));
        }
        self.check_inputs()
    }

    fn check_inputs(&self) -> Result<()> {
        for (at, input) in self.inputs.iter().enumerate() {
            let place = format!("axes[{}].inputs[{}]", self.axis, input.name);
            let interval = |[lo, hi]: [f64; 2]| lo < hi && lo.abs().max(hi.abs()) <= MOST_OF_INPUT;
            let believed = input.plausible[0] <= input.span[0] && input.plausible[1] >= input.span[1];
            let sound = [
                ("name", !input.name.is_empty() && self.inputs[..at].iter().all(|other| other.name != input.name)),
                ("span", interval(input.span)),
                ("plausible", interval(input.plausible) && believed),
                ("reference", (input.span[0]..=input.span[1]).contains(&input.reference)),
                ("hold_s", (0.0..=1e6).contains(&input.hold_s)),
                ("offset", input.offset.is_finite()),
                ("gain_per_code", input.gain_per_code != 0.0 && input.gain_per_code.is_finite()),
                ("lag_s", input.lag_s.is_none_or(|lag| lag.value > 0.0 && lag.value.is_finite())),
                (
                    "rate_span_per_min",
                    input.rate_span_per_min.is_none_or(|[lo, hi]| lo <= 0.0 && hi >= 0.0 && interval([lo, hi])),
                ),
            ];
            if let Some((field, _)) = sound.iter().find(|(_, sound)| !sound) {
                let what = "must be finite, in order, and plausible around the span";
                return Err(Error::input(what).column(format!("{place}.{field}")));
            }
            let rated = self.terms.iter().any(|term| term.kind == TermKind::Rate && term.sensor == input.name);
            if rated && (input.lag_s.is_none() || input.rate_span_per_min.is_none()) {
                return Err(Error::input("a rate term needs lag_s and rate_span_per_min").column(place));
            }
        }
        Ok(())
    }
}
