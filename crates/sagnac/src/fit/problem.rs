//! One axis as a least-squares problem.
//!
//! ```text
//! y = C_run + Σ bᵢ·[T̄ᵢ − Tᵢ(x0)] + Σ cⱼ·mean(Ṫ·Tⱼ) − Ω_run·1e-6·Σ e_k·[T̄_k − T_k(x0)]       °/h
//! ```
//!
//! with the same sums over every further input (another x, another Ṫ of its own lag), and zones and steps beside them
//! ([`super::input`]).
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
use crate::calibration::TermKind;
use crate::fit::lag::{LagRate, RATE_COLUMNS};
use crate::fit::plateaus::plateaus_of;
use crate::fit::turning::Turning;
use crate::model::basis::Span;
use crate::model::input::{Input, Source, knots};
use crate::model::spec::{FurtherTerms, ModelSpec};
use crate::window::Windows;
use sagnac_log::error::{Error, Result};
use sagnac_units::s_from_ns;

/// Number of τ tried before the last refinement.
const TAU_STEPS: usize = 24;

/// The used windows of one axis.
pub(crate) struct Problem<'a> {
    windows: &'a Windows,
    /// What terms may be functions of; the first is the thermometer of the fit.
    pub(crate) inputs: Vec<Input>,
    /// Per input: the first τ of the grid that is tried. Raised where a thermometer's noise asks for more.
    pub(crate) tau_from: Vec<usize>,
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

/// A term of a model on a problem.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TermPlace {
    /// Place among the problem's inputs.
    pub(crate) input: usize,
    pub(crate) kind: TermKind,
    pub(crate) order: u8,
    /// Where a zone or a step begins: x of the knot, or the threshold in the input's unit.
    pub(crate) at: Option<f64>,
}

/// Means of Ṫ·T₀ … Ṫ·T₃ of every row, per input; nothing for inputs without a rate term.
pub(crate) type Rates = Vec<Vec<[f64; RATE_COLUMNS]>>;

impl<'a> Problem<'a> {
    /// The windows in which all of `sources` are known; the first of them is the thermometer of the fit.
    pub(crate) fn new(
        windows: &'a Windows,
        axis: usize,
        sources: &[Source],
        reference_c: f64,
        min_span_c: f64,
        turning: Option<Turning>,
    ) -> Result<Self> {
        let rows = &windows.rows;
        let known = |i: &usize| sources.iter().all(|source| source.in_window(windows, *i).0.is_finite());
        let used: Vec<usize> = (0..windows.len()).filter(|i| rows.excluded[*i].is_none() && known(i)).collect();
        if used.is_empty() {
            return Err(no_window(windows));
        }
        let inputs: Vec<Input> =
            sources.iter().map(|source| Input::new(*source, windows, &used, reference_c)).collect();
        let span = inputs[0].span;
        check_span(windows, span, min_span_c)?;
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
        let levels = levels(turning.as_ref(), &used, &run, runs.len());
        let tau_from = vec![0; inputs.len()];
        Ok(Self { windows, inputs, tau_from, used, y, weight, run, runs, run_rate, levels, turning })
    }

    /// The span of the thermometer of the fit.
    pub(crate) fn span(&self) -> Span {
        self.inputs[0].span
    }

    /// Place of the input of this name.
    pub(crate) fn input(&self, name: &str) -> Option<usize> {
        self.inputs.iter().position(|input| input.name == name)
    }

    /// The terms of a model, in the order of its parameters; those of inputs that are not here are left out.
    pub(crate) fn terms(&self, spec: &ModelSpec) -> Vec<TermPlace> {
        let main =
            FurtherTerms { input: String::new(), bias: spec.bias, rate: spec.rate, scale: spec.scale, steps: None };
        let further = spec.further.iter().filter_map(|of| Some((self.input(&of.input)?, of)));
        let mut terms = Vec::new();
        for (input, of) in std::iter::once((0, &main)).chain(further) {
            let mut add = |kind, order, at| terms.push(TermPlace { input, kind, order, at });
            (1..=of.bias).for_each(|order| add(TermKind::Bias, order, None));
            (0..of.rate.map_or(0, |order| order + 1)).for_each(|order| add(TermKind::Rate, order, None));
            if input == 0 {
                knots(spec.zones).into_iter().for_each(|knot| add(TermKind::Zone, 2, Some(knot)));
            }
            if of.steps.is_some() {
                self.inputs[input].thresholds().into_iter().for_each(|at| add(TermKind::Step, 0, Some(at)));
            }
            (1..=of.scale).for_each(|order| add(TermKind::Scale, order, None));
        }
        terms
    }

