//! Which figures a report has, and what is in each.

use crate::figure::{Figure, Layer, Role, SOLID, rounded};
use sagnac::calibration::{AxisCalibration, PpmEstimate, SoakRow};
use sagnac::diagnostics::{AxisReportData, Effect, EffectOf, Leg, ReportData, WindowPoint};
use sagnac::fit::frontier;
use sagnac::model::ActsOn;
use sagnac::model::TICK_INSTRUCTIONS;
use sagnac::verify::{PlateauProof, ScaleProof};
use sagnac_log::ingest::Reason;
use sagnac_log::setup::RateUnit;
use sagnac_units::format::on_scale;

/// The layers of one kind of all axes together draw no more points.
const MOST_POINTS: usize = 1800;
/// Points of a curve.
const CURVE_POINTS: usize = 121;
/// A curve of noise no higher than so many bars leaves something of them to be seen.
const MOST_PEAK: f64 = 1.6;
/// Two-sided 95 % of a normal.
const TWO_SIGMA: f64 = 1.96;

/// Words and units that differ between a fit and a proof.
pub(crate) struct Wording {
    pub(crate) before: &'static str,
    pub(crate) after: &'static str,
}

/// For a fit.
pub(crate) const OF_FIT: Wording = Wording { before: "as logged", after: "less the fit" };
/// For a proof.
pub(crate) const OF_PROOF: Wording = Wording { before: "as logged", after: "corrected" };

/// Points drawn of so many, and the words for it.
fn thinned<'a>(
    report_data: &ReportData,
    points: impl Iterator<Item = &'a WindowPoint>,
) -> (Vec<&'a WindowPoint>, String) {
    let all: Vec<&WindowPoint> = points.collect();
    let step = all.len().div_ceil(MOST_POINTS / report_data.axes.len().clamp(1, 6)).max(1);
    let words = if step > 1 { format!(" One window in {step} is drawn.") } else { String::new() };
    (all.into_iter().step_by(step).collect(), words)
}

fn used(axis: &AxisReportData) -> impl Iterator<Item = &WindowPoint> {
    axis.points.iter().filter(|p| p.excluded.is_none() && p.temperature_c.is_finite())
}

pub(crate) fn figure(axis: char, name: &str, title: &str, caption: String, labels: [&str; 2], group: &str) -> Figure {
    Figure {
        id: format!("{name}-{axis}"),
        title: title.to_owned(),
        caption,
        x_label: labels[0].to_owned(),
        y_label: labels[1].to_owned(),
        group: format!("{group}-{axis}"),
        x: [0.0; 2],
        y: [0.0; 2],
        decades: false,
        layers: Vec::new(),
    }
}

fn dots(label: &str, role: Role, at: impl Iterator<Item = (f64, f64)>) -> Layer {
    let (x, y): (Vec<f64>, Vec<f64>) = at.unzip();
    Layer::Dots { label: label.to_owned(), role, x: rounded(x), y: rounded(y) }
}

fn line(label: &str, role: Role, x: &[f64], y: Vec<f64>, broken: bool) -> Layer {
    let dash = if broken { role.dash() } else { SOLID };
    Layer::Line { label: label.to_owned(), role, x: rounded(x.iter().copied()), y: rounded(y), dash }
}

/// A curve over the span with its 95 % band, from the record alone: the drift at rest, or the scale factor with its value at
/// T0.
fn curve(axis: &AxisCalibration, quantity: ActsOn) -> (Vec<f64>, Vec<f64>, Option<Vec<f64>>) {
    let span = axis.span();
    let step = (span.hi - span.lo) / (CURVE_POINTS - 1) as f64;
    // The last of them may lie a rounding beyond the span.
    let x: Vec<f64> = (0..CURVE_POINTS).map(|i| (span.lo + step * i as f64).min(span.hi)).collect();
    match quantity {
        ActsOn::Bias => {
            let y = x.iter().map(|t| axis.drift(*t, axis.reference_c())).collect();
            let band = x.iter().map(|t| Some(axis.predict(*t)?.curve_dph)).collect();
            (x, y, band)
        }
        ActsOn::ScaleFactor => {
            let (y, sigma): (Vec<f64>, Vec<f64>) = x.iter().map(|t| axis.scale_deviation(*t).into()).unzip();
            let band = sigma.iter().any(|sigma| *sigma > 0.0);
            (x, y, band.then(|| sigma.into_iter().map(|sigma| TWO_SIGMA * sigma).collect()))
        }
    }
}

