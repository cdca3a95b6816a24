//! What speaks against a retest before any of its values does: facts that were stated otherwise than for the calibration, limits that were
//! made easier, and noise that is not the unit's.
//!
//! ```text
//! overrides     input rate, window, limits easier than their base set, a single limit      in the line of the verdict
//! objections    another temperature offset; a retest quieter than the record, or of another    no acceptance, whatever the limits
//!               unit's curve, noise or scale factor; copied rows
//! ```

use crate::calibration::{Calibration, NoiseFloor};
use crate::verify::limits::table::{Bound, Limits};
use crate::verify::overrides::Override;
use crate::verify::{AxisVerification, DecisionRule, SETS, SPECS};
use sagnac_log::setup::{RateUnit, Setup};
use sagnac_noise::{Repeat, Trace};
use sagnac_units::format::significant;

/// Windows whose lengths differ by less than this part of them are alike.
const SAME_WINDOW: f64 = 1e-6;

/// A retest whose N is below this part of the record's, or whose B below that, is not of the same noise.
const QUIETER_N: f64 = 0.5;
const QUIETER_B: f64 = 1.0 / 3.0;
/// A retest that keeps more than this part of the predicted drift, and this many times the misfit of the training logs, whose N is above this many times the record's, or whose scale factor
/// differs by more than this part of the deviation that the setup allows, is not of the same unit.
const OTHER_CURVE: f64 = 0.5;
const OTHER_MISFIT: f64 = 2.0;
const OTHER_N: f64 = 2.0;
const OTHER_SIGMAS: f64 = 3.0;
const OTHER_SCALE: f64 = 0.2;
/// σ² at two rows over that at one, more than the record has: white noise has 0.5, a mean of three rows 1.2.
const CORRELATED: f64 = 0.4;
/// Rows of intervals that differ by less than this part of them are alike.
const SAME_ROWS: f64 = 0.1;
/// Standard errors of an upper bound.
const SIGMAS: f64 = 1.96;

/// What the retest states otherwise than its calibration.
pub(crate) fn of_retest(record: Option<&Calibration>, window_s: f64, axes: &[AxisVerification]) -> Vec<Override> {
    let rates = axes.iter().filter_map(|axis| {
        let bias = axis.bias_repeatability.as_ref()?;
        let (calibration_dph, retest_dph) = (bias.calibration_input_rate_dph, bias.input_rate_dph);
        bias.has_other_input().then_some(Override::InputRate { axis: axis.axis, calibration_dph, retest_dph })
    });
    let window = record.map(|record| record.window_s).filter(|of_fit| (window_s / of_fit - 1.0).abs() > SAME_WINDOW);
    rates.chain(window.map(|calibration_s| Override::Window { calibration_s, retest_s: window_s })).collect()
}

/// Limits easier than those of their base set, and one that stands alone.
pub(crate) fn of_limits(limits: &Limits) -> Vec<Override> {
    let set = SETS.iter().find(|(set, _)| limits.base.as_deref() == Some(*set));
    let base = set.and_then(|(_, text)| Limits::parse(text).ok());
    let given = limits.given();
    if let ([(spec, _)], None) = (given.as_slice(), &base) {
        return vec![Override::SingleLimit { name: spec.key.to_owned() }];
    }
    let easier = SPECS.iter().filter_map(|spec| {
        let (base, stated) = ((spec.stated)(base.as_ref()?)?, (spec.stated)(limits)?);
        let is_easier = if spec.bound == Bound::Most { stated > base } else { stated < base };
        is_easier.then(|| Override::Limit { name: spec.key.to_owned(), base, stated })
    });
    let rule = |limits: &Limits| limits.decision.unwrap_or_default();
    let is_unguarded =
        base.as_ref().is_some_and(|base| rule(base) == DecisionRule::Guarded) && rule(limits) == DecisionRule::Simple;
    easier.chain(is_unguarded.then_some(Override::Decision)).collect()
}

/// The target knows no offset between temperature and counts but that of its calibration.
pub(crate) fn other_offset(record: Option<&Calibration>, setup: &Setup) -> Option<String> {
    let (of_fit, stated) = (record?.setup.temperature_offset_s, setup.temperature_offset_s);
    (of_fit != stated).then(|| {
        format!(
            "the retest has temperature_offset_s = {stated}, its calibration {of_fit}; the target has no other offset"
        )
    })
}

