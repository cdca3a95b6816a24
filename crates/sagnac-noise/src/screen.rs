//! Screens the rows of one axis before the recorder: bridges gaps and finds disturbed rows.
//!
//! **Gaps with a known angle** (a running total): the phase is known on both sides and missing within. Differences that need a
//! missing phase do not count.
//!
//! **Gaps with a lost angle**: each lost row is replaced by the mean of the 64 rows nearest to the gap, so that differences reach
//! across it. This holds for gaps of at most 8 rows while at most 5 % of all rows are lost; otherwise a gap ends the stretch.
//! The replacement has three effects, for a lost fraction p:
//!
//! * White rate noise: σ² is too small by p at short τ and too large by p at long τ. It is divided by the expected factor
//!   (`white_factor`), which is exact for this noise.
//! * Flicker, rate random walk and ramp: the means follow them at every τ, so σ is off by p/2: 0.5 % where 1 % of rows are lost.
//!   If the rate wanders by more than its noise within 64 rows, the mean of only the two adjacent rows is used.
//! * Quantization: a lost row also loses the rounding that it shares with its neighbours. N² grows by 2·p·Q²/τ0.
//!
//! **Disturbed rows** are more than six scales from the median of about 700 rows around them. The scale is that of the middle
//! nine tenths of these rows, at least that of rounding; noise alone exceeds six scales once in 10⁸ rows. The record is computed
//! both with and without disturbed rows. The result excludes them if they are at most 0.5 % of the rows; if there are more, they
//! are normal behaviour of the gyro, and the result includes them.

use crate::difference::Difference;
use crate::freedom::NEAREST;
use crate::level::{Bounds, RowLevel, Seen};
use crate::recorder::{Recorded, Recorder};

/// Rows per block; a block is screened at once.
const BLOCK: usize = 512;
/// Rows before a block that are used for its median and scale too.
const CONTEXT: usize = 256;
/// Fewest rows around a lost one that give a mean.
const FEWEST_NEAREST: usize = 16;
/// Longest gap that is filled with a mean, rows.
const MOST_LOST: u64 = 8;
/// A known angle bridges a gap of this many intervals, or of a quarter of the stretch before it.
const ALWAYS_KNOWN: u64 = 512;
const KNOWN_PART: u64 = 4;
/// Disturbed rows that are listed.
const MOST_NAMED: usize = 10;

/// Largest fraction of lost rows that are filled with means.
pub const MOST_LOST_PART: f64 = 0.05;
/// Largest fraction of disturbed rows that are excluded.
pub const MOST_DISTURBED_PART: f64 = 0.005;

/// Where a row comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct RowPlace {
    /// Number of the log, from 0.
    pub log: u32,
    /// Line in the log.
    pub line: u64,
}

/// A row that is far from those around it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disturbed {
    /// Where it is.
    pub place: RowPlace,
    /// Its angle minus the median of those around it, in their unit.
    pub away: f64,
}

/// Input of the screen, in order.
#[derive(Clone, Copy)]
enum Piece {
    Row { angle: f64, place: RowPlace },
    Wide { intervals: u64, angle: f64, place: RowPlace },
    Lost { intervals: u64 },
    End,
}

/// One variant of the record; `None` until a row occurs for which the variants differ.
#[derive(Clone)]
struct Variant {
    fills_gaps: Option<bool>,
    excludes_disturbed: Option<bool>,
    recorder: Recorder,
}

/// Receives the rows of one axis.
#[derive(Clone)]
pub struct Screen {
    variants: Vec<Variant>,
    pieces: Vec<Piece>,
    /// Undisturbed rows before the pending ones.
    context: Vec<f64>,
    /// Levels near the quantiles of the last block that needed them.
    bounds: Option<Bounds>,
    /// What these bounds have seen in the context, once they have held for it.
    seen: Option<Seen>,
    rows: u64,
    lost: u64,
    disturbed: u64,
    named: Vec<Disturbed>,
}

/// Result of a screen.
pub struct Screened {
    /// The record that the figures are computed from.
    pub used: Recorded,
    /// If there are disturbed rows: the same record with them if `used` excludes them, without them otherwise.
    pub other: Option<Recorded>,
    /// `used` excludes the disturbed rows.
    pub cleaned: bool,
    /// Number of disturbed rows.
    pub disturbed: u64,
    /// The first of them.
    pub named: Vec<Disturbed>,
    /// All rows.
    pub rows: u64,
}

