//! Scenario files: refused by key before a run starts; the same bytes each time; the manual.

use std::io::Write as _;
use std::path::Path;

use crate::gyros::{READY, ready, run, run_rows};
use sagnac_sim::{ChamberLeg, ERROR_SOURCES, Fault, FaultKind, Fidelity, LogText, Scenario, truth_header, write_truth};

const LEAST: &str = "
[geometry]
perimeter_m = 0.28
[[thermometer]]
[chamber]
leg = [{ soak_s = 100 }]
";

fn refusal(text: &str) -> String {
    Scenario::from_toml(text).and_then(|scenario| scenario.build()).unwrap_err().to_string()
}

#[test]
fn little_is_needed() {
    let scenario = Scenario::from_toml(LEAST).unwrap();
    assert_eq!(scenario.build().unwrap().length_s(), 100.0);
}

/// Replaced text of the least scenario, its replacement, and words of the refusal.
const BAD: &[(&str, &str, &str)] = &[
    ("perimeter_m = 0.28", "perimeter_m = -0.28", "`geometry.perimeter_m` is -0.28: give 0.02 to 20 m"),
    ("perimeter_m = 0.28", "", "`geometry.perimeter_m` must be given"),
    ("perimeter_m = 0.28", "perimeter_m = nan", "`geometry.perimeter_m` must be given"),
    ("perimeter_m = 0.28", "perimeter_m = 0.28\nlength_m = 1.0", "unknown field `length_m`"),
    ("[geometry]", "[geometri]", "unknown field `geometri`"),
    ("[[thermometer]]", "", "`thermometer` is missing"),
    ("[[thermometer]]", "[[thermometer]]\n[[thermometer]]", "`thermometer[1].name` is `` again"),
    ("[[thermometer]]", "[[thermometer]]\nname = \"A b\"", "small letters, digits and _"),
    ("{ soak_s = 100 }", "", "`chamber.leg` is missing"),
    ("{ soak_s = 100 }", "{ soak_s = 0 }", "`chamber.leg[0]` soaks for 0 s"),
    ("{ soak_s = 100 }", "{ soak_h = 1 }", "a leg is { soak_s = … } or { to_c = …, rate_cpm = … }"),
    ("{ soak_s = 100 }", "{ to_c = 900, rate_cpm = 1 }", "ramps to 900 °C"),
    ("{ soak_s = 100 }", "{ to_c = 70, rate_cpm = 0 }", "at 0 °C/min"),
    ("[geometry]", "[run]\ninterval_s = 0.3\n[geometry]", "`run.interval_s` is 0.3: give whole seconds"),
    ("[geometry]", "[run]\ninterval_s = 500.0\n[geometry]", "`run.interval_s` is 500 s, longer than the test (100 s)"),
    (
        "[geometry]",
        "[run]\nfidelity = \"beat\"\n[input]\nrate_dph = 3.6e6\n[dither]\nfrequency_hz = 2000.0\namplitude_arcsec = 1000.0\n[geometry]",
        "fringes in a tick of 100 µs, 500 can be followed",
    ),
    ("[geometry]", "[path_length]\nrange_low = 50.0\nrange_high = 40.0\n[geometry]", "not above range_low"),
    ("[geometry]", "[path_length]\nrange_low = -40.0\nrange_high = 40.0\n[geometry]", "holds 0.92 wavelengths"),
    (
        "[geometry]",
        "[path_length]\nbandwidth_hz = 120.0\nrising_lag_s = 1.0\nfalling_lag_s = 1.0\nsweep_s = 0.0\n[geometry]",
        "`path_length.bandwidth_hz` makes a loop that cannot be built",
    ),
    ("perimeter_m = 0.28", "perimeter_m = 0.8", "the next longitudinal mode has 1.26 times"),
    ("[geometry]", "[dither]\nfrequency_hz = 400.0\nnoise = 0.0\n[geometry]", "pure dither has dynamic lock-in zones"),
    (
        "[geometry]",
        "[dither]\nfrequency_hz = 400.0\namplitude_arcsec = 1.0\n[geometry]",
        "`dither.amplitude_arcsec` is 0.4",
    ),
    ("[[thermometer]]", "[[thermometer]]\nlsb_c = 1e-310", "`thermometer[0].lsb_c`"),
    ("[chamber]", "[chamber]\ncycles = 1.5", "`chamber.cycles` is 1.5: give a whole number"),
    (
        "leg = [{ soak_s = 100 }]",
        "cycles = 10000\nleg = [{ soak_s = 1e6 }]",
        "`chamber.cycles` make a test of 10000000000 s",
    ),
    ("[geometry]", "name = \"a\\u001b[31m\"\n[geometry]", "`name` holds control characters"),
    ("[geometry]", "[[fault]]\nat_s = 5\nfor_s = 5\nsensor = 3\n[geometry]", "`fault[0].sensor` is 3: there are 1"),
    (
        "[geometry]",
        "[[fault]]\nat_s = 500\nfor_s = 5\n[geometry]",
        "`fault[0].at_s` is 500 s, and the test ends at 100 s",
    ),
    (
        "[geometry]",
        "[run]\nfidelity = \"beat\"\nbeat_model = \"two_mode\"\n[cavity]\nloss_ppm = 20000\ngain_ratio = 3\n[geometry]",
        "a tick needs",
    ),
    ("[geometry]", "[intensity]\nnominal_ma = 5.0\n[geometry]", "`intensity.nominal_ma` is 5, not between"),
    ("[geometry]", "[[fault]]\nkind = \"stuck_thermometer\"\nfor_s = 1.0\n[geometry]", "`fault[0].at_s` must be given"),
];

