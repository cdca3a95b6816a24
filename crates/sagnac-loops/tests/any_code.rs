//! Any code of the photodiode: no overflow (tests check arithmetic), outputs in their ranges, no wind-up.

use proptest::prelude::*;
use sagnac_loops::{IntensityConfig, LoopGoal, PathLengthConfig, PathLengthPhase, PathLengthStatus};

fn path_config() -> impl Strategy<Value = PathLengthConfig> {
    (2_u32..=32, 0.01_f64..0.05, 0.001_f64..0.09, 1e5_f64..8e6, 1_f64..20.0, prop::bool::ANY, 0_u8..2).prop_map(
        |(half, modulation_waves, part, peak_code, curvature, heater, answer_ticks)| {
            let period_s = 2.0 * f64::from(half) * 1e-4;
            let bandwidth_hz = part / period_s;
            PathLengthConfig {
                tick_s: 1e-4,
                modulation_hz: 1.0 / period_s,
                modulation_waves,
                separate_modulator: heater,
                answer_ticks,
                range: if heater { [0.0, 4.0] } else { [-150.0, 150.0] },
                waves_per_unit: if heater { 0.75 } else { 0.012 },
                codes_per_unit: if heater { 30_000.0 } else { 870.0 },
                lag_s: if heater { [5.0, 8.0] } else { [0.0; 2] },
                peak_code,
                curvature,
                noise: 1e-4,
                goal: LoopGoal { bandwidth_hz, phase_margin_deg: 45.0 },
                reset_margin_waves: 0.2,
                reset_s: 0.01,
                settle_s: 0.01,
                sweep_s: if heater { 0.0 } else { 0.05 },
                lock_waves: 0.005,
            }
        },
    )
}

/// Codes that stay, jump, saturate and lie far outside of any converter.
fn codes() -> impl Strategy<Value = Vec<(i32, u16)>> {
    let code = prop_oneof![any::<i32>(), -1000..1000_i32, Just(i32::MIN), Just(i32::MAX), Just(1 << 23)];
    prop::collection::vec((code, 1_u16..400), 1..60)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn the_actuator_stays_in_its_range(config in path_config(), codes in codes()) {
        let built = config.build();
        prop_assert!(built.is_ok(), "{}", built.unwrap_err());
        let design = built.unwrap();
        let table = design.integers;
        let mut state = table.start();
        let [low, high] = config.range.map(|unit| unit * config.codes_per_unit);
        for (code, times) in codes {
            for _ in 0..times {
                let out = table.tick(&mut state, code);
                let sum = f64::from(out.actuator) + if config.separate_modulator { 0.0 } else { f64::from(out.modulation) };
                prop_assert!(sum >= low - 1.0 && sum <= high + 1.0, "{sum} is not in {low} … {high}");
                let locked = matches!(state.phase(), PathLengthPhase::Locked { .. });
                prop_assert!(locked || out.status.contains(PathLengthStatus::INVALID), "{:?}", state.phase());
            }
        }
    }

    #[test]
    fn the_current_stays_in_its_range(
        update_ticks in 1_u16..200,
        set_code in 1e3_f64..4e6,
        part in 0.001_f64..0.09,
        high_ma in 0.02_f64..100.0,
        current_bits in 8_u32..=23,
        slew_ma_per_s in 1e-3_f64..1e5,
        codes in codes(),
        hold in any::<bool>(),
    ) {
        let current_codes_per_ma = f64::from(1 << current_bits) / high_ma;
        let period_s = f64::from(update_ticks) * 1e-4;
        let config = IntensityConfig {
            tick_s: 1e-4,
            update_ticks,
            set_code,
            codes_per_ma: 4.0 * set_code / high_ma,
            lag_s: 1e-3,
            range_ma: [0.15 * high_ma, high_ma],
            current_codes_per_ma,
            slew_ma_per_s,
            ignition_ma: 0.75 * high_ma,
            ignition_s: 0.05,
            rest_s: 0.02,
            tries: 2,
            low_part: 0.8,
            goal: LoopGoal { bandwidth_hz: part / period_s, phase_margin_deg: 45.0 },
        };
        let built = config.build();
        prop_assert!(built.is_ok(), "{}", built.unwrap_err());
        let design = built.unwrap();
        let mut state = design.integers.start();
        let mut before = f64::from(design.integers.tick(&mut state, 0, hold).current);
        for (code, times) in codes {
            for _ in 0..times {
                let current = f64::from(design.integers.tick(&mut state, code, hold).current);
                prop_assert!((0.0..=f64::from(1 << current_bits)).contains(&current));
                // Ignition switches; all else is slewed, by a code at least.
                let step = (current - before).abs();
                let switched = current == 0.0 || current == (0.75 * f64::from(1 << current_bits)).round();
                let slew = (slew_ma_per_s * period_s * current_codes_per_ma).max(1.0) + 1.0;
                prop_assert!(switched || step <= slew, "{before} to {current}");
                before = current;
            }
        }
    }
}

/// An integrator at its limit leaves it as soon as the error changes sign, for any time at the limit.
#[test]
fn nothing_is_wound_up() {
    let config = IntensityConfig {
        tick_s: 1e-4,
        update_ticks: 8,
        set_code: 200_000.0,
        codes_per_ma: 400_000.0,
        lag_s: 1e-3,
        range_ma: [0.3, 2.0],
        current_codes_per_ma: 500_000.0,
        slew_ma_per_s: 1e4,
        ignition_ma: 1.5,
        ignition_s: 0.5,
        rest_s: 1.0,
        tries: 0,
        low_part: 0.8,
        goal: LoopGoal { bandwidth_hz: 10.0, phase_margin_deg: 60.0 },
    };
    let table = config.build().unwrap().integers;
    let run = |dim_ticks: u32| {
        let mut state = table.start();
        (0..dim_ticks).for_each(|_| {
            table.tick(&mut state, 100_000, false);
        });
        assert_eq!(table.tick(&mut state, 100_000, false).current, 1_000_000, "at its end");
        (1..).find(|_| table.tick(&mut state, 210_000, false).current < 1_000_000).unwrap()
    };
    let (soon, late): (u32, u32) = (run(4_000), run(400_000));
    assert!(soon <= 32 && soon == late, "{soon} and {late} ticks");
}
