//! From sums of differences to a noise budget: curves and five terms, each with its 95 % interval.

use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::bootstrap::{Spread, TermUncertainty};
use crate::difference::{Deviation, Difference};
use crate::freedom::{Record, Stretches};
use crate::pyramid::FULL_OVERLAP;
use crate::recorder::{Recorded, Recorder};
use crate::screen::{Disturbed, RowPlace, Screened};
use crate::slope::{Slope, slope_of};
use crate::taus::{LONGEST_PART, TauError, Taus};
use crate::terms::{AllanTerm, FittedTerms, Point, fit_terms};
use sagnac_units::ARCSEC_RT_S_PER_DEG_RT_H;
use sagnac_units::format::significant;

/// Confidence of every interval here.
pub const CONFIDENCE: f64 = 0.95;
/// Largest mean squared distance of the points from the model, in units of their variances. Beyond it the five terms do not
/// describe the curve. Points of an overlapping curve are correlated, so the mean scatters more than χ²/n.
const MISFIT: f64 = 4.0;
/// Halvings in the search for the scatter that explains a misfit.
const HALVINGS: usize = 40;
/// Fewest τ that separate the terms.
const FEWEST_TAUS: usize = 4;
/// Iterations between the fit and the degrees of freedom.
const ROUNDS: usize = 3;

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

/// A term of the budget.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum TermValue {
    /// Found.
    Found {
        /// Value.
        value: f64,
        /// Lower end of its 95 % interval; null if the uncertainty of the curve is unknown.
        lower: Option<f64>,
        /// Upper end.
        upper: Option<f64>,
    },
    /// Not resolvable from this record.
    Unresolved {
        /// Why.
        unresolved: String,
    },
}

/// The five terms, in the field's units.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Terms {
    /// Quantization, arcsec.
    pub q_arcsec: TermValue,
    /// Angle random walk, °/√h.
    pub n_deg_rt_h: TermValue,
    /// Bias instability, °/h.
    pub b_dph: TermValue,
    /// Rate random walk, °/h/√h.
    pub k_dph_rt_h: TermValue,
    /// Rate ramp, °/h/h.
    pub r_dph_h: TermValue,
}

impl Terms {
    /// In the order of [`AllanTerm::ALL`].
    pub fn get(&self, term: AllanTerm) -> &TermValue {
        match term {
            AllanTerm::Quantization => &self.q_arcsec,
            AllanTerm::AngleRandomWalk => &self.n_deg_rt_h,
            AllanTerm::BiasInstability => &self.b_dph,
            AllanTerm::RateRandomWalk => &self.k_dph_rt_h,
            AllanTerm::RateRamp => &self.r_dph_h,
        }
    }

    /// None of them, for one reason.
    pub(crate) fn none(why: &str) -> Self {
        Self::from_each(|_| TermValue::Unresolved { unresolved: why.to_owned() })
    }

    pub(crate) fn from_each(mut value: impl FnMut(AllanTerm) -> TermValue) -> Self {
        Self {
            q_arcsec: value(AllanTerm::Quantization),
            n_deg_rt_h: value(AllanTerm::AngleRandomWalk),
            b_dph: value(AllanTerm::BiasInstability),
            k_dph_rt_h: value(AllanTerm::RateRandomWalk),
            r_dph_h: value(AllanTerm::RateRamp),
        }
    }
}

impl AllanTerm {
    /// Letter and unit of the field.
    pub fn name(self) -> (&'static str, &'static str) {
        match self {
            Self::Quantization => ("quantization Q", "arcsec"),
            Self::AngleRandomWalk => ("angle random walk N", "°/√h"),
            Self::BiasInstability => ("bias instability B", "°/h"),
            Self::RateRandomWalk => ("rate random walk K", "°/h/√h"),
            Self::RateRamp => ("rate ramp R", "°/h/h"),
        }
    }

