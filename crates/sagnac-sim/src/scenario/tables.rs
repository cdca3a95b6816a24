//! The tables of a scenario file: what a person types, in Hz, V, s and °C.
//!
//! Each key has its default, range, unit and source in its declaration. Sources: `[S]` public sources; `[M]` general
//! knowledge of the field, not verified; both as marked in the project's domain notes; `[D]` a choice of this
//! simulator.

use serde::Deserialize;

use crate::physics::RingShape;
use crate::scenario::section::{REQUIRED, section};

/// Level of detail of the simulation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Fidelity {
    /// Counts per interval; for tests of days.
    Count,
    /// Phase of the beat, every 100 µs; for tests of minutes.
    Beat,
}

/// Equations of the beat.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BeatModel {
    /// One equation for the phase (Adler).
    Adler,
    /// Both intensities and the phase (Lamb, Aronowitz).
    TwoMode,
}

/// Model of the path-length and intensity loops.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum LoopModel {
    /// Ideal loops: no error and no delay inside the actuator's range.
    Ideal,
    /// The code of `sagnac-loops`, run every tick on a simulated plant.
    Running,
}

/// Counts per fringe.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CountsPerFringe {
    /// One.
    X1,
    /// Two.
    X2,
    /// Four.
    X4,
}

impl CountsPerFringe {
    /// As a number.
    pub fn per_fringe(self) -> f64 {
        match self {
            Self::X1 => 1.0,
            Self::X2 => 2.0,
            Self::X4 => 4.0,
        }
    }
}

/// Actuator of the path-length loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Actuator {
    /// Mirror on a piezo; unit V.
    Piezo,
    /// Heater on a prism or on the block; unit W.
    Heater,
}

/// Where a thermometer is mounted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SensorLocation {
    /// On the block.
    #[default]
    Block,
    /// Near the anode, which the discharge heats.
    Anode,
    /// In the chamber's air.
    Chamber,
}

/// Orientation of the input axis, for the Earth's rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AxisDirection {
    /// No Earth rate.
    None,
    /// Along the local vertical, upward.
    Up,
    /// True north.
    North,
}

section! {
    /// Level of detail and interval of the rows.
    RunConfig "run"
    numbers {
        /// Time between rows of the log: whole seconds, or a second divided by a whole number.
        interval_s = 1.0, 0.0001 ..= 1000.0, "s", "design: tick 100 µs, thermal tests at 1 s";
    }
    words {
        /// Level of detail: counts per interval (tests of days) or phase of the beat (minutes).
        fidelity: Fidelity = Fidelity::Count, "count, beat";
        /// Equations of the beat; not used at the count level.
        beat_model: BeatModel = BeatModel::Adler, "adler, two_mode";
        /// Loops: ideal, or their own code run every 100 µs.
        loops: LoopModel = LoopModel::Ideal, "ideal, running";
    }
}

section! {
    /// Geometry of the ring.
    GeometryConfig "geometry"
    numbers {
        /// Length of the closed light path.
        perimeter_m = REQUIRED, 0.02 ..= 20.0, "m", "16 and 28 cm in the domain notes §4";
        /// Wavelength in vacuum.
        wavelength_um = 0.63299, 0.3 ..= 2.0, "µm", "He-Ne, domain notes §1";
    }
    words {
        /// Shape of the ring.
        shape: RingShape = RingShape::Triangle, "triangle, square, circle";
    }
}

