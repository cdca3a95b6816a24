//! The parts of an acceptance report: unit, rig, limits, verdict, room to sign.

use maud::{Markup, html};
use sagnac_log::setup::RateUnit;

use crate::figure::{Figure, Layer, Role, SOLID, rounded};
use crate::figures::figure;
use crate::prose::prose;
use crate::sheet::Sheet;
use sagnac::calibration::{Calibration, LogUnit};
use sagnac::verify::{
    AxisVerification, Bound, Estimate, Judged, LimitSpec, PositionError, SPECS, Verdict, Verification,
};
use sagnac_units::format::{celsius, file_name, plain, significant, unit, with_sigma};

/// True where the unit was checked against limits.
pub(crate) fn is_acceptance(verification: &Verification) -> bool {
    verification.axes.iter().any(|axis| axis.pass.is_some())
}

/// The verdict over all axes, with the retest and the limits.
pub(crate) fn identity(
    verification: &Verification,
    calibration: Option<&Calibration>,
    sheet: &Sheet,
    units: RateUnit,
) -> Markup {
    let accepted = verification.passed();
    let judged = Judged::of(verification.axes.iter().flat_map(|axis| &axis.limits));
    let word = match (accepted, judged.not_asked) {
        (true, _) if verification.training_unknown => "Limits met, training logs unknown",
        (true, 0) => "Accepted",
        (true, _) => "Accepted as far as asked",
        (false, _) if judged.not_met == 0 && judged.not_decided > 0 => "Not decided",
        (false, _) => "Not accepted",
    };
    let log = calibration.map(|c| match c.unit {
        LogUnit::Counts { arcsec_per_count, quantum } => {
            format!("counts of {} arcsec, quantum {quantum}", plain(arcsec_per_count))
        }
        LogUnit::Rates { .. } => "rates".to_owned(),
    });
    let unseen = verification.is_of_other_logs();
    let limits = verification.limits.as_ref();
    html! {
        @if !verification.untested_axes.is_empty() {
            p.note { "The retest lacks axes of the calibration: " (verification.untested_axes.iter().collect::<String>()) ". The unit is not accepted." }
        }
        @for objection in &verification.objections { p.note { "The unit is not accepted: " (prose(objection)) "." } }
        div class={ "verdict " (if accepted { "pass" } else { "fail" }) } { b.word { (word) ": " (judged.words()) (verification.reservations()) } }
        div.scroll { table {
            tr { td { "unit" } td.words { (verification.serial) } }
            @for (name, value) in specified(verification) { (entry(name, value.as_deref())) }
            @for (name, value) in sheet.entries() { (entry(name, value)) }
            (entry("sensor", verification.sensor.as_deref()))
            (entry("rig", verification.rig.as_deref()))
            @if let Some(log) = log { tr { td { "log" } td.words { (log) } } }
            @for test in &verification.inputs {
                tr {
                    td { "test" @if unseen { ", not seen by the fit" } }
                    td.words { (test.file) ", " (test.rows) " rows" br; span.hash { "SHA-256 " (test.sha256) } }
                }
            }
            @for (axes, words) in covered(verification) {
                tr { td { "temperatures, axis " (axes) } td.words { (words) } }
            }
            @if let Some(limits) = limits {
                @for (word, source) in [("limits", Some(limits)), ("limits start from", limits.base.as_deref())] {
                    @if let Some(source) = source {
                        tr { td { (word) } td.words { (file_name(&source.name)) br; span.hash { "SHA-256 " (source.sha256) } } }
                    }
                }
            }
            @for one in &verification.overrides { tr { td { "overridden" } td.words { (one.words(units)) } } }
            @for file in &verification.new_clocks { tr { td { "clock" } td.words { (file) " begins a new clock: the time before it is not known" } } }
            @for axis in &verification.axes {
                @if let Some(off) = &axis.flagged_off { tr { td { "axis " (axis.axis) } td.words { (off.words(units)) } } }
            }
            tr { td { "record, SHA-256" } td.hash { (verification.record_sha256) } }
            tr { td { "images judged, SHA-256" } td.hash { (verification.image_sha256) } }
            tr { td { "program" } td.words { (verification.program) } }
        } }
    }
}

