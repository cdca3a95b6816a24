//! A verification in short: one verdict for the unit, limits as rows and axes as columns, and the gain.

use sagnac::verify::{AxisVerification, Bound, DecisionRule, Judged, LimitSpec, SPECS, Verdict, Verification};
use sagnac_log::setup::RateUnit;
use sagnac_units::format::{counted, significant, with_sigma};

use crate::output::brief::{Brief, Remark};
use crate::output::terminal::{MOST_COLUMNS, Tone, lines_of};

/// Up to so many limits are all shown; of more those that are not met or not decided.
const ALL_SHOWN: usize = 7;
/// Limits shown of more.
const SHOWN: usize = 5;

/// With what was written.
pub(crate) fn verification_brief(
    verification: &Verification,
    rule: DecisionRule,
    wrote: &[String],
    units: RateUnit,
) -> Brief {
    let (word, tone, verdict) = verdict(verification, units);
    let mut body = limits(verification, units);
    if !body.is_empty() {
        body.push(String::new());
    }
    body.push(gain(verification));
    let judged = verification.axes.iter().any(|axis| axis.pass.is_some());
    let rule = match rule {
        DecisionRule::Simple => "rule: simple (the value alone)",
        DecisionRule::Guarded => "rule: guarded (95 % sure)",
    };
    let rule = judged.then(|| rule.to_owned());
    let wrote = (!wrote.is_empty()).then(|| format!("wrote {}", wrote.join(", ")));
    let last = [rule, wrote, Some("details: -v".to_owned())].into_iter().flatten().collect::<Vec<_>>().join("      ");
    Brief {
        of: verification.serial.clone(),
        word,
        tone,
        verdict,
        body,
        remarks: remarks(verification, units),
        last: vec![last],
    }
}

fn verdict(verification: &Verification, units: RateUnit) -> (&'static str, Tone, String) {
    let judged = |axis: &AxisVerification| Judged::of(&axis.limits);
    let axes = &verification.axes;
    let total = Judged::of(axes.iter().flat_map(|axis| &axis.limits));
    let asked = total.met + total.not_met + total.not_decided;
    let most = axes.iter().map(judged).map(|j| j.met + j.not_met + j.not_decided).max().unwrap_or(0);
    let all = counted(most, "limit", "limits");
    // `axes x, z miss 1 of 7 limits`; `axis x misses 2, axis z 1 of 7 limits`.
    let per_axis = |count: fn(Judged) -> usize, [one, several]: [&str; 2]| {
        let bad: Vec<(char, usize)> =
            axes.iter().map(|axis| (axis.axis, count(judged(axis)))).filter(|(_, n)| *n > 0).collect();
        let letters: Vec<String> = bad.iter().map(|(axis, _)| axis.to_string()).collect();
        match bad.as_slice() {
            [] => String::new(),
            [(axis, n)] => format!("axis {axis} {one} {n} of {all}"),
            [(_, n), rest @ ..] if rest.iter().all(|(_, other)| other == n) => {
                format!("axes {} {several} {n} of {all}", letters.join(", "))
            }
            [(axis, n), rest @ ..] => {
                let more: Vec<String> = rest.iter().map(|(axis, n)| format!("axis {axis} {n}")).collect();
                format!("axis {axis} {one} {n}, {} of {all}", more.join(", "))
            }
        }
    };
    let not = |why: String| ("NOT ACCEPTED", Tone::Bad, why);
    if axes.iter().all(|axis| axis.pass.is_none()) {
        let words = axes.iter().map(|axis| format!("axis {} {}", axis.axis, over_floor(axis, units)));
        return ("", Tone::Plain, format!("no limits given; {}", words.collect::<Vec<_>>().join(", ")));
    }
    if !verification.training_overlap.is_empty() {
        return not("the calibration was made from this log".to_owned());
    }
    if let Some(objection) = verification.objections.first() {
        return not(objection.clone());
    }
    if total.not_met > 0 {
        return not(per_axis(|judged| judged.not_met, ["misses", "miss"]));
    }
    if total.not_decided > 0 {
        let hours = axes.iter().flat_map(|axis| &axis.limits).filter_map(|limit| limit.undecided_hours);
        let longest = hours.fold(0.0, f64::max);
        let more = if longest > 0.0 && longest < 1000.0 {
            format!("; {} more hours would", longest.ceil())
        } else {
            String::new()
        };
        return (
            "NOT DECIDED",
            Tone::Open,
            per_axis(|judged| judged.not_decided, ["leaves open", "leave open"]) + &more,
        );
    }
    if !verification.untested_axes.is_empty() {
        let missing: Vec<String> = verification.untested_axes.iter().map(char::to_string).collect();
        return not(format!("the retest has no axis {}", missing.join(", ")));
    }
    let met = format!("{} met{}", counted(asked, "limit", "limits"), verification.reservations());
    match verification.training_unknown {
        true => (
            "LIMITS MET",
            Tone::Open,
            format!("{met}; an image does not name its training logs: verify its calibration"),
        ),
        false => ("ACCEPTED", Tone::Good, met),
    }
}

