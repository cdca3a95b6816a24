//! Scale factor and bias of each plateau: the rate-table test in the usual terms.
//!
//! ```text
//! y = B + k·Ω,   S = S0/k,   ε = (1/k − 1)·1e6 ppm        two directions: k = (y⁺ − y⁻)/(Ω⁺ − Ω⁻)
//! ```
//!
//! by least squares over the windows of a plateau: temperature within ±1 °C, mean temperatures of its rates within 0.5 °C, at
//! least two rates. With one rate in two directions this is the two-direction method S = (θ⁺ − θ⁻)/(N⁺ − N⁻), which removes
//! bias and Earth rate. A plateau whose rates lie in different runs uses windows of equal temperature from each.
//!
//! * nonlinearity: largest distance of a rate's mean from the straight line, ppm of the largest rate; needs three rates
//! * asymmetry: 2(S⁺ − S⁻)/(S⁺ + S⁻), with a slope for each direction; needs two rates on a side, or rest and both sides
//! * repeatability: σ of ε about the mean of its temperature (within 2 °C), after removal of the slope over all plateaus; only
//!   temperatures that were visited more than once count
//!
//! The uncertainty of each is that of a sum over the windows under their noise ([`super::plateau_noise`]): a rate that stays long is
//! compared with others across the slow noise between them.
//!
//! These values check the joint fit; they are not inputs of it.

use crate::calibration::{Plateau, PpmEstimate, Repeatability};
use crate::noise_model::processes::SlowNoise;
use crate::rate_table::input::{RateTableInput, SAME_RATE};
use crate::rate_table::plateau_noise::PlateauNoise;
use crate::rate_table::turned_window::{KnownNoise, TurnedWindow};
use crate::window::{REACH_C, Windows, level_stretches};
use nalgebra::{DMatrix, DVector};

/// Fewer windows give no uncertainty.
const FEWEST: usize = 4;
/// A slope farther than this from one means that the gyro does not follow its table.
const FAR_FROM_ONE: f64 = 0.9;
/// Plateaus closer than this are visits of one temperature, °C.
const SAME_C: f64 = 2.0;

/// The plateaus of one axis over some windows, in their order.
pub(crate) fn plateaus_of(
    windows: &Windows,
    used: &[usize],
    column: usize,
    sensor: usize,
    turning: &RateTableInput,
    stated: Option<(SlowNoise, f64)>,
) -> Vec<Plateau> {
    let one = |i: &usize| TurnedWindow {
        run: windows.rows.run[*i] as usize,
        middle_s: windows.middle_s(*i),
        temperature_c: windows.rows.mean_c[sensor][*i],
        along_dph: turning.along_dph[*i],
        measured_dph: windows.rate_dph(column, *i),
        weight: windows.duration_s(*i) / windows.shape.nominal_s,
    };
    // About another axis, this one sees what its misalignment makes of the rate: no rate of its own.
    let used = used.iter().filter(|i| turning.across_dph[**i].1 == 0.0);
    let known = KnownNoise { stated, nominal_s: windows.shape.timed.then_some(windows.shape.nominal_s) };
    plateaus(&used.map(one).filter(|w| w.temperature_c.is_finite()).collect::<Vec<_>>(), known)
}