/// Customer, part with revision, and specification: as the limits file states them, else lines to fill in by hand.
fn specified(verification: &Verification) -> [(&'static str, Option<String>); 3] {
    let stated = verification.limits.as_ref().and_then(|limits| limits.specification.clone()).unwrap_or_default();
    let revision = stated.revision.map(|revision| format!("revision {revision}"));
    let part: Vec<String> = stated.part.into_iter().chain(revision).collect();
    let part = (!part.is_empty()).then(|| part.join(", "));
    [("customer", stated.customer), ("part, revision", part), ("specification", stated.number)]
}

/// An entry of the head; a blank line to fill in by hand by default.
fn entry(name: &str, value: Option<&str>) -> Markup {
    html! { tr { td { (name) } td.words { @match value { Some(value) => { (value) } None => { span.pen {} } } } } }
}

/// The temperatures that the test covers, axes that cover the same in one line.
fn covered(verification: &Verification) -> Vec<(String, String)> {
    let mut all: Vec<(String, String)> = Vec::new();
    for axis in &verification.axes {
        let rates = axis.tested_cpm().map_or(String::new(), |cpm| format!("; at most {} °C/min", significant(cpm, 2)));
        let Some(words) = axis.coverage.as_ref().map(|coverage| coverage.words() + &rates) else { continue };
        match all.iter_mut().find(|(_, known)| *known == words) {
            Some((axes, _)) => *axes += &format!(", {}", axis.axis),
            None => all.push((axis.axis.to_string(), words)),
        }
    }
    all
}

/// Every limit with its verdict: on one page, whether of one axis or of three.
pub(crate) fn limits(verification: &Verification) -> Markup {
    let source = verification.limits.as_ref();
    let paragraphs = source.and_then(|limits| Some(&limits.specification.as_ref()?.paragraphs));
    let words = |key: &str| {
        let (words, unit) = limit_words(key);
        let paragraph = paragraphs.and_then(|all| all.get(key));
        (paragraph.map_or(words.clone(), |paragraph| format!("{words} (§{paragraph})")), unit)
    };
    let judged: Vec<&AxisVerification> = verification.axes.iter().filter(|axis| !axis.limits.is_empty()).collect();
    html! {
        @match judged.as_slice() {
            [] => {}
            [axis] => { h3 { "Limits" } (limits_of_one(axis, words)) }
            axes => {
                h3 { "Limits" }
                (limits_of_all(axes, words))
            }
        }
    }
}

/// The limits of one axis with their margins.
fn limits_of_one(axis: &AxisVerification, words_of: impl Fn(&str) -> (String, String)) -> Markup {
    let excluding = axis.excluded_fraction.is_some();
    html! {
        div.scroll { table {
            thead { tr {
                th { "limit" } th { "bound" } th { "value" }
                @if excluding { th { "of every row" } }
                th { "margin" } th.words { "" }
            } }
            @for limit in &axis.limits {
                @let (words, its_unit) = words_of(&limit.name);
                tr {
                    td.words { (words) @if !its_unit.is_empty() { ", " (its_unit) } } td { (bound_text(limit)) }
                    td { (limit.value_text()) }
                    @if excluding { td { (limit.value_of_every_row.map_or("-".to_owned(), |value| significant(value, 4))) } }
                    td { (limit.margin_text()) }
                    (verdict_cell(limit, axis.failing_place(&limit.name)))
                }
            }
        } }
    }
}

fn verdict_cell(limit: &Verdict, place: Option<String>) -> Markup {
    html! {
        @match limit.pass {
            Some(true) => { td.pass.words { (limit.word()) } }
            Some(false) => { td.fail.words { (limit.word()) @if let Some(place) = place { " " (place) } } }
            None => { td.unit { (limit.word()) } }
        }
    }
}

/// The limits of several axes, a column each.
fn limits_of_all(axes: &[&AxisVerification], words_of: impl Fn(&str) -> (String, String)) -> Markup {
    let mut names: Vec<&str> = Vec::new();
    for limit in axes.iter().flat_map(|axis| &axis.limits) {
        if !names.contains(&limit.name.as_str()) {
            names.push(&limit.name);
        }
    }
    let judged = |axis: &AxisVerification, name: &str| axis.limits.iter().find(|limit| limit.name == name).cloned();
    let is_asked = |name: &&str| axes.iter().any(|axis| judged(axis, name).is_some_and(|limit| limit.pass.is_some()));
    let (names, unasked): (Vec<&str>, Vec<&str>) = names.into_iter().partition(is_asked);
    let unasked: Vec<String> = unasked.into_iter().map(|name| limit_words(name).0).collect();
    html! {
        div.scroll { table {
            thead { tr {
                th { "limit" } th { "bound" }
                @for axis in axes { th { "axis " (axis.axis) } }
            } }
            @for name in names {
                @let (words, its_unit) = words_of(name);
                @let bound = axes.iter().find_map(|axis| judged(axis, name)).map_or(String::new(), |limit| bound_text(&limit));
                tr {
                    td.words { (words) @if !its_unit.is_empty() { ", " (its_unit) } } td { (bound) }
                    @for axis in axes {
                        @match judged(axis, name) {
                            Some(limit) => {
                                td class=(match limit.pass { Some(true) => "judged pass", Some(false) => "judged fail", None => "judged" }) {
                                    (limit.value_text()) br; span.verdict-word { (limit.word()) @if let Some(place) = axis.failing_place(name) { " " (place) } }
                                }
                            }
                            None => { td { "-" } }
                        }
                    }
                }
            }
            @if !unasked.is_empty() {
                tr { td.words colspan=(2 + axes.len()) { b { "Not asked of any axis: " } (unasked.join("; ")) } }
            }
        } }
    }
}

/// Behind the signatures: why a limit is not met, not decided or not asked, how limits decide, and what is suspected.
pub(crate) fn remarks(verification: &Verification, units: RateUnit) -> Markup {
    let several = verification.axes.len() > 1;
    let mut unasked: Vec<(String, String)> = Vec::new();
    for axis in &verification.axes {
        for limit in axis.limits.iter().filter(|limit| limit.pass.is_none()) {
            let words = format!(
                "Not asked: {}: {}.",
                limit_words(&limit.name).0,
                limit.why.as_deref().unwrap_or("it is of another test")
            );
            match unasked.iter_mut().find(|(_, known)| *known == words) {
                Some((axes, _)) => *axes += &format!(", {}", axis.axis),
                None => unasked.push((axis.axis.to_string(), words)),
            }
        }
    }
    html! {
        @for axis in verification.axes.iter().filter(|axis| !axis.limits.is_empty()) {
            @for limit in axis.limits.iter().filter(|limit| limit.pass.is_some()) {
                @if let Some(remark) = limit.remark() {
                    p.note.why {
                        @if several { "Axis " (axis.axis) ": " }
                        (limit_words(&limit.name).0) ": " (limit.word()) ", " (prose(&remark)) "."
                    }
                }
            }
            @if axis.about_common_mean {
                p.note { "Each run covers little of the temperatures: the figures are about the mean of all runs, not each run's own." }
            }
            (suspects(axis, units))
        }
        @for (axes, words) in &unasked {
            p.note { @if several && axes.split(", ").count() < verification.axes.len() { "Axis " (axes) ": " } (words) }
        }
        @if let Some(rule) = verification.limits.as_ref().and_then(|limits| limits.decision) { p.note { "Decision rule applied: " (rule.words()) } }
        @if !several { p.note { "Margin: the distance to the bound, as a fraction of it." } }
    }
}

/// A limit's name for people, and its unit.
fn limit_words(name: &str) -> (String, String) {
    let Some(spec) = spec_of(name) else { return (name.to_owned(), String::new()) };
    (spec.label.to_owned(), unit(spec.unit))
}

/// `≤ 0.01000` or `≥ 0.9000`.
fn bound_text(limit: &Verdict) -> String {
    let sign = match spec_of(&limit.name).map(|spec| spec.bound) {
        Some(Bound::Least) => "≥",
        Some(Bound::Most) | None => "≤",
    };
    format!("{sign} {}", significant(limit.limit, 4))
}

fn spec_of(name: &str) -> Option<&'static LimitSpec> {
    SPECS.iter().find(|spec| spec.key == name)
}

