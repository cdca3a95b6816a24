//! Stamps that go back: a counter of 32 bits that wraps, or a clock that starts again.
//!
//! A wrap has one reading: 2³² units are added. A restart begins a run of its own; its times go on an hour later, so that nothing joins
//! it to the rows before. Single rows out of order stay as they are, and so does a log that repeats its own first rows.
//! A row from later on counts as out of order itself, and not those after it.
//!
//! Fails at a restart less than eight stamps before the end of a piece: those rows count as out of order, and the run begins after them.

use crate::ingest::columns::raw::{MAX_TIME, NO_TIME, RawRows};

/// Stamps that go on after a restart.
const GOING_ON: usize = 8;
/// A pause of so many intervals, or of a minute, may lie within a wrap.
const PAUSE_ROWS: i64 = 1000;
const PAUSE_NS: i64 = 60_000_000_000;
/// Restarts that are named.
const MOST_WORDS: usize = 3;
/// Time that is put between two runs, ns.
const BETWEEN_RUNS_NS: i64 = 3_600_000_000_000;

/// Follows the stamps of a log.
#[derive(Debug)]
pub(crate) struct UnbrokenClock {
    /// Between two stamps, ns.
    interval_ns: i64,
    /// 2³² units of the time column, ns; `None` for dates.
    wrap_ns: Option<i64>,
    offset_ns: i64,
    last_ns: Option<i64>,
    /// The first rows of each run: times and angles.
    first_rows: Vec<Vec<(i64, Vec<u64>)>>,
    /// The rows are those of a run before, until the clock goes on.
    repeats: bool,
    pub(crate) wraps: u32,
    /// Line of the first row of each further run.
    pub(crate) restarts: Vec<u64>,
}

impl UnbrokenClock {
    /// `places` are the decimal places from the unit to ns, `u32::MAX` for dates.
    pub(crate) fn new(interval_ns: i64, places: u32) -> Self {
        let wrap_ns = 10_i64.checked_pow(places).and_then(|unit_ns| unit_ns.checked_mul(1 << 32));
        Self {
            interval_ns,
            wrap_ns,
            offset_ns: 0,
            last_ns: None,
            first_rows: Vec::new(),
            repeats: false,
            wraps: 0,
            restarts: Vec::new(),
        }
    }

    /// Makes the stamps of a piece go on. Where the clock starts again within it, the rows from there on are returned, untouched: the first
    /// piece of the next run.
    pub(crate) fn mend(&mut self, rows: &mut RawRows) -> Option<RawRows> {
        if self.last_ns.is_none() {
            self.first_rows.push(rows_from(rows, 0));
        }
        let goes_on = self.last_ns <= rows.time_ns.first().copied() && rows.time_ns.is_sorted();
        let is_sound = rows.time_ns.last().is_some_and(|last_ns| last_ns.unsigned_abs() < MAX_TIME);
        if self.offset_ns == 0 && goes_on && is_sound && rows.time_ns[0] != NO_TIME {
            self.last_ns = rows.time_ns.last().copied();
            return None;
        }
        for at in 0..rows.len() {
            let Some(stamp) = rows.sound_time(at) else { continue };
            let mut time_ns = stamp.saturating_add(self.offset_ns);
            if let Some(last_ns) = self.last_ns.filter(|last_ns| time_ns < *last_ns) {
                let back_ns = last_ns.saturating_sub(time_ns);
                if let Some(wrap_ns) = self.wrap_ns.filter(|wrap_ns| self.is_wrap(wrap_ns.saturating_sub(back_ns))) {
                    self.offset_ns = self.offset_ns.saturating_add(wrap_ns);
                    self.wraps += 1;
                    time_ns = time_ns.saturating_add(wrap_ns);
                } else if self.is_restart(rows, at, back_ns) && !self.repeats_a_run(rows, at) {
                    self.restarts.push(rows.line_of(at));
                    self.offset_ns = self.offset_ns.saturating_add(back_ns).saturating_add(BETWEEN_RUNS_NS);
                    self.last_ns = None;
                    return Some(rows.split_off(at));
                }
            }
            rows.time_ns[at] = match self.last_ns.filter(|_| self.is_out_of_order(rows, at, time_ns)) {
                Some(last_ns) => last_ns - 1,
                None => {
                    self.repeats &= self.last_ns > Some(time_ns);
                    self.last_ns = self.last_ns.max(Some(time_ns));
                    time_ns
                }
            };
        }
        None
    }

    /// Wraps and restarts, a sentence each.
    pub(crate) fn words(&self) -> Vec<String> {
        let times = |n: u32| if n == 1 { "once".to_owned() } else { format!("{n} times") };
        let wraps = (self.wraps > 0).then(|| format!("the clock of 32 bits wraps {}", times(self.wraps)));
        let restarts = self.restarts.iter().take(MOST_WORDS);
        let restarts =
            restarts.map(|line| format!("the clock starts again at line {line}: a run of its own begins there"));
        wraps.into_iter().chain(restarts).collect()
    }

    fn is_wrap(&self, step_ns: i64) -> bool {
        (1..=PAUSE_NS.max(PAUSE_ROWS.saturating_mul(self.interval_ns))).contains(&step_ns)
    }

    /// The rows from here on are those of a run before, as in a log that was written twice.
    fn repeats_a_run(&mut self, rows: &RawRows, at: usize) -> bool {
        self.repeats |= self.first_rows.contains(&rows_from(rows, at));
        self.repeats
    }

    /// A row from later on, after which most of the next three go on as before it.
    fn is_out_of_order(&self, rows: &RawRows, at: usize, time_ns: i64) -> bool {
        let Some(last_ns) =
            self.last_ns.filter(|last_ns| time_ns.saturating_sub(*last_ns) > self.interval_ns.saturating_mul(2))
        else {
            return false;
        };
        let next = (at + 1..rows.len()).filter_map(|row| rows.sound_time(row)).take(3);
        let before = |next: &i64| (last_ns + 1..time_ns).contains(&next.saturating_add(self.offset_ns));
        next.filter(before).count() > 1
    }

    /// The rows from here on go on by themselves, far from where the clock was.
    fn is_restart(&self, rows: &RawRows, at: usize, back_ns: i64) -> bool {
        let next = rows_from(rows, at);
        let step_ns = |pair: &[(i64, Vec<u64>)]| pair[1].0.saturating_sub(pair[0].0);
        let goes_on = |step_ns: i64| (1..=self.interval_ns.saturating_mul(4)).contains(&step_ns);
        back_ns > self.interval_ns.saturating_mul(GOING_ON as i64)
            && next.len() == GOING_ON
            && next.windows(2).all(|pair| goes_on(step_ns(pair)))
    }
}

/// Times and angles of the next sound rows, the first of each stamp.
fn rows_from(rows: &RawRows, at: usize) -> Vec<(i64, Vec<u64>)> {
    let mut before = None;
    let mut is_new = |stamp: i64| before.replace(stamp) != Some(stamp);
    let stamps =
        (at..rows.len()).filter_map(|row| Some((row, rows.sound_time(row)?))).filter(|(_, stamp)| is_new(*stamp));
    let angles = |row: usize| rows.axes.iter().map(|column| column[row].to_bits()).collect();
    stamps.map(|(row, stamp)| (stamp, angles(row))).take(GOING_ON).collect()
}
