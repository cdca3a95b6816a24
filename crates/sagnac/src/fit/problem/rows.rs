//! One axis as a least-squares problem.
//!
//! ```text
//! y = C_run + Σ bᵢ·[T̄ᵢ − Tᵢ(x0)] + Σ cⱼ·mean(Ṫ·Tⱼ) − Ω_run·1e-6·Σ e_k·[T̄_k − T_k(x0)]       °/h
//! ```
//!
//! with the same sums over every other input (its own x, its own Ṫ with its own lag), and with zones and steps
//! ([`crate::model::input`]).
//!
//! y is the mean rate of a window, Ω_run the mean rate of its run: with one input rate per run that is
//! the model of the target to first order in ε. On a rate table (see [`crate::rate_table::input`]) it is exact instead:
//!
//! ```text
//! y − Ω_table = C + δ·Ω_across − y·1e-6·{ε0 + Σ e_k·[T̄_k − T_k(x0)]} + Σ bᵢ·[…] + Σ cⱼ·mean(…)
//! ```
//!
//! with ε0 the deviation of the scale factor at T0 and δ the misalignment towards another axis that was turned. C is one
//! constant per run where every run was turned at several rates, otherwise one for all: a run at a single rate does not
//! separate its constant from ε0.

use crate::fit::problem::axis::Axis;
use crate::fit::problem::exclusions::{check_moves, check_span, no_window};
use crate::fit::problem::lag::{LagRate, LagTrack, Stretches, stretches};
use crate::fit::problem::levels::Level;
use crate::fit::problem::rate_columns::{KnownRates, RateRows};
use crate::fit::progress::Progress;
use crate::model::basis::Span;
use crate::model::input::{SampledInput, Signal, knots};
use crate::model::spec::ModelSpec;
use crate::model::{ActsOn, Form, InputTerms};
use crate::noise_model::processes::NoiseRows;
use crate::rate_table::input::RateTableInput;
use crate::window::Windows;
use sagnac_log::error::{Error, Result};
use sagnac_units::s_from_ns;
use std::ops::Range;
use std::sync::OnceLock;

/// Span of rates for which a correction holds, over what the fit saw.
const RATE_MARGIN: f64 = 1.5;
/// Number of τ in the grid, before the refinement.
const TAU_STEPS: usize = 24;

/// The used windows of one axis.
pub(crate) struct AxisRows<'a> {
    windows: &'a Windows,
    /// Inputs of the terms; the first is the thermometer of the fit. Where a rate can be had, all of them follow once more, for a
    /// second lag.
    pub(crate) inputs: Vec<SampledInput>,
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
    /// Mean rate of each run, °/h.
    pub(crate) run_rate: Vec<f64>,
    /// Middle of each row's window, h since the first row of its run; and the weighted mean of each run.
    time_h: Vec<f64>,
    mean_time_h: Vec<f64>,
    /// The same middle, s since the start of its run.
    middle_s: Vec<f64>,
    /// Rates of the table, where the axis was on one.
    pub(crate) turning: Option<RateTableInput>,
    /// Told what is being done.
    pub(crate) progress: Progress,
    known_rates: KnownRates,
    /// Per input and run: its temperatures in stretches where these are few, from when they are first needed.
    tracks: Vec<OnceLock<Vec<Option<Stretches>>>>,
    /// Per run: start and end of each row's window, s from the start of the run.
    bounds: Vec<Vec<(f64, f64)>>,
    /// Rates that the tests behind a prior covered, °C/min: of the thermometer of the fit, then of its repeat.
    rate_spans: Vec<[f64; 2]>,
    has_prior: bool,
}

/// A term of a model on the rows of a problem.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TermColumn {
    /// Index among the problem's inputs.
    pub(crate) input: usize,
    pub(crate) form: Form,
}

/// Means of Ṫ·T₀ … Ṫ·T₃ of every row, per input; nothing for inputs without a rate term.
pub(crate) type Rates = Vec<RateRows>;