/// Drift against temperature with the curve at rest and its band.
pub(crate) fn drift(report_data: &ReportData, axis: &AxisReportData, record: &AxisCalibration) -> Option<Figure> {
    let (shown, words) = thinned(report_data, used(axis));
    let rate = if record.rate_span_cpm().is_some() {
        " Dashed: the fit at the median rates of heating and cooling; the distance between them is the effect of the rate terms."
    } else {
        ""
    };
    let further =
        if record.other_signals().next().is_none() { "" } else { " and what the fit assigns to other inputs" };
    let caption = format!(
        "Each point is a window, less the offset of its run{further}. The curve is the fit at rest, zero at {} °C, with its 95 % \
         band.{rate}{words}",
        record.reference_c()
    );
    let title = "Drift against temperature";
    let mut out = figure(axis.axis, "drift", title, caption, ["temperature, °C", "drift, °/h"], "temperature");
    for (label, role, leg) in LEGS {
        let of_leg = shown.iter().filter(|p| p.leg() == leg).map(|p| (p.temperature_c, p.before_dph - p.inputs_dph));
        out.layers.push(dots(label, role, of_leg));
    }
    let (x, y, band) = curve(record, ActsOn::Bias);
    if let Some(half) = band {
        let (lo, hi) = y.iter().zip(&half).map(|(y, half)| (y - half, y + half)).unzip::<_, _, Vec<_>, Vec<_>>();
        let (lo, hi, at) = (rounded(lo), rounded(hi), rounded(x.iter().copied()));
        out.layers.push(Layer::Band { label: "95 % band".to_owned(), role: Role::Fit, x: at, lo, hi });
    }
    out.layers.push(line("fit at rest", Role::Fit, &x, y.clone(), false));
    // With rate terms the moving fits are already there, and most windows are not at rest.
    let at_rest = |t: &f64| record.predict(*t).filter(|_| record.rate_span_cpm().is_none());
    let window: Option<Vec<f64>> = x.iter().map(|t| Some(at_rest(t)?.window_dph)).collect();
    for (half, sign) in window.iter().flat_map(|half| [(half, -1.0), (half, 1.0)]) {
        let edge = y.iter().zip(half).map(|(y, half)| y + sign * half).collect();
        out.layers.push(line("95 % of other windows at rest", Role::Floor, &x, edge, true));
    }
    for (name, role, leg) in &LEGS[..2] {
        if let Some((cpm, y)) = while_moving(axis, record, *leg, &x, &y) {
            out.layers.push(line(&format!("fit while {name} at {cpm:+.2} °C/min"), *role, &x, y, true));
        }
    }
    out.drop_empty().framed(false)
}