/// Every plateau that separates scale factor and bias, by temperature within the order of the test.
fn plateaus(windows: &[TurnedWindow], known: KnownNoise) -> Vec<Plateau> {
    let places = windows.iter().map(|w| (w.run, w.temperature_c));
    let stretches: Vec<Vec<TurnedWindow>> =
        level_stretches(places).into_iter().map(|stretch| windows[stretch].to_vec()).collect();
    let (mut whole, mut single): (Vec<_>, Vec<_>) = stretches.into_iter().partition(|stretch| rates(stretch) > 1);
    // Where rate and temperature change together, as on a ramp, their effects cannot be separated.
    whole.retain(|stretch| {
        let means = by_rate(stretch).into_iter().map(|(_, members)| mean_c(members.iter().map(|at| &stretch[*at])));
        let (lo, hi) = means.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), c| (lo.min(c), hi.max(c)));
        hi - lo <= 0.5 * REACH_C
    });
    // Rates that lie in different runs: windows of equal temperature together.
    single.sort_by(|a, b| mean_c(a.iter()).total_cmp(&mean_c(b.iter())));
    let mut gathered: Vec<Vec<TurnedWindow>> = Vec::new();
    for stretch in single {
        match gathered.last_mut() {
            Some(last) if (mean_c(last.iter()) - mean_c(stretch.iter())).abs() <= REACH_C => last.extend(stretch),
            _ => gathered.push(stretch),
        }
    }
    for plateau in &mut gathered {
        plateau.sort_by(|a, b| a.run.cmp(&b.run).then(a.middle_s.total_cmp(&b.middle_s)));
    }
    whole.extend(gathered.into_iter().filter(|stretch| rates(stretch) > 1));
    whole.retain(|stretch| stretch.len() >= FEWEST);
    let levels: Vec<Vec<usize>> = whole.iter().map(|stretch| rate_of_each(stretch)).collect();
    let noise = PlateauNoise::of(&whole, &levels, known);
    whole.iter().zip(&levels).filter_map(|(windows, levels)| plateau(windows, levels, &noise)).collect()
}

fn mean_c<'a>(windows: impl ExactSizeIterator<Item = &'a TurnedWindow>) -> f64 {
    let count = windows.len() as f64;
    windows.map(|w| w.temperature_c).sum::<f64>() / count
}

/// Different rates, rising, each with the places of its windows.
fn by_rate(windows: &[TurnedWindow]) -> Vec<(f64, Vec<usize>)> {
    let largest = largest_dph(windows);
    let mut sorted: Vec<usize> = (0..windows.len()).collect();
    sorted.sort_by(|a, b| windows[*a].along_dph.total_cmp(&windows[*b].along_dph));
    let mut out: Vec<(f64, Vec<usize>)> = Vec::new();
    for at in sorted {
        let along_dph = windows[at].along_dph;
        match out.last_mut() {
            Some((rate, members)) if along_dph - *rate <= SAME_RATE * largest => members.push(at),
            _ => out.push((along_dph, vec![at])),
        }
    }
    out
}

fn largest_dph(windows: &[TurnedWindow]) -> f64 {
    windows.iter().fold(0.0_f64, |most, w| most.max(w.along_dph.abs()))
}

fn rates(windows: &[TurnedWindow]) -> usize {
    by_rate(windows).len()
}

/// Of each window: the place of its rate among the different ones.
fn rate_of_each(windows: &[TurnedWindow]) -> Vec<usize> {
    let mut out = vec![0; windows.len()];
    for (place, (_, members)) in by_rate(windows).into_iter().enumerate() {
        members.into_iter().for_each(|at| out[at] = place);
    }
    out
}

/// Least squares on some columns, of what was measured beyond the table: about the line of slope one no digits are lost.
struct Line {
    theta: DVector<f64>,
    /// Of the parameters as sums over the windows: a row each.
    gain: DMatrix<f64>,
    /// The columns: a row for each window.
    design: DMatrix<f64>,
}

impl Line {
    fn of(windows: &[TurnedWindow], columns: &[fn(&TurnedWindow) -> f64]) -> Option<Self> {
        let (n, p) = (windows.len(), columns.len());
        let design = DMatrix::from_fn(n, p, |i, j| columns[j](&windows[i]));
        let scale: Vec<f64> = (0..p).map(|j| design.column(j).norm()).collect();
        if n <= p || scale.iter().any(|length| *length <= 0.0) {
            return None;
        }
        let scaled = DMatrix::from_fn(n, p, |i, j| design[(i, j)] / scale[j]);
        let weighted = DMatrix::from_fn(n, p, |i, j| windows[i].weight * scaled[(i, j)]);
        let mut gain = (scaled.transpose() * &weighted).try_inverse()? * weighted.transpose();
        gain.row_iter_mut().zip(&scale).for_each(|(mut row, scale)| row /= *scale);
        let theta = &gain * DVector::from_fn(n, |i, _| windows[i].beyond_dph());
        theta.iter().all(|v| v.is_finite()).then_some(Self { theta, gain, design })
    }
}

