//! Warnings: each fault is raised within a stated time, and a hundred hours of good test raise none.
//!
//! The rig is this file's own: a chamber, a block behind it, thermometers with steps and noise, counts that random-walk. It shares no code with
//! the simulator or the bench. The simulator's own faults come on top.

use std::path::Path;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use sagnac_bench::journal::{Entry, EntryKind, JournalWriter};
use sagnac_bench::live::{Live, Warning, WarningKind};
use sagnac_bench::{JournalRows, Start, journal_of};
use sagnac_log::setup::Setup;

const NS: f64 = 1e9;

/// A rig on a thermal test.
#[derive(Clone)]
struct Rig {
    hours: f64,
    row_s: f64,
    seed: u64,
    /// Of the block behind the chamber, and of the second thermometer behind the first, s.
    lag_s: f64,
    second_lag_s: f64,
    thermometer_noise_c: f64,
    lsb_c: f64,
    arcsec_per_count: f64,
    ramp_cpm: f64,
    soak_s: f64,
    /// The second thermometer is there; the chamber is asked.
    has_second: bool,
    has_chamber: bool,
    has_loops: bool,
}

impl Default for Rig {
    fn default() -> Self {
        Self {
            hours: 8.0,
            row_s: 1.0,
            seed: 1,
            lag_s: 1200.0,
            second_lag_s: 200.0,
            thermometer_noise_c: 0.01,
            lsb_c: 0.0625,
            arcsec_per_count: 0.15125,
            ramp_cpm: 1.0,
            soak_s: 5400.0,
            has_second: true,
            has_chamber: true,
            has_loops: true,
        }
    }
}

/// A row, before a fault changes it.
#[derive(Clone, Debug)]
struct Row {
    t_s: f64,
    counts: f64,
    block_c: f64,
    second_c: f64,
    chamber_c: f64,
    set_point_c: f64,
    path_length_v: f64,
    light: f64,
    /// Not sent.
    lost: bool,
    /// Sent by so much later, s.
    late_s: f64,
}

impl Rig {
    /// Set-point of the chamber: from 20 °C down to −40, up to 70, and round again.
    fn set_point(&self, t_s: f64) -> f64 {
        let leg_s = 110.0 / self.ramp_cpm * 60.0;
        let first_s = 60.0 / self.ramp_cpm * 60.0;
        if t_s < self.soak_s {
            return 20.0;
        }
        let t_s = t_s - self.soak_s;
        if t_s < first_s {
            return 20.0 - self.ramp_cpm / 60.0 * t_s;
        }
        let t_s = (t_s - first_s) % (2.0 * (leg_s + self.soak_s));
        let half = leg_s + self.soak_s;
        let (along, from, to) = if t_s < half { (t_s, -40.0, 70.0) } else { (t_s - half, 70.0, -40.0) };
        if along < self.soak_s { from } else { from + (to - from) * ((along - self.soak_s) / leg_s).min(1.0) }
    }

    fn rows(&self) -> impl Iterator<Item = Row> + use<> {
        let rig = self.clone();
        let mut random = ChaCha8Rng::seed_from_u64(rig.seed);
        let (mut chamber, mut block, mut second) = (20.0, 20.0, 20.0);
        let (mut angle, mut counted) = (0.0, 0.0);
        (1..=(rig.hours * 3600.0 / rig.row_s) as u64).map(move |row| {
            let t_s = row as f64 * rig.row_s;
            let normal = |random: &mut ChaCha8Rng| -> f64 { StandardNormal.sample(random) };
            let set_point_c = rig.set_point(t_s);
            chamber += (set_point_c - chamber) * (rig.row_s / 120.0).min(1.0);
            block += (chamber - block) * rig.row_s / rig.lag_s;
            second += (block - second) * rig.row_s / rig.second_lag_s;
            let drift = 4.5 + 0.002 * (block - 20.0) + 1e-5 * (block - 20.0_f64).powi(2);
            angle += drift * rig.row_s + 0.18 * rig.row_s.sqrt() * normal(&mut random);
            let counts = (angle / rig.arcsec_per_count).floor() - counted;
            counted += counts;
            let mut read = |c: f64| {
                let c = c + rig.thermometer_noise_c * normal(&mut random);
                (c / rig.lsb_c).round() * rig.lsb_c
            };
            let (block_c, second_c) = (read(block), read(second + 1.5 + 0.01 * block));
            Row {
                t_s,
                counts,
                block_c,
                second_c,
                chamber_c: (chamber * 10.0).round() / 10.0,
                set_point_c,
                path_length_v: 40.0 - 0.3 * block + 0.01 * normal(&mut random),
                light: 1.0 - 0.001 * (block - 20.0) + 0.002 * normal(&mut random),
                lost: false,
                late_s: 0.0,
            }
        })
    }

