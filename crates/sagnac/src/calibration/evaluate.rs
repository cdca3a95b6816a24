//! The uncertainty of a record: predictions with their intervals, hysteresis, what more soaking would improve.
//!
//! ```text
//! d(T) at rest = Σ bᵢ·[Sᵢ(T) − Sᵢ(T0)]        σ² = wᵀ·Cov·w, w the weights of the terms        half = t₀.₉₇₅·σ
//! ```
//!
//! Every other input is at its reference. Fails outside the span of the fit: there is no prediction.

use crate::calibration::axis::AxisCalibration;
use crate::calibration::input::Input;
use crate::calibration::term::CorrectionTerm;
use crate::calibration::uncertainty::{Evaluation, Prediction, SCALE_AT_REFERENCE};
use crate::model::{ActsOn, TermShape};

/// How much faster than the ramps of the test a rate may be that it still stands for.
const RATE_MARGIN: f64 = 1.5;

/// Rate of an input, per minute.
type RateOf<'a> = &'a dyn Fn(&Input) -> f64;
const AT_REST: RateOf<'static> = &|_| 0.0;

impl AxisCalibration {
    /// The drift at rest at a temperature within the span, with its intervals; `None` outside, or where nothing was
    /// fitted here.
    pub fn predict(&self, celsius: f64) -> Option<Prediction> {
        let residual = self.fit.as_ref()?.residual;
        let [lo, hi] = self.span_c();
        if !(lo..=hi).contains(&celsius) {
            return None;
        }
        let drift_dph = self.drift(celsius, self.reference_c());
        let variance =
            self.variance_of(&self.drift_weights(celsius, self.reference_c())) + self.spread_variance(celsius);
        let half = |variance: f64| residual.t_quantile_975 * variance.sqrt();
        Some(Prediction {
            drift_dph,
            curve_dph: half(variance),
            window_dph: half(variance + residual.sigma_dph.powi(2)),
        })
    }

    /// What models next to this one, and what moved together with temperature, add to the variance of the curve.
    pub(crate) fn spread_variance(&self, celsius: f64) -> f64 {
        let Some(fit) = &self.fit else { return 0.0 };
        let together = fit.entanglement.iter().filter_map(|entanglement| entanglement.spread.as_ref());
        fit.curve_spread.iter().chain(together).map(|spread| spread.variance(celsius)).sum()
    }

    /// The terms over the thermometer of the fit that act on one quantity, with their weights at a temperature and its rate
    /// (steady, so that every lag has settled) less those at another temperature at rest. Other inputs are at their references.
    fn weights(
        &self,
        acts_on: ActsOn,
        celsius: f64,
        rate_cpm: RateOf<'_>,
        from_c: f64,
    ) -> impl Iterator<Item = (&CorrectionTerm, f64)> {
        let span = self.span();
        let acting = move |term: &&CorrectionTerm| term.acts_on == acts_on && self.is_of_thermometer(term);
        let weight = move |term: &CorrectionTerm| {
            let here = term.shape.value(span, celsius);
            let rate_cpm = self.input_of(term).map_or(0.0, rate_cpm);
            if term.times_rate { rate_cpm * here } else { here - term.shape.value(span, from_c) }
        };
        self.correction.terms.iter().filter(acting).map(move |term| (term, weight(term)))
    }

    /// Weights as rows of the covariance; empty where nothing was fitted here.
    fn rows(&self, acts_on: ActsOn, celsius: f64, rate_cpm: RateOf<'_>, from_c: f64) -> Vec<(usize, f64)> {
        let weights = self.weights(acts_on, celsius, rate_cpm, from_c).filter(|(_, weight)| *weight != 0.0);
        weights.filter_map(|(term, weight)| Some((self.row_of(term)?, weight))).collect()
    }

    /// The drift at a temperature while each input has its rate, less that at T0 at rest, °/h.
    pub(crate) fn drift_at_rates(&self, celsius: f64, rate_of: &dyn Fn(&Input) -> f64) -> f64 {
        let weights = self.weights(ActsOn::Bias, celsius, rate_of, self.reference_c());
        weights.map(|(term, weight)| term.value * weight).sum()
    }

