//! The noise of a record that is judged window by window: its Allan curve without the windows that are left out.
//!
//! ```text
//! rows ─▶ squared differences, by the window in which they end ─▶ the octaves that no excluded window touches ─▶ the five laws ─▶ N, Q
//! ```
//!
//! Differences reach across windows, up to τ = 8 windows: counts may hide N at every τ within one. The longest octaves are dropped
//! until the laws describe the curve ([`crate::model`]), so that a drift over temperature is no noise. It is the estimator of a whole
//! record ([`crate::budget()`]), on fewer octaves.
//!
//! Fails on a record with a strong signal at τ ≤ τ_w/4: the signal counts as noise, and N has no interval.
//! Memory: a phase pyramid, and two numbers per octave and window.

use crate::difference::{Deviation, Difference, SquareSum};
use crate::freedom::{NEAREST, Stretches, edf_white_fm};
use crate::laws::terms::{Point, WHITE, fit_terms};
use crate::model::{Model, RawPoint, is_rounding};
use crate::pyramid::Pyramid;
use crate::taus::LONGEST_PART;
use crate::term_value::{MeasuredNoise, NoiseTerms};

/// Longest τ, in windows.
const LONGEST: f64 = 8.0;
/// Part of a window within which a drift over temperature is no matter.
const WITHIN: f64 = 0.25;
/// Most octaves: τ up to 2³⁹ rows.
const MOST_OCTAVES: usize = 40;
/// Points with fewer equivalent degrees of freedom are not used.
const MIN_EDF: f64 = 8.0;
/// A hump is this many times above noise, in deviation.
const HUMP: f64 = 10.0;
/// And this many times above a shorter τ.
const RISE: f64 = 3.0;
/// Most lost rows in a row that are filled.
pub const FILLED: u64 = 8;
/// Phases that are passed on together.
const TOGETHER: usize = 64;

/// Squared differences that end in one window, one entry per octave.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WindowSquares {
    /// In arcsec².
    pub octaves: Vec<SquareSum>,
}

impl WindowSquares {
    /// Mean square at the shortest τ, and its degrees of freedom.
    pub fn shortest(&self) -> Option<(f64, f64)> {
        let shortest = self.octaves.first().filter(|sum| sum.number > 0.0)?;
        Some((shortest.squares / shortest.number, edf_white_fm(shortest.number + 2.0, 1.0)))
    }
}

/// A window as the noise of a record sees it.
#[derive(Clone, Copy, Debug)]
pub struct JudgedWindow<'a> {
    /// Its squares.
    pub squares: &'a WindowSquares,
    /// Intervals of a row in it, those of lost rows and of a short gap before it included.
    pub intervals: u64,
    /// Phases of them that are missing: a running total has lost rows.
    pub holes: u64,
    /// Rows of them that were filled with a mean.
    pub filled: u64,
    /// It goes on where the window before it ends.
    pub follows: bool,
    /// It counts.
    pub is_used: bool,
}

/// A place of a curve that no noise explains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hump {
    /// τ of its top, s.
    pub tau_s: f64,
    /// Deviation there over the largest that the laws of noise allow.
    pub times: f64,
}

/// Octaves without excluded windows, and the stretches behind them.
pub struct WindowedCurve {
    octaves: Vec<SquareSum>,
    stretches: Stretches,
    tau0_s: f64,
    window_s: f64,
    count_arcsec: Option<f64>,
}

