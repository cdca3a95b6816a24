//! The parts of an acceptance report: unit, rig, limits, verdict, room to sign.

use maud::{Markup, html};

use crate::figure::{Figure, Layer, Role, SOLID, rounded};
use crate::figures::figure;
use sagnac::calibration::{Calibration, LogUnit};
use sagnac::verify::{AxisVerification, Bound, Estimate, Judged, PositionError, SPECS, Verification};
use sagnac_units::format::{celsius, plain, significant, unit, with_sigma};

/// True where the unit was checked against limits.
pub(crate) fn is_acceptance(verification: &Verification) -> bool {
    verification.axes.iter().any(|axis| axis.pass.is_some())
}

/// The verdict over all axes, with the retest and the limits.
pub(crate) fn identity(verification: &Verification, calibration: Option<&Calibration>) -> Markup {
    let accepted = verification.passed();
    let judged = Judged::of(verification.axes.iter().flat_map(|axis| &axis.limits));
    let word = match (accepted, judged.not_asked) {
        (true, 0) => "Accepted",
        (true, _) => "Accepted as far as asked",
        (false, _) if judged.not_met == 0 && judged.not_decided > 0 => "Not decided",
        (false, _) => "Not accepted",
    };
    let not_stated = || "not stated in the setup".to_owned();
    let log = calibration.map(|c| match c.unit {
        LogUnit::Counts { arcsec_per_count, quantum } => {
            format!("counts of {} arcsec, quantum {quantum}", plain(arcsec_per_count))
        }
        LogUnit::Rates { .. } => "rates".to_owned(),
    });
    // An image alone does not say what it was made from.
    let unseen = calibration.is_some() && verification.training_overlap.is_empty();
    let limits = verification.limits.as_ref();
    html! {
        @if !verification.untested_axes.is_empty() {
            p.note { "The retest lacks axes of the calibration: " (verification.untested_axes.iter().collect::<String>()) ". The unit is not accepted." }
        }
        div class={ "verdict " (if accepted { "pass" } else { "fail" }) } { b.word { (word) ": " (judged.words()) } }
        div.scroll { table {
            tr { td { "unit" } td.words { (verification.serial) } }
            tr { td { "sensor" } td.words { (verification.sensor.clone().unwrap_or_else(not_stated)) } }
            tr { td { "rig" } td.words { (verification.rig.clone().unwrap_or_else(not_stated)) } }
            @if let Some(log) = log { tr { td { "log" } td.words { (log) } } }
            @for test in &verification.inputs {
                tr {
                    td { "test" @if unseen { ", not seen by the fit" } }
                    td.words { (test.file) ", " (test.rows) " rows" br; span.hash { "SHA-256 " (test.sha256) } }
                }
            }
            @for axis in &verification.axes {
                @if let Some(coverage) = &axis.coverage {
                    tr { td { "temperatures, axis " (axis.axis) } td.words { (coverage.words()) } }
                }
            }
            @if let Some(limits) = limits {
                @for (word, source) in [("limits", Some(limits)), ("limits start from", limits.base.as_deref())] {
                    @if let Some(source) = source {
                        tr { td { (word) } td.words { (source.name) br; span.hash { "SHA-256 " (source.sha256) } } }
                    }
                }
            }
            tr { td { "record, SHA-256" } td.hash { (verification.record_sha256) } }
            tr { td { "images judged, SHA-256" } td.hash { (verification.image_sha256) } }
            tr { td { "program" } td.words { (verification.program) } }
        } }
    }
}

