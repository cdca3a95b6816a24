//! The recording mems-chamber-sweep: a real thermal sweep with hysteresis and a start-up row.
//!
//! Reference: numpy.polyfit(T, axis, 3) on all rows, numpy 2.4.6, printed by
//! `testdata/mems-chamber-sweep/numpy_cubic.py` (the recording's README has the same to eight digits).

use crate::support;
use std::path::Path;

use crate::recordings::{bench, shared};
use crate::support::model;
use sagnac::calibration::{AxisCalibration, Calibration};
use sagnac::fit::{FitOptions, calibrate};
use sagnac::window::WindowBuilder;
use sagnac_log::ingest::{LogReader, ReadMode, Reason};
use sagnac_log::setup::Setup;
use sagnac_units::DPH_PER_RADPS;

fn fit(text: &str, keep_all: bool) -> Option<Calibration> {
    Some(try_fit(text, keep_all)?.unwrap())
}

fn try_fit(text: &str, keep_all: bool) -> Option<sagnac::Result<Calibration>> {
    let path = shared("mems-chamber-sweep/imu_raw_data.csv")?;
    let setup = bench("mems-chamber-sweep/bench.toml");
    let log = LogReader::open(&path, &setup, ReadMode::Bulk).unwrap();
    let windows = WindowBuilder::read_all(vec![log], &setup).unwrap();
    let windows = if keep_all { windows.keep_outliers() } else { windows }.finish();
    Some(calibrate(windows, &setup, &FitOptions::new(model(text))))
}

/// Held-out σ in the log's own unit, rad/s.
fn held_out(axis: &AxisCalibration) -> f64 {
    axis.cross_validation().unwrap().sigma_dph / DPH_PER_RADPS
}

#[test]
fn the_cubic_is_numpys() {
    let Some(calibration) = fit("bias 3", true) else {
        return;
    };
    // x, y, z: powers 3, 2, 1, 0; rad/s.
    let numpy = [
        [-6.547811871319e-08, 1.127144684294e-05, -2.905713924391e-04, -6.908658751316e-02],
        [-6.692696824870e-08, 1.225912748890e-05, 1.623419332849e-04, -1.496989454433e-02],
        [1.743340035572e-08, 2.066631306912e-07, -4.339730106444e-05, 1.634952711565e-02],
    ];
    for (axis, reference) in calibration.axes.iter().zip(numpy) {
        for (power, expected) in reference.iter().rev().enumerate() {
            let ours = axis.monomial.as_ref().unwrap().coefficients[power] / DPH_PER_RADPS;
            assert!((ours / expected - 1.0).abs() < 1e-6, "axis {} power {power}: {ours:e} {expected:e}", axis.axis);
        }
        assert!(axis.noise_floor().is_none(), "row windows have no floor");
    }
}

#[test]
fn auto_finds_the_rate_term_that_no_order_replaces() {
    let Some(auto) = fit("auto", false) else {
        return;
    };
    let cubic = fit("bias 3", false).unwrap();
    let x = &auto.axes[0];
    let residual = x.residual().unwrap().sigma_dph / DPH_PER_RADPS;
    println!(
        "x: {} residual {residual:.4e}, held out {:.4e} rad/s, lag {:?}",
        x.correction.model,
        held_out(x),
        x.lag_s()
    );
    assert!(residual <= 2.05e-3, "{residual:e}");
    assert!(held_out(x) <= 2.85e-3, "{:e}", held_out(x));
    for axis in 0..2 {
        assert!(held_out(&auto.axes[axis]) < held_out(&cubic.axes[axis]), "axis {axis}");
    }
    for order in 1..=8 {
        let alone = fit(&format!("bias {order}"), false).unwrap();
        assert!(alone.axes[0].residual().unwrap().sigma_dph / DPH_PER_RADPS > 4.0e-3, "order {order}");
    }
}

#[test]
fn the_start_up_row_is_flagged() {
    let Some(calibration) = fit("bias 3", false) else {
        return;
    };
    let excluded = &calibration.axes[0].excluded();
    assert_eq!(excluded.len(), 1, "{excluded:?}");
    assert_eq!((excluded[0].reason, excluded[0].rows), (Reason::StartUp, 1));
    assert!(excluded[0].first.ends_with("imu_raw_data.csv:2"), "{}", excluded[0].first);
}

