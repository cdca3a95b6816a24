//! Deviations against printed values and published recordings.

use crate::recordings::{bench, shared};
use crate::support::{paper_setup, reader};
use sagnac::allan::{Request, budget_of_curves, noise_budget, parse_curve};
use sagnac::calibration::LogFile;
use sagnac_log::setup::Setup;
use sagnac_noise::{AxisBudget, BareCurve, Deviation, Difference, Taus, TermValue, overlapping, phases};
use sagnac_sim::{PaperRig, csv_bytes};

fn deviation(deviation: Deviation, rates: &[f64], m: usize) -> f64 {
    let sums = overlapping(&phases(rates, 0.0), &[Difference { deviation, m }]);
    sums[0].variance(deviation, m as f64).unwrap().sqrt()
}

/// NIST SP 1065, table 31: the ten-point set of NBS Monograph 140, to the digits printed there. At τ = 1 the Hadamard
/// deviation is 70.806075…, which the table rounds down.
#[test]
fn nbs14_ten_points() {
    let rates = [892.0, 809.0, 823.0, 798.0, 671.0, 644.0, 883.0, 903.0, 677.0];
    for (kind, m, printed) in [
        (Deviation::Allan, 1, 91.22945),
        (Deviation::Allan, 2, 85.95287),
        (Deviation::Hadamard, 1, 70.80607),
        (Deviation::Hadamard, 2, 85.61487),
    ] {
        let got = deviation(kind, &rates, m);
        assert!((got - printed).abs() <= 0.51e-5, "{kind:?} at {m}: {got} for {printed}");
    }
}

/// NIST SP 1065, table 32: 1000 values of the generator 16807·n mod (2³¹ − 1) from 1234567890, as parts of 2³¹ − 1.
#[test]
fn nbs14_thousand_points() {
    const MODULUS: u64 = (1 << 31) - 1;
    let states = std::iter::successors(Some(1_234_567_890_u64), |n| Some(16_807 * n % MODULUS));
    let rates: Vec<f64> = states.take(1000).map(|n| n as f64 / MODULUS as f64).collect();
    for (kind, m, printed) in [
        (Deviation::Allan, 1, "2.922319e-1"),
        (Deviation::Allan, 10, "9.159953e-2"),
        (Deviation::Allan, 100, "3.241343e-2"),
        (Deviation::Hadamard, 1, "2.943883e-1"),
        (Deviation::Hadamard, 10, "9.581083e-2"),
        (Deviation::Hadamard, 100, "3.237638e-2"),
    ] {
        assert_eq!(format!("{:.6e}", deviation(kind, &rates, m)), printed, "{kind:?} at {m}");
    }
}

fn budget_of(csv: &str, setup: &Setup, taus: Taus, exact: bool) -> AxisBudget {
    let log = reader(csv.as_bytes().to_vec(), setup);
    noise_budget(vec![log], None, setup, &Request { exact, ..Request::new(taus) }).unwrap().axes.remove(0)
}

fn points(budget: &AxisBudget) -> Vec<(f64, f64)> {
    budget.curve.iter().map(|point| (point.tau_s, point.adev_dph)).collect()
}

/// The same record as counts and as rates, and with a gap: by hand, over the differences that do not span it.
#[test]
fn counts_rates_and_gaps() {
    let counts: Vec<i64> = (0..600).map(|k| 40 + (k * 7919) % 23).collect();
    let gap = |k: usize| (300..310).contains(&k);
    let mut count_log = String::from("time_s,counts\n");
    let mut rate_log = String::from("time_s,rate_dph\n");
    for (k, count) in counts.iter().enumerate().filter(|(k, _)| !gap(*k)) {
        count_log += &format!("{},{count}\n", k + 1);
        rate_log += &format!("{},{}\n", k + 1, *count as f64 * 1.5);
    }
    let with_scale = Setup { arcsec_per_count: Some(1.5), ..Setup::default() };
    let taus = Taus::Given(vec![1.0, 2.0, 7.0]);
    let of_counts = budget_of(&count_log, &with_scale, taus.clone(), false);
    let of_rates = budget_of(&rate_log, &Setup::default(), taus, true);
    assert_eq!((of_counts.rows, of_counts.stretches), (590, 2));
    for ((tau, from_counts), (_, from_rates)) in points(&of_counts).into_iter().zip(points(&of_rates)) {
        let m = tau as usize;
        let (mut squares, mut number) = (0.0, 0.0);
        for k in 0..counts.len() + 1 - 2 * m {
            let sum = |from: usize| (from..from + m).map(|k| counts[k] as f64).sum::<f64>();
            if !(k..k + 2 * m).any(gap) {
                squares += (1.5 * (sum(k + m) - sum(k))).powi(2);
                number += 1.0;
            }
        }
        let wanted = f64::sqrt(squares / (2.0 * number)) / tau;
        assert!((from_counts / wanted - 1.0).abs() < 1e-12, "{tau}: {from_counts} for {wanted}");
        assert!((from_rates / wanted - 1.0).abs() < 1e-9, "{tau}: {from_rates} for {wanted}");
    }
}

