//! Checks of a scenario: every value against its range, and the rules between values.
//!
//! Only the first error found is reported. Rules that need a part of the gyro (whether a loop with these gains exists,
//! whether a beat fits a tick) are checked when that part is built.

use crate::physics;
use crate::profile::{Leg, Profile};
use crate::scenario::error::ScenarioError;
use crate::scenario::fault::FaultKind;
use crate::scenario::section::Section;
use crate::scenario::tables::{ChamberLeg, Fidelity, LoopModel};
use crate::scenario::{Scenario, TICK_S};

/// Longest test, s: 10 years.
const LONGEST_S: f64 = 315_360_000.0;
/// Most thermometers of a log.
const MOST_THERMOMETERS: usize = 32;

/// Checks the numbers of a table against their ranges.
fn check_ranges<S: Section>(section: &S, path: &str) -> Result<(), ScenarioError> {
    let numeric = S::KEYS.iter().filter_map(|key| key.range.map(|range| (key, range)));
    for ((key, (lo, hi)), value) in numeric.zip(section.numbers()) {
        let name = format!("{path}.{}", key.name);
        if value.is_nan() {
            return Err(ScenarioError::new(&name, format!("must be given: {}", key.text.trim())));
        }
        if !(lo..=hi).contains(&value) {
            let unit = if key.unit.is_empty() { String::new() } else { format!(" {}", key.unit) };
            return Err(ScenarioError::new(&name, format!("is {value}: give {lo} to {hi}{unit}")));
        }
    }
    Ok(())
}

/// The same for a list of tables.
fn check_list<S: Section>(list: &[S], path: &str) -> Result<(), ScenarioError> {
    list.iter().enumerate().try_for_each(|(index, section)| check_ranges(section, &format!("{path}[{index}]")))
}

fn check_whole(key: &str, value: f64) -> Result<(), ScenarioError> {
    let fits = value == libm::floor(value);
    if fits { Ok(()) } else { Err(ScenarioError::new(key, format!("is {value}: give a whole number"))) }
}

/// A leg of the chamber that a chamber can make.
fn chamber_leg(index: usize, leg: &ChamberLeg) -> Result<Leg, ScenarioError> {
    let refused = |message: String| Err(ScenarioError::new(&format!("chamber.leg[{index}]"), message));
    match *leg {
        ChamberLeg::Soak { soak_s } if (1.0..=LONGEST_S).contains(&soak_s) => Ok(Leg::Soak(soak_s)),
        ChamberLeg::Soak { soak_s } => refused(format!("soaks for {soak_s} s: give 1 s to 10 years")),
        ChamberLeg::Ramp { to_c, rate_cpm }
            if (-100.0..=150.0).contains(&to_c) && (0.001..=50.0).contains(&rate_cpm) =>
        {
            Ok(Leg::Ramp(to_c, rate_cpm))
        }
        ChamberLeg::Ramp { to_c, rate_cpm } => {
            refused(format!("ramps to {to_c} °C at {rate_cpm} °C/min: give −100 to 150 °C at 0.001 to 50 °C/min"))
        }
    }
}

impl Scenario {
    /// Checks every value and the rules between them. [`Self::build`] does it as well.
    ///
    /// # Errors
    /// The first value that is refused, with its key.
    pub fn check(&self) -> Result<(), ScenarioError> {
        self.check_tables()?;
        self.check_text()?;
        self.check_whole_numbers()?;
        self.check_interval()?;
        self.check_thermometers()?;
        self.check_rate_table()?;
        let length_s = self.profile()?.length_s();
        self.check_faults(length_s)?;
        self.check_one_mode()?;
        self.check_dither()
    }