impl Screen {
    /// Arguments as for [`Recorder::new`].
    pub fn new(wanted: Vec<Difference>, hold: usize) -> Self {
        Self {
            variants: vec![Variant {
                fills_gaps: None,
                excludes_disturbed: None,
                recorder: Recorder::new(wanted, hold),
            }],
            pieces: Vec::with_capacity(BLOCK),
            context: Vec::new(),
            bounds: None,
            seen: None,
            rows: 0,
            lost: 0,
            disturbed: 0,
            named: Vec::new(),
        }
    }

    /// The next rows of the stretch, the first of them at `place_of(0)`.
    pub fn rows(&mut self, angles: &[f64], place_of: impl Fn(usize) -> RowPlace) {
        let mut at = 0;
        while at < angles.len() {
            let undisturbed = &angles[at..self.end_of_undisturbed(angles, at)];
            if undisturbed.is_empty() {
                self.row(angles[at], place_of(at));
                at += 1;
                continue;
            }
            self.rows += undisturbed.len() as u64;
            self.variants.iter_mut().for_each(|variant| variant.recorder.push(undisturbed));
            self.keep_context(undisturbed[undisturbed.len() - CONTEXT..].iter().copied());
            at += undisturbed.len();
        }
    }

    /// The end of the blocks from `at` on of which counts alone show that no row is disturbed.
    fn end_of_undisturbed(&mut self, angles: &[f64], at: usize) -> usize {
        let mut end = at;
        if self.pieces.is_empty()
            && let Some(bounds) = &self.bounds
        {
            while let Some(block) = angles.get(end..end + BLOCK)
                && let before = self.seen.unwrap_or_else(|| bounds.see(&self.context))
                && let Some(seen) = bounds.hold(before, block, CONTEXT)
            {
                // In those rows that become the context.
                self.seen = Some(seen);
                end += BLOCK;
            }
        }
        end
    }

    /// The next row of the stretch.
    pub fn row(&mut self, angle: f64, place: RowPlace) {
        self.push(Piece::Row { angle, place });
    }

    /// A row of several intervals: a running total with missing rows in between.
    pub fn wide(&mut self, intervals: u64, angle: f64, place: RowPlace) {
        self.push(if intervals > 1 { Piece::Wide { intervals, angle, place } } else { Piece::Row { angle, place } });
    }

    /// `intervals` rows are lost, together with their angle.
    pub fn lost(&mut self, intervals: u64) {
        self.push(Piece::Lost { intervals });
    }

    /// Ends the stretch: the next row does not continue it.
    pub fn end_stretch(&mut self) {
        self.push(Piece::End);
    }

    /// The next row is of another log: rows before it are no context for it.
    pub fn end_run(&mut self) {
        self.end_stretch();
        self.settle();
        self.context.clear();
    }

    fn push(&mut self, piece: Piece) {
        let row = matches!(piece, Piece::Row { .. } | Piece::Wide { .. });
        self.rows += u64::from(row);
        self.pieces.push(piece);
        if self.pieces.len() >= BLOCK {
            self.settle();
        }
    }

    /// Ends the record.
    pub fn finish(mut self) -> Screened {
        self.settle();
        let lost_part = self.lost as f64 / (self.rows + self.lost).max(1) as f64;
        let fills_gaps = lost_part <= MOST_LOST_PART;
        let cleaned = self.disturbed > 0 && self.disturbed as f64 <= MOST_DISTURBED_PART * self.rows as f64;
        let recorded = |variants: &mut Vec<Variant>, excludes_disturbed: bool| {
            let fits = |variant: &Variant| {
                variant.fills_gaps.is_none_or(|j| j == fills_gaps)
                    && variant.excludes_disturbed.is_none_or(|c| c == excludes_disturbed)
            };
            let at = variants.iter().position(fits).unwrap_or(0);
            variants.swap_remove(at).recorder.finish()
        };
        let used = recorded(&mut self.variants, cleaned);
        let other = (self.disturbed > 0).then(|| recorded(&mut self.variants, !cleaned));
        Screened { used, other, cleaned, disturbed: self.disturbed, named: self.named, rows: self.rows }
    }