    fn setup(&self, more: &str) -> Setup {
        let poll = if self.has_chamber {
            "[[bench.poll]]\nsource = \"scpi://chamber:1\"\ncolumns = [{ name = \"temperature_c_chamber\", query = \"T?\" }, { name = \"set_point_c\", query = \"S?\" }]\n"
        } else {
            ""
        };
        let text = format!("axis = \"z\"\narcsec_per_count = {}\n{more}\n{poll}", self.arcsec_per_count);
        Setup::parse(&text).unwrap()
    }

    /// Warnings of a test whose rows a fault changes.
    fn warnings(&self, more: &str, mut fault: impl FnMut(&mut Row)) -> Vec<Warning> {
        let folder = tempfile::tempdir().unwrap();
        let path = journal_of(&folder.path().join("run.parquet"));
        self.record(&path, more, &mut fault);
        let live = Live::default();
        live.look_through(JournalRows::open(&path).unwrap()).unwrap();
        live.look(|state| state.warnings.clone())
    }

    /// The journal that a bench would have written.
    fn record(&self, path: &Path, more: &str, fault: &mut dyn FnMut(&mut Row)) {
        const STARTED_NS: i64 = 1_700_000_000_000_000_000;
        let names = ["gyro", "temperature_c_chamber", "set_point_c"].map(str::to_owned).to_vec();
        let start = Start::new("test", STARTED_NS, &self.setup(more), names);
        let mut journal = JournalWriter::create(path).unwrap();
        journal.push(&start.entry().unwrap()).unwrap();
        let bytes = |source: u8, at_s: f64, text: String| Entry {
            kind: EntryKind::Bytes,
            source,
            arrival_ns: STARTED_NS + (at_s * NS) as i64,
            payload: text.into_bytes(),
        };
        let mut header = "time_s,counts,temperature_c".to_owned();
        header += if self.has_second { ",temperature_c_second" } else { "" };
        header += if self.has_loops { ",aux_path_length_v,aux_light" } else { "" };
        journal.push(&bytes(0, 0.0, header + "\n")).unwrap();
        for mut row in self.rows() {
            fault(&mut row);
            if self.has_chamber {
                journal.push(&bytes(1, row.t_s, row.chamber_c.to_string())).unwrap();
                journal.push(&bytes(2, row.t_s, row.set_point_c.to_string())).unwrap();
            }
            if row.lost {
                continue;
            }
            let counts = if row.counts.is_nan() { String::new() } else { row.counts.to_string() };
            let mut text = format!("{},{counts},{}", row.t_s, row.block_c);
            if self.has_second {
                text += &format!(",{}", row.second_c);
            }
            if self.has_loops {
                text += &format!(",{:.4},{:.5}", row.path_length_v, row.light);
            }
            journal.push(&bytes(0, row.t_s + row.late_s + 0.02, text + "\n")).unwrap();
        }
        journal.write().unwrap();
    }
}

/// Asserts that a warning of this kind began within so many minutes of a fault, and no other one before it.
fn raised(warnings: &[Warning], kind: WarningKind, fault_s: f64, within_min: f64) {
    let mut all: Vec<&Warning> = warnings.iter().collect();
    all.sort_by(|a, b| a.since_s.total_cmp(&b.since_s));
    let found = all.iter().find(|warning| warning.kind == kind).unwrap_or_else(|| panic!("no {kind:?} in {all:?}"));
    let after_min = (found.since_s - fault_s) / 60.0;
    assert!((0.0..=within_min).contains(&after_min), "{kind:?} after {after_min} min: {}", found.words);
    let early: Vec<&&Warning> = all.iter().filter(|warning| warning.since_s < fault_s).collect();
    assert!(early.is_empty(), "before the fault: {early:?}");
}

/// Start of every fault: in the ramp that heats.
const FAULT_S: f64 = 5.5 * 3600.0;

#[test]
fn a_stuck_thermometer_is_seen_in_quarter_of_an_hour() {
    for (has_second, has_chamber) in [(true, true), (true, false), (false, true)] {
        for second in [false, true] {
            if second && !has_second {
                continue;
            }
            let rig = Rig { has_second, has_chamber, ..Rig::default() };
            let mut held = f64::NAN;
            let warnings = rig.warnings("", |row| {
                let reading = if second { &mut row.second_c } else { &mut row.block_c };
                if row.t_s < FAULT_S {
                    held = *reading;
                } else {
                    *reading = held;
                }
            });
            raised(&warnings, WarningKind::StuckThermometer, FAULT_S, 15.0);
        }
    }
}

