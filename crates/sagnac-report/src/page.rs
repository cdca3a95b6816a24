//! The page: verdict first, then figures, tables, provenance.

use maud::{DOCTYPE, Markup, PreEscaped, html};
use sagnac_log::setup::RateUnit;

use crate::figure::{Dash, Figure};
use crate::figures::Wording;
use crate::prose::prose;
use crate::report::Report;
use crate::sheet::Sheet;
use crate::{acceptance, figures, svg, terms};
use sagnac::calibration::{AxisCalibration, Calibration, LogFile, LogUnit, PpmEstimate, UNASSIGNED};
use sagnac::diagnostics::{AxisReportData, ReportData};
use sagnac::model::ModelSpec;
use sagnac::notes::{Note, NoteAbout, NoteLevel};
use sagnac::verify::{AxisVerification, Correction, DriftValues, Judged, REPEATED_PROFILE, ScaleValues, Verification};
use sagnac_log::error::{Error, Result};
use sagnac_log::ingest::{Tally, hex, sha256};
use sagnac_units::format::{celsius, counted, plain, printable, printable_json, significant, times_text, with_sigma};

/// Scripts and styles of the page. uPlot 1.6.32 is under the MIT licence, which is in the same folder.
/// uPlot, which draws the figures that move.
pub const UPLOT_JS: &str = include_str!("vendor/uplot/uPlot.iife.min.js");
/// Its style.
pub const UPLOT_CSS: &str = include_str!("vendor/uplot/uPlot.min.css");
/// Its licence.
pub const UPLOT_LICENCE: &str = include_str!("vendor/uplot/LICENSE");
/// Style of every page.
pub const STYLE: &str = include_str!("report.css");
const SCRIPT: &str = include_str!("report.js");
/// The page loads nothing from anywhere, and the browser enforces that.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'";

/// The report of a calibration.
///
/// # Errors
/// A record that cannot be written as JSON.
pub fn calibration_report(calibration: &Calibration, report_data: &ReportData, units: RateUnit) -> Result<Report> {
    let mut drawn = Vec::new();
    let several = calibration.axes.len() > 1;
    let body = html! {
        h1 { "Thermal calibration" @if calibration.serial != UNASSIGNED { " of " (calibration.serial) } }
        p.sub { (subtitle(calibration, report_data.runs.len())) }
        p.note {
            "Figures on unseen data come from windows that the fit did not use. Verify the correction on another test: " code { "sagnac verify" }
            " runs it through the image that you will ship."
        }
        @for axis in &calibration.axes { (fit_verdict(axis, report_data, several, units)) }
        @for axis in &calibration.axes {
            @if several { h2.axis { "Axis " (axis.axis) } }
            @if let Some(points) = report_data.axes.iter().find(|points| points.axis == axis.axis) {
                @let all = fit_figures(report_data, points, axis, units);
                (all_shown(&all))
                @let () = drawn.extend(all);
            }
            (terms::coefficients(axis, units))
            (plateaus(axis, units))
            (terms::candidates(axis.candidates(), units))
            (terms::model_search(axis.fit.as_ref().map_or(&[], |fit| &fit.model_search), units))
            (left_out(&axis.excluded().iter().collect::<Vec<_>>()))
        }
        (provenance(calibration)?)
    };
    page(&format!("Thermal calibration ({})", calibration.serial), &body, drawn)
}

