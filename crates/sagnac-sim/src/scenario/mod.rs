//! `scenario.toml`: the gyro, its test and its faults, in one file.
//!
//! Every table and key is declared once, in [`tables`], with default, range, unit and source; the same
//! declaration reads the file, checks it and makes the manual ([`manual`]). Unknown keys are refused, values out of
//! range and profiles that cannot be are refused by name before a run starts.

pub mod section;
pub mod tables;

use serde::Deserialize;

use crate::beat::STEPS_PER_LIFETIME;
use crate::fault::{Fault, FaultKind};
use crate::physics;
use crate::plant::Design;
use crate::scenario::section::{Key, Section};
use crate::scenario::tables::{
    BeatModel, Bias, Block, Cavity, Chamber, Direction, Dither, Electronics, Fidelity, Geometry, Input, IntensityTable,
    LegTable, Loops, Noise, PathLengthTable, Readout, Run, ScaleFactor, ThermometerTable,
};
use crate::thermal::{Leg, Profile};

/// Why a scenario is refused: where and what.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// `table.key`, or empty for the file.
    pub key: String,
    /// What is wrong and what can be done.
    pub what: String,
    /// Line of the file, where one is to blame.
    pub line: Option<u64>,
}

impl std::fmt::Display for Problem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.key.is_empty() { write!(f, "{}", self.what) } else { write!(f, "`{}` {}", self.key, self.what) }
    }
}

impl std::error::Error for Problem {}

pub(crate) fn problem(key: &str, what: impl Into<String>) -> Problem {
    Problem { key: key.to_owned(), what: what.into(), line: None }
}

/// Earth's rate against the stars, °/h (IERS, WGS 84: 7.292115e-5 rad/s).
const EARTH_RATE_DPH: f64 = 15.041_067;
/// Longest test, s: 10 years.
const LONGEST_S: f64 = 315_360_000.0;

/// A scenario as it is in the file.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Scenario {
    /// Name.
    pub name: String,
    /// What it stands for.
    pub description: String,
    /// Seed where none is given at the start.
    pub seed: u64,
    /// What is integrated.
    pub run: Run,
    /// The path.
    pub geometry: Geometry,
    /// Losses and gain.
    pub cavity: Cavity,
    /// Dither.
    pub dither: Dither,
    /// Photodiodes and counter.
    pub readout: Readout,
    /// Block.
    pub block: Block,
    /// Bias.
    pub bias: Bias,
    /// Scale factor.
    pub scale_factor: ScaleFactor,
    /// Path-length control.
    pub path_length: PathLengthTable,
    /// Intensity control.
    pub intensity: IntensityTable,
    /// Noise.
    pub noise: Noise,
    /// Thermometers.
    pub thermometer: Vec<ThermometerTable>,
    /// Clock.
    pub electronics: Electronics,
    /// Chamber.
    pub chamber: Chamber,
    /// Rates.
    pub input: Input,
    /// Faults.
    pub fault: Vec<Fault>,
}

/// A table of the manual.
#[derive(Clone, Copy, Debug)]
pub struct Table {
    /// Name in the file.
    pub path: &'static str,
    /// What it is.
    pub about: &'static str,
    /// Its keys.
    pub keys: &'static [Key],
}

const fn table<S: Section>() -> Table {
    Table { path: S::PATH, about: S::ABOUT, keys: S::KEYS }
}

/// Every table with its keys.
pub fn manual() -> Vec<Table> {
    vec![
        table::<Run>(),
        table::<Geometry>(),
        table::<Cavity>(),
        table::<Dither>(),
        table::<Readout>(),
        table::<Block>(),
        table::<Bias>(),
        table::<ScaleFactor>(),
        table::<PathLengthTable>(),
        table::<IntensityTable>(),
        table::<Noise>(),
        table::<ThermometerTable>(),
        table::<Electronics>(),
        table::<Chamber>(),
        table::<Input>(),
        table::<Fault>(),
    ]
}

fn check<S: Section>(section: &S, place: &str) -> Result<(), Problem> {
    let numeric = S::KEYS.iter().filter_map(|key| key.range.map(|range| (key, range)));
    for ((key, (lo, hi)), value) in numeric.zip(section.numbers()) {
        let name = format!("{place}.{}", key.name);
        if value.is_nan() {
            return Err(problem(&name, format!("must be given: {}", key.text.trim())));
        }
        if !(lo..=hi).contains(&value) {
            let unit = if key.unit.is_empty() { String::new() } else { format!(" {}", key.unit) };
            return Err(problem(&name, format!("is {value}; it can be {lo} to {hi}{unit}")));
        }
    }
    Ok(())
}

