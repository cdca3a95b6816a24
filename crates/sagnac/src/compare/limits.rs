//! The limits of a comparison: those of a retest that are of a change between records.
//!
//! ```text
//! bias            b_i = mean over the runs of record i of (run offset − input rate), at T0          d_ij = b_i − b_j
//! turn-on         s over the runs of all records; one-sided 95 % bound s·√((n − 1)/χ²(0.05, n − 1))
//! curve           D_ij(T) = d_i(T) − d_j(T) at the common temperatures, less its mean over them
//!                 r = √(mean D² − tr C/m), C the covariance of D, m the temperatures; σ(r²) = √(2·tr C² + 4·DᵀCD)/m
//! slope, rate     straight line through D_ij(T); difference of the rate effects at T0
//! scale factor    ε_i(T) − ε_j(T) at the temperature where it is worst
//! ```
//!
//! Every pair of records is judged and the worst verdict counts, so that the order of the records does not matter. σ² of b_i is
//! that of the fit or what the scatter of its runs makes of their mean, whichever is larger. A record of one run has no such scatter: what
//! changes from turn-on to turn-on is then in d_ij, not in its σ.

use nalgebra::{DMatrix, DVector};

use crate::calibration::AxisCalibration;
use crate::compare::triangle::{Apart, apart};
use crate::verify::{Estimate, LimitSpec, Limits, TurnOns, Verdict};
use sagnac_log::setup::TurnOnCount;

/// What one limit asks of a comparison.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct ComparedLimit {
    /// Key in the limits file.
    pub key: &'static str,
    /// The value in words.
    pub label: &'static str,
    /// Where it comes from.
    pub from: &'static str,
    value: fn(&ComparedRecords<'_>) -> ComparedValue,
}

/// Every limit that a comparison asks, in the order of the limits' own table.
pub const COMPARED: [ComparedLimit; 12] = [
    ComparedLimit {
        key: "sigma_beyond_floor_dph_max",
        label: "rms of the difference of two corrections on ramps of ±1 °C/min",
        from: "up and down over the temperatures that all records span, each correction behind its own lag",
        value: |all| all.pairs(|a, b| Ok(all.triangle(a, b)?.residual_dph)),
    },
    ComparedLimit {
        key: "span_covered_min",
        label: "temperatures that all records have, as a fraction of those that any has",
        from: "the spans of the records: what changed outside their common span is not seen",
        value: |all| {
            let unknown = || ComparedValue::Unknown("no record has a span of temperature".to_owned());
            all.span_covered().map_or_else(unknown, ComparedValue::Bound)
        },
    },
    ComparedLimit {
        key: "drift_dph_per_c_max",
        label: "slope over temperature of the difference of two curves",
        from: "12 temperatures that all records span",
        value: |all| all.pairs(|a, b| all.slope(a, b)),
    },
    ComparedLimit {
        key: "drift_dph_per_cpm_max",
        label: "difference of two rate effects at T0",
        from: "records with rate terms",
        value: |all| all.of_rates(),
    },
    ComparedLimit {
        key: "hysteresis_dph_max",
        label: "difference of two corrections on these ramps, heating less cooling",
        from: "the same ramps",
        value: |all| all.pairs(|a, b| Ok(all.triangle(a, b)?.hysteresis_dph)),
    },
    ComparedLimit {
        key: "arw_deg_rt_h_max",
        label: "largest N of a record",
        from: "records that know their noise",
        value: |all| all.largest_walk(),
    },
    ComparedLimit {
        key: "temperature_residual_dph_max",
        label: "rms over temperature of the difference of two curves about its mean, less what noise makes of it",
        from: "the same 12 temperatures, with the covariance of both fits and what selecting the models adds",
        value: |all| all.pairs(|a, b| all.change_of_curve(a, b)),
    },
    ComparedLimit {
        key: "bias_repeatability_dph_max",
        label: "difference of the mean fixed biases of two records at T0, as logged",
        from: "run offsets less the input rate, where all records have one",
        value: |all| {
            all.of_bias(|biases| ComparedValue::Pairs(pairs_of(biases, |a, b| Ok(difference(a.mean, b.mean)))))
        },
    },
    ComparedLimit {
        key: "turn_on_sigma_dph_max",
        label: "one-sided 95 % bound of the σ from turn-on to turn-on over the runs of all records",
        from: "two turn-ons or more, stated in the setups of the records",
        value: |all| all.of_bias(turn_ons),
    },
    ComparedLimit {
        key: "fixed_bias_dph_max",
        label: "largest fixed bias of a run, as logged",
        from: "the same",
        value: |all| all.of_bias(|biases| largest(biases.iter().flat_map(|record| &record.runs).copied())),
    },
    ComparedLimit {
        key: "scale_factor_repeatability_ppm_max",
        label: "difference of two scale factors at the temperature where it is worst",
        from: "records from a rate table",
        value: |all| all.of_scale(|| all.pairs(|a, b| all.change_of_scale(a, b))),
    },
    ComparedLimit {
        key: "scale_factor_ppm_max",
        label: "largest deviation of a scale factor from its nominal value at T0",
        from: "the same",
        value: |all| {
            all.of_scale(|| largest(all.axes.iter().map(|axis| estimate(axis.scale_deviation(all.reference_c)))))
        },
    },
];

