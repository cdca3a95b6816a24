//! Collects the phase of one axis: in memory while the record is short, through the pyramid when it is long.

use crate::difference::{Difference, SquareSum};
use crate::freedom::Stretches;
use crate::overlap::overlapping;
use crate::pyramid::{Pyramid, served};
use crate::spectrum::periods::Series;

/// Phases in memory, all axes together, before the switch to the pyramid: 24 MiB. Where rows are lost or disturbed, up to four
/// variants of the record are kept ([`crate::Screen`]).
pub const HELD_PHASES: usize = 3 << 20;
/// Rows whose phases are passed on together.
const PIECE: usize = 4096;
/// Longest distance of a difference, rows: no record is longer.
pub const MOST_ROWS: usize = 1 << 40;

/// Collects one axis.
#[derive(Clone, Debug)]
pub struct Recorder {
    wanted: Vec<Difference>,
    /// Most phases in memory; beyond it the recorder switches to the pyramid.
    hold: usize,
    held: Vec<Vec<f64>>,
    held_phases: usize,
    pyramid: Option<Pyramid>,
    stretches: Stretches,
    series: Series,
    /// Of the open stretch; 0 between stretches.
    phases: u64,
    phase: f64,
    /// Phases of rows on their way.
    arriving: Vec<f64>,
    /// First angle of the record, subtracted from all so that sums keep their digits.
    offset: Option<f64>,
    rows: u64,
    /// Intervals whose angle was assumed.
    filled: u64,
    /// Phases that are missing.
    holes: u64,
}

/// Result of a recorder.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorded {
    /// Sums and the differences they are of.
    pub sums: Vec<(Difference, SquareSum)>,
    /// Unbroken stretches.
    pub stretches: Stretches,
    /// Rows of the longest, in which periods show.
    pub series: Series,
    /// Rows in them.
    pub rows: u64,
    /// Lost rows that were filled with a mean rate.
    pub filled: u64,
    /// Full overlap at every distance; otherwise only up to [`crate::FULL_OVERLAP`] rows.
    pub full_overlap: bool,
}

impl Recorder {
    /// Collects the sums of these differences: exactly as given for at most `hold` phases, at distances that the pyramid serves
    /// beyond.
    pub fn new(wanted: Vec<Difference>, hold: usize) -> Self {
        Self {
            wanted,
            hold,
            held: Vec::new(),
            held_phases: 0,
            pyramid: None,
            stretches: Stretches::default(),
            series: Series::default(),
            phases: 0,
            phase: 0.0,
            arriving: Vec::new(),
            offset: None,
            rows: 0,
            filled: 0,
            holes: 0,
        }
    }

    /// Phases of the open stretch; 0 between stretches.
    pub fn open_phases(&self) -> u64 {
        self.phases
    }

    /// The next rows of the open stretch: angles of one interval each.
    pub fn push(&mut self, angles: &[f64]) {
        let Some(first) = angles.first() else { return };
        let offset = self.open_at(*first);
        self.rows += angles.len() as u64;
        let mut arriving = std::mem::take(&mut self.arriving);
        for angles in angles.chunks(PIECE) {
            let mut phase = self.phase;
            arriving.clear();
            arriving.extend(angles.iter().map(|angle| {
                phase += angle - offset;
                phase
            }));
            self.phase = phase;
            self.series.push(angles.iter().map(|angle| angle - offset));
            self.keep(&arriving);
        }
        self.arriving = arriving;
    }

    /// A row of several intervals: a running total with missing rows in between. Within it the phase is missing.
    pub fn push_wide(&mut self, intervals: u64, angle: f64) {
        let offset = self.open_at(angle / intervals.max(1) as f64);
        for _ in 1..intervals {
            self.keep(&[f64::NAN]);
        }
        let whole = angle - offset * intervals as f64;
        self.phase += whole;
        self.series.push((0..intervals).map(|_| whole / intervals as f64));
        self.keep(&[self.phase]);
        self.rows += 1;
    }

    /// Lost rows of the open stretch: each is replaced by `angle`.
    pub fn push_filled(&mut self, rows: u64, angle: f64) {
        let offset = self.open_at(angle);
        self.series.push((0..rows).map(|_| angle - offset));
        for _ in 0..rows {
            self.phase += angle - offset;
            self.keep(&[self.phase]);
        }
        self.filled += rows;
    }

    /// Opens a stretch if none is open; returns the angle to be subtracted from every row.
    fn open_at(&mut self, first: f64) -> f64 {
        let offset = *self.offset.get_or_insert(first);
        if self.phases == 0 {
            self.phase = 0.0;
            if self.pyramid.is_none() {
                self.held.push(Vec::new());
            }
            self.keep(&[0.0]);
        }
        offset
    }

    /// The next phases, into memory or the pyramid.
    fn keep(&mut self, phases: &[f64]) {
        let held = if self.pyramid.is_some() { 0 } else { (self.hold - self.held_phases).min(phases.len()) };
        let (held, through) = phases.split_at(held);
        if let Some(stretch) = self.held.last_mut() {
            stretch.extend_from_slice(held);
        }
        // Phases of rows are sums, so that NaN stays to their end. Those of a gap come one by one.
        let all_known = phases.last().is_some_and(|phase| !phase.is_nan());
        if !all_known {
            self.holes += phases.iter().filter(|phase| phase.is_nan()).count() as u64;
        }
        self.phases += phases.len() as u64;
        self.held_phases += held.len();
        if through.is_empty() {
            return;
        }
        if self.pyramid.is_none() {
            self.switch_to_pyramid();
        }
        if let Some(pyramid) = &mut self.pyramid {
            pyramid.extend(through, all_known);
        }
    }

