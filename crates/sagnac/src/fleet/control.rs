//! Control charts: whether the next unit is like those before.
//!
//! ```text
//! z = (value − median)/(1.4826·MAD)
//! Western Electric (1956):  1: |z| > 3    2: two of three beyond 2 on one side    3: four of five beyond 1    4: eight in a row on one side
//! EWMA (Roberts 1959):      wᵢ = (1 − λ)·wᵢ₋₁ + λ·zᵢ;   |wᵢ| > L·√(λ/(2 − λ)·(1 − (1 − λ)²ⁱ)),   λ = 0.2, L = 2.962
//! ```
//!
//! Each rule fires by chance as well; of independent normal values this often at a point, in closed form: 0.0027, 0.0021, 0.0045, 0.0078.
//! All four together run 92 points to a false signal, the EWMA 500 (Champ and Woodall 1987; Lucas and Saccucci 1990; held by the tests). So
//! a count of signals stands next to the count that chance makes.
//!
//! Fails where neighbours are alike for a good reason, such as three axes of one unit, or where no order of time is known.

/// Weight of a new value.
const LAMBDA: f64 = 0.2;
/// Width of the limits of the EWMA for a false signal in 500 points.
const WIDTH: f64 = 2.962;
/// Values that give a centre and a σ.
const LEAST_VALUES: usize = 20;
/// MAD of a normal distribution as its σ.
pub(super) const SIGMA_OF_MAD: f64 = 1.482_602_218_505_602;

/// A rule that a point has broken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Rule {
    /// Beyond 3 σ.
    Beyond,
    /// Two of three beyond 2 σ on one side.
    TwoOfThree,
    /// Four of five beyond 1 σ on one side.
    FourOfFive,
    /// Eight in a row on one side.
    EightInARow,
    /// The moving average is beyond its limits.
    Ewma,
}

impl Rule {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Beyond, Self::TwoOfThree, Self::FourOfFive, Self::EightInARow, Self::Ewma];

    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Beyond => "beyond 3 σ",
            Self::TwoOfThree => "two of three beyond 2 σ",
            Self::FourOfFive => "four of five beyond 1 σ",
            Self::EightInARow => "eight in a row on one side",
            Self::Ewma => "moving average (EWMA)",
        }
    }

    /// How often it fires by chance at a point with enough points before it; `None` for the EWMA, whose points are alike.
    pub fn by_chance(self) -> Option<f64> {
        match self {
            Self::Beyond => Some(0.002_699_8),
            Self::TwoOfThree => Some(0.002_046_7),
            Self::FourOfFive => Some(0.004_467_6),
            Self::EightInARow => Some(0.007_812_5),
            Self::Ewma => None,
        }
    }
}

/// A chart of one quantity.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ControlChart {
    /// Median.
    pub centre: f64,
    /// σ by the MAD.
    pub sigma: f64,
    /// The values, in order.
    pub values: Vec<f64>,
    /// Their moving average.
    pub ewma: Vec<f64>,
    /// Half width of its limits.
    pub ewma_half: Vec<f64>,
    /// Points that broke a rule.
    pub signals: Vec<(usize, Rule)>,
}

impl ControlChart {
    /// Of values in order; `None` of fewer than twenty, or where most are equal.
    pub fn new(values: Vec<f64>) -> Option<Self> {
        let centre = median(&values);
        let away: Vec<f64> = values.iter().map(|value| (value - centre).abs()).collect();
        let sigma = SIGMA_OF_MAD * median(&away);
        (values.len() >= LEAST_VALUES && sigma > 0.0 && sigma.is_finite()).then(|| Self::about(values, centre, sigma))
    }

    /// Of values whose centre and σ are known.
    pub fn about(values: Vec<f64>, centre: f64, sigma: f64) -> Self {
        let z: Vec<f64> = values.iter().map(|value| (value - centre) / sigma).collect();
        let (mut ewma, mut ewma_half, mut w, mut rest) = (Vec::new(), Vec::new(), 0.0, 1.0);
        for z in &z {
            w += LAMBDA * (z - w);
            rest *= (1.0 - LAMBDA).powi(2);
            ewma.push(centre + sigma * w);
            ewma_half.push(sigma * WIDTH * (LAMBDA / (2.0 - LAMBDA) * (1.0 - rest)).sqrt());
        }
        let beyond = |at: usize| (ewma[at] - centre).abs() > ewma_half[at];
        let mut signals = Vec::new();
        for at in 0..z.len() {
            let broken = western_electric(&z[..=at]).into_iter().chain(beyond(at).then_some(Rule::Ewma));
            signals.extend(broken.map(|rule| (at, rule)));
        }
        Self { centre, sigma, values, ewma, ewma_half, signals }
    }

    /// Values of another unit. Rules count σ, so the signals stay.
    pub(super) fn scale(&mut self, factor: f64) {
        let all = [&mut self.values, &mut self.ewma, &mut self.ewma_half].into_iter().flatten();
        all.chain([&mut self.centre, &mut self.sigma]).for_each(|value| *value *= factor);
    }

    /// Points that broke a rule, and how many chance makes.
    pub fn count(&self, rule: Rule) -> (usize, Option<f64>) {
        let count = self.signals.iter().filter(|(_, broken)| *broken == rule).count();
        (count, rule.by_chance().map(|rate| rate * self.values.len() as f64))
    }
}