    /// The drift at rest at a temperature less that at another, °/h.
    pub fn drift(&self, celsius: f64, from_c: f64) -> f64 {
        self.weights(ActsOn::Bias, celsius, AT_REST, from_c).map(|(term, weight)| term.value * weight).sum()
    }

    /// The same as rows of the covariance with their weights; empty where nothing was fitted here.
    pub(crate) fn drift_weights(&self, celsius: f64, from_c: f64) -> Vec<(usize, f64)> {
        self.rows(ActsOn::Bias, celsius, AT_REST, from_c)
    }

    /// The deviation of the scale factor from S0 at a temperature and its σ, ppm: its value at T0 from a rate table (else 0)
    /// and the scale terms.
    pub fn scale_deviation(&self, celsius: f64) -> [f64; 2] {
        let reference_c = self.reference_c();
        let at_reference = self.fit.as_ref().and_then(|fit| fit.scale_factor.as_ref()).map(|scale| scale.at_reference);
        let own = self.fit.iter().flat_map(|fit| fit.covariance_of.iter().position(|name| name == SCALE_AT_REFERENCE));
        let terms = self.weights(ActsOn::ScaleFactor, celsius, AT_REST, reference_c);
        let value = terms.map(|(term, weight)| term.value * weight).sum::<f64>();
        let rows = own
            .map(|row| (row, 1.0))
            .chain(self.rows(ActsOn::ScaleFactor, celsius, AT_REST, reference_c))
            .collect::<Vec<_>>();
        [at_reference.map_or(0.0, |at| at.ppm) + value, self.variance_of(&rows).sqrt()]
    }

    /// Drift per °C/min of temperature rate at a temperature and its σ, °/h per °C/min; `None` without rate terms.
    pub fn rate_effect(&self, celsius: f64) -> Option<[f64; 2]> {
        let of_rate = |(term, _): &(&CorrectionTerm, f64)| term.times_rate;
        let one = &|_: &Input| 1.0;
        let terms: Vec<(&CorrectionTerm, f64)> =
            self.weights(ActsOn::Bias, celsius, one, celsius).filter(of_rate).collect();
        let rows = self.rate_weights(celsius);
        let value = terms.iter().map(|(term, weight)| term.value * weight).sum();
        (!terms.is_empty()).then(|| [value, self.variance_of(&rows).sqrt()])
    }

    /// The same as rows of the covariance with their weights; empty without rate terms.
    pub(crate) fn rate_weights(&self, celsius: f64) -> Vec<(usize, f64)> {
        let one = &|_: &Input| 1.0;
        self.rows(ActsOn::Bias, celsius, one, celsius)
    }