    /// Switches to the pyramid and passes all phases in memory to it.
    fn switch_to_pyramid(&mut self) {
        let served = |difference: &Difference| Difference { m: served(difference.m), ..*difference };
        self.wanted = self.wanted.iter().map(served).collect();
        self.wanted.dedup();
        let mut pyramid = Pyramid::new(self.wanted.clone());
        let held = std::mem::take(&mut self.held);
        let last = held.len().saturating_sub(1);
        for (number, stretch) in held.into_iter().enumerate() {
            pyramid.extend(&stretch, self.holes == 0);
            if number < last {
                pyramid.end_stretch();
            }
        }
        self.pyramid = Some(pyramid);
    }

    /// A gap: the next row does not join the previous one.
    pub fn end_stretch(&mut self) {
        if self.phases > 0 {
            self.stretches.add(self.phases);
            self.series.end_stretch();
            if let Some(pyramid) = &mut self.pyramid {
                pyramid.end_stretch();
            }
            self.phases = 0;
        }
    }

    /// Ends the record.
    pub fn finish(mut self) -> Recorded {
        self.end_stretch();
        self.stretches.set_missing(self.holes, self.filled);
        let mut sums = vec![SquareSum::default(); self.wanted.len()];
        match &self.pyramid {
            Some(pyramid) => sums.copy_from_slice(pyramid.sums()),
            None => {
                for stretch in &self.held {
                    let here = overlapping(stretch, &self.wanted);
                    sums.iter_mut().zip(here).for_each(|(sum, part)| sum.merge(part));
                }
            }
        }
        Recorded {
            sums: self.wanted.iter().copied().zip(sums).collect(),
            stretches: self.stretches,
            series: self.series,
            rows: self.rows,
            filled: self.filled,
            full_overlap: self.pyramid.is_none(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::difference::Deviation;
    use crate::freedom::{PhaseNoise, Record};
    use crate::pyramid::FULL_OVERLAP;

    fn differences(highest: usize) -> Vec<Difference> {
        let multiples = (0..).map(|octave| 1_usize << octave).take_while(|m| *m <= highest);
        let odd = [3, 5, 511, 513, 1023, 1025, 3001].into_iter().filter(|m| *m <= highest);
        let all: Vec<usize> = multiples.chain(odd).collect();
        let both = [Deviation::Allan, Deviation::Hadamard];
        both.iter().flat_map(|deviation| all.iter().map(|m| Difference { deviation: *deviation, m: *m })).collect()
    }

    /// White rates of unit variance: a small generator of even values, summed to near normal ones.
    fn white(rows: usize, seed: u64) -> Vec<f64> {
        let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
        let mut uniform = || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..rows).map(|_| (0..12).map(|_| uniform()).sum::<f64>() - 6.0).collect()
    }

    /// The sums do not depend on the pieces in which rows arrive. Up to full overlap, memory and pyramid agree to rounding.
    #[test]
    fn the_pyramid_overlaps_fully_at_its_foot() {
        let angles = white(50_000, 1);
        let recorded = |hold: usize, piece: usize| {
            let mut recorder = Recorder::new(differences(8192), hold);
            for (number, part) in angles.chunks(piece).enumerate() {
                recorder.push(part);
                if number % 10 == 9 {
                    recorder.end_stretch();
                }
            }
            recorder.finish()
        };
        let (held, through) = (recorded(usize::MAX, 4000), recorded(0, 4000));
        assert!(held.full_overlap && !through.full_overlap);
        assert_eq!((held.rows, held.stretches.count()), (50_000, 2));
        let sum_of =
            |of: &Recorded, wanted: Difference| of.sums.iter().find(|(d, _)| *d == wanted).map(|(_, sum)| *sum);
        for (difference, sum) in through.sums.iter().filter(|(difference, _)| difference.m <= FULL_OVERLAP) {
            let exact = sum_of(&held, *difference).unwrap();
            assert_eq!(sum.number, exact.number, "{difference:?}");
            assert!((sum.squares / exact.squares - 1.0).abs() < 1e-11, "{difference:?}");
        }
        assert_eq!(recorded(20_000, 4000), through, "a switch in the middle changes nothing");
        let mut one_by_one = Recorder::new(differences(8192), 0);
        angles.chunks(40_000).for_each(|stretch| {
            stretch.iter().for_each(|angle| one_by_one.push(&[*angle]));
            one_by_one.end_stretch();
        });
        assert_eq!(one_by_one.finish(), through, "nor do the pieces");
    }

    /// The module's claim: how far the pyramid is from full overlap, in standard deviations of the result.
    #[test]
    fn the_pyramid_is_close_to_full_overlap_above() {
        const ROWS: usize = 1 << 18;
        let noise = PhaseNoise { n2: 1.0, ..PhaseNoise::default() };
        let mut worst: f64 = 0.0;
        for seed in 1..=20 {
            let angles = white(ROWS, seed);
            let recorded = |hold: usize| {
                let mut recorder = Recorder::new(differences(ROWS / 8), hold);
                recorder.push(&angles);
                recorder.finish()
            };
            let (held, through) = (recorded(usize::MAX), recorded(0));
            for (difference, sum) in &through.sums {
                let Some((_, exact)) = held.sums.iter().find(|(d, _)| d == difference) else { continue };
                let variance = |sum: &SquareSum| sum.variance(difference.deviation, difference.m as f64).unwrap();
                let record = Record { noise, deviation: difference.deviation, tau0_s: 1.0, stretches: &held.stretches };
                let relative_sigma = (0.5 / record.edf(difference.m as f64)).sqrt();
                let away = (variance(sum) / variance(exact)).sqrt() - 1.0;
                worst = worst.max(away.abs() / relative_sigma);
            }
        }
        println!("worst {worst}");
        assert!(worst < 0.01, "{worst} of a standard deviation");
    }
}