/// Effect of one input: its terms, and the windows minus all other terms.
pub(crate) fn effect(report_data: &ReportData, axis: char, place: usize, effect: &Effect) -> Option<Figure> {
    let Effect { input, of, .. } = effect;
    let unit = if effect.in_celsius { ", °C" } else { "" };
    let (title, x_label, y_label) = match of {
        EffectOf::Value => (format!("Drift against {input}"), format!("{input}{unit}"), "drift, °/h"),
        EffectOf::Rate => {
            (format!("Drift against the rate of {input}"), format!("lagged rate of {input}{unit}/min"), "drift, °/h")
        }
        EffectOf::Scale => {
            (format!("Scale factor against {input}"), format!("{input}{unit}"), "scale factor's change, ppm")
        }
    };
    let at = |y: &'_ [f64]| effect.x.iter().copied().zip(y.iter().copied()).collect::<Vec<_>>();
    let every = effect.x.len().div_ceil(MOST_POINTS / report_data.axes.len().clamp(1, 6)).max(1);
    let thin = |y: &'_ [f64]| at(y).into_iter().step_by(every);
    let words = if every > 1 { format!(" One window in {every} is drawn.") } else { String::new() };
    let zero = match of {
        EffectOf::Rate => "no rate".to_owned(),
        EffectOf::Value | EffectOf::Scale => {
            let ends = |pick: fn(f64, f64) -> f64| effect.x.iter().copied().reduce(pick).unwrap_or(0.0);
            let width = ends(f64::max) - ends(f64::min);
            format!("{}{}", on_scale(effect.reference, width), unit.trim_start_matches(','))
        }
    };
    let caption = format!(
        "Each point: one window, other effects removed. Bars: means of bins with twice their own σ. Bars on the line mean that the model fits. Zero at {zero}.{words}"
    );
    let mut out =
        figure(axis, &format!("effect-{place}"), &title, caption, [&x_label, y_label], &format!("effect-{place}"));
    out.layers.push(dots("windows", Role::Steady, thin(&effect.shown)));
    if effect.curve.is_empty() {
        out.layers.push(dots("terms", Role::Fit, thin(&effect.fit)));
    } else {
        let (x, y): (Vec<f64>, Vec<f64>) = effect.curve.iter().map(|[x, y]| (*x, *y)).unzip();
        out.layers.push(line("terms", Role::Fit, &x, y, false));
    }
    let (x, y, half) = bins(&at(&effect.shown));
    let (label, x, y, half) = ("means of bins".to_owned(), rounded(x), rounded(y), rounded(half));
    out.layers.push(Layer::Whiskers { label, role: Role::After, x, y, half, joined: false });
    out.framed(true)
}

/// Held-out residual against the instructions of the slow update.
pub(crate) fn tradeoff(record: &AxisCalibration) -> Option<Figure> {
    let best = frontier(record);
    if best.len() < 2 {
        return None;
    }
    let knee = best.iter().find(|point| point.knee)?;
    let caption = format!(
        "Each point is a model, evaluated on unseen data. The line joins those with the least error for their cost. The knee, {}, is the \
         cheapest that larger models hardly improve. The slow update runs once in a temperature period. The tick takes {} instructions \
         for every model.",
        knee.candidate.model, TICK_INSTRUCTIONS
    );
    let labels = ["slow update, instructions of a Cortex-M4F", "σ on unseen data, °/h"];
    let title = "Accuracy and run time of each model";
    let mut out = figure(record.axis, "tradeoff", title, caption, labels, "instructions");
    let all =
        record.candidates().iter().filter_map(|c| Some((f64::from(c.slow_update_instructions?), c.held_out_dph?)));
    out.layers.push(dots("models", Role::Steady, all));
    let x: Vec<f64> = best.iter().map(|point| f64::from(point.instructions)).collect();
    out.layers.push(line("frontier", Role::After, &x, best.iter().map(|point| point.held_out_dph).collect(), false));
    let at = |instructions: u32, held_out_dph: f64| std::iter::once((f64::from(instructions), held_out_dph));
    let selected = record.candidates().iter().find(|candidate| candidate.chosen);
    let is_knee = selected.is_some_and(|candidate| candidate.model == knee.candidate.model);
    let word = if is_knee { "knee and selected" } else { "knee" };
    let knee_at = at(knee.instructions, knee.held_out_dph);
    out.layers.push(dots(&format!("{word}: {}", knee.candidate.model), Role::Excluded, knee_at));
    if let Some((candidate, instructions, held_out_dph)) =
        selected.filter(|_| !is_knee).and_then(|c| Some((c, c.slow_update_instructions?, c.held_out_dph?)))
    {
        let label = format!("selected: {}", candidate.model);
        out.layers.push(dots(&label, Role::Cooling, at(instructions, held_out_dph)));
    }
    if let Some(floor) = record.noise_floor() {
        out.layers.push(line("noise floor", Role::Floor, &[x[0], x[x.len() - 1]], vec![floor.value_dph; 2], true));
    }
    out.framed(false)
}

