//! Where a record is at rest, from the rows alone.
//!
//! ```text
//! rows ─▶ blocks of 1 s, 16 rows at least ─▶ variance within each ─▶ moving: over 100 times that of the quiet twentieth ─▶ longest rest
//! ```
//!
//! Three blocks in a row are motion; one is a shock. Wrong rows, however many, leave quarters of their blocks quiet. A long record has longer blocks, each with the larger variance of its
//! two halves, so memory does not grow with it.
//!
//! Fails where a record moves from its first row to its last (its curve has a hump instead: [`Hump`](sagnac_noise::Hump)), and where a
//! table turns at one even rate.

use sagnac_log::ingest::{Batch, LogShape};
use sagnac_noise::RowPlace;
use sagnac_units::format::significant;
use sagnac_units::s_from_ns;
use serde::Serialize;

/// Least length of a block.
const BLOCK_S: f64 = 1.0;
const LEAST_ROWS: u64 = 16;
/// More blocks than this are joined in pairs.
const MOST_BLOCKS: usize = 1 << 14;
/// Fewer blocks show no quiet part.
const FEWEST_BLOCKS: usize = 20;
/// Parts of a block.
const QUARTERS: usize = 4;
/// Part of the blocks that is quiet in any record worth its name.
const QUIET_PART: usize = 20;
/// Variance over that of a quiet block: ten times in deviation.
const MOVING: f64 = 100.0;
/// Blocks in a row that are motion; fewer quiet ones between two of them are no rest.
const TOGETHER: usize = 3;

/// Part of a record without motion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RestSpan {
    /// File of its first row.
    pub file: String,
    /// Line of its first row.
    pub first_line: u64,
    /// File of its last row.
    pub last_file: String,
    /// Line of its last row.
    pub last_line: u64,
    /// Length, s.
    pub length_s: f64,
    /// First and last row.
    #[serde(skip)]
    rows: [RowPlace; 2],
}

impl std::fmt::Display for RestSpan {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { file, first_line, last_file, last_line, length_s, .. } = self;
        let length = if *length_s < 600.0 {
            format!("{} s", significant(*length_s, 3))
        } else {
            format!("{} h", significant(length_s / 3600.0, 3))
        };
        if file == last_file {
            write!(f, "{length}, lines {first_line} … {last_line} of {file}")
        } else {
            write!(f, "{length}, line {first_line} of {file} … line {last_line} of {last_file}")
        }
    }
}

impl RestSpan {
    /// The rows of a batch of this log that lie in it.
    pub(crate) fn rows_of(&self, log: u32, batch: &Batch) -> std::ops::Range<usize> {
        let [first, last] = self.rows;
        let place = |line: &u64| RowPlace { log, line: *line };
        let before = batch.line.partition_point(|line| place(line) < first);
        before..batch.line.partition_point(|line| place(line) <= last)
    }
}

/// Motion and rest of a record.
#[derive(Clone, Debug, PartialEq)]
pub struct Rest {
    /// Time with motion, s, and of the whole.
    pub moving_s: f64,
    /// Length of all blocks, s.
    pub length_s: f64,
    /// The longest rest; `None` where all of it moves.
    pub longest: Option<RestSpan>,
}

/// A block of rows.
#[derive(Clone, Copy)]
struct Block {
    run: u32,
    length_ns: i64,
    rows: [RowPlace; 2],
}

/// The block that is being read.
#[derive(Clone)]
struct OpenBlock {
    block: Block,
    count: u64,
    /// Per axis: the first value, and per quarter the number of values, the sum of the values less it and of their squares.
    sums: Vec<(f64, [[f64; 3]; QUARTERS])>,
}

/// Variance of n values by their sum and that of their squares.
fn variance([n, sum, squares]: [f64; 3]) -> f64 {
    (squares - sum * sum / n).max(0.0) / (n - 1.0).max(1.0)
}

