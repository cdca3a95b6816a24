//! What a fit may leave out: at most a twentieth of a run, and never a side of a lasting change.
//!
//! An outlier rule that takes more than that decides the answer. Then the fit refuses and names the stretch.

use crate::model::basis::Span;
use crate::window::Windows;
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::Reason;
use sagnac_units::s_from_ns;

/// Part of a run's rows that may be excluded as bumps, steps or start-up.
const MOST: f64 = 0.05;
/// Fewer windows may be alike by chance, of a coarse counter.
const FEWEST_ALIKE: usize = 10;
/// Differences below this part of a rate are rounding.
const ROUNDING: f64 = 1e-12;

/// # Errors
/// [`sagnac_log::ErrorKind::Refused`] for a run of which too much looks like outliers, or whose rate changed for good.
pub(crate) fn check(windows: &Windows) -> Result<()> {
    (0..windows.runs.len()).try_for_each(|run| check_run(windows, run))
}

/// Windows that are all alike hold neither drift nor noise: a fit of them would be sure of nothing to sixteen digits.
///
/// # Errors
/// [`sagnac_log::ErrorKind::Refused`] for such an axis.
pub(crate) fn check_moves(windows: &Windows, axis: usize) -> Result<()> {
    let used: Vec<usize> = (0..windows.len()).filter(|i| windows.rows.excluded[*i].is_none()).collect();
    let rates = used.iter().map(|i| windows.rate_dph(axis, *i));
    let (lo, hi) = rates.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), rate| (lo.min(rate), hi.max(rate)));
    if used.len() < FEWEST_ALIKE || hi - lo > ROUNDING * lo.abs().max(hi.abs()) {
        return Ok(());
    }
    let (letter, n) = (windows.shape.axes[axis], used.len());
    let what = format!("the rate of axis {letter} is constant in all {n} windows: the column is stuck or too coarse");
    Err(Error::refused(what, "correct the counts column, or set a longer --window"))
}

fn check_run(windows: &Windows, run: usize) -> Result<()> {
    let rows = &windows.rows;
    let members: Vec<usize> = (0..windows.len()).filter(|i| rows.run[*i] as usize == run).collect();
    let file = |window: usize| windows.runs[run].file_at(rows.start_ns[window]).to_owned();
    let hours = |ns: i64| s_from_ns(ns - windows.runs[run].start_ns) / 3600.0;
    if let Some(step) = members.iter().find(|i| rows.excluded[**i] == Some(Reason::LastingStep)) {
        let at = hours(rows.start_ns[*step]);
        return Err(Error::refused(
            format!("the rate steps at {at:.2} h of the run and stays there: one curve does not fit both sides"),
            "find the cause, then cut the log there, or keep all of it with --keep-outliers",
        )
        .file(file(*step))
        .line(rows.first_line[*step]));
    }
    let is_suspect = |i: &usize| matches!(rows.excluded[*i], Some(Reason::Motion | Reason::Step | Reason::StartUp));
    let count = |members: &mut dyn Iterator<Item = usize>| members.map(|i| f64::from(rows.samples[i])).sum::<f64>();
    let excluded = count(&mut members.iter().copied().filter(is_suspect));
    let all = count(&mut members.iter().copied());
    if excluded <= MOST * all {
        return Ok(());
    }
    let stretches = members.chunk_by(|a, b| is_suspect(a) == is_suspect(b)).filter(|stretch| is_suspect(&stretch[0]));
    let longest = stretches.max_by_key(|stretch| stretch.len()).unwrap_or(&[]);
    let (first, last) = (longest.first().copied().unwrap_or(0), longest.last().copied().unwrap_or(0));
    let (from, to) = (hours(rows.start_ns[first]), hours(rows.end_ns[last]));
    let part = 100.0 * excluded / all;
    Err(Error::refused(format!(
        "{part:.1} % of the run look like bumps, steps or start-up (longest from {from:.2} to {to:.2} h), and the limit is {:.0} %",
        100.0 * MOST
    ), "repeat the test, cut the stretch out of the log, set discard_initial_s, or use --keep-outliers")
    .file(file(first))
    .line(rows.first_line[first]))
}

/// What to do about a thermometer that is read in few of the rows.
pub(crate) const READINGS_HOLD: &str = "a reading of a thermometer holds for 10 s: where readings are farther apart, give one and a half times their \
     interval as stale_after_s under [[thermometer]] in the setup, as `sagnac init` does";

/// True where a thermometer is read, and most windows have no temperature of it.
pub(crate) fn readings_do_not_hold(windows: &Windows) -> bool {
    (0..windows.shape.thermometers.len()).any(|at| {
        let track = windows.runs.iter().filter_map(|run| run.tracks.get(at)).flatten();
        let lost = windows.rows.mean_c[at].iter().filter(|mean| mean.is_nan()).count();
        2 * lost > windows.len() && track.into_iter().any(|celsius| celsius.is_finite())
    })
}

/// Says why nothing is left, the commonest reason first.
pub(crate) fn no_window(windows: &Windows) -> Error {
    let why = most_left_out(windows).unwrap_or("it contains no usable row".to_owned());
    let holds = !readings_do_not_hold(windows);
    let help = if holds { "run `sagnac inspect LOG` to list the excluded rows" } else { READINGS_HOLD };
    Error::refused(format!("the log has no usable window: {why}"), help)
}

/// The most frequent reason for excluded rows, in words.
fn most_left_out(windows: &Windows) -> Option<String> {
    let most = windows.tallies.most()?;
    let rows = if most.rows == 1 { "1 row is".to_owned() } else { format!("{} rows are", most.rows) };
    Some(format!("{rows} excluded as {} (first at {})", most.reason.name(), most.first))
}

/// Lowest to highest sample of the used windows must be wide enough.
pub(crate) fn check_span(windows: &Windows, Span { lo, hi }: Span, min_span_c: f64) -> Result<()> {
    if hi - lo < min_span_c {
        return Err(Error::refused(
            format!(
                "the data span {:.2} °C ({lo:.2} … {hi:.2} °C), and a fit needs {min_span_c} °C{}",
                hi - lo,
                most_left_out(windows).map_or(String::new(), |why| format!(" ({why})"))
            ),
            "test over a wider range, or lower --min-span if you know what you are doing",
        )
        .column("min_span_c"));
    }
    Ok(())
}