impl<'a> AxisRows<'a> {
    /// The windows in which all of `signals` are known; the first of them is the thermometer of the fit.
    ///
    /// # Errors
    /// No such window; too small a span, T0 outside it; an axis that does not move.
    pub(crate) fn new(axis: &Axis<'a>, signals: &[Signal]) -> Result<Self> {
        let windows = axis.windows;
        let rows = &windows.rows;
        let known = |i: &usize| signals.iter().all(|signal| signal.in_window(windows, *i).0.is_finite());
        let used: Vec<usize> = (0..windows.len()).filter(|i| rows.excluded[*i].is_none() && known(i)).collect();
        if used.is_empty() {
            return Err(no_window(windows));
        }
        let inputs = sampled(axis, signals, &used)?;
        let mut runs: Vec<usize> = used.iter().map(|i| rows.run[*i] as usize).collect();
        let all_runs = runs.clone();
        runs.dedup();
        let run: Vec<usize> = all_runs.iter().map(|r| runs.binary_search(r).unwrap_or(0)).collect();
        let along = |i: &usize| axis.turning.as_ref().map_or(0.0, |turning| turning.along_dph[*i]);
        let y: Vec<f64> = used.iter().map(|i| windows.rate_dph(axis.index, *i) - along(i)).collect();
        let by_row = windows.shape.window.seconds().is_none();
        let weight: Vec<f64> =
            used.iter().map(|i| if by_row { 1.0 } else { windows.duration_s(*i) / windows.shape.nominal_s }).collect();
        let mean_of_runs = |values: &[f64]| -> Vec<f64> {
            let mut sums = vec![(0.0, 0.0); runs.len()];
            for ((r, value), w) in run.iter().zip(values).zip(&weight) {
                sums[*r].0 += w * value;
                sums[*r].1 += w;
            }
            sums.iter().map(|(sum, weight)| sum / weight).collect()
        };
        let run_rate = mean_of_runs(&y);
        let since_start_h = |i: &usize| {
            let middle_ns = i64::midpoint(rows.start_ns[*i], rows.end_ns[*i]);
            s_from_ns(middle_ns - windows.runs[rows.run[*i] as usize].start_ns) / 3600.0
        };
        let time_h: Vec<f64> = used.iter().map(since_start_h).collect();
        let middle_s = used.iter().map(|i| windows.middle_s(*i)).collect();
        let mean_time_h = mean_of_runs(&time_h);
        let tracks = inputs.iter().map(|_| OnceLock::new()).collect();
        let mut bounds = vec![Vec::new(); runs.len()];
        for (i, run) in used.iter().zip(&run) {
            let origin_ns = windows.runs[runs[*run]].start_ns;
            bounds[*run].push([rows.start_ns[*i], rows.end_ns[*i]].map(|ns| s_from_ns(ns - origin_ns)).into());
        }
        let known_rates = axis.common.of(&used);
        Ok(Self {
            windows,
            inputs,
            used,
            y,
            weight,
            run,
            runs,
            run_rate,
            time_h,
            mean_time_h,
            middle_s,
            turning: axis.turning.clone(),
            progress: axis.progress.clone(),
            known_rates,
            tracks,
            bounds,
            has_prior: axis.prior.is_some(),
            rate_spans: axis.prior.map_or_else(Vec::new, |prior| prior.rate_spans_cpm.clone()),
        })
    }

    /// The span of the thermometer of the fit.
    pub(crate) fn span(&self) -> Span {
        self.inputs[0].span
    }

    /// Place of the input of this name, not of a repeat.
    pub(crate) fn input(&self, name: &str) -> Option<usize> {
        self.inputs.iter().position(|input| input.name == name && input.repeats.is_none())
    }

    /// Inputs other than the thermometer of the fit, each once.
    pub(crate) fn others(&self) -> &[SampledInput] {
        let own = self.inputs.iter().take_while(|input| input.repeats.is_none()).count();
        &self.inputs[1..own]
    }

    /// The thermometer of the fit, or its repeat.
    pub(crate) fn is_main(&self, input: usize) -> bool {
        input == 0 || self.inputs[input].repeats == Some(0)
    }

    /// Place of the repeat of an input.
    pub(crate) fn repeat_of(&self, input: usize) -> Option<usize> {
        self.inputs.iter().position(|other| other.repeats == Some(input))
    }

