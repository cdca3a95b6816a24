//! Time between the files of a retest: that of one clock is missing, that before a new clock is not known.
//!
//! ```text
//! one clock    runs in the order of their times, none of which begins before the one before has ended
//! unseen       the time between them, whatever the order in which they were given
//! new clock    a run that begins before the one before has ended
//! ```
//!
//! Where the setup states that files are separate tests (`--runs`), or all of them one (`--one-run`), there is neither. Fails where the
//! clock of a later test happens to go on behind that of the one before.

use sagnac_log::setup::{RunDivision, Setup};
use sagnac_units::format::file_name;

use crate::window::Run;

/// Runs may overlap by this, ns: the row that two files share.
fn shared_ns(run: &Run, interval_ns: i64) -> i64 {
    (run.end_ns - run.start_ns).min(3 * interval_ns / 2)
}

/// What the times of runs say of one another.
#[derive(Clone, Debug, Default)]
pub(crate) struct Clocks {
    /// Time between files of one clock, ns: nobody has seen it.
    pub(crate) unseen_ns: i64,
    /// Files whose clock begins again.
    pub(crate) new: Vec<String>,
}

impl Clocks {
    /// Of runs with rows of an interval.
    pub(crate) fn of(runs: &[Run], interval_ns: i64, setup: &Setup) -> Self {
        let mut clocks = Self::default();
        if setup.runs != RunDivision::Auto {
            return clocks;
        }
        // A clock that begins again within a file leaves a part of it behind, without the file's hash: its times say nothing of the next.
        let is_whole = |run: &Run| run.files.last().is_some_and(|file| !file.summary.sha256.is_empty());
        for group in runs.chunk_by(|before, _| is_whole(before)) {
            let mut sorted: Vec<&Run> = group.iter().collect();
            sorted.sort_by_key(|run| run.start_ns);
            for pair in sorted.windows(2) {
                let gap_ns = pair[1].start_ns.saturating_sub(pair[0].end_ns);
                if gap_ns < -shared_ns(pair[1], interval_ns) {
                    clocks.new.extend(pair[1].files.first().map(|file| file_name(&file.summary.file)));
                } else {
                    clocks.unseen_ns = clocks.unseen_ns.saturating_add(gap_ns.max(0));
                }
            }
        }
        clocks
    }
}
