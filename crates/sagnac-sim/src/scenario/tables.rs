//! The tables of a scenario. Sources: S public sources, M general knowledge of the field, not verified, both
//! as the project's domain notes mark them; D a choice of this simulator.

use serde::Deserialize;

use crate::physics::Shape;
use crate::scenario::section::{REQUIRED, section};

/// How much of the gyro is integrated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Fidelity {
    /// Counts per interval, for days.
    Count,
    /// The phase of the light itself, for minutes.
    Beat,
}

/// Equations of the beat.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BeatModel {
    /// One equation for the phase.
    Adler,
    /// Both intensities and the phase.
    TwoMode,
}

/// Whether the loops' code runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Loops {
    /// They do what they are for, at once.
    Ideal,
    /// `sagnac-loops` runs every tick on a simulated plant.
    Running,
}

/// Counts of a fringe.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Counting {
    /// One.
    X1,
    /// Two.
    X2,
    /// Four.
    X4,
}

impl Counting {
    /// As a number.
    pub fn per_fringe(self) -> f64 {
        match self {
            Self::X1 => 1.0,
            Self::X2 => 2.0,
            Self::X4 => 4.0,
        }
    }
}

/// What moves the path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Actuator {
    /// A mirror on a piezo; its unit is V.
    Piezo,
    /// A heater on a prism or the block; its unit is W.
    Heater,
}

/// Where a thermometer sits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Place {
    /// On the block.
    #[default]
    Block,
    /// Near the anode, where the discharge heats.
    Anode,
    /// In the chamber's air.
    Chamber,
}

/// Where the input axis points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Direction {
    /// Nothing of the Earth's rate.
    None,
    /// Away from the Earth's centre.
    Up,
    /// True north.
    North,
}

section! {
    /// What is integrated, and how often a row is written.
    Run "run"
    numbers {
        /// Time between rows of the log; whole seconds, or a second divided by a whole number.
        interval_s = 1.0, 0.0001 ..= 1000.0, "s", "design: tick 100 µs, thermal tests at 1 s";
    }
    words {
        /// Counts for days, or the phase of the light for minutes.
        fidelity: Fidelity = Fidelity::Count, "count, beat";
        /// Equations of the beat; without a meaning at the count level.
        beat_model: BeatModel = BeatModel::Adler, "adler, two_mode";
        /// Whether the loops' own code runs every 100 µs, or just does what it is for.
        loops: Loops = Loops::Ideal, "ideal, running";
    }
}

section! {
    /// The light's path.
    Geometry "geometry"
    numbers {
        /// Length once round.
        perimeter_m = REQUIRED, 0.02 ..= 20.0, "m", "16 and 28 cm in the domain notes §4";
        /// Wavelength in vacuum.
        wavelength_um = 0.63299, 0.3 ..= 2.0, "µm", "He-Ne, domain notes §1";
    }
    words {
        /// Shape of the path.
        shape: Shape = Shape::Triangle, "triangle, square, circle";
    }
}

section! {
    /// Losses, gain and backscatter.
    Cavity "cavity"
    numbers {
        /// Loss of a round trip.
        loss_ppm = 300.0, 10.0 ..= 20000.0, "ppm", "[M]";
        /// Gain over loss at the peak, at the nominal current.
        gain_ratio = 1.5, 1.05 ..= 5.0, "", "[M]";
        /// Full width of the gain curve at half height.
        gain_width_mhz = 1500.0, 200.0 ..= 5000.0, "MHz", "[M] Doppler width of neon";
        /// Cross over self saturation, θ/β.
        cross_saturation = 0.5, 0.0 ..= 0.95, "", "[M] two isotopes keep it below 1";
        /// Field that mode 1 sends into mode 2, of its own per round trip.
        backscatter_1_ppm = 0.3, 0.0 ..= 10.0, "ppm", "lock-in 50 to 1000 °/h [M]";
        /// Field that mode 2 sends into mode 1.
        backscatter_2_ppm = 0.3, 0.0 ..= 10.0, "ppm", "lock-in 50 to 1000 °/h [M]";
        /// Phase ε₁ of the first.
        backscatter_phase_1_deg = 40.0, -360.0 ..= 360.0, "deg", "any";
        /// Phase ε₂ of the second.
        backscatter_phase_2_deg = 40.0, -360.0 ..= 360.0, "deg", "any";
        /// Null shift of a current that is not the same in both arms.
        null_shift_dph_per_ma = 0.0, -100.0 ..= 100.0, "°/h per mA", "[M] Langmuir flow";
        /// That difference at the nominal current; it grows with the current.
        current_imbalance_ma = 0.0, -1.0 ..= 1.0, "mA", "[M]";
    }
    words {}
}