impl Scenario {
    /// Reads and checks.
    ///
    /// # Errors
    /// What is no TOML, an unknown key, a value out of range, a profile that cannot be; named.
    pub fn from_toml(text: &str) -> Result<Self, Problem> {
        let scenario: Self = toml::from_str(text).map_err(|e| {
            let line = e.span().and_then(|span| text.get(..span.start)).map(|before| 1 + before.matches('\n').count());
            Problem { line: line.map(|line| line as u64), ..problem("", e.message().trim_end()) }
        })?;
        scenario.check()?;
        Ok(scenario)
    }

    /// Checks every value and what must hold between them.
    ///
    /// # Errors
    /// The first problem.
    pub fn check(&self) -> Result<(), Problem> {
        check(&self.run, "run")?;
        check(&self.geometry, "geometry")?;
        check(&self.cavity, "cavity")?;
        check(&self.dither, "dither")?;
        check(&self.readout, "readout")?;
        check(&self.block, "block")?;
        check(&self.bias, "bias")?;
        check(&self.scale_factor, "scale_factor")?;
        check(&self.path_length, "path_length")?;
        check(&self.intensity, "intensity")?;
        check(&self.noise, "noise")?;
        check(&self.electronics, "electronics")?;
        check(&self.chamber, "chamber")?;
        check(&self.input, "input")?;
        for (index, thermometer) in self.thermometer.iter().enumerate() {
            check(thermometer, &format!("thermometer[{index}]"))?;
        }
        for (index, fault) in self.fault.iter().enumerate() {
            check(fault, &format!("fault[{index}]"))?;
        }
        self.check_words()?;
        self.check_whole()?;
        self.check_interval()?;
        self.check_thermometers()?;
        self.check_table()?;
        let length_s = self.profile()?.length_s();
        self.check_faults(length_s)?;
        self.check_one_mode()?;
        self.check_dither()?;
        self.check_beat()?;
        Design::of(self).map(|_| ())
    }

    fn check_interval(&self) -> Result<(), Problem> {
        let interval = self.run.interval_s;
        let whole = |value: f64| (value - libm::round(value)).abs() < 1e-9 * value;
        let ticks = interval / crate::TICK_S;
        let fits = if interval >= 1.0 { whole(interval) } else { whole(1.0 / interval) && whole(ticks) };
        if fits {
            Ok(())
        } else {
            Err(problem(
                "run.interval_s",
                format!("is {interval}; it can be whole seconds, or 1/n of a second in whole ticks of 100 µs"),
            ))
        }
    }

    /// Names and descriptions go to terminals and pages.
    fn check_words(&self) -> Result<(), Problem> {
        for (key, text) in [("name", &self.name), ("description", &self.description)] {
            if text.chars().any(char::is_control) {
                return Err(problem(key, "holds control characters; give one line of plain text"));
            }
        }
        Ok(())
    }

    fn check_whole(&self) -> Result<(), Problem> {
        let whole = |key: &str, value: f64| {
            let fits = value == libm::floor(value);
            if fits { Ok(()) } else { Err(problem(key, format!("is {value}; it is a whole number"))) }
        };
        whole("chamber.cycles", self.chamber.cycles)?;
        whole("electronics.counter_bits", self.electronics.counter_bits)?;
        whole("intensity.ignition_tries", self.intensity.ignition_tries)?;
        for (index, leg) in self.input.table.iter().enumerate() {
            whole(&format!("input.table[{index}].for_s"), leg.for_s)?;
        }
        for (index, fault) in self.fault.iter().enumerate() {
            whole(&format!("fault[{index}].sensor"), fault.sensor)?;
        }
        if self.electronics.counter_bits == 1.0 {
            return Err(problem(
                "electronics.counter_bits",
                "is 1: a counter that can hold nothing; give 2 and more, or 0",
            ));
        }
        Ok(())
    }

    /// What a fault names must be there, and it must happen.
    fn check_faults(&self, length_s: f64) -> Result<(), Problem> {
        for (index, fault) in self.fault.iter().enumerate() {
            let at = |key: &str, what: String| Err(problem(&format!("fault[{index}].{key}"), what));
            if fault.at_s >= length_s {
                return at("at_s", format!("is {} s, and the test ends at {length_s} s", fault.at_s));
            }
            if fault.for_s < 1.0 {
                return at("for_s", format!("is {} s; a fault lasts 1 s and more", fault.for_s));
            }
            if fault.sensor as usize >= self.thermometer.len() {
                let have = self.thermometer.len();
                return at("sensor", format!("is {}; there are {have}, counted from 0", fault.sensor));
            }
            if fault.kind == FaultKind::DroppedSamples && fault.size > 1.0 {
                return at("size", format!("is {}; it is the part of the rows that is dropped, up to 1", fault.size));
            }
            if fault.kind == FaultKind::ModeResetStorm && self.run.loops == Loops::Running {
                return at("kind", "is mode_reset_storm, which only ideal loops can be told to have".to_owned());
            }
        }
        Ok(())
    }

