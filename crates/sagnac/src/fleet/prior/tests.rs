//! Against fleets of known truth, drawn here: by hundreds, never by one.

use super::*;
use crate::fleet::UnitOutcome;
use crate::fleet::draws::Draws;
use crate::fleet::result::AxisResult;

/// L·z of three normal values.
fn with(draws: &mut Draws, factor: &[[f64; 3]; 3]) -> [f64; 3] {
    let z = [draws.normal(), draws.normal(), draws.normal()];
    factor.map(|row| row.iter().zip(z).map(|(l, z)| l * z).sum())
}

const MEAN: [f64; 3] = [0.3, -0.1, 0.05];
/// Factors of Σ and of V: both with correlations, of terms of different sizes.
const OF_UNITS: [[f64; 3]; 3] = [[0.2, 0.0, 0.0], [0.05, 0.08, 0.0], [-0.02, 0.03, 0.04]];
const OF_TESTS: [[f64; 3]; 3] = [[0.05, 0.0, 0.0], [-0.02, 0.04, 0.0], [0.01, 0.01, 0.02]];

fn product(factor: &[[f64; 3]; 3]) -> Vec<f64> {
    let entry = |i: usize, j: usize| (0..3).map(|k| factor[i][k] * factor[j][k]).sum::<f64>();
    (0..3).flat_map(|i| (0..=i).map(move |j| entry(i, j))).collect()
}

fn unit(name: usize, lot: &str, beta: [f64; 3], covariance: Vec<f64>) -> UnitResult {
    let terms = ["bias 1", "bias 2", "rate 0"].map(str::to_owned).to_vec();
    let units = ["deg/h", "deg/h", "deg/h per degC/min"].map(str::to_owned).to_vec();
    let axis = AxisResult {
        axis: "x".to_owned(),
        model: "bias 2, rate 0".to_owned(),
        span_c: [-40.0, 70.0],
        common: Some(CommonBasis { terms, units, coefficients: beta.to_vec(), covariance }),
        ..AxisResult::default()
    };
    UnitResult {
        unit: format!("RLG-{name}"),
        lot: lot.to_owned(),
        outcome: UnitOutcome::Calibrated,
        axes: vec![axis],
        ..UnitResult::default()
    }
}

/// A fleet: units about the mean of their lot, each tested with an uncertainty of its own.
fn fleet(draws: &mut Draws, units: usize, lots: &[f64]) -> Vec<UnitResult> {
    let of_one = |at: usize, draws: &mut Draws| {
        let lot = at % lots.len();
        let size = 0.5 + draws.uniform();
        let (own, error) = (with(draws, &OF_UNITS), with(draws, &OF_TESTS));
        let beta = std::array::from_fn(|k| MEAN[k] + lots[lot] + own[k] + size * error[k]);
        unit(at, &format!("lot {lot}"), beta, product(&OF_TESTS).iter().map(|v| v * size * size).collect())
    };
    (0..units).map(|at| of_one(at, draws)).collect()
}

/// Mean and its standard error of each entry over many priors.
fn over(priors: &[Vec<f64>]) -> Vec<[f64; 2]> {
    let n = priors.len() as f64;
    let of = |at: usize| {
        let mean = priors.iter().map(|prior| prior[at]).sum::<f64>() / n;
        let square = priors.iter().map(|prior| (prior[at] - mean).powi(2)).sum::<f64>() / (n - 1.0);
        [mean, (square / n).sqrt()]
    };
    (0..priors[0].len()).map(of).collect()
}

