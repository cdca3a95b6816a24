//! A value checked against its limit: met, not met, not decided, not asked.
//!
//! ```text
//! guarded    met: value + 1.645σ within the limit · not met: value − 1.645σ beyond it · else not decided
//! no value   not decided, with the test that would give one
//! hours      of retest after which ± 1.645σ would not reach across the limit: h·((1.645σ/room)² − 1), for σ falls with √h
//! ```

use serde::{Deserialize, Serialize};

use sagnac_units::format::{significant, with_sigma};

/// One limit checked with its value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Verdict {
    /// Key of the limit.
    pub name: String,
    /// The limit.
    pub limit: f64,
    /// The value; null where it cannot be had (no floor): then the limit is not decided.
    pub value: Option<f64>,
    /// Standard error of the value, where it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma: Option<f64>,
    /// The value over every row, where some were excluded on request.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value_of_every_row: Option<f64>,
    /// The guard band reaches across the limit: hours of retest, beyond those of this one, after which it would no longer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub undecided_hours: Option<f64>,
    /// Room between value and limit as a part of the limit; negative where it is not met, null without a value or for a limit next to zero.
    pub margin: Option<f64>,
    /// Run whose value this is, where it is worse alone than all runs together.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub run: Option<String>,
    /// Temperature of the plateau whose value this is, °C, where the limit is not met.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plateau_c: Option<f64>,
    /// It is met; false where it is not met or not decided; null where it is not asked of such a retest.
    pub pass: Option<bool>,
    /// Why the value is not known or not asked; of a comparison also the records whose value it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
}

impl Verdict {
    /// The value for people, with its standard error.
    pub fn value_text(&self) -> String {
        match (self.value, self.sigma) {
            (Some(value), Some(sigma)) => with_sigma(value, Some(sigma)),
            (Some(value), None) => significant(value, 4),
            (None, _) => if self.pass.is_some() { "unknown" } else { "-" }.to_owned(),
        }
    }

    /// The margin for people: in per cent, or how often the bound is exceeded.
    pub fn margin_text(&self) -> String {
        match self.margin {
            Some(margin) if margin < -9.0 => format!("exceeds limit {}×", significant(1.0 - margin, 2)),
            Some(margin) => format!("{} %", significant(100.0 * margin, 2)),
            None => "-".to_owned(),
        }
    }

    /// `met`, `not met`, `not decided` or `not asked`.
    pub fn word(&self) -> &'static str {
        match self.pass {
            Some(true) => "met",
            Some(false) if self.is_open() => "not decided",
            Some(false) => "not met",
            None => "not asked",
        }
    }

    /// Not decided: the guard band reaches across the limit, or such a retest has no value for it.
    pub fn is_open(&self) -> bool {
        self.pass == Some(false) && (self.undecided_hours.is_some() || self.value.is_none())
    }

    /// Not met before not decided before met and not asked.
    pub(crate) fn is_worse_than(&self, other: &Self) -> bool {
        let rank = |verdict: &Self| match verdict.pass {
            Some(false) if !verdict.is_open() => 2,
            Some(false) => 1,
            Some(true) | None => 0,
        };
        rank(self) > rank(other)
    }

    /// What more a verdict says: how long a retest would decide, or why there is no value.
    pub fn remark(&self) -> Option<String> {
        let of_run = self.run.as_ref().map(|run| format!("{run} alone"));
        let more = match self.undecided_hours {
            Some(hours) if hours >= MOST_HOURS => {
                Some("the value lies at its limit: no longer retest decides".to_owned())
            }
            Some(hours) => Some(format!("{} more hours would decide", hours.ceil())),
            None => None,
        };
        let parts: Vec<String> = [of_run, more, self.why.clone()].into_iter().flatten().collect();
        (!parts.is_empty()).then(|| parts.join("; "))
    }
}

/// How many limits are met, not met, and not asked.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Judged {
    /// Met.
    pub met: usize,
    /// Not met.
    pub not_met: usize,
    /// Within the guard band: a longer retest would decide.
    pub not_decided: usize,
    /// Not asked of such a retest.
    pub not_asked: usize,
}

impl Judged {
    /// Counts verdicts.
    pub fn of<'a>(verdicts: impl IntoIterator<Item = &'a Verdict>) -> Self {
        let mut out = Self::default();
        for verdict in verdicts {
            *match verdict.pass {
                Some(true) => &mut out.met,
                Some(false) if verdict.is_open() => &mut out.not_decided,
                Some(false) => &mut out.not_met,
                None => &mut out.not_asked,
            } += 1;
        }
        out
    }

    /// `9 of 10 limits met, 1 not decided, 2 not asked of such a retest`.
    pub fn words(self) -> String {
        self.words_of("such a retest")
    }

    /// The same of what was judged.
    pub fn words_of(self, what: &str) -> String {
        let Self { met, not_met, not_decided, not_asked } = self;
        let part = |n: usize, what: &str| if n > 0 { format!(", {n} {what}") } else { String::new() };
        let undecided = part(not_decided, "not decided");
        let unasked = part(not_asked, &format!("not asked of {what}"));
        format!("{met} of {} limits met{undecided}{unasked}", met + not_met + not_decided)
    }
}

/// How a value with an uncertainty is compared with its limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DecisionRule {
    /// The value alone.
    #[default]
    Simple,
    /// With a guard band of 1.645 of the value's standard errors, as ISO 14253-1 has it: met where value and band are within
    /// the limit, not met where both are beyond it, else not decided.
    Guarded,
}

impl DecisionRule {
    /// The rule in a sentence.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Simple => "simple. The value alone decides: a unit at a limit is accepted in half of such tests.",
            Self::Guarded => {
                "guarded (ISO 14253-1). A limit is met where the value and 1.645 of its standard errors (±) are within the bound, not met \
                 where both are beyond it, else not decided. A unit beyond any limit is accepted in about 5 % of such tests, however many \
                 limits there are, for it must meet each."
            }
        }
    }
}

/// One-sided 95 %.
const GUARD_SIGMAS: f64 = 1.645;
/// Hours from which on no retest is proposed.
const MOST_HOURS: f64 = 1000.0;

/// Where a value lies.
pub(crate) enum Decided {
    Met,
    NotMet,
    /// More hours that would decide.
    After(f64),
}

impl DecisionRule {
    /// From the room to the limit (negative beyond it), its standard error, and the hours behind it. An uncertainty falls with
    /// the root of the hours.
    pub(crate) fn decide(self, room: f64, sigma: Option<f64>, hours: f64) -> Decided {
        let guard = match self {
            Self::Simple => 0.0,
            Self::Guarded => GUARD_SIGMAS * sigma.unwrap_or(0.0),
        };
        if room >= guard {
            Decided::Met
        } else if room < -guard {
            Decided::NotMet
        } else {
            let needed = (guard / room).powi(2) - 1.0;
            Decided::After(if needed.is_finite() { (hours * needed).min(MOST_HOURS) } else { MOST_HOURS })
        }
    }
}