    /// The plant stands for one longitudinal mode: the next must not reach its threshold.
    fn check_one_mode(&self) -> Result<(), Problem> {
        let off = physics::free_spectral_range_hz(self.geometry.perimeter_m) / (self.cavity.gain_width_mhz * 1e6);
        let next = self.cavity.gain_ratio * physics::gain_line(off);
        if next < 1.0 {
            return Ok(());
        }
        Err(problem(
            "cavity.gain_ratio",
            format!(
                "is {}: with this perimeter the next longitudinal mode has {next:.2} times the gain it needs and lases too; this simulator has one mode. Less gain or a shorter path",
                self.cavity.gain_ratio
            ),
        ))
    }

    /// The walk's law needs many fringes in a swing, and noise.
    fn check_dither(&self) -> Result<(), Problem> {
        let d = &self.dither;
        if !self.is_dithered() {
            return Ok(());
        }
        if d.frequency_hz < 20.0 {
            return Err(problem(
                "dither.frequency_hz",
                format!("is {}; it can be 20 Hz and more, or 0 for none", d.frequency_hz),
            ));
        }
        let fringes = d.amplitude_arcsec / self.arcsec_per_fringe();
        if fringes < 2.0 {
            return Err(problem(
                "dither.amplitude_arcsec",
                format!(
                    "is {fringes:.3} fringes; it can be 2 and more, or 0 for none: less does not free a gyro from lock-in"
                ),
            ));
        }
        if d.noise < 0.01 && self.run.fidelity == Fidelity::Count {
            return Err(problem(
                "dither.noise",
                format!(
                    "is {}: pure dither has dynamic lock-in zones, which only the beat level knows. 0.01 and more, or run.fidelity = \"beat\"",
                    d.noise
                ),
            ));
        }
        Ok(())
    }