/// Two lags on axis x, about 7 s and 400 s: held out, 0.38 of the cubic's error. On the other axes the data do not separate them.
#[test]
fn a_second_lag_explains_more_of_axis_x() {
    let Some(path) = shared("mems-chamber-sweep/imu_raw_data.csv") else {
        return;
    };
    let x_alone = |text: &str| {
        let mut setup = bench("mems-chamber-sweep/bench.toml");
        setup.columns.retain(|_, column| !["rate_radps_y", "rate_radps_z"].contains(&column.as_str()));
        let log = LogReader::open(&path, &setup, ReadMode::Bulk).unwrap();
        let windows = WindowBuilder::read_all(vec![log], &setup).unwrap().finish();
        calibrate(windows, &setup, &FitOptions::new(model(text))).unwrap().axes.remove(0)
    };
    let (cubic, two) = (x_alone("bias 3"), x_alone("bias 2, rate 0, slow rate 1"));
    let (fast, slow) = (two.lag_s().unwrap(), two.slow_lag_s().unwrap());
    let ratio = held_out(&two) / held_out(&cubic);
    println!("x: {} {ratio:.3} of the cubic, lags {fast:?}, {slow:?}", two.correction.model);
    assert!(ratio < 0.42, "{ratio}");
    assert!((5.0..12.0).contains(&fast.value) && (350.0..480.0).contains(&slow.value), "{fast:?} {slow:?}");
    let refused = try_fit("bias 3, rate 1, slow rate 1", false).unwrap().unwrap_err().to_string();
    assert!(refused.contains("do not separate the two lags"), "{refused}");
}

/// Held out, of the cubic's error: 0.13, 0.61 and 0.31 on x, y and z. On x and z `auto` finds a drift in time and a warm-up next to
/// one lag, which leave a third of what two lags leave. This one sweep cannot say whether time or a process slower than the sweep
/// is the cause; the record says that neither is corrected.
#[test]
fn time_explains_what_a_second_lag_does_not() {
    let Some(cubic) = fit("bias 3", false) else {
        return;
    };
    let auto = fit("auto", false).unwrap();
    for ((axis, of), most) in auto.axes.iter().zip(&cubic.axes).zip([0.15, 0.65, 0.35]) {
        let ratio = held_out(axis) / held_out(of);
        println!("{}: {} {ratio:.3} of the cubic", axis.axis, axis.correction.model);
        assert!(ratio < most, "{ratio}");
        assert!(axis.slow_lag_s().is_none(), "{}", axis.correction.model);
    }
    let effects: Vec<usize> = auto.axes.iter().map(|axis| axis.fit.as_ref().unwrap().time_effects.len()).collect();
    assert_eq!(effects, [2, 0, 2]);
    // The tutorial quotes the values of axis x.
    let page =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/tutorial/real-log.md")).unwrap();
    let dph = |axis: &AxisCalibration| format!("{:.0}", axis.cross_validation().unwrap().sigma_dph);
    let x = &auto.axes[0];
    for quoted in
        [x.correction.model.clone(), format!("**{} °/h", dph(x)), format!("alone has {}", dph(&cubic.axes[0]))]
    {
        assert!(page.contains(&quoted), "real-log.md has no \"{quoted}\"");
    }
}

/// Its heating alone, thirty rows summed to counts: the largest models follow the ramp closely and are wrong by several times that next to it.
/// A grade selected `bias 6, rate 1` there, with 2.6 times the held-out error of `bias 6`.
#[test]
fn no_model_is_selected_that_a_smaller_one_beats_by_far() {
    const ROW_S: f64 = 0.5054;
    const ARCSEC_PER_COUNT: f64 = 0.5;
    let Some(path) = shared("mems-chamber-sweep/imu_raw_data.csv") else {
        return;
    };
    let text = std::fs::read_to_string(path).unwrap();
    let rows: Vec<(f64, f64)> = text
        .lines()
        .skip(1 + 2692)
        .take(3502)
        .map(|line| {
            let fields: Vec<f64> = line.split('\t').map(|field| field.parse().unwrap()).collect();
            (fields[8], fields[2])
        })
        .collect();
    let sums = rows.chunks_exact(30).enumerate().map(|(at, rows)| {
        let celsius = rows.iter().map(|(celsius, _)| celsius).sum::<f64>() / 30.0;
        let arcsec = rows.iter().map(|(_, radps)| radps).sum::<f64>() * ROW_S * 180.0 / std::f64::consts::PI * 3600.0;
        format!("{:.3},{celsius:.3},{:.0}\n", (at + 1) as f64 * 30.0 * ROW_S, arcsec / ARCSEC_PER_COUNT)
    });
    let log = format!("time_s,temperature_c,counts\n{}", sums.collect::<String>());
    let setup = Setup { arcsec_per_count: Some(ARCSEC_PER_COUNT), ..Setup::default() };
    let found = support::fit(vec![log.into_bytes()], &setup, "auto").unwrap();
    let fit = found.axes[0].fit.as_ref().unwrap();
    let chosen = fit.candidates.iter().find(|candidate| candidate.chosen).unwrap();
    println!("{chosen:?}");
    let smaller = fit.candidates.iter().filter(|other| other.coefficients < chosen.coefficients);
    let least = smaller.filter_map(|other| other.held_out_dph).fold(f64::INFINITY, f64::min);
    assert!(chosen.held_out_dph.unwrap() <= 1.5 * least, "{chosen:?} {least}");
}
