//! The five terms of a curve from the τ on at which the laws hold, with their intervals or the reasons why there are none.
//!
//! ```text
//! points without their periods ─▶ all five laws ─▶ do they describe the curve? ─▶ terms
//!                                                   no: from the next octave on, 1/τ² of any sign ─▶ …
//! ```
//!
//! Fails where no range of τ follows the laws: then no term is resolved, and the curve bounds the slow ones alone.

use crate::difference::Deviation;
use crate::freedom::{Record, Stretches};
use crate::laws::bootstrap::{Estimates, Spread, TermUncertainty};
use crate::laws::law_range::Agreement;
use crate::laws::slope::{Slope, slope_of};
use crate::laws::terms::{AllanTerm, FittedTerms, Laws, Point, WHITE};
use crate::spectrum::periods::Period;
use crate::term_value::{CONFIDENCE, MeasuredNoise, NORMAL_975, NoiseTerms, TermValue, Terms, interval};
use sagnac_units::format::significant;
use serde::Serialize;

/// Largest mean squared distance of the points from the model, in units of their variances. Beyond it the five terms do not
/// describe the curve. Points of an overlapping curve are correlated, so the mean scatters more than χ²/n.
const MISFIT: f64 = 4.0;
/// Least ratio of τ·σ² at neighbouring octaves behind a filter: scatter, and the overshoot of four poles.
const RISES: f64 = 0.85;
/// Octaves from the shortest on that a dither or an unknown beat may shape.
const MOST_OF_DITHER: usize = 4;
/// Mean square of the second difference of a phase in whole counts, over the count: each of its three roundings is below one.
const MOST_OF_ROUNDING: f64 = 4.0;
/// Highest σ² behind a low-pass filter, over N² and its frequency.
const HIGHEST_OF_FILTER: f64 = 1.2;
/// Uncertainty of a period's part in σ², and the least of σ² that is not a period's.
const PERIOD_UNCERTAIN: f64 = 0.1;
const LEAST_REST: f64 = 0.02;
/// Confidence of a point's interval where each of a dozen must lie above a term.
const BEYOND_CHANCE: f64 = 0.999;
/// Scatter about the five laws, as a part of σ, beyond which they do not describe a curve at all.
const MOST_SCATTER: f64 = 0.1;
/// Standard errors of N² from which on short τ determine it.
const DETERMINED: f64 = 5.0;
/// Halvings in the search for the scatter that explains a misfit.
const HALVINGS: usize = 40;
/// Fewest τ that separate the terms.
const FEWEST_TAUS: usize = 4;
/// Iterations between the fit and the degrees of freedom.
const ROUNDS: usize = 3;

/// The τ at which the five laws hold.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct LawRange {
    /// From this τ on, s. Below it a filter, readings that repeat, a dither or a beat shape the curve.
    pub from_s: f64,
    /// −3 dB frequency of the filter, Hz, to about a fifth for any order; null where a filter is not what shapes the curve.
    pub filter_hz: Option<f64>,
}

/// A point of a curve without its periods.
pub(crate) struct RawPoint {
    /// τ in rows.
    pub(crate) m: f64,
    /// σ²(τ), (°/h)².
    pub(crate) variance: f64,
    /// First guess of its degrees of freedom.
    pub(crate) edf: f64,
    /// 1/edf from what the periods left in it.
    pub(crate) uncertain: f64,
}

impl RawPoint {
    /// Takes the periods out, each uncertain by [`PERIOD_UNCERTAIN`] of its part.
    pub(crate) fn without(periods: &[Period], tau0_s: f64, m: usize, variance: f64, edf: f64) -> Self {
        let parts = periods.iter().map(|period| period.variance(m as f64 * tau0_s));
        let (sum, squares) = parts.fold((0.0, 0.0), |(sum, squares), part| (sum + part, squares + part * part));
        let rest = (variance - sum).max(LEAST_REST * variance);
        let uncertain = PERIOD_UNCERTAIN.powi(2) * squares / (rest * rest) / 2.0;
        Self { m: m as f64, variance: rest, edf, uncertain }
    }
}