/// The report of a verification; `calibration` adds the verified calibration, where it is available. `sheet` is the head of an acceptance.
///
/// # Errors
/// A record that cannot be written as JSON.
pub fn verification_report(
    verification: &Verification,
    calibration: Option<&Calibration>,
    report_data: &ReportData,
    sheet: &Sheet,
    units: RateUnit,
) -> Result<Report> {
    let mut drawn = Vec::new();
    let several = verification.axes.len() > 1;
    let judged = acceptance::is_acceptance(verification);
    let body = html! {
        h1 { (if judged { "Acceptance test" } else { "Verification on another test" }) @if !verification.serial.is_empty() && verification.serial != UNASSIGNED { ": " (verification.serial) } }
        p.sub {
            (if verification.is_of_other_logs() { "Logs that the fit did not see, run" } else { "Logs run" })
            " through the code and the image that you will ship. Windows of " (plain(verification.window_s)) " s."
        }
        (same_log(verification))
        @if judged {
            (acceptance::identity(verification, calibration, sheet, units))
            (acceptance::limits(verification))
            (acceptance::signatures())
            (acceptance::remarks(verification, units))
        }
        @for axis in &verification.axes { (proof_verdict(axis, verification, units)) }
        @if judged { h2.annex { "Annex: figures and tables of each axis" } }
        @for axis in &verification.axes {
            @if several { h2.axis { "Axis " (axis.axis) } }
            (before_after(axis, verification, units))
            (scale_before_after(axis))
            (acceptance::bias_repeatability(axis, units))
            (acceptance::residual(axis, units))
            (acceptance::flight(axis))
            (left(axis, units))
            @if let Some(points) = report_data.axes.iter().find(|points| points.axis == axis.axis) {
                @let all = proof_figures(report_data, points, axis, units);
                (all_shown(&all))
                @let () = drawn.extend(all);
            }
            @if let Some(record) = calibration.and_then(|c| c.axes.iter().find(|a| a.axis == axis.axis)) {
                (terms::coefficients(record, units))
            }
        }
        @let (of_host, excluded): (Vec<&Tally>, Vec<&Tally>) = verification.excluded.iter().partition(|tally| tally.reason.is_replayed());
        (left_out(&excluded))
        (replayed(&of_host))
        h2 { "Provenance" }
        (inputs(&verification.inputs))
        div.scroll { table {
            tr { td { "program" } td.words { (verification.program) } }
            tr { td { "SHA-256 of the record" } td.hash { (verification.record_sha256) } }
            tr { td { "SHA-256 of the images" } td.hash { (verification.image_sha256) } }
        } }
    };
    let document = sheet.document.as_deref().filter(|_| judged).map_or(String::new(), |number| format!("{number}: "));
    page(&format!("{document}{} {}", if judged { "Acceptance" } else { "Proof" }, verification.serial), &body, drawn)
}

/// Everything into one file. A control character of a record or a log is shown as its number, wherever it comes from.
pub(crate) fn page(title: &str, body: &Markup, figures: Vec<Figure>) -> Result<Report> {
    let data = serde_json::to_string(&figures).map_err(|e| Error::defect(format!("cannot write the figures: {e}")))?;
    let data = printable_json(&data).replace('<', "\\u003c");
    let (title, body) = (printable(title), PreEscaped(true_minus(&printable(&body.0))));
    let markup = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (title) }
                style { (PreEscaped(UPLOT_CSS)) (PreEscaped(without_indents(STYLE))) (PreEscaped(footer(&title))) }
            }
            body {
                main {
                    (body)
                    p.note.screen { "Drag in a figure to zoom, double-click to reset. Figures with a common axis move together." }
                }
                script type="application/json" id="figures" { (PreEscaped(data)) }
                script { (PreEscaped("/*\n")) (PreEscaped(UPLOT_LICENCE)) (PreEscaped("*/\n")) (PreEscaped(UPLOT_JS)) }
                script { (PreEscaped(without_indents(SCRIPT))) }
            }
        }
    };
    Ok(Report { html: markup.into_string(), figures })
}

/// Style or script without the blanks at the beginnings of its lines: neither has a text of several lines.
fn without_indents(text: &str) -> String {
    text.lines().map(str::trim_start).collect::<Vec<_>>().join("\n")
}