fn over_floor(axis: &AxisVerification, units: RateUnit) -> String {
    let sigma = format!("σ {}", units.text(axis.after.sigma_dph, 3));
    axis.noise_floor.as_ref().map_or(sigma.clone(), |floor| {
        format!("{sigma}, {} of the noise floor", significant(axis.after.sigma_dph / floor.value_dph, 3))
    })
}

fn spec_of(name: &str) -> Option<&'static LimitSpec> {
    SPECS.iter().find(|spec| spec.key == name)
}

/// How bad a limit is over all axes: 3 not met, 2 not decided, 1 met, 0 not asked.
fn rank(verdicts: &[&Verdict]) -> u8 {
    let of_one = |verdict: &&Verdict| match verdict.pass {
        Some(false) if !verdict.is_open() => 3,
        Some(false) => 2,
        Some(true) => 1,
        None => 0,
    };
    verdicts.iter().map(of_one).max().unwrap_or(0)
}

/// The limits as rows, and those that are not shown in one line.
fn limits(verification: &Verification, units: RateUnit) -> Vec<String> {
    let mut names: Vec<&str> = Vec::new();
    for limit in verification.axes.iter().flat_map(|axis| &axis.limits) {
        if !names.contains(&limit.name.as_str()) {
            names.push(&limit.name);
        }
    }
    let of_name = |name: &str| -> Vec<&Verdict> {
        let of_axis = |axis| -> Option<&Verdict> { AxisVerification::limit(axis, name) };
        verification.axes.iter().filter_map(of_axis).collect()
    };
    let (shown, hidden): (Vec<&str>, Vec<&str>) = if names.len() <= ALL_SHOWN {
        (names, Vec::new())
    } else {
        let mut bad: Vec<&str> = names.iter().copied().filter(|name| rank(&of_name(name)) > 1).collect();
        bad.sort_by_key(|name| std::cmp::Reverse(rank(&of_name(name))));
        bad.truncate(SHOWN);
        let rest = names.iter().copied().filter(|name| !bad.contains(name)).collect();
        (bad, rest)
    };
    let table = |sigmas: bool| {
        let axes = verification.axes.iter().map(|axis| axis.axis.to_string());
        let head = ["".to_owned(), "limit".to_owned()].into_iter().chain(axes).chain([String::new()]).collect();
        let rows = shown.iter().map(|name| row(verification, name, &of_name(name), units, sigmas));
        lines_of(&[head].into_iter().chain(rows).collect::<Vec<_>>())
    };
    // Three axes in a large unit have small numbers: their σ go before a line wraps.
    let fits = |lines: &Vec<String>| lines.iter().all(|line| line.chars().count() <= MOST_COLUMNS);
    let lines =
        if shown.is_empty() { Vec::new() } else { Some(table(true)).filter(fits).unwrap_or_else(|| table(false)) };
    lines.into_iter().chain(summary(&hidden, of_name)).collect()
}

fn row(verification: &Verification, name: &str, verdicts: &[&Verdict], units: RateUnit, sigmas: bool) -> Vec<String> {
    let (label, bound, of_unit, is_fraction) = spec_of(name)
        .map_or((name, Bound::Most, "", false), |spec| (spec.label, spec.bound, spec.unit, spec.is_fraction()));
    let (scale, of_unit) = if is_fraction { (100.0, "%".to_owned()) } else { units.shown(of_unit) };
    let sign = if bound == Bound::Most { "≤" } else { "≥" };
    let limit = verdicts.first().map_or(0.0, |verdict| verdict.limit);
    let mark = match rank(verdicts) {
        3 => "FAIL ",
        2 => "open ",
        _ => "     ",
    };
    let value = |axis: &AxisVerification| {
        let Some(verdict) = axis.limit(name) else { return "-".to_owned() };
        match (verdict.value, verdict.sigma) {
            (Some(value), Some(sigma)) if sigmas && verdict.pass == Some(false) => {
                with_sigma(scale * value, Some(scale * sigma))
            }
            (Some(value), _) => significant(scale * value, 3),
            (None, _) => if verdict.pass.is_some() { "unknown" } else { "n/a" }.to_owned(),
        }
    };
    let cells = verification.axes.iter().map(value);
    let limit = format!("{sign} {} {of_unit}", significant(scale * limit, 3)).trim_end().to_owned();
    [format!("{mark}{}", label.trim_end_matches(", fraction")), limit]
        .into_iter()
        .chain(cells)
        .chain([verification.axes.iter().find_map(|axis| axis.failing_place(name)).unwrap_or_default()])
        .collect()
}