/// Gain of a longer soak.
pub(crate) fn soak(record: &AxisCalibration) -> Option<Figure> {
    let soak = record.fit.as_ref()?.soak.as_ref()?;
    let gain = if soak.improves() {
        format!("The next hour improves the curve as a whole most at {:.0} °C.", soak.best_c)
    } else {
        "An hour more improves the curve as a whole by less than 3 % at any temperature.".to_owned()
    };
    let caption = format!(
        "Standard deviation of the curve at rest, now and after so many more hours of soak at each temperature. \
         Where the lines meet, a longer soak gains nothing. {gain}"
    );
    let labels = ["temperature, °C", "σ of the drift, °/h"];
    let title = "Gain of a longer soak";
    let mut out = figure(record.axis, "soak", title, caption, labels, "temperature");
    let x: Vec<f64> = soak.rows.iter().map(|row| row.temperature_c).collect();
    let now = soak.rows.iter().map(|row| row.sigma_dph).collect();
    out.layers.push(line("now", Role::Fit, &x, now, false));
    let roles = [Role::Before, Role::After, Role::Floor, Role::ExcludedToo];
    for ((index, hours), role) in soak.hours.iter().enumerate().zip(roles) {
        let after = |row: &SoakRow| row.after_dph.get(index).map_or(f64::NAN, |after| after.min(row.sigma_dph));
        let after = soak.rows.iter().map(after).collect();
        out.layers.push(line(&format!("after {hours} h"), role, &x, after, true));
    }
    out.framed(true)
}

/// Scale factor against temperature: the joint fit with its band, the plateaus with twice their σ.
pub(crate) fn scale_factor(record: &AxisCalibration) -> Option<Figure> {
    let scale = record.scale_factor()?;
    let caption = "The curve is the joint fit of bias and scale factor, with its 95 % band. Bars: each plateau \
                   by itself, by the two-direction method, with twice its standard deviation.";
    let labels = ["temperature, °C", "scale factor from nominal, ppm"];
    let title = "Scale factor against temperature";
    let mut out = figure(record.axis, "scale", title, caption.to_owned(), labels, "temperature");
    let (x, y, band) = curve(record, ActsOn::ScaleFactor);
    if let Some(half) = band {
        let (lo, hi): (Vec<f64>, Vec<f64>) = y.iter().zip(&half).map(|(y, half)| (y - half, y + half)).unzip();
        let (lo, hi, at) = (rounded(lo), rounded(hi), rounded(x.iter().copied()));
        out.layers.push(Layer::Band { label: "95 % band".to_owned(), role: Role::Fit, x: at, lo, hi });
    }
    out.layers.push(line("joint fit", Role::Fit, &x, y, false));
    let points = scale.plateaus.iter().map(|p| (p.temperature_c, p.scale));
    out.layers.extend(whiskers("plateaus", Role::After, points));
    out.framed(false)
}

/// Scale factor at the plateaus of a proof, before and after.
pub(crate) fn scale_proof(axis: char, proof: &ScaleProof) -> Option<Figure> {
    let caption = "Each plateau by the two-direction method, with twice its standard deviation. The correction removes the change with \
                   temperature and keeps the scale factor at the reference temperature.";
    let labels = ["temperature, °C", "scale factor from nominal, ppm"];
    let title = "Scale factor before and after";
    let mut out = figure(axis, "scale", title, caption.to_owned(), labels, "temperature");
    let side =
        |value: fn(&PlateauProof) -> PpmEstimate| proof.plateaus.iter().map(move |p| (p.temperature_c, value(p)));
    out.layers.extend(whiskers("before", Role::Before, side(|p| p.before)));
    out.layers.extend(whiskers("after", Role::After, side(|p| p.after)));
    out.framed(false)
}

