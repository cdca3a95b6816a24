//! Chamber, block and thermometers.
//!
//! ```text
//! Ṫ_block = (T_chamber − T_block)/lag         Ṫ_anode = (T_chamber + heat − T_anode)/lag_anode
//! reading = LSB·round((T_lagged + offset + noise)/LSB)
//! ```
//!
//! One step a second, each node with its exact decay e^(−1 s/lag) towards the chamber's temperature at the end of the
//! second: right to a half of a second against lags of minutes. True while each place is one lump.

use rand_chacha::ChaCha8Rng;

use crate::noise::normal;
use crate::scenario::Scenario;
use crate::scenario::tables::Place;

/// One leg of the chamber's profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Leg {
    /// Stay for this many seconds.
    Soak(f64),
    /// Go to a temperature (°C) at this rate (°C/min, positive).
    Ramp(f64, f64),
}

/// The chamber's temperature over time: straight pieces of whole seconds, gone through again and again.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// The first time through begins at the start's temperature, all others where the one before ended.
    first: Vec<Piece>,
    again: Vec<Piece>,
    cycles: u32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Piece {
    start_s: f64,
    end_s: f64,
    from_c: f64,
    step_c: f64,
}

/// Legs one after the other from a temperature.
fn pieces(start_c: f64, legs: &[Leg]) -> Vec<Piece> {
    let mut pieces: Vec<Piece> = Vec::with_capacity(legs.len());
    let (mut now_s, mut now_c) = (0.0, start_c);
    for leg in legs {
        let (length_s, to_c) = match *leg {
            Leg::Soak(length_s) => (libm::floor(length_s).max(1.0), now_c),
            Leg::Ramp(to_c, rate_cpm) => (libm::floor((to_c - now_c).abs() / rate_cpm * 60.0).max(1.0), to_c),
        };
        let step_c = (to_c - now_c) / length_s;
        pieces.push(Piece { start_s: now_s, end_s: now_s + length_s, from_c: now_c, step_c });
        (now_s, now_c) = (now_s + length_s, to_c);
    }
    pieces
}

impl Piece {
    fn end_c(&self) -> f64 {
        self.from_c + self.step_c * (self.end_s - self.start_s)
    }
}

fn length_s(pieces: &[Piece]) -> f64 {
    pieces.last().map_or(0.0, |piece| piece.end_s)
}

impl Profile {
    /// Legs one after the other from a temperature, so many times.
    pub fn new(start_c: f64, legs: &[Leg], cycles: u32) -> Self {
        let first = pieces(start_c, legs);
        let again = pieces(first.last().map_or(start_c, Piece::end_c), legs);
        Self { first, again, cycles: cycles.max(1) }
    }

    /// Length of all, s.
    pub fn length_s(&self) -> f64 {
        length_s(&self.first) + f64::from(self.cycles - 1) * length_s(&self.again)
    }

    /// Temperature at a time, °C; at the ends that of the ends.
    pub fn at(&self, time_s: f64) -> f64 {
        let first_s = length_s(&self.first);
        if time_s <= first_s || self.cycles == 1 {
            return at(&self.first, time_s);
        }
        let again_s = length_s(&self.again);
        // The end of a cycle belongs to it.
        let cycle = (libm::ceil((time_s - first_s) / again_s) - 1.0).min(f64::from(self.cycles - 2));
        at(&self.again, time_s - first_s - cycle * again_s)
    }

    /// Lowest and highest temperature, °C.
    pub fn span_c(&self) -> [f64; 2] {
        let ends = self.first.iter().chain(&self.again).flat_map(|p| [p.from_c, p.end_c()]);
        ends.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], t| [lo.min(t), hi.max(t)])
    }
}

fn at(pieces: &[Piece], time_s: f64) -> f64 {
    let index = pieces.partition_point(|piece| piece.end_s < time_s);
    let piece = pieces.get(index).or(pieces.last());
    piece.map_or(0.0, |p| p.from_c + p.step_c * (time_s.min(p.end_s) - p.start_s).max(0.0))
}

/// A first-order lag, a step a second.
#[derive(Clone, Copy, Debug)]
struct Node {
    value: f64,
    keep: f64,
}

impl Node {
    fn new(value: f64, lag_s: f64) -> Self {
        Self { value, keep: if lag_s > 0.0 { libm::exp(-1.0 / lag_s) } else { 0.0 } }
    }

