//! One axis as a least-squares problem.
//!
//! ```text
//! y = C_run + Σ bᵢ·[T̄ᵢ − Tᵢ(x0)] + Σ cⱼ·mean(Ṫ·Tⱼ) − Ω_run·1e-6·Σ e_k·[T̄_k − T_k(x0)]       °/h
//! ```
//!
//! y is the mean rate of a window, Ω_run the mean rate of its run: with one input rate per run that is
//! the model of the target to first order in ε.

use crate::error::{Error, Result};
use crate::fit::basis::{BASIS_LEN, Span, chebyshev, chebyshev_mean};
use crate::fit::lag::{LagRate, RATE_COLUMNS};
use crate::fit::model::ModelSpec;
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
}

impl<'a> Problem<'a> {
    pub(crate) fn new(
        windows: &'a Windows,
        axis: usize,
        sensor: usize,
        reference_c: f64,
        min_span_c: f64,
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
        let y: Vec<f64> = used.iter().map(|i| windows.rate_dph(axis, *i)).collect();
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
        Ok(Self { windows, sensor, span, used, y, weight, run, runs, bias, run_rate })
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
        -self.run_rate[self.run[row]] * 1e-6 * self.bias[row][order]
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