fn whiskers(label: &str, role: Role, points: impl Iterator<Item = (f64, PpmEstimate)>) -> Option<Layer> {
    let mut points: Vec<(f64, PpmEstimate)> = points.collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let label = label.to_owned();
    let x = rounded(points.iter().map(|(t, _)| *t));
    let y = rounded(points.iter().map(|(_, e)| e.ppm));
    let half = rounded(points.iter().map(|(_, e)| 2.0 * e.sigma_ppm));
    (!points.is_empty()).then_some(Layer::Whiskers { label, role, x, y, half, joined: true })
}

/// The fit at the median rate of a leg; `None` without rate terms or such windows.
fn while_moving(
    axis: &AxisReportData,
    record: &AxisCalibration,
    leg: Leg,
    x: &[f64],
    at_rest: &[f64],
) -> Option<(f64, Vec<f64>)> {
    record.rate_span_cpm()?;
    let mut rates: Vec<f64> = used(axis).filter(|p| p.leg() == leg).map(|p| p.rate_cpm).collect();
    rates.sort_by(f64::total_cmp);
    let cpm = *rates.get(rates.len() / 2)?;
    let rate_part = |t_c: &f64| record.rate_effect(*t_c).map_or(0.0, |[per_cpm, _]| per_cpm);
    Some((cpm, x.iter().zip(at_rest).map(|(t, rest)| rest + cpm * rate_part(t)).collect()))
}

const LEGS: [(&str, Role, Leg); 3] = [
    ("heating", Role::Heating, Leg::Heating),
    ("cooling", Role::Cooling, Leg::Cooling),
    ("steady", Role::Steady, Leg::Steady),
];

/// Before and after against the time of the test.
pub(crate) fn over_time(report_data: &ReportData, axis: &AxisReportData, wording: &Wording) -> Option<Figure> {
    let (shown, words) = thinned(report_data, used(axis));
    let caption = format!("Each run about its own constant.{}{words}", runs_in_words(report_data));
    let labels = [time_label(report_data), "drift, °/h"];
    let mut out = figure(axis.axis, "time", "Before and after against time", caption, labels, "time");
    out.layers.push(dots(wording.before, Role::Before, shown.iter().map(|p| (p.hours, p.before_dph))));
    out.layers.push(dots(wording.after, Role::After, shown.iter().map(|p| (p.hours, p.after_dph))));
    out.drop_empty().framed(true)
}

fn time_label(report_data: &ReportData) -> &'static str {
    if report_data.timed { "hours of test" } else { "hours of test (rows without time, counted)" }
}

fn runs_in_words(report_data: &ReportData) -> String {
    if report_data.runs.len() < 2 {
        return String::new();
    }
    let runs = report_data.runs.iter().map(|run| format!("{} from {:.1} h", run.file, run.hours[0]));
    format!(" Runs are shown one after the other: {}.", runs.collect::<Vec<_>>().join(", "))
}

/// Before and after against temperature.
pub(crate) fn over_temperature(report_data: &ReportData, axis: &AxisReportData, wording: &Wording) -> Option<Figure> {
    let (shown, words) = thinned(report_data, used(axis));
    let caption = format!("In a good result the residual is a level cloud, as wide as the noise.{words}");
    let title = "Before and after against temperature";
    let mut out = figure(axis.axis, "temperature", title, caption, ["temperature, °C", "drift, °/h"], "temperature");
    out.layers.push(dots(wording.before, Role::Before, shown.iter().map(|p| (p.temperature_c, p.before_dph))));
    out.layers.push(dots(wording.after, Role::After, shown.iter().map(|p| (p.temperature_c, p.after_dph))));
    out.drop_empty().framed(true)
}