/// Alone, it is seen if it stops in the middle of a ramp.
#[test]
fn a_lone_thermometer_that_stops_in_a_ramp_is_seen() {
    let rig = Rig { has_second: false, has_chamber: false, ..Rig::default() };
    let mut held = f64::NAN;
    let warnings = rig.warnings("", |row| {
        if row.t_s < FAULT_S {
            held = row.block_c;
        } else {
            row.block_c = held;
        }
    });
    raised(&warnings, WarningKind::StuckThermometer, FAULT_S, 15.0);
}

#[test]
fn a_thermometer_that_drifts_or_comes_off_is_seen() {
    // 4 °C an hour, at temperatures that were seen before: within 40 minutes.
    let rig = Rig { hours: 14.0, ..Rig::default() };
    let again_s = 11.0 * 3600.0;
    let drifts = rig.warnings("", |row| {
        row.second_c += ((row.t_s - again_s).max(0.0) / 3600.0 * 4.0 / 0.0625).round() * 0.0625;
    });
    raised(&drifts, WarningKind::ThermometerDeparts, again_s, 40.0);
    // Off the block: it reads the air of the chamber, within ten minutes.
    let off = Rig::default().warnings("", |row| {
        if row.t_s >= FAULT_S {
            row.second_c = row.chamber_c;
        }
    });
    raised(&off, WarningKind::ThermometerDeparts, FAULT_S, 10.0);
}

#[test]
fn counts_that_stand_still_or_are_missing_are_seen() {
    let mut held = f64::NAN;
    let stopped = Rig::default().warnings("", |row| {
        if row.t_s < FAULT_S {
            held = row.counts;
        } else {
            row.counts = held;
        }
    });
    raised(&stopped, WarningKind::CountsStandStill, FAULT_S, 7.0);
    let missing = Rig::default().warnings("", |row| {
        if row.t_s >= FAULT_S && (row.t_s as u64).is_multiple_of(5) {
            row.counts = f64::NAN;
        }
    });
    raised(&missing, WarningKind::MissingRows, FAULT_S, 3.0);
    let lost = Rig::default().warnings("", |row| row.lost = row.t_s >= FAULT_S && (row.t_s as u64).is_multiple_of(6));
    raised(&lost, WarningKind::MissingRows, FAULT_S, 3.0);
}

#[test]
fn running_totals_and_counters_that_wrap_are_seen() {
    // A running total that is read as counts of a row.
    let mut total = 0.0;
    let totals = Rig::default().warnings("", |row| {
        total += row.counts;
        row.counts = total;
    });
    raised(&totals, WarningKind::CounterWraps, 0.0, 4.0);
    // A running total of 16 bits whose width is not stated: it wraps once in half an hour.
    let mut total = 0.0;
    let wraps = Rig::default().warnings("counter = \"cumulative\"", |row| {
        total = (total + row.counts) % 65_536.0;
        row.counts = total;
    });
    raised(&wraps, WarningKind::CounterWraps, 0.0, 45.0);
    // With its width there is nothing to say.
    let mut total = 0.0;
    let known = Rig::default().warnings("counter = \"cumulative\"\ncounter_bits = 16", |row| {
        total = (total + row.counts) % 65_536.0;
        row.counts = total;
    });
    assert!(known.is_empty(), "{known:?}");
}

#[test]
fn a_chamber_that_does_not_follow_is_seen() {
    let mut held = f64::NAN;
    let warnings = Rig::default().warnings("", |row| {
        if row.t_s < FAULT_S {
            held = row.chamber_c;
        } else {
            row.chamber_c = held;
        }
    });
    raised(&warnings, WarningKind::ChamberNotFollowing, FAULT_S, 20.0);
}

#[test]
fn a_ramp_that_is_too_fast_is_seen() {
    let fast = Rig { ramp_cpm: 5.0, lag_s: 300.0, ..Rig::default() };
    let warnings = fast.warnings("", |_| {});
    // The ramp begins after the first soak.
    raised(&warnings, WarningKind::RampTooFast, 5400.0, 12.0);
}

#[test]
fn loops_out_of_their_range_are_seen() {
    let dim = Rig::default().warnings("", |row| row.light *= if row.t_s >= FAULT_S { 0.5 } else { 1.0 });
    raised(&dim, WarningKind::Light, FAULT_S, 3.0);
    let at_limit = Rig::default().warnings("", |row| {
        if row.t_s >= FAULT_S {
            row.path_length_v = 75.0;
        }
    });
    raised(&at_limit, WarningKind::PathLength, FAULT_S, 8.0);
}