/// A minus before a digit, in the text of a page, as people print it. What stands behind a letter, digit or point is a name or a date.
fn true_minus(html: &str) -> String {
    let mut out = String::with_capacity(html.len() + 64);
    let (mut in_tag, mut before) = (false, ' ');
    let mut rest = html.chars().peekable();
    while let Some(c) = rest.next() {
        match c {
            '<' => in_tag = true,
            '>' => in_tag = false,
            _ => (),
        }
        let begins = !before.is_alphanumeric() && !['.', '_', '-', '/', ')', '"', '\''].contains(&before);
        let is_minus = c == '-' && !in_tag && begins && rest.peek().is_some_and(char::is_ascii_digit);
        out.push(if is_minus { '−' } else { c });
        before = c;
    }
    out
}

/// Every printed page shows its report, its number and the number of pages.
fn footer(title: &str) -> String {
    // Every other character by its number: a style sheet reads some of them.
    let written =
        |c: char| if c.is_alphanumeric() || c == ' ' { c.to_string() } else { format!("\\{:x} ", u32::from(c)) };
    let title: String = title.chars().map(written).collect();
    format!(
        "@page {{ @bottom-left {{ content: \"{title}\"; font: 8pt sans-serif; color: #4a505b }} @bottom-right {{ content: counter(page) \" / \" counter(pages); font: 8pt sans-serif; color: #4a505b }} }}"
    )
}

/// Figures in one column, or in two where the screen is wide.
pub(crate) fn all_shown(figures: &[Figure]) -> Markup {
    html! { @if !figures.is_empty() { div.figures { @for figure in figures { (shown(figure)) } } } }
}

/// A figure on the page: heading, legend, drawing, caption.
pub(crate) fn shown(figure: &Figure) -> Markup {
    html! {
        figure {
            h3 { (figure.title) }
            div.legend {
                @for (label, role, kind, dash) in legend(figure) {
                    span {
                        @if dash.is_empty() { i class=(kind) style={ "color:var(--" (role) ")" } {} }
                        @else { (broken_line(role, dash)) }
                        (label)
                    }
                }
            }
            div.plot id=(figure.id) { (PreEscaped(svg::draw(figure))) }
            div.readout {}
            figcaption { (figure.caption) }
        }
    }
}

/// A broken line as the figure draws it.
fn broken_line(role: &str, dash: Dash) -> Markup {
    let lengths = dash.iter().map(u8::to_string).collect::<Vec<_>>().join(" ");
    html! {
        svg.key width="34" height="10" aria-hidden="true" {
            path d="M0 5h34" fill="none" stroke={ "var(--" (role) ")" } stroke-width="2.5" stroke-dasharray=(lengths) {}
        }
    }
}

/// Labels once each, with the names of their colour and their sign, and how a line is broken.
fn legend(figure: &Figure) -> Vec<(&str, &'static str, &'static str, Dash)> {
    let mut out: Vec<(&str, &'static str, &'static str, Dash)> = Vec::new();
    for layer in &figure.layers {
        let (label, role) = layer.label();
        if !label.is_empty() && out.iter().all(|(seen, ..)| *seen != label) {
            out.push((label, role.name(), layer.sign(), layer.dash()));
        }
    }
    out
}

fn fit_figures(
    report_data: &ReportData,
    points: &AxisReportData,
    axis: &AxisCalibration,
    units: RateUnit,
) -> Vec<Figure> {
    let floor = axis.noise_floor().map(|floor| floor.value_dph);
    let drift = figures::drift(report_data, points, axis);
    let effect = |(place, effect)| figures::effect(report_data, axis.axis, place, effect);
    drift
        .into_iter()
        .chain(points.effects.iter().enumerate().filter_map(effect))
        .chain(figures::scale_factor(axis))
        .chain(figures::soak(axis))
        .chain(figures::tradeoff(axis))
        .chain(both_sides(report_data, points, &figures::OF_FIT, floor, units))
        .map(|figure| figure.shown_in(units))
        .collect()
}