/// The residual alone, heating and cooling apart, with the reach of noise.
pub(crate) fn residual(report_data: &ReportData, axis: &AxisReportData, floor_dph: Option<f64>) -> Option<Figure> {
    let (shown, words) = thinned(report_data, used(axis));
    let of_noise = if floor_dph.is_some() { " Noise alone leaves 95 % of the points in the band." } else { "" };
    let caption = format!(
        "Each point is a window after the correction.{of_noise} A slope or a loop is drift that remains.{words}"
    );
    let labels = ["temperature, °C", "residual, °/h"];
    let mut out = figure(axis.axis, "residual", "Residual against temperature", caption, labels, "temperature");
    for (label, role, leg) in LEGS {
        let of_leg = shown.iter().filter(|p| p.leg() == leg).map(|p| (p.temperature_c, p.after_dph));
        out.layers.push(dots(label, role, of_leg));
    }
    let ends = |pick: fn(f64, f64) -> f64| shown.iter().map(|p| p.temperature_c).reduce(pick);
    if let (Some(floor), Some(lo), Some(hi)) = (floor_dph, ends(f64::min), ends(f64::max)) {
        let [below, above] = [-1.0, 1.0].map(|sign| rounded([sign * TWO_SIGMA * floor; 2]));
        let (label, role) = ("95 % of noise alone".to_owned(), Role::Floor);
        out.layers.insert(0, Layer::Band { label, role, x: rounded([lo, hi]), lo: below, hi: above });
    }
    out.drop_empty().framed(true)
}

/// Residuals next to the noise floor.
pub(crate) fn histogram(axis: &AxisReportData, floor_dph: Option<f64>, units: RateUnit) -> Option<Figure> {
    let values: Vec<f64> = used(axis).map(|p| p.after_dph).filter(|v| v.is_finite()).collect();
    histogram_of(axis.axis, &values, floor_dph, units)
}

fn histogram_of(axis: char, values: &[f64], floor_dph: Option<f64>, units: RateUnit) -> Option<Figure> {
    let (edges, heights) = binned(values)?;
    let width = edges[1] - edges[0];
    let (lo, hi) = (edges[0], edges[edges.len() - 1]);
    let highest = heights.iter().copied().fold(0.0, f64::max);
    // The peak of a normal of σ = floor. Where it towers over the bars, noise is a narrow band among them.
    let peak = |floor: f64| values.len() as f64 * width / (floor * std::f64::consts::TAU.sqrt());
    let is_curve = |floor: f64| peak(floor) <= MOST_PEAK * highest;
    let caption = match floor_dph {
        Some(floor) if is_curve(floor) => format!(
            "Bars: windows per bin. Line: {} windows of noise alone, σ = {} (the floor).",
            values.len(),
            units.text(floor, 3)
        ),
        Some(floor) => {
            format!("Bars: windows per bin. Shaded: 95 % of noise alone, σ = {} (the floor).", units.text(floor, 3))
        }
        None => "The noise floor of this log is not known, so the bars have no reference.".to_owned(),
    };
    let title = if floor_dph.is_some() { "Residual, next to the noise floor" } else { "Residual" };
    let mut out = figure(axis, "histogram", title, caption, ["residual, °/h", "windows"], "histogram");
    let shade = |floor: &f64| [[-TWO_SIGMA * floor, TWO_SIGMA * floor]];
    out.layers.extend(floor_dph.as_ref().filter(|floor| !is_curve(**floor)).map(|floor| Layer::Shades {
        label: "95 % of noise alone".to_owned(),
        role: Role::Floor,
        stretches: shade(floor).to_vec(),
    }));
    let bars = Layer::Bars { label: "residual".to_owned(), role: Role::After, edges: rounded(edges), heights };
    out.layers.push(bars);
    if let Some(floor) = floor_dph.filter(|floor| is_curve(*floor)) {
        let reach = (4.0 * floor).max(lo.abs()).max(hi.abs()).min(8.0 * floor.max((hi - lo) / 8.0));
        let x: Vec<f64> =
            (0..CURVE_POINTS).map(|i| reach * (2.0 * i as f64 / (CURVE_POINTS - 1) as f64 - 1.0)).collect();
        let y = x.iter().map(|x| peak(floor) * (-0.5 * (x / floor).powi(2)).exp()).collect();
        out.layers.push(line("noise alone", Role::Floor, &x, y, false));
    }
    out.framed(true)
}