/// A steady ramp: σ = R·τ/√2 for Allan, zero for Hadamard, and R is the only term found.
#[test]
fn a_ramp_is_a_ramp() {
    let mut log = String::from("time_s,rate_dph\n");
    (1..=4000).for_each(|k| log += &format!("{k},{}\n", 0.5 * f64::from(k) - 0.25));
    let budget = budget_of(&log, &Setup::default(), Taus::Octaves, false);
    for (tau, adev) in points(&budget) {
        assert!((adev / (0.5 * tau / 2.0_f64.sqrt()) - 1.0).abs() < 1e-9, "{tau}: {adev}");
    }
    let least = budget.hadamard.iter().map(|point| point.hdev_dph).fold(0.0, f64::max);
    assert!(least < 1e-8, "{least}");
    let TermValue::Found { value, .. } = budget.terms.r_dph_h else { panic!("{:?}", budget.terms) };
    assert!((value / 1800.0 - 1.0).abs() < 1e-6, "{value}");
}

/// The paper's rig heats up and cools down: its drift reads as rate random walk or ramp, with a warning; removed, the
/// rig's own walk remains.
#[test]
fn a_temperature_ramp_is_reported_and_removed() {
    let setup = paper_setup();
    let log = || reader(csv_bytes(PaperRig::PAPER.run(1)), &setup);
    let request = Request::new(Taus::Octaves);
    let raw = noise_budget(vec![log()], None, &setup, &request).unwrap();
    assert!(raw.warnings[0].contains("the temperature moved by 17.9 °C") && !raw.detrended, "{:?}", raw.warnings);
    let long = |budget: &AxisBudget| budget.curve.last().unwrap().adev_dph;
    let flat =
        noise_budget(vec![log()], Some(vec![log()].into()), &setup, &Request { detrend: true, ..request }).unwrap();
    assert!(flat.warnings.is_empty() && flat.detrended, "{:?}", flat.warnings);
    // White noise of N = 0.18 arcsec/√s at 4096 s is 0.0028 °/h.
    assert!(long(&raw.axes[0]) > 0.05 && long(&flat.axes[0]) < 0.004, "{} {}", long(&raw.axes[0]), long(&flat.axes[0]));
    let TermValue::Found { lower: Some(lower), upper: Some(upper), .. } = flat.axes[0].terms.n_deg_rt_h else {
        panic!()
    };
    assert!((lower..=upper).contains(&0.003), "{lower} … {upper}");
    assert!(matches!(flat.axes[0].terms.r_dph_h, TermValue::Unresolved { .. }));
}