section! {
    /// Mechanical dither.
    Dither "dither"
    numbers {
        /// Frequency at 25 °C; 0 for none.
        frequency_hz = 0.0, 0.0 ..= 2000.0, "Hz", "300 to 600 [M], 406 to 463 in firmware [S]";
        /// Its change with block temperature.
        frequency_ppm_per_c = 0.0, -1000.0 ..= 1000.0, "ppm/°C", "[M] stiffness of the spring";
        /// Amplitude.
        amplitude_arcsec = 150.0, 0.0 ..= 1000.0, "arcsec", "40 to 200 [M]";
        /// Random change of the amplitude from one swing to the next, σ of its part.
        noise = 0.1, 0.0 ..= 0.3, "", "[M]; 0 leaves dynamic lock-in zones";
    }
    words {}
}

section! {
    /// Photodiodes and counter.
    Readout "readout"
    numbers {
        /// How far from a quarter of a fringe the photodiodes are apart.
        phase_error_deg = 0.0, -45.0 ..= 45.0, "deg", "[D]";
        /// Noise of the dither pickoff.
        pickoff_noise_arcsec = 0.0, 0.0 ..= 10.0, "arcsec", "[D]";
    }
    words {
        /// Counts of a fringe.
        counting: Counting = Counting::X4, "x4, x2, x1";
    }
}

section! {
    /// The block and how it follows the chamber.
    Block "block"
    numbers {
        /// Expansion at 25 °C.
        expansion_ppm_per_c = 0.05, -10.0 ..= 20.0, "ppm/°C", "glass-ceramic ±0.02, 0.05, 0.10 by class [S]";
        /// Its change with temperature.
        expansion_bend_ppm_per_c2 = 0.0, -0.1 ..= 0.1, "ppm/°C²", "[M]";
        /// Time constant towards the chamber.
        lag_s = 1200.0, 1.0 ..= 100000.0, "s", "20 min in the domain notes §2";
        /// Time constant of the place near the anode.
        anode_lag_s = 700.0, 1.0 ..= 100000.0, "s", "[D]";
        /// How much the discharge warms that place.
        anode_heat_c = 2.0, 0.0 ..= 30.0, "°C", "[D]";
    }
    words {}
}

section! {
    /// Bias and where it comes from. None of it is a polynomial of a thermometer's reading.
    Bias "bias"
    numbers {
        /// Without any cause below.
        fixed_dph = 0.0, -100.0 ..= 100.0, "°/h", "any";
        /// With block temperature from 25 °C.
        slope_dph_per_c = 0.0005, -1.0 ..= 1.0, "°/h/°C", "0.0005 to 0.005 [M]";
        /// Height of a knee: knee·tanh((T − knee_c)/knee_width_c).
        knee_dph = 0.0, -10.0 ..= 10.0, "°/h", "[D] not a polynomial";
        /// Middle of the knee.
        knee_c = 15.0, -100.0 ..= 150.0, "°C", "[D]";
        /// Width of the knee.
        knee_width_c = 25.0, 1.0 ..= 200.0, "°C", "[D]";
        /// With the block's own rate.
        rate_dph_per_cpm = 0.0, -1.0 ..= 1.0, "°/h per °C/min", "0.005 to 0.05 [M]";
        /// With the difference between anode and block, from that at rest.
        gradient_dph_per_c = 0.0, -1.0 ..= 1.0, "°/h/°C", "[M]";
        /// Half the distance between heating and cooling.
        hysteresis_dph = 0.0, 0.0 ..= 1.0, "°/h", "[M]";
        /// Turn of temperature over which it changes sides.
        hysteresis_width_c = 10.0, 0.1 ..= 200.0, "°C", "[D]";
        /// Step from one mode to the next; the next one takes it back.
        mode_step_dph = 0.0, 0.0 ..= 1.0, "°/h", "0.001 to 0.05 [M]";
        /// Ripple with the actuator, periodic over two modes.
        ripple_dph = 0.0, 0.0 ..= 1.0, "°/h", "period: US5438410 [S]; size [M]";
        /// First warm-up term.
        warm_up_1_dph = 0.0, -10.0 ..= 10.0, "°/h", "[M]";
        /// Its time constant.
        warm_up_1_s = 180.0, 1.0 ..= 100000.0, "s", "1 to 5 min [M]";
        /// Second warm-up term.
        warm_up_2_dph = 0.0, -10.0 ..= 10.0, "°/h", "[M]";
        /// Its time constant.
        warm_up_2_s = 1500.0, 1.0 ..= 100000.0, "s", "15 to 40 min [M]";
    }
    words {}
}