/// Equal bins by the rule of Freedman and Diaconis (1981), between 8 and 60 of them.
fn binned(values: &[f64]) -> Option<(Vec<f64>, Vec<f64>)> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let (lo, hi) = (*sorted.first()?, *sorted.last()?);
    let at = |part: f64| sorted[((sorted.len() - 1) as f64 * part).round() as usize];
    let rule = 2.0 * (at(0.75) - at(0.25)) / (values.len() as f64).cbrt();
    let range = if hi > lo { hi - lo } else { lo.abs().max(1e-9) };
    let count = if rule > 0.0 { (range / rule).ceil().clamp(8.0, 60.0) as usize } else { 8 };
    let width = range / count as f64;
    let edges: Vec<f64> = (0..=count).map(|i| lo + width * i as f64).collect();
    let mut heights = vec![0.0; count];
    for value in values {
        heights[(((value - lo) / width) as usize).min(count - 1)] += 1.0;
    }
    Some((edges, heights))
}

/// The temperature profile; excluded stretches are shaded by reason.
pub(crate) fn profile(report_data: &ReportData, axis: &AxisReportData) -> Option<Figure> {
    let reasons = stretches(axis);
    let caption = if reasons.is_empty() {
        "Every window is used.".to_owned()
    } else {
        "Shaded: excluded windows, with the reason. The reasons are explained with the table below.".to_owned()
    };
    let labels = [time_label(report_data), "temperature, °C"];
    let mut out = figure(axis.axis, "profile", "Temperature of the test", caption, labels, "time");
    const SHADES: [Role; 3] = [Role::Excluded, Role::ExcludedToo, Role::ExcludedAlso];
    for ((reason, stretches), role) in reasons.into_iter().zip(SHADES.into_iter().cycle()) {
        let label = format!("excluded: {}", reason.name().replace('_', " "));
        out.layers.push(Layer::Shades { label, role, stretches });
    }
    for run in 0..report_data.runs.len() {
        let (of_run, _) =
            thinned(report_data, axis.points.iter().filter(|p| p.run == run && p.temperature_c.is_finite()));
        let (x, y): (Vec<f64>, Vec<f64>) = of_run.iter().map(|p| (p.hours, p.temperature_c)).unzip();
        let label = if run == 0 { "thermometer of the model" } else { "" };
        out.layers.push(line(label, Role::Temperature, &x, y, false));
    }
    out.drop_empty().framed(false)
}

/// Neighbouring windows of one reason as one stretch, by reason.
fn stretches(axis: &AxisReportData) -> Vec<(Reason, Vec<[f64; 2]>)> {
    let mut out: Vec<(Reason, Vec<[f64; 2]>)> = Vec::new();
    let mut last: Option<(Reason, usize)> = None;
    for point in &axis.points {
        let Some(reason) = point.excluded else {
            last = None;
            continue;
        };
        let [from, to] = [-0.5, 0.5].map(|half| point.hours + half * point.length_h);
        let slot = match out.iter().position(|(r, _)| *r == reason) {
            Some(slot) => slot,
            None => {
                out.push((reason, Vec::new()));
                out.len() - 1
            }
        };
        match (last, out[slot].1.last_mut()) {
            (Some(before), Some(stretch)) if before == (reason, point.run) => stretch[1] = to,
            _ => out[slot].1.push([from, to]),
        }
        last = Some((reason, point.run));
    }
    out
}