section! {
    /// Losses, gain and backscatter.
    CavityConfig "cavity"
    numbers {
        /// Loss of a round trip.
        loss_ppm = 300.0, 10.0 ..= 20000.0, "ppm", "[M]";
        /// Ratio of gain to loss at line centre and nominal current.
        gain_ratio = 1.5, 1.05 ..= 5.0, "", "[M]";
        /// Full width of the gain curve at half maximum.
        gain_width_mhz = 1500.0, 200.0 ..= 5000.0, "MHz", "[M] Doppler width of neon";
        /// Ratio of cross to self saturation, θ/β.
        cross_saturation = 0.5, 0.0 ..= 0.95, "", "[M] two isotopes keep it below 1";
        /// Field scattered from mode 1 into mode 2, as a fraction of mode 1 per round trip.
        backscatter_1_ppm = 0.3, 0.0 ..= 10.0, "ppm", "lock-in 50 to 1000 °/h [M]";
        /// Field scattered from mode 2 into mode 1.
        backscatter_2_ppm = 0.3, 0.0 ..= 10.0, "ppm", "lock-in 50 to 1000 °/h [M]";
        /// Phase ε₁ of the scattering from mode 1.
        backscatter_phase_1_deg = 40.0, -360.0 ..= 360.0, "deg", "any";
        /// Phase ε₂ of the scattering from mode 2.
        backscatter_phase_2_deg = 40.0, -360.0 ..= 360.0, "deg", "any";
        /// Null shift per difference of the two arm currents.
        null_shift_dph_per_ma = 0.0, -100.0 ..= 100.0, "°/h per mA", "[M] Langmuir flow";
        /// Difference of the arm currents at the nominal current; proportional to the current.
        current_imbalance_ma = 0.0, -1.0 ..= 1.0, "mA", "[M]";
    }
    words {}
}

section! {
    /// Mechanical dither.
    DitherConfig "dither"
    numbers {
        /// Frequency at 25 °C; 0 for no dither.
        frequency_hz = 0.0, 0.0 ..= 2000.0, "Hz", "300 to 600 [M], 406 to 463 in firmware [S]";
        /// Change of the frequency with block temperature.
        frequency_ppm_per_c = 0.0, -1000.0 ..= 1000.0, "ppm/°C", "[M] stiffness of the spring";
        /// Amplitude.
        amplitude_arcsec = 150.0, 0.0 ..= 1000.0, "arcsec", "40 to 200 [M]";
        /// Random change of the amplitude between half cycles, relative standard deviation.
        noise = 0.1, 0.0 ..= 0.3, "", "[M]; 0 keeps dynamic lock-in zones";
    }
    words {}
}

section! {
    /// Photodiodes and counter.
    ReadoutConfig "readout"
    numbers {
        /// Deviation of the spacing of the photodiodes from a quarter fringe.
        phase_error_deg = 0.0, -45.0 ..= 45.0, "deg", "[D]";
        /// Noise of the dither pickoff, standard deviation.
        pickoff_noise_arcsec = 0.0, 0.0 ..= 10.0, "arcsec", "[D]";
    }
    words {
        /// Counts per fringe.
        counting: CountsPerFringe = CountsPerFringe::X4, "x4, x2, x1";
    }
}

section! {
    /// The block: thermal expansion and thermal lag.
    BlockConfig "block"
    numbers {
        /// Coefficient of thermal expansion at 25 °C.
        expansion_ppm_per_c = 0.05, -10.0 ..= 20.0, "ppm/°C", "glass-ceramic ±0.02, 0.05, 0.10 by class [S]";
        /// Change of the coefficient with temperature.
        expansion_bend_ppm_per_c2 = 0.0, -0.1 ..= 0.1, "ppm/°C²", "[M]";
        /// Time constant of the block relative to the chamber.
        lag_s = 1200.0, 1.0 ..= 100000.0, "s", "20 min in the domain notes §2";
        /// Time constant of the region near the anode.
        anode_lag_s = 700.0, 1.0 ..= 100000.0, "s", "[D]";
        /// Steady temperature rise of that region by the discharge.
        anode_heat_c = 2.0, 0.0 ..= 30.0, "°C", "[D]";
    }
    words {}
}

