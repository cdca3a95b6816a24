//! Values of a record's uncertainty. `evaluate.rs` makes predictions and intervals of them.

use sagnac_log::setup::RateUnit;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Name of ε0 in the covariance.
pub(crate) const SCALE_AT_REFERENCE: &str = "scale 0";

/// Mean while heating less mean while cooling: a gradient, a lag, a rate term.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct Hysteresis {
    /// About the offsets of the runs, °/h.
    pub before_dph: f64,
    /// Less the fit, °/h. In-sample: quote the one of a verification instead.
    pub after_dph: f64,
    /// Standard error of both by the residuals' scatter, widened by their correlation, °/h.
    pub sigma_dph: f64,
}

/// Memory of temperature at rest: friction, mounting stress, a play operator. On ramps it looks like an effect of the temperature rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct MemoryAtRest {
    /// Bias at rest after heating less that after cooling, at one temperature, °/h; null where none was soaked from both sides.
    pub difference_dph: Option<f64>,
    /// Its standard error, °/h.
    pub sigma_dph: Option<f64>,
    /// Temperature of these soaks, °C.
    pub temperature_c: Option<f64>,
    /// How far memory may move the bias at rest to either side, °/h: half of that difference, where it is significant; without such soaks half
    /// of the difference of the ramps. Zero where neither is.
    pub half_dph: f64,
}

impl MemoryAtRest {
    /// In a sentence, where memory may move the bias.
    pub fn note(&self, units: RateUnit) -> Option<String> {
        let half = units.text(self.half_dph, 2);
        let says = match (self.difference_dph, self.sigma_dph, self.temperature_c) {
            (Some(difference), Some(sigma), Some(celsius)) => format!(
                "memory: at rest at {celsius:.0} °C the bias after heating is {} {} from that after cooling, so ± {half} at rest",
                units.with_sigma(difference, Some(sigma)),
                units.name()
            ),
            _ => format!(
                "memory and rate effect are not separated: at rest the bias may be ± {half} off; soak at 25 °C from both sides"
            ),
        };
        (self.half_dph > 0.0).then_some(says)
    }
}

/// The uncertainty of the curve at one temperature, now and after soaking there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct SoakRow {
    /// °C.
    pub temperature_c: f64,
    /// σ of the drift at rest now, °/h.
    pub sigma_dph: f64,
    /// The same after each of `hours` at this temperature, °/h.
    pub after_dph: Vec<f64>,
}

/// What more soaking would improve, by the covariance of the fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct Soak {
    /// Hours that are forecast.
    pub hours: Vec<f64>,
    /// Temperature by temperature.
    pub rows: Vec<SoakRow>,
    /// Where the next hour makes the curve as a whole best known, °C.
    pub best_c: f64,
    /// Root mean square of σ over the rows now, °/h.
    pub mean_sigma_dph: f64,
    /// The same after that hour.
    pub mean_sigma_after_dph: f64,
}

impl Soak {
    /// Smaller gains of an hour are none.
    const LEAST_GAIN: f64 = 0.03;

    /// False where an hour more gains less than 3 %: the test is long, or its noise slow.
    pub fn improves(&self) -> bool {
        self.mean_sigma_after_dph < (1.0 - Self::LEAST_GAIN) * self.mean_sigma_dph
    }
}

/// What the fit says of a temperature.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Prediction {
    /// d(T) at rest, °/h.
    pub drift_dph: f64,
    /// Half of its 95 % interval, °/h: that of the curve alone.
    pub curve_dph: f64,
    /// Half of the 95 % interval of a further window of a run whose offset is known, °/h: curve and noise.
    pub window_dph: f64,
}

/// σ that models other than the selected one add to its curve.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct CurveSpread {
    /// Temperatures, °C, rising.
    pub temperature_c: Vec<f64>,
    /// σ at each, °/h.
    pub sigma_dph: Vec<f64>,
}

/// The rows contradict the fitted model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct LackOfFit {
    /// What describes them better: a model, or words for a curve that is none.
    pub better: String,
    /// By how much χ² of the rows falls with it, after the price of its coefficients.
    pub chi_squared: f64,
    /// Where its curve is farthest from the fitted one, °C.
    pub temperature_c: f64,
    /// How far it is there, °/h: that curve less the fitted one.
    pub difference_dph: f64,
}

impl LackOfFit {
    /// What it means for the use of a calibration.
    pub fn note(&self, units: RateUnit) -> String {
        let Self { better, chi_squared, temperature_c, difference_dph } = self;
        format!(
            "the rows contradict this model: {better} describes them better (Δχ² {chi_squared:.0}), and its curve differs by {} at {temperature_c:.0} °C",
            units.text(*difference_dph, 2)
        )
    }
}

impl CurveSpread {
    /// Variance at a temperature, (°/h)², straight between the points.
    pub(crate) fn variance(&self, celsius: f64) -> f64 {
        let after = self.temperature_c.partition_point(|t| *t < celsius);
        let point = |at: usize| Some((*self.temperature_c.get(at)?, *self.sigma_dph.get(at)?));
        let sigma = match (after.checked_sub(1).and_then(point), point(after)) {
            (Some((from, a)), Some((to, b))) => a + (b - a) * (celsius - from) / (to - from),
            (Some((_, one)), None) | (None, Some((_, one))) => one,
            (None, None) => 0.0,
        };
        sigma * sigma
    }
}

/// Noise of a residual that is not white, with its terms as IEEE Std 952 names them: the likeliest kind. Intervals count the others, too.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct SlowNoiseTerms {
    /// White part of a window of nominal length, °/h.
    pub white_dph: f64,
    /// Bias instability B, °/h; null without.
    pub bias_instability_dph: Option<f64>,
    /// Rate random walk K, °/h/√h; null without.
    pub rate_random_walk_dph_rt_h: Option<f64>,
    /// σ of a first-order Markov process, °/h; null without.
    pub markov_sigma_dph: Option<f64>,
    /// Its correlation time, s.
    pub markov_correlation_s: Option<f64>,
}

/// The correction at one temperature and temperature rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[non_exhaustive]
pub struct Evaluation {
    /// Temperature, °C.
    pub temperature_c: f64,
    /// Its rate, °C/min.
    pub rate_cpm: f64,
    /// Bias drift d, °/h; 0 at T0 and rest.
    pub drift_dph: f64,
    /// Lower end of its 95 % interval, °/h; null where nothing was fitted here.
    pub lower_dph: Option<f64>,
    /// Upper end.
    pub upper_dph: Option<f64>,
    /// Deviation of the scale factor from that at T0, ppm.
    pub scale_ppm: f64,
    /// False where the target is OUT_OF_SPAN: then the correction is the one at the border.
    pub in_span: bool,
}