/// 400 fleets of 60: μ̂ and Σ̂ are those of the units, without what their tests add; S is not.
#[test]
fn mean_and_scatter_are_the_units_own() {
    let mut draws = Draws(1);
    let priors: Vec<Prior> = (0..400).map(|_| Prior::learned(&fleet(&mut draws, 60, &[0.0]), None).unwrap()).collect();
    let of = |values: fn(&Population) -> Vec<f64>| over(&priors.iter().map(|p| values(&p.fleet)).collect::<Vec<_>>());
    for (got, wanted) in of(|fleet| fleet.mean.clone()).iter().zip(MEAN) {
        assert!((got[0] - wanted).abs() < 4.0 * got[1], "{got:?} for {wanted}");
    }
    let truth = product(&OF_UNITS);
    for ([got, error], wanted) in of(|fleet| fleet.covariance.clone()).iter().zip(&truth) {
        // Measured: the positive part and the bound on outliers move an entry by less than 2 % of the largest next to it.
        assert!((got - wanted).abs() < 4.0 * error + 0.0006, "{got} ± {error} for {wanted}");
    }
    let with_tests: f64 = truth[0] + product(&OF_TESTS)[0] * (1.0 + 1.0 / 12.0);
    assert!((with_tests / truth[0] - 1.0) > 0.05, "the tests add something that can be seen");
    assert!(priors.iter().all(|prior| prior.fleet.directions == 3 && prior.within_lots.is_none()));
}

/// Coverage of the next unit: its true curve and rate effect lie within the 95 % interval of the fleet at every temperature, as often as
/// they should. Together they are within the ellipsoid less often, because the least of sixty units' scatters is too small.
#[test]
fn the_next_unit_is_where_the_prior_says() {
    let mut draws = Draws(2);
    let temperatures = [-40.0, -10.0, 5.0, 40.0, 70.0];
    let (mut within, mut in_ellipsoid) = ([0; 6], 0);
    for _ in 0..2000 {
        let prior = Prior::learned(&fleet(&mut draws, 60, &[0.0]), None).unwrap();
        let own = with(&mut draws, &OF_UNITS);
        let away = DVector::from_iterator(3, (0..3).map(|k| MEAN[k] + own[k] - prior.fleet.mean[k]));
        let sigma = symmetric(&prior.fleet.covariance, 3);
        // Student's t of 59 degrees: 2.001.
        let next = symmetric(&prior.fleet.about_mean_of(prior.fleet.axes), 3);
        let curve = temperatures.map(|t: f64| {
            let x = (t - 20.0) / 60.0;
            DVector::from_column_slice(&[x, 2.0 * x * x, 0.0])
        });
        let rate = DVector::from_column_slice(&[0.0, 0.0, 1.0]);
        for (count, weight) in within.iter_mut().zip(curve.iter().chain([&rate])) {
            *count += u32::from(weight.dot(&away).abs() < 2.001 * weight.dot(&(&next * weight)).sqrt());
        }
        // χ² of three degrees, 95 %: 7.815.
        in_ellipsoid += u32::from(away.dot(&(sigma.try_inverse().unwrap() * &away)) < 7.815);
    }
    for count in within {
        let part = f64::from(count) / 2000.0;
        assert!((0.93..0.97).contains(&part), "{within:?}");
    }
    let part = f64::from(in_ellipsoid) / 2000.0;
    assert!((0.83..0.91).contains(&part), "{part}");
}

/// Tests alone scatter the results: of units that are all equal the prior says so.
#[test]
fn equal_units_have_no_scatter() {
    let mut draws = Draws(3);
    let mut sigmas = Vec::new();
    for _ in 0..100 {
        let units: Vec<UnitResult> = (0..60)
            .map(|at| {
                let error = with(&mut draws, &OF_TESTS);
                unit(at, "", std::array::from_fn(|k| MEAN[k] + error[k]), product(&OF_TESTS))
            })
            .collect();
        let prior = Prior::learned(&units, None).unwrap();
        sigmas.push(prior.fleet.sigma(0) / prior.fleet.sigma_of_tests(0));
    }
    sigmas.sort_by(f64::total_cmp);
    // A plain difference of variances would be negative in a half of the fleets.
    assert!(sigmas.iter().all(|ratio| *ratio >= 0.0) && sigmas[50] < 0.45, "median {}", sigmas[50]);
}

