//! One axis as a least-squares problem.
//!
//! ```text
//! y = C_run + Σ bᵢ·[T̄ᵢ − Tᵢ(x0)] + Σ cⱼ·mean(Ṫ·Tⱼ) − Ω_run·1e-6·Σ e_k·[T̄_k − T_k(x0)]       °/h
//! ```
//!
//! y is the mean rate of a window, Ω_run the mean rate of its run: with one input rate per run that is
//! the model of the target to first order in ε. On a rate table (see [`super::turning`]) it is exact instead:
//!
//! ```text
//! y − Ω_table = C + δ·Ω_across − y·1e-6·{ε0 + Σ e_k·[T̄_k − T_k(x0)]} + Σ bᵢ·[…] + Σ cⱼ·mean(…)
//! ```
//!
//! with ε0 the deviation of the scale factor at T0 and δ the misalignment towards another axis that was turned. C is one
//! constant per run where every run was turned at several rates, else one for all: a run at a single rate cannot tell
//! its constant from ε0.

use crate::calibration::Plateau;
use crate::error::{Error, Result};
use crate::fit::basis::{BASIS_LEN, Span, chebyshev, chebyshev_mean};
use crate::fit::lag::{LagRate, RATE_COLUMNS};
use crate::fit::model::ModelSpec;
use crate::fit::plateaus::plateaus_of;
use crate::fit::turning::Turning;
use crate::units::s_from_ns;
use crate::window::Windows;

/// Number of τ tried before the last refinement.
const TAU_STEPS: usize = 24;

/// The used windows of one axis.
pub(crate) struct Problem<'a> {
    windows: &'a Windows,
    sensor: usize,
    pub(crate) span: Span,
    /// Window of each row.
    pub(crate) used: Vec<usize>,
    /// Rate, °/h.
    pub(crate) y: Vec<f64>,
    /// Weight; 1 for a window of nominal length.
    pub(crate) weight: Vec<f64>,
    /// Index into `runs`.
    pub(crate) run: Vec<usize>,
    /// Runs that have windows.
    pub(crate) runs: Vec<usize>,
    /// T̄ᵢ − Tᵢ(x0).
    pub(crate) bias: Vec<[f64; BASIS_LEN]>,
    /// Mean rate of each run, °/h.
    pub(crate) run_rate: Vec<f64>,
    /// Columns before the terms of a model.
    pub(crate) levels: Vec<Level>,
    /// What the axis was turned by, where a table did.
    pub(crate) turning: Option<Turning>,
}

/// A column that stands before the terms: part of the fit, never of the correction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Level {
    /// Constant of a run (index into `runs`), °/h.
    Run(usize),
    /// One constant for all runs, °/h.
    AllRuns,
    /// ε0: the scale factor at T0, ppm.
    Scale,
    /// Misalignment towards an axis, rad.
    Across(char),
}

impl Level {
    /// Its name in the covariance.
    pub(crate) fn name(self, runs: &[usize]) -> String {
        match self {
            Self::Run(index) => format!("constant {}", runs.get(index).copied().unwrap_or(index)),
            Self::AllRuns => "constant".to_owned(),
            Self::Scale => "scale 0".to_owned(),
            Self::Across(letter) => format!("misalignment {letter}"),
        }
    }
}