    /// The correction at a temperature within the span and a temperature rate, with its 95 % interval: zero at T0 and rest.
    /// The interval holds what memory of temperature and a rate effect without a term may add; it is `None` where nothing was fitted here. Outside of the spans the correction is the one at the border, as
    /// on the target.
    pub fn evaluate(&self, celsius: f64, rate_cpm: f64) -> Evaluation {
        let main = self.thermometer();
        let at_c = celsius.clamp(main.span[0], main.span[1]);
        // Each lag has a span of its own.
        let within = |input: &Input| input.rate_span_per_min.map_or(0.0, |[lo, hi]| rate_cpm.clamp(lo, hi));
        let rate: RateOf<'_> = &within;
        let is_clamped = |term: &CorrectionTerm| {
            let rated = self.input_of(term).filter(|_| term.times_rate && self.is_of_thermometer(term));
            rated.is_some_and(|input| within(input) != rate_cpm)
        };
        let reference_c = self.reference_c();
        let sum = |acts_on| -> f64 {
            let terms = self.weights(acts_on, at_c, rate, reference_c);
            // No term at all is 0, not −0.
            terms.map(|(term, weight)| term.value * weight).sum::<f64>() + 0.0
        };
        let drift_dph = sum(ActsOn::Bias);
        let half = self.fit.as_ref().map(|fit| {
            let own = self.variance_of(&self.rows(ActsOn::Bias, at_c, rate, reference_c));
            let left = fit.rate_left_dph_per_cpm.map_or(0.0, |left| (left * rate_cpm).powi(2));
            let sigma = (own + self.spread_variance(at_c) + left).sqrt();
            // On the ramps of the test the correction is right, whether memory or rate made their difference: at rest all of it is open.
            let ramp_cpm = fit.ramp_rates_cpm.map(|[lo, hi]| 0.5 * (hi - lo)).filter(|ramp_cpm| *ramp_cpm > 0.0);
            let away = ramp_cpm.map_or(1.0, |ramp_cpm| (1.0 - rate_cpm.abs() / ramp_cpm).abs());
            let memory = fit.memory.map_or(0.0, |memory| away * memory.half_dph);
            (fit.residual.t_quantile_975 * sigma).hypot(memory)
        });
        // Without a rate term there is no span of rates: the test's own, as wide as that of a term would be.
        let tested =
            self.fit.as_ref().filter(|fit| fit.rate_left_dph_per_cpm.is_some()).and_then(|fit| fit.ramp_rates_cpm);
        let is_tested = tested.is_none_or(|ends| {
            let [lo, hi] = ends.map(|end| RATE_MARGIN * end);
            (lo.min(0.0)..=hi.max(0.0)).contains(&rate_cpm)
        });
        Evaluation {
            temperature_c: celsius,
            rate_cpm,
            drift_dph,
            lower_dph: half.map(|half| drift_dph - half),
            upper_dph: half.map(|half| drift_dph + half),
            scale_ppm: sum(ActsOn::ScaleFactor),
            in_span: at_c == celsius && is_tested && !self.correction.terms.iter().any(is_clamped),
        }
    }

    /// Row of the covariance of a term.
    pub(crate) fn row_of(&self, term: &CorrectionTerm) -> Option<usize> {
        let name = self.name_of(term);
        self.fit.as_ref()?.covariance_of.iter().position(|row| *row == name)
    }

    /// Drift per unit of an input at its reference and its σ; `None` without value terms over it.
    pub(crate) fn slope_of_input(&self, name: &str) -> Option<[f64; 2]> {
        let input = self.correction.inputs.iter().find(|input| input.name == name)?;
        let is_series = |term: &CorrectionTerm| matches!(term.shape, TermShape::Chebyshev { .. });
        let terms =
            self.correction.terms.iter().filter(|term| {
                term.acts_on == ActsOn::Bias && !term.times_rate && is_series(term) && term.input == name
            });
        let slopes: Vec<(&CorrectionTerm, f64)> =
            terms.map(|term| (term, term.shape.slope(input.scaling(), input.reference))).collect();
        let weights: Vec<(usize, f64)> =
            slopes.iter().filter_map(|(term, slope)| Some((self.row_of(term)?, *slope))).collect();
        let value = slopes.iter().map(|(term, slope)| term.value * slope).sum();
        (!slopes.is_empty()).then(|| [value, self.variance_of(&weights).sqrt()])
    }

    /// Variance of a sum of parameters, each times its weight.
    pub fn variance_of(&self, weights: &[(usize, f64)]) -> f64 {
        self.covariance_between(weights, weights).max(0.0)
    }

    /// Covariance of two sums of parameters, each times its weight.
    pub(crate) fn covariance_between(&self, these: &[(usize, f64)], those: &[(usize, f64)]) -> f64 {
        let covariance = self.fit.as_ref().map_or(&[][..], |fit| &fit.covariance);
        let entry = |i: usize, j: usize| covariance.get(i).and_then(|row| row.get(j)).copied().unwrap_or(0.0);
        let row_sum = |(i, a): &(usize, f64)| those.iter().map(|(j, b)| a * b * entry(*i, *j)).sum::<f64>();
        these.iter().map(row_sum).sum()
    }

    /// A rate table turned it.
    pub fn turned(&self) -> bool {
        self.fit.as_ref().is_some_and(|fit| fit.scale_factor.is_some() || !fit.misalignment.is_empty())
    }
}