/// Behind a filter τ·σ² rises to N²; motion and resonances make it fall somewhere.
fn rises(points: &[RawPoint]) -> bool {
    let of = |p: &RawPoint| p.m * p.variance;
    points.windows(2).all(|pair| of(&pair[1]) > RISES * of(&pair[0]))
}

/// Rounding to counts explains these octaves: σ²·τ² is half of a mean square. It beats with the rate until the noise of the angle
/// reaches a count.
pub(crate) fn is_rounding(points: &[RawPoint], tau0_s: f64, count_arcsec: f64) -> bool {
    let most = MOST_OF_ROUNDING * count_arcsec * count_arcsec / 2.0;
    points.iter().all(|p| p.variance * (p.m * tau0_s).powi(2) <= most)
}

/// The five terms of a curve, with the known properties of its record.
pub(crate) struct Model<'a> {
    pub(crate) fitted: Option<FittedTerms>,
    /// Degrees of freedom of a point from additional scatter, the same at every τ.
    scatter_edf: f64,
    /// 1/edf of each point from what a period left in it.
    uncertain: Vec<f64>,
    /// Of the octaves at which the laws hold.
    multiples: Vec<f64>,
    points: Vec<Point>,
    /// Those that are fitted.
    terms: &'static [AllanTerm],
    laws: Laws,
    /// The laws describe the points, or too few points to be judged.
    agrees: bool,
    /// The shortest octaves fall below N²/τ by more than chance.
    falls_short: bool,
    tau0_s: f64,
    stretches: &'a Stretches,
}

impl<'a> Model<'a> {
    /// The laws from the first τ on at which they hold. `count_arcsec` is one count of a record that consists of whole counts.
    pub(crate) fn new(points: &[RawPoint], tau0_s: f64, stretches: &'a Stretches, count_arcsec: Option<f64>) -> Self {
        let model = Self::lawful(points, tau0_s, stretches, count_arcsec);
        let added = model.rounding_of_lost_rows();
        if added == 0.0 {
            return model;
        }
        let without = |p: &RawPoint| {
            let rest = p.variance - added / (p.m * tau0_s);
            RawPoint { m: p.m, edf: p.edf, uncertain: p.uncertain, variance: rest.max(LEAST_REST * p.variance) }
        };
        let points: Vec<RawPoint> = points.iter().map(without).collect();
        Self::lawful(&points, tau0_s, stretches, count_arcsec)
    }

    /// A lost row also loses the rounding that it shares with its neighbours: with a fraction p of the rows filled with means, N² grows by
    /// 2pQ²/τ0, arcsec²/s.
    fn rounding_of_lost_rows(&self) -> f64 {
        let lost = 1.0 - self.stretches.recorded_part();
        let q2 = self.fitted.map_or(0.0, |fitted| fitted.coefficient(AllanTerm::Quantization).max(0.0));
        2.0 * lost * q2 / self.tau0_s
    }