    /// Screens the pending rows and passes them to the recorders.
    fn settle(&mut self) {
        let rows = self.pieces.iter().filter_map(|piece| match piece {
            Piece::Row { angle, .. } => Some(*angle),
            _ => None,
        });
        let rows: Vec<f64> = rows.collect();
        let level = RowLevel::of(self.context.iter().chain(&rows).copied().collect());
        (self.bounds, self.seen) = (level.as_ref().map(Bounds::about), None);
        let away = |piece: &Piece| level.as_ref().and_then(|level| level.away(piece));
        let disturbed: Vec<Option<Disturbed>> = self.pieces.iter().map(away).collect();
        self.fork(&disturbed);
        let plain = rows.len() == self.pieces.len() && disturbed.iter().all(Option::is_none);
        if plain {
            self.variants.iter_mut().for_each(|variant| variant.recorder.push(&rows));
        } else {
            let undisturbed = Undisturbed::of(&self.context, &self.pieces, &disturbed);
            for variant in &mut self.variants {
                self.pieces.iter().zip(&disturbed).enumerate().for_each(|(at, (piece, disturbed))| {
                    variant.take(*piece, disturbed.is_some(), || undisturbed.mean_near(at));
                });
            }
        }
        let undisturbed =
            self.pieces.iter().zip(&disturbed).filter(|(_, disturbed)| disturbed.is_none()).filter_map(|(piece, _)| {
                match piece {
                    Piece::Row { angle, .. } => Some(*angle),
                    _ => None,
                }
            });
        let undisturbed: Vec<f64> = undisturbed.collect();
        self.keep_context(undisturbed);
        self.pieces.clear();
    }

    /// Adds undisturbed rows to the context and drops the oldest.
    fn keep_context(&mut self, undisturbed: impl IntoIterator<Item = f64>) {
        self.context.extend(undisturbed);
        let old = self.context.len().saturating_sub(CONTEXT);
        self.context.drain(..old);
    }

    /// Counts lost and disturbed rows. At the first of each kind, every variant splits into two.
    fn fork(&mut self, found: &[Option<Disturbed>]) {
        let lost = self.pieces.iter().filter_map(|piece| match piece {
            Piece::Lost { intervals } if *intervals <= MOST_LOST => Some(*intervals),
            _ => None,
        });
        let lost: u64 = lost.sum();
        let disturbed = found.iter().flatten();
        self.named.extend(disturbed.clone().take(MOST_NAMED - self.named.len()));
        let disturbed = disturbed.count() as u64;
        if lost > 0 && self.lost == 0 {
            self.variants = both(&self.variants, |variant, yes| variant.fills_gaps = Some(yes));
        }
        if disturbed > 0 && self.disturbed == 0 {
            self.variants = both(&self.variants, |variant, yes| variant.excludes_disturbed = Some(yes));
        }
        self.lost += lost;
        self.disturbed += disturbed;
    }
}

fn both(variants: &[Variant], set: impl Fn(&mut Variant, bool)) -> Vec<Variant> {
    let with = |variant: &Variant, yes: bool| {
        let mut variant = variant.clone();
        set(&mut variant, yes);
        variant
    };
    variants.iter().flat_map(|variant| [with(variant, true), with(variant, false)]).collect()
}

impl Variant {
    fn take(&mut self, piece: Piece, disturbed: bool, mean: impl Fn() -> Option<f64>) {
        let recorder = &mut self.recorder;
        let is_open = recorder.open_phases() > 0;
        let replaced = disturbed && self.excludes_disturbed == Some(true);
        match piece {
            Piece::Row { .. } | Piece::Wide { .. } if replaced && !is_open => {}
            Piece::Row { angle, .. } if !replaced => recorder.push(&[angle]),
            Piece::Row { .. } => fill(recorder, 1, mean()),
            Piece::Wide { intervals, .. } if intervals > ALWAYS_KNOWN.max(recorder.open_phases() / KNOWN_PART) => {
                recorder.end_stretch();
            }
            Piece::Wide { intervals, angle, .. } if !replaced => recorder.push_wide(intervals, angle),
            Piece::Wide { intervals, .. } => fill(recorder, intervals, mean()),
            Piece::Lost { .. } if !is_open => {}
            Piece::Lost { intervals } if intervals <= MOST_LOST && self.fills_gaps == Some(true) => {
                fill(recorder, intervals, mean());
            }
            Piece::Lost { .. } | Piece::End => recorder.end_stretch(),
        }
    }
}

fn fill(recorder: &mut Recorder, rows: u64, mean: Option<f64>) {
    match mean {
        Some(mean) => recorder.push_filled(rows, mean),
        None => recorder.end_stretch(),
    }
}