section! {
    /// Bias by cause. None of it is a polynomial in a thermometer's reading.
    BiasConfig "bias"
    numbers {
        /// Fixed bias.
        fixed_dph = 0.0, -100.0 ..= 100.0, "°/h", "any";
        /// Sensitivity to block temperature, from 25 °C.
        slope_dph_per_c = 0.0005, -1.0 ..= 1.0, "°/h/°C", "0.0005 to 0.005 [M]";
        /// Height of a knee, knee·tanh((T − knee_c)/knee_width_c).
        knee_dph = 0.0, -10.0 ..= 10.0, "°/h", "[D] not a polynomial";
        /// Centre of the knee.
        knee_c = 15.0, -100.0 ..= 150.0, "°C", "[D]";
        /// Width of the knee.
        knee_width_c = 25.0, 1.0 ..= 200.0, "°C", "[D]";
        /// Sensitivity to the temperature rate of the block.
        rate_dph_per_cpm = 0.0, -1.0 ..= 1.0, "°/h per °C/min", "0.005 to 0.05 [M]";
        /// Sensitivity to the temperature difference between anode and block, relative to its steady value.
        gradient_dph_per_c = 0.0, -1.0 ..= 1.0, "°/h/°C", "[M]";
        /// Half the difference between heating and cooling.
        hysteresis_dph = 0.0, 0.0 ..= 1.0, "°/h", "[M]";
        /// Temperature change after a reversal over which the hysteresis changes sign.
        hysteresis_width_c = 10.0, 0.1 ..= 200.0, "°C", "[D]";
        /// Step between adjacent modes, alternating in sign.
        mode_step_dph = 0.0, 0.0 ..= 1.0, "°/h", "0.001 to 0.05 [M]";
        /// Amplitude of a ripple in the actuator's path, with a period of two modes.
        ripple_dph = 0.0, 0.0 ..= 1.0, "°/h", "period: US5438410 [S]; size [M]";
        /// First warm-up component.
        warm_up_1_dph = 0.0, -10.0 ..= 10.0, "°/h", "[M]";
        /// Time constant of the first warm-up component.
        warm_up_1_s = 180.0, 1.0 ..= 100000.0, "s", "1 to 5 min [M]";
        /// Second warm-up component.
        warm_up_2_dph = 0.0, -10.0 ..= 10.0, "°/h", "[M]";
        /// Time constant of the second warm-up component.
        warm_up_2_s = 1500.0, 1.0 ..= 100000.0, "s", "15 to 40 min [M]";
    }
    words {}
}

section! {
    /// Scale-factor errors. The steps of 1/m at mode changes follow from the geometry and have no key.
    ScaleFactorConfig "scale_factor"
    numbers {
        /// Change with the path set by the actuator: slope of the sawtooth.
        actuator_ppm_per_wave = 0.0, -100.0 ..= 100.0, "ppm", "[M] uniform expansion alone changes nothing";
    }
    words {}
}

section! {
    /// Path-length control. The actuator's unit is V (piezo) or W (heater).
    PathLengthControlConfig "path_length"
    numbers {
        /// Lower limit of the actuator.
        range_low = -150.0, -10000.0 ..= 10000.0, "V or W", "[M] tens of volts per wavelength";
        /// Upper limit of the actuator.
        range_high = 150.0, -10000.0 ..= 10000.0, "V or W", "[M]";
        /// Path change per unit.
        waves_per_unit = 0.012, 0.000001 ..= 1000.0, "waves per V or W", "[M]";
        /// Resolution of the actuator's D/A converter.
        converter_bits = 18.0, 8.0 ..= 24.0, "bit", "[D]";
        /// Lag while the path grows.
        rising_lag_s = 0.0, 0.0 ..= 10000.0, "s", "a heater heats …";
        /// Lag while the path shrinks.
        falling_lag_s = 0.0, 0.0 ..= 10000.0, "s", "… and cools more slowly";
        /// Modulation frequency.
        modulation_hz = 1250.0, 0.1 ..= 2500.0, "Hz", "250 in heater firmware [S]; 1 to 10 kHz piezo [M]";
        /// Modulation amplitude.
        modulation_waves = 0.02, 0.0001 ..= 0.1, "waves", "[M]";
        /// Crossover frequency of the loop.
        bandwidth_hz = 20.0, 0.001 ..= 200.0, "Hz", "[D]";
        /// Phase margin, minimum.
        phase_margin_deg = 60.0, 20.0 ..= 120.0, "deg", "[D]";
        /// Distance from a limit at which a mode reset starts.
        reset_margin_waves = 0.3, 0.0 ..= 100.0, "waves", "[D]";
        /// Time a reset takes per wavelength.
        reset_s = 0.2, 0.0 ..= 10000.0, "s", "[D]";
        /// Settling time after a reset or a sweep.
        settle_s = 0.1, 0.0 ..= 10000.0, "s", "[D]";
        /// Duration of the search through one wavelength: at least eight of the lags above. 0 for no search, if there is
        /// light everywhere.
        sweep_s = 1.0, 0.0 ..= 10000.0, "s", "[D]";
        /// Detuning below which the loop counts as locked.
        lock_waves = 0.005, 0.00001 ..= 0.05, "waves", "[D]";
    }
    words {
        /// Actuator.
        actuator: Actuator = Actuator::Piezo, "piezo, heater";
    }
}

