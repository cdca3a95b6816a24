//! One axis of a record: what its target applies, and how that was found.

use sagnac_log::ingest::Tally;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::calibration::axis_record::{AxisRecord, FitDiagnostics};
use crate::calibration::{
    Candidate, CorrectionTerm, CrossValidation, FitResidual, FixedBias, Input, InputSource, Lag, Monomial, NoiseFloor,
    RunOffset, ScaleFactor, WarmUp,
};
use crate::model::{BASIS_LEN, Form, Span, TermShape};

/// What the target of one axis applies.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct AxisCorrection {
    /// In the words of `--model`.
    pub model: String,
    /// What the terms depend on, and the thermometers that differences need. The first is the thermometer of the fit.
    pub inputs: Vec<Input>,
    /// The terms.
    pub terms: Vec<CorrectionTerm>,
    /// The warm-up since power-on; null where it is not corrected.
    pub warm_up: Option<WarmUp>,
    /// The fixed bias at T0; null where the correction keeps it.
    pub fixed_bias: Option<FixedBias>,
}

impl AxisCorrection {
    /// A temperature or a difference of two, or a repeat of one.
    pub(crate) fn is_in_celsius(&self, input: &Input) -> bool {
        match &input.source {
            InputSource::Thermometer(_) | InputSource::Difference(..) => true,
            InputSource::Column(_) => false,
            InputSource::Repeat(of) => {
                let repeated = self.inputs.iter().find(|other| other.name == *of);
                repeated.is_none_or(|other| !matches!(other.source, InputSource::Column(_)))
            }
        }
    }
}

/// A parameter of the fit that is no coefficient.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct NonlinearParameter {
    /// Its name: `lag`, `lag(cavity)`, `slow lag`.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Standard deviation; `None` where the data do not resolve it.
    pub sigma: Option<f64>,
    /// Unit of both.
    pub unit: String,
}

/// The calibration of one axis. In JSON it is one flat object.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "AxisRecord", into = "AxisRecord")]
#[non_exhaustive]
pub struct AxisCalibration {
    /// Axis letter.
    pub axis: char,
    /// What the target applies.
    pub correction: AxisCorrection,
    /// Offsets of the runs. Never part of the correction.
    pub run_offsets: Vec<RunOffset>,
    /// The curve in the paper's form; null where it is no polynomial of the temperature.
    pub monomial: Option<Monomial>,
    /// The curve zone by zone, coldest first, where the span is cut into zones.
    pub zones: Vec<Monomial>,
    /// How the correction was found; null for imported coefficients.
    pub fit: Option<FitDiagnostics>,
}

impl AxisCalibration {
    /// The thermometer of the fit. A record without one is refused when it is read.
    pub fn thermometer(&self) -> &Input {
        &self.correction.inputs[0]
    }

    /// T0, °C: the correction is zero there at rest.
    pub fn reference_c(&self) -> f64 {
        self.thermometer().reference
    }

    /// Temperatures of the fit, °C. Outside, the correction is the one at the border.
    pub fn span_c(&self) -> [f64; 2] {
        self.thermometer().span
    }

    /// The span of the thermometer of the fit as a scaling to −1 … 1.
    pub fn span(&self) -> Span {
        self.thermometer().scaling()
    }

    /// Lag of the rate terms over the thermometer of the fit.
    pub fn lag_s(&self) -> Option<Lag> {
        self.thermometer().lag_s
    }

    /// Rates of the thermometer of the fit that the rate terms were fitted to, °C/min: of its lag, then of its slow one.
    pub(crate) fn rate_spans_cpm(&self) -> Vec<[f64; 2]> {
        let main = self.thermometer();
        let slow = self.other_inputs().iter().find(|input| input.repeats() == Some(&main.name));
        std::iter::once(main).chain(slow).filter_map(|input| input.rate_span_per_min).collect()
    }

    /// The second, slower lag of the rate terms over the thermometer of the fit.
    pub fn slow_lag_s(&self) -> Option<Lag> {
        let main = &self.thermometer().name;
        self.other_inputs().iter().find(|input| input.repeats() == Some(main))?.lag_s
    }

    /// Temperature rates of the fit, °C/min; `None` without rate terms over the thermometer of the fit.
    pub fn rate_span_cpm(&self) -> Option<[f64; 2]> {
        self.thermometer().rate_span_per_min
    }

    /// Residual of the fit; `None` for imported coefficients, as all that follows.
    pub fn residual(&self) -> Option<&FitResidual> {
        self.fit.as_ref().map(|fit| &fit.residual)
    }

    /// Noise floor.
    pub fn noise_floor(&self) -> Option<&NoiseFloor> {
        self.fit.as_ref()?.noise_floor.as_ref()
    }

    /// Held-out residual.
    pub fn cross_validation(&self) -> Option<&CrossValidation> {
        self.fit.as_ref()?.cross_validation.as_ref()
    }