    fn check_thermometers(&self) -> Result<(), Problem> {
        if self.thermometer.is_empty() {
            return Err(problem("thermometer", "is missing: a thermal test has at least one"));
        }
        const MOST: usize = 32;
        if self.thermometer.len() > MOST {
            return Err(problem(
                "thermometer",
                format!("stands {} times; a log has at most {MOST}", self.thermometer.len()),
            ));
        }
        for (index, one) in self.thermometer.iter().enumerate() {
            if one.lsb_c != 0.0 && one.lsb_c < 1e-6 {
                let what = format!("is {:e}; it can be 1e-6 °C and more, or 0 for none", one.lsb_c);
                return Err(problem(&format!("thermometer[{index}].lsb_c"), what));
            }
            let place = format!("thermometer[{index}].name");
            if !one.name.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_') {
                return Err(problem(&place, format!("is `{}`; small letters, digits and _ make a header", one.name)));
            }
            if self.thermometer[..index].iter().any(|other| other.name == one.name) {
                return Err(problem(&place, format!("is `{}` again; give each its own", one.name)));
            }
        }
        Ok(())
    }

    fn check_table(&self) -> Result<(), Problem> {
        for (index, leg) in self.input.table.iter().enumerate() {
            let bad = !(leg.rate_dps.abs() <= 2000.0 && leg.for_s >= 1.0 && leg.for_s <= LONGEST_S);
            if bad {
                return Err(problem(
                    &format!("input.table[{index}]"),
                    format!(
                        "is {} °/s for {} s; it can be −2000 to 2000 °/s for 1 s and more",
                        leg.rate_dps, leg.for_s
                    ),
                ));
            }
        }
        Ok(())
    }

    /// The beat must fit a tick, and a run of it some minutes.
    fn check_beat(&self) -> Result<(), Problem> {
        if self.run.fidelity == Fidelity::Count {
            return Ok(());
        }
        const MOST_FRINGES_PER_TICK: f64 = 500.0;
        let table = self.input.table.iter().map(|leg| leg.rate_dps.abs() * 3600.0).fold(0.0, f64::max);
        let swing = std::f64::consts::TAU * self.dither.frequency_hz * self.dither.amplitude_arcsec;
        let rate = self.input_dph().abs() + table + swing;
        let fringes = rate / self.arcsec_per_fringe() * crate::TICK_S;
        if fringes > MOST_FRINGES_PER_TICK {
            return Err(problem(
                "run.fidelity",
                format!(
                    "beat: up to {fringes:.0} fringes in a tick of 100 µs, {MOST_FRINGES_PER_TICK} can be followed; lower the rates or the dither"
                ),
            ));
        }
        const MOST_STEPS_PER_TICK: f64 = 1000.0;
        let steps = STEPS_PER_LIFETIME * self.intensity_rate() * crate::TICK_S;
        if self.run.beat_model == BeatModel::TwoMode && steps > MOST_STEPS_PER_TICK {
            return Err(problem(
                "cavity.loss_ppm",
                format!(
                    "is {}: the intensities follow so fast that a tick needs {steps:.0} steps, {MOST_STEPS_PER_TICK} can be made; less loss or gain_ratio, or run.beat_model = \"adler\"",
                    self.cavity.loss_ppm
                ),
            ));
        }
        Ok(())
    }

    /// The chamber's profile.
    ///
    /// # Errors
    /// No leg; a leg without length, too long, or to a temperature or at a rate that no chamber reaches.
    pub fn profile(&self) -> Result<Profile, Problem> {
        let mut legs = Vec::new();
        for (index, leg) in self.chamber.leg.iter().enumerate() {
            let key = format!("chamber.leg[{index}]");
            legs.push(match *leg {
                LegTable::Soak { soak_s } if (1.0..=LONGEST_S).contains(&soak_s) => Leg::Soak(soak_s),
                LegTable::Soak { soak_s } => {
                    return Err(problem(&key, format!("soaks for {soak_s} s; it can be 1 s to 10 years")));
                }
                LegTable::Ramp { to_c, rate_cpm }
                    if (-100.0..=150.0).contains(&to_c) && (0.001..=50.0).contains(&rate_cpm) =>
                {
                    Leg::Ramp(to_c, rate_cpm)
                }
                LegTable::Ramp { to_c, rate_cpm } => {
                    return Err(problem(
                        &key,
                        format!(
                            "ramps to {to_c} °C at {rate_cpm} °C/min; it can be −100 to 150 °C at 0.001 to 50 °C/min"
                        ),
                    ));
                }
            });
        }
        if legs.is_empty() {
            return Err(problem("chamber.leg", "is missing: give soaks and ramps, or one soak for a test at rest"));
        }
        let profile = Profile::new(self.chamber.start_c, &legs, self.chamber.cycles as u32);
        let length_s = profile.length_s();
        if length_s > LONGEST_S {
            return Err(problem("chamber.cycles", format!("make a test of {length_s} s; it can be 10 years")));
        }
        if length_s < self.run.interval_s {
            return Err(problem(
                "run.interval_s",
                format!("is {} s, longer than the test ({length_s} s)", self.run.interval_s),
            ));
        }
        Ok(profile)
    }

    /// There is a dither: a frequency and an amplitude.
    pub fn is_dithered(&self) -> bool {
        self.dither.frequency_hz > 0.0 && self.dither.amplitude_arcsec > 0.0
    }

    /// Rotation that makes one fringe, arcsec.
    pub fn arcsec_per_fringe(&self) -> f64 {
        physics::arcsec_per_fringe(self.geometry.shape, self.geometry.perimeter_m, self.geometry.wavelength_um * 1e-6)
    }

    /// Nominal scale factor, arcsec per count.
    pub fn arcsec_per_count(&self) -> f64 {
        self.arcsec_per_fringe() / self.readout.counting.per_fringe()
    }

    /// Lock-in threshold, °/h.
    pub fn lock_in_dph(&self) -> f64 {
        let c = &self.cavity;
        let r = [c.backscatter_1_ppm * 1e-6, c.backscatter_2_ppm * 1e-6];
        let epsilon = [c.backscatter_phase_1_deg.to_radians(), c.backscatter_phase_2_deg.to_radians()];
        physics::lock_in_dph(self.geometry.perimeter_m, self.arcsec_per_fringe(), r, epsilon)
    }

    /// All angle random walk: that of dithered lock-in and that given besides, °/√h.
    pub fn arw_deg_rt_h(&self) -> f64 {
        let d = &self.dither;
        let lock_in = if self.is_dithered() {
            physics::dithered_arw_deg_rt_h(
                self.lock_in_dph(),
                self.arcsec_per_fringe(),
                d.frequency_hz,
                d.amplitude_arcsec,
            )
        } else {
            0.0
        };
        libm::hypot(lock_in, self.noise.arw_deg_rt_h)
    }

    /// (c/2L)·α: how fast the intensities of the two modes settle, 1/s.
    pub(crate) fn intensity_rate(&self) -> f64 {
        let fsr = physics::free_spectral_range_hz(self.geometry.perimeter_m);
        0.5 * fsr * self.cavity.loss_ppm * 1e-6 * (self.cavity.gain_ratio - 1.0)
    }

    /// Constant input rate, °/h: the given one and the Earth's.
    pub fn input_dph(&self) -> f64 {
        let latitude = self.input.latitude_deg.to_radians();
        self.input.rate_dph
            + match self.input.direction {
                Direction::None => 0.0,
                Direction::Up => EARTH_RATE_DPH * libm::sin(latitude),
                Direction::North => EARTH_RATE_DPH * libm::cos(latitude),
            }
    }
}