impl RowLevel {
    /// The row as disturbed, if it is too far from the median.
    fn away(&self, piece: &Piece) -> Option<Disturbed> {
        let (angle, intervals, place) = match *piece {
            Piece::Row { angle, place } => (angle, 1.0, place),
            Piece::Wide { intervals, angle, place } => (angle, intervals as f64, place),
            Piece::Lost { .. } | Piece::End => return None,
        };
        let away = angle - self.median * intervals;
        // Over many intervals the error of the median itself adds up too.
        let far = self.far * (intervals.sqrt() + 0.1 * (intervals - 1.0));
        (away.abs() > far).then_some(Disturbed { place, away })
    }
}

/// Undisturbed rows with the number of their piece, from 1; 0 for those of the context.
struct Undisturbed {
    at: Vec<usize>,
    angles: Vec<f64>,
}

impl Undisturbed {
    fn of(context: &[f64], pieces: &[Piece], disturbed: &[Option<Disturbed>]) -> Self {
        let mut undisturbed = Self { at: vec![0; context.len()], angles: context.to_vec() };
        for (at, (piece, disturbed)) in pieces.iter().zip(disturbed).enumerate() {
            if let (Piece::Row { angle, .. }, None) = (piece, disturbed) {
                undisturbed.at.push(at + 1);
                undisturbed.angles.push(*angle);
            }
        }
        undisturbed
    }