/// Outliers are excluded by name and change nothing; units of the fleet are not.
#[test]
fn odd_units_are_named_and_do_not_count() {
    let mut draws = Draws(4);
    let (mut caught, mut wrong, mut units_in_all) = (0, 0, 0);
    let mut ratios = Vec::new();
    for _ in 0..200 {
        let mut units = fleet(&mut draws, 60, &[0.0, 0.4, -0.3]);
        let clean = Prior::learned(&units, None).unwrap();
        for (at, by) in [(7, 3.0), (31, -2.5), (50, 2.0)] {
            if let Some(common) = &mut units[at].axes[0].common {
                common.coefficients[at % 3] += by;
            }
        }
        let prior = Prior::learned(&units, None).unwrap();
        let named: Vec<&str> = prior.not_used.iter().map(|part| part.axis.as_str()).collect();
        caught += ["RLG-7 x", "RLG-31 x", "RLG-50 x"].iter().filter(|name| named.contains(name)).count();
        wrong += named.len() - 3;
        units_in_all += 57;
        ratios.push(prior.within_lots.unwrap().sigma(0) / clean.within_lots.unwrap().sigma(0));
    }
    assert_eq!(caught, 600);
    assert!(wrong * 1000 < units_in_all, "{wrong} of {units_in_all} good units excluded");
    ratios.sort_by(f64::total_cmp);
    assert!(ratios[10] > 0.9 && ratios[189] < 1.1, "{} … {}", ratios[10], ratios[189]);
}

/// Within lots the scatter is that of the units; over all of them that of the lots as well.
#[test]
fn lots_have_their_own_means() {
    let mut draws = Draws(5);
    let offsets = [0.0, 0.6, -0.6];
    let priors: Vec<Prior> =
        (0..200).map(|_| Prior::learned(&fleet(&mut draws, 90, &offsets), None).unwrap()).collect();
    let within = over(&priors.iter().map(|p| p.within_lots.clone().unwrap().covariance).collect::<Vec<_>>());
    for ([got, error], wanted) in within.iter().zip(product(&OF_UNITS)) {
        assert!((got - wanted).abs() < 4.0 * error + 0.0006, "{got} ± {error} for {wanted}");
    }
    // Variance of the offsets over ninety axes: 90/89 · 0.24.
    let all = over(&priors.iter().map(|p| p.fleet.covariance.clone()).collect::<Vec<_>>());
    assert!((all[0][0] - product(&OF_UNITS)[0] - 0.2427).abs() < 0.005, "{:?}", all[0]);
    for (lot, offset) in priors[0].lots.iter().zip(offsets) {
        assert!(lot.axes == 30 && (lot.mean[0] - MEAN[0] - offset).abs() < 0.2, "{lot:?}");
    }
}

/// The same bytes, in whatever order units come and in whatever parts they are merged.
#[test]
fn parts_merge_to_the_bytes_of_the_whole() {
    let mut draws = Draws(6);
    for _ in 0..20 {
        let units = fleet(&mut draws, 120, &[0.0, 0.2]);
        let whole = Prior::learned(&units, None).unwrap().to_json().unwrap();
        let mut other = units.clone();
        for at in (1..other.len()).rev() {
            other.swap(at, (draws.uniform() * (at + 1) as f64) as usize);
        }
        assert_eq!(Prior::learned(&other, None).unwrap().to_json().unwrap(), whole);
        let of = |units: &[UnitResult]| Prior::learned(units, None).unwrap();
        let [a, b, c] = [&other[..40], &other[40..70], &other[70..]].map(of);
        // The median of a part may name a unit that the whole does not: the same sums only where none is odd.
        let one = a.clone().merged(b.clone()).unwrap().merged(c.clone()).unwrap();
        let two = c.merged(a.merged(b).unwrap()).unwrap();
        assert_eq!(one.to_json().unwrap(), two.to_json().unwrap());
        if one.not_used.is_empty() && !whole.contains("odd") {
            assert_eq!(one.to_json().unwrap(), whole);
        }
        assert_eq!(Prior::from_json(&whole).unwrap().to_json().unwrap(), whole);
    }
}