/// ε of a slope that lies `excess` above one, ppm.
fn ppm(excess: f64) -> f64 {
    ((1.0 + excess).recip() - 1.0) * 1e6
}

fn plateau(windows: &[TurnedWindow], levels: &[usize], noise: &PlateauNoise) -> Option<Plateau> {
    let line = Line::of(windows, &[|_| 1.0, |w| w.along_dph])?;
    if line.theta[1].abs() > FAR_FROM_ONE {
        return None;
    }
    let groups = by_rate(windows);
    let of_line = noise.about(windows, &[|_| 1.0, |w| w.along_dph])?;
    let sigma = |row: usize| noise.sigma(windows, &line.gain.row(row).transpose(), of_line);
    Some(Plateau {
        temperature_c: mean_c(windows.iter()),
        windows: windows.len(),
        rates_dps: groups.iter().map(|(rate, _)| rate / sagnac_units::DPH_PER_DPS).collect(),
        scale: PpmEstimate { ppm: ppm(line.theta[1]), sigma_ppm: 1e6 * sigma(1) },
        bias_dph: line.theta[0],
        bias_sigma_dph: sigma(0),
        nonlinearity: nonlinearity(windows, &groups, &line, noise.within(windows, levels), noise),
        asymmetry: asymmetry(windows, &groups, noise),
    })
}

/// The largest mean of a rate's windows about the line; `variance` is that of a window within its rate.
fn nonlinearity(
    windows: &[TurnedWindow],
    groups: &[(f64, Vec<usize>)],
    line: &Line,
    variance: Option<f64>,
    noise: &PlateauNoise,
) -> Option<PpmEstimate> {
    let largest = largest_dph(windows);
    if groups.len() < 3 || largest == 0.0 {
        return None;
    }
    let variance = variance?;
    let distance = |(_, members): &(f64, Vec<usize>)| {
        let part = (members.len() as f64).recip();
        let columns = members.iter().fold(DVector::zeros(2), |sum, at| sum + line.design.row(*at).transpose() * part);
        let mut parts = -line.gain.tr_mul(&columns);
        members.iter().for_each(|at| parts[*at] += part);
        let dph: f64 = parts.iter().zip(windows).map(|(part, w)| part * w.beyond_dph()).sum();
        (dph.abs(), noise.sigma(windows, &parts, variance))
    };
    let (distance, sigma) = groups.iter().map(distance).max_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(PpmEstimate { ppm: 1e6 * distance / largest, sigma_ppm: 1e6 * sigma / largest })
}

fn asymmetry(windows: &[TurnedWindow], groups: &[(f64, Vec<usize>)], noise: &PlateauNoise) -> Option<PpmEstimate> {
    let largest = largest_dph(windows);
    let side = |sign: f64| groups.iter().filter(|(rate, _)| rate * sign > SAME_RATE * largest).count();
    let rest = groups.iter().any(|(rate, _)| rate.abs() <= SAME_RATE * largest);
    let (forward, backward) = (side(1.0), side(-1.0));
    if forward == 0 || backward == 0 || !(rest || forward > 1 || backward > 1) {
        return None;
    }
    let columns: [fn(&TurnedWindow) -> f64; 3] = [|_| 1.0, |w| w.along_dph.max(0.0), |w| w.along_dph.min(0.0)];
    let line = Line::of(windows, &columns)?;
    let between = (line.gain.row(1) - line.gain.row(2)).transpose();
    let sigma = noise.sigma(windows, &between, noise.about(windows, &columns)?);
    // S is inverse to the slope: a steeper positive side is a smaller S⁺.
    Some(PpmEstimate { ppm: ppm(line.theta[1]) - ppm(line.theta[2]), sigma_ppm: 1e6 * sigma })
}

