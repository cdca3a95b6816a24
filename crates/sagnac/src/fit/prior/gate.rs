//! Whether a unit is of the fleet whose prior its fit uses: four bounds, each of which a unit of the fleet passes.
//!
//! ```text
//! D² = Σ (uⱼᵀy)²/(s² + sⱼ²)     over the directions j in which units scatter by more than the noise: Hotelling's distribution, 0.99
//! M² = Σ (uⱼᵀy)²/(s² + sⱼ²)     over the others, in which units are alike: Fisher's, of the test's noise alone, 0.995
//! γ/σ of a term beyond the model, added with no prior: Student's, 0.995 for all of them
//! r = σ·√((1 + ρ)/(1 − ρ)) of the residual: ln r is normal over the fleet, 0.995
//! ```
//!
//! The prior would draw a unit that is not like its fleet onto it, with the fleet's narrow interval. How large an error each test may
//! hide is stated: `unnoticed_dph`.
//!
//! Fails for a unit that is odd where the test does not go, by less than its noise, or in what other terms of the model imitate.

use crate::calibration::PriorUse;
use crate::fit::one_model::design::{Design, Tau};
use crate::fit::prior::posterior::{Known, Linear, Solved, shown};
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::rows::TermColumn;
use crate::fit::problem::unit_prior::{ResidualOfFleet, UnitPrior};
use crate::model::common_basis::COMMON_SPAN;
use crate::model::{ActsOn, Form, chebyshev};
use crate::noise_model::processes::SlowNoise;
use sagnac_core::MAX_ORDER;
use sagnac_log::error::{Error, Result};
use statrs::distribution::{ContinuousCDF, FisherSnedecor, StudentsT};

/// Of so many units of the fleet one is refused.
const GATE: f64 = 0.99;
/// Units differ in a direction where they scatter by this part of the noise.
const SHOWN_TO_GATE: f64 = 1.0;
/// Directions of which the test shows nothing at all, not even a unit that is odd there.
const SHOWN_AT_ALL: f64 = 1e-6;
/// Parts of the span at which a curve is looked at, and one that is none, °/h.
const CURVE: usize = 48;
const NO_CURVE_DPH: f64 = 1e-9;
/// Of so many units that are like their fleet one is refused where units are alike: by the noise of its test alone.
const MISFIT: f64 = 0.995;
/// Of so many units one is refused for a term that the model does not have.
const OTHER_TERM: f64 = 0.995;
/// Orders of the curve beyond the model's, and lags of rate effects, s, that are looked for.
const NEXT_ORDERS: usize = 2;
const OTHER_LAGS_S: [f64; 3] = [60.0, 300.0, 1200.0];
/// Of so many units one is refused for its residual.
const RESIDUAL: f64 = 0.995;
/// Quantile of a normal law: what is larger by it is found in nine tests of ten.
const ONE_OF_TEN: f64 = 1.3;

impl ResidualOfFleet {
    /// The largest r of a unit like the fleet, °/h, whose test has so many degrees of freedom.
    fn most_dph(&self, degrees: f64) -> f64 {
        let n = self.axes as f64;
        // ln of a standard deviation has a variance of 1/(2ν), and that of its correlation factor about 1/ν.
        let sigma = (self.ln_sigma.powi(2) * (1.0 + n.recip()) + 1.5 / degrees.max(1.0)).sqrt();
        let quantile = StudentsT::new(0.0, 1.0, (n - 1.0).max(1.0)).map_or(3.0, |t| t.inverse_cdf(RESIDUAL));
        (self.ln_mean + quantile * sigma).exp()
    }
}