impl WindowedCurve {
    /// Of windows in their order, `window_s` each. A difference of two windows counts where both and all between them do.
    pub fn of<'a>(windows: impl Iterator<Item = JudgedWindow<'a>>, tau0_s: f64, window_s: f64) -> Self {
        let (mut octaves, mut stretches): (Vec<SquareSum>, _) = (Vec::new(), Stretches::default());
        // Intervals before a window that count; all that exist, where its stretch begins with a window that does.
        let (mut clean, mut is_whole, mut holes, mut filled) = (0_u64, true, 0, 0);
        for window in windows {
            if !window.follows || !window.is_used {
                stretches.add(clean + u64::from(clean > 0));
                (clean, is_whole) = (0, !window.follows && window.is_used);
            }
            if !window.is_used {
                continue;
            }
            octaves.resize(octaves.len().max(window.squares.octaves.len()), SquareSum::default());
            for (octave, sum) in window.squares.octaves.iter().enumerate() {
                if is_whole || clean >= 2 << octave {
                    octaves[octave].merge(*sum);
                }
            }
            clean += window.intervals;
            holes += window.holes;
            filled += window.filled;
        }
        stretches.add(clean + u64::from(clean > 0));
        stretches.set_missing(holes, filled);
        Self { octaves, stretches, tau0_s, window_s, count_arcsec: None }
    }

    /// The same of angles that were counted in wholes of `count_arcsec`.
    #[must_use]
    pub fn counted(self, count_arcsec: Option<f64>) -> Self {
        Self { count_arcsec, ..self }
    }

    /// σ² in (°/h)² with enough degrees of freedom; the longest τ last.
    fn points(&self) -> Vec<RawPoint> {
        self.all_points().take_while(|point| point.edf >= MIN_EDF).collect()
    }

    /// The same at every τ that the record shows.
    fn all_points(&self) -> impl Iterator<Item = RawPoint> {
        let (phases, longest) = (self.stretches.phases(), self.stretches.longest() / LONGEST_PART);
        let point = move |(octave, sum): (usize, &SquareSum)| {
            let m = Some(2.0_f64.powi(octave as i32)).filter(|m| *m <= longest as f64)?;
            let variance = sum.variance(Deviation::Allan, m * self.tau0_s).filter(|variance| *variance > 0.0)?;
            let variance = variance / self.stretches.white_factor(Deviation::Allan, m);
            Some(RawPoint { m, variance, edf: edf_white_fm(phases, m), uncertain: 0.0 })
        };
        self.octaves.iter().enumerate().filter_map(point)
    }

    /// σ² at two rows over that at one: 1/4 of rounding, 1/2 of white noise, more where neighbouring rows correlate.
    pub fn second_over_first(&self) -> Option<f64> {
        let mut points = self.all_points();
        let (first, second) = (points.next()?, points.next()?);
        (first.m == 1.0 && second.m == 2.0).then(|| second.variance / first.variance)
    }

    /// Where the curve rises to a place far above all that N, B and K allow of every other τ: motion, or a strong line. White noise
    /// behind a filter rises, too, but N explains its fall; rounding falls faster, but from the shortest τ on.
    pub fn hump(&self) -> Option<Hump> {
        let points: Vec<RawPoint> = self.all_points().collect();
        let over = |at: usize| {
            let RawPoint { m, variance, .. } = points[at];
            // The largest σ² here of a law ∝ 1/τᵖ that lies nowhere above these points.
            let most = |points: &[RawPoint], power: i32| {
                points.iter().map(|point| point.variance * (point.m / m).powi(power)).reduce(f64::min)
            };
            let [n, b, k] = [most(&points, 1)?, most(&points, 0)?, most(&points, -1)?];
            let hump = Hump { tau_s: m * self.tau0_s, times: (variance / (n + b + k)).sqrt() };
            (variance >= RISE * RISE * most(&points[..at], 0)?).then_some(hump)
        };
        let highest = (0..points.len()).filter_map(over).max_by(|a, b| a.times.total_cmp(&b.times))?;
        (highest.times >= HUMP).then_some(highest)
    }

    /// N and Q; `None` from fewer than two usable τ, without any noise, or where a filter leaves no τ at which the laws hold.
    pub fn noise(&self) -> Option<MeasuredNoise> {
        let points = self.points();
        let within = self.within(&points);
        if within < 2 {
            return None;
        }
        if let Some(noise) = Model::white_alone(&points[..within], self.tau0_s, &self.stretches) {
            return Some(noise);
        }
        let model = |last: usize| Model::new(&points[..last], self.tau0_s, &self.stretches, self.count_arcsec);
        let described = (within..=points.len()).rev().map(model).find(Model::describes);
        let noise = match described {
            Some(model) => {
                let (terms, ends) = (model.noise()?, model.walk_ends());
                // A slow term may take the place of N: what short τ show then bounds both.
                let short =
                    ends.and_then(|[_, at_most]| Some(self.white_terms(&points[..within])?.n_arcsec_rt_s.min(at_most)));
                let n_arcsec_rt_s = short.filter(|_| terms.n_arcsec_rt_s == 0.0).unwrap_or(terms.n_arcsec_rt_s);
                let filter_hz = model.law_range(&points).and_then(|range| range.filter_hz);
                MeasuredNoise { terms: NoiseTerms { n_arcsec_rt_s, ..terms }, n_ends_arcsec_rt_s: ends, filter_hz }
            }
            None => MeasuredNoise::stated(self.undescribed(&points[..within])?),
        };
        (noise.terms.n_arcsec_rt_s + noise.terms.q_arcsec > 0.0).then_some(noise)
    }

    /// N and Q of a curve that shows something else, too.
    fn undescribed(&self, points: &[RawPoint]) -> Option<NoiseTerms> {
        let shape = Model::new(points, self.tau0_s, &self.stretches, self.count_arcsec).filtered();
        if let Some(n_arcsec_rt_s) = shape {
            return (n_arcsec_rt_s > 0.0).then_some(NoiseTerms { n_arcsec_rt_s, q_arcsec: 0.0 });
        }
        // A beat of counts that lasts longer than a window looks like any law.
        let beats = self.count_arcsec.is_some_and(|count| is_rounding(points, self.tau0_s, count));
        self.white_terms(points).filter(|_| !beats)
    }

    /// Q and N alone, at the τ of these points.
    fn white_terms(&self, points: &[RawPoint]) -> Option<NoiseTerms> {
        let point = |p: &RawPoint| Point { tau_s: p.m * self.tau0_s, variance: p.variance, edf: p.edf };
        let points: Vec<Point> = points.iter().map(point).collect();
        let fitted = fit_terms(&points, &WHITE)?;
        let [q_arcsec, n_arcsec_rt_s] = WHITE.map(|term| fitted.root(term));
        Some(NoiseTerms { n_arcsec_rt_s, q_arcsec })
    }

    /// N² that `other` shows within windows beyond this curve, of the same rows before something was added to them, arcsec²/s.
    pub fn walk_added_in(&self, other: &Self) -> Option<f64> {
        let square = |curve: &Self| {
            let points = curve.points();
            Some(curve.white_terms(&points[..curve.within(&points)])?.n_arcsec_rt_s.powi(2))
        };
        Some(square(other)? - square(self)?)
    }

    /// How many of these points a drift over temperature does not reach.
    fn within(&self, points: &[RawPoint]) -> usize {
        points.iter().filter(|p| p.m * self.tau0_s <= WITHIN * self.window_s * (1.0 + 1e-9)).count()
    }
}