/// The residual, figure by figure.
pub(crate) fn residual(axis: &AxisVerification, units: RateUnit) -> Markup {
    let left = &axis.residual;
    let estimate = |e: Estimate| units.with_sigma(e.value, Some(e.sigma));
    let (rate, per) = (|| units.name().to_owned(), |of: &str| format!("{} per {of}", units.name()));
    let (walk_factor, walk_unit) = units.shown("deg/rt h");
    let mut rows: Vec<(String, String, String)> = Vec::new();
    if let Some(p) = left.plateaus {
        let name = format!("largest plateau offset of {}, at {} °C", p.plateaus, celsius(p.worst_offset_temperature_c));
        rows.push((name, estimate(p.worst_offset_dph), rate()));
        rows.push(("largest σ within a plateau".to_owned(), units.number(p.worst_sigma_dph, 3), rate()));
    }
    if let Some(rms) = left.ramps_rms_dph {
        rows.push(("root mean square in ramps".to_owned(), units.number(rms, 3), rate()));
    }
    if let Some(offset) = left.ramp_offset_dph {
        rows.push(("mean of ramps less mean of soaks".to_owned(), estimate(offset), rate()));
    }
    if let Some(memory) = left.memory {
        let name = format!("memory at {} °C: after heating less after cooling", celsius(memory.temperature_c));
        rows.push((name, estimate(memory.difference_dph), rate()));
    }
    if let Some(slope) = left.temperature_slope {
        rows.push(("drift with temperature".to_owned(), estimate(slope), per("°C")));
    }
    if let Some(slope) = left.rate_slope {
        rows.push(("drift with its rate".to_owned(), estimate(slope), per("°C/min")));
    }
    if let Some(walk) = left.random_walk {
        rows.push((
            "angle random walk before".to_owned(),
            significant(walk_factor * walk.before_deg_rt_h, 3),
            walk_unit.clone(),
        ));
        rows.push((
            "angle random walk after".to_owned(),
            significant(walk_factor * walk.after_deg_rt_h, 3),
            walk_unit.clone(),
        ));
    }
    if let Some(smooth) = left.over_temperature_dph {
        rows.push(("smooth residual over temperature, rms".to_owned(), estimate(smooth), rate()));
    }
    if let Some(b) = left.bias_instability_dph {
        rows.push(("bias instability, from the least Allan deviation".to_owned(), estimate(b), rate()));
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
        @if let Some(why) = &axis.flight_unavailable { p.note { "The stated flight is not available: " (prose(why)) "." } }
    }
}

