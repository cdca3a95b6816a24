//! From sums of differences to a noise budget: curves, and five terms by [`crate::model`], each with its 95 % interval.

use serde::Serialize;

use crate::difference::{Deviation, Difference};
use crate::laws::terms::FittedTerms;
use crate::model::{LawRange, Model, RawPoint};
use crate::pyramid::FULL_OVERLAP;
use crate::recorder::{Recorded, Recorder};
use crate::screen::{Disturbed, RowPlace, Screened};
use crate::spectrum::periods::Period;
use crate::taus::{LONGEST_PART, TauError, Taus};
use crate::term_value::{CONFIDENCE, Terms, interval};

/// Least part of σ² that a period makes at some τ: a smaller one is of no account.
const LEAST_BEND: f64 = 0.02;

/// A point of the Allan curve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct CurvePoint {
    /// τ, s.
    pub tau_s: f64,
    /// Overlapping Allan deviation, °/h.
    pub adev_dph: f64,
    /// Lower end of its 95 % interval; null where it is unknown.
    pub lower_dph: Option<f64>,
    /// Upper end.
    pub upper_dph: Option<f64>,
    /// Squared differences in it; null for a bare curve.
    pub n: Option<f64>,
    /// Their equivalent degrees of freedom.
    pub edf: Option<f64>,
}

/// A point of the Hadamard curve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct HadamardPoint {
    /// τ, s.
    pub tau_s: f64,
    /// Overlapping Hadamard deviation, °/h.
    pub hdev_dph: f64,
    /// Lower end of its 95 % interval.
    pub lower_dph: Option<f64>,
    /// Upper end.
    pub upper_dph: Option<f64>,
    /// Squared differences in it.
    pub n: f64,
}

/// A row that is far from those around it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DisturbedRow {
    /// `file:line`.
    pub at: String,
    /// Its angle minus the median of those around it, arcsec.
    pub deviation_arcsec: f64,
}

/// Rows that are far from those around them.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DisturbedRows {
    /// Number of disturbed rows.
    pub rows: u64,
    /// Fraction of all rows.
    pub fraction: f64,
    /// The curve and the terms exclude them.
    pub excluded: bool,
    /// The first ten.
    pub first: Vec<DisturbedRow>,
    /// The terms of the same record with these rows if they are excluded, without them otherwise.
    pub alternative_terms: Terms,
}

/// The noise of one axis.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct AxisBudget {
    /// Axis letter.
    pub axis: char,
    /// Rows used.
    pub rows: u64,
    /// Unbroken stretches that contain them.
    pub stretches: u64,
    /// Length of the longest stretch, s.
    pub longest_s: f64,
    /// Lost rows that were filled with a mean rate, so that differences at long τ reach across them.
    pub filled_rows: u64,
    /// Interval of a row, s.
    pub sample_interval_s: f64,
    /// Full overlap up to this τ, s; null: at every τ.
    pub full_overlap_s: Option<f64>,
    /// The overlapping Allan deviation.
    pub curve: Vec<CurvePoint>,
    /// The overlapping Hadamard deviation, which a steady ramp of the rate does not affect.
    pub hadamard: Vec<HadamardPoint>,
    /// The five terms.
    pub terms: Terms,
    /// Scatter of the curve about the five terms beyond chance, as a fraction of σ; null where there is none.
    /// The intervals of the terms include it.
    pub misfit: Option<f64>,
    /// Where the five laws begin to hold; null where they hold at all τ.
    pub law_range: Option<LawRange>,
    /// Periods of the rate, the strongest first. The terms exclude them; the curve includes them.
    pub periods: Vec<Period>,
    /// Rows that are far from those around them; null where there are none.
    pub disturbed: Option<DisturbedRows>,
    /// The model as fitted, for drawing: (τ s, deviation °/h).
    #[serde(skip)]
    pub fitted: Option<FittedTerms>,
}

/// One unit of the angles of a record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RecordUnit {
    /// Whole counts of so many arcsec.
    Count(f64),
    /// Any angle, in units of so many arcsec.
    Angle(f64),
}

impl RecordUnit {
    fn arcsec(self) -> f64 {
        let (Self::Count(arcsec) | Self::Angle(arcsec)) = self;
        arcsec
    }

    fn count_arcsec(self) -> Option<f64> {
        match self {
            Self::Count(arcsec) => Some(arcsec),
            Self::Angle(_) => None,
        }
    }
}

/// The budget of one unbroken stretch in memory: angles of `tau0_s` seconds each.
///
/// # Errors
/// A τ that such rows cannot have.
pub fn budget_of_angles(angles: &[f64], unit: RecordUnit, tau0_s: f64, taus: &Taus) -> Result<AxisBudget, TauError> {
    let shown = taus.multiples(tau0_s)?;
    let mut recorder = Recorder::new(differences(&shown, angles.len().max(1)), usize::MAX);
    recorder.push(angles);
    let recorded = recorder.finish();
    let limit = taus.longest_shown(recorded.stretches.longest());
    Ok(budget('x', &recorded, tau0_s, unit, |m| m <= limit && shown.contains(&m)))
}

