//! The effect of each input alone.
//!
//! ```text
//! own(row) = Σ θ·regressor(row) over the terms of one input and one kind        shown(row) = own(row) + residual(row)
//! ```
//!
//! The component-plus-residual plot (Larsen and McCleary 1972): where the terms describe the data, the points scatter about
//! the curve; a bend that the terms lack shows in the points.
//!
//! Where it fails: for inputs that move together the effect is divided as in the fit. An effect that the fit assigns to the
//! wrong input does not show here.

use crate::diagnostics::{Effect, EffectOf};
use crate::fit::one_model::solution::Fitted;
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::rows::{Rates, TermColumn};
use crate::model::Form;

/// Points of a curve.
const CURVE_POINTS: usize = 121;
/// Windows that turned at this fraction of the fastest rate or more show the scale factor.
const TURNED: f64 = 0.5;

/// The parts of a fit on its rows.
pub(crate) struct Parts<'a> {
    fitted: &'a Fitted,
    problem: &'a LeastSquares<'a>,
    rates: Rates,
}

impl<'a> Parts<'a> {
    pub(crate) fn new(fitted: &'a Fitted, problem: &'a LeastSquares<'a>) -> Self {
        let taus: Vec<(usize, f64)> = fitted.taus.iter().map(|tau| (tau.input, tau.value_s)).collect();
        Self { fitted, problem, rates: problem.rates(&taus) }
    }

    fn terms(&self, wanted: impl Fn(&TermColumn) -> bool) -> Vec<(&'a TermColumn, f64)> {
        let values = &self.fitted.theta[self.problem.levels().len()..];
        self.fitted.terms.iter().zip(values.iter().copied()).filter(|(term, _)| wanted(term)).collect()
    }

    /// Sum of some terms for each row, °/h.
    pub(crate) fn made(&self, wanted: impl Fn(&TermColumn) -> bool) -> Vec<f64> {
        let terms = self.terms(wanted);
        let of_row =
            |row| terms.iter().map(|(term, value)| value * self.problem.regressor(term, row, &self.rates)).sum();
        (0..self.problem.len()).map(of_row).collect()
    }

    /// Root mean square over the rows of the sum of an input's terms, about its mean, °/h.
    pub(crate) fn rms_of(&self, input: usize) -> f64 {
        let part_dph = self.made(|term| term.input == input);
        let mean = part_dph.iter().sum::<f64>() / part_dph.len().max(1) as f64;
        (part_dph.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / part_dph.len().max(1) as f64).sqrt()
    }

    /// Every input alone; of the thermometer of the fit only its rate, because other figures show its value.
    pub(crate) fn effects(&self) -> Vec<Effect> {
        let of_input = |input: usize| {
            [EffectOf::Value, EffectOf::Rate, EffectOf::Scale].into_iter().filter_map(move |of| self.effect(input, of))
        };
        let all = (0..self.problem.inputs.len()).flat_map(of_input);
        all.filter(|effect| effect.further || effect.of == EffectOf::Rate).collect()
    }

    fn effect(&self, input: usize, of: EffectOf) -> Option<Effect> {
        let terms = self.terms(|term| term.input == input && of.holds(term.form));
        if terms.is_empty() {
            return None;
        }
        let own = self.made(|term| term.input == input && of.holds(term.form));
        let here = &self.problem.inputs[input];
        let fastest = (0..self.problem.len()).map(|row| self.problem.turned_dph(row).abs()).fold(0.0, f64::max);
        let told = |row: &usize| of != EffectOf::Scale || self.problem.turned_dph(*row).abs() >= TURNED * fastest;
        let rows: Vec<usize> = (0..self.problem.len()).filter(told).collect();
        let unit = |row: usize| if of == EffectOf::Scale { -self.problem.turned_dph(row) * 1e-6 } else { 1.0 };
        let x_of = |row: &usize| match of {
            EffectOf::Rate => self.rates[input].get(*row).map_or(f64::NAN, |rate| rate[0]),
            EffectOf::Value | EffectOf::Scale => here.value(*row),
        };
        let x: Vec<f64> = rows.iter().map(x_of).collect();
        let fit: Vec<f64> = rows.iter().map(|row| own[*row] / unit(*row)).collect();
        let left = rows.iter().zip(&fit).map(|(row, fit)| fit + self.fitted.residuals[*row] / unit(*row)).collect();
        Some(Effect {
            input: here.name.clone(),
            further: input > 0,
            in_celsius: here.signal.in_celsius(),
            of,
            reference: here.reference,
            curve: self.curve(input, of, &terms, &x),
            x,
            fit,
            shown: left,
        })
    }

    /// The terms over their input, at rest; of a rate the straight line, where it is one.
    fn curve(&self, input: usize, of: EffectOf, terms: &[(&TermColumn, f64)], x: &[f64]) -> Vec<[f64; 2]> {
        let here = &self.problem.inputs[input];
        if of == EffectOf::Rate {
            let [(TermColumn { form, .. }, slope)] = terms else { return Vec::new() };
            if *form != Form::rate(0) {
                return Vec::new();
            }
            let ends = x.iter().fold([0.0, 0.0], |[lo, hi]: [f64; 2], x| [lo.min(*x), hi.max(*x)]);
            return ends.map(|x| [x, slope * x]).to_vec();
        }
        let (lo, hi) = (here.span.lo, here.span.hi);
        let mut at: Vec<f64> =
            (0..CURVE_POINTS).map(|i| lo + (hi - lo) * i as f64 / (CURVE_POINTS - 1) as f64).collect();
        let jumps = terms.iter().filter_map(|(term, _)| term.form.shape.jump());
        at.extend(jumps.flat_map(|threshold| [threshold.next_down(), threshold]));
        at.sort_by(f64::total_cmp);
        let sum = |value: f64| {
            terms.iter().map(|(term, theta)| theta * term.form.value(here.span, value, here.reference)).sum()
        };
        at.into_iter().map(|value| [value, sum(value)]).collect()
    }
}