/// A value of a comparison.
enum ComparedValue {
    NotAsked(String),
    Unknown(String),
    One(Estimate),
    /// A bound without a standard error.
    Bound(f64),
    /// Of every pair, with the places of its records; `Err` says why a pair has none.
    Pairs(Vec<(usize, usize, Result<Estimate, String>)>),
}

/// The records of one axis at their common temperatures.
pub(crate) struct ComparedRecords<'a> {
    pub(crate) axes: &'a [&'a AxisCalibration],
    pub(crate) names: Vec<&'a str>,
    /// Turn-ons that each record states.
    pub(crate) turn_ons: Vec<Option<TurnOnCount>>,
    pub(crate) temperatures_c: &'a [f64],
    pub(crate) reference_c: f64,
    /// Windows of all records, h.
    pub(crate) hours: f64,
}

/// Fixed bias of a record at T0.
struct Bias {
    mean: Estimate,
    /// The runs that have an offset of their own.
    runs: Vec<Estimate>,
    /// The turn-ons that it states.
    turn_ons: Option<TurnOnCount>,
}

impl ComparedRecords<'_> {
    /// Judges every limit of a file. What a comparison cannot ask is not asked, and says so.
    pub(crate) fn judge(&self, limits: &Limits) -> Vec<Verdict> {
        let rule = limits.decision.unwrap_or_default();
        let one = |(spec, limit): (&LimitSpec, f64)| {
            let Some(asked) = COMPARED.iter().find(|asked| asked.key == spec.key) else {
                return spec.not_asked(limit, "needs a retest: `sagnac verify`".to_owned());
            };
            let held =
                |estimate: &Estimate| spec.hold(limit, (estimate.value.abs(), Some(estimate.sigma)), rule, self.hours);
            match (asked.value)(self) {
                ComparedValue::NotAsked(why) => spec.not_asked(limit, why),
                ComparedValue::Unknown(why) => spec.unknown(limit, why),
                ComparedValue::One(estimate) => held(&estimate),
                ComparedValue::Bound(value) => spec.hold(limit, (value, None), rule, self.hours),
                ComparedValue::Pairs(pairs) => {
                    let of_pair = |(a, b, estimate): (usize, usize, Result<Estimate, String>)| match estimate {
                        Ok(estimate) => {
                            let why = Some(format!("{} against {}", self.names[a], self.names[b]));
                            Verdict { why, ..held(&estimate) }
                        }
                        Err(why) => spec.unknown(limit, why),
                    };
                    let worst = pairs.into_iter().map(of_pair).reduce(|worst, other| {
                        let by_value = !worst.is_worse_than(&other) && other.value > worst.value;
                        if other.is_worse_than(&worst) || by_value { other } else { worst }
                    });
                    worst.unwrap_or_else(|| spec.unknown(limit, "fewer than two records".to_owned()))
                }
            }
        };
        limits.given().into_iter().map(one).collect()
    }

    /// Curves are compared where all records have been: what changed elsewhere is not seen.
    fn span_covered(&self) -> Option<f64> {
        let limit = |at: usize, pick: fn(f64, f64) -> f64| self.axes.iter().map(|axis| axis.span_c()[at]).reduce(pick);
        let (common, any) = (limit(1, f64::min)? - limit(0, f64::max)?, limit(1, f64::max)? - limit(0, f64::min)?);
        (any > 0.0).then_some((common / any).clamp(0.0, 1.0))
    }

    fn pairs(&self, change: impl Fn(usize, usize) -> Result<Estimate, String>) -> ComparedValue {
        let places: Vec<usize> = (0..self.axes.len()).collect();
        ComparedValue::Pairs(pairs_of(&places, |a, b| change(*a, *b)))
    }

    /// Fixed biases of all records, where each knows its input rate.
    fn of_bias(&self, value: impl Fn(&[Bias]) -> ComparedValue) -> ComparedValue {
        let blind = self.axes.iter().position(|axis| axis.run_offsets.iter().any(|run| run.fixed_bias_dph.is_none()));
        if let Some(at) = blind {
            let name = self.names[at];
            return ComparedValue::NotAsked(format!(
                "{name} does not know its input rate: input_rate_dph or [earth] in its setup"
            ));
        }
        let biases: Option<Vec<Bias>> = {
            let stated = self.axes.iter().zip(&self.turn_ons);
            stated.map(|(axis, turn_ons)| Bias::of(axis, *turn_ons, self.reference_c)).collect()
        };
        biases
            .map_or_else(|| ComparedValue::Unknown("a record without a run offset".to_owned()), |biases| value(&biases))
    }

    /// Scale factors, where every record was made on a rate table.
    fn of_scale(&self, value: impl Fn() -> ComparedValue) -> ComparedValue {
        let turned = |axis: &AxisCalibration| axis.fit.as_ref().is_some_and(|fit| fit.scale_factor.is_some());
        match self.axes.iter().position(|axis| !turned(axis)) {
            Some(at) => ComparedValue::NotAsked(format!("{} was not made on a rate table", self.names[at])),
            None => value(),
        }
    }

    /// Rate effects, where any record has one.
    fn of_rates(&self) -> ComparedValue {
        let effects: Vec<Option<[f64; 2]>> = self.axes.iter().map(|axis| axis.rate_effect(self.reference_c)).collect();
        if effects.iter().all(Option::is_none) {
            return ComparedValue::NotAsked("no record has rate terms".to_owned());
        }
        self.pairs(|a, b| {
            let slope = |at: usize| effects[at].map(estimate).ok_or_else(|| self.lacks(at, "rate term"));
            Ok(difference(slope(a)?, slope(b)?))
        })
    }

    /// Both corrections on ramps over the common span.
    fn triangle(&self, a: usize, b: usize) -> Result<Apart, String> {
        let ends = self.temperatures_c.first().zip(self.temperatures_c.last()).filter(|(lo, hi)| lo < hi);
        let (lo_c, hi_c) = ends.ok_or("no common temperatures")?;
        Ok(apart([self.axes[a], self.axes[b]], [*lo_c, *hi_c]))
    }

    /// Noise does not cancel in a difference: the noisiest record counts.
    fn largest_walk(&self) -> ComparedValue {
        let walk = |axis: &&AxisCalibration| Some(axis.fit.as_ref()?.noise_floor.as_ref()?.n_deg_rt_h);
        let all: Option<Vec<f64>> = self.axes.iter().map(walk).collect();
        let largest = all.and_then(|all| all.into_iter().reduce(f64::max));
        largest
            .map_or_else(|| ComparedValue::Unknown("a record does not know its noise".to_owned()), ComparedValue::Bound)
    }

    fn lacks(&self, at: usize, what: &str) -> String {
        format!("{} has no {what}: make all records with one --model", self.names[at])
    }

    /// Difference of two curves at the common temperatures about its mean, and its covariance.
    fn apart(&self, a: usize, b: usize) -> Result<(DVector<f64>, DMatrix<f64>), String> {
        let (a, b) = (self.curve(a)?, self.curve(b)?);
        let m = self.temperatures_c.len();
        let centre = DMatrix::from_fn(m, m, |i, j| f64::from(u8::from(i == j)) - 1.0 / m as f64);
        Ok((&centre * (a.0 - b.0), &centre * (a.1 + b.1) * &centre))
    }

    /// Curve of a record at the common temperatures, zero at T0, and its covariance with what the selection of its model adds.
    fn curve(&self, at: usize) -> Result<(DVector<f64>, DMatrix<f64>), String> {
        let (axis, m) = (self.axes[at], self.temperatures_c.len());
        let spread = axis.fit.as_ref().and_then(|fit| fit.curve_spread.as_ref());
        let weights: Vec<Vec<(usize, f64)>> =
            self.temperatures_c.iter().map(|celsius| axis.drift_weights(*celsius, self.reference_c)).collect();
        if spread.is_none() && weights.iter().all(Vec::is_empty) {
            return Err(self.lacks(at, "bias term"));
        }
        let values = DVector::from_fn(m, |i, _| axis.drift(self.temperatures_c[i], self.reference_c));
        let mut covariance = DMatrix::from_fn(m, m, |i, j| axis.covariance_between(&weights[i], &weights[j]));
        for (i, celsius) in self.temperatures_c.iter().enumerate() {
            covariance[(i, i)] += spread.map_or(0.0, |spread| spread.variance(*celsius));
        }
        Ok((values, covariance))
    }

    fn change_of_curve(&self, a: usize, b: usize) -> Result<Estimate, String> {
        let (apart, covariance) = self.apart(a, b)?;
        let m = self.temperatures_c.len() as f64;
        let value = ((apart.norm_squared() - covariance.trace()) / m).clamp(0.0, f64::INFINITY).sqrt();
        // What noise makes of D is in DᵀCD: without it D would be as long as r says.
        let own = apart.norm_squared().max(f64::MIN_POSITIVE);
        let along = apart.dot(&(&covariance * &apart)) * (m * value * value / own).min(1.0);
        let of_square = (2.0 * covariance.norm_squared() + 4.0 * along).sqrt() / m;
        // Near zero the root of the mean square's own uncertainty.
        let sigma = of_square / (2.0 * value).max(of_square.sqrt()).max(f64::MIN_POSITIVE);
        Ok(Estimate { value, sigma })
    }

    fn slope(&self, a: usize, b: usize) -> Result<Estimate, String> {
        let (apart, covariance) = self.apart(a, b)?;
        let m = self.temperatures_c.len();
        let mean = self.temperatures_c.iter().sum::<f64>() / m as f64;
        let from_mean = DVector::from_fn(m, |i, _| self.temperatures_c[i] - mean);
        let weights = &from_mean / from_mean.norm_squared();
        let sigma = weights.dot(&(&covariance * &weights)).clamp(0.0, f64::INFINITY).sqrt();
        Ok(Estimate { value: weights.dot(&apart), sigma })
    }

    fn change_of_scale(&self, a: usize, b: usize) -> Result<Estimate, String> {
        let deviation = |at: usize, celsius: f64| estimate(self.axes[at].scale_deviation(celsius));
        let all = self.temperatures_c.iter().map(|celsius| difference(deviation(a, *celsius), deviation(b, *celsius)));
        let worst = all.max_by(|a, b| a.value.abs().total_cmp(&b.value.abs()));
        worst.ok_or_else(|| "no common temperature".to_owned())
    }
}