    /// The terms of a model, in the order of its parameters, without those of inputs that the problem does not have.
    pub(crate) fn terms(&self, spec: &ModelSpec) -> Vec<TermColumn> {
        let known = spec.inputs().iter().filter_map(|terms| Some((self.index_of(terms)?, terms)));
        let of_input = |(input, of): (usize, &InputTerms)| {
            let sampled = &self.inputs[input];
            let forms = of.forms(&knots(of.zones, sampled.span), &sampled.thresholds());
            let slow = of.slow_forms().filter_map(|form| Some(TermColumn { input: self.repeat_of(input)?, form }));
            forms.into_iter().map(move |form| TermColumn { input, form }).chain(slow).collect::<Vec<_>>()
        };
        known.flat_map(of_input).collect()
    }

    /// Index of the input of some terms; the thermometer of the fit is the first.
    pub(crate) fn index_of(&self, terms: &InputTerms) -> Option<usize> {
        if terms.input.is_empty() { Some(0) } else { self.input(&terms.input) }
    }

    /// Indices of the inputs whose lag a model needs; a repeat follows what it repeats.
    pub(crate) fn rated(&self, spec: &ModelSpec) -> Vec<usize> {
        let of_terms = |of: &InputTerms| {
            let at = self.index_of(of);
            let slow = at.and_then(|at| self.repeat_of(at)).filter(|_| of.slow_rate.is_some());
            at.filter(|_| of.rate.is_some()).into_iter().chain(slow)
        };
        spec.inputs().iter().flat_map(of_terms).collect()
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
        let ratio = (self.longest_run_s() / 4.0 / lo).max(1.0).ln() / (TAU_STEPS - 1) as f64;
        let grid: Vec<f64> = (0..TAU_STEPS).map(|i| lo * (ratio * i as f64).exp()).collect();
        if ratio > 0.0 { grid } else { vec![lo] }
    }

    pub(crate) fn longest_run_s(&self) -> f64 {
        self.runs.iter().map(|r| self.windows.runs[*r].length_s()).fold(0.0, f64::max)
    }

