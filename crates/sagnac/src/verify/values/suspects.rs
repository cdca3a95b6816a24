//! Stretches of a retest that look like bumps, steps or start-up: reported with place and size, and judged like all others.

use sagnac_log::setup::RateUnit;
use serde::{Deserialize, Serialize};

use crate::window::{Windows, suspected};
use sagnac_log::ingest::Reason;
use sagnac_units::format::file_name;
use sagnac_units::s_from_ns;

/// Windows on each side that a stretch is compared with.
const BESIDE: usize = 5;

/// Windows one after the other that do not follow their neighbours.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct Suspect {
    /// What they look like.
    pub reason: Reason,
    /// File of the run.
    pub file: String,
    /// Start, h since the start of the run.
    pub start_h: f64,
    /// End, h since the start of the run.
    pub end_h: f64,
    /// Windows.
    pub windows: usize,
    /// Their mean rate less that of the windows next to them, °/h; none where no window next to them is used.
    pub size_dph: Option<f64>,
}

impl Suspect {
    /// `step of -0.31 °/h at 3.25 … 4.25 h of cycle.csv`.
    pub fn words(&self, units: RateUnit) -> String {
        let what = self.reason.name().replace('_', " ");
        let size = self.size_dph.map_or_else(|| "unknown size".to_owned(), |dph| units.text(dph, 2));
        let file = file_name(&self.file);
        format!("{what} of {size} at {:.2} … {:.2} h of {file}", self.start_h, self.end_h)
    }
}

/// Of an axis of the retest as logged.
pub(crate) fn suspects(windows: &Windows, axis: usize) -> Vec<Suspect> {
    let marks = suspected(windows, axis);
    let rows = &windows.rows;
    let follows =
        |a: &(usize, Reason), b: &(usize, Reason)| b.0 == a.0 + 1 && a.1 == b.1 && rows.run[a.0] == rows.run[b.0];
    let stretch = |stretch: &[(usize, Reason)]| {
        let (first, last, reason) = (stretch[0].0, stretch[stretch.len() - 1].0, stretch[0].1);
        let run = rows.run[first];
        let beside = |i: &usize| rows.run[*i] == run && rows.excluded[*i].is_none();
        let before = (first.saturating_sub(BESIDE)..first).filter(beside);
        let after = (last + 1..windows.len().min(last + 1 + BESIDE)).filter(beside);
        let of_run = &windows.runs[run as usize];
        let hours = |ns: i64| s_from_ns(ns - of_run.start_ns) / 3600.0;
        let own = mean(windows, axis, first..=last);
        let level = mean(windows, axis, before.chain(after));
        Suspect {
            reason,
            file: of_run.name(),
            start_h: hours(rows.start_ns[first]),
            end_h: hours(rows.end_ns[last]),
            windows: stretch.len(),
            size_dph: own.zip(level).map(|(own, level)| own - level),
        }
    };
    marks.chunk_by(follows).map(stretch).collect()
}

fn mean(windows: &Windows, axis: usize, members: impl Iterator<Item = usize>) -> Option<f64> {
    let (sum, n) = members.fold((0.0, 0.0), |(sum, n), i| (sum + windows.rate_dph(axis, i), n + 1.0));
    (n > 0.0).then(|| sum / n)
}