/// The recording's README: slope −1 (dither and quantization), 208.7 °/h at 1/64 s, 13.24 at 0.25, 1.58 at 1,
/// 0.124 at 16, 0.040 at 64.
#[test]
fn ln100_falls_with_the_slope_of_quantization() {
    let Some(path) = shared("rlg-ln100-static/x_LN100_up.csv.gz") else { return };
    let setup = bench("rlg-ln100-static/bench.toml");
    let budget = |setup: &Setup, taus: Taus| {
        let log = sagnac_log::ingest::LogReader::open(&path, setup, sagnac_log::ingest::ReadMode::Bulk).unwrap();
        noise_budget(vec![log], None, setup, &Request::new(taus)).unwrap()
    };
    // The README's values assume evenly spaced rows; the stamps jitter by 1 %.
    let mut even = Setup { sample_interval_s: Some(0.015_608_7), ..setup.clone() };
    even.columns.insert("t_s".to_owned(), "ignore".to_owned());
    let taus = Taus::Given([1.0, 16.0, 64.0, 1024.0, 4096.0].map(|m| m * 0.015_608_7).to_vec());
    let curve = points(&budget(&even, taus).axes[0]);
    assert_eq!(curve.len(), 5);
    for ((_, adev), readme) in curve.iter().zip([208.7, 13.24, 1.58, 0.124, 0.0402]) {
        assert!((adev / readme - 1.0).abs() < 0.001, "{adev} for {readme}");
    }
    let octaves = budget(&setup, Taus::Octaves);
    let curve = points(&octaves.axes[0]);
    let logs: Vec<(f64, f64)> = curve.iter().map(|(tau, adev)| (tau.ln(), adev.ln())).collect();
    let mean = |f: fn(&(f64, f64)) -> f64| logs.iter().map(f).sum::<f64>() / logs.len() as f64;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let slope =
        logs.iter().map(|p| (p.0 - x) * (p.1 - y)).sum::<f64>() / logs.iter().map(|p| (p.0 - x).powi(2)).sum::<f64>();
    assert!((slope + 1.0).abs() < 0.05, "{slope}");
    // Five minutes of dithered counting resolve quantization and nothing else. The aliases of the three dithers have names of their own:
    // each axis shows that of the strongest, 29.94 Hz. They make σ(τ)·τ/√3 swing between 0.6 and 2 arcsec; the count beneath is 0.71.
    let terms = &octaves.axes[0].terms;
    let strongest = octaves.axes[0].periods.iter().max_by(|a, b| a.amplitude_dph.total_cmp(&b.amplitude_dph)).unwrap();
    assert!((strongest.frequency_hz - 29.94).abs() < 0.05, "{strongest:?}");
    assert!(matches!(terms.q_arcsec, TermValue::Found { value, .. } if (0.6..0.9).contains(&value)), "{terms:?}");
    assert!(
        matches!(terms.b_dph, TermValue::Unresolved { .. }) && matches!(terms.k_dph_rt_h, TermValue::Unresolved { .. })
    );
    let is_named = |warning: &String| warning.contains("29.9 Hz");
    assert!(octaves.warnings.iter().any(is_named), "the alias is said to be there: {:?}", octaves.warnings);
}

/// Multiple m, Allan deviation, Hadamard deviation.
type AtMultiples = [(usize, f64, f64); 6];

/// What allantools 2024.06 (numpy 2.4.6, Python 3.11) makes of the recording's counts of 0.1 arcsec, by
///
/// ```python
/// phase = numpy.concatenate([[0], numpy.cumsum(counts * 0.1)])                 # arcsec; 1 arcsec/s is 1 °/h
/// allantools.oadev(phase, rate=100, data_type="phase", taus=[0.01, 0.1, 1, 10, 100, 300])      # and ohdev
/// ```
///
/// axis: (m, Allan, Hadamard), °/h.
const PSINS: [(char, AtMultiples); 3] = [
    (
        'x',
        [
            (1, 53.112_161_542_240, 57.328_648_105_625),
            (10, 55.613_904_094_889, 48.261_248_769_663),
            (100, 17.352_969_950_227, 17.206_651_130_933),
            (1000, 8.420_291_462_833, 7.768_243_452_125),
            (10_000, 2.074_846_394_456, 2.051_276_629_240),
            (30_000, 0.865_068_179_047, 0.857_306_881_077),
        ],
    ),
    (
        'y',
        [
            (1, 56.811_651_857_394, 56.789_683_240_844),
            (10, 104.568_388_417_541, 82.040_521_418_297),
            (100, 60.656_479_319_263, 60.806_298_792_026),
            (1000, 14.691_978_514_290, 14.882_127_308_992),
            (10_000, 2.661_118_787_642, 2.667_734_363_841),
            (30_000, 0.891_840_738_632, 0.899_524_340_536),
        ],
    ),
    (
        'z',
        [
            (1, 34.171_697_669_018, 34.102_535_147_468),
            (10, 55.379_241_426_227, 48.752_042_778_044),
            (100, 8.706_210_606_353, 8.921_633_530_654),
            (1000, 1.494_484_873_047, 1.520_286_614_872),
            (10_000, 0.250_515_292_301, 0.254_329_506_325),
            (30_000, 0.077_459_048_551, 0.077_407_462_381),
        ],
    ),
];