/// Noise of the retest below that of the unit's own record, with 95 % confidence; of an axis.
pub(crate) fn quieter(record: Option<&Calibration>, axis: &AxisVerification, units: RateUnit) -> Option<String> {
    let fit = record?.axes.iter().find(|of_fit| of_fit.axis == axis.axis)?.fit.as_ref()?;
    let floor = fit.noise_floor.as_ref()?;
    let why = of_walk(floor, axis).or_else(|| of_filter(floor, axis)).or_else(|| {
        let (own, shown) = (fit.slow_noise.as_ref()?.bias_instability_dph?, axis.residual.bias_instability_dph?);
        let at_most = shown.value + SIGMAS * shown.sigma;
        let [at_most_text, own_text] = [at_most, own].map(|dph| units.text(dph, 2));
        (at_most < QUIETER_B * own).then(|| format!("B is at most {at_most_text}, there {own_text}"))
    })?;
    Some(format!("axis {}: the retest is quieter than the unit's own record: {why}", axis.axis))
}

fn of_walk(floor: &NoiseFloor, axis: &AxisVerification) -> Option<String> {
    let [_, at_most] = axis.residual.random_walk?.after_ends_deg_rt_h?;
    let [at_most_text, own] = [at_most, floor.n_deg_rt_h].map(|n| significant(n, 2));
    (at_most < QUIETER_N * floor.n_deg_rt_h).then(|| format!("N is at most {at_most_text} °/√h, there {own}"))
}

/// Neighbouring rows that correlate, where those of the record do not: a filter that both have is no fault. Of rows alike.
fn of_filter(floor: &NoiseFloor, axis: &AxisVerification) -> Option<String> {
    let [shown, row_s] = axis.noise_floor.as_ref()?.second_over_first?;
    let own =
        floor.second_over_first.filter(|_| floor.row_s.is_some_and(|own_s| (own_s / row_s - 1.0).abs() < SAME_ROWS))?;
    (shown > own + CORRELATED).then(|| {
        let [shown, own] = [shown, own].map(|ratio| significant(ratio, 2));
        format!("its neighbouring rows correlate (σ² at two rows is {shown} of that at one, there {own})")
    })
}

/// Values of an axis that no other test of the unit has: its curve, its noise, its scale factor.
pub(crate) fn other_unit(record: Option<&Calibration>, axis: &AxisVerification, setup: &Setup) -> Option<String> {
    let fit = record?.axes.iter().find(|of_fit| of_fit.axis == axis.axis)?.fit.as_ref()?;
    // What the model left in the training logs it leaves here, too.
    let floor_dph = fit.noise_floor.as_ref().map_or(0.0, |floor| floor.value_dph);
    let misfit_dph = (fit.residual.sigma_dph.powi(2) - floor_dph.powi(2)).max(0.0).sqrt();
    let curve = axis.residual.over_temperature_dph.zip(axis.residual.removed_over_temperature_dph).and_then(
        |(left, predicted)| {
            if left.value - OTHER_SIGMAS * left.sigma < OTHER_MISFIT * misfit_dph {
                return None;
            }
            let part = (left.value - OTHER_SIGMAS * left.sigma) / predicted;
            (part > OTHER_CURVE).then(|| {
                format!("the correction leaves at least {} of the drift that it predicts", significant(part, 2))
            })
        },
    );
    let walk = axis.residual.random_walk.zip(fit.noise_floor.as_ref()).and_then(|(walk, floor)| {
        let [at_least, _] = walk.after_ends_deg_rt_h?;
        let [at_least_text, own] = [at_least, floor.n_deg_rt_h].map(|n| significant(n, 2));
        (at_least > OTHER_N * floor.n_deg_rt_h).then(|| format!("N is at least {at_least_text} °/√h, there {own}"))
    });
    let scale = axis.scale_factor_difference.and_then(|scale| {
        let beyond_ppm = scale.ppm.abs() - OTHER_SIGMAS * scale.sigma_ppm;
        (beyond_ppm > OTHER_SCALE * setup.scale_factor_deviation_max_ppm())
            .then(|| format!("the scale factor differs by {} ppm", significant(scale.ppm, 3)))
    });
    let reasons: Vec<String> = [curve, walk, scale].into_iter().flatten().collect();
    let letter = axis.axis;
    (!reasons.is_empty()).then(|| {
        format!(
            "axis {letter}: the retest differs from the record as that of another unit would: {}",
            reasons.join("; ")
        )
    })
}

/// Rows that came before in the retest count once.
pub(crate) fn repeated(retest: &Trace) -> Option<String> {
    let copy = Repeat::within(retest)?;
    let [hours, percent] = [copy.lag_s / 3600.0, 100.0 * copy.shared].map(|value| significant(value, 3));
    Some(format!("rows of the retest repeat those {hours} h before: {percent} % of their noise is the same"))
}