/// Refuses a unit that is not of the fleet: by its distance where units differ, and by its misfit where they are alike. The prior would
/// draw a unit that is odd where others are alike onto the fleet, with the fleet's narrow interval.
pub(crate) fn gate(known: &Known, solved: &Solved, prior: &UnitPrior, spare_rows: f64) -> Result<PriorUse> {
    let square = |at: &usize| solved.along[*at].powi(2) / (solved.variance + solved.singular[*at].powi(2));
    let different = shown(solved, SHOWN_TO_GATE);
    let alike: Vec<usize> = shown(solved, SHOWN_AT_ALL).into_iter().filter(|at| !different.contains(at)).collect();
    let distance = different.iter().map(square).sum::<f64>().sqrt();
    let misfit = alike.iter().map(square).sum::<f64>().sqrt();
    let (k, degrees) = (different.len() as f64, prior.degrees);
    if different.is_empty() {
        return Err(Error::refused(
            "the test does not separate the units of the fleet",
            "test at other temperatures, or longer",
        ));
    }
    // Hotelling (1931): T²·(ν − k + 1)/(ν·k) has the F distribution of k and ν − k + 1 degrees.
    let spare = degrees - k + 1.0;
    let quantile = FisherSnedecor::new(k, spare).map_err(|_| {
        Error::refused(
            format!("a prior of {} axes is too small for {} directions", prior.axes, different.len()),
            "make a prior from more units",
        )
    })?;
    let distance_max = (quantile.inverse_cdf(GATE) * degrees * k / spare).sqrt();
    // Noise alone, whose variance is that of the rows beyond all columns.
    let m = alike.len() as f64;
    let misfit_max = FisherSnedecor::new(m, spare_rows).map_or(0.0, |f| (m * f.inverse_cdf(MISFIT)).sqrt());
    let unnoticed = |at: usize, prefix: &str| {
        let (bound, others) = if different.contains(&at) { (distance_max, k) } else { (misfit_max, m) };
        unnoticed_error(known, solved, prior, (at, prefix), (bound.powi(2) - others + 1.0).max(0.0).sqrt() + ONE_OF_TEN)
    };
    let most_unnoticed = |prefix: &str| (0..solved.z.len()).map(|at| unnoticed(at, prefix)).fold(0.0, f64::max);
    let (unnoticed_dph, unnoticed_rate) = (most_unnoticed("bias "), most_unnoticed("rate "));
    let variance = solved.singular.iter().map(|s| s.powi(2) / (s.powi(2) + solved.variance));
    let used = PriorUse {
        sha256: prior.sha256.clone(),
        lot: prior.lot.clone(),
        axes: prior.axes,
        distance,
        distance_max,
        directions: different.len(),
        misfit,
        misfit_max,
        residual_dph: None,
        residual_max_dph: None,
        unnoticed_dph_per_cpm: unnoticed_rate.is_finite().then_some(unnoticed_rate),
        unnoticed_dph: unnoticed_dph.is_finite().then_some(unnoticed_dph),
        parameters: solved.z.len(),
        determined: variance.sum(),
    };
    if distance > distance_max {
        let away = &known.common_root * &solved.z;
        let in_sigma = |at: usize| away[at] / known.common_root.row(at).norm();
        let farthest = most(away.len(), |at| in_sigma(at).abs());
        let name = prior.terms.get(farthest).map_or("", String::as_str);
        return Err(not_of_fleet(format!(
            "Mahalanobis distance {distance:.1} in {} directions, at most {distance_max:.1} at {:.0} %; \
             {name} is {:+.1} σ from the fleet's mean",
            different.len(),
            100.0 * GATE,
            in_sigma(farthest)
        )));
    }
    if misfit > misfit_max {
        let worst = alike[most(alike.len(), |at| square(&alike[at]))];
        let along = &known.common_root * solved.directions.column(worst);
        let name = prior.terms.get(most(along.len(), |at| (along[at] / known.common_root.row(at).norm()).abs()));
        return Err(not_of_fleet(format!(
            "the test contradicts it in {} in which its units are alike: misfit {misfit:.1}, at most {misfit_max:.1} at {:.1} %; \
             mostly in {}",
            sagnac_units::format::counted(alike.len(), "direction", "directions"),
            100.0 * MISFIT,
            name.map_or("", String::as_str)
        )));
    }
    Ok(used)
}

/// Error of a series of terms over the prior's span, that of a curve about its mean, of a unit that is odd in one direction by what one test
/// of ten does not find: δ = bound·√(s² + sⱼ²)/sⱼ units of z, of which the prior draws s²/(s² + sⱼ²) onto the fleet.
fn unnoticed_error(known: &Known, solved: &Solved, prior: &UnitPrior, (at, of): (usize, &str), bound: f64) -> f64 {
    let common = &known.common_root * solved.directions.column(at);
    let order = |name: &str| name.strip_prefix(of).and_then(|order| order.parse::<usize>().ok());
    let orders: Vec<(usize, f64)> =
        prior.terms.iter().zip(common.iter()).filter_map(|(name, value)| Some((order(name)?, *value))).collect();
    let [lo, hi] = prior.span_c;
    let curve = |part: usize| -> f64 {
        let shapes = chebyshev(COMMON_SPAN.x(lo + (hi - lo) * part as f64 / CURVE as f64));
        orders.iter().map(|(order, value)| value * shapes.get(*order).copied().unwrap_or(0.0)).sum()
    };
    let curve: Vec<f64> = (0..=CURVE).map(curve).collect();
    // The mean of a curve is a part of the run's offset.
    let mean = if of == "bias " { curve.iter().sum::<f64>() / curve.len() as f64 } else { 0.0 };
    let size_dph = curve.iter().map(|value| (value - mean).abs()).fold(0.0, f64::max);
    let (singular, variance) = (solved.singular[at], solved.variance);
    // A direction of the lag alone has no curve, whether the test shows it or not.
    if size_dph <= NO_CURVE_DPH {
        0.0
    } else {
        size_dph * bound * variance / (singular * (variance + singular.powi(2)).sqrt())
    }
}