    fn check_tables(&self) -> Result<(), ScenarioError> {
        // Exhaustive, so that a new table cannot be forgotten.
        let Self {
            name: _,
            description: _,
            seed: _,
            run,
            geometry,
            cavity,
            dither,
            readout,
            block,
            bias,
            scale_factor,
            path_length,
            intensity,
            noise,
            thermometer,
            electronics,
            chamber,
            input,
            fault,
        } = self;
        check_ranges(run, "run")?;
        check_ranges(geometry, "geometry")?;
        check_ranges(cavity, "cavity")?;
        check_ranges(dither, "dither")?;
        check_ranges(readout, "readout")?;
        check_ranges(block, "block")?;
        check_ranges(bias, "bias")?;
        check_ranges(scale_factor, "scale_factor")?;
        check_ranges(path_length, "path_length")?;
        check_ranges(intensity, "intensity")?;
        check_ranges(noise, "noise")?;
        check_ranges(electronics, "electronics")?;
        check_ranges(chamber, "chamber")?;
        check_ranges(input, "input")?;
        check_list(thermometer, "thermometer")?;
        check_list(fault, "fault")
    }

    /// Names and descriptions are printed on terminals and pages.
    fn check_text(&self) -> Result<(), ScenarioError> {
        for (key, text) in [("name", &self.name), ("description", &self.description)] {
            if text.chars().any(char::is_control) {
                return Err(ScenarioError::new(key, "holds control characters: give one line of plain text"));
            }
        }
        Ok(())
    }

    fn check_whole_numbers(&self) -> Result<(), ScenarioError> {
        check_whole("chamber.cycles", self.chamber.cycles)?;
        check_whole("electronics.counter_bits", self.electronics.counter_bits)?;
        check_whole("intensity.ignition_tries", self.intensity.ignition_tries)?;
        for (index, leg) in self.input.table.iter().enumerate() {
            check_whole(&format!("input.table[{index}].for_s"), leg.for_s)?;
        }
        for (index, fault) in self.fault.iter().enumerate() {
            check_whole(&format!("fault[{index}].sensor"), fault.sensor)?;
        }
        if self.electronics.counter_bits == 1.0 {
            let message = "is 1: such a counter can hold no count. Give 2 or more, or 0 for unlimited";
            return Err(ScenarioError::new("electronics.counter_bits", message));
        }
        Ok(())
    }

    fn check_interval(&self) -> Result<(), ScenarioError> {
        let interval = self.run.interval_s;
        let whole = |value: f64| (value - libm::round(value)).abs() < 1e-9 * value;
        let ticks = interval / TICK_S;
        let fits = if interval >= 1.0 { whole(interval) } else { whole(1.0 / interval) && whole(ticks) };
        if fits {
            return Ok(());
        }
        let message = format!("is {interval}: give whole seconds, or 1/n of a second in whole ticks of 100 µs");
        Err(ScenarioError::new("run.interval_s", message))
    }

