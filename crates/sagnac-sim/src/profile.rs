//! The temperature profile of the thermal chamber: soaks and ramps, repeated.
//!
//! A profile is a list of legs from a start temperature. It is piecewise linear; each leg is rounded down to whole
//! seconds, with a minimum of one. The first cycle begins at the start temperature and each later one where the
//! previous cycle ended.
//!
//! The profile is the air temperature. An overshoot of the chamber's controller is not modelled.

/// One leg of a chamber profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Leg {
    /// Hold the temperature for this time, s.
    Soak(f64),
    /// Go to a temperature (°C) at this rate (°C/min, positive in both directions).
    Ramp(f64, f64),
}

/// Chamber temperature over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    first: Vec<Piece>,
    /// Every cycle after the first.
    again: Vec<Piece>,
    cycles: u32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Piece {
    start_s: f64,
    end_s: f64,
    from_c: f64,
    slope_c_per_s: f64,
}

impl Piece {
    fn end_c(&self) -> f64 {
        self.from_c + self.slope_c_per_s * (self.end_s - self.start_s)
    }
}

/// The pieces of one cycle.
fn pieces(start_c: f64, legs: &[Leg]) -> Vec<Piece> {
    let mut pieces: Vec<Piece> = Vec::with_capacity(legs.len());
    let (mut now_s, mut now_c) = (0.0, start_c);
    for leg in legs {
        let (length_s, to_c) = match *leg {
            Leg::Soak(length_s) => (libm::floor(length_s).max(1.0), now_c),
            Leg::Ramp(to_c, rate_cpm) => (libm::floor((to_c - now_c).abs() / rate_cpm * 60.0).max(1.0), to_c),
        };
        let slope_c_per_s = (to_c - now_c) / length_s;
        pieces.push(Piece { start_s: now_s, end_s: now_s + length_s, from_c: now_c, slope_c_per_s });
        (now_s, now_c) = (now_s + length_s, to_c);
    }
    pieces
}

fn length_s(pieces: &[Piece]) -> f64 {
    pieces.last().map_or(0.0, |piece| piece.end_s)
}

/// Temperature at a time of one cycle.
fn at(pieces: &[Piece], time_s: f64) -> f64 {
    let index = pieces.partition_point(|piece| piece.end_s < time_s);
    let piece = pieces.get(index).or(pieces.last());
    piece.map_or(0.0, |p| p.from_c + p.slope_c_per_s * (time_s.min(p.end_s) - p.start_s).max(0.0))
}

impl Profile {
    /// A profile from a start temperature, repeated for a number of cycles.
    pub fn new(start_c: f64, legs: &[Leg], cycles: u32) -> Self {
        let first = pieces(start_c, legs);
        let again = pieces(first.last().map_or(start_c, Piece::end_c), legs);
        Self { first, again, cycles: cycles.max(1) }
    }

    /// Length of all cycles together, s.
    pub fn length_s(&self) -> f64 {
        length_s(&self.first) + f64::from(self.cycles - 1) * length_s(&self.again)
    }

    /// Temperature at a time, °C. Before the start and after the end it is that of the start and of the end.
    pub fn at(&self, time_s: f64) -> f64 {
        let first_s = length_s(&self.first);
        if time_s <= first_s || self.cycles == 1 {
            return at(&self.first, time_s);
        }
        let again_s = length_s(&self.again);
        // The last instant of a cycle belongs to that cycle.
        let cycle = (libm::ceil((time_s - first_s) / again_s) - 1.0).min(f64::from(self.cycles - 2));
        at(&self.again, time_s - first_s - cycle * again_s)
    }

    /// Lowest and highest temperature, °C.
    pub fn span_c(&self) -> [f64; 2] {
        let ends = self.first.iter().chain(&self.again).flat_map(|p| [p.from_c, p.end_c()]);
        ends.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], t| [lo.min(t), hi.max(t)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_profile_follows_its_legs() {
        let legs = [Leg::Soak(600.0), Leg::Ramp(-40.0, 2.0), Leg::Soak(60.0)];
        let profile = Profile::new(20.0, &legs, 1);
        assert_eq!(profile.length_s(), 600.0 + 1800.0 + 60.0);
        let at = [-1.0, 600.0, 1500.0, 2400.0, 9999.0].map(|t| profile.at(t));
        assert_eq!(at, [20.0, 20.0, -10.0, -40.0, -40.0]);
        assert_eq!(profile.span_c(), [-40.0, 20.0]);
        // The second cycle begins where the first ended.
        let twice = Profile::new(20.0, &[Leg::Ramp(30.0, 1.0), Leg::Ramp(-40.0, 1.0)], 3);
        assert_eq!(twice.length_s(), 4800.0 + 2.0 * 8400.0);
        let at = [600.0, 4800.0, 4860.0, 9000.0, 13_200.0, 17_400.0, 21_600.0, 30_000.0].map(|t| twice.at(t));
        assert_eq!(at, [30.0, -40.0, -39.0, 30.0, -40.0, 30.0, -40.0, -40.0]);
    }
}