/// The rules that the last of some points breaks.
fn western_electric(z: &[f64]) -> Vec<Rule> {
    let Some(last) = z.last() else { return Vec::new() };
    let side = last.signum();
    let tail = |n: usize| z.len().checked_sub(n).map(|from| &z[from..]);
    let breaks = |n: usize, least: usize, bound: f64| {
        side * last > bound && tail(n).is_some_and(|tail| tail.iter().filter(|z| side * **z > bound).count() >= least)
    };
    let mut broken = Vec::new();
    if last.abs() > 3.0 {
        broken.push(Rule::Beyond);
    }
    if breaks(3, 2, 2.0) {
        broken.push(Rule::TwoOfThree);
    }
    if breaks(5, 4, 1.0) {
        broken.push(Rule::FourOfFive);
    }
    if breaks(8, 8, 0.0) {
        broken.push(Rule::EightInARow);
    }
    broken
}

/// Median; NaN of nothing.
pub(super) fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let middle = sorted.len() / 2;
    match sorted.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => sorted[middle],
        _ => f64::midpoint(sorted[middle - 1], sorted[middle]),
    }
}

#[cfg(test)]
mod tests {
    use super::super::draws::Draws;
    use super::*;

    /// Points to the first signal of some rules, mean of many charts with its standard error.
    fn run_length(rules: &[Rule], shift: f64, charts: usize, seed: u64) -> [f64; 2] {
        let mut draws = Draws(seed);
        let lengths: Vec<f64> = (0..charts)
            .map(|_| {
                // Longer than nearly every chart; one that lasts begins a new piece.
                let mut before = 0;
                loop {
                    let values: Vec<f64> = (0..2000).map(|_| shift + draws.normal()).collect();
                    let chart = ControlChart::about(values, 0.0, 1.0);
                    match chart.signals.iter().find(|(_, rule)| rules.contains(rule)) {
                        Some((at, _)) => return (before + at + 1) as f64,
                        None => before += 2000,
                    }
                }
            })
            .collect();
        let n = lengths.len() as f64;
        let mean = lengths.iter().sum::<f64>() / n;
        let square = lengths.iter().map(|length| (length - mean).powi(2)).sum::<f64>() / (n - 1.0);
        [mean, (square / n).sqrt()]
    }

    /// Champ and Woodall, Technometrics 29 (1987), table 1: all four rules, no shift 91.75, a shift of 1 σ 9.22. The first rule alone is
    /// geometric: 1/0.0027 = 370.4.
    #[test]
    fn western_electric_runs_as_long_as_published() {
        for (rules, shift, published) in
            [(&Rule::ALL[..4], 0.0, 91.75), (&Rule::ALL[..4], 1.0, 9.22), (&Rule::ALL[..1], 0.0, 370.4)]
        {
            let [mean, error] = run_length(rules, shift, 1500, 11);
            assert!((mean - published).abs() < 4.0 * error, "{mean} ± {error} for {published}");
        }
    }

    /// Lucas and Saccucci, Technometrics 32 (1990), table 3: λ 0.2, L 2.962, no shift 500, a shift of 1 σ 10.5. Their limits are those
    /// of a long chart; ours are narrower at its start, so that an early shift shows a little sooner.
    #[test]
    fn the_moving_average_runs_as_long_as_published() {
        let [mean, error] = run_length(&[Rule::Ewma], 0.0, 1500, 12);
        assert!((mean - 500.0).abs() < 4.0 * error + 15.0, "{mean} ± {error}");
        let [mean, error] = run_length(&[Rule::Ewma], 1.0, 1500, 13);
        assert!((8.0..10.5 + 4.0 * error).contains(&mean), "{mean} ± {error}");
    }

    /// The closed forms of chance against a long chart.
    #[test]
    fn chance_is_as_stated() {
        let mut draws = Draws(14);
        let points = 400_000;
        let chart = ControlChart::about((0..points).map(|_| draws.normal()).collect(), 0.0, 1.0);
        for rule in &Rule::ALL[..4] {
            let (found, expected) = chart.count(*rule);
            let expected = expected.unwrap();
            // Signals of one rule come in runs: eight times a count's own variance at most.
            assert!(
                (found as f64 - expected).abs() < 4.0 * (8.0 * expected).sqrt(),
                "{rule:?}: {found} for {expected}"
            );
        }
    }

    /// Centre and σ are those of the most, whatever a few are.
    #[test]
    fn a_few_odd_values_do_not_move_the_limits() {
        let mut draws = Draws(15);
        let mut values: Vec<f64> = (0..500).map(|_| 3.0 + 0.5 * draws.normal()).collect();
        values[100..110].fill(100.0);
        let chart = ControlChart::new(values).unwrap();
        assert!(
            (chart.centre - 3.0).abs() < 0.1 && (chart.sigma - 0.5).abs() < 0.06,
            "{} {}",
            chart.centre,
            chart.sigma
        );
        assert!((100..110).all(|at| chart.signals.contains(&(at, Rule::Beyond))));
        assert!(ControlChart::new(vec![1.0; 19]).is_none() && ControlChart::new(vec![1.0; 50]).is_none());
    }
}
