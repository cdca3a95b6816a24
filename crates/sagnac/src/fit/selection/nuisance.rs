//! Drift in time and warm-up after power-on: fitted with the terms so that no term takes their place. None is
//! corrected but a warm-up where that is asked for ([`super::warm_up`]).
//!
//! ```text
//! drift      d·(t − t̄)         °/h per hour; of all runs together, or of each run
//! warm-up    a·e^(−t/τ)        °/h at the first row of a run, IEEE Std 647's turn-on; τ from a grid of ratio two
//! ```
//!
//! t is the time since the first row of the run. A chamber that heats once and cools once makes a drift in time look like a rate
//! term, for what was measured while heating came first. `auto` therefore grades every model of the grid without and with each of
//! these columns ([`super::grades`]), and keeps those of the best grade where it is better by [`TIME_DECISIVE`].
//!
//! Fails where time and temperature move together: a column that temperature explains by more than [`TIME_EXPLAINED_MAX`] is not
//! tried, and the uncertainty of the curve carries it instead ([`crate::fit::uncertainty::entanglement`]).

use crate::fit::one_model::residual_noise::noise_of;
use crate::fit::one_model::solution::fit;
use crate::fit::problem::least_squares::LeastSquares;
use crate::fit::problem::levels::Level;
use crate::fit::selection::grades::{Grades, WhitenedSeries};
use crate::fit::selection::prices::{TIME_DECISIVE, TIME_EXPLAINED_MAX, price};
use crate::model::spec::ModelSpec;
use crate::noise_model::processes::SlowNoise;
use crate::noise_model::whitening::Whitening;

/// Shortest τ of a warm-up, windows, and the longest as a part of the longest run.
const SHORTEST_WINDOWS: f64 = 5.0;
const LONGEST_PART: f64 = 1.0 / 3.0;
/// τ of a warm-up that are tried, at most.
const MOST_TAUS: i32 = 8;

/// The nuisance columns of a problem that are justified next to the best model of the grid. Rate series of order 0 and every second
/// lag decide: what goes with time is common to all.
pub(crate) fn justified(problem: &LeastSquares<'_>, specs: &[ModelSpec], taus_s: &[f64]) -> Vec<Level> {
    let is_plain = |spec: &&ModelSpec| spec.thermometer().rate.is_none_or(|order| order == 0);
    let specs: &[ModelSpec] = &specs.iter().filter(is_plain).cloned().collect::<Vec<_>>();
    let taus_s: &[f64] = &taus_s.iter().copied().step_by(2).collect::<Vec<_>>();
    if !problem.has_rate() || specs.is_empty() {
        return Vec::new();
    }
    best(problem, specs, taus_s).unwrap_or_default()
}

/// The best set of columns.
fn best(problem: &LeastSquares<'_>, specs: &[ModelSpec], taus_s: &[f64]) -> Option<Vec<Level>> {
    let noise = noise_of_largest(problem, specs, taus_s)?;
    let whitening = Whitening::new(problem.noise_rows(), noise);
    let runs = problem.runs.len();
    let each: Vec<Level> = (0..if runs > 1 { runs } else { 0 }).map(|run| Level::Drift(Some(run))).collect();
    let of_all: Vec<Level> = std::iter::once(Level::Drift(None)).chain(warm_ups(problem)).collect();
    let each = if separate(problem, &whitening, specs, taus_s, &each)?.len() == runs { each } else { Vec::new() };
    let of_all = separate(problem, &whitening, specs, taus_s, &of_all)?;
    let mut graded = graded_sets(problem, &whitening, specs, taus_s, &[], &sets(&of_all))?;
    if !each.is_empty() {
        // A drift of each run takes the place of that of all.
        let with_each: Vec<Vec<Level>> =
            sets(&of_all).into_iter().filter(|set| !set.contains(&Level::Drift(None))).collect();
        graded.extend(graded_sets(problem, &whitening, specs, taus_s, &each, &with_each)?);
    }
    let variance = graded.iter().map(|(grades, _)| grades.variance).fold(f64::INFINITY, f64::min);
    let tried_taus = of_all.iter().filter(|level| level.warm_up_s().is_some()).count();
    let price_of = |set: &[Level]| {
        let is_warm = set.iter().any(|level| level.warm_up_s().is_some());
        let of_tau = if is_warm { 2.0 * (tried_taus as f64).ln() } else { 0.0 };
        let margin = if set.is_empty() { 0.0 } else { TIME_DECISIVE };
        set.len() as f64 * price(problem.len() as f64) + of_tau + margin
    };
    let grade = |(grades, set): &(Grades, Vec<Level>)| grades.least(variance) + price_of(set);
    graded.into_iter().min_by(|a, b| grade(a).total_cmp(&grade(b))).map(|(_, set)| set)
}