/// What cannot tell a scatter is refused, with what is missing.
#[test]
fn too_little_is_refused() {
    let mut draws = Draws(7);
    let units = fleet(&mut draws, 20, &[0.0]);
    let why = |units: &[UnitResult], model: Option<&str>| Prior::learned(units, model).unwrap_err();
    assert!(why(&units, None).what.contains("20 axes of `bias 2, rate 0` are too few"), "{}", why(&units, None));
    assert!(why(&units, Some("bias 5")).what.contains("0 axes of `bias 5`"));
    assert!(why(&[], None).what.contains("no unit of this fleet"));
    let mut others = fleet(&mut draws, 40, &[0.0]);
    others[..20].iter_mut().for_each(|unit| unit.axes[0].span_c = [10.0, 30.0]);
    others[..15].iter_mut().for_each(|unit| unit.axes[0].model = "bias 9".to_owned());
    let help = why(&others, None).help;
    assert!(help.contains("15 not used: another model") && help.contains("5 not used: its test spans fewer"), "{help}");
}

/// `gyros` gyros, each tested `tests` times under as many names.
fn few_under_many_names(draws: &mut Draws, gyros: usize, tests: usize) -> Vec<UnitResult> {
    let own: Vec<[f64; 3]> = (0..gyros).map(|_| with(draws, &OF_UNITS)).collect();
    let of_one = |at: usize| {
        let error = with(draws, &OF_TESTS);
        let beta = std::array::from_fn(|k| MEAN[k] + own[at % gyros][k] + 0.3 * error[k]);
        unit(at, "", beta, product(&OF_TESTS).iter().map(|v| v * 0.09).collect())
    };
    (0..gyros * tests).map(of_one).collect()
}

/// Few gyros under many names are refused, and gyros that are all distinct are not: normal ones, ones with heavy tails, ones that scatter
/// less than their tests, ones of lots near each other that the manifest does not tell, ones that differ in one direction.
#[test]
fn one_gyro_has_one_name() {
    let mut draws = Draws(8);
    let is_refused = |units: &[UnitResult]| match Prior::learned(units, None) {
        Ok(_) => false,
        Err(e) => e.what.contains("form groups") && e.help.contains("each gyro one name"),
    };
    for (gyros, tests, least) in [(2, 15, 90), (4, 8, 90), (6, 6, 85), (10, 4, 80)] {
        let refused = (0..100).filter(|_| is_refused(&few_under_many_names(&mut draws, gyros, tests))).count();
        assert!(refused >= least, "{gyros} gyros, {tests} tests each: {refused} of 100 refused");
    }
    let mut wrong = [0; 5];
    for _ in 0..200 {
        let heavy = |draws: &mut Draws| {
            let chi: f64 = (0..3).map(|_| draws.normal().powi(2)).sum();
            let size = (3.0 / chi).sqrt();
            let (own, error) = (with(draws, &OF_UNITS), with(draws, &OF_TESTS));
            std::array::from_fn(|k| MEAN[k] + size * own[k] + 0.3 * error[k])
        };
        let alike = |draws: &mut Draws| {
            let (own, error) = (with(draws, &OF_UNITS), with(draws, &OF_TESTS));
            std::array::from_fn(|k| MEAN[k] + 0.1 * own[k] + error[k])
        };
        let small = product(&OF_TESTS).iter().map(|v| v * 0.09).collect::<Vec<_>>();
        let tails: Vec<UnitResult> = (0..40).map(|at| unit(at, "", heavy(&mut draws), small.clone())).collect();
        let equal: Vec<UnitResult> = (0..40).map(|at| unit(at, "", alike(&mut draws), product(&OF_TESTS))).collect();
        let mut untold = fleet(&mut draws, 40, &[0.0, 0.1, -0.1]);
        untold.iter_mut().for_each(|unit| unit.lot.clear());
        // In one direction alone, about 30 times the uncertainty of the tests.
        let line: Vec<UnitResult> = (0..40)
            .map(|at| {
                let (along, error) = (draws.normal(), with(&mut draws, &OF_TESTS));
                let beta = std::array::from_fn(|k| MEAN[k] + 0.3 * error[k] + if k == 0 { 0.4 * along } else { 0.0 });
                unit(at, "", beta, small.clone())
            })
            .collect();
        let distinct = few_under_many_names(&mut draws, 40, 1);
        for (count, units) in wrong.iter_mut().zip([distinct, tails, equal, untold, line]) {
            *count += usize::from(is_refused(&units));
        }
    }
    assert!(wrong.iter().all(|count| *count <= 4), "of 200 each: {wrong:?}");
}