/// One-pass squares for one axis, window by window.
#[derive(Clone, Debug)]
pub struct WindowedDifferences {
    /// At multiples 1, 2, 4 … of τ0.
    pyramid: Pyramid,
    octaves: usize,
    phase: f64,
    /// Mean angle of the last [`NEAREST`] samples or so, arcsec.
    mean_arcsec: f64,
}

impl WindowedDifferences {
    /// For samples of `tau0_s` seconds in windows of `window_s`; of windows of one row none.
    pub fn new(tau0_s: f64, window_s: f64) -> Self {
        let fits = |m: &usize| *m as f64 * tau0_s <= LONGEST * window_s * (1.0 + 1e-9);
        let multiples = (0..MOST_OCTAVES).map(|octave| 1_usize << octave).take_while(fits);
        let wanted: Vec<Difference> = multiples.map(|m| Difference { deviation: Deviation::Allan, m }).collect();
        Self { octaves: wanted.len(), pyramid: Pyramid::new(wanted), phase: 0.0, mean_arcsec: 0.0 }
    }

    /// Octaves of τ.
    pub fn octaves(&self) -> usize {
        self.octaves
    }

    /// The next samples of the window: angles of one interval each, `arcsec` per unit.
    pub fn push(&mut self, angles: &[f64], arcsec: f64) {
        if self.octaves == 0 {
            return;
        }
        self.begin();
        let last = &angles[angles.len().saturating_sub(NEAREST)..];
        let mean_arcsec = arcsec * last.iter().sum::<f64>() / last.len().max(1) as f64;
        self.mean_arcsec += (mean_arcsec - self.mean_arcsec) * last.len() as f64 / NEAREST as f64;
        let mut phases = [0.0; TOGETHER];
        for part in angles.chunks(TOGETHER) {
            for (phase, angle) in phases.iter_mut().zip(part) {
                self.phase += angle * arcsec;
                *phase = self.phase;
            }
            // A phase that is not known leaves none behind it that is.
            self.pyramid.extend(&phases[..part.len()], !self.phase.is_nan());
        }
    }

