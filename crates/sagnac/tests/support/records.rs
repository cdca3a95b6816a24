//! Records of a ring laser gyro at rest, made here and by nothing of the project: splitmix64, Box and Muller, a running
//! total rounded down to counts, rows lost.

/// splitmix64.
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x5851_f42d_4c95_7f2d)
    }

    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// From 0 to below 1.
    pub(crate) fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }

    /// A whole number below `end`.
    pub(crate) fn below(&mut self, end: usize) -> usize {
        (self.uniform() * end as f64) as usize
    }
}

/// A ring laser gyro at rest, row by row.
#[derive(Clone, Copy)]
pub(crate) struct Gyro {
    pub(crate) rows: usize,
    pub(crate) interval_s: f64,
    pub(crate) arcsec_per_count: f64,
    /// Angle random walk, °/√h.
    pub(crate) n_deg_rt_h: f64,
    /// Mean rate, °/h.
    pub(crate) rate_dph: f64,
}

/// Twelve hours in rows of 5 s.
pub(crate) const TWELVE_HOURS: Gyro =
    Gyro { rows: 8640, interval_s: 5.0, arcsec_per_count: 0.151_25, n_deg_rt_h: 0.003, rate_dph: 10.2 };

impl Gyro {
    /// Angle of each row, arcsec: 1 °/√h is 60 arcsec/√s, 1 °/h is 1 arcsec/s.
    pub(crate) fn angles(&self, random: &mut Random) -> Vec<f64> {
        let sigma = self.n_deg_rt_h * 60.0 * self.interval_s.sqrt();
        (0..self.rows).map(|_| self.rate_dph * self.interval_s + sigma * random.normal()).collect()
    }

    /// The running total after each row, counts.
    pub(crate) fn totals(&self, angles: &[f64]) -> Vec<i64> {
        let sum = angles.iter().scan(0.0, |sum, angle| {
            *sum += angle;
            Some(*sum)
        });
        sum.map(|angle| (angle / self.arcsec_per_count).floor() as i64).collect()
    }
}

/// Which rows are lost: each by itself with a probability, or in bursts of 2 to 40 until that part is gone. The first two
/// stay.
pub(crate) fn lost(rows: usize, part: f64, bursts: bool, random: &mut Random) -> Vec<bool> {
    let mut lost = vec![false; rows];
    if !bursts {
        lost.iter_mut().skip(2).for_each(|row| *row = random.uniform() < part);
        return lost;
    }
    let mut gone = 0;
    while (gone as f64) < part * rows as f64 {
        let (from, length) = (2 + random.below(rows - 2), 2 + random.below(39));
        lost.iter_mut().skip(from).take(length).for_each(|row| *row = true);
        gone += length;
    }
    lost
}

/// A log of counts: times, and what `value` says of the rows that are not lost.
pub(crate) fn log(gyro: &Gyro, values: &[i64], lost: &[bool]) -> Vec<u8> {
    use std::fmt::Write as _;
    let mut text = String::from("time_s,temperature_c,counts\n");
    for (row, value) in values.iter().enumerate().filter(|(row, _)| !lost[*row]) {
        writeln!(text, "{},25.0,{value}", (row + 1) as f64 * gyro.interval_s).unwrap();
    }
    text.into_bytes()
}

/// Steps of a running total: an incremental log of the same gyro.
pub(crate) fn steps(totals: &[i64]) -> Vec<i64> {
    let before = std::iter::once(&0).chain(totals);
    totals.iter().zip(before).map(|(now, before)| now - before).collect()
}