/// Every limit with its value, its margin and its verdict, axis by axis.
pub(crate) fn limits(verification: &Verification) -> Markup {
    let several = verification.axes.len() > 1;
    html! {
        @for axis in verification.axes.iter().filter(|axis| !axis.limits.is_empty()) {
            h3 { "Limits" @if several { " of axis " (axis.axis) } }
            div.scroll { table {
                @let excluding = axis.excluded_fraction.is_some();
                thead { tr {
                    th { "limit" } th.words { "unit" } th { "bound" } th { "value" }
                    @if excluding { th { "of every row" } }
                    th { "margin" } th.words { "" }
                } }
                @for limit in &axis.limits {
                    @let (words, its_unit) = limit_words(&limit.name);
                    tr {
                        td.words { (words) } td.unit { (its_unit) } td { (significant(limit.limit, 4)) }
                        td { (limit.value_text()) }
                        @if excluding { td { (limit.value_of_every_row.map_or("-".to_owned(), |value| significant(value, 4))) } }
                        td { (limit.margin_text()) }
                        @match limit.pass {
                            Some(true) => { td.pass.words { (limit.word()) } }
                            Some(false) => { td.fail.words { (limit.word()) } }
                            None => { td.unit { (limit.word()) } }
                        }
                    }
                    @if let Some(remark) = limit.remark().filter(|_| limit.pass.is_some()) {
                        tr.why { td colspan="7" { (limit.word()) ": " (remark) } }
                    }
                }
            } }
            @for limit in axis.limits.iter().filter(|limit| limit.pass.is_none()) {
                p.note { "Not asked: " (limit_words(&limit.name).0) ": " (limit.why.as_deref().unwrap_or("it is of another test")) "." }
            }
            p.note { "Guarded: met where the value and 1.645 of its standard errors (±) are within the bound, not met where both are beyond it, else not decided. Simple: the value alone decides. Margin: the distance to the bound, as a fraction of it." }
            @if axis.about_common_mean {
                p.note { "Each run covers little of the temperatures: the figures are about the mean of all runs, not each run's own." }
            }
            (suspects(axis))
        }
    }
}

/// A limit's name for people, and its unit.
fn limit_words(name: &str) -> (String, String) {
    let Some(spec) = SPECS.iter().find(|spec| spec.key == name) else { return (name.to_owned(), String::new()) };
    let bound = match spec.bound {
        Bound::Most => "at most",
        Bound::Least => "at least",
    };
    (format!("{}, {bound}", spec.label), unit(spec.unit))
}

/// The residual, figure by figure.
pub(crate) fn residual(axis: &AxisVerification) -> Markup {
    let left = &axis.residual;
    let estimate = |e: Estimate| with_sigma(e.value, Some(e.sigma));
    let mut rows: Vec<(String, String, &str)> = Vec::new();
    if let Some(p) = left.plateaus {
        let name = format!(
            "farthest of {} plateaus from the mean, at {} °C",
            p.plateaus,
            celsius(p.worst_offset_temperature_c)
        );
        rows.push((name, estimate(p.worst_offset_dph), "°/h"));
        rows.push(("largest σ within a plateau".to_owned(), significant(p.worst_sigma_dph, 3), "°/h"));
    }
    if let Some(rms) = left.ramps_rms_dph {
        rows.push(("root mean square in ramps".to_owned(), significant(rms, 3), "°/h"));
    }
    if let Some(slope) = left.temperature_slope {
        rows.push(("drift with temperature".to_owned(), estimate(slope), "°/h per °C"));
    }
    if let Some(slope) = left.rate_slope {
        rows.push(("drift with its rate".to_owned(), estimate(slope), "°/h per °C/min"));
    }
    if let Some(walk) = left.random_walk {
        rows.push(("angle random walk before".to_owned(), significant(walk.before_deg_rt_h, 3), "°/√h"));
        rows.push(("angle random walk after".to_owned(), significant(walk.after_deg_rt_h, 3), "°/√h"));
    }
    if let Some(smooth) = left.over_temperature_dph {
        rows.push(("smooth residual over temperature, rms".to_owned(), estimate(smooth), "°/h"));
    }
    if let Some(b) = left.bias_instability_dph {
        rows.push(("bias instability, from the least Allan deviation".to_owned(), estimate(b), "°/h"));
    }
    html! {
        @if !rows.is_empty() {
            h3 { "Residual of the corrected gyro" }
            div.scroll { table {
                thead { tr { th { "" } th { "value" } th.words { "unit" } } }
                @for (name, value, unit) in &rows { tr { td { (name) } td { (value) } td.words { (unit) } } }
            } }
        }
    }
}

