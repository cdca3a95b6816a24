//! Thermometers that disagree with each other: one that stands still while others move, and the vote of several.
//!
//! ```text
//! values ─▶ Watch: since a thermometer last moved by `still`, has another gone away from it by `shows`?     ─▶ it stands still
//! codes  ─▶ vote:  the median of three or more; farther than `agree` from it                              ─▶ outvoted
//! ```
//!
//! A thermometer that is stuck at a plausible value passes every test of its own: it is in its range, it does not jump, it is fresh. Only
//! another one shows it, or the command of a heater that would have moved it. The watch has no clock: it names a thermometer as long as
//! others go away from it and it does not move, and none while nothing moves.
//!
//! Only the way *away* from it counts. In a soak a fast thermometer rests while a slow one still comes nearer by tens of degrees; that shows
//! nothing. `shows` must leave a slow one time to follow: where the chamber turns, one behind a lag τ goes up and down by less than
//! `still` until the fast one has moved by √(8·r·τ·still), in a ramp r: 9 °C at 5 °C/min, 20 min and 0.1 °C. `still` must exceed the noise
//! of a thermometer at rest, from peak to peak, and the noise that a stuck one still has.
//!
//! It does not say which of two is right and does not see two that are stuck together. A place that a heater holds at one temperature
//! stands still by design: leave it out.

/// Most thermometers of a vote.
pub const MOST_VOTERS: usize = 8;

/// What the watch takes as evidence. Values of thermometers are in one unit, for example 2⁻²⁴ °C
/// ([`crate::InputSpec::value_q24`]).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WatchSpec {
    /// Another thermometer that goes away by this much shows it.
    pub shows: u32,
    /// A thermometer that moves by this much does not stand still.
    pub still: u32,
    /// A heater's command that moves by this much shows it, in the command's own codes; 0: there is no heater.
    pub command_shows: u32,
}

/// One thermometer since it last moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Place<const N: usize> {
    low: i32,
    high: i32,
    /// The least distance of each other thermometer.
    nearest: [Option<u32>; N],
    /// Lowest and highest command.
    command: Option<(i32, i32)>,
}

impl<const N: usize> Place<N> {
    const fn at(value: i32) -> Self {
        Self { low: value, high: value, nearest: [None; N], command: None }
    }
}

/// `N` thermometers, and the command of a heater.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Watch<const N: usize> {
    spec: WatchSpec,
    places: [Option<Place<N>>; N],
}

impl<const N: usize> Watch<N> {
    /// At power-on.
    pub const fn new(spec: WatchSpec) -> Self {
        Self { spec, places: [None; N] }
    }

    /// What it takes as evidence.
    pub const fn spec(&self) -> WatchSpec {
        self.spec
    }

    /// Takes the newest values, `None` where there is no sample, and the heater's command. Bit i of the result: thermometer i stands still
    /// although another one, or the command, moved.
    ///
    /// **SAG-CORE-024** A thermometer that stands still while others or the heater's command move is named.
    pub fn update(&mut self, values: &[Option<i32>; N], command: Option<i32>) -> u32 {
        let spec = self.spec;
        let mut named = 0;
        for (at, (slot, value)) in self.places.iter_mut().zip(values).enumerate() {
            let Some(value) = *value else { continue };
            let place = slot.get_or_insert(Place::at(value));
            (place.low, place.high) = (place.low.min(value), place.high.max(value));
            if place.high.abs_diff(place.low) >= spec.still {
                *place = Place::at(value);
            }
            let others = values.iter().enumerate().filter(|(other, _)| *other != at);
            let distances = others.filter_map(|(other, far)| Some((other, far.as_ref()?.abs_diff(value))));
            let mut shown = false;
            for (other, distance) in distances {
                if let Some(nearest) = place.nearest.get_mut(other) {
                    let least = nearest.map_or(distance, |least| least.min(distance));
                    *nearest = Some(least);
                    shown |= distance - least >= spec.shows;
                }
            }
            if let Some(command) = command {
                let (low, high) =
                    place.command.map_or((command, command), |(low, high)| (low.min(command), high.max(command)));
                place.command = Some((low, high));
                shown |= spec.command_shows > 0 && high.abs_diff(low) >= spec.command_shows;
            }
            if shown {
                named |= 1_u32.checked_shl(at as u32).unwrap_or(0);
            }
        }
        named
    }
}

/// The result of a vote.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Vote {
    /// The code to use; `None` if there is none, or if two disagree.
    pub code: Option<i32>,
    /// Bit i: number i is farther than the limit from the code, or one of two that disagree.
    pub outvoted: u8,
    /// Number of thermometers that had a sample.
    pub voters: u8,
}

/// The median of the codes of several thermometers at one place, each with the same conversion: of an even number the mean of the two in the
/// middle, rounded down. One that is farther than `agree` from it is outvoted. Two must agree, and one alone is used as it is. Of more
/// than [`MOST_VOTERS`] the first are taken.
///
/// **SAG-CORE-025** Of three or more codes the vote is the median, and codes away from it are named.
pub fn vote(codes: &[Option<i32>], agree: u32) -> Vote {
    let mut sorted = [0_i32; MOST_VOTERS];
    let mut voters = 0_usize;
    for code in codes.iter().take(MOST_VOTERS).flatten() {
        if let Some(slot) = sorted.get_mut(voters) {
            *slot = *code;
            voters += 1;
        }
    }
    if let Some(cast) = sorted.get_mut(..voters) {
        cast.sort_unstable();
    }
    let at = |index: usize| i64::from(sorted.get(index).copied().unwrap_or(0));
    let median = match voters {
        0 => return Vote::default(),
        n if n % 2 == 1 => at(n / 2),
        n => (at(n / 2 - 1) + at(n / 2)) >> 1,
    };
    let far = |code: i32| (i64::from(code) - median).unsigned_abs() > u64::from(agree);
    let disagree = voters == 2 && (at(1) - at(0)).unsigned_abs() > u64::from(agree);
    let mut outvoted = 0_u8;
    for (bit, code) in codes.iter().take(MOST_VOTERS).enumerate() {
        if code.is_some_and(|code| disagree || (voters > 2 && far(code))) {
            outvoted |= 1 << bit;
        }
    }
    let code = if disagree { None } else { i32::try_from(median).ok() };
    Vote { code, outvoted, voters: voters as u8 }
}