    /// Places of the inputs whose lag a model needs.
    pub(crate) fn rated(&self, spec: &ModelSpec) -> Vec<usize> {
        let further = spec.further.iter().filter(|of| of.rate.is_some()).filter_map(|of| self.input(&of.input));
        spec.rate.iter().map(|_| 0).chain(further).collect()
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

    /// Δt, s.
    pub(crate) fn period_s(&self) -> f64 {
        s_from_ns(self.windows.shape.period_ns)
    }

    /// The windows behind it.
    pub(crate) fn windows(&self) -> &'a Windows {
        self.windows
    }

    fn lag(&self, input: usize, run: usize, tau_s: f64) -> LagRate<'_> {
        let Input { source, span, .. } = &self.inputs[input];
        let track_c = source.track(self.windows, self.runs[run]);
        LagRate { track_c, span: *span, period_s: self.period_s(), tau_s }
    }

    /// Start and end of each row's window of one run, s from the start of the run.
    fn bounds(&self, of: usize) -> Vec<(f64, f64)> {
        let origin_ns = self.windows.runs[self.runs[of]].start_ns;
        let seconds = |ns: i64| s_from_ns(ns - origin_ns);
        let members = self.used.iter().zip(&self.run).filter(|(_, run)| **run == of);
        members.map(|(i, _)| (seconds(self.windows.rows.start_ns[*i]), seconds(self.windows.rows.end_ns[*i]))).collect()
    }

    /// Means of Ṫ·T₀ … Ṫ·T₃ of every row, °C/min. Rows stand run by run.
    pub(crate) fn rate_columns(&self, input: usize, tau_s: f64) -> Vec<[f64; RATE_COLUMNS]> {
        (0..self.runs.len()).flat_map(|run| self.lag(input, run, tau_s).means(&self.bounds(run))).collect()
    }

    /// The rate columns of the inputs that have a τ.
    pub(crate) fn rates(&self, taus_s: &[(usize, f64)]) -> Rates {
        let mut rates = vec![Vec::new(); self.inputs.len()];
        taus_s.iter().for_each(|(input, tau_s)| rates[*input] = self.rate_columns(*input, *tau_s));
        rates
    }

    /// Lowest and highest Ṫ that the used windows hold, °C/min; 0 is always within.
    pub(crate) fn rate_span(&self, input: usize, tau_s: f64) -> [f64; 2] {
        let of_runs = (0..self.runs.len()).map(|run| self.lag(input, run, tau_s).extremes(&self.bounds(run)));
        of_runs.fold([0.0, 0.0], |[lo, hi], [l, h]| [l.min(lo), h.max(hi)])
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
        let Source::Thermometer(sensor) = self.inputs[0].source else { return None };
        Some(plateaus_of(self.windows, &self.used, axis, sensor, self.turning.as_ref()?))
    }

    /// Place of a level among the parameters.
    pub(crate) fn place_of(&self, level: Level) -> Option<usize> {
        self.levels.iter().position(|other| *other == level)
    }

    /// The regressor of a term on one row; `rates` from [`Self::rates`].
    pub(crate) fn regressor(&self, term: &TermPlace, row: usize, rates: &Rates) -> f64 {
        let (input, order) = (&self.inputs[term.input], usize::from(term.order));
        match (term.kind, term.at) {
            (TermKind::Bias, _) => input.basis[row][order],
            (TermKind::Rate, _) => rates[term.input].get(row).map_or(0.0, |rate| rate[order]),
            (TermKind::Scale, _) => self.scale_column(term.input, row, order),
            (TermKind::Zone, Some(knot)) => input.zone(row, knot),
            (TermKind::Step, Some(threshold)) => input.step(row, threshold),
            (TermKind::Zone | TermKind::Step, None) => 0.0,
        }
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

/// Lowest to highest sample of the used windows must be wide enough.
fn check_span(windows: &Windows, Span { lo_c, hi_c }: Span, min_span_c: f64) -> Result<()> {
    if hi_c - lo_c < min_span_c {
        return Err(Error::refused(format!(
            "the data span {:.2} °C ({lo_c:.2} … {hi_c:.2} °C); a fit needs {min_span_c} °C{}",
            hi_c - lo_c,
            most_left_out(windows).map_or(String::new(), |why| format!("; {why}"))
        ))
        .column("min_span_c")
        .help("test over a wider range, or lower --min-span if you know what you do"));
    }
    Ok(())
}