/// Of some columns those that the curve over temperature does not explain next to the offsets.
fn separate(
    problem: &LeastSquares<'_>,
    whitening: &Whitening,
    specs: &[ModelSpec],
    taus_s: &[f64],
    tried: &[Level],
) -> Option<Vec<Level>> {
    let own = problem.levels().len();
    let with = problem.with_further(tried);
    // The columns in question stay in the factor; offsets of runs, which are in every model, are projected out.
    let columns = with.run_columns_of(|level| matches!(level, Level::Run(_)));
    let series = WhitenedSeries::new(&with, whitening, specs, &taus_s[..1.min(taus_s.len())], &columns)?;
    let place = |column: usize| columns.shared.iter().position(|shared| *shared == column);
    let known: Vec<usize> = (0..own).filter_map(place).collect();
    let is_separate = |column: &usize| {
        place(*column).and_then(|at| series.explained_by_bias(at, &known)).is_some_and(|part| part < TIME_EXPLAINED_MAX)
    };
    Some((own..with.levels().len()).filter(is_separate).map(|column| with.levels()[column]).collect())
}

/// Grades with each of some sets of columns, next to those that are always there.
fn graded_sets(
    problem: &LeastSquares<'_>,
    whitening: &Whitening,
    specs: &[ModelSpec],
    taus_s: &[f64],
    always: &[Level],
    sets: &[Vec<Level>],
) -> Option<Vec<(Grades, Vec<Level>)>> {
    let mut of_sets: Vec<Level> = Vec::new();
    for level in sets.iter().flatten() {
        if !of_sets.contains(level) {
            of_sets.push(*level);
        }
    }
    let tried = problem.levels().len() + always.len();
    let with = problem.with_further(&[always, &of_sets].concat());
    let columns = with.run_columns();
    let series = WhitenedSeries::new(&with, whitening, specs, taus_s, &columns)?;
    let place = |level: &Level| columns.shared.iter().position(|shared| with.levels()[*shared] == *level);
    let graded = |set: &Vec<Level>| {
        let before = with.levels()[..tried].iter().chain(set).filter_map(place).collect::<Vec<_>>();
        Some((series.grades(&before)?, always.iter().chain(set).copied().collect()))
    };
    Some(sets.iter().filter_map(graded).collect())
}

/// Slow noise of the largest model next to a drift and a warm-up of middle length, so that neither counts as noise.
fn noise_of_largest(problem: &LeastSquares<'_>, specs: &[ModelSpec], taus_s: &[f64]) -> Option<SlowNoise> {
    let largest = specs.iter().max_by_key(|spec| spec.coefficients())?;
    let warm_ups = warm_ups(problem);
    let further: Vec<Level> =
        std::iter::once(Level::Drift(None)).chain(warm_ups.get(warm_ups.len() / 2).copied()).collect();
    let with = problem.with_further(&further);
    Some(fit(&with, largest, taus_s).map(|fitted| noise_of(&with, &fitted).best).unwrap_or_default())
}

fn warm_ups(problem: &LeastSquares<'_>) -> Vec<Level> {
    let shortest_s = SHORTEST_WINDOWS * problem.windows().shape.nominal_s;
    let longest_s = LONGEST_PART * problem.longest_run_s();
    let tau = |k: i32| shortest_s * 2.0_f64.powi(k);
    (0..MOST_TAUS).map(tau).take_while(|tau_s| *tau_s <= longest_s).map(|tau_s| Level::WarmUp { tau_s }).collect()
}

/// Nothing, a drift of all runs, one warm-up, or both.
fn sets(separate: &[Level]) -> Vec<Vec<Level>> {
    let (warm, drift): (Vec<Level>, Vec<Level>) = separate.iter().partition(|level| level.warm_up_s().is_some());
    let drifts: Vec<Vec<Level>> =
        std::iter::once(Vec::new()).chain(drift.into_iter().map(|level| vec![level])).collect();
    let with_warm = drifts.iter().flat_map(|drift| warm.iter().map(|level| [drift.as_slice(), &[*level]].concat()));
    let with_warm: Vec<Vec<Level>> = with_warm.collect();
    drifts.into_iter().chain(with_warm).collect()
}