/// Refuses a unit that another term explains, which the fleet's model does not have: the next orders of the curve, a rate effect of
/// another lag. Each is added alone, with no prior; γ/σ of the true model has Student's distribution.
pub(crate) fn refuse_other_terms(
    problem: &LeastSquares<'_>,
    linear: &Linear,
    solved: &Solved,
    (terms, taus): (&[TermColumn], &[Tau]),
    noise: SlowNoise,
    spare_rows: f64,
) -> Result<()> {
    let others = other_columns(problem, terms, taus);
    let bound = StudentsT::new(0.0, 1.0, spare_rows.max(1.0))
        .map_or(f64::INFINITY, |t| t.inverse_cdf(1.0 - (1.0 - OTHER_TERM) / (2.0 * others.len().max(1) as f64)));
    for (name, column) in others {
        let Some(in_sigma) = linear.added_column(problem, column, noise, solved.variance) else { continue };
        if in_sigma.abs() > bound {
            return Err(not_of_fleet(format!(
                "{name}, which the fleet's model does not have, is {:.1} σ from none in this test, at most {bound:.1} at {:.1} %",
                in_sigma.abs(),
                100.0 * OTHER_TERM
            )));
        }
    }
    Ok(())
}

/// Columns of terms beyond the model, with their names.
fn other_columns(problem: &LeastSquares<'_>, terms: &[TermColumn], taus: &[Tau]) -> Vec<(String, Vec<f64>)> {
    let mut out = Vec::new();
    let is_curve =
        |term: &&TermColumn| !term.form.times_rate && term.form.acts_on == ActsOn::Bias && problem.is_main(term.input);
    let highest = terms.iter().filter(is_curve).filter_map(|term| Some((term.form.shape.order()?, term.input))).max();
    let Some((order, input)) = highest else { return out };
    let column = |form: Form, lag_s: Option<f64>| -> Vec<f64> {
        let term = [TermColumn { input, form }];
        let lags: Vec<(usize, f64)> = lag_s.map(|lag_s| (input, lag_s)).into_iter().collect();
        let design = Design::new(problem, &term, &lags);
        (0..problem.len()).map(|row| problem.regressor(&term[0], row, &design.rates)).collect()
    };
    for next in order + 1..=(order + NEXT_ORDERS).min(usize::from(MAX_ORDER)) {
        let Ok(next) = u8::try_from(next) else { continue };
        out.push((format!("an order {next} of the curve"), column(Form::bias(next), None)));
    }
    if problem.has_rate() {
        let is_another = |lag_s: &f64| taus.iter().all(|tau| !(0.5..2.0).contains(&(lag_s / tau.value_s)));
        for lag_s in OTHER_LAGS_S.into_iter().filter(|lag_s| *lag_s < problem.longest_run_s()).filter(is_another) {
            out.push((format!("a rate effect with a lag of {lag_s} s"), column(Form::rate(0), Some(lag_s))));
        }
    }
    out
}

/// Refuses a unit whose residual is larger than those of its fleet: something moves it that the fleet's model does not have. Its variance would
/// widen the bounds of the gate, and hide what it is.
pub(crate) fn residual_like_the_fleets(
    used: PriorUse,
    prior: &UnitPrior,
    window_s: f64,
    degrees: f64,
) -> Result<PriorUse> {
    let of_fleet = prior.residual.filter(|of_fleet| (of_fleet.window_s / window_s - 1.0).abs() < 1e-9);
    let (Some(of_fleet), Some(residual_dph)) = (of_fleet, used.residual_dph) else { return Ok(used) };
    let most_dph = of_fleet.most_dph(degrees);
    if residual_dph > most_dph {
        let [residual, most, usual] =
            [residual_dph, most_dph, of_fleet.ln_mean.exp()].map(|dph| sagnac_units::format::significant(dph, 3));
        return Err(not_of_fleet(format!(
            "its residual is {residual} °/h, at most {most} at {:.1} %, and {usual} in the fleet: something moves it that the fleet's model does \
             not have, such as a longer lag",
            100.0 * RESIDUAL
        )));
    }
    Ok(PriorUse { residual_max_dph: Some(most_dph), ..used })
}

/// Where something is largest.
fn most(count: usize, size: impl Fn(usize) -> f64) -> usize {
    (0..count).max_by(|a, b| size(*a).total_cmp(&size(*b))).unwrap_or(0)
}

fn not_of_fleet(why: String) -> Error {
    Error::refused(
        format!("the unit is not of this fleet: {why}"),
        "give it the full test, and calibrate it without a prior",
    )
    .column("--prior")
}
