//! A calibration in short: per axis the drift as logged and on unseen data, the error of the curve, and the model by its name.
//!
//! ```text
//! as logged        σ of the used windows about their run's mean           on unseen data   σ of held-out windows
//! error of curve   largest half width of the 95 % interval over the span, at rest, about T0
//! ```

use sagnac::calibration::{AxisCalibration, Calibration, RunOffset, UNASSIGNED};
use sagnac::diagnostics::{AxisReportData, ReportData};
use sagnac::model::ModelSpec;
use sagnac::notes::NoteLevel;
use sagnac_log::setup::RateUnit;
use sagnac_units::format::{counted, significant, times_text};

use crate::output::brief::{Brief, Remark};
use crate::output::terminal::{Tone, lines_of};

/// Temperatures at which the curve's interval is taken.
const TEMPERATURES: usize = 25;

/// With what was written, and the command that comes next.
pub(crate) fn calibration_brief(
    calibration: &Calibration,
    report_data: &ReportData,
    wrote: &[String],
    output: Option<&str>,
    units: RateUnit,
) -> Brief {
    let rows = calibration.axes.iter().zip(&report_data.axes).map(|(axis, drawn)| row(axis, drawn, units));
    let titles: [[&str; 6]; 2] = [
        ["", "bias drift, 1σ", "", "", "95 % error", ""],
        ["axis", "as logged", "on unseen data", "reduction", "of curve", "model"],
    ];
    let rows: Vec<Vec<String>> = titles.map(|row| row.map(str::to_owned).to_vec()).into_iter().chain(rows).collect();
    let next = match output {
        Some(output) if calibration.serial == UNASSIGNED => {
            format!("next    sagnac verify {output} RETEST.csv (an image needs --serial)")
        }
        Some(output) => format!("next    sagnac verify {output} RETEST.csv"),
        None => "next    the same command with -o unit.cal.json writes the calibration".to_owned(),
    };
    let wrote = (!wrote.is_empty()).then(|| format!("wrote   {}", wrote.join(", ")));
    Brief {
        of: calibration.serial.clone(),
        word: "",
        tone: Tone::Plain,
        verdict: verdict(calibration, report_data),
        body: lines_of(&rows),
        remarks: remarks(calibration, units),
        last: wrote.into_iter().chain([next]).collect(),
    }
}

fn verdict(calibration: &Calibration, report_data: &ReportData) -> String {
    let spans = calibration.axes.iter().map(|axis| axis.span_c());
    let [lo, hi] = spans.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], [a, b]| [lo.min(a), hi.max(b)]);
    let hours = report_data.runs.iter().map(|run| run.hours[1] - run.hours[0]).sum::<f64>();
    let of_axes = calibration.axes.iter().filter_map(|axis| axis.fit.as_ref());
    let left_out = of_axes.map(|fit| fit.excluded.iter().map(|tally| tally.rows).sum::<u64>()).max().unwrap_or(0);
    let used = match left_out {
        0 => "all data used".to_owned(),
        1 => "1 row or window left out".to_owned(),
        n => format!("{n} rows and windows left out"),
    };
    let runs = counted(report_data.runs.len(), "run", "runs");
    let length = if report_data.timed { format!(", {} h", significant(hours, 2)) } else { String::new() };
    format!("calibrated over {lo:.0} … {hi:.0} °C ({runs}{length}, {used})")
}

fn row(axis: &AxisCalibration, drawn: &AxisReportData, units: RateUnit) -> Vec<String> {
    let logged_dph = drawn.logged_sigma_dph();
    let unseen_dph = axis.cross_validation().map(|held_out| held_out.sigma_dph);
    let shown = |value: Option<f64>| value.map_or("-".to_owned(), |dph| units.text(dph, 3));
    let reduction = drawn.reduction(unseen_dph);
    let model = axis.correction.model.parse::<ModelSpec>().map_or(axis.correction.model.clone(), |spec| spec.words());
    vec![
        axis.axis.to_string(),
        shown(logged_dph),
        shown(unseen_dph),
        reduction.map_or("-".to_owned(), |times| format!("{} x", times_text(times))),
        curve_error_dph(axis).map_or("-".to_owned(), |half| format!("± {}", units.text(half, 2))),
        model,
    ]
}

/// Largest half width of the 95 % interval of the curve, °/h.
fn curve_error_dph(axis: &AxisCalibration) -> Option<f64> {
    let [lo, hi] = axis.span_c();
    let step = (hi - lo) / (TEMPERATURES - 1) as f64;
    // The last step may end a rounding beyond the span.
    let half = |at: usize| Some(axis.predict((lo + step * at as f64).min(hi))?.curve_dph);
    (0..TEMPERATURES).filter_map(half).reduce(f64::max)
}

/// Notes of the fit, then the bias that stays.
fn remarks(calibration: &Calibration, units: RateUnit) -> Vec<Remark> {
    let of_axis = move |axis: &AxisCalibration| {
        let letter = axis.axis;
        let told = axis.notes(units).into_iter().filter(|note| note.level != NoteLevel::Fact);
        let remark = move |note: sagnac::notes::Note| Remark {
            is_warning: note.level == NoteLevel::Warning,
            axes: vec![letter],
            text: note.text,
        };
        told.map(remark).collect::<Vec<_>>()
    };
    calibration.axes.iter().flat_map(of_axis).chain(kept_bias(calibration, units)).collect()
}

/// The bias at T0: kept, or removed.
fn kept_bias(calibration: &Calibration, units: RateUnit) -> Option<Remark> {
    let removed = |axis: &AxisCalibration| axis.correction.fixed_bias.map(|bias| bias.value_dph);
    let of_runs = |axis: &AxisCalibration, of: &dyn Fn(&RunOffset) -> Option<f64>| {
        let all: Vec<f64> = axis.run_offsets.iter().filter_map(of).collect();
        (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64)
    };
    let axes = &calibration.axes;
    let is_removed = axes.iter().all(|axis| removed(axis).is_some());
    let knows_input = axes.iter().all(|axis| of_runs(axis, &|run| run.fixed_bias_dph).is_some());
    let value = |axis: &AxisCalibration| match (is_removed, knows_input) {
        (true, _) => removed(axis),
        (false, true) => of_runs(axis, &|run| run.fixed_bias_dph),
        (false, false) => of_runs(axis, &|run| Some(run.value_dph)),
    };
    let all = axes.iter().take(3).filter_map(|axis| Some(format!("{} {}", axis.axis, units.number(value(axis)?, 3))));
    let values = format!("{} {}", all.collect::<Vec<_>>().join(", "), units.name());
    let reference_c = axes.first()?.reference_c();
    let text = match (is_removed, knows_input) {
        (true, _) => format!("the fixed bias at {reference_c:.0} °C is removed ({values})"),
        (false, true) => format!("fixed bias at {reference_c:.0} °C is kept ({values}): --remove-bias"),
        (false, false) => format!("mean rate at {reference_c:.0} °C, Earth rate included, is kept ({values})"),
    };
    Some(Remark::note(text))
}