/// Real counts of a standing vehicle against allantools, row by row; and the same through the reader, where the rows that are far
/// from those around them are replaced. Its README: base motion and quantization, so that an angle random walk read here is
/// wrong; two of three axes had one once, 0.314 (0.256 … 0.388) and 0.699 (0.550 … 0.921) °/√h. Nothing is resolved, and each
/// bound lies below what the whole curve would be.
#[test]
fn a_standing_vehicle_has_deviations_and_no_random_walk() {
    let Some(path) = shared("rlg-psins-static/rlg.csv.gz") else { return };
    let mut text = String::new();
    let file = std::fs::File::open(&path).unwrap();
    std::io::Read::read_to_string(&mut flate2::read::GzDecoder::new(file), &mut text).unwrap();
    let column = |at: usize| -> Vec<f64> {
        let cells = text.lines().skip(1).map(|row| row.split(',').nth(at).unwrap());
        cells.map(|cell| 10.0 * cell.parse::<f64>().unwrap()).collect()
    };
    let setup = Setup { arcsec_per_count: Some(0.1), ..Setup::default() };
    let log = sagnac_log::ingest::LogReader::open(&path, &setup, sagnac_log::ingest::ReadMode::Bulk).unwrap();
    let taus = Taus::Given(PSINS[0].1.map(|(m, ..)| m as f64 * 0.01).to_vec());
    let read = noise_budget(vec![log], None, &setup, &Request { exact: true, ..Request::new(taus) }).unwrap();
    for (at, ((letter, wanted), budget)) in PSINS.iter().zip(&read.axes).enumerate() {
        let rates = column(at + 1);
        assert_eq!(rates.len(), 184_718);
        for (m, adev, hdev) in wanted {
            for (kind, wanted) in [(Deviation::Allan, adev), (Deviation::Hadamard, hdev)] {
                let got = deviation(kind, &rates, *m);
                assert!((got / wanted - 1.0).abs() < 1e-9, "{letter} {kind:?} {m}: {got} for {wanted}");
            }
        }
        let disturbed = budget.disturbed.as_ref().unwrap();
        assert!(disturbed.excluded && disturbed.fraction < 0.0006, "{letter}: {disturbed:?}");
        assert_eq!((budget.axis, budget.rows + disturbed.rows, budget.stretches), (*letter, 184_718, 1));
        assert_eq!(budget.curve.len(), wanted.len());
        for (point, (m, adev, _)) in budget.curve.iter().zip(wanted) {
            // Rows excluded from a motion that returns leave an angle behind: measured 2 % up to 10 s, 17 % at 300 s (z).
            let most = if *m <= 1000 { 0.03 } else { 0.2 };
            assert!((point.adev_dph / adev - 1.0).abs() < most, "{letter} {m}: {} for {adev}", point.adev_dph);
        }
        for term in sagnac_noise::AllanTerm::ALL {
            let TermValue::Unresolved { unresolved } = budget.terms.get(term) else {
                panic!("{letter} {term:?}: {:?}", budget.terms.get(term))
            };
            // A filter hides any walk or quantization, and motion is no proof that there is none: nothing bounds these two.
            let is_fast =
                matches!(term, sagnac_noise::AllanTerm::Quantization | sagnac_noise::AllanTerm::AngleRandomWalk);
            let Some((_, bound)) = unresolved.split_once("at most ").filter(|_| !is_fast) else {
                assert!(is_fast && !unresolved.contains("at most"), "{letter} {term:?}: {unresolved}");
                continue;
            };
            let bound: f64 = bound.split(' ').next().unwrap().parse().unwrap();
            // No bound is far above the curve: alone, the term would touch it somewhere.
            let root = bound / term.in_its_unit(1.0);
            let alone = |tau_s: f64| root * term.variance(tau_s).sqrt();
            let nearest = budget.curve.iter().map(|p| alone(p.tau_s) / p.adev_dph).fold(0.0, f64::max);
            assert!((0.1..3.0).contains(&nearest), "{letter} {term:?}: {bound}, {nearest}");
        }
        assert!(budget.misfit.unwrap() > 0.2, "{letter}: {:?}", budget.misfit);
    }
    assert_eq!(read.warnings.iter().filter(|warning| warning.contains("scatters about the five terms")).count(), 3);
}

