//! Time between the files of a retest: that of one clock is missing, that before a new clock is not known.
//!
//! ```text
//! unseen       start of a run less the end of the run before, where it is later: a cut
//! new clock    a run that starts before the end of the run before
//! ```
//!
//! Where the setup states that files are separate tests (`--runs`), or all of them one (`--one-run`), there is neither. Fails where the
//! clock of a later test happens to go on behind that of the one before.

use sagnac_log::setup::{RunDivision, Setup};
use sagnac_units::format::file_name;

use crate::window::Run;

/// Files whose clock begins again before the end of the file before, where nobody stated that they are separate tests.
pub(crate) fn new_clocks(runs: &[Run], setup: &Setup) -> Vec<String> {
    let is_new = |pair: &&[Run]| setup.runs == RunDivision::Auto && pair[1].start_ns < pair[0].end_ns;
    runs.windows(2).filter(is_new).filter_map(|pair| Some(file_name(&pair[1].files.first()?.summary.file))).collect()
}

/// Time between files of one clock, ns, where nobody stated that they are separate tests: nobody has seen it.
pub(crate) fn unseen_ns(runs: &[Run], setup: &Setup) -> i64 {
    // A clock that begins again within a file leaves a part of it behind, without the file's hash.
    let is_whole = |run: &Run| run.files.last().is_some_and(|file| !file.summary.sha256.is_empty());
    let gap_ns = |pair: &[Run]| pair[1].start_ns.saturating_sub(pair[0].end_ns).max(0);
    let pairs = runs.windows(2).filter(|pair| setup.runs == RunDivision::Auto && is_whole(&pair[0]));
    pairs.map(gap_ns).fold(0, i64::saturating_add)
}
