//! A bare curve: τ and σ of an Allan deviation that another program made.
//!
//! Columns `tau_s` and `adev_dph`, `adev_dps` or `adev_radps`, with `_x`, `_y`, `_z` for several axes; others are not
//! read. The curve that `sagnac allan -o` writes is one. A curve does not say how well its points are known: with the
//! length of the record behind it they are taken as those of a full overlap, without it every point weighs the same and
//! terms have no interval.

use std::io::Read;
use std::path::Path;

use crate::allan::budget::{AxisBudget, CurvePoint, Model, TermValue, Terms, interval};
use crate::allan::difference::Deviation;
use crate::allan::freedom::Stretches;
use crate::allan::read::NoiseBudget;
use crate::allan::terms::{Point, Term, fit_terms};
use crate::calibration::Input;
use crate::error::{Error, Result};
use crate::fit::program;
use crate::ingest::{hex, sha256};
use crate::units::{DPH_PER_DPS, DPH_PER_RADPS};

/// Ratio of neighbouring τ that are fitted, at least.
const APART: f64 = 1.4;
/// Where τ stands.
const TAU: &str = "tau_s";
/// Recognised headers of a deviation, and their unit in °/h.
const DEVIATIONS: [(&str, f64); 3] = [("adev_dph", 1.0), ("adev_dps", DPH_PER_DPS), ("adev_radps", DPH_PER_RADPS)];
/// No record is longer: 30,000 years.
const MOST_RECORD_S: f64 = 1e12;
/// Less than this part of σ² at every τ is no term.
const NO_PART: f64 = 1e-6;
/// No curve is longer.
const MAX_BYTES: u64 = 16 << 20;

/// A curve of one axis.
#[derive(Clone, Debug, PartialEq)]
pub struct BareCurve {
    /// Axis letter.
    pub axis: char,
    /// (τ s, deviation °/h), τ rising.
    pub points: Vec<(f64, f64)>,
}

/// A byte order mark, as spreadsheets write it.
const BOM: &[u8] = b"\xef\xbb\xbf";

/// True for text whose first line, but for comments, names τ and a deviation.
pub fn is_curve(start: &[u8]) -> bool {
    let start = start.strip_prefix(BOM).unwrap_or(start);
    let mut lines = start.split(|byte| matches!(byte, b'\n' | b'\r'));
    let line = lines.find(|line| !line.is_empty() && !line.starts_with(b"#")).unwrap_or_default();
    let Ok(line) = std::str::from_utf8(line) else { return false };
    let mut fields = line.split(',').map(str::trim);
    fields.clone().any(|field| field == TAU) && fields.any(|field| column_of(field).is_some())
}

/// Axis and unit of a column of deviations.
fn column_of(header: &str) -> Option<(char, f64)> {
    DEVIATIONS.iter().find_map(|(name, unit)| match header.strip_prefix(name)? {
        "" => Some(('x', *unit)),
        rest => {
            let mut letters = rest.strip_prefix('_')?.chars();
            let letter = letters.next().filter(char::is_ascii_lowercase)?;
            letters.next().is_none().then_some((letter, *unit))
        }
    })
}

/// Reads a curve.
///
/// # Errors
/// No curve, a cell that is no number above zero, τ that do not rise.
pub fn read_curve(path: &Path) -> Result<(Vec<BareCurve>, Input)> {
    let name = path.display().to_string();
    let file = std::fs::File::open(path).map_err(|e| Error::io_path(path, "open", &e))?;
    let mut bytes = Vec::new();
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(|e| Error::io_path(path, "read", &e))?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(Error::input("too large for a curve").file(name));
    }
    let curves = parse_curve(&bytes).map_err(|e| e.file(&name))?;
    let rows = curves.iter().map(|curve| curve.points.len()).max().unwrap_or(0) as u64;
    Ok((curves, Input { file: crate::write::file_name(&name), sha256: hex(&sha256(&bytes)), rows }))
}