/// °/h of one rad/s.
const DPH_PER_RADPS: f64 = 206_264.806_247_096_36;

fn published(unit: &str, axis: char, name: &str) -> Option<f64> {
    let text = std::fs::read_to_string(shared(&format!("allan-curves/{unit}_imu_param.yaml"))?).unwrap();
    let of_axis = text.split(&format!("{axis}-axis:")).nth(1).unwrap();
    let cell = of_axis.split(&format!("{name}:")).nth(1).unwrap().lines().next().unwrap();
    Some(cell.trim().parse::<f64>().unwrap() * DPH_PER_RADPS)
}

fn curve(unit: &str, axis: char) -> Option<BareCurve> {
    let read = |name: String| std::fs::read_to_string(shared(&name)?).ok();
    let taus = read(format!("allan-curves/data_{unit}_gyr_t.txt"))?;
    let values = read(format!("allan-curves/data_{unit}_gyr_{axis}.txt"))?;
    let mut csv = String::from("tau_s,adev_dph\n");
    taus.lines().zip(values.lines()).for_each(|(tau, value)| csv += &format!("{},{}\n", tau.trim(), value.trim()));
    Some(parse_curve(csv.as_bytes()).unwrap().remove(0))
}

/// N at 1 s and the floor 0.664·B against the published `gyr_n` and `gyr_w` of their authors' own fit (which are the
/// deviation at 1 s and the least one of their curve).
fn ratios(unit: &str, axis: char) -> Option<(f64, f64)> {
    let input = LogFile { file: unit.to_owned(), sha256: String::new(), rows: 0, rows_sketch: String::new() };
    let budget = budget_of_curves(&[curve(unit, axis)?], None, input).unwrap().axes.remove(0);
    let fitted = budget.fitted.unwrap();
    let least = budget.curve.iter().map(|p| fitted.variance(p.tau_s).sqrt()).fold(f64::INFINITY, f64::min);
    Some((fitted.variance(1.0).sqrt() / published(unit, axis, "gyr_n")?, least / published(unit, axis, "gyr_w")?))
}

/// Two hours of each unit. Measured: N within 6.9 % and the floor within 21 % for three of four units.
///
/// The trap: the published `gyr_n` of the BMI160 is 14 times its own curve at 1 s (1.427e-3 rad/s for 1.02e-4), scaled by
/// the square root of its 200 Hz; its `gyr_w` agrees.
#[test]
fn published_parameters_agree_but_for_the_bmi160_trap() {
    for unit in ["16448", "A3", "N3", "BMI160"] {
        for axis in ['x', 'y', 'z'] {
            let Some((n, floor)) = ratios(unit, axis) else { return };
            println!("{unit} {axis}: N {n}, floor {floor}");
            let n = if unit == "BMI160" { n * 200.0_f64.sqrt() } else { n };
            assert!((n - 1.0).abs() < 0.08, "{unit} {axis}: N {n}");
            assert!((floor - 1.0).abs() < 0.22, "{unit} {axis}: floor {floor}");
        }
    }
}