    fn check_thermometers(&self) -> Result<(), ScenarioError> {
        if self.thermometer.is_empty() {
            return Err(ScenarioError::new("thermometer", "is missing: a thermal test has at least one"));
        }
        if self.thermometer.len() > MOST_THERMOMETERS {
            let message = format!("is given {} times: give {MOST_THERMOMETERS} at most", self.thermometer.len());
            return Err(ScenarioError::new("thermometer", message));
        }
        for (index, one) in self.thermometer.iter().enumerate() {
            if one.lsb_c != 0.0 && one.lsb_c < 1e-6 {
                let message = format!("is {:e}: give 1e-6 °C or more, or 0 for unlimited", one.lsb_c);
                return Err(ScenarioError::new(&format!("thermometer[{index}].lsb_c"), message));
            }
            let refused = |message| Err(ScenarioError::new(&format!("thermometer[{index}].name"), message));
            if !one.name.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_') {
                return refused(format!("is `{}`: use small letters, digits and _", one.name));
            }
            if self.thermometer[..index].iter().any(|other| other.name == one.name) {
                return refused(format!("is `{}` again: give each thermometer a name of its own", one.name));
            }
        }
        Ok(())
    }

    fn check_rate_table(&self) -> Result<(), ScenarioError> {
        for (index, leg) in self.input.table.iter().enumerate() {
            let fits = leg.rate_dps.abs() <= 2000.0 && leg.for_s >= 1.0 && leg.for_s <= LONGEST_S;
            if !fits {
                let message =
                    format!("is {} °/s for {} s: give −2000 to 2000 °/s for 1 s or more", leg.rate_dps, leg.for_s);
                return Err(ScenarioError::new(&format!("input.table[{index}]"), message));
            }
        }
        Ok(())
    }

    /// A fault must happen within the test, to something that is there.
    fn check_faults(&self, length_s: f64) -> Result<(), ScenarioError> {
        for (index, fault) in self.fault.iter().enumerate() {
            let refused =
                |key: &str, message: String| Err(ScenarioError::new(&format!("fault[{index}].{key}"), message));
            if fault.at_s >= length_s {
                return refused("at_s", format!("is {} s, and the test ends at {length_s} s", fault.at_s));
            }
            if fault.for_s < 1.0 {
                return refused("for_s", format!("is {} s: give 1 s or more", fault.for_s));
            }
            if fault.sensor as usize >= self.thermometer.len() {
                let have = self.thermometer.len();
                return refused("sensor", format!("is {}: there are {have}, counted from 0", fault.sensor));
            }
            if fault.kind == FaultKind::DroppedSamples && fault.size > 1.0 {
                return refused("size", format!("is {}: give the fraction of dropped rows, up to 1", fault.size));
            }
            if fault.kind == FaultKind::ModeResetStorm && self.run.loops == LoopModel::Running {
                return refused("kind", "is mode_reset_storm, which needs run.loops = \"ideal\"".to_owned());
            }
        }
        Ok(())
    }

    /// The plant has one longitudinal mode: the next mode must stay below its threshold.
    fn check_one_mode(&self) -> Result<(), ScenarioError> {
        let off = physics::free_spectral_range_hz(self.geometry.perimeter_m) / (self.cavity.gain_width_mhz * 1e6);
        let next = self.cavity.gain_ratio * physics::gain_line(off);
        if next < 1.0 {
            return Ok(());
        }
        let message = format!(
            "is {}: with this perimeter the next longitudinal mode has {next:.2} times the gain it needs and lases too, and this simulator has one mode. Give a lower gain or a shorter path",
            self.cavity.gain_ratio
        );
        Err(ScenarioError::new("cavity.gain_ratio", message))
    }

    /// The law of the dithered angle random walk needs many fringes per swing, and dither noise.
    fn check_dither(&self) -> Result<(), ScenarioError> {
        let d = &self.dither;
        if !self.is_dithered() {
            return Ok(());
        }
        if d.frequency_hz < 20.0 {
            let message = format!("is {}: give 20 Hz or more, or 0 for no dither", d.frequency_hz);
            return Err(ScenarioError::new("dither.frequency_hz", message));
        }
        let fringes = d.amplitude_arcsec / self.arcsec_per_fringe();
        if fringes < 2.0 {
            let message = format!("is {fringes:.3} fringes: give 2 or more to overcome lock-in, or 0 for no dither");
            return Err(ScenarioError::new("dither.amplitude_arcsec", message));
        }
        if d.noise < 0.01 && self.run.fidelity == Fidelity::Count {
            let message = format!(
                "is {}: pure dither has dynamic lock-in zones, which only the beat level simulates. Give 0.01 or more, or run.fidelity = \"beat\"",
                d.noise
            );
            return Err(ScenarioError::new("dither.noise", message));
        }
        Ok(())
    }

    /// The temperature profile of the chamber.
    ///
    /// # Errors
    /// No leg; a leg without length, too long, or to a temperature or at a rate that no chamber reaches; a test shorter
    /// than a row or longer than 10 years.
    pub fn profile(&self) -> Result<Profile, ScenarioError> {
        let legs = self.chamber.leg.iter().enumerate().map(|(index, leg)| chamber_leg(index, leg));
        let legs = legs.collect::<Result<Vec<Leg>, _>>()?;
        if legs.is_empty() {
            let message = "is missing: give soaks and ramps, or one soak for a test at rest";
            return Err(ScenarioError::new("chamber.leg", message));
        }
        let profile = Profile::new(self.chamber.start_c, &legs, self.chamber.cycles as u32);
        let length_s = profile.length_s();
        if length_s > LONGEST_S {
            let message = format!("make a test of {length_s} s: give 10 years at most");
            return Err(ScenarioError::new("chamber.cycles", message));
        }
        if length_s < self.run.interval_s {
            let message = format!("is {} s, longer than the test ({length_s} s)", self.run.interval_s);
            return Err(ScenarioError::new("run.interval_s", message));
        }
        Ok(profile)
    }
}