    /// From arcsec and seconds to its unit.
    pub fn in_its_unit(self, root: f64) -> f64 {
        match self {
            Self::Quantization | Self::BiasInstability => root,
            Self::AngleRandomWalk => root / ARCSEC_RT_S_PER_DEG_RT_H,
            Self::RateRandomWalk => root * 60.0,
            Self::RateRamp => root * 3600.0,
        }
    }
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
    /// Rows that are far from those around them; null where there are none.
    pub disturbed: Option<DisturbedRows>,
    /// The model as fitted, for drawing: (τ s, deviation °/h).
    #[serde(skip)]
    pub fitted: Option<FittedTerms>,
}

/// The budget of one unbroken stretch in memory: angles of `tau0_s` seconds each, arcsec.
///
/// # Errors
/// A τ that such rows cannot have.
pub fn budget_of_angles(angles: &[f64], tau0_s: f64, taus: &Taus) -> Result<AxisBudget, TauError> {
    let shown = taus.multiples(tau0_s)?;
    let mut recorder = Recorder::new(differences(&shown, angles.len().max(1)), usize::MAX);
    recorder.push(angles);
    let recorded = recorder.finish();
    let limit = taus.longest_shown(recorded.stretches.longest());
    Ok(budget('x', &recorded, tau0_s, 1.0, |m| m <= limit && shown.contains(&m)))
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

/// The budget of a recorded axis. `asked` selects the τ to show; `arcsec` is the size of one unit of the angles.
pub fn budget(axis: char, recorded: &Recorded, tau0_s: f64, arcsec: f64, asked: impl Fn(usize) -> bool) -> AxisBudget {
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
    let fit = fit.map(|(m, variance, number)| (m as f64, variance, number / m as f64));
    let model = Model::new(fit.collect(), tau0_s, &recorded.stretches);
    let curve = variances(Deviation::Allan).filter(|(m, ..)| asked(*m)).map(|(m, variance, n)| {
        let edf = model.edf(Deviation::Allan, m as f64);
        let [lower_dph, upper_dph] = interval(variance, edf);
        CurvePoint { tau_s: m as f64 * tau0_s, adev_dph: variance.sqrt(), lower_dph, upper_dph, n: Some(n), edf }
    });
    let hadamard = variances(Deviation::Hadamard).filter(|(m, ..)| asked(*m)).map(|(m, variance, n)| {
        let [lower_dph, upper_dph] = interval(variance, model.edf(Deviation::Hadamard, m as f64));
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
        curve: curve.collect(),
        hadamard: hadamard.collect(),
        terms: model.terms(),
        misfit: model.misfit(),
        disturbed: None,
        fitted: model.fitted,
    }
}

/// The budget of a screened axis; `place` gives the name of a row.
pub fn budget_of_screened(
    axis: char,
    screened: &Screened,
    tau0_s: f64,
    arcsec: f64,
    asked: impl Fn(usize) -> bool,
    place: impl Fn(RowPlace) -> String,
) -> AxisBudget {
    let mut used = budget(axis, &screened.used, tau0_s, arcsec, asked);
    used.disturbed = screened.other.as_ref().map(|other| {
        let named = |row: &Disturbed| DisturbedRow { at: place(row.place), deviation_arcsec: row.away * arcsec };
        DisturbedRows {
            rows: screened.disturbed,
            fraction: screened.disturbed as f64 / screened.rows.max(1) as f64,
            excluded: screened.cleaned,
            first: screened.named.iter().map(named).collect(),
            alternative_terms: budget(axis, other, tau0_s, arcsec, |_| false).terms,
        }
    });
    used
}

/// The five terms of a curve, with the known properties of its record.
pub(crate) struct Model<'a> {
    pub(crate) fitted: Option<FittedTerms>,
    /// Degrees of freedom of a point from additional scatter, the same at every τ.
    scatter_edf: f64,
    multiples: Vec<f64>,
    points: Vec<Point>,
    tau0_s: f64,
    stretches: &'a Stretches,
}

impl<'a> Model<'a> {
    /// From (m, σ², first guess of the degrees of freedom). Fit and degrees of freedom depend on each other: a few iterations.
    pub(crate) fn new(points: Vec<(f64, f64, f64)>, tau0_s: f64, stretches: &'a Stretches) -> Self {
        let multiples: Vec<f64> = points.iter().map(|(m, ..)| *m).collect();
        let point = |(m, variance, edf): &(f64, f64, f64)| Point { tau_s: m * tau0_s, variance: *variance, edf: *edf };
        let mut fit: Vec<Point> = points.iter().map(point).collect();
        let fitted = fit_terms(&fit, &AllanTerm::ALL);
        let (scatter_edf, points) = (f64::INFINITY, Vec::new());
        let mut model = Self { fitted, scatter_edf, multiples, points, tau0_s, stretches };
        for _ in 0..ROUNDS {
            for (point, m) in fit.iter_mut().zip(&model.multiples) {
                point.edf = model.edf(Deviation::Allan, *m).unwrap_or(point.edf);
            }
            model.fitted = fit_terms(&fit, &AllanTerm::ALL);
        }
        model.explain_misfit(&fit);
        model.points = fit;
        model
    }

    /// Where the points lie too far from the model, finds the scatter that explains the misfit and fits again with it. Signals
    /// other than the five terms (dither, a period, a step) must not get weights as if they were known to a percent.
    fn explain_misfit(&mut self, points: &[Point]) {
        let freedom = points.len().saturating_sub(AllanTerm::ALL.len()).max(1) as f64;
        let with = |scatter_edf: f64| -> Option<(f64, FittedTerms)> {
            let spread: Vec<Point> =
                points.iter().map(|p| Point { edf: (1.0 / p.edf + 1.0 / scatter_edf).recip(), ..*p }).collect();
            let fitted = fit_terms(&spread, &AllanTerm::ALL)?;
            let away = |p: &Point| p.edf / 2.0 * (p.variance / fitted.variance(p.tau_s) - 1.0).powi(2);
            Some((spread.iter().map(away).sum::<f64>() / freedom, fitted))
        };
        if points.iter().any(|p| p.edf <= 0.0) || with(f64::INFINITY).is_none_or(|(misfit, _)| misfit <= MISFIT) {
            return;
        }
        let (mut low, mut high) = (0.0_f64, 40.0);
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(low, high);
            match with(middle.exp2()) {
                Some((misfit, _)) if misfit > 1.0 => high = middle,
                _ => low = middle,
            }
        }
        self.scatter_edf = low.exp2();
        self.fitted = with(self.scatter_edf).map(|(_, fitted)| fitted);
    }

    /// Scatter beyond chance, as a fraction of σ: half of that of σ².
    pub(crate) fn misfit(&self) -> Option<f64> {
        self.scatter_edf.is_finite().then(|| (0.5 / self.scatter_edf).sqrt())
    }

    fn record(&self, deviation: Deviation) -> Option<Record<'a>> {
        let noise = self.fitted.as_ref()?.noise();
        Some(Record { noise, deviation, tau0_s: self.tau0_s, stretches: self.stretches })
    }

    /// Equivalent degrees of freedom of a point.
    pub(crate) fn edf(&self, deviation: Deviation, m: f64) -> Option<f64> {
        // One point fits any noise and gives no information on its uncertainty.
        let record = self.record(deviation).filter(|_| self.multiples.len() > 1)?;
        // Every existing difference has at least one.
        Some(record.edf(m)).filter(|edf| *edf > 0.0).map(|edf| edf.max(1.0))
    }

    pub(crate) fn terms(&self) -> Terms {
        let (Some(fitted), Some(record)) = (&self.fitted, self.record(Deviation::Allan)) else {
            return Terms::none("no deviation above zero in this record: it is too short, or all its rows are alike");
        };
        if self.multiples.len() < FEWEST_TAUS {
            return Terms::none(
                "fewer than four octaves of τ above zero determine no slopes: the longest stretch is shorter than 24 rows, or silent",
            );
        }
        let longest_s = self.multiples.last().map_or(0.0, |m| m * self.tau0_s);
        let (measured, multiples, scatter_edf) = (&self.points[..], &self.multiples[..], self.scatter_edf);
        let estimates = TermUncertainty { record: &record, measured, multiples, scatter_edf }.of_terms(fitted);
        let mut spreads = estimates.spreads.into_iter();
        Terms::from_each(|term| match spreads.next() {
            Some(Spread::Interval { lower, upper }) => match self.not_shown(term, fitted) {
                Some(unresolved) => TermValue::Unresolved { unresolved },
                None => TermValue::Found {
                    value: term.in_its_unit(fitted.root(term)),
                    lower: Some(term.in_its_unit(lower)),
                    upper: Some(term.in_its_unit(upper)),
                },
            },
            Some(Spread::Unresolved { at_most }) => {
                // Scatter widens a bound beyond the curve itself.
                let most = if self.misfit().is_some() { at_most.min(self.most_by_the_curve(term)) } else { at_most };
                let unresolved = not_resolvable(term, longest_s, term.in_its_unit(most), &estimates.traded);
                TermValue::Unresolved { unresolved }
            }
            None => TermValue::Unresolved { unresolved: "no curve could be drawn from the model".to_owned() },
        })
    }

    /// The largest root of a term that the upper ends of the curve allow: no term is more than the curve.
    fn most_by_the_curve(&self, term: AllanTerm) -> f64 {
        let upper = |p: &Point| interval(p.variance, Some(p.edf))[1].map(|end| end / term.variance(p.tau_s).sqrt());
        self.points.iter().filter_map(upper).fold(f64::INFINITY, f64::min)
    }

    /// Why a term that has an interval is none, where the five terms do not describe the curve.
    fn not_shown(&self, term: AllanTerm, fitted: &FittedTerms) -> Option<String> {
        let spread = |p: &Point| Point { edf: (1.0 / p.edf + 1.0 / self.scatter_edf).recip(), ..*p };
        let points: Vec<Point> = self.points.iter().map(spread).collect();
        let slope = if self.misfit().is_some() { slope_of(term, fitted, &points) } else { Slope::Shown };
        let (name, unit) = term.name();
        let letter = name.rsplit(' ').next().unwrap_or_default();
        let why = match slope {
            Slope::Shown => return None,
            Slope::Nowhere => format!("no three octaves of τ show {letter} alone"),
            Slope::Other { found, model, taus_s: [from, to] } => format!(
                "from τ = {} to {} s, where {letter} would dominate, the slope is {}, not {}",
                significant(from, 2),
                significant(to, 2),
                significant(found, 2),
                significant(model, 2)
            ),
        };
        let most = self.most_by_the_curve(term);
        let bound = format!("; the curve allows at most {} {unit}", significant(term.in_its_unit(most), 2));
        Some(format!(
            "not one of the five terms describes the curve: {why}{}",
            if most.is_finite() { &bound } else { "" }
        ))
    }
}