fn proof_figures(
    report_data: &ReportData,
    points: &AxisReportData,
    axis: &AxisVerification,
    units: RateUnit,
) -> Vec<Figure> {
    let scale = axis.scale_factor.as_ref().and_then(|proof| figures::scale_proof(axis.axis, proof));
    let floor = axis.noise_floor.as_ref().map(|floor| floor.value_dph);
    scale
        .into_iter()
        .chain(acceptance::flight_figure(axis))
        .chain(both_sides(report_data, points, &figures::OF_PROOF, floor, units))
        .map(|figure| figure.shown_in(units))
        .collect()
}

/// Parts common to fit and verification.
fn both_sides(
    report_data: &ReportData,
    points: &AxisReportData,
    words: &Wording,
    floor_dph: Option<f64>,
    units: RateUnit,
) -> Vec<Figure> {
    let all = [
        figures::over_time(report_data, points, words),
        figures::profile(report_data, points),
        figures::over_temperature(report_data, points, words),
        figures::residual(report_data, points, floor_dph),
        figures::histogram(points, floor_dph, units),
        figures::hysteresis(points, words),
    ];
    all.into_iter().flatten().collect()
}

fn subtitle(calibration: &Calibration, runs: usize) -> String {
    let unit = match calibration.unit {
        LogUnit::Counts { arcsec_per_count, .. } => format!("counts of {} arcsec", plain(arcsec_per_count)),
        LogUnit::Rates { .. } => "rates".to_owned(),
    };
    let sensor = calibration.setup.sensor.as_deref().map_or(String::new(), |sensor| format!("{sensor}; "));
    format!("{sensor}{} of {unit}, windows of {} s", counted(runs, "run", "runs"), plain(calibration.window_s))
}

fn tile(name: &str, number: &str, unit: &str) -> Markup {
    html! { div.tile { div.name { (name) } div.number { (number) " " span.unit { (unit) } } } }
}

/// Words with their axis, where there are several, else with a capital.
fn headline(axis: char, several: bool, words: &str) -> String {
    if several {
        return format!("Axis {axis}: {words}");
    }
    let mut rest = words.chars();
    rest.next().map_or(String::new(), |first| first.to_uppercase().chain(rest).collect())
}

/// A drift that is smaller by no more than this is not reduced: its σ scatters by some per cent.
const NO_GAIN: f64 = 1.05;

/// `drift reduced 94 times; remaining 8.3 °/h`; without a gain, that there is none.
fn reduced(times: f64, text: fn(f64) -> String, remaining_dph: f64, units: RateUnit) -> String {
    let gain = if times > NO_GAIN { format!("reduced {} times", text(times)) } else { "not reduced".to_owned() };
    format!("drift {gain}; remaining {}", units.text(remaining_dph, 3))
}

fn fit_verdict(axis: &AxisCalibration, report_data: &ReportData, several: bool, units: RateUnit) -> Markup {
    let held_out = axis.cross_validation().map(|cv| cv.sigma_dph);
    let floor = axis.noise_floor().map(|floor| floor.value_dph);
    let points = report_data.axes.iter().find(|points| points.axis == axis.axis);
    let used = points.map_or(0, |p| p.points.iter().filter(|p| p.excluded.is_none()).count());
    let all = points.map_or(0, |p| p.points.len());
    let logged = points.and_then(AxisReportData::logged_sigma_dph);
    let reduction = points.and_then(|points| points.reduction(held_out));
    let word = match (held_out, reduction) {
        (Some(held_out), Some(times)) => reduced(times, times_text, held_out, units),
        (Some(_), None) => "fitted; too few windows or no drift to compare with".to_owned(),
        (None, _) if axis.fit.as_ref().is_some_and(|fit| fit.prior.is_some()) => {
            "fitted with the prior of its fleet; the test is too short to check the drift on unseen data".to_owned()
        }
        (None, _) => "not fitted here".to_owned(),
    };
    let model = axis.correction.model.parse::<ModelSpec>().map_or(axis.correction.model.clone(), |spec| spec.words());
    html! {
        div.verdict {
            b.word { (headline(axis.axis, several, &word)) }
            p.note {
                "Model: " (model) " (" code { (axis.correction.model) } ")."
                @if let Some(ratio) = held_out.zip(floor).map(|(left, floor)| left / floor) {
                    " The remaining drift, on unseen data, is " (significant(ratio, 3)) " times the noise floor."
                }
            }
            div.tiles {
                @if let Some(value) = logged { (tile("drift as logged, σ", &units.number(value, 3), units.name())) }
                @if let Some(value) = held_out { (tile("on unseen data, σ", &units.number(value, 3), units.name())) }
                @if let Some(value) = floor { (tile("noise floor of a window", &units.number(value, 3), units.name())) }
                @if let Some(residual) = axis.residual() { (tile("σ of the fit's residuals", &units.number(residual.sigma_dph, 3), units.name())) }
                (tile("span", &format!("{:.1} … {:.1}", axis.span_c()[0], axis.span_c()[1]), "°C"))
                (tile("windows used", &format!("{used} of {all}"), ""))
            }
            @for note in axis.notes(units).iter().filter(|note| note.about != NoteAbout::ScaleFactor) { (said(note)) }
            @for prior in axis.fit.iter().flat_map(|fit| &fit.prior) { p.note { "SHA-256 of the prior: " (prior.sha256) "." } }
        }
    }
}

