//! The noise of a record's rows, thinned: their sums over equal parts of its time, from the first row to the last.
//!
//! ```text
//! rows ─▶ parts of a quarter of a second or a row; joined in pairs when they are too many
//! text: one character for each difference of neighbouring parts, a fifth of the median size a step; `.` where one is not known
//! ```
//!
//! What the text leaves out of a difference is added to the next one, so that its sums stay within a step.
//!
//! Fails for a record whose parts are mostly lost: it has no noise of its own.

/// Most lost rows in a row that are as the last one was.
const MOST_FILLED: u64 = 8;
/// A part of fast rows, s.
const PART_S: f64 = 0.25;
/// More parts are joined in pairs.
const MOST_PARTS: usize = 1 << 17;
/// The same in a text.
const MOST_IN_TEXT: usize = 1 << 13;
/// Steps of the text in the median size of a difference.
const STEPS: f64 = 5.0;
/// Characters of −31 … 31 steps; a larger difference is cut.
const DIGITS: &[u8] = b"0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz-";
const MOST_STEPS: f64 = 31.0;
const UNKNOWN: char = '.';

/// Sums of the rows of a record over equal parts of its time.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    /// Length of a part, s.
    part_s: f64,
    /// NaN where rows are missing.
    parts: Vec<f64>,
}

/// Collects a [`Trace`], row by row.
#[derive(Clone, Debug)]
pub struct TraceWatch {
    row_s: f64,
    rows_of_part: u64,
    parts: Vec<f64>,
    open: f64,
    open_rows: u64,
    last: f64,
}

impl TraceWatch {
    /// Of rows of an interval, s.
    pub fn new(row_s: f64) -> Self {
        let rows_of_part = ((PART_S / row_s).round() as u64).max(1);
        Self { row_s, rows_of_part, parts: Vec::new(), open: 0.0, open_rows: 0, last: f64::NAN }
    }

    /// The next rows.
    pub fn push(&mut self, angles: &[f64]) {
        let mut rest = angles;
        while !rest.is_empty() {
            let fits = usize::try_from(self.rows_of_part - self.open_rows).unwrap_or(usize::MAX).min(rest.len());
            self.open += rest[..fits].iter().sum::<f64>();
            self.open_rows += fits as u64;
            rest = &rest[fits..];
            if self.open_rows >= self.rows_of_part {
                self.parts.push(self.open);
                (self.open, self.open_rows) = (0.0, 0);
                self.thin();
            }
        }
        self.last = angles.last().copied().unwrap_or(self.last);
    }

    /// Rows that are missing before the next one. A few are as the last one was.
    pub fn lose(&mut self, rows: u64) {
        if rows <= MOST_FILLED {
            return (0..rows).for_each(|_| self.push(&[self.last]));
        }
        let all = self.open_rows.saturating_add(rows);
        let whole = usize::try_from(all / self.rows_of_part).unwrap_or(usize::MAX).min(MOST_PARTS);
        self.parts.extend(std::iter::repeat_n(f64::NAN, whole));
        self.open_rows = all % self.rows_of_part;
        self.open = if self.open_rows > 0 { f64::NAN } else { 0.0 };
        self.thin();
    }

    /// The next row belongs to another time.
    pub fn end_run(&mut self) {
        (self.open, self.open_rows) = (0.0, 0);
        if self.parts.last().is_some_and(|last| last.is_finite()) {
            self.parts.push(f64::NAN);
            self.thin();
        }
    }

    /// The trace so far.
    pub fn finish(self) -> Trace {
        Trace { part_s: self.row_s * self.rows_of_part as f64, parts: self.parts }
    }

    fn thin(&mut self) {
        while self.parts.len() >= MOST_PARTS {
            // The part at hand goes on where the last whole pair ends.
            let odd = if self.parts.len() % 2 == 1 { self.parts.pop() } else { None };
            self.parts = pairs(&self.parts);
            self.open += odd.unwrap_or(0.0);
            self.open_rows += if odd.is_some() { self.rows_of_part } else { 0 };
            self.rows_of_part *= 2;
        }
    }
}

/// Sums of neighbours.
fn pairs(parts: &[f64]) -> Vec<f64> {
    parts.chunks_exact(2).map(|pair| pair[0] + pair[1]).collect()
}

/// The median size of what is not zero; zero without any.
pub(crate) fn median_size(values: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = values.iter().map(|value| value.abs()).filter(|size| *size > 0.0).collect();
    let middle = sizes.len() / 2;
    if sizes.is_empty() { 0.0 } else { *sizes.select_nth_unstable_by(middle, f64::total_cmp).1 }
}