/// Result of the stated flight.
pub(crate) fn flight(axis: &AxisVerification) -> Markup {
    let metres = |e: Estimate| with_sigma(e.value, Some(e.sigma));
    html! {
        @if let Some(flown) = &axis.flight {
            h3 { "Position error of the stated flight, m" }
            p.note { "Stated: " (flown.stated.described()) "." }
            div.scroll { table {
                thead { tr { th { "after " (significant(flown.minutes, 3)) " min" } th { "m" } } }
                tr { td { "by the drift as logged" } td { (metres(flown.before_m)) } }
                tr { td { "by the drift as corrected" } td { (metres(flown.after_m)) } }
                tr { td { "as corrected, most on the way" } td { (significant(flown.most_after_m, 3)) } }
                tr { td { "the same with two of its σ" } td { (significant(flown.bound_after_m, 3)) } }
                @if let Some(heading) = flown.heading {
                    tr { td { "across the track, by a heading error of " (metres(heading.heading_arcmin)) " arcmin" } td { (metres(heading.cross_track_m)) } }
                }
                @if let Some(noise) = flown.noise_m { tr { td { "angle random walk alone, σ" } td { (significant(noise, 3)) } } }
            } }
        }
        @if let Some(why) = &axis.flight_unavailable { p.note { "The stated flight is not available: " (why) "." } }
    }
}

/// Position error over the flight.
pub(crate) fn flight_figure(axis: &AxisVerification) -> Option<Figure> {
    let flown: &PositionError = axis.flight.as_ref()?;
    let title = "What the drift does to the position";
    let caption = "The drift over temperature that the windows show, flown through the stated profile of temperature. Noise is not in these \
                   curves: it leaves no distance of its own but a spread, which the table gives beside them."
        .to_owned();
    let mut out = figure(axis.axis, "flight", title, caption, ["time of flight, min", "position error, m"], "flight");
    let curve = |label: &str, role: Role, y: &[f64]| Layer::Line {
        label: label.to_owned(),
        role,
        x: rounded(flown.at_minutes.iter().copied()),
        y: rounded(y.iter().copied()),
        dash: if role == Role::Before { role.dash() } else { SOLID },
    };
    out.layers.push(curve("as logged", Role::Before, &flown.curve_before_m));
    out.layers.push(curve("corrected", Role::After, &flown.curve_after_m));
    out.framed(true)
}

/// Stretches that look like disturbances, with place and size.
fn suspects(axis: &AxisVerification) -> Markup {
    let judged = if axis.excluded_fraction.is_some() { "excluded where asked" } else { "judged with the rest" };
    html! {
        @for suspect in &axis.suspects { p.note { "Suspected " (suspect.words()) "; " (judged) "." } }
    }
}

/// Fixed bias of each run against the calibration.
pub(crate) fn bias_repeatability(axis: &AxisVerification) -> Markup {
    let text = |e: Estimate| with_sigma(e.value, Some(e.sigma));
    html! {
        @if let Some(found) = &axis.bias_repeatability {
            h3 { "Fixed bias against the calibration, °/h" }
            div.scroll { table {
                thead { tr { th.words { "" } th { "fixed bias" } th { "less the calibration's" } } }
                tr { td { "calibration, input rate " (significant(found.input_rate_dph, 5)) " °/h" } td { (text(found.calibration_dph)) } td { "-" } }
                @for run in &found.runs {
                    tr { td { (sagnac_units::format::file_name(&run.file)) } td { (text(run.bias_dph)) } td { (text(run.difference_dph)) } }
                }
            } }
            @if let Some(turn_ons) = found.turn_ons {
                p.note {
                    "Turn-on to turn-on: σ " (significant(turn_ons.sigma_dph, 2)) " °/h over " (turn_ons.n) " runs, those of the calibration included; below "
                    (significant(turn_ons.sigma_upper_dph, 2)) " °/h with 95 % confidence."
                }
            }
        }
        @if let Some(why) = &axis.bias_repeatability_unavailable {
            p.note { "The fixed bias is not judged against the calibration: " (why) "." }
        }
    }
}

/// Room for names, on the page of the verdict.
pub(crate) fn signatures() -> Markup {
    html! {
        div.signatures {
            @for role in ["Tested by", "Accepted by"] {
                div { p { (role) } p.line { "Name" } p.line { "Date" } p.line { "Signature" } }
            }
        }
    }
}