/// Reads the text of a curve.
///
/// # Errors
/// As [`read_curve`].
pub fn parse_curve(text: &[u8]) -> Result<Vec<BareCurve>> {
    let mut csv = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(text.strip_prefix(BOM).unwrap_or(text));
    let unread = |e: &csv::Error| Error::input(format!("not a readable table: {e}"));
    let headers = csv.headers().map_err(|e| unread(&e))?.clone();
    let tau = headers.iter().position(|header| header == TAU);
    let tau =
        tau.ok_or_else(|| Error::input("no column `tau_s`").help("a curve has the columns tau_s and adev_dph"))?;
    let columns: Vec<(usize, char, f64)> = headers
        .iter()
        .enumerate()
        .filter_map(|(index, header)| column_of(header).map(|(axis, unit)| (index, axis, unit)))
        .collect();
    for (index, (_, axis, _)) in columns.iter().enumerate() {
        if columns[..index].iter().any(|(_, other, _)| other == axis) {
            return Err(Error::input(format!("two columns of axis {axis}")).help("name them adev_dph_x, adev_dph_y …"));
        }
    }
    let mut curves: Vec<BareCurve> =
        columns.iter().map(|(_, axis, _)| BareCurve { axis: *axis, points: Vec::new() }).collect();
    for record in csv.records() {
        let record = record.map_err(|e| unread(&e))?;
        let line = record.position().map_or(0, csv::Position::line);
        let value = |index: usize| {
            let cell = record.get(index).unwrap_or_default();
            let number = cell.parse().ok().filter(|v: &f64| v.is_finite() && *v > 0.0);
            let column = headers.get(index).unwrap_or_default();
            number.ok_or_else(|| Error::input("must be a number above zero").line(line).column(column).value(cell))
        };
        let tau_s = value(tau)?;
        for ((index, _, unit), curve) in columns.iter().zip(&mut curves) {
            if record.get(*index).is_some_and(str::is_empty) {
                continue;
            }
            if curve.points.last().is_some_and(|(last, _)| *last >= tau_s) {
                return Err(Error::input("τ must rise from line to line").line(line).column(TAU));
            }
            curve.points.push((tau_s, value(*index)? * unit));
        }
    }
    if curves.iter().all(|curve| curve.points.is_empty()) {
        return Err(Error::input("a curve without points").help("give rows of tau_s and adev_dph"));
    }
    Ok(curves)
}

/// The five terms of bare curves; `record_s` is the length of the record behind them, if it is known.
///
/// # Errors
/// A record too short for the curve's longest τ, or longer than any.
pub fn budget_of_curves(curves: &[BareCurve], record_s: Option<f64>, input: Input) -> Result<NoiseBudget> {
    let longest_s = curves.iter().flat_map(|curve| &curve.points).fold(0.0_f64, |most, (tau_s, _)| most.max(*tau_s));
    if let Some(seconds) = record_s
        && !(2.0 * longest_s..MOST_RECORD_S).contains(&seconds)
    {
        return Err(Error::input(format!(
            "a record with a deviation at τ = {longest_s} s has at least twice that length"
        ))
        .column("--record")
        .value(seconds.to_string()));
    }
    let axes = curves.iter().map(|curve| match record_s {
        Some(record_s) => known_length(curve, record_s),
        None => of_unknown_length(curve),
    });
    let axes: Vec<AxisBudget> = axes.collect();
    Ok(NoiseBudget {
        warnings: axes.iter().filter_map(AxisBudget::misfit_text).collect(),
        axes,
        detrended: false,
        excluded: Vec::new(),
        inputs: vec![input],
        program: program(),
    })
}

fn budget(curve: &BareCurve, points: Vec<CurvePoint>, terms: Terms) -> AxisBudget {
    AxisBudget {
        axis: curve.axis,
        rows: 0,
        stretches: 1,
        longest_s: 0.0,
        sample_interval_s: 0.0,
        full_overlap_s: None,
        curve: points,
        hadamard: Vec::new(),
        terms,
        misfit: None,
        fitted: None,
    }
}

/// The shortest τ stands for the interval of a row.
fn known_length(curve: &BareCurve, record_s: f64) -> AxisBudget {
    let tau0_s = curve.points.first().map_or(1.0, |(tau_s, _)| *tau_s);
    let mut stretches = Stretches::default();
    stretches.add((record_s / tau0_s).round() as u64 + 1);
    // Points nearer to each other than half an octave tell the same twice.
    let mut last_s = 0.0;
    let mut apart = |tau_s: f64| {
        let apart = tau_s >= APART * last_s;
        last_s = if apart { tau_s } else { last_s };
        apart
    };
    let usable = curve.points.iter().filter(|(tau_s, _)| *tau_s <= record_s / 3.0).filter(|(tau_s, _)| apart(*tau_s));
    let points = usable.map(|(tau_s, adev)| (tau_s / tau0_s, adev * adev, record_s / tau_s));
    let model = Model::new(points.collect(), tau0_s, &stretches);
    let shown = curve.points.iter().map(|(tau_s, adev_dph)| {
        let edf = model.edf(Deviation::Allan, tau_s / tau0_s).filter(|edf| *edf > 0.0);
        let [lower_dph, upper_dph] = interval(adev_dph * adev_dph, edf);
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
    let fitted = fit_terms(&points, &Term::ALL).filter(|_| points.len() > 1);
    let terms = fitted.as_ref().map_or_else(
        || Terms::none("a single τ tells no slope"),
        |fitted| {
            // A rounding's worth of a term is none.
            let part = |term: Term, p: &Point| fitted.coefficient(term) * term.variance(p.tau_s) / p.variance;
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