/// The differences a budget needs: those asked for and the octaves of the fit.
pub fn differences(shown: &[usize], highest: usize) -> Vec<Difference> {
    let octaves = (0..usize::BITS - 1).map(|octave| 1_usize << octave).take_while(|m| *m <= highest);
    let mut all: Vec<usize> = shown.iter().copied().chain(octaves).collect();
    all.sort_unstable();
    all.dedup();
    let differences = |deviation| all.iter().map(move |m| Difference { deviation, m: *m });
    differences(Deviation::Allan).chain(differences(Deviation::Hadamard)).collect()
}

/// The budget of a recorded axis. `asked` selects the τ to show.
pub fn budget(
    axis: char,
    recorded: &Recorded,
    tau0_s: f64,
    unit: RecordUnit,
    asked: impl Fn(usize) -> bool,
) -> AxisBudget {
    let arcsec = unit.arcsec();
    let longest = recorded.stretches.longest();
    let variances = |deviation: Deviation| {
        let sums = recorded.sums.iter().filter(move |(difference, _)| difference.deviation == deviation);
        sums.filter_map(move |(difference, sum)| {
            let variance = sum.variance(deviation, difference.m as f64 * tau0_s)? * arcsec * arcsec;
            let variance = variance / recorded.stretches.white_factor(deviation, difference.m as f64);
            Some((difference.m, variance, sum.number))
        })
    };
    let limit = usize::try_from(longest / LONGEST_PART).unwrap_or(usize::MAX);
    let fit =
        variances(Deviation::Allan).filter(|(m, variance, _)| m.is_power_of_two() && *m <= limit && *variance > 0.0);
    let fit: Vec<(usize, f64, f64)> = fit.collect();
    let periods: Vec<Period> = recorded.series.periods(tau0_s, arcsec);
    let bends = |period: &Period| {
        fit.iter().any(|(m, variance, _)| period.variance(*m as f64 * tau0_s) > LEAST_BEND * variance)
    };
    let periods: Vec<Period> = periods.into_iter().filter(bends).collect();
    let without = |(m, variance, number)| RawPoint::without(&periods, tau0_s, m, variance, number / m as f64);
    let fit: Vec<RawPoint> = fit.into_iter().map(without).collect();
    let model = Model::new(&fit, tau0_s, &recorded.stretches, unit.count_arcsec());
    let curve = variances(Deviation::Allan).filter(|(m, ..)| asked(*m)).map(|(m, variance, n)| {
        let edf = model.edf(Deviation::Allan, m as f64);
        let [lower_dph, upper_dph] = interval(variance, edf, CONFIDENCE);
        CurvePoint { tau_s: m as f64 * tau0_s, adev_dph: variance.sqrt(), lower_dph, upper_dph, n: Some(n), edf }
    });
    let curve: Vec<CurvePoint> = curve.collect();
    let hadamard = variances(Deviation::Hadamard).filter(|(m, ..)| asked(*m)).map(|(m, variance, n)| {
        let [lower_dph, upper_dph] = interval(variance, model.edf(Deviation::Hadamard, m as f64), CONFIDENCE);
        HadamardPoint { tau_s: m as f64 * tau0_s, hdev_dph: variance.sqrt(), lower_dph, upper_dph, n }
    });
    AxisBudget {
        axis,
        rows: recorded.rows,
        stretches: recorded.stretches.count(),
        longest_s: longest.saturating_sub(1) as f64 * tau0_s,
        filled_rows: recorded.filled,
        sample_interval_s: tau0_s,
        full_overlap_s: (!recorded.full_overlap).then_some(FULL_OVERLAP as f64 * tau0_s),
        hadamard: hadamard.collect(),
        terms: model.terms(),
        misfit: model.misfit(),
        law_range: model.law_range(&fit),
        periods,
        curve,
        disturbed: None,
        fitted: model.fitted,
    }
}

/// The budget of a screened axis; `place` gives the name of a row.
pub fn budget_of_screened(
    axis: char,
    screened: &Screened,
    tau0_s: f64,
    unit: RecordUnit,
    asked: impl Fn(usize) -> bool,
    place: impl Fn(RowPlace) -> String,
) -> AxisBudget {
    let mut used = budget(axis, &screened.used, tau0_s, unit, asked);
    used.disturbed = screened.other.as_ref().map(|other| {
        let named = |row: &Disturbed| DisturbedRow { at: place(row.place), deviation_arcsec: row.away * unit.arcsec() };
        DisturbedRows {
            rows: screened.disturbed,
            fraction: screened.disturbed as f64 / screened.rows.max(1) as f64,
            excluded: screened.cleaned,
            first: screened.named.iter().map(named).collect(),
            alternative_terms: budget(axis, other, tau0_s, unit, |_| false).terms,
        }
    });
    used
}