#[test]
fn bad_scenarios_are_refused_by_name() {
    for (from, to, words) in BAD {
        let text = LEAST.replacen(from, to, 1);
        let message = refusal(&text);
        assert!(message.contains(words), "{to:?}: {message}");
    }
    let torn = Scenario::from_toml("seed = 3\n[geometry\n").unwrap_err();
    assert_eq!(torn.line, Some(2), "{torn}");
}

#[test]
fn names_and_files_are_parsed() {
    for (kind, name) in FaultKind::ALL {
        assert_eq!(name.parse::<FaultKind>(), Ok(kind));
        assert_eq!(kind.to_string(), name);
    }
    let unknown = "meteor".parse::<FaultKind>().unwrap_err();
    assert_eq!(unknown.key, "fault.kind");
    assert!(unknown.message.starts_with("is `meteor`: give one of stuck_thermometer, "), "{unknown}");
    assert_eq!(LEAST.parse::<Scenario>(), Scenario::from_toml(LEAST));
    let missing = Scenario::from_file("no/such/gyro.toml").unwrap_err().to_string();
    assert!(missing.starts_with("cannot read no/such/gyro.toml: "), "{missing}");
}

/// The log and the truth of the first rows.
fn bytes(scenario: &Scenario, seed: u64, rows: usize) -> (Vec<u8>, Vec<u8>) {
    let mut text = LogText::new(scenario);
    let (mut log, mut truth) = (text.header_line().into_bytes(), truth_header().into_bytes());
    run_rows(scenario, seed, rows, |row, second| {
        log.write_all(text.line(row, second)).unwrap();
        write_truth(&mut truth, row, second).unwrap();
    });
    (log, truth)
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_any_number_of_threads() {
    for name in READY {
        let scenario = ready(name);
        let alone = bytes(&scenario, 7, 2000);
        let together: Vec<_> = std::thread::scope(|scope| {
            let threads: Vec<_> = (0..3).map(|_| scope.spawn(|| bytes(&scenario, 7, 2000))).collect();
            threads.into_iter().map(|thread| thread.join().unwrap()).collect()
        });
        assert!(together.iter().all(|other| *other == alone), "{name}");
        assert_ne!(bytes(&scenario, 8, 2000).0, alone.0, "{name}");
    }
}

/// Time stamps are exact at every interval.
#[test]
fn times_of_the_log_are_exact() {
    for interval in [0.25, 0.125, 0.0625, 0.05, 0.0125, 0.0016, 0.0001, 1.0, 7.0] {
        let mut scenario = ready("paper");
        scenario.run.interval_s = interval;
        let (log, _) = bytes(&scenario, 1, 40);
        for (row, line) in String::from_utf8(log).unwrap().lines().skip(1).enumerate() {
            let time_s: f64 = line.split(',').next().unwrap().parse().unwrap();
            assert!((time_s - (row + 1) as f64 * interval).abs() < 1e-9, "{interval}: {line}");
        }
    }
}

/// Two simultaneous faults of a kind act on two thermometers.
#[test]
fn faults_of_a_kind_add_up() {
    let mut scenario = ready("triangle-28cm-dithered");
    let stuck = |sensor: f64| Fault { kind: FaultKind::StuckThermometer, at_s: 10.0, for_s: 100.0, size: 0.0, sensor };
    scenario.thermometer.iter_mut().for_each(|t| (t.noise_c, t.lsb_c) = (1.0, 0.0));
    scenario.fault = vec![stuck(0.0), stuck(1.0)];
    let mut readings = Vec::new();
    run_rows(&scenario, 1, 50, |_, second| readings.push(second.readings_c.clone()));
    assert!(readings[11..].iter().all(|r| *r == readings[11]), "both are stuck");
}

/// The log has no truth, and every error has its column in the truth.
#[test]
fn the_log_holds_no_truth() {
    let scenario = ready("triangle-28cm-dithered");
    let header = LogText::new(&scenario).header_line();
    assert_eq!(header, "time_s,counts,valid,temperature_c,temperature_c_anode,aux_path_length_v,aux_light\n");
    for source in ERROR_SOURCES {
        assert!(truth_header().contains(&format!(",{source}_dph,")), "{source}");
    }
}

/// Switching a noise source off does not change the random numbers of the others.
#[test]
fn sources_are_apart() {
    let (mut with, mut without) = (ready("triangle-28cm-dithered"), ready("triangle-28cm-dithered"));
    with.thermometer[0].noise_c = 0.1;
    without.noise.bias_instability_dph = 0.0;
    without.thermometer[0].noise_c = 0.0;
    let walks = |scenario: &Scenario| {
        let mut noise = Vec::new();
        run_rows(scenario, 1, 100, |row, _| noise.push(row.noise_arcsec));
        noise
    };
    assert_eq!(walks(&with), walks(&without));
}

/// Each fault has its effect, and none before its start.
#[test]
fn faults_break_what_they_say() {
    let mut base = ready("triangle-28cm-dithered");
    base.chamber.leg = vec![ChamberLeg::Soak { soak_s: 600.0 }, ChamberLeg::Ramp { to_c: 70.0, rate_cpm: 5.0 }];
    base.chamber.cycles = 1.0;
    let rows = |fault: Option<Fault>| {
        let mut scenario = base.clone();
        scenario.fault.extend(fault);
        let mut out = Vec::new();
        run(&scenario, 1, |row, second| {
            out.push((row.time_ns / 1_000_000_000, row.counts, row.valid, second.readings_c[0]));
        });
        out
    };
    let clean = rows(None);
    for (kind, name) in FaultKind::ALL {
        let fault = Fault { kind, at_s: 700.0, for_s: 600.0, size: 0.0, sensor: 0.0 };
        let broken = rows(Some(fault));
        assert_eq!(broken[..700], clean[..700], "{name} before its time");
        let during = |rows: &[(i64, i64, bool, f64)]| -> Vec<(i64, i64, bool, f64)> {
            rows.iter().copied().filter(|row| (701..=1300).contains(&row.0)).collect()
        };
        let (was, is) = (during(&clean), during(&broken));
        let flagged = is.iter().filter(|row| !row.2).count();
        let counts = |rows: &[(i64, i64, bool, f64)]| rows.iter().map(|row| row.1).sum::<i64>();
        match kind {
            FaultKind::StuckThermometer => assert!(is.iter().all(|row| row.3 == is[0].3)),
            FaultKind::DriftingThermometer => assert!((is[599].3 - was[599].3 - 10.0 / 6.0).abs() < 0.1),
            FaultKind::DroppedSamples => assert!((350..490).contains(&is.len())),
            FaultKind::LockLoss => assert_eq!(flagged, 600),
            FaultKind::DitherFailure => assert_eq!(counts(&is), 0, "inside the dead band"),
            FaultKind::PumpFailure => assert!(flagged == 600 && counts(&is) == 0),
            FaultKind::ModeResetStorm => assert!((25..40).contains(&flagged), "{flagged}"),
            FaultKind::SaturatedCounter => assert!(is.iter().all(|row| row.1 <= 7) && counts(&is) < counts(&was)),
            FaultKind::ClockDrift => assert!(is.len() < was.len()),
        }
    }
}

/// The same at the beat level: without dither, inside the dead band, nothing is counted.
#[test]
fn a_failed_dither_locks_the_beat_too() {
    let mut scenario = ready("square-28cm");
    scenario.run.fidelity = Fidelity::Beat;
    scenario.chamber.leg = vec![ChamberLeg::Soak { soak_s: 30.0 }];
    scenario.fault = vec![Fault { kind: FaultKind::DitherFailure, at_s: 10.0, for_s: 10.0, size: 0.0, sensor: 0.0 }];
    let mut counts = Vec::new();
    run(&scenario, 1, |row, _| counts.push(row.counts));
    let sum = |rows: &[i64]| rows.iter().sum::<i64>();
    // 22.8 counts per second. In the first second of the fault the stripper still releases its last period.
    assert!((sum(&counts[..10]) - 228).abs() < 8, "{counts:?}");
    assert_eq!(sum(&counts[11..20]), 0, "{counts:?}");
    assert!((sum(&counts[21..]) - 205).abs() < 8, "{counts:?}");
}

/// Every scenario of the project can be built, and its bench.toml has its scale factor.
#[test]
fn every_scenario_of_the_project_is_good() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
    let mut seen = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let scenario = ready(&name);
        scenario.build().unwrap();
        assert_eq!(scenario.name, name);
        let bench = std::fs::read_to_string(path.join("bench.toml")).unwrap();
        assert!(bench.contains(&format!("arcsec_per_count = {}\n", scenario.arcsec_per_count())), "{name}: bench.toml");
        seen += 1;
    }
    assert_eq!(seen, 5);
}