/// A note of a fit as a sentence.
fn said(note: &Note) -> Markup {
    let word = if note.level == NoteLevel::Warning { "Warning: " } else { "Note: " };
    html! { p.note { (word) (prose(&note.text)) "." } }
}

fn proof_verdict(axis: &AxisVerification, verification: &Verification, units: RateUnit) -> Markup {
    let several = verification.axes.len() > 1;
    let remaining_dph = axis.after.sigma_dph;
    let gained = match axis.improvement_sigma {
        _ if !verification.training_overlap.is_empty() => {
            "the fit has seen this log, so no reduction is stated".to_owned()
        }
        Some(times) => reduced(times, |times| significant(times, 3), remaining_dph, units),
        None => format!("remaining {}", units.text(remaining_dph, 3)),
    };
    let class = axis.pass.map_or("", |pass| if pass { "pass" } else { "fail" });
    let word = match axis.pass {
        Some(_) if several => format!("{}; {gained}", Judged::of(&axis.limits).words()),
        _ => gained,
    };
    let times = |ratio: Option<f64>| ratio.map_or("-".to_owned(), |r| significant(r, 3));
    html! {
        div class={ "verdict " (class) } {
            b.word { (headline(axis.axis, several, &word)) }
            div.tiles {
                (tile("max − min, before over after", &times(axis.improvement), ""))
                (tile("σ, before over after", &times(axis.improvement_sigma), ""))
                (tile("σ after", &units.number(axis.after.sigma_dph, 3), units.name()))
                @match &axis.noise_floor {
                    Some(floor) => {
                        (tile("noise floor", &units.number(floor.value_dph, 3), units.name()))
                        (tile("σ after over the floor", &significant(axis.after.sigma_dph / floor.value_dph, 3), ""))
                    }
                    None => { (tile("noise floor", "not known", "")) }
                }
                (tile("windows", &axis.after.n.to_string(), ""))
            }
            @if let Some(coverage) = &axis.coverage { p.note { "The test covers " (coverage.words()) "." } }
            @if axis.repeats_profile { p.note { "Note: " (REPEATED_PROFILE) "." } }
            @for (name, windows) in &axis.status_windows {
                p.note { "Status " (name) " in " (windows) " of " (axis.after.n) " windows." }
            }
        }
    }
}

fn same_log(verification: &Verification) -> Markup {
    html! {
        @if verification.training_unknown {
            p.note { "Note: an image does not name its training logs; nothing shows that this test is another one. Verify its record for a proof." }
        }
        @if !verification.training_overlap.is_empty() {
            div.verdict.fail {
                b.word { "This is no proof" }
                p { (verification.training_overlap.join(", ")) " is a log that the calibration was made from." }
            }
        }
    }
}