impl Trace {
    /// Length of a part, s.
    pub fn part_s(&self) -> f64 {
        self.part_s
    }

    pub(crate) fn parts(&self) -> &[f64] {
        &self.parts
    }

    /// Of at most 8,192 parts: their length, s, and the text of their differences; `None` from a record without noise.
    pub fn text(&self) -> Option<(f64, String)> {
        let (mut part_s, mut parts) = (self.part_s, self.parts.clone());
        while parts.len() > MOST_IN_TEXT {
            (part_s, parts) = (2.0 * part_s, pairs(&parts));
        }
        let differences: Vec<f64> = parts.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let step = median_size(&differences) / STEPS;
        let mut left_out = 0.0;
        let digit = |difference: &f64| {
            if !difference.is_finite() {
                return UNKNOWN;
            }
            let wanted = difference / step + left_out;
            let steps = wanted.round().clamp(-MOST_STEPS, MOST_STEPS);
            left_out = (wanted - steps).clamp(-0.5, 0.5);
            char::from(DIGITS[(steps + MOST_STEPS) as usize])
        };
        (step > 0.0).then(|| (part_s, differences.iter().map(digit).collect()))
    }

    /// Back from a text, in steps; `None` where it is none.
    pub fn of_text(part_s: f64, text: &str) -> Option<Self> {
        if !(part_s.is_finite() && part_s > 0.0) || text.len() > MOST_IN_TEXT {
            return None;
        }
        let (mut sum, mut parts) = (0.0, vec![0.0]);
        for character in text.bytes() {
            let at = DIGITS.iter().position(|digit| *digit == character);
            sum = match at {
                Some(at) => sum + at as f64 - MOST_STEPS,
                None if char::from(character) == UNKNOWN => f64::NAN,
                None => return None,
            };
            parts.push(sum);
            // The level after a gap is not known; differences are all that is used.
            sum = if sum.is_finite() { sum } else { 0.0 };
        }
        Some(Self { part_s, parts })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(i: usize) -> f64 {
        ((i * 7919 + i * i * 104_729) % 1009) as f64 / 1009.0 - 0.5
    }

    #[test]
    fn a_text_gives_the_sums_back_within_a_step() {
        let rows: Vec<f64> = (0..40_000).map(|i| 3.0 + noise(i)).collect();
        let mut watch = TraceWatch::new(0.5);
        watch.push(&rows);
        let trace = watch.finish();
        let (part_s, text) = trace.text().unwrap();
        assert_eq!((part_s, text.len()), (4.0, 4999));
        let back = Trace::of_text(part_s, &text).unwrap();
        let sums: Vec<f64> = rows.chunks_exact(8).map(|part| part.iter().sum()).collect();
        let step = median_size(&sums.windows(2).map(|pair| pair[1] - pair[0]).collect::<Vec<_>>()) / STEPS;
        for (sum, part) in sums.iter().zip(back.parts()) {
            assert!((part * step - (sum - sums[0])).abs() < step, "{sum}");
        }
    }

    #[test]
    fn lost_rows_keep_the_time_and_a_few_are_filled() {
        let mut watch = TraceWatch::new(1.0);
        watch.push(&[1.0, 2.0]);
        watch.lose(2);
        watch.push(&[3.0]);
        watch.lose(9);
        watch.push(&[4.0]);
        watch.end_run();
        let Trace { part_s, parts } = watch.finish();
        assert_eq!((part_s, &parts[..5]), (1.0, &[1.0, 2.0, 2.0, 2.0, 3.0][..]));
        assert!(parts[5..14].iter().all(|part| part.is_nan()) && parts[14] == 4.0 && parts.len() == 16);
    }

    #[test]
    fn parts_are_joined_and_no_row_is_lost() {
        let mut watch = TraceWatch::new(0.1);
        (0..700_001).for_each(|_| watch.push(&[1.0]));
        let trace = watch.finish();
        assert!(trace.parts().len() < MOST_PARTS && trace.part_s() > PART_S);
        let rows_of_part = (trace.part_s() / 0.1).round();
        assert!(trace.parts().iter().all(|part| *part == rows_of_part));
        assert_eq!(trace.text(), None);
    }

    #[test]
    fn no_other_text_is_a_trace() {
        for (part_s, text) in [(f64::NAN, "0A"), (0.0, "0A"), (-1.0, "0A"), (1.0, "0 "), (1.0, "é"), (1.0, "+")] {
            assert_eq!(Trace::of_text(part_s, text), None, "{part_s} {text}");
        }
        assert_eq!(Trace::of_text(1.0, &"0".repeat(MOST_IN_TEXT + 1)), None);
    }
}