impl<'a> Problem<'a> {
    pub(crate) fn new(
        windows: &'a Windows,
        axis: usize,
        sensor: usize,
        reference_c: f64,
        min_span_c: f64,
        turning: Option<Turning>,
    ) -> Result<Self> {
        let rows = &windows.rows;
        let used: Vec<usize> = (0..windows.len()).filter(|i| rows.excluded[*i].is_none()).collect();
        if used.is_empty() {
            return Err(no_window(windows));
        }
        let span = span_of(windows, sensor, &used, min_span_c)?;
        if !(span.lo_c..=span.hi_c).contains(&reference_c) {
            return Err(Error::refused(format!(
                "the reference temperature {reference_c} °C lies outside the span of the data, {:.2} … {:.2} °C",
                span.lo_c, span.hi_c
            ))
            .column("reference_c")
            .help("give --reference a temperature within the span"));
        }
        let mut runs: Vec<usize> = used.iter().map(|i| rows.run[*i] as usize).collect();
        let all_runs = runs.clone();
        runs.dedup();
        let run: Vec<usize> = all_runs.iter().map(|r| runs.binary_search(r).unwrap_or(0)).collect();
        let at_reference = chebyshev(span.x(reference_c));
        let bias = used.iter().map(|&i| {
            let variance = rows.variance_c2[sensor][i] * span.slope().powi(2);
            let mean = chebyshev_mean(span.x(rows.mean_c[sensor][i]), variance);
            std::array::from_fn(|n| mean[n] - at_reference[n])
        });
        let along = |i: &usize| turning.as_ref().map_or(0.0, |turning| turning.along_dph[*i]);
        let y: Vec<f64> = used.iter().map(|i| windows.rate_dph(axis, *i) - along(i)).collect();
        let by_row = windows.shape.window.seconds().is_none();
        let weight: Vec<f64> =
            used.iter().map(|i| if by_row { 1.0 } else { windows.duration_s(*i) / windows.shape.nominal_s }).collect();
        let mut sums = vec![(0.0, 0.0); runs.len()];
        for ((r, y), w) in run.iter().zip(&y).zip(&weight) {
            sums[*r].0 += w * y;
            sums[*r].1 += w;
        }
        let run_rate = sums.iter().map(|(sum, weight)| sum / weight).collect();
        let bias = bias.collect();
        let levels = levels(turning.as_ref(), &used, &run, runs.len());
        Ok(Self { windows, sensor, span, used, y, weight, run, runs, bias, run_rate, levels, turning })
    }

    pub(crate) fn len(&self) -> usize {
        self.y.len()
    }

    /// True where a temperature rate can be had.
    pub(crate) fn has_rate(&self) -> bool {
        self.windows.shape.timed
    }

    /// τ from Δt to a quarter of the longest run, in equal ratios.
    pub(crate) fn tau_grid(&self) -> Vec<f64> {
        let lo = s_from_ns(self.windows.shape.period_ns);
        let longest = self.runs.iter().map(|r| self.windows.runs[*r].length_s()).fold(0.0, f64::max);
        let ratio = (longest / 4.0 / lo).max(1.0).ln() / (TAU_STEPS - 1) as f64;
        let grid: Vec<f64> = (0..TAU_STEPS).map(|i| lo * (ratio * i as f64).exp()).collect();
        if ratio > 0.0 { grid } else { vec![lo] }
    }

    fn lag(&self, run: usize, tau_s: f64) -> LagRate<'_> {
        let track_c = &self.windows.runs[self.runs[run]].tracks[self.sensor];
        LagRate { track_c, span: self.span, period_s: s_from_ns(self.windows.shape.period_ns), tau_s }
    }

    /// Start and end of each row's window of one run, s from the start of the run.
    fn bounds(&self, of: usize) -> Vec<(f64, f64)> {
        let origin_ns = self.windows.runs[self.runs[of]].start_ns;
        let seconds = |ns: i64| s_from_ns(ns - origin_ns);
        let members = self.used.iter().zip(&self.run).filter(|(_, run)| **run == of);
        members.map(|(i, _)| (seconds(self.windows.rows.start_ns[*i]), seconds(self.windows.rows.end_ns[*i]))).collect()
    }

    /// Means of Ṫ·T₀ … Ṫ·T₃ of every row, °C/min. Rows stand run by run.
    pub(crate) fn rate_columns(&self, tau_s: f64) -> Vec<[f64; RATE_COLUMNS]> {
        (0..self.runs.len()).flat_map(|run| self.lag(run, tau_s).means(&self.bounds(run))).collect()
    }

    /// Lowest and highest Ṫ that the used windows hold, °C/min; 0 is always within.
    pub(crate) fn rate_span(&self, tau_s: f64) -> [f64; 2] {
        let of_runs = (0..self.runs.len()).map(|run| self.lag(run, tau_s).extremes(&self.bounds(run)));
        of_runs.fold([0.0, 0.0], |[lo, hi], [l, h]| [l.min(lo), h.max(hi)])
    }

    /// −Ω_run·1e-6·[T̄_k − T_k(x0)], °/h per ppm.
    pub(crate) fn scale_column(&self, row: usize, order: usize) -> f64 {
        -self.turned_dph(row) * 1e-6 * self.bias[row][order]
    }

    /// The rate that the scale factor scales: as measured in the window on a table, else that of the run.
    fn turned_dph(&self, row: usize) -> f64 {
        match &self.turning {
            Some(turning) => self.y[row] + turning.along_dph[self.used[row]],
            None => self.run_rate[self.run[row]],
        }
    }

    /// One row of the columns before the terms.
    pub(crate) fn level(&self, row: usize, level: Level) -> f64 {
        match level {
            Level::Run(run) => f64::from(u8::from(run == self.run[row])),
            Level::AllRuns => 1.0,
            Level::Scale => -self.turned_dph(row) * 1e-6,
            Level::Across(letter) => {
                let across = self.turning.as_ref().map(|turning| turning.across_dph[self.used[row]]);
                across.filter(|(turned, _)| *turned == letter).map_or(0.0, |(_, rate)| rate)
            }
        }
    }

    /// The plateaus of the axis, where a table turned it.
    pub(crate) fn plateaus(&self, axis: usize) -> Option<Vec<Plateau>> {
        Some(plateaus_of(self.windows, &self.used, axis, self.sensor, self.turning.as_ref()?))
    }

    /// Place of a level among the parameters.
    pub(crate) fn place_of(&self, level: Level) -> Option<usize> {
        self.levels.iter().position(|other| *other == level)
    }

    /// The regressors of a model on one row, without the constant; `rate` from [`Self::rate_columns`].
    pub(crate) fn regressors(&self, spec: ModelSpec, row: usize, rate: &[f64; RATE_COLUMNS], out: &mut Vec<f64>) {
        out.extend_from_slice(&self.bias[row][1..=usize::from(spec.bias)]);
        if let Some(order) = spec.rate {
            out.extend_from_slice(&rate[..=usize::from(order)]);
        }
        out.extend((1..=usize::from(spec.scale)).map(|k| self.scale_column(row, k)));
    }
}