/// Spread of ε among visits of one temperature, after removal of its slope over all plateaus; `None` where no temperature
/// was visited twice.
pub(crate) fn repeatability(plateaus: &[Plateau]) -> Option<Repeatability> {
    let mut sorted: Vec<&Plateau> = plateaus.iter().collect();
    sorted.sort_by(|a, b| a.temperature_c.total_cmp(&b.temperature_c));
    let mean = |value: fn(&Plateau) -> f64| plateaus.iter().map(value).sum::<f64>() / plateaus.len().max(1) as f64;
    let (t, e) = (mean(|p| p.temperature_c), mean(|p| p.scale.ppm));
    let moment =
        |value: &dyn Fn(&Plateau) -> f64| plateaus.iter().map(|p| (p.temperature_c - t) * value(p)).sum::<f64>();
    let spread = moment(&|p| p.temperature_c - t);
    let wide = spread > plateaus.len() as f64 * SAME_C * SAME_C;
    let per_c = if wide { moment(&|p| p.scale.ppm - e) / spread } else { 0.0 };
    let level = |p: &Plateau| p.scale.ppm - per_c * (p.temperature_c - t);
    let mut groups: Vec<Vec<&Plateau>> = Vec::new();
    for plateau in sorted {
        match groups.last_mut() {
            // Measured from the first visit, so that a ramp does not become a chain of visits.
            Some(group) if plateau.temperature_c - group[0].temperature_c <= SAME_C => group.push(plateau),
            _ => groups.push(vec![plateau]),
        }
    }
    groups.retain(|group| group.len() > 1);
    let (mut squares, mut noise, mut degrees, mut temperatures) = (0.0, 0.0, 0, 0);
    for group in groups {
        let n = group.len() as f64;
        let mean = group.iter().map(|p| level(p)).sum::<f64>() / n;
        squares += group.iter().map(|p| (level(p) - mean).powi(2)).sum::<f64>();
        noise += group.iter().map(|p| p.scale.sigma_ppm.powi(2)).sum::<f64>() * (n - 1.0) / n;
        degrees += group.len() - 1;
        temperatures += 1;
    }
    (degrees > 0).then(|| Repeatability {
        sigma_ppm: (squares / degrees as f64).sqrt(),
        of_noise_ppm: (noise / degrees as f64).sqrt(),
        temperatures,
        degrees_of_freedom: degrees,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHITE: KnownNoise = KnownNoise { stated: None, nominal_s: None };

    fn windows(measured: impl Fn(f64, usize) -> f64, rates: &[f64], temperature_c: f64) -> Vec<TurnedWindow> {
        let one = |i: usize| {
            let along_dph = rates[i % rates.len()];
            TurnedWindow {
                run: 0,
                middle_s: 100.0 * i as f64,
                temperature_c,
                along_dph,
                measured_dph: measured(along_dph, i),
                weight: 1.0,
            }
        };
        (0..24).map(one).collect()
    }

    /// Small, without correlation to the rates' period.
    fn noise(i: usize) -> f64 {
        0.002 * (((i * 7919 + i * i * 104_729) % 1009) as f64 / 1009.0 - 0.5)
    }

    /// By hand: S⁺ and S⁻ from one rate in both directions; bias and Earth rate cancel.
    #[test]
    fn two_directions_separate_scale_and_bias() {
        let epsilon = 250e-6;
        let made = windows(|rate, i| (rate + 4.5 + 0.3) / (1.0 + epsilon) + noise(i), &[36_000.0, -36_000.0], 20.0);
        let found = plateaus(&made, WHITE).remove(0);
        assert!(
            (found.scale.ppm - 250.0).abs() < 3.0 * found.scale.sigma_ppm && found.scale.sigma_ppm < 0.01,
            "{found:?}"
        );
        assert!((found.bias_dph - 4.8).abs() < 0.002, "{found:?}");
        assert!(found.nonlinearity.is_none() && found.asymmetry.is_none(), "two rates cannot tell them");
    }

    /// A ramp of 1 °C/min in windows of 20 s with a rate every two minutes: no plateau. Rates that come and go within a degree
    /// are one, and so is a soak with the ends of its ramps.
    #[test]
    fn a_ramp_whose_rates_follow_the_temperature_has_no_plateaus() {
        let ramp = |change: usize| {
            let mut made = windows(|rate, i| rate + noise(i), &[0.0], 20.0);
            for (i, w) in made.iter_mut().enumerate() {
                w.along_dph = if (i / change).is_multiple_of(2) { 36_000.0 } else { -36_000.0 };
                (w.measured_dph, w.temperature_c) = (w.along_dph + noise(i), 20.0 + i as f64 / 3.0);
            }
            plateaus(&made, WHITE).len()
        };
        assert_eq!(ramp(6), 0);
        assert!(ramp(1) > 0);
        let mut soak = windows(|rate, i| rate + noise(i), &[36_000.0, -36_000.0], 20.0);
        soak[0].temperature_c = 19.2;
        soak[23].temperature_c = 20.9;
        assert_eq!(plateaus(&soak, WHITE).len(), 1);
    }

    #[test]
    fn asymmetry_and_nonlinearity_need_their_rates() {
        let rates = [36_000.0, -36_000.0, 0.0, 18_000.0, -18_000.0];
        let lame = |rate: f64| if rate > 0.0 { rate / (1.0 + 30e-6) } else { rate / (1.0 - 10e-6) };
        let found = plateaus(&windows(|rate, i| lame(rate) + noise(i), &rates, 20.0), WHITE).remove(0);
        let asymmetry = found.asymmetry.unwrap();
        assert!((asymmetry.ppm - 40.0).abs() < 3.0 * asymmetry.sigma_ppm, "{asymmetry:?}");
        let bent = |rate: f64| rate + 1.0 * (rate / 36_000.0).powi(2);
        let found = plateaus(&windows(|rate, i| bent(rate) + noise(i), &rates, 20.0), WHITE).remove(0);
        // About the line through 1, 0.25, 0, 0.25, 1 (mean 0.5 but for unequal counts) the ends lie half a °/h away.
        let nonlinearity = found.nonlinearity.unwrap();
        assert!((nonlinearity.ppm - 0.5 / 36_000.0 * 1e6).abs() < 1.0, "{nonlinearity:?}");
    }

    #[test]
    fn visits_of_one_temperature_repeat_or_not() {
        let mut made = Vec::new();
        for (visit, epsilon) in [100e-6, 104e-6, 98e-6].into_iter().enumerate() {
            made.extend(windows(|rate, i| rate / (1.0 + epsilon) + noise(i), &[36_000.0, -36_000.0], 20.0));
            made.extend(windows(
                |rate, i| rate / (1.0 + 50e-6) + noise(i),
                &[36_000.0, -36_000.0],
                40.0 + 10.0 * visit as f64,
            ));
        }
        let found = repeatability(&plateaus(&made, WHITE)).unwrap();
        // 100, 104, 98: σ = 3.055.
        assert!((found.sigma_ppm - 3.055).abs() < 0.05 && found.temperatures == 1, "{found:?}");
        assert!(found.of_noise_ppm < 0.02);
    }

    /// One direction per run: windows of equal temperature are brought together.
    #[test]
    fn directions_in_different_runs_meet() {
        let mut made = Vec::new();
        for (run, rate) in [36_000.0, -36_000.0].into_iter().enumerate() {
            made.extend((0..60).map(|i| TurnedWindow {
                run,
                middle_s: 100.0 * f64::from(i),
                temperature_c: 10.0 + 0.25 * f64::from(i),
                along_dph: rate,
                measured_dph: rate / (1.0 + 1e-6 * f64::from(i)) + 1.0,
                weight: 1.0,
            }));
        }
        let found = plateaus(&made, WHITE);
        assert!(
            found.len() >= 4 && found.iter().all(|p| (p.scale.ppm - 4.0 * (p.temperature_c - 10.0)).abs() < 0.5),
            "{found:?}"
        );
    }
}
