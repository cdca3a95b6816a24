//! The loops over a second: ideal, or their own code on the plant.

use crate::fault::FaultKind;
use crate::plant::{Design, Running, SecondOfLoops};
use crate::scenario::Scenario;
use crate::scenario::tables::Loops;

/// What path length and intensity did over a second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LoopsSecond {
    /// Actuator, V or W.
    pub actuator: f64,
    /// Peak of the gain the cavity sits on, counted from the one at 25 °C with the actuator at 0.
    pub mode: i64,
    /// Light; 1 is regulated.
    pub light: f64,
    /// Current, mA.
    pub current_ma: f64,
    /// Locked and lit throughout.
    pub valid: bool,
}

/// Loops that do what they are for at once, or the running ones.
#[derive(Clone, Debug)]
pub(crate) enum Control {
    Ideal(Ideal),
    Running(Box<Running>),
}

/// Path length at a peak, light at 1, until an actuator ends.
#[derive(Clone, Debug)]
pub(crate) struct Ideal {
    mode: Option<i64>,
    /// Seconds until counts are good again.
    invalid_s: f64,
    margin: f64,
    reset_s: f64,
    settle_s: f64,
}

impl Control {
    pub(crate) fn new(scenario: &Scenario, design: &Design, seed: u64) -> Self {
        let path = &scenario.path_length;
        match scenario.run.loops {
            Loops::Ideal => Self::Ideal(Ideal {
                mode: None,
                invalid_s: if scenario.chamber.cold_start { path.sweep_s + path.settle_s } else { 0.0 },
                margin: path.reset_margin_waves / path.waves_per_unit,
                reset_s: path.reset_s,
                settle_s: path.settle_s,
            }),
            Loops::Running => Self::Running(Box::new(Running::new(design, seed))),
        }
    }

    /// A second at a block temperature that goes from one value to another.
    pub(crate) fn second(
        &mut self,
        design: &Design,
        block_c: [f64; 2],
        fault: Option<(FaultKind, f64)>,
    ) -> LoopsSecond {
        let plant = &design.plant;
        let thermal = block_c.map(|t| plant.thermal_waves(t));
        let loss = block_c.map(|t| plant.loss(t));
        let dark = matches!(fault, Some((FaultKind::PumpFailure, _)));
        match self {
            Self::Ideal(ideal) => ideal.second(design, thermal[1], loss[1], fault),
            Self::Running(running) => {
                // A lost lock is a path that jumps under the loop each second, by more than it can take for drift.
                let jumps =
                    |(kind, since)| if kind == FaultKind::LockLoss { 0.37 * libm::floor(since * 7.0) } else { 0.0 };
                let jump = fault.map_or(0.0, jumps);
                const TICKS: u32 = 10_000;
                let SecondOfLoops { actuator, light, current_ma, invalid_ticks, .. } =
                    running.stretch(TICKS, [thermal[0] + jump, thermal[1] + jump], loss, dark);
                let mode = libm::round(thermal[1] + jump + actuator * plant.waves_per_unit) as i64;
                LoopsSecond { actuator, mode, light, current_ma, valid: invalid_ticks == 0 }
            }
        }
    }
}

impl Ideal {
    fn second(
        &mut self,
        design: &Design,
        thermal_waves: f64,
        loss: f64,
        fault: Option<(FaultKind, f64)>,
    ) -> LoopsSecond {
        let plant = &design.plant;
        let [low, high] = plant.range;
        let middle = f64::midpoint(low, high);
        let nearest_middle = || libm::round(thermal_waves + middle * plant.waves_per_unit) as i64;
        let unit = |mode: i64| (mode as f64 - thermal_waves) / plant.waves_per_unit;
        let mut mode = *self.mode.get_or_insert_with(nearest_middle);
        if unit(mode) <= low + self.margin || unit(mode) >= high - self.margin {
            let to = nearest_middle();
            self.invalid_s = self.reset_s * (to - mode).unsigned_abs() as f64 + self.settle_s;
            mode = to;
            self.mode = Some(to);
        }
        let current_ma = plant.holding_ma(loss).clamp(plant.range_ma[0], plant.range_ma[1]);
        let mut out = LoopsSecond {
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
        out.valid &= self.invalid_s <= 0.0;
        self.invalid_s -= 1.0;
        out
    }

    /// A reset that nothing called for, there and back in turn.
    pub(crate) fn storm(&mut self, to: i64) {
        let Some(mode) = self.mode else { return };
        self.invalid_s = self.reset_s + self.settle_s;
        self.mode = Some(mode + to);
    }
}