    /// Lost samples of a rate, each filled with the mean of those before it.
    pub fn fill(&mut self, samples: u64) {
        for _ in 0..samples.min(FILLED) {
            self.phase += self.mean_arcsec;
            self.pyramid.extend(&[self.phase], !self.phase.is_nan());
        }
    }

    /// A row of several intervals: a running total with missing rows in between. The phase is known at its end and missing
    /// within it.
    pub fn push_wide(&mut self, intervals: u64, angle: f64, arcsec: f64) {
        if self.octaves == 0 || intervals == 0 {
            return;
        }
        // No difference reaches across more missing phases than the longest one spans.
        if intervals > 2 << self.octaves {
            return self.end_stretch();
        }
        self.begin();
        for from in (1..intervals).step_by(TOGETHER) {
            let missing = (intervals - from).min(TOGETHER as u64) as usize;
            self.pyramid.extend(&[f64::NAN; TOGETHER][..missing], false);
        }
        self.phase += angle * arcsec;
        self.pyramid.extend(&[self.phase], !self.phase.is_nan());
    }

    /// The phase before the first sample of a stretch.
    fn begin(&mut self) {
        if self.pyramid.len() == 0 {
            self.pyramid.extend(&[0.0], true);
        }
    }

    /// Ends the window and returns its squares. The next sample begins a window that follows, or a stretch of its own.
    pub fn end_window(&mut self) -> WindowSquares {
        WindowSquares { octaves: self.pyramid.take_so_far() }
    }

    /// Ends the stretch: no difference reaches across.
    pub fn end_stretch(&mut self) {
        self.pyramid.end_stretch();
        self.phase = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(squares: &WindowSquares, rows: u64) -> JudgedWindow<'_> {
        JudgedWindow { squares, intervals: rows, holes: 0, filled: 0, follows: true, is_used: true }
    }

    /// Closed form: phase alternating 0, 1, 0, 1 … has second difference ±2 at m = 1 and 0 at m = 2.
    #[test]
    fn second_differences_are_those_of_the_phase() {
        let mut differences = WindowedDifferences::new(1.0, 1.0);
        let angles: Vec<f64> = (0..100).map(|k| if k % 2 == 0 { 1.0 } else { -1.0 }).collect();
        differences.push(&angles, 1.0);
        let squares = differences.end_window().octaves;
        assert!((squares[0].squares / squares[0].number - 4.0).abs() < 1e-12);
        let numbers: Vec<f64> = squares.iter().map(|sum| sum.number).collect();
        assert_eq!((squares[1].squares, numbers.as_slice()), (0.0, &[99.0, 97.0, 93.0, 85.0][..]));
    }

    /// The windows of a stretch together have every difference of it; a stretch that ends has none across its end.
    #[test]
    fn differences_reach_across_windows_of_a_stretch() {
        let angles: Vec<f64> = (0..200).map(|k| f64::from(k * 7919 % 23)).collect();
        let numbers = |ends: bool| {
            let mut differences = WindowedDifferences::new(1.0, 10.0);
            let mut windows = Vec::new();
            for part in angles.chunks(100) {
                if ends {
                    differences.end_stretch();
                }
                differences.push(part, 1.0);
                windows.push(differences.end_window());
            }
            (0..6).map(|octave| windows.iter().map(|w| w.octaves[octave].number).sum::<f64>()).collect::<Vec<_>>()
        };
        let differences_of = |phases: f64| (0..6).map(move |octave| phases - f64::from(2 << octave));
        assert_eq!(numbers(false), differences_of(201.0).collect::<Vec<_>>());
        assert_eq!(numbers(true), differences_of(101.0).map(|number| 2.0 * number).collect::<Vec<_>>());
    }