/// Variance of a block, and that of its motion: a motion slower than the block has a 16th of it in a quarter, a shock has all of it in one.
fn variances(quarters: &[[f64; 3]; QUARTERS]) -> [f64; 2] {
    let whole = quarters.iter().fold([0.0; 3], |[n, sum, squares], of| [n + of[0], sum + of[1], squares + of[2]]);
    let mut each = quarters.map(variance);
    each.sort_by(f64::total_cmp);
    let whole = variance(whole);
    [whole, whole.min((QUARTERS * QUARTERS) as f64 * each[1])]
}

/// Judges rows as they are read.
#[derive(Clone)]
pub(crate) struct RestWatch {
    block_rows: u64,
    nominal_ns: i64,
    run: u32,
    /// Logs that were read to their end.
    files: Vec<String>,
    blocks: Vec<Block>,
    /// Per axis and block: its variance, and that of its motion.
    variance: Vec<Vec<[f64; 2]>>,
    open: Option<OpenBlock>,
    /// Per axis: the last value and the least step between two, which is that of the counter or of the digits.
    steps: Vec<[f64; 2]>,
}

impl RestWatch {
    pub(crate) fn new(shape: &LogShape) -> Self {
        Self {
            block_rows: LEAST_ROWS.max((BLOCK_S / s_from_ns(shape.nominal_ns)) as u64),
            nominal_ns: shape.nominal_ns,
            run: 0,
            files: Vec::new(),
            blocks: Vec::new(),
            variance: vec![Vec::new(); shape.axes.len()],
            open: None,
            steps: vec![[f64::NAN, f64::INFINITY]; shape.axes.len()],
        }
    }

    /// The next rows; those that cover more than an interval are no samples of a rate.
    pub(crate) fn push(&mut self, batch: &Batch) {
        for row in 0..batch.len() {
            let length_ns = batch.end_ns[row] - batch.start_ns[row];
            if batch.valid[row] && 2 * length_ns <= 3 * self.nominal_ns {
                self.row(batch, row, length_ns);
            }
        }
    }

    fn row(&mut self, batch: &Batch, row: usize, length_ns: i64) {
        let place = RowPlace { log: self.files.len() as u32, line: batch.line[row] };
        let block = Block { run: self.run, length_ns: 0, rows: [place; 2] };
        let values = || batch.angle.iter().map(|column| column[row]);
        let open = self.open.get_or_insert_with(|| OpenBlock {
            block,
            count: 0,
            sums: values().map(|value| (value, [[0.0; 3]; QUARTERS])).collect(),
        });
        let quarter = ((open.count * QUARTERS as u64 / self.block_rows) as usize).min(QUARTERS - 1);
        open.count += 1;
        open.block.length_ns += length_ns;
        open.block.rows[1] = place;
        for ((value, (first, quarters)), [before, least]) in values().zip(&mut open.sums).zip(&mut self.steps) {
            let off = value - *first;
            let [n, sum, squares] = &mut quarters[quarter];
            *n += 1.0;
            *sum += off;
            *squares += off * off;
            let step = (value - std::mem::replace(before, value)).abs();
            if step > 1e-9 * value.abs() && step < *least {
                *least = step;
            }
        }
        if open.count >= self.block_rows {
            self.close();
        }
    }

    fn close(&mut self) {
        let Some(OpenBlock { block, count, sums }) = self.open.take() else { return };
        if count < LEAST_ROWS {
            return;
        }
        self.blocks.push(block);
        for (column, (_, quarters)) in self.variance.iter_mut().zip(sums) {
            column.push(variances(&quarters));
        }
        if self.blocks.len() >= MOST_BLOCKS {
            self.join_pairs();
        }
    }