    /// Scale factor from a rate table.
    pub fn scale_factor(&self) -> Option<&ScaleFactor> {
        self.fit.as_ref()?.scale_factor.as_ref()
    }

    /// Models that were tried.
    pub fn candidates(&self) -> &[Candidate] {
        self.fit.as_ref().map_or(&[], |fit| &fit.candidates)
    }

    /// Windows and rows that were excluded, and why.
    pub fn excluded(&self) -> &[Tally] {
        self.fit.as_ref().map_or(&[], |fit| &fit.excluded)
    }

    /// Inputs other than the thermometer of the fit.
    pub fn other_inputs(&self) -> &[Input] {
        self.correction.inputs.get(1..).unwrap_or(&[])
    }

    /// The same without those that repeat an input for a second lag.
    pub fn other_signals(&self) -> impl Iterator<Item = &Input> {
        self.other_inputs().iter().filter(|input| input.repeats().is_none())
    }

    /// A term over the thermometer of the fit.
    pub fn is_over_thermometer(&self, term: &CorrectionTerm) -> bool {
        term.input == self.thermometer().name
    }

    /// An input in degrees Celsius, or a repeat of one; else a column with a unit of its own.
    pub fn is_in_celsius(&self, input: &Input) -> bool {
        self.correction.is_in_celsius(input)
    }

    /// A term over the thermometer of the fit, behind its first or its second lag.
    pub(crate) fn is_of_thermometer(&self, term: &CorrectionTerm) -> bool {
        let repeats = self.input_of(term).and_then(Input::repeats);
        self.is_over_thermometer(term) || repeats == Some(self.thermometer().name.as_str())
    }

    /// A name of something that belongs to an input, as models and the covariance have it: in brackets, but not that of the
    /// thermometer of the fit; `slow` for a second lag.
    fn named(&self, input: &str, name: impl Fn(Option<&str>) -> String) -> String {
        let other = |input: &'_ str| input != self.thermometer().name;
        let repeats = self.correction.inputs.iter().find(|other| other.name == input).and_then(Input::repeats);
        match repeats {
            Some(of) => format!("slow {}", name(Some(of).filter(|of| other(of)))),
            None => name(Some(input).filter(|input| other(input))),
        }
    }

    /// The input of a term.
    pub fn input_of(&self, term: &CorrectionTerm) -> Option<&Input> {
        self.correction.inputs.iter().find(|input| input.name == term.input)
    }

    /// Name of a term, as the covariance and people have it: `bias 2`, `rate(cavity) 0`, `slow rate 0`.
    pub fn name_of(&self, term: &CorrectionTerm) -> String {
        self.named(&term.input, |input| term.form().name(input))
    }

    /// Unit of a term's coefficient.
    pub(crate) fn unit_of(&self, term: &CorrectionTerm) -> &'static str {
        let in_celsius = self.input_of(term).is_none_or(|input| self.is_in_celsius(input));
        term.form().unit(in_celsius)
    }

    /// Parameters that the model is not linear in, for tables: the lags of its inputs and the fitted periods of its harmonics. A
    /// stated period has no uncertainty and is not among them.
    pub fn nonlinear(&self) -> Vec<NonlinearParameter> {
        let lag = |input: &Input| {
            let Lag { value, sigma } = input.lag_s?;
            let lag = |input: Option<&str>| input.map_or("lag".to_owned(), |input| format!("lag({input})"));
            let name = self.named(&input.name, lag);
            Some(NonlinearParameter { name, value, sigma, unit: "s".to_owned() })
        };
        let period = |term: &CorrectionTerm| {
            let (TermShape::Cosine { period: value }, Some(input)) = (term.shape, self.input_of(term)) else {
                return None;
            };
            let word = term.acts_on.period_name();
            let is_main = self.is_over_thermometer(term);
            let name = if is_main { word.to_owned() } else { format!("{word}({})", term.input) };
            let row = self.fit.as_ref()?.covariance_of.iter().position(|row| *row == name)?;
            let unit = if self.is_in_celsius(input) { "degC" } else { "unit" }.to_owned();
            Some(NonlinearParameter { name, value, sigma: Some(self.variance_of(&[(row, 1.0)]).sqrt()), unit })
        };
        let lags = self.correction.inputs.iter().filter_map(lag);
        lags.chain(self.correction.terms.iter().filter_map(period)).collect()
    }

    /// Coefficients of a polynomial over the thermometer of the fit by order; zero where there is no term. `of` is any term
    /// of it: [`Form::bias`], [`Form::rate`] or [`Form::scale`].
    pub fn series(&self, of: Form) -> [f64; BASIS_LEN] {
        let mut series = [0.0; BASIS_LEN];
        for term in self.correction.terms.iter().filter(|term| self.is_over_thermometer(term)) {
            if let Some(order) = term.shape.order()
                && (term.acts_on, term.times_rate) == (of.acts_on, of.times_rate)
                && let Some(slot) = series.get_mut(order)
            {
                *slot = term.value;
            }
        }
        series
    }
}