section! {
    /// Scale factor besides the geometry: steps of 1/m with the mode come by themselves.
    ScaleFactor "scale_factor"
    numbers {
        /// Change with the path the actuator makes up for: the sawtooth's slope.
        actuator_ppm_per_wave = 0.0, -100.0 ..= 100.0, "ppm", "[M] uniform expansion alone changes nothing";
    }
    words {}
}

section! {
    /// Path-length control. Units of the actuator are V (piezo) or W (heater).
    PathLengthTable "path_length"
    numbers {
        /// Lower end of the actuator's range.
        range_low = -150.0, -10000.0 ..= 10000.0, "V or W", "[M] tens of volts per wavelength";
        /// Upper end.
        range_high = 150.0, -10000.0 ..= 10000.0, "V or W", "[M]";
        /// Path per unit.
        waves_per_unit = 0.012, 0.000001 ..= 1000.0, "waves per V or W", "[M]";
        /// Converter of the actuator.
        converter_bits = 18.0, 8.0 ..= 24.0, "bit", "[D]";
        /// Lag when the path grows.
        rising_lag_s = 0.0, 0.0 ..= 10000.0, "s", "a heater heats";
        /// Lag when it shrinks.
        falling_lag_s = 0.0, 0.0 ..= 10000.0, "s", "… and cools more slowly";
        /// Modulation.
        modulation_hz = 1250.0, 0.1 ..= 2500.0, "Hz", "250 in heater firmware [S]; 1 to 10 kHz piezo [M]";
        /// Its amplitude.
        modulation_waves = 0.02, 0.0001 ..= 0.1, "waves", "[M]";
        /// Crossover of the loop.
        bandwidth_hz = 20.0, 0.001 ..= 200.0, "Hz", "[D]";
        /// Phase margin, at least.
        phase_margin_deg = 60.0, 20.0 ..= 120.0, "deg", "[D]";
        /// A reset happens this far from an end of the range.
        reset_margin_waves = 0.3, 0.0 ..= 100.0, "waves", "[D]";
        /// Time in which a reset goes one wavelength.
        reset_s = 0.2, 0.0 ..= 10000.0, "s", "[D]";
        /// Time the actuator is given to arrive.
        settle_s = 0.1, 0.0 ..= 10000.0, "s", "[D]";
        /// Time of the search through one wavelength: at least eight of the lags above. 0 for none, where there is light
        /// everywhere.
        sweep_s = 1.0, 0.0 ..= 10000.0, "s", "[D]";
        /// Locked is within this of the peak.
        lock_waves = 0.005, 0.00001 ..= 0.05, "waves", "[D]";
    }
    words {
        /// What moves the path.
        actuator: Actuator = Actuator::Piezo, "piezo, heater";
    }
}

section! {
    /// Intensity control: discharge current, or pump.
    IntensityTable "intensity"
    numbers {
        /// Converter of the photodiode.
        photodiode_bits = 20.0, 8.0 ..= 24.0, "bit", "[D]";
        /// Part of its range the regulated light takes. What ignition makes must fit in as well, or the search for
        /// the brightest place is blind.
        part_of_range = 0.4, 0.05 ..= 0.9, "", "[D]";
        /// Noise of a reading, σ of the regulated light.
        noise = 0.0001, 0.0 ..= 0.01, "", "[D] shot noise of some µW";
        /// Current at 25 °C.
        nominal_ma = 1.0, 0.01 ..= 1000.0, "mA", "[M]";
        /// Least current.
        low_ma = 0.3, 0.0 ..= 1000.0, "mA", "[M]";
        /// Most current.
        high_ma = 2.0, 0.01 ..= 1000.0, "mA", "[M]";
        /// Change of the gain per change of the current, both as parts.
        gain_exponent = 0.7, 0.1 ..= 2.0, "", "[M]";
        /// Lag from current to light.
        lag_s = 0.001, 0.0 ..= 10.0, "s", "[M]";
        /// Fastest change of the current.
        slew_ma_per_s = 5.0, 0.0001 ..= 100000.0, "mA/s", "[D]";
        /// Current while igniting.
        ignition_ma = 1.5, 0.01 ..= 1000.0, "mA", "[D]";
        /// Longest try.
        ignition_s = 0.5, 0.0 ..= 1000.0, "s", "[D]";
        /// Pause between tries.
        rest_s = 1.0, 0.0 ..= 1000.0, "s", "[D]";
        /// Tries to ignite after the first; then it stays dark.
        ignition_tries = 10.0, 0.0 ..= 200.0, "", "[D]";
        /// Crossover of the loop.
        bandwidth_hz = 10.0, 0.01 ..= 200.0, "Hz", "1 to 100 [M]";
        /// Phase margin, at least.
        phase_margin_deg = 60.0, 20.0 ..= 120.0, "deg", "[D]";
        /// Growth of the losses from −40 to +70 °C.
        loss_growth = 0.0, -0.5 ..= 1.0, "", "30 % asked of the loop";
        /// Light below this part is called low.
        low_part = 0.8, 0.05 ..= 1.0, "", "[D]";
    }
    words {}
}