    fn join_pairs(&mut self) {
        self.block_rows *= 2;
        let (mut at, mut kept) = (0, 0);
        while at < self.blocks.len() {
            let next = self.blocks.get(at + 1).filter(|next| next.run == self.blocks[at].run).copied();
            let block = self.blocks[at];
            self.blocks[kept] = next.map_or(block, |next| Block {
                length_ns: block.length_ns + next.length_ns,
                rows: [block.rows[0], next.rows[1]],
                ..block
            });
            for column in &mut self.variance {
                let larger = |of: usize| column[at][of].max(column[at + 1][of]);
                column[kept] = if next.is_some() { [larger(0), larger(1)] } else { column[at] };
            }
            (at, kept) = (at + 1 + usize::from(next.is_some()), kept + 1);
        }
        self.blocks.truncate(kept);
        self.variance.iter_mut().for_each(|column| column.truncate(kept));
    }

    pub(crate) fn end_run(&mut self) {
        self.close();
        self.run += 1;
    }

    pub(crate) fn end_file(&mut self, file: &str) {
        self.files.push(file.to_owned());
    }

    /// `None` from too few blocks.
    pub(crate) fn finish(mut self) -> Option<Rest> {
        self.close();
        if self.blocks.len() < FEWEST_BLOCKS {
            return None;
        }
        let mut moves = vec![false; self.blocks.len()];
        for (column, [_, step]) in self.variance.iter().zip(&self.steps) {
            let mut quiet: Vec<f64> = column.iter().map(|[whole, _]| *whole).filter(|whole| *whole > 0.0).collect();
            quiet.sort_by(f64::total_cmp);
            // Rounding of a step alone has a variance of a twelfth of its square.
            let quiet = quiet.get(quiet.len() / QUIET_PART).copied().unwrap_or(f64::INFINITY);
            let most = MOVING * quiet.max(if step.is_finite() { step * step / 12.0 } else { 0.0 });
            moves.iter_mut().zip(column).for_each(|(moves, [_, motion])| *moves |= *motion > most);
        }
        join(&mut moves);
        let length_s = |blocks: &[Block]| s_from_ns(blocks.iter().map(|block| block.length_ns).sum());
        let mut longest: Option<(f64, &[Block])> = None;
        let mut at = 0;
        let same = |a: usize, b: usize| moves[a] == moves[b] && self.blocks[a].run == self.blocks[b].run;
        while at < moves.len() {
            let end = (at + 1..moves.len()).find(|next| !same(at, *next)).unwrap_or(moves.len());
            let seconds = length_s(&self.blocks[at..end]);
            if !moves[at] && longest.is_none_or(|(most, _)| seconds > most) {
                longest = Some((seconds, &self.blocks[at..end]));
            }
            at = end;
        }
        let moving = self.blocks.iter().zip(&moves).filter(|(_, moves)| **moves);
        let name = |log: u32| self.files.get(log as usize).cloned().unwrap_or_default();
        let span = |(length_s, blocks): (f64, &[Block])| {
            let rows = [blocks.first()?.rows[0], blocks.last()?.rows[1]];
            let [file, last_file] = rows.map(|row| name(row.log));
            let [first_line, last_line] = rows.map(|row| row.line);
            Some(RestSpan { file, first_line, last_file, last_line, length_s, rows })
        };
        Some(Rest {
            moving_s: s_from_ns(moving.map(|(block, _)| block.length_ns).sum()),
            length_s: length_s(&self.blocks),
            longest: longest.and_then(span),
        })
    }
}

/// Joins moving blocks with fewer than [`TOGETHER`] between them, and drops those that are fewer themselves. The blocks next to motion
/// hold its first and last rows.
fn join(moves: &mut [bool]) {
    let mut last = None;
    for at in 0..moves.len() {
        if moves[at] {
            if let Some(last) = last.filter(|last| at - last <= TOGETHER) {
                moves[last..at].fill(true);
            }
            last = Some(at);
        }
    }
    moves
        .chunk_by_mut(|a, b| a == b)
        .filter(|group| group[0] && group.len() < TOGETHER)
        .for_each(|few| few.fill(false));
    let whole = moves.to_vec();
    for (at, moves) in moves.iter_mut().enumerate() {
        *moves |= at > 0 && whole[at - 1] || whole.get(at + 1).is_some_and(|next| *next);
    }
}
