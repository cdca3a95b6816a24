//! What is shown of a test: the last minutes by seconds, the whole by means.

use std::collections::VecDeque;

use serde::Serialize;

use crate::live::seconds::Second;

/// Seconds that are shown one by one: so many of them, and so many points at most.
const MOST_SECONDS: usize = 600;
/// Means of the whole; when there are more, two become one.
const MOST_MEANS: usize = 1440;
/// Seconds of a mean, at first.
const FIRST_MEAN_S: f64 = 10.0;
/// Time over which a temperature's rate is shown, s.
const RATE_S: f64 = 60.0;

/// A point of what is shown: seconds since the first row, then a value a column, in the columns' order.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct TrendPoint {
    /// s since the first row.
    pub t_s: f64,
    /// Rates, °/h; null where there is none.
    pub rates_dph: Vec<Option<f64>>,
    /// Temperatures, °C.
    pub temperatures_c: Vec<Option<f64>>,
}

impl TrendPoint {
    fn of(second: &Second) -> Self {
        let known = |value: f64| Some(value).filter(|value| value.is_finite());
        Self {
            t_s: second.t_s,
            rates_dph: second.axes.iter().map(|axis| known(axis.rate_dph())).collect(),
            temperatures_c: second.temperatures_c.iter().map(|c| known(*c)).collect(),
        }
    }
}

/// Sums of a mean.
#[derive(Clone, Debug, Default)]
struct Sums {
    seconds: u32,
    t_s: f64,
    rates: Vec<(f64, u32)>,
    temperatures: Vec<(f64, u32)>,
}

fn add(sums: &mut Vec<(f64, u32)>, values: &[Option<f64>]) {
    sums.resize(values.len(), (0.0, 0));
    for ((sum, number), value) in sums.iter_mut().zip(values) {
        if let Some(value) = value {
            *sum += value;
            *number += 1;
        }
    }
}

fn means(sums: &[(f64, u32)]) -> Vec<Option<f64>> {
    sums.iter().map(|(sum, number)| (*number > 0).then(|| sum / f64::from(*number))).collect()
}

/// The last minutes, and the whole.
#[derive(Clone, Debug, Default)]
pub(crate) struct Trend {
    seconds: VecDeque<TrendPoint>,
    means: Vec<TrendPoint>,
    mean_s: f64,
    open: Sums,
}

impl Trend {
    pub(crate) fn push(&mut self, second: &Second) {
        let point = TrendPoint::of(second);
        if self.mean_s == 0.0 {
            self.mean_s = FIRST_MEAN_S;
        }
        if self.open.seconds > 0 && point.t_s - self.open.t_s >= self.mean_s {
            self.close();
        }
        if self.open.seconds == 0 {
            self.open.t_s = point.t_s;
        }
        self.open.seconds += 1;
        add(&mut self.open.rates, &point.rates_dph);
        add(&mut self.open.temperatures, &point.temperatures_c);
        let from_s = point.t_s - MOST_SECONDS as f64;
        self.seconds.push_back(point);
        while self.seconds.len() > MOST_SECONDS || self.seconds.front().is_some_and(|first| first.t_s <= from_s) {
            self.seconds.pop_front();
        }
    }

    fn close(&mut self) {
        let open = std::mem::take(&mut self.open);
        let (rates_dph, temperatures_c) = (means(&open.rates), means(&open.temperatures));
        self.means.push(TrendPoint { t_s: open.t_s + self.mean_s / 2.0, rates_dph, temperatures_c });
        if self.means.len() > MOST_MEANS {
            self.means = self.means.chunks(2).map(middle).collect();
            self.mean_s *= 2.0;
        }
    }

    /// The newest second.
    pub(crate) fn newest(&self) -> Option<&TrendPoint> {
        self.seconds.back()
    }

    /// The last minutes.
    pub(crate) fn seconds(&self) -> Vec<TrendPoint> {
        self.seconds.iter().cloned().collect()
    }

    /// The whole.
    pub(crate) fn means(&self) -> Vec<TrendPoint> {
        self.means.clone()
    }

    /// Rates of the temperatures over the last minute, °C/min.
    pub(crate) fn temperature_rates_cpm(&self) -> Vec<Option<f64>> {
        let Some(newest) = self.seconds.back() else { return Vec::new() };
        let before = self.seconds.iter().rev().find(|point| newest.t_s - point.t_s >= RATE_S);
        let rate = |at: usize| {
            let before = before?;
            let (from, to) = ((*before.temperatures_c.get(at)?)?, (*newest.temperatures_c.get(at)?)?);
            Some(60.0 * (to - from) / (newest.t_s - before.t_s))
        };
        (0..newest.temperatures_c.len()).map(rate).collect()
    }
}

/// The mean of two points, or one by itself.
fn middle(pair: &[TrendPoint]) -> TrendPoint {
    let [one, other] = pair else { return pair.first().cloned().unwrap_or_default() };
    let mean = |a: &[Option<f64>], b: &[Option<f64>]| {
        a.iter().zip(b).map(|(a, b)| a.zip(*b).map(|(a, b)| f64::midpoint(a, b)).or(*a).or(*b)).collect()
    };
    TrendPoint {
        t_s: f64::midpoint(one.t_s, other.t_s),
        rates_dph: mean(&one.rates_dph, &other.rates_dph),
        temperatures_c: mean(&one.temperatures_c, &other.temperatures_c),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three days stay within the bounds, and the mean of the whole is the mean of the seconds.
    #[test]
    fn three_days_are_kept_in_bounds() {
        let mut trend = Trend::default();
        for t in 0..3 * 86_400 {
            let second = Second { t_s: f64::from(t), temperatures_c: vec![f64::from(t)], ..Second::default() };
            trend.push(&second);
        }
        assert_eq!(trend.seconds().len(), MOST_SECONDS);
        let means = trend.means();
        assert!((MOST_MEANS / 2..=MOST_MEANS).contains(&means.len()), "{}", means.len());
        for point in &means[..means.len() - 1] {
            assert!((point.temperatures_c[0].unwrap() - point.t_s).abs() < 2.0, "{point:?}");
        }
        assert_eq!(trend.temperature_rates_cpm(), [Some(60.0)]);
    }

    /// Rows of 5 s: the last ten minutes are 120 points, not 600 rows.
    #[test]
    fn the_last_minutes_are_minutes_whatever_the_rows_are() {
        let mut trend = Trend::default();
        for row in 0..1000 {
            trend.push(&Second { t_s: f64::from(row) * 5.0, ..Second::default() });
        }
        let shown = trend.seconds();
        assert_eq!((shown.len(), shown[0].t_s), (120, 4400.0));
    }
}