impl Bias {
    fn of(axis: &AxisCalibration, turn_ons: Option<TurnOnCount>, reference_c: f64) -> Option<Self> {
        let shift = axis.drift(reference_c, axis.reference_c());
        let moved = axis.drift_weights(reference_c, axis.reference_c());
        let covariance_of = &axis.fit.as_ref()?.covariance_of;
        let row = |name: &str| covariance_of.iter().position(|row| row == name);
        // On a rate table that turned runs at different rates all have one offset.
        let common = row("offset");
        let offsets = axis.run_offsets.iter().take(if common.is_some() { 1 } else { usize::MAX });
        let runs: Option<Vec<(f64, usize)>> = offsets
            .map(|run| Some((run.fixed_bias_dph? + shift, common.or_else(|| row(&format!("offset {}", run.run)))?)))
            .collect();
        let runs = runs.filter(|runs| !runs.is_empty())?;
        let n = runs.len() as f64;
        let sigma = |rows: &[(usize, f64)]| axis.variance_of(&[rows, &moved[..]].concat()).sqrt();
        let mean = runs.iter().map(|(bias, _)| bias).sum::<f64>() / n;
        let own = sigma(&runs.iter().map(|(_, row)| (*row, 1.0 / n)).collect::<Vec<_>>());
        let scatter = runs.iter().map(|(bias, _)| (bias - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0) / n;
        let runs = runs.iter().map(|(bias, row)| Estimate { value: *bias, sigma: sigma(&[(*row, 1.0)]) }).collect();
        Some(Self { mean: Estimate { value: mean, sigma: own.max(scatter.sqrt()) }, runs, turn_ons })
    }
}

fn turn_ons(biases: &[Bias]) -> ComparedValue {
    let runs = |record: &Bias| record.runs.iter().map(|run| run.value).collect();
    let all = TurnOns::of(biases.iter().map(|record| (runs(record), record.turn_ons)));
    let bound = all.map(|bound| ComparedValue::Bound(bound.sigma_upper_dph));
    bound.unwrap_or_else(|| {
        ComparedValue::Unknown("fewer than two turn-ons are stated (turn_ons in a setup)".to_owned())
    })
}

fn largest(all: impl Iterator<Item = Estimate>) -> ComparedValue {
    let worst = all.max_by(|a, b| a.value.abs().total_cmp(&b.value.abs()));
    worst.map_or_else(|| ComparedValue::Unknown("no run".to_owned()), ComparedValue::One)
}

fn estimate([value, sigma]: [f64; 2]) -> Estimate {
    Estimate { value, sigma }
}

fn difference(a: Estimate, b: Estimate) -> Estimate {
    Estimate { value: a.value - b.value, sigma: a.sigma.hypot(b.sigma) }
}

fn pairs_of<T>(
    all: &[T],
    change: impl Fn(&T, &T) -> Result<Estimate, String>,
) -> Vec<(usize, usize, Result<Estimate, String>)> {
    let with = |a: usize| (a + 1..all.len()).map(move |b| (a, b));
    (0..all.len()).flat_map(with).map(|(a, b)| (a, b, change(&all[a], &all[b]))).collect()
}