/// Position error over the flight.
pub(crate) fn flight_figure(axis: &AxisVerification) -> Option<Figure> {
    let flown: &PositionError = axis.flight.as_ref()?;
    let title = "Position error of the flight";
    let caption = "The drift over temperature, flown through the stated temperature profile. The curves are without noise: the table gives its \
                   spread."
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
fn suspects(axis: &AxisVerification, units: RateUnit) -> Markup {
    let judged = if axis.excluded_fraction.is_some() { "excluded where asked" } else { "judged with the rest" };
    html! {
        @for suspect in &axis.suspects { p.note { "Suspected " (suspect.words(units)) "; " (judged) "." } }
    }
}

/// Fixed bias of each run against the calibration.
pub(crate) fn bias_repeatability(axis: &AxisVerification, units: RateUnit) -> Markup {
    let text = |e: Estimate| units.with_sigma(e.value, Some(e.sigma));
    html! {
        @if let Some(repeatability) = &axis.bias_repeatability {
            h3 { "Fixed bias against the calibration, " (units.name()) }
            div.scroll { table {
                thead { tr { th.words { "" } th { "fixed bias" } th { "less the calibration's" } } }
                tr { td { "calibration; " (repeatability.input_text(units)) } td { (text(repeatability.calibration_dph)) } td { "-" } }
                @for run in &repeatability.runs {
                    tr { td { (file_name(&run.file)) } td { (text(run.bias_dph)) } td { (text(run.difference_dph)) } }
                }
            } }
            @if let Some(turn_ons) = repeatability.turn_ons {
                p.note {
                    "Turn-on to turn-on: σ " (units.text(turn_ons.sigma_dph, 2)) " over " (turn_ons.n) " stated turn-ons, those of the calibration included; below "
                    (units.text(turn_ons.sigma_upper_dph, 2)) " with 95 % confidence."
                }
            }
        }
        @if let Some(why) = &axis.bias_repeatability_unavailable {
            p.note { "The fixed bias is not judged against the calibration: " (prose(why)) "." }
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