/// A record that was made with a prior says of the unit what its fleet said already.
#[test]
fn what_a_prior_made_makes_no_prior() {
    let mut draws = Draws(9);
    let mut units = fleet(&mut draws, 60, &[0.0]);
    let without = Prior::learned(&units[..40], None).unwrap();
    units[40..].iter_mut().for_each(|unit| unit.axes[0].with_prior = true);
    let prior = Prior::learned(&units, None).unwrap();
    assert_eq!((&prior.sums, prior.fleet.axes), (&without.sums, 40));
    assert_eq!(prior.not_used, [counted("its record was made with a prior", 20)]);
}

/// Where some tests resolve the lag and others do not, either part would be a selection by it: all take part, without it.
#[test]
fn no_part_is_selected_by_its_lag() {
    let mut draws = Draws(10);
    let mut units = fleet(&mut draws, 100, &[0.0]);
    let without = Prior::learned(&units, None).unwrap();
    let add_lag = |unit: &mut UnitResult| {
        unit.axes[0].lag_s = Some(300.0);
        let common = unit.axes[0].common.as_mut().unwrap();
        common.terms.push("lag_s".to_owned());
        common.units.push("s".to_owned());
        common.coefficients.push(300.0);
        common.covariance.extend([0.0, 0.0, 0.0, 400.0]);
    };
    units[..15].iter_mut().for_each(add_lag);
    assert_eq!(Prior::learned(&units, None).unwrap().fleet.axes, 85);
    units[15..60].iter_mut().for_each(add_lag);
    let mixed = Prior::learned(&units, None).unwrap();
    assert_eq!((mixed.fleet, mixed.terms, mixed.fixed_lag_s), (without.fleet, without.terms, Some(300.0)));
}

/// Lots of a few units each are as far from the median of all as lots are from each other: none of them is odd for that.
#[test]
fn small_lots_are_not_odd() {
    let mut draws = Draws(11);
    let (mut named, mut all) = (0, 0);
    for _ in 0..50 {
        let lots: Vec<f64> = (0..16).map(|_| draws.normal()).collect();
        let mut units = fleet(&mut draws, 128, &lots);
        // Four of each of twelve lots, ten of each of four.
        let mut counts = [0; 16];
        units.retain(|unit| {
            let lot: usize = unit.lot[4..].parse().unwrap();
            counts[lot] += 1;
            counts[lot] <= if lot < 12 { 4 } else { 10 }
        });
        let prior = Prior::learned(&units, None).unwrap();
        named += prior.not_used.len();
        all += units.len();
    }
    assert!(named * 100 < all, "{named} of {all} good units excluded");
}

/// A unit counts once, in whatever parts its fleet is given.
#[test]
fn a_fleet_counts_once() {
    let mut draws = Draws(12);
    let mut units = fleet(&mut draws, 90, &[0.0, 0.2]);
    for (at, unit) in units.iter_mut().enumerate() {
        unit.inputs_sha256 = vec![format!("{at:016x}{at:048x}"), format!("{:016x}{at:048x}", at + 1000)];
    }
    let of = |units: &[UnitResult]| Prior::learned(units, None).unwrap();
    let one = of(&units[..45]);
    assert!(one.clone().merged(of(&units[45..])).is_ok());
    for other in [&units[..45], &units[..44], &units[44..]] {
        let refusal = one.clone().merged(of(other)).unwrap_err();
        assert!(refusal.what.contains("logs are in both"), "{refusal}");
    }
}