    /// No difference of an excluded window counts: windows next to a wild one give the sums of those far from it.
    #[test]
    fn an_excluded_window_has_no_effect() {
        let mut differences = WindowedDifferences::new(1.0, 10.0);
        let windows: Vec<WindowSquares> = (0..40)
            .map(|window| {
                let size = if window == 20 { 1e9 } else { 1.0 };
                let angles: Vec<f64> = (0..10).map(|k| size * f64::from((10 * window + k) * 7919 % 23)).collect();
                differences.push(&angles, 1.0);
                differences.end_window()
            })
            .collect();
        let judge = |(at, squares)| JudgedWindow { is_used: at != 20, follows: at > 0, ..judged(squares, 10) };
        let curve = WindowedCurve::of(windows.iter().enumerate().map(judge), 1.0, 10.0);
        assert!(curve.octaves.iter().all(|sum| sum.squares < 1e9 && sum.number > 0.0), "{:?}", curve.octaves);
        assert_eq!((curve.stretches.count(), curve.stretches.longest()), (2, 201));
    }

    /// A gap longer than the longest difference divides the stretch: the sums equal those of two.
    #[test]
    fn a_long_gap_in_a_total_divides_the_stretch() {
        let angles: Vec<f64> = (0..200).map(|k| f64::from(k * 7919 % 23)).collect();
        let sums = |intervals: Option<u64>| {
            let mut differences = WindowedDifferences::new(1.0, 1.0);
            differences.push(&angles[..90], 1.0);
            match intervals {
                Some(intervals) => differences.push_wide(intervals, 1234.5, 1.0),
                None => differences.end_stretch(),
            }
            differences.push(&angles[90..], 1.0);
            differences.end_window().octaves
        };
        let two = sums(None);
        for intervals in [17, 1000, u64::MAX] {
            for (one, two) in sums(Some(intervals)).iter().zip(&two) {
                assert_eq!(one.number, two.number, "{intervals}");
                assert!((one.squares / two.squares - 1.0).abs() < 1e-12, "{intervals}");
            }
        }
    }

    #[test]
    fn silence_has_no_noise() {
        let mut differences = WindowedDifferences::new(1.0, 100.0);
        differences.push(&[4.5; 1000], 1.0);
        let squares = differences.end_window();
        assert_eq!(WindowedCurve::of([judged(&squares, 1000)].into_iter(), 1.0, 100.0).noise(), None);
    }

    /// The result is that of the definition, bit for bit the same for any size of the pieces.
    #[test]
    fn pieces_do_not_matter() {
        let angles: Vec<f64> = (0..20_000).map(|k| f64::from((k * 7919) % 101) / 7.0).collect();
        let sums = |piece: usize| {
            let mut differences = WindowedDifferences::new(1.0, 64.0);
            angles.chunks(piece).for_each(|part| differences.push(part, 0.15));
            differences.end_window().octaves
        };
        let whole = sums(angles.len());
        assert_eq!(whole, sums(1));
        assert_eq!(whole, sums(4097));
        let mut phases = vec![0.0];
        angles.iter().for_each(|angle| phases.push(phases[phases.len() - 1] + 0.15 * angle));
        for (octave, sum) in whole.iter().enumerate() {
            let m = 1 << octave;
            let second = (2 * m..phases.len()).map(|k| phases[k] - 2.0 * phases[k - m] + phases[k - 2 * m]);
            let expected: f64 = second.map(|d| d * d).sum();
            assert!((sum.squares / expected - 1.0).abs() < 1e-12, "m {m}");
            assert_eq!(sum.number, (phases.len() - 2 * m) as f64);
        }
    }
}