fn not_resolvable(term: AllanTerm, longest_s: f64, at_most: f64, traded: &[AllanTerm]) -> String {
    let (_, unit) = term.name();
    let bound = match at_most {
        bound if bound.is_finite() => format!(": at most {} {unit}", significant(bound, 2)),
        _ => ", and not bounded by it".to_owned(),
    };
    let others = traded.iter().filter(|other| **other != term).map(|other| other.name().0);
    let others = if traded.contains(&term) { others.collect::<Vec<_>>().join(" or ") } else { String::new() };
    let instead = if others.is_empty() { String::new() } else { format!("; the curve needs it, or {others} instead") };
    format!("not resolvable from this record (τ up to {} s){bound}{instead}", significant(longest_s, 3))
}

/// Ends of a deviation's interval: σ·√(edf/χ²).
pub(crate) fn interval(variance: f64, edf: Option<f64>) -> [Option<f64>; 2] {
    let chi = edf.and_then(|edf| Some((edf, ChiSquared::new(edf).ok()?)));
    let Some((edf, chi)) = chi.filter(|_| variance > 0.0) else { return [None, None] };
    let tail = (1.0 - CONFIDENCE) / 2.0;
    [1.0 - tail, tail].map(|part| {
        let end = (variance * edf / chi.inverse_cdf(part)).sqrt();
        end.is_finite().then_some(end)
    })
}