#[test]
fn clocks_that_drift_apart_are_seen() {
    // The gyro's clock is 500 ppm slow from the start: its rows come ever later.
    let warnings = Rig::default().warnings("", |row| row.late_s = row.t_s * 500e-6);
    raised(&warnings, WarningKind::ClockDrift, 0.0, 15.0);
}

#[test]
fn vibration_is_seen() {
    let mut random = ChaCha8Rng::seed_from_u64(9);
    let mut last = 0.0;
    let warnings = Rig::default().warnings("", |row| {
        if row.t_s >= FAULT_S {
            // An angle that shakes: what one row has, the next one has not.
            let shake: f64 = StandardNormal.sample(&mut random);
            row.counts += (8.0 * (shake - last)).round();
            last = shake;
        }
    });
    raised(&warnings, WarningKind::Vibration, FAULT_S, 4.0);
}

/// A hundred hours and more of good test, over rigs of all kinds: no warning.
#[test]
fn a_good_test_raises_nothing() {
    let base = Rig { hours: 24.0, ..Rig::default() };
    let rigs = [
        base.clone(),
        Rig { seed: 2, row_s: 5.0, ..base.clone() },
        Rig { seed: 3, has_second: false, has_chamber: false, ..base.clone() },
        Rig { seed: 4, thermometer_noise_c: 0.0, lsb_c: 0.001, has_chamber: false, ..base.clone() },
        Rig { seed: 5, thermometer_noise_c: 0.1, lsb_c: 0.1, second_lag_s: 600.0, ..base.clone() },
        // A coarse counter, whose rows are 7 or 8 counts.
        Rig { seed: 6, arcsec_per_count: 2.42, row_s: 4.0, ..base.clone() },
        Rig { seed: 7, ramp_cpm: 0.3, soak_s: 10_800.0, ..base.clone() },
        Rig { seed: 8, lag_s: 3600.0, second_lag_s: 60.0, lsb_c: 0.5, ..base },
    ];
    let mut hours = 0.0;
    for rig in rigs {
        let warnings = rig.warnings("", |_| {});
        assert!(warnings.is_empty(), "seed {}: {warnings:?}", rig.seed);
        hours += rig.hours;
    }
    assert!(hours >= 100.0);
}

/// The simulator's own faults: each raises a warning, and its sound tests raise none.
#[test]
fn faults_of_the_simulator_are_seen() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios/triangle-28cm-dithered");
    let text = std::fs::read_to_string(root.join("triangle-28cm-dithered.toml")).unwrap();
    let bench = std::fs::read_to_string(root.join("bench.toml")).unwrap();
    // The second ramp heats from 34,200 s on.
    let faults = [
        ("", None),
        ("stuck_thermometer", Some(WarningKind::StuckThermometer)),
        ("drifting_thermometer", Some(WarningKind::ThermometerDeparts)),
        ("dropped_samples", Some(WarningKind::MissingRows)),
        ("pump_failure", Some(WarningKind::Light)),
        ("saturated_counter", Some(WarningKind::CountsStandStill)),
        ("dither_failure", Some(WarningKind::CountsStandStill)),
    ];
    for (fault, kind) in faults {
        let mut scenario = sagnac_sim::Scenario::from_toml(&text).unwrap();
        if let Some(kind) = Some(fault).filter(|fault| !fault.is_empty()) {
            let mut fault = sagnac_sim::Fault::of_kind(kind.parse().unwrap(), 82_800.0);
            (fault.at_s, fault.for_s) = (36_000.0, 5400.0);
            scenario.fault.push(fault);
        }
        let folder = tempfile::tempdir().unwrap();
        let path = journal_of(&folder.path().join("run.parquet"));
        let setup = Setup::parse(&bench).unwrap();
        let start = Start::new("test", 0, &setup, vec!["simulator".to_owned()]);
        let mut journal = JournalWriter::create(&path).unwrap();
        journal.push(&start.entry().unwrap()).unwrap();
        let mut log = sagnac_sim::LogText::new(&scenario);
        let entry = |t_ns: i64, line: &[u8]| Entry {
            kind: EntryKind::Bytes,
            source: 0,
            arrival_ns: t_ns,
            payload: line.to_vec(),
        };
        journal.push(&entry(0, log.header_line().as_bytes())).unwrap();
        let mut run = scenario.build().unwrap().start(5);
        run.each_row(|row, second| journal.push(&entry(row.time_ns, log.line(row, second)))).unwrap();
        journal.write().unwrap();
        let live = Live::default();
        live.look_through(JournalRows::open(&path).unwrap()).unwrap();
        let warnings = live.look(|state| state.warnings.clone());
        match kind {
            Some(kind) => raised(&warnings, kind, 36_000.0, 40.0),
            None => assert!(warnings.is_empty(), "{warnings:?}"),
        }
    }
}