    fn follow(&mut self, target: f64) {
        self.value = target + (self.value - target) * self.keep;
    }
}

/// Temperatures of the gyro, advanced second by second.
#[derive(Clone, Debug)]
pub(crate) struct Thermal {
    profile: Profile,
    block: Node,
    anode: Node,
    anode_heat_c: f64,
    thermometers: Vec<Thermometer>,
    rng: ChaCha8Rng,
}

#[derive(Clone, Debug)]
struct Thermometer {
    at: Place,
    node: Node,
    noise_c: f64,
    lsb_c: f64,
    offset_c: f64,
}

/// Temperatures over a second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Temperatures {
    /// Air of the chamber at the end of the second, °C.
    pub chamber_c: f64,
    /// Mean of the block, °C.
    pub block_c: f64,
    /// Rate of the block, °C/min.
    pub block_cpm: f64,
    /// Place near the anode, °C.
    pub anode_c: f64,
    /// Anode less block, less what it is at rest, °C.
    pub gradient_c: f64,
}

impl Thermal {
    pub(crate) fn new(scenario: &Scenario, profile: Profile, rng: ChaCha8Rng) -> Self {
        let start_c = scenario.chamber.start_c;
        // A gyro that has been on for long is warm at its anode; a cold one is not yet.
        let heat = if scenario.chamber.cold_start { 0.0 } else { scenario.block.anode_heat_c };
        let thermometers = scenario.thermometer.iter().map(|t| Thermometer {
            at: t.at,
            node: Node::new(if t.at == Place::Anode { start_c + heat } else { start_c }, t.lag_s),
            noise_c: t.noise_c,
            lsb_c: t.lsb_c,
            offset_c: t.offset_c,
        });
        Self {
            profile,
            block: Node::new(start_c, scenario.block.lag_s),
            anode: Node::new(start_c + heat, scenario.block.anode_lag_s),
            anode_heat_c: scenario.block.anode_heat_c,
            thermometers: thermometers.collect(),
            rng,
        }
    }

    /// The second that ends at a time; readings at its end into `readings_c`.
    pub(crate) fn second(&mut self, end_s: f64, readings_c: &mut Vec<f64>) -> Temperatures {
        let chamber_c = self.profile.at(end_s);
        let before_c = self.block.value;
        self.block.follow(chamber_c);
        self.anode.follow(chamber_c + self.anode_heat_c);
        let (block_c, anode_c) = (self.block.value, self.anode.value);
        readings_c.clear();
        for t in &mut self.thermometers {
            let target = match t.at {
                Place::Block => block_c,
                Place::Anode => anode_c,
                Place::Chamber => chamber_c,
            };
            t.node.follow(target);
            let noise = if t.noise_c > 0.0 { normal(&mut self.rng) } else { 0.0 };
            let value = t.node.value + t.offset_c + t.noise_c * noise;
            readings_c.push(if t.lsb_c > 0.0 { libm::round(value / t.lsb_c) * t.lsb_c } else { value });
        }
        Temperatures {
            chamber_c,
            block_c: f64::midpoint(before_c, block_c),
            block_cpm: (block_c - before_c) * 60.0,
            anode_c,
            gradient_c: anode_c - block_c - self.anode_heat_c,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_profile_goes_where_it_is_told() {
        let legs = [Leg::Soak(600.0), Leg::Ramp(-40.0, 2.0), Leg::Soak(60.0)];
        let profile = Profile::new(20.0, &legs, 1);
        assert_eq!(profile.length_s(), 600.0 + 1800.0 + 60.0);
        let at = [-1.0, 600.0, 1500.0, 2400.0, 9999.0].map(|t| profile.at(t));
        assert_eq!(at, [20.0, 20.0, -10.0, -40.0, -40.0]);
        assert_eq!(profile.span_c(), [-40.0, 20.0]);
        // The second time begins where the first ended.
        let twice = Profile::new(20.0, &[Leg::Ramp(30.0, 1.0), Leg::Ramp(-40.0, 1.0)], 3);
        assert_eq!(twice.length_s(), 4800.0 + 2.0 * 8400.0);
        let at = [600.0, 4800.0, 4860.0, 9000.0, 13_200.0, 17_400.0, 21_600.0, 30_000.0].map(|t| twice.at(t));
        assert_eq!(at, [30.0, -40.0, -39.0, 30.0, -40.0, 30.0, -40.0, -40.0]);
    }
}