fn before_after(axis: &AxisVerification, verification: &Verification, units: RateUnit) -> Markup {
    let (factor, unit) = units.shown(&verification.unit);
    let row = |name: &str, f: &DriftValues| {
        html! {
            tr {
                td { (name) } td { (f.n) }
                @for value in [f.min, f.max, f.mean, f.peak_to_peak, f.sigma] {
                    // Counts have steps of their own; rates have none.
                    td { @if verification.unit == "deg/h" { (significant(factor * value, 5)) } @else { (format!("{value:.2}")) } }
                }
                td { (units.number(f.sigma_dph, 3)) }
            }
        }
    };
    html! {
        h3 { "Before and after, " (unit) }
        div.scroll { table {
            thead { tr { th { "" } th { "n" } th { "min" } th { "max" } th { "mean" } th { "max − min" } th { "σ" } th { "σ, " (units.name()) } } }
            (row("before", &axis.before))
            (row("after", &axis.after))
            @if let Some(floor) = &axis.noise_floor {
                tr {
                    td { "noise floor" } td { (floor.n) } td {} td {} td {}
                    td { (significant(factor * floor.expected_peak_to_peak, 3)) }
                    td { (significant(factor * floor.value, 3)) } td { (units.number(floor.value_dph, 3)) }
                }
            }
        } }
        @if let Some(floor) = &axis.noise_floor {
            p.note { "Floor: " (floor.source) ". Noise alone gives its max − min in " (floor.n) " windows." }
        }
    }
}

/// The scale factor over the plateaus, before and after.
fn scale_before_after(axis: &AxisVerification) -> Markup {
    let row = |name: &str, f: &ScaleValues| {
        html! { tr { td { (name) } @for value in [f.mean_ppm, f.peak_to_peak_ppm, f.sigma_ppm] { td { (significant(value, 3)) } } } }
    };
    html! {
        @if let Some(scale) = &axis.scale_factor {
            h3 { "Scale factor over " (scale.plateaus.len()) " plateaus, ppm from nominal" }
            div.scroll { table {
                thead { tr { th { "" } th { "mean" } th { "max − min" } th { "σ" } } }
                (row("before", &scale.before))
                (row("after", &scale.after))
                tr { td { "noise alone" } td {} td {} td { (significant(scale.of_noise_ppm, 3)) } }
            } }
        }
    }
}

/// Results of the rate table, plateau by plateau.
fn plateaus(axis: &AxisCalibration, units: RateUnit) -> Markup {
    let estimate = |e: Option<PpmEstimate>| e.map_or("-".to_owned(), |e| with_sigma(e.ppm, Some(e.sigma_ppm)));
    html! {
        @if let Some(scale) = axis.scale_factor() {
            h3 { "Scale factor" }
            p.note {
                "At " (axis.reference_c()) " °C: " (estimate(Some(scale.at_reference))) " ppm from nominal"
                @if let Some(s) = scale.arcsec_per_count { ", " (format!("{s:.8}")) " arcsec per count" } "."
                @if let Some(r) = scale.repeatability {
                    " Repeatability over " (r.temperatures) " temperatures: σ " (significant(r.sigma_ppm, 2)) " ppm; noise makes "
                    (significant(r.of_noise_ppm, 2)) "."
                }
            }
            div.scroll { table {
                thead { tr {
                    th { "plateau, °C" } th { "windows" } th.words { "rates, °/s" } th { "scale factor, ppm" } th { "rate at rest, " (units.name()) }
                    th { "nonlinearity, ppm" } th { "asymmetry, ppm" }
                } }
                @for p in &scale.plateaus {
                    tr {
                        td { (celsius(p.temperature_c)) } td { (p.windows) }
                        td.words { (p.rates_dps.iter().map(|r| significant(*r, 4)).collect::<Vec<_>>().join(", ")) }
                        td { (estimate(Some(p.scale))) } td { (units.with_sigma(p.bias_dph, Some(p.bias_sigma_dph))) }
                        td { (estimate(p.nonlinearity)) } td { (estimate(p.asymmetry)) }
                    }
                }
            } }
        }
        @for note in axis.notes(units).iter().filter(|note| note.about == NoteAbout::ScaleFactor) { (said(note)) }
        @for m in axis.fit.iter().flat_map(|fit| &fit.misalignment) {
            p.note { "The input axis is misaligned towards " (m.towards) " by " (with_sigma(m.arcsec, Some(m.sigma_arcsec))) " arcsec." }
        }
    }
}