/// Heating against cooling: means of temperature bins, before and after.
pub(crate) fn hysteresis(axis: &AxisReportData, wording: &Wording) -> Option<Figure> {
    let caption = "Means of temperature bins with twice their own σ. A gap between heating and cooling after the \
                   correction is an effect that the model lacks: another lag, a gradient, or hysteresis.";
    let labels = ["temperature, °C", "mean drift, °/h"];
    let title = "Heating against cooling";
    let mut out = figure(axis.axis, "hysteresis", title, caption.to_owned(), labels, "temperature");
    for (name, role, leg) in &LEGS[..2] {
        let members: Vec<&WindowPoint> = used(axis).filter(|p| p.leg() == *leg).collect();
        let over_temperature = |y: fn(&WindowPoint) -> f64| -> Vec<(f64, f64)> {
            members.iter().map(|p| (p.temperature_c, y(p))).collect()
        };
        let (x, y, _) = bins(&over_temperature(|p| p.before_dph));
        out.layers.push(line(&format!("{name}, {}", wording.before), *role, &x, y, true));
        let (x, y, half) = bins(&over_temperature(|p| p.after_dph));
        let (x, y, half) = (rounded(x), rounded(y), rounded(half));
        out.layers.push(Layer::Whiskers {
            label: format!("{name}, {}", wording.after),
            role: *role,
            x,
            y,
            half,
            joined: true,
        });
    }
    if out.layers.iter().any(|layer| matches!(layer, Layer::Whiskers { x, .. } if x.len() < 2)) {
        return None;
    }
    out.framed(true)
}

/// Mean x, mean y and twice its σ in up to twelve equal bins of x with at least four points.
fn bins(points: &[(f64, f64)]) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    const BINS: usize = 12;
    let extremes = |(lo, hi): (f64, f64), (x, _): &(f64, f64)| (lo.min(*x), hi.max(*x));
    let (lo, hi) = points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), extremes);
    let mut sums = [(0.0, 0.0, 0.0, 0.0); BINS];
    for (x, y) in points {
        let bin = ((x - lo) / (hi - lo) * BINS as f64) as usize;
        let (n, t, v, squares) = &mut sums[bin.min(BINS - 1)];
        *n += 1.0;
        *t += x;
        *v += y;
        *squares += y * y;
    }
    let full = sums.iter().filter(|(n, ..)| *n >= 4.0);
    let rows = full.map(|(n, t, v, squares)| {
        let mean = v / n;
        let variance = ((squares / n - mean * mean) * n / (n - 1.0)).max(0.0);
        (t / n, mean, 2.0 * (variance / n).sqrt())
    });
    let mut out = (Vec::new(), Vec::new(), Vec::new());
    for (x, y, half) in rows {
        out.0.push(x);
        out.1.push(y);
        out.2.push(half);
    }
    out
}

impl Figure {
    /// Without layers of dots that have none.
    fn drop_empty(mut self) -> Self {
        self.layers.retain(|layer| !matches!(layer, Layer::Dots { x, .. } | Layer::Line { x, .. } if x.is_empty()));
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever the floor, the frame of the histogram holds its bars and its curve.
    #[test]
    fn a_histogram_stays_in_its_frame() {
        let values: Vec<f64> = (0..500).map(|at| (f64::from(at) / 100.0).sin()).collect();
        for floor in [1e-3, 0.1, 0.5, 1.0, 10.0] {
            let drawn = histogram_of('x', &values, Some(floor), RateUnit::DegPerHour).unwrap();
            let inside = |range: [f64; 2], values: &[f64]| values.iter().all(|v| (range[0]..=range[1]).contains(v));
            for layer in &drawn.layers {
                match layer {
                    Layer::Bars { edges, heights, .. } => assert!(inside(drawn.x, edges) && inside(drawn.y, heights)),
                    Layer::Line { x, y, .. } => assert!(inside(drawn.x, x) && inside(drawn.y, y), "{floor}"),
                    Layer::Shades { stretches, .. } => assert!(inside(drawn.x, &stretches[0]), "{floor}"),
                    other => panic!("{other:?}"),
                }
            }
            assert_eq!(drawn.layers.len(), 2, "bars, and the curve or the reach of noise: {floor}");
        }
    }
}