/// A unit of a new lot: each lot counts once, however large it is, and no lot is odd because a large one is not like it.
#[test]
fn a_large_lot_does_not_decide_for_a_new_one() {
    let mut draws = Draws(14);
    let (mut within, mut named, mut all) = (0, 0, 0);
    for _ in 0..400 {
        let lots: Vec<f64> = (0..31).map(|_| 0.4 * draws.normal()).collect();
        let mut units = fleet(&mut draws, 31 * 60, &lots);
        let mut counts = [0; 31];
        units.retain(|unit| {
            let lot: usize = unit.lot[4..].parse().unwrap();
            counts[lot] += 1;
            counts[lot] <= if lot == 0 { 60 } else { 2 }
        });
        let prior = Prior::learned(&units, None).unwrap();
        named += prior.not_used.len();
        all += units.len();
        let next = PriorFile { prior, sha256: String::new() }.of_unit(None).unwrap();
        let own = MEAN[0] + 0.4 * draws.normal() + with(&mut draws, &OF_UNITS)[0];
        // Student's t of 30 degrees: 2.042.
        within += u32::from((own - next.mean[0]).abs() < 2.042 * next.covariance[0].sqrt());
    }
    let part = f64::from(within) / 400.0;
    assert!((0.93..=0.99).contains(&part), "{part}");
    assert!(named * 50 < all, "{named} of {all} good units excluded");
}

/// Numbers of a file that somebody changed: each is refused, whatever it is.
#[test]
fn a_changed_file_is_refused() {
    let mut draws = Draws(13);
    let text = Prior::learned(&fleet(&mut draws, 60, &[0.0, 0.2]), None).unwrap().to_json().unwrap();
    assert!(Prior::from_json(&text).is_ok());
    // Another layout is no change.
    let whole: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert!(Prior::from_json(&whole.to_string()).is_ok());
    let mut refused = 0;
    let changes: [fn(&mut serde_json::Value); 6] = [
        |v| v["terms"].as_array_mut().unwrap().swap(0, 1),
        |v| v["sums"]["lot 0"]["axes"] = 3000.into(),
        |v| v["sums"]["lot 0"]["product"][0] = v["sums"]["lot 0"]["product"][1].clone(),
        |v| v["model"] = "bias 1, rate 1".into(),
        |v| v["bias_instability_dph"] = 0.5.into(),
        |v| v["units"][0] = "ppm".into(),
    ];
    for change in changes {
        let mut changed = whole.clone();
        change(&mut changed);
        let error = Prior::from_json(&changed.to_string()).unwrap_err();
        refused += u32::from(error.what.contains("the file was edited"));
    }
    assert_eq!(refused, 6);
}

/// A lot that scatters more than the others has no narrow interval of theirs; lots that scatter alike do, heavy tails or not.
#[test]
fn a_wide_lot_needs_a_prior_of_its_own() {
    let mut draws = Draws(15);
    let mut of = |wide: f64, heavy: bool| {
        let one = |at: usize, draws: &mut Draws| {
            let lot = usize::from(at < 30);
            let chi: f64 = (0..5).map(|_| draws.normal().powi(2)).sum();
            let size = if heavy { (3.0 / chi).sqrt() } else { 1.0 } * if lot == 1 { wide } else { 1.0 };
            let (own, error) = (with(draws, &OF_UNITS), with(draws, &OF_TESTS));
            let beta = std::array::from_fn(|k| MEAN[k] + size * own[k] + 0.3 * error[k]);
            unit(at, &format!("lot {lot}"), beta, product(&OF_TESTS).iter().map(|v| v * 0.09).collect())
        };
        let units: Vec<UnitResult> = (0..130).map(|at| one(at, &mut draws)).collect();
        let prior = PriorFile { prior: Prior::learned(&units, None).unwrap(), sha256: String::new() };
        assert!(prior.of_unit(Some("lot 0")).is_ok());
        prior.of_unit(Some("lot 1")).is_err_and(|e| e.what.contains("scatter") && e.help.contains("alone"))
    };
    let mut refused = |wide: f64, heavy: bool| (0..100).filter(|_| of(wide, heavy)).count();
    let found = [refused(1.0, false), refused(1.0, true), refused(2.5, false), refused(2.5, true)];
    assert!(found[0] <= 2 && found[1] <= 2 && found[2] >= 95 && found[3] >= 80, "of 100: {found:?}");
}