    /// Mean of the rows nearest to a piece.
    fn mean_near(&self, at: usize) -> Option<f64> {
        let middle = self.at.partition_point(|number| *number <= at);
        let from = middle.saturating_sub(NEAREST / 2).min(self.at.len().saturating_sub(NEAREST));
        let near = &self.angles[from..(from + NEAREST).min(self.at.len())];
        let mean = |rows: &[f64]| rows.iter().sum::<f64>() / rows.len() as f64;
        if near.len() < FEWEST_NEAREST {
            return None;
        }
        let all = mean(near);
        let about: f64 = near.iter().map(|angle| (angle - all).powi(2)).sum();
        let between: f64 = near.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum();
        // In white noise `between` is twice `about`; 64 rows of it never give less than `about`.
        let wanders = between < about;
        let beside = middle.saturating_sub(1)..(middle + 1).min(self.at.len());
        Some(if wanders { mean(&self.angles[beside]) } else { all })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::difference::Deviation;

    /// splitmix64, Box and Muller.
    struct Random(u64);

    impl Random {
        fn uniform(&mut self) -> f64 {
            self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = self.0;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
        }

        fn normal(&mut self) -> f64 {
            (-2.0 * (1.0 - self.uniform()).ln()).sqrt() * (std::f64::consts::TAU * self.uniform()).cos()
        }
    }

    fn screen() -> Screen {
        Screen::new(vec![Difference { deviation: Deviation::Allan, m: 1 }], 0)
    }

    fn push(screen: &mut Screen, angles: impl IntoIterator<Item = f64>) {
        angles.into_iter().enumerate().for_each(|(at, angle)| screen.row(angle, RowPlace { log: 0, line: at as u64 }));
    }

    /// No row of plain noise is found disturbed: 2 million rows for each ratio of count to σ.
    #[test]
    fn noise_alone_is_not_disturbed() {
        for step in [0.0_f64, 0.1, 0.5, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0] {
            let mut random = Random(step.to_bits());
            let mut screen = screen();
            let (mut sum, mut before) = (0.0, 0.0);
            push(
                &mut screen,
                (0..250_000).map(|_| {
                    sum += 0.37 + random.normal();
                    let total = if step > 0.0 { (sum / step).floor() * step } else { sum };
                    let angle = total - before;
                    before = total;
                    angle
                }),
            );
            let screened = screen.finish();
            assert_eq!(screened.disturbed, 0, "{step}: {:?}", screened.named);
        }
        // Nor are rows of a ramp, of a dither, or of a table that turned half of the time.
        let mut random = Random(7);
        let kinds: [&dyn Fn(f64) -> f64; 3] =
            [&|k| 0.02 * k, &|k| 30.0 * (0.7 * k).sin(), &|k| if k < 50_000.0 { 0.0 } else { 40.0 }];
        for kind in kinds {
            let mut screen = screen();
            push(&mut screen, (0..100_000).map(|k| kind(f64::from(k)) + random.normal()));
            let screened = screen.finish();
            assert_eq!(screened.disturbed, 0, "{:?}", screened.named);
        }
    }

    /// Rows beyond the threshold are found and those just below it are not: 7 and 5 σ from the mean.
    #[test]
    fn rows_about_the_threshold() {
        let mut random = Random(3);
        let mut screen = screen();
        let level = |k: u64| match k % 5000 {
            1000 => 4.0,
            3000 => 9.0,
            _ => 0.0,
        };
        push(
            &mut screen,
            (0..500_000).map(|k| match level(k) {
                0.0 => random.normal(),
                away => away + 0.3 * random.normal(),
            }),
        );
        let screened = screen.finish();
        assert_eq!((screened.disturbed, screened.cleaned), (100, true));
        assert!(screened.named.iter().all(|row| row.place.line % 5000 == 3000), "{:?}", screened.named);
        assert_eq!(screened.used.filled, 100);
    }

    /// Counts never find other rows than the quantiles: noise of any ratio to its count, with rows far off, ramps, turns of a table
    /// and constant stretches, in pieces of any length.
    #[test]
    fn blocks_are_screened_as_single_rows_are() {
        let mut fast = 0;
        for seed in 0..60_u64 {
            let mut random = Random(seed);
            let step = [0.0, 0.3, 1.0, 2.0, 4.0, 8.0][seed as usize % 6];
            let far = random.uniform() * 10.0;
            let angles: Vec<f64> = (0..20_000)
                .map(|k| {
                    let level = match (seed / 6 % 5, k) {
                        (1, k) => 0.01 * f64::from(k),
                        (2, 9_000..) => 40.0,
                        (3, 5_000..9_000) => return 7.0,
                        (4, k) => 0.4 * (f64::from(k) * 0.02).sin(),
                        _ => 0.0,
                    };
                    let away = if k % 1700 == 900 { far } else { 0.0 };
                    let angle = level + away + random.normal();
                    if step > 0.0 { (angle / step).round() * step } else { angle }
                })
                .collect();
            let place = |at: usize| RowPlace { log: 0, line: at as u64 };
            let screened = |piece: usize| {
                let mut screen = screen();
                for (number, part) in angles.chunks(piece).enumerate() {
                    screen.rows(part, |at| place(number * piece + at));
                }
                screen.finish()
            };
            let mut single = screen();
            angles.iter().enumerate().for_each(|(at, angle)| single.row(*angle, place(at)));
            let single = single.finish();
            for piece in [20_000, 8192, 700, 512] {
                let blocks = screened(piece);
                assert_eq!(
                    (&blocks.used, &blocks.other, blocks.disturbed, &blocks.named, blocks.rows),
                    (&single.used, &single.other, single.disturbed, &single.named, single.rows),
                    "{seed} {piece}"
                );
            }
            let mut screen = screen();
            screen.rows(&angles[..4096], place);
            fast +=
                angles[4096..].chunks_exact(BLOCK).filter(|block| screen.end_of_undisturbed(block, 0) == BLOCK).count();
        }
        assert!(fast > 300, "{fast} blocks without quantiles");
    }

    /// Each log is screened by itself; short records are not screened; constant rows have no scale.
    #[test]
    fn what_cannot_be_judged_is_not() {
        let mut random = Random(5);
        let mut screen = super::tests::screen();
        for log in 0..20 {
            push(&mut screen, (0..700).map(|_| 1000.0 * f64::from(log) + random.normal()));
            screen.end_run();
        }
        assert_eq!(screen.finish().disturbed, 0);
        for angles in [vec![0.0, 1e9, 0.0], vec![7.0; 1000]] {
            let mut screen = super::tests::screen();
            push(&mut screen, angles);
            assert_eq!(screen.finish().disturbed, 0);
        }
    }

    /// Few short gaps are bridged. Long gaps end the stretch, and so does every gap if too many rows are lost.
    #[test]
    fn gaps_by_their_length_and_number() {
        let record = |every: usize, gap: u64| {
            let mut random = Random(9);
            let mut screen = screen();
            for _ in 0..20 {
                push(&mut screen, (0..every).map(|_| random.normal()));
                screen.lost(gap);
            }
            let used = screen.finish().used;
            (used.stretches.count(), used.filled)
        };
        assert_eq!(record(100, 1), (1, 20));
        assert_eq!(record(100, 5), (1, 100), "4.8 %");
        assert_eq!(record(100, 6), (20, 0), "5.7 %");
        assert_eq!(record(1000, 8), (1, 160));
        assert_eq!(record(1000, 9), (20, 0));
    }
}