    fn lawful(points: &[RawPoint], tau0_s: f64, stretches: &'a Stretches, count_arcsec: Option<f64>) -> Self {
        let plain = Self::of(points, Laws::PLAIN, &AllanTerm::ALL, tau0_s, stretches);
        let Some(found) = plain.agreement().filter(|of| !of.holds || of.below_zero) else { return plain };
        let from = |first: usize| Self::of(&points[first..], Laws::FILTERED, &AllanTerm::ALL, tau0_s, stretches);
        let last = points.len().saturating_sub(FEWEST_TAUS);
        let mut agreements = (0..=last).map(|first| (first, from(first).agreement()));
        // One that cannot be judged ends the search.
        let first = agreements.find(|(_, agreement)| agreement.is_none_or(|of| of.holds));
        let shaped = &points[..=first.map_or(0, |(first, _)| first)];
        let below_zero = found.below_zero || first.is_some_and(|(_, of)| of.is_some_and(|of| of.below_zero));
        let falls_short = below_zero && rises(shaped);
        // A disagreement within the scatter that intervals include is not worth a term.
        if !falls_short && plain.misfit().is_none() {
            return plain;
        }
        // A dither ends within a few octaves, a beat with counts where the noise exceeds one; motion that goes on is neither.
        let beats = |first: usize| count_arcsec.is_some_and(|count| is_rounding(&points[..first], tau0_s, count));
        let may_begin = |first: &usize| falls_short || *first <= MOST_OF_DITHER || beats(*first);
        let first = first.map(|(first, _)| first).filter(may_begin);
        // What just passes is still bent. One octave more costs little; the tail of a filter's memory, e^(−τ/T), needs two, and so does a
        // long beat, which fades as the noise of the angle grows to several counts.
        let has_tail = falls_short || first.is_some_and(|first| first > MOST_OF_DITHER);
        let more: &[usize] = if has_tail { &[2, 1] } else { &[1] };
        let later = |first: usize| more.iter().map(move |more| from((first + more).min(last)));
        let holds = |model: &Self| model.agreement().is_some_and(|of| of.holds);
        let lawful = first.and_then(|first| later(first).find(holds));
        Self { falls_short, ..lawful.unwrap_or(Self { agrees: false, ..plain }) }
    }

    /// N and Q of points that white noise alone describes, where it determines N.
    pub(crate) fn white_alone(points: &[RawPoint], tau0_s: f64, stretches: &'a Stretches) -> Option<MeasuredNoise> {
        let model = Self::of(points, Laws::PLAIN, &WHITE, tau0_s, stretches);
        let agreement = model.agreement().filter(|of| of.holds && !of.below_zero && model.misfit().is_none())?;
        let (terms, sigma) = (model.noise()?, agreement.n2_sigma);
        let n2 = terms.n_arcsec_rt_s.powi(2);
        let ends = [-NORMAL_975, NORMAL_975].map(|sigmas| (n2 + sigmas * sigma).max(0.0).sqrt());
        (n2 > DETERMINED * sigma).then_some(MeasuredNoise { terms, n_ends_arcsec_rt_s: Some(ends), filter_hz: None })
    }

    /// Of all points of a bare curve, whose rows nobody has seen.
    pub(crate) fn of_bare(points: &[RawPoint], tau0_s: f64, stretches: &'a Stretches) -> Self {
        Self::of(points, Laws::PLAIN, &AllanTerm::ALL, tau0_s, stretches)
    }

    /// Of all of these points. Fit and degrees of freedom depend on each other: a few iterations.
    fn of(raw: &[RawPoint], laws: Laws, terms: &'static [AllanTerm], tau0_s: f64, stretches: &'a Stretches) -> Self {
        let point = |p: &RawPoint| Point { tau_s: p.m * tau0_s, variance: p.variance, edf: p.edf };
        let mut fit: Vec<Point> = raw.iter().map(point).collect();
        let mut model = Self {
            fitted: laws.fit(&fit, terms),
            scatter_edf: f64::INFINITY,
            uncertain: raw.iter().map(|p| p.uncertain).collect(),
            multiples: raw.iter().map(|p| p.m).collect(),
            points: Vec::new(),
            terms,
            laws,
            agrees: true,
            falls_short: false,
            tau0_s,
            stretches,
        };
        for _ in 0..ROUNDS {
            for (point, raw) in fit.iter_mut().zip(raw) {
                let edf = model.edf(Deviation::Allan, raw.m).unwrap_or(raw.edf);
                point.edf = (edf.recip() + raw.uncertain).recip();
            }
            model.fitted = laws.fit(&fit, terms);
        }
        model.explain_misfit(&fit);
        model.points = fit;
        model
    }

    /// Whether the laws describe the curve.
    fn agreement(&self) -> Option<Agreement> {
        let (fitted, record) = (self.fitted.as_ref()?, self.record(Deviation::Allan)?);
        Agreement::of(&self.points, &self.multiples, &self.uncertain, fitted, &record)
    }