/// `13 met, 3 not asked (needs a retest on a rate table)`.
fn summary<'a>(hidden: &[&'a str], of_name: impl Fn(&str) -> Vec<&'a Verdict>) -> Option<String> {
    let with = |wanted: u8| hidden.iter().filter(|name| rank(&of_name(name)) == wanted).count();
    let unasked = hidden.iter().filter(|name| rank(&of_name(name)) == 0);
    let mut reasons: Vec<&str> = unasked
        .filter_map(|name| of_name(name).first().copied())
        .filter_map(|verdict| verdict.why.as_deref())
        .collect();
    reasons.sort_unstable();
    reasons.dedup();
    let why = reasons.first().map_or(String::new(), |first| match reasons.len() {
        1 => format!(" ({first})"),
        more => format!(" ({first}, and {} more)", more - 1),
    });
    if with(1) == hidden.len() {
        // The verdict says it already.
        return None;
    }
    let part = |n: usize, words: &str| (n > 0).then(|| format!("{n} {words}"));
    let parts =
        [part(with(3), "more not met"), part(with(2), "more open"), part(with(1), "met"), part(with(0), "not asked")];
    let words: Vec<String> = parts.into_iter().flatten().collect();
    (!words.is_empty()).then(|| format!("     {}{why}", words.join(", ")))
}

fn gain(verification: &Verification) -> String {
    let times = |axis: &AxisVerification| axis.improvement_sigma.map_or("-".to_owned(), |times| significant(times, 3));
    let all: Vec<String> = verification.axes.iter().map(times).collect();
    let seen = match (verification.training_unknown, verification.training_overlap.is_empty()) {
        (true, _) => "a test that the fit may have seen",
        (_, true) => "a test the fit has not seen",
        (_, false) => "a log of the fit: no proof",
    };
    let hours = verification.axes.iter().map(|axis| axis.hours).fold(0.0, f64::max);
    let spans = verification.axes.iter().filter_map(|axis| axis.coverage.map(|coverage| coverage.tested_c));
    let span = spans.reduce(|[lo, hi], [a, b]| [lo.min(a), hi.max(b)]);
    let span = span.map_or(String::new(), |[lo, hi]| format!(", {lo:.0} … {hi:.0} °C"));
    let fastest = verification.axes.iter().filter_map(AxisVerification::tested_cpm).reduce(f64::max);
    let rates = fastest.map_or(String::new(), |cpm| format!(", to {} °C/min", significant(cpm, 2)));
    format!("drift reduced {} times on {seen} ({} h{span}{rates})", all.join(", "), significant(hours, 2))
}

fn remarks(verification: &Verification, units: RateUnit) -> Vec<Remark> {
    let copies = verification
        .training_overlap
        .iter()
        .map(|file| Remark::warning(format!("{file} is a log of the calibration: verify another test")));
    let judged = verification.axes.iter().any(|axis| axis.pass.is_some());
    let objections = verification.objections.iter().skip(usize::from(judged)).cloned().map(Remark::warning);
    let overrides = verification.overrides.iter().map(|one| Remark::note(format!("overridden: {}", one.words(units))));
    let clocks = verification.new_clocks.iter().map(|file| new_clock(file));
    let clocks = clocks.chain(verification.unseen_h.map(unseen)).map(Remark::note);
    let of_axis = move |axis: &AxisVerification| {
        let about = |text: String| Remark { is_warning: true, axes: vec![axis.axis], text };
        let repeats = axis.repeats_profile.then(|| {
            about("this test repeats the calibration's profile: it proves nothing for other profiles".to_owned())
        });
        let flight = axis.flight_unavailable.as_ref().map(|why| about(format!("no flight: {why}")));
        let judged = if axis.excluded_fraction.is_some() { "" } else { "; it is judged with the rest" };
        let suspects = axis.suspects.iter().map(|suspect| about(format!("suspected {}{judged}", suspect.words(units))));
        let flagged = axis.flagged_off.as_ref().map(|off| about(off.words(units)));
        repeats.into_iter().chain(flight).chain(flagged).chain(suspects).collect::<Vec<_>>()
    };
    copies.chain(objections).chain(overrides).chain(clocks).chain(verification.axes.iter().flat_map(of_axis)).collect()
}

/// A file whose clock begins again.
pub(crate) fn new_clock(file: &str) -> String {
    format!("{file} begins a new clock: the time before it is not known (--runs: separate tests, --one-run: one)")
}

/// Time between files of one clock.
pub(crate) fn unseen(hours: f64) -> String {
    format!("{} h between files of one clock count as missing (--runs: they are separate tests)", significant(hours, 3))
}