section! {
    /// Intensity control: discharge current or pump.
    IntensityControlConfig "intensity"
    numbers {
        /// Resolution of the photodiode's A/D converter.
        photodiode_bits = 20.0, 8.0 ..= 24.0, "bit", "[D]";
        /// Fraction of the converter's range used by the regulated light. The light at ignition must fit as well, or
        /// the search for the peak compares saturated readings.
        part_of_range = 0.4, 0.05 ..= 0.9, "", "[D]";
        /// Noise of a sample, standard deviation relative to the regulated light.
        noise = 0.0001, 0.0 ..= 0.01, "", "[D] shot noise of some µW";
        /// Nominal current, at 25 °C.
        nominal_ma = 1.0, 0.01 ..= 1000.0, "mA", "[M]";
        /// Minimum current.
        low_ma = 0.3, 0.0 ..= 1000.0, "mA", "[M]";
        /// Maximum current.
        high_ma = 2.0, 0.01 ..= 1000.0, "mA", "[M]";
        /// Exponent of gain over current: relative change of gain per relative change of current.
        gain_exponent = 0.7, 0.1 ..= 2.0, "", "[M]";
        /// Lag from current to light.
        lag_s = 0.001, 0.0 ..= 10.0, "s", "[M]";
        /// Maximum slew rate of the current.
        slew_ma_per_s = 5.0, 0.0001 ..= 100000.0, "mA/s", "[D]";
        /// Current during ignition.
        ignition_ma = 1.5, 0.01 ..= 1000.0, "mA", "[D]";
        /// Duration of one ignition attempt.
        ignition_s = 0.5, 0.0 ..= 1000.0, "s", "[D]";
        /// Pause between attempts.
        rest_s = 1.0, 0.0 ..= 1000.0, "s", "[D]";
        /// Ignition attempts after the first; then the loop stays off.
        ignition_tries = 10.0, 0.0 ..= 200.0, "", "[D]";
        /// Crossover frequency of the loop.
        bandwidth_hz = 10.0, 0.01 ..= 200.0, "Hz", "1 to 100 [M]";
        /// Phase margin, minimum.
        phase_margin_deg = 60.0, 20.0 ..= 120.0, "deg", "[D]";
        /// Relative growth of the losses from −40 to +70 °C.
        loss_growth = 0.0, -0.5 ..= 1.0, "", "30 % required of the loop";
        /// Light below this fraction of the set point is reported as low.
        low_part = 0.8, 0.05 ..= 1.0, "", "[D]";
    }
    words {}
}

section! {
    /// Noise. The angle random walk of dithered lock-in is added automatically.
    NoiseConfig "noise"
    numbers {
        /// Angle random walk N in addition to that of dithered lock-in.
        arw_deg_rt_h = 0.0, 0.0 ..= 10.0, "°/√h", "0.003 in the domain notes";
        /// Bias instability B; its Allan deviation is flat at 0.664 B.
        bias_instability_dph = 0.0, 0.0 ..= 100.0, "°/h", "domain notes §3";
        /// Rate random walk K.
        rate_random_walk_dph_rt_h = 0.0, 0.0 ..= 100.0, "°/h/√h", "domain notes §3";
        /// Rate ramp R.
        rate_ramp_dph_h = 0.0, -100.0 ..= 100.0, "°/h/h", "domain notes §3";
    }
    words {}
}

