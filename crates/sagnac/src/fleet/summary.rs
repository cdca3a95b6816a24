//! A run of a fleet in words: a line a unit, in the order of the manifest, and what all came to.

use std::collections::BTreeMap;

use serde::Serialize;

use super::{Acceptance, AxisResult, Done, Refusal, Unit, UnitOutcome, UnitResult};
use sagnac_units::format::{counted, significant};

/// What a run of a fleet came to.
#[derive(Clone, Debug, Default, Serialize)]
#[non_exhaustive]
pub struct Summary {
    /// Units.
    pub units: usize,
    /// Those with a record.
    pub calibrated: usize,
    /// Those whose data cannot support a calibration.
    pub refused: usize,
    /// Those with a record from before, whose logs cannot be read now.
    pub not_renewed: usize,
    /// Those with a log or setup that cannot be read.
    pub failed: usize,
    /// Of those with a retest and limits: how many met them, and how many did not or could not be judged.
    pub met: usize,
    /// How many did not, or could not be judged.
    pub not_met: usize,
    /// Not done again, because nothing had changed.
    pub unchanged: usize,
    /// Each unit, for scripts.
    pub results: Vec<UnitResult>,
}

impl Summary {
    fn count(&mut self, result: &UnitResult, is_kept: bool) {
        self.units += 1;
        *match result.outcome {
            UnitOutcome::Calibrated => &mut self.calibrated,
            UnitOutcome::Refused => &mut self.refused,
            UnitOutcome::NotRenewed => &mut self.not_renewed,
            UnitOutcome::Failed => &mut self.failed,
        } += 1;
        self.met += usize::from(result.acceptance == Acceptance::Met);
        self.not_met += usize::from(result.acceptance.is_bad());
        self.unchanged += usize::from(is_kept);
    }

    /// True where every unit has a record of its logs and no retest was failed.
    pub fn is_good(&self) -> bool {
        self.calibrated == self.units && self.not_met == 0
    }

    /// In one line.
    pub fn words(&self) -> String {
        let mut out = format!(
            "{}: {} calibrated, {} refused, {} failed",
            counted(self.units, "unit", "units"),
            self.calibrated,
            self.refused,
            self.failed
        );
        if self.not_renewed > 0 {
            out += &format!(", {} not renewed", self.not_renewed);
        }
        if self.met + self.not_met > 0 {
            out += &format!("; limits met by {} of {}", self.met, self.met + self.not_met);
        }
        if self.unchanged > 0 {
            out += &format!("; {} unchanged since before", self.unchanged);
        }
        out
    }
}

/// Units as they are done, in the order of the manifest.
#[derive(Debug, Default)]
pub struct InOrder {
    width: usize,
    keeps: bool,
    waiting: BTreeMap<usize, (UnitResult, bool)>,
    next: usize,
    summary: Summary,
}

impl InOrder {
    /// For these units; with each result in the summary, or without.
    pub fn new(units: &[Unit], keeps: bool) -> Self {
        let width = units.iter().map(|unit| unit.name.len()).max().unwrap_or(0);
        Self { width, keeps, ..Self::default() }
    }

    /// One more unit, in any order. The lines that can be said now.
    pub fn take(&mut self, done: Done) -> Vec<String> {
        self.waiting.insert(done.place, (done.result, done.is_kept));
        let mut lines = Vec::new();
        while let Some((result, is_kept)) = self.waiting.remove(&self.next) {
            let (width, kept) = (self.width, if is_kept { " (unchanged)" } else { "" });
            lines.push(format!("{:width$}  {}{kept}", result.unit, result.words()));
            self.summary.count(&result, is_kept);
            if self.keeps {
                self.summary.results.push(result);
            }
            self.next += 1;
        }
        lines
    }

    /// What all came to.
    pub fn summary(self) -> Summary {
        self.summary
    }
}

impl UnitResult {
    /// In one line.
    pub fn words(&self) -> String {
        if let Some(refusal) = &self.refusal {
            return format!("{}: {}", self.outcome.name(), words(refusal));
        }
        let axes = self.axes.iter().map(axis).collect::<Vec<_>>().join("; ");
        let judged = match (&self.retest_refusal, self.acceptance) {
            (Some(refusal), _) => format!("; retest not judged: {}", words(refusal)),
            (None, Acceptance::NoRetest | Acceptance::NoLimits) => String::new(),
            (None, acceptance) => format!("; limits {}", acceptance.name()),
        };
        axes + &judged
    }
}

fn words(refusal: &Refusal) -> String {
    let place = if refusal.place.is_empty() { String::new() } else { format!("{}: ", refusal.place) };
    place + &refusal.reason
}

fn axis(result: &AxisResult) -> String {
    let residual =
        result.residual_dph.map_or(String::new(), |sigma| format!(", residual σ {} °/h", significant(sigma, 3)));
    let floors = result.residual_dph.zip(result.noise_floor_dph).filter(|(_, floor)| *floor > 0.0);
    let floors =
        floors.map_or(String::new(), |(sigma, floor)| format!(" ({} of the floor)", significant(sigma / floor, 3)));
    let not_met = if result.limits_not_met().is_empty() {
        String::new()
    } else {
        format!(", not met: {}", result.limits_not_met().join(" "))
    };
    format!("{} `{}`{residual}{floors}{not_met}", result.axis, result.model)
}
