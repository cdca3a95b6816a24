//! A bare curve: τ and σ of an Allan deviation that another program computed.
//!
//! A curve does not state the uncertainty of its points. If the length of its record is known, they count as points of a
//! fully overlapping deviation. Otherwise every point has the same weight and the terms have no interval.

use crate::budget::{AxisBudget, CurvePoint};
use crate::difference::Deviation;
use crate::freedom::Stretches;
use crate::laws::terms::{AllanTerm, Point, fit_terms};
use crate::model::{Model, RawPoint};
use crate::term_value::{CONFIDENCE, TermValue, Terms, interval};

/// Smallest ratio of neighbouring τ in the fit.
const APART: f64 = 1.4;
/// Longest record, s: 30,000 years.
const MOST_RECORD_S: f64 = 1e12;
/// Most rows of a record: 30 years at 10 kHz. The degrees of freedom of more would take minutes.
const MOST_ROWS: f64 = 1e13;
/// A term below this fraction of σ² at every τ counts as zero.
const NO_PART: f64 = 1e-6;

/// A curve of one axis.
#[derive(Clone, Debug, PartialEq)]
pub struct BareCurve {
    /// Axis letter.
    pub axis: char,
    /// (τ s, deviation °/h), τ rising.
    pub points: Vec<(f64, f64)>,
}

/// A record length too short for its curve's longest τ, or unreasonably long.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "a record with deviations from τ = {shortest_s} s to {longest_s} s has at least twice the longest τ, and at most 1e13 rows of the shortest"
)]
pub struct RecordLengthError {
    /// Shortest τ of the curve, s: the row interval.
    pub shortest_s: f64,
    /// Longest τ of the curve, s.
    pub longest_s: f64,
    /// Length of the record as given, s.
    pub record_s: f64,
}

/// The five terms of a bare curve; `record_s` is the length of the record behind it, if it is known.
///
/// # Errors
/// A record too short for the curve's longest τ, longer than 1e12 s, or of more than 1e13 rows of its shortest τ.
pub fn budget_of_curve(curve: &BareCurve, record_s: Option<f64>) -> Result<AxisBudget, RecordLengthError> {
    let longest_s = curve.points.iter().fold(0.0_f64, |most, (tau_s, _)| most.max(*tau_s));
    let shortest_s = curve.points.first().map_or(1.0, |(tau_s, _)| *tau_s);
    let most_s = MOST_RECORD_S.min(MOST_ROWS * shortest_s);
    match record_s {
        Some(record_s) if !(2.0 * longest_s..most_s).contains(&record_s) => {
            Err(RecordLengthError { shortest_s, longest_s, record_s })
        }
        Some(record_s) => Ok(known_length(curve, record_s)),
        None => Ok(of_unknown_length(curve)),
    }
}

fn budget(curve: &BareCurve, points: Vec<CurvePoint>, terms: Terms) -> AxisBudget {
    AxisBudget {
        axis: curve.axis,
        rows: 0,
        stretches: 1,
        longest_s: 0.0,
        filled_rows: 0,
        sample_interval_s: 0.0,
        full_overlap_s: None,
        curve: points,
        hadamard: Vec::new(),
        terms,
        misfit: None,
        law_range: None,
        periods: Vec::new(),
        disturbed: None,
        fitted: None,
    }
}

/// With a known record length; the shortest τ serves as the row interval.
fn known_length(curve: &BareCurve, record_s: f64) -> AxisBudget {
    let tau0_s = curve.points.first().map_or(1.0, |(tau_s, _)| *tau_s);
    let mut stretches = Stretches::default();
    stretches.add((record_s / tau0_s).round() as u64 + 1);
    // Points closer than half an octave carry the same information twice.
    let mut last_s = 0.0;
    let mut apart = |tau_s: f64| {
        let apart = tau_s >= APART * last_s;
        last_s = if apart { tau_s } else { last_s };
        apart
    };
    let usable = curve.points.iter().filter(|(tau_s, _)| *tau_s <= record_s / 3.0).filter(|(tau_s, _)| apart(*tau_s));
    let point = |(tau_s, adev): &(f64, f64)| RawPoint {
        m: tau_s / tau0_s,
        variance: adev * adev,
        edf: record_s / tau_s,
        uncertain: 0.0,
    };
    let points: Vec<RawPoint> = usable.map(point).collect();
    let model = Model::of_bare(&points, tau0_s, &stretches);
    let shown = curve.points.iter().map(|(tau_s, adev_dph)| {
        let edf = model.edf(Deviation::Allan, tau_s / tau0_s).filter(|edf| *edf > 0.0);
        let [lower_dph, upper_dph] = interval(adev_dph * adev_dph, edf, CONFIDENCE);
        CurvePoint { tau_s: *tau_s, adev_dph: *adev_dph, lower_dph, upper_dph, n: None, edf }
    });
    let (terms, misfit) = (model.terms(), model.misfit());
    AxisBudget {
        misfit,
        longest_s: record_s,
        sample_interval_s: tau0_s,
        fitted: model.fitted,
        ..budget(curve, shown.collect(), terms)
    }
}

fn of_unknown_length(curve: &BareCurve) -> AxisBudget {
    let point = |(tau_s, adev): &(f64, f64)| Point { tau_s: *tau_s, variance: adev * adev, edf: 1.0 };
    let points: Vec<Point> = curve.points.iter().map(point).collect();
    let fitted = fit_terms(&points, &AllanTerm::ALL).filter(|_| points.len() > 1);
    let terms = fitted.as_ref().map_or_else(
        || Terms::none("a single τ has no slope"),
        |fitted| {
            // A term of the size of rounding errors counts as zero.
            let part = |term: AllanTerm, p: &Point| fitted.coefficient(term) * term.variance(p.tau_s) / p.variance;
            Terms::from_each(|term| match points.iter().map(|p| part(term, p)).fold(0.0, f64::max) {
                ..NO_PART => TermValue::Unresolved { unresolved: "the other terms explain the whole curve".to_owned() },
                _ => TermValue::Found { value: term.in_its_unit(fitted.root(term)), lower: None, upper: None },
            })
        },
    );
    let shown = curve.points.iter().map(|(tau_s, adev_dph)| CurvePoint {
        tau_s: *tau_s,
        adev_dph: *adev_dph,
        lower_dph: None,
        upper_dph: None,
        n: None,
        edf: None,
    });
    AxisBudget { fitted, ..budget(curve, shown.collect(), terms) }
}
