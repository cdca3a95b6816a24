//! The loops over a second: ideal, or their own code on the plant.
//!
//! Ideal loops hold the path on a peak and the light at 1 without error or delay, as long as the actuators' ranges
//! last. Near a limit they reset to the mode nearest to the middle; counts are invalid for the time this takes.

use crate::plant::{LoopDesign, LoopState};
use crate::scenario::{FaultKind, LoopModel, Scenario, ScenarioError};

/// Ticks in a second.
const TICKS_PER_S: u32 = 10_000;

/// Path length and intensity over a second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct LoopSecond {
    /// Actuator, V or W.
    pub actuator: f64,
    /// Mode: the gain peak in use, counted from that at 25 °C with the actuator at 0.
    pub mode: i64,
    /// Light; 1 is regulated.
    pub light: f64,
    /// Current, mA.
    pub current_ma: f64,
    /// Locked, with light, throughout the second.
    pub valid: bool,
}

/// Both loops as built.
#[derive(Clone, Debug)]
pub(crate) struct Loops {
    design: LoopDesign,
    model: LoopModel,
    ideal: Ideal,
}

/// Memory of the loops, by model.
#[derive(Clone, Debug)]
pub(crate) enum LoopsState {
    Ideal(IdealState),
    Running(Box<LoopState>),
}

/// Constants of ideal loops.
#[derive(Clone, Debug)]
struct Ideal {
    /// Distance from a limit at which a reset starts, in units of the actuator.
    margin: f64,
    reset_s: f64,
    settle_s: f64,
    /// Time to the first lock.
    first_lock_s: f64,
}

#[derive(Clone, Debug)]
pub(crate) struct IdealState {
    mode: Option<i64>,
    /// Time until counts are valid again.
    invalid_s: f64,
}

impl Loops {
    pub(crate) fn build(scenario: &Scenario) -> Result<Self, ScenarioError> {
        let path = &scenario.path_length;
        let ideal = Ideal {
            margin: path.reset_margin_waves / path.waves_per_unit,
            reset_s: path.reset_s,
            settle_s: path.settle_s,
            first_lock_s: if scenario.chamber.cold_start { path.sweep_s + path.settle_s } else { 0.0 },
        };
        Ok(Self { design: LoopDesign::build(scenario)?, model: scenario.run.loops, ideal })
    }

    pub(crate) fn design(&self) -> &LoopDesign {
        &self.design
    }

    pub(crate) fn start(&self, seed: u64) -> LoopsState {
        match self.model {
            LoopModel::Ideal => LoopsState::Ideal(IdealState { mode: None, invalid_s: self.ideal.first_lock_s }),
            LoopModel::Running => LoopsState::Running(Box::new(self.design.start(seed))),
        }
    }

    /// A second while the block goes from one temperature to another. A fault is given with the time since its start.
    pub(crate) fn second(
        &self,
        state: &mut LoopsState,
        block_c: [f64; 2],
        fault: Option<(FaultKind, f64)>,
    ) -> LoopSecond {
        match state {
            LoopsState::Ideal(ideal) => self.ideal_second(ideal, block_c[1], fault),
            LoopsState::Running(running) => self.running_second(running, block_c, fault),
        }
    }

    /// A mode reset without cause; ideal loops only.
    pub(crate) fn force_reset(&self, state: &mut LoopsState, by: i64) {
        let LoopsState::Ideal(IdealState { mode: Some(mode), invalid_s }) = state else { return };
        *invalid_s = self.ideal.reset_s + self.ideal.settle_s;
        *mode += by;
    }

    fn running_second(&self, state: &mut LoopState, block_c: [f64; 2], fault: Option<(FaultKind, f64)>) -> LoopSecond {
        let plant = &self.design.plant;
        // A lost lock: the path jumps each second, by more than the loop can follow as drift.
        let jump_waves = match fault {
            Some((FaultKind::LockLoss, since)) => 0.37 * libm::floor(since * 7.0),
            _ => 0.0,
        };
        let mut conditions = self.design.conditions(block_c);
        conditions.thermal_waves = conditions.thermal_waves.map(|waves| waves + jump_waves);
        conditions.dark = matches!(fault, Some((FaultKind::PumpFailure, _)));
        let out = self.design.advance(state, TICKS_PER_S, &conditions);
        let mode = libm::round(conditions.thermal_waves[1] + out.actuator * plant.waves_per_unit) as i64;
        LoopSecond {
            actuator: out.actuator,
            mode,
            light: out.light,
            current_ma: out.current_ma,
            valid: out.invalid_ticks == 0,
        }
    }

    fn ideal_second(&self, state: &mut IdealState, block_c: f64, fault: Option<(FaultKind, f64)>) -> LoopSecond {
        let plant = &self.design.plant;
        let (thermal_waves, loss) = (plant.thermal_waves(block_c), plant.loss(block_c));
        let [low, high] = plant.range;
        let middle = f64::midpoint(low, high);
        let nearest_middle = || libm::round(thermal_waves + middle * plant.waves_per_unit) as i64;
        let unit = |mode: i64| (mode as f64 - thermal_waves) / plant.waves_per_unit;
        let mut mode = *state.mode.get_or_insert_with(nearest_middle);
        if unit(mode) <= low + self.ideal.margin || unit(mode) >= high - self.ideal.margin {
            let to = nearest_middle();
            state.invalid_s = self.ideal.reset_s * (to - mode).unsigned_abs() as f64 + self.ideal.settle_s;
            mode = to;
            state.mode = Some(to);
        }
        let current_ma = plant.holding_ma(loss).clamp(plant.range_ma[0], plant.range_ma[1]);
        let mut out = LoopSecond {
            actuator: unit(mode),
            mode,
            light: plant.light(0.0, plant.drive(current_ma), loss),
            current_ma,
            valid: true,
        };
        match fault {
            Some((FaultKind::PumpFailure, _)) => (out.light, out.current_ma, out.valid) = (0.0, 0.0, false),
            Some((FaultKind::LockLoss, _)) => (out.light, out.valid) = (0.5, false),
            _ => {}
        }
        out.valid &= state.invalid_s <= 0.0;
        state.invalid_s -= 1.0;
        out
    }
}