    /// Where the points lie too far from the model, finds the scatter that explains the misfit and fits again with it. Signals
    /// other than the five terms (dither, a period, a step) must not get weights as if they were known to a percent.
    fn explain_misfit(&mut self, points: &[Point]) {
        let freedom = points.len().saturating_sub(self.terms.len()).max(1) as f64;
        let with = |scatter_edf: f64| -> Option<(f64, FittedTerms)> {
            let spread: Vec<Point> =
                points.iter().map(|p| Point { edf: (1.0 / p.edf + 1.0 / scatter_edf).recip(), ..*p }).collect();
            let fitted = self.laws.fit(&spread, self.terms)?;
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
        // Rows that a filter joins are fewer than they seem: as few as at the shortest lawful τ.
        let m = if self.laws.filtered { m.max(self.multiples.first().copied().unwrap_or(m)) } else { m };
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
        if !self.agrees && self.misfit().is_some_and(|part| part > MOST_SCATTER) {
            return Terms::from_each(|term| TermValue::Unresolved { unresolved: self.without_law(term) });
        }
        let longest_s = self.multiples.last().map_or(0.0, |m| m * self.tau0_s);
        let estimates = self.estimates(fitted, &record);
        let mut spreads = estimates.spreads.into_iter();
        Terms::from_each(|term| match spreads.next() {
            Some(Spread::Interval { lower, upper }) => match self.not_shown(term, fitted, lower) {
                Some(unresolved) => TermValue::Unresolved { unresolved },
                None => TermValue::Found {
                    value: term.in_its_unit(fitted.root(term)),
                    lower: Some(term.in_its_unit(lower)),
                    upper: Some(term.in_its_unit(upper)),
                },
            },
            Some(Spread::Hidden) => TermValue::Unresolved { unresolved: self.hidden() },
            Some(Spread::Unresolved { at_most }) => {
                // Scatter widens a bound beyond the curve itself, which bounds the slow terms whatever shapes it at short τ.
                let most = match (self.agrees && self.misfit().is_none(), term) {
                    (true, _) => at_most,
                    (false, AllanTerm::Quantization | AllanTerm::AngleRandomWalk) => f64::INFINITY,
                    (false, _) => at_most.min(self.most_by_the_curve(term, CONFIDENCE)),
                };
                let unresolved = not_resolvable(term, longest_s, term.in_its_unit(most), &estimates.traded);
                TermValue::Unresolved { unresolved }
            }
            None => TermValue::Unresolved { unresolved: "no curve could be drawn from the model".to_owned() },
        })
    }

    fn estimates(&self, fitted: &FittedTerms, record: &Record<'_>) -> Estimates {
        let (measured, multiples, laws) = (&self.points[..], &self.multiples[..], self.laws);
        let scatter: Vec<f64> = self.uncertain.iter().map(|own| own + self.scatter_edf.recip()).collect();
        TermUncertainty { record, measured, multiples, scatter: &scatter, laws }.of_terms(fitted)
    }

    /// The laws describe the curve, which has enough octaves for a judgement.
    pub(crate) fn describes(&self) -> bool {
        self.agrees && self.misfit().is_none() && self.agreement().is_some()
    }

    /// N and Q; `None` where a filter shapes the whole curve. Q is zero where a filter hides it.
    pub(crate) fn noise(&self) -> Option<NoiseTerms> {
        let fitted = self.fitted.filter(|_| self.filtered() != Some(0.0))?;
        let q_arcsec = fitted.coefficient(AllanTerm::Quantization).max(0.0).sqrt();
        Some(NoiseTerms { n_arcsec_rt_s: fitted.root(AllanTerm::AngleRandomWalk), q_arcsec })
    }

    /// 95 % interval of N, arcsec/√s; from zero where N is not resolved.
    pub(crate) fn walk_ends(&self) -> Option<[f64; 2]> {
        let (fitted, record) = (self.fitted.as_ref()?, self.record(Deviation::Allan)?);
        let spreads = AllanTerm::ALL.into_iter().zip(self.estimates(fitted, &record).spreads);
        let walk = spreads.into_iter().find(|(term, _)| *term == AllanTerm::AngleRandomWalk);
        match walk?.1 {
            Spread::Interval { lower, upper } => Some([lower, upper]),
            Spread::Unresolved { at_most } => Some([0.0, at_most]),
            Spread::Hidden => None,
        }
    }

    /// Why there is no term. A filter lowers the curve at short τ, so that it bounds the slow terms only.
    fn without_law(&self, term: AllanTerm) -> String {
        let slow = !matches!(term, AllanTerm::Quantization | AllanTerm::AngleRandomWalk);
        let most = Some(self.most_by_the_curve(term, CONFIDENCE)).filter(|most| slow && most.is_finite());
        let bound = most.map_or(String::new(), |most| {
            format!("; the curve allows at most {} {}", significant(term.in_its_unit(most), 2), term.name().1)
        });
        format!("the curve follows the five laws at none of its τ{bound}")
    }

    /// Where the laws begin. The highest σ² of white noise behind a filter is 1.2·N²·f to 5 % for one pole and for Butterworth's two
    /// and four (the integral of NIST SP 1065, eq. 65, over N²·|H|²).
    pub(crate) fn law_range(&self, all: &[RawPoint]) -> Option<LawRange> {
        let from = *self.multiples.first().filter(|_| self.laws.filtered)?;
        let from_s = from * self.tau0_s;
        // A drift may be higher, behind it.
        let of_filter = all.iter().filter(|point| point.m <= from);
        let highest = of_filter.map(|point| point.variance).fold(0.0, f64::max);
        let n2 = self.fitted?.coefficient(AllanTerm::AngleRandomWalk);
        let filter_hz = (self.is_behind_filter() && n2 > 0.0).then(|| highest / (HIGHEST_OF_FILTER * n2));
        Some(LawRange { from_s, filter_hz })
    }

    /// N in arcsec/√s of a curve that a filter shapes at short τ; zero where it shapes all of it, `None` for any other curve.
    pub(crate) fn filtered(&self) -> Option<f64> {
        let n = self.fitted.filter(|_| self.agrees).map_or(0.0, |fitted| fitted.root(AllanTerm::AngleRandomWalk));
        self.falls_short.then_some(n)
    }

    /// The coefficient of 1/τ² is below zero.
    fn is_behind_filter(&self) -> bool {
        self.laws.filtered && self.fitted.is_some_and(|fitted| fitted.coefficient(AllanTerm::Quantization) < 0.0)
    }

    /// Why there is no quantization.
    fn hidden(&self) -> String {
        let from_s = self.multiples.first().map_or(0.0, |m| m * self.tau0_s);
        let what =
            if self.is_behind_filter() { "a filter hides it" } else { "a dither, a beat or a disturbance hides it" };
        format!("not resolvable: the five laws hold from τ = {} s on, and {what} below", significant(from_s, 2))
    }

    /// The largest root of a term that the upper ends of the curve allow: no term is more than the curve, but for what a filter
    /// takes from it.
    fn most_by_the_curve(&self, term: AllanTerm, confidence: f64) -> f64 {
        let taken = self.fitted.map_or(0.0, |fitted| fitted.coefficient(AllanTerm::Quantization).min(0.0));
        let upper = |p: &Point| {
            let end = interval(p.variance, Some(p.edf), confidence)[1]?;
            let whole = end * end - taken * AllanTerm::Quantization.variance(p.tau_s);
            Some((whole / term.variance(p.tau_s)).sqrt())
        };
        self.points.iter().filter_map(upper).fold(f64::INFINITY, f64::min)
    }

    /// Why a term that has an interval is none, where the five terms do not describe the curve.
    fn not_shown(&self, term: AllanTerm, fitted: &FittedTerms, lower: f64) -> Option<String> {
        let most = self.most_by_the_curve(term, BEYOND_CHANCE);
        if lower > most {
            let (_, unit) = term.name();
            return Some(format!(
                "not one of the five terms describes the curve: it falls below this one; it allows at most {} {unit}",
                significant(term.in_its_unit(most), 2)
            ));
        }
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
        let most = self.most_by_the_curve(term, CONFIDENCE);
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