section! {
    /// A thermometer. Its column is `temperature_c_` and its name, or `temperature_c` if it has none.
    ThermometerConfig "thermometer"
    numbers {
        /// Time constant.
        lag_s = 0.0, 0.0 ..= 10000.0, "s", "[D]";
        /// Noise of a reading, standard deviation.
        noise_c = 0.0, 0.0 ..= 10.0, "°C", "[D]";
        /// Resolution; 0 for unlimited.
        lsb_c = 0.0625, 0.0 ..= 10.0, "°C", "0.0625 in the domain notes §2";
        /// Offset of the readings.
        offset_c = 0.0, -100.0 ..= 100.0, "°C", "[D]";
    }
    words {
        /// Name in the header; one thermometer may have none.
        name: String = String::new(), "letters, digits, _";
        /// Where it is mounted.
        at: SensorLocation = SensorLocation::Block, "block, anode, chamber";
    }
}

section! {
    /// Electronics: the oscillator of the counter and of the log's time, and the width of the counter.
    ElectronicsConfig "electronics"
    numbers {
        /// Rate error of the clock; positive is fast.
        clock_ppm = 0.0, -1000.0 ..= 1000.0, "ppm", "[D]";
        /// Change of the rate error with block temperature, from 25 °C.
        clock_ppm_per_c = 0.0, -10.0 ..= 10.0, "ppm/°C", "[D]";
        /// Width of the counter, which saturates within a row; 0 for unlimited.
        counter_bits = 0.0, 0.0 ..= 63.0, "bit", "[D]";
    }
    words {}
}

/// A leg of the chamber's profile: a soak or a ramp.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(untagged, deny_unknown_fields, expecting = "a leg is { soak_s = … } or { to_c = …, rate_cpm = … }")]
pub enum ChamberLeg {
    /// Hold the temperature.
    Soak {
        /// Duration, s.
        soak_s: f64,
    },
    /// Change the temperature.
    Ramp {
        /// End temperature, °C.
        to_c: f64,
        /// Rate, °C/min, positive in both directions.
        rate_cpm: f64,
    },
}

section! {
    /// The thermal chamber.
    ChamberConfig "chamber"
    numbers {
        /// Temperature of chamber and block at the start.
        start_c = 25.0, -100.0 ..= 150.0, "°C", "−40 … +70 in the domain notes §5";
        /// Number of passes through the legs.
        cycles = 1.0, 1.0 ..= 10000.0, "", "at least 3 in a thermal test, domain notes §5";
    }
    words {
        /// Whether the gyro is switched on at the start; otherwise it is warm.
        cold_start: bool = false, "false, true";
        /// Legs: soaks { soak_s } and ramps { to_c, rate_cpm }.
        leg: Vec<ChamberLeg> = Vec::new(), "list";
    }
}

/// A dwell of the rate table at one rate.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RateTableLeg {
    /// Rate of the table, °/s.
    pub rate_dps: f64,
    /// Duration, s.
    pub for_s: f64,
}

section! {
    /// Input rate: a constant, the Earth's rate, and a rate table.
    InputConfig "input"
    numbers {
        /// Constant rate.
        rate_dph = 0.0, -3600000.0 ..= 3600000.0, "°/h", "any";
        /// Geodetic latitude.
        latitude_deg = 0.0, -90.0 ..= 90.0, "deg", "17.4 in the domain notes §1";
    }
    words {
        /// Orientation of the input axis, for the Earth's rate.
        direction: AxisDirection = AxisDirection::None, "none, up, north";
        /// Rate table: { rate_dps, for_s }, repeated.
        table: Vec<RateTableLeg> = Vec::new(), "list";
    }
}