/// Rates of white noise with a random walk, flicker (a sum of exponential correlations) or steps of counting next to it; `period_dph` is the
/// amplitude of a sine of 40 s.
fn noisy(seed: u64, kind: u64, period_dph: f64) -> Vec<f64> {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut uniform = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut normal = move || (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
    let (mut walk, mut total, mut flicker) = (0.0, 0.0, [0.0; 4]);
    (0..8192)
        .map(|i| {
            walk += if kind == 1 { 0.004 * normal() } else { 0.0 };
            for (level, tau) in flicker.iter_mut().zip([8.0_f64, 64.0, 512.0, 4096.0]) {
                let keep = (-1.0 / tau).exp();
                *level = keep * *level + if kind == 2 { 0.1 * (1.0 - keep * keep).sqrt() * normal() } else { 0.0 };
            }
            let sine = period_dph * (std::f64::consts::TAU * f64::from(i) / 40.0).sin();
            let rate = normal() + walk + flicker.iter().sum::<f64>() + sine;
            // Counts of a whole angle, the rest carried on.
            let before = f64::floor(total);
            total += rate;
            if kind == 3 { f64::floor(total) - before } else { rate }
        })
        .collect()
}

/// Differences that do not overlap, as other programs make their curves.
fn not_overlapping(rates: &[f64]) -> String {
    let mut csv = String::from("tau_s,adev_dph\n");
    let mut m = 1;
    while m <= rates.len() / 8 {
        let means: Vec<f64> = rates.chunks_exact(m).map(|chunk| chunk.iter().sum::<f64>() / m as f64).collect();
        let square: f64 = means.windows(2).map(|pair| (pair[1] - pair[0]).powi(2)).sum();
        csv += &format!("{m},{}\n", (square / (2.0 * (means.len() - 1) as f64)).sqrt());
        m = (m * 5).div_ceil(4).max(m + 1);
    }
    csv
}

/// The scatter of a curve is said where it is there, and rarely where it is not: of records of the five terms and of curves of other
/// programs less than 5 %. A period has a name instead, nearly always.
#[test]
fn the_scatter_of_a_curve_is_a_rare_warning() {
    use rayon::prelude::*;

    const RECORDS: u64 = 100;
    let input = || LogFile { file: "curve".to_owned(), sha256: String::new(), rows: 0, rows_sketch: String::new() };
    let is_said = |warnings: &[String]| warnings.iter().any(|warning| warning.contains("scatters about"));
    let is_named = |warnings: &[String]| warnings.iter().any(|warning| warning.contains("a period of 40.0 s"));
    let warnings_of = |rates: &[f64]| {
        let rows = rates.iter().enumerate().map(|(i, rate)| format!("{},{rate}\n", i + 1));
        let log = reader(format!("time_s,rate_dph\n{}", rows.collect::<String>()).into_bytes(), &Setup::default());
        let request = Request::new(Taus::LogSpaced);
        noise_budget(vec![log], None, &Setup::default(), &request).unwrap().warnings
    };
    let of_curve = |rates: &[f64]| {
        let curve = parse_curve(not_overlapping(rates).as_bytes()).unwrap();
        is_said(&budget_of_curves(&curve, Some(rates.len() as f64), input()).unwrap().warnings)
    };
    let count =
        |is_said: &(dyn Fn(u64) -> bool + Sync), of: u64| (0..of).into_par_iter().filter(|seed| is_said(*seed)).count();
    let logs = count(&|seed| is_said(&warnings_of(&noisy(seed + 1, seed % 4, 0.0))), RECORDS);
    let curves = count(&|seed| of_curve(&noisy(seed + 1, seed % 4, 0.0)), RECORDS);
    let periods = count(&|seed| is_named(&warnings_of(&noisy(seed + 1, seed % 4, 1.0))), RECORDS / 2);
    println!("of {RECORDS}: {logs} logs, {curves} curves; of {}: {periods} with a period", RECORDS / 2);
    assert!(logs + curves < 2 * RECORDS as usize / 20, "{logs} logs, {curves} curves");
    assert!(periods as f64 > 0.95 * (RECORDS / 2) as f64, "{periods}");
}

/// Of the published curves of two hours one is warned of. (The BMI160's goes on to a τ that two hours do not have.)
#[test]
fn published_curves_are_not_warned_of_one_and_all() {
    let input = || LogFile { file: "curve".to_owned(), sha256: String::new(), rows: 0, rows_sketch: String::new() };
    let mut said = Vec::new();
    for unit in ["16448", "A3", "N3"] {
        for axis in ['x', 'y', 'z'] {
            let Some(curve) = curve(unit, axis) else { return };
            let budget = budget_of_curves(&[curve], Some(7200.0), input()).unwrap();
            if budget.warnings.iter().any(|warning| warning.contains("scatters about")) {
                said.push(format!("{unit} {axis}"));
            }
        }
    }
    assert_eq!(said, ["A3 x"]);
}