section! {
    /// Noise. The walk that dither makes of lock-in comes on top by itself.
    Noise "noise"
    numbers {
        /// Angle random walk besides that of dithered lock-in.
        arw_deg_rt_h = 0.0, 0.0 ..= 10.0, "°/√h", "0.003 in the domain notes";
        /// Bias instability B: its Allan deviation is flat at 0.664 B.
        bias_instability_dph = 0.0, 0.0 ..= 100.0, "°/h", "domain notes §3";
        /// Rate random walk K.
        rate_random_walk_dph_rt_h = 0.0, 0.0 ..= 100.0, "°/h/√h", "domain notes §3";
        /// Rate ramp R.
        rate_ramp_dph_h = 0.0, -100.0 ..= 100.0, "°/h/h", "domain notes §3";
    }
    words {}
}

section! {
    /// A thermometer; the first is the one of the header `temperature_c`.
    ThermometerTable "thermometer"
    numbers {
        /// Time constant.
        lag_s = 0.0, 0.0 ..= 10000.0, "s", "[D]";
        /// Noise of a reading.
        noise_c = 0.0, 0.0 ..= 10.0, "°C", "[D]";
        /// Step of a reading; 0 for none.
        lsb_c = 0.0625, 0.0 ..= 10.0, "°C", "0.0625 in the domain notes §2";
        /// What it reads too much.
        offset_c = 0.0, -100.0 ..= 100.0, "°C", "[D]";
    }
    words {
        /// Name in the header; the first may go without.
        name: String = String::new(), "letters, digits, _";
        /// Where it sits.
        at: Place = Place::Block, "block, anode, chamber";
    }
}

section! {
    /// Oscillator of the counter and of the log's time.
    Electronics "electronics"
    numbers {
        /// What the clock is fast by.
        clock_ppm = 0.0, -1000.0 ..= 1000.0, "ppm", "[D]";
        /// Its change with block temperature from 25 °C.
        clock_ppm_per_c = 0.0, -10.0 ..= 10.0, "ppm/°C", "[D]";
        /// Width of the counter of a row; it stops at its ends. 0: wide enough.
        counter_bits = 0.0, 0.0 ..= 63.0, "bit", "[D]";
    }
    words {}
}

/// A leg of the chamber's profile: a soak, or a ramp.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(untagged, deny_unknown_fields, expecting = "a leg is { soak_s = … } or { to_c = …, rate_cpm = … }")]
pub enum LegTable {
    /// Stay.
    Soak {
        /// For so long.
        soak_s: f64,
    },
    /// Go.
    Ramp {
        /// To this temperature, °C.
        to_c: f64,
        /// At this rate, °C/min, positive.
        rate_cpm: f64,
    },
}

section! {
    /// The thermal chamber.
    Chamber "chamber"
    numbers {
        /// Temperature at the start, of the block too.
        start_c = 25.0, -100.0 ..= 150.0, "°C", "−40 … +70 in the domain notes §5";
        /// How often the legs are gone through.
        cycles = 1.0, 1.0 ..= 10000.0, "", "at least 3 in a thermal test, domain notes §5";
    }
    words {
        /// The gyro is switched on at the start; else it has been on for long.
        cold_start: bool = false, "false, true";
        /// Soaks { soak_s } and ramps { to_c, rate_cpm }.
        leg: Vec<LegTable> = Vec::new(), "list";
    }
}

/// A stretch of the rate table's profile.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TableLeg {
    /// Rate of the table, °/s.
    pub rate_dps: f64,
    /// For so long, s.
    pub for_s: f64,
}

section! {
    /// What the gyro is turned by.
    Input "input"
    numbers {
        /// A constant rate.
        rate_dph = 0.0, -3600000.0 ..= 3600000.0, "°/h", "any";
        /// Geodetic latitude.
        latitude_deg = 0.0, -90.0 ..= 90.0, "deg", "17.4 in the domain notes §1";
    }
    words {
        /// Where the input axis points, for the Earth's rate.
        direction: Direction = Direction::None, "none, up, north";
        /// Rate table: { rate_dps, for_s }, gone through again and again.
        table: Vec<TableLeg> = Vec::new(), "list";
    }
}