/// Figures of the residual of the correction.
fn left(axis: &AxisVerification, units: RateUnit) -> Markup {
    let rows = axis.residual_diagnostics.rows(units);
    html! {
        @if !rows.is_empty() {
            h3 { "Residual" }
            div.scroll { table {
                thead { tr { th { "" } th { "value" } th { "of noise alone" } } }
                @for row in &rows { tr { @for cell in row { td { (cell) } } } }
            } }
            p.note {
                "Heating minus cooling shows hysteresis, a gradient or another lag. Steps across gaps show mode steps, where resets are marked "
                "invalid. Correlation of neighbours shows slow effects. The limits of noise are two standard errors of white residuals."
            }
        }
    }
}

/// Rows that a calibration leaves out, and a replay corrects as the gyro's processor does.
fn replayed(tallies: &[&Tally]) -> Markup {
    html! {
        @if !tallies.is_empty() {
            h3 { "Corrected as the gyro does it" }
            p { "A calibration leaves these rows out. The gyro's processor judges them by its own rules, and so did this test." }
            (reasons(tallies))
        }
    }
}

fn left_out(tallies: &[&Tally]) -> Markup {
    html! {
        h3 { "Left out" }
        @if tallies.is_empty() { p { "Nothing." } } @else { (reasons(tallies)) }
    }
}

fn reasons(tallies: &[&Tally]) -> Markup {
    html! {
        div.scroll { table {
            thead { tr { th { "reason" } th { "rows" } th.words { "first" } th.words { "meaning" } } }
            @for tally in tallies {
                tr {
                    td { (tally.reason.name().replace('_', " ")) } td { (tally.rows) }
                    td.words { (tally.first) } td.words { (tally.reason.meaning()) }
                }
            }
        } }
    }
}

fn inputs(inputs: &[LogFile]) -> Markup {
    html! {
        div.scroll { table {
            thead { tr { th { "log" } th { "rows" } th.words { "SHA-256" } } }
            @for input in inputs {
                tr { td { (input.file) } td { (input.rows) } td.hash { (input.sha256) } }
            }
        } }
    }
}

fn provenance(calibration: &Calibration) -> Result<Markup> {
    let record = hex(&sha256(calibration.to_json()?.as_bytes()));
    // A record without a serial number, or that fits no image, still has a report.
    let correction =
        (calibration.serial != UNASSIGNED).then(|| Correction::from_calibration(calibration.clone()).ok()).flatten();
    let from = &calibration.provenance;
    let thermometer = match calibration.thermometer_name().unwrap_or_default() {
        "" => "temperature_c".to_owned(),
        name => format!("temperature_c_{name}"),
    };
    Ok(html! {
        h2 { "Provenance" }
        (inputs(&from.inputs))
        div.scroll { table {
            tr { td { "program" } td.words { (from.program) } }
            tr { td { "newest sample, or SOURCE_DATE_EPOCH" } td.words { (from.time_s) " s (" (from.time_source) ")" } }
            tr { td { "thermometer" } td.words { (thermometer) } }
            tr { td { "target" } td.words {
                "tick " (calibration.target.tick_s() * 1e6) " µs, temperature period " (calibration.target.period_s()) " s"
            } }
            tr { td { "SHA-256 of the record" } td.hash { (record) } }
            @if let Some(correction) = correction {
                tr { td { "SHA-256 of its images, the first that export makes" } td.hash { (correction.sha256()) } }
            }
        } }
    })
}