/// The columns before the terms.
fn levels(turning: Option<&Turning>, used: &[usize], run: &[usize], runs: usize) -> Vec<Level> {
    let Some(turning) = turning else { return (0..runs).map(Level::Run).collect() };
    let of_run = |index: usize| used.iter().zip(run).filter(move |(_, run)| **run == index).map(|(i, _)| *i);
    let along = turning.rates(used.iter().copied()).len() > 1;
    let each_tells = (0..runs).all(|index| turning.rates(of_run(index)).len() > 1);
    let mut levels: Vec<Level> =
        if each_tells || !along { (0..runs).map(Level::Run).collect() } else { vec![Level::AllRuns] };
    if along {
        levels.push(Level::Scale);
    }
    let mut across: Vec<char> = used
        .iter()
        .map(|i| turning.across_dph[*i])
        .filter(|(_, rate)| rate.is_finite() && *rate != 0.0)
        .map(|(letter, _)| letter)
        .collect();
    across.sort_unstable();
    across.dedup();
    levels.extend(across.into_iter().map(Level::Across));
    levels
}

/// Says why nothing is left, the commonest reason first.
fn no_window(windows: &Windows) -> Error {
    let why = most_left_out(windows).unwrap_or("it holds no usable row".to_owned());
    Error::refused(format!("no window of the log can be used: {why}"))
        .help("`sagnac inspect` lists everything left out")
}

/// The reason for which most rows are left out, in words.
fn most_left_out(windows: &Windows) -> Option<String> {
    let most = windows.tallies.most()?;
    Some(format!("{} rows are left out as {} (first at {})", most.rows, most.reason.name(), most.first))
}

/// Lowest to highest sample of the used windows.
fn span_of(windows: &Windows, sensor: usize, used: &[usize], min_span_c: f64) -> Result<Span> {
    let lo_c = used.iter().map(|i| windows.rows.min_c[sensor][*i]).fold(f64::INFINITY, f64::min);
    let hi_c = used.iter().map(|i| windows.rows.max_c[sensor][*i]).fold(f64::NEG_INFINITY, f64::max);
    if hi_c - lo_c < min_span_c {
        return Err(Error::refused(format!(
            "the data span {:.2} °C ({lo_c:.2} … {hi_c:.2} °C); a fit needs {min_span_c} °C{}",
            hi_c - lo_c,
            most_left_out(windows).map_or(String::new(), |why| format!("; {why}"))
        ))
        .column("min_span_c")
        .help("test over a wider range, or lower --min-span if you know what you do"));
    }
    Ok(Span::on_grid(lo_c, hi_c))
}