    /// The rows as noise runs through them.
    pub(crate) fn noise_rows(&self) -> NoiseRows<'_> {
        let (longest_s, nominal_s) = (self.longest_run_s(), self.windows.shape.nominal_s);
        NoiseRows { run: &self.run, middle_s: &self.middle_s, weight: &self.weight, longest_s, nominal_s }
    }

    /// Δt, s.
    pub(crate) fn period_s(&self) -> f64 {
        s_from_ns(self.windows.shape.period_ns)
    }

    /// The windows behind it.
    pub(crate) fn windows(&self) -> &'a Windows {
        self.windows
    }

    fn lag(&self, input: usize, run: usize, tau_s: f64) -> LagRate<'_> {
        let SampledInput { signal, span, .. } = &self.inputs[input];
        let tracks = || self.runs.iter().map(|run| stretches(&signal.track(self.windows, *run))).collect();
        let track = match &self.tracks[self.source(input)].get_or_init(tracks)[run] {
            Some(kept) => LagTrack::Stretches(kept),
            None => LagTrack::Points(signal.track(self.windows, self.runs[run])),
        };
        LagRate { track, span: *span, period_s: self.period_s(), tau_s }
    }

    /// The input whose track and span this one has.
    fn source(&self, input: usize) -> usize {
        self.inputs[input].repeats.unwrap_or(input)
    }

    /// Rows of one run; rows stand run by run.
    pub(crate) fn rows_of(&self, run: usize) -> Range<usize> {
        self.run.partition_point(|other| *other < run)..self.run.partition_point(|other| *other <= run)
    }

    /// Means of Ṫ·T₀ … Ṫ·T₃ of every row, °C/min.
    pub(crate) fn rate_columns(&self, input: usize, tau_s: f64) -> RateRows {
        let input = self.source(input);
        self.known_rates.find(&self.inputs[input], tau_s).unwrap_or_else(|| {
            let rows = self.computed_rates(input, tau_s);
            if self.tau_grid().contains(&tau_s) {
                self.known_rates.keep(&self.inputs[input], tau_s, &rows);
            }
            rows
        })
    }

    fn computed_rates(&self, input: usize, tau_s: f64) -> RateRows {
        (0..self.runs.len()).flat_map(|run| self.lag(input, run, tau_s).means(&self.bounds[run])).collect()
    }

    /// The rate columns of the inputs that have a τ.
    pub(crate) fn rates(&self, taus_s: &[(usize, f64)]) -> Rates {
        let mut rates: Rates = vec![RateRows::default(); self.inputs.len()];
        taus_s.iter().for_each(|(input, tau_s)| rates[*input] = self.rate_columns(*input, *tau_s));
        rates
    }

    /// Lowest and highest Ṫ that the used windows hold, °C/min, and half as much again: two steps of a thermometer may fall
    /// together, and a chamber ramps a little faster another time. 0 is always within.
    pub(crate) fn rate_span(&self, input: usize, tau_s: f64) -> [f64; 2] {
        let of_runs = (0..self.runs.len()).map(|run| self.lag(input, run, tau_s).extremes(&self.bounds[run]));
        let own = of_runs.fold([0.0, 0.0], |[lo, hi], [l, h]| [l.min(lo), h.max(hi)]).map(|far| RATE_MARGIN * far);
        let of_prior = self.is_main(input).then(|| self.rate_spans.get(usize::from(input > 0))).flatten();
        of_prior.map_or(own, |known| [own[0].min(known[0]), own[1].max(known[1])])
    }

    /// −Ω_run·1e-6·[T̄_k − T_k(x0)], °/h per ppm.
    pub(crate) fn scale_column(&self, input: usize, row: usize, order: usize) -> f64 {
        -self.turned_dph(row) * 1e-6 * self.inputs[input].basis[row][order]
    }

    /// The rate that the scale factor scales: as measured in the window on a table, else that of the run.
    pub(crate) fn turned_dph(&self, row: usize) -> f64 {
        match &self.turning {
            Some(turning) => self.y[row] + turning.along_dph[self.used[row]],
            None => self.run_rate[self.run[row]],
        }
    }

    /// Time of a row since the start of its run, s.
    pub(crate) fn since_start_s(&self, row: usize) -> f64 {
        3600.0 * self.time_h[row]
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
            Level::Drift(run) => {
                let is_of_it = run.is_none_or(|run| run == self.run[row]);
                if is_of_it { self.time_h[row] - self.mean_time_h[self.run[row]] } else { 0.0 }
            }
            Level::WarmUp { tau_s } => (-self.since_start_s(row) / tau_s).exp(),
        }
    }

    /// Something is known of the unit before its test.
    pub(crate) fn has_prior(&self) -> bool {
        self.has_prior
    }

    /// The regressor of a term on one row; `rates` from [`Self::rates`].
    pub(crate) fn regressor(&self, term: &TermColumn, row: usize, rates: &Rates) -> f64 {
        let TermColumn { input, form } = *term;
        let mean = if form.times_rate {
            // Means of Ṫ times a polynomial are summed along the track, not from the moments of the window. No model of the fit
            // multiplies another shape with the rate.
            let rate = rates[input].get(row);
            form.shape.order().map_or(f64::NAN, |order| rate.and_then(|rate| rate.get(order)).copied().unwrap_or(0.0))
        } else {
            self.inputs[input].mean(form.shape, row)
        };
        match form.acts_on {
            ActsOn::Bias => mean,
            ActsOn::ScaleFactor => -self.turned_dph(row) * 1e-6 * mean,
        }
    }
}

/// The inputs of some signals over these windows, each once more for a second lag where a rate can be had.
fn sampled(axis: &Axis<'_>, signals: &[Signal], used: &[usize]) -> Result<Vec<SampledInput>> {
    let Axis { windows, reference_c, min_span_c, .. } = *axis;
    let mut inputs: Vec<SampledInput> =
        signals.iter().map(|signal| SampledInput::new(*signal, windows, used, reference_c)).collect();
    if let Some(prior) = axis.prior {
        inputs[0] = SampledInput::over(signals[0], windows, used, reference_c, prior.span_c);
    } else {
        check_span(windows, inputs[0].span, min_span_c)?;
    }
    check_moves(windows, axis.index)?;
    let span = inputs[0].span;
    if !(span.lo..=span.hi).contains(&reference_c) {
        return Err(Error::refused(
            format!(
                "the reference temperature {reference_c} °C lies outside the span of the data, {:.2} … {:.2} °C",
                span.lo, span.hi
            ),
            "set --reference to a temperature in this range",
        )
        .column("reference_c"));
    }
    if windows.shape.timed {
        inputs.extend(SampledInput::repeated(&inputs));
    }
    Ok(inputs)
}
