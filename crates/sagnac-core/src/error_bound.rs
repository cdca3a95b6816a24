//! How far the correction may be off now: a number next to the status.
//!
//! ```text
//! bound    max(0.1 °/h, 0.05·ΣR) + Σ step effects       status 0; R the effect of an input's rate at its border `far`
//! step     R·α·step/far + D·step/half + J               the largest step that passes, with the way of the true value meanwhile: the reach
//!                                                       of one update; D the steepest slope of the terms, J the sum of their steps
//! settling + 2·R·exp(−n·α)                              n slow updates after the lag began
//! open     + 2·(C + R)                                  C the effect of the input itself: its value may be wrong. Also while a jump is
//!                                                       weighed, and always where the image has no limit of slope for the input
//! held     + D·reach/half + J + R·Δy                    reach the limit of slope times the hold,
//!                                                       Δy ≤ α·reach·(1 + n·α)/far + n·α the change of the rate
//! ```
//!
//! An input makes 2·(C + R) at most, whatever happens to it. While a correction is held its own number counts, and these parts are added.
//!
//! It bounds the fault, not the calibration: add the calibration's own uncertainty. There is no bound where an input is outside its span or
//! without a value since power-on, and none against a reading that is wrong and moves by no more than a largest step at a time. Scale terms count for
//! nothing: their effect follows the input rate.

use crate::compensator::State;
use crate::image::{Image, Kind, MAX_INPUTS, Multiplier, Shape};
use crate::input::{InputSpec, InputState, ValueSource};
use crate::status::Status;

/// No bound.
pub const UNBOUNDED: u32 = u32::MAX;
/// 0.1 °/h.
const LEAST_MILLI_DPH: u32 = 100;
/// A twentieth of the rate effects.
const PART: i64 = 20;
/// log₂ e in Q16, rounded down.
const LOG2_E_Q16: u64 = 94_548;
const ONE_Q16: i64 = 1 << 16;
/// Without a bound whatever else holds.
const OPEN_ENDED: Status = Status::UNCORRECTED
    .with(Status::OUT_OF_SPAN)
    .with(Status::RATE_OUT_OF_SPAN)
    .with(Status::OVERFLOW)
    .with(Status::NO_DITHER)
    .with(Status::COUNTS_LOST)
    .with(Status::STUCK)
    .with(Status::OUTVOTED);

/// The bound after each slow update, in one call or in slices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ErrorBound {
    /// Slow updates in a row that kept the last correction.
    held_updates: u32,
    milli_dph: u32,
    /// That of the last update with a correction of its own, which a hold keeps.
    made_milli_dph: u32,
    /// The next slice: an input, or the sum behind the last one; [`WHOLE`] when none is missing.
    next: u8,
    /// Of the slices so far, Q40 counts per tick.
    rates: i64,
    faults: i64,
}

/// No slice is missing.
const WHOLE: u8 = u8::MAX;

impl Default for ErrorBound {
    fn default() -> Self {
        Self::new()
    }
}

impl ErrorBound {
    /// Before the first slow update: no bound.
    pub const fn new() -> Self {
        Self { held_updates: 0, milli_dph: UNBOUNDED, made_milli_dph: UNBOUNDED, next: WHOLE, rates: 0, faults: 0 }
    }

    /// The bound of the last slow update whose slices are made, 0.001 °/h rounded up; [`UNBOUNDED`] for none.
    pub const fn milli_dph(&self) -> u32 {
        self.milli_dph
    }

    /// Whether a status leaves no bound, those that a board adds included.
    pub const fn is_open_ended(status: Status) -> bool {
        status.bits() & OPEN_ENDED.bits() != 0
    }

    /// No slice is missing.
    pub const fn is_whole(&self) -> bool {
        self.next == WHOLE
    }

    /// Once after each slow update. It reads the state and changes nothing of it.
    ///
    /// **SAG-CORE-031** After each slow update a bound in °/h says how far a fault may have moved the correction.
    pub fn update(&mut self, image: &Image, state: &State) {
        self.begin(state);
        while !self.is_whole() {
            self.advance(image, state);
        }
    }

    /// The same in slices: begin it after a slow update, and make a slice in each tick behind it.
    pub fn begin(&mut self, state: &State) {
        let status = state.status();
        self.held_updates = if status.contains(Status::HELD) { self.held_updates.saturating_add(1) } else { 0 };
        (self.next, self.rates, self.faults) = (0, 0, 0);
        if Self::is_open_ended(status) {
            self.end(UNBOUNDED, 0);
        }
    }

    /// One slice, of the same image and the state of the same slow update. Nothing where none is missing.
    #[inline(never)]
    pub fn advance(&mut self, image: &Image, state: &State) {
        let at = usize::from(self.next);
        if let (Some(spec), Some(memory)) = (image.inputs().get(at), state.inputs().get(at)) {
            let effects = Effects::of(image, at);
            self.rates += effects.rate;
            let parents = parents(image, state.inputs(), at);
            let of_step = effects.moved(spec, parents.reach_q24(1).unwrap_or(0), 0);
            let of_fault = effects.of_fault(spec, memory, parents, self.held_updates);
            self.faults += (of_step + of_fault).min(effects.whole());
            self.next += 1;
        } else if !self.is_whole() {
            let bound = milli_dph(image, self.rates / PART + 1).max(LEAST_MILLI_DPH);
            self.end(bound, if self.faults > 0 { milli_dph(image, self.faults) } else { 0 });
        }
    }

    /// The last slice. A hold keeps a correction that may have been made of a wrong value, whatever the inputs show now.
    fn end(&mut self, bound_milli_dph: u32, faults_milli_dph: u32) {
        let now = bound_milli_dph.saturating_add(faults_milli_dph);
        self.next = WHOLE;
        if self.held_updates == 0 {
            (self.milli_dph, self.made_milli_dph) = (now, now);
        } else {
            self.milli_dph = now.max(self.made_milli_dph.saturating_add(faults_milli_dph));
        }
    }
}

/// The codes behind an input: how far they may have moved in some updates, and whether one may be wrong.
#[derive(Clone, Copy)]
struct Parents<'a> {
    image: &'a Image,
    memories: &'a [InputState; MAX_INPUTS],
    own: [usize; 2],
}

fn parents<'a>(image: &'a Image, memories: &'a [InputState; MAX_INPUTS], at: usize) -> Parents<'a> {
    let own = match image.inputs().get(at).map(|spec| spec.source) {
        Some(ValueSource::Difference { of, less }) => [usize::from(of), usize::from(less)],
        Some(ValueSource::Repeat { of }) => [usize::from(of), MAX_INPUTS],
        _ => [at, MAX_INPUTS],
    };
    Parents { image, memories, own }
}

impl Parents<'_> {
    fn each(&self) -> impl Iterator<Item = (&InputSpec, &InputState)> {
        self.own.iter().filter_map(|at| Some((self.image.inputs().get(*at)?, self.memories.get(*at)?)))
    }

    fn are_open(&self) -> bool {
        self.each().any(|(spec, memory)| memory.is_open(spec) || memory.weighs_a_jump())
    }

    /// 2⁻²⁴ °C; `None` without a limit of slope.
    fn reach_q24(&self, updates: u32) -> Option<i64> {
        self.each().map(|(spec, _)| (spec.step_growth > 0).then(|| i64::from(spec.reach_q24(updates)))).sum()
    }
}

/// The largest effects of an input on the increment, Q40 counts per tick.
#[derive(Clone, Copy, Default)]
struct Effects {
    curve: i64,
    rate: i64,
    /// Per half span of the input.
    slope: i64,
    /// Of its steps.
    jump: i64,
}

impl Effects {
    fn of(image: &Image, at: usize) -> Self {
        let mut effects = Self::default();
        for term in image.terms().iter().filter(|term| usize::from(term.input) == at && term.kind == Kind::Bias) {
            let size = term.bound_q40();
            // Of T_n: n². Of a harmonic: π·turns. A step has none.
            let slope = match term.shape {
                Shape::Chebyshev(order) => i64::from(order) * i64::from(order),
                Shape::Zone { .. } => 1,
                Shape::Step { .. } => 0,
                Shape::Cosine { turns_q18 } | Shape::Sine { turns_q18 } => (i64::from(turns_q18) >> 16) + 1,
            };
            // The image bounds the sum of sizes: 2⁵⁴, and no slope is above 257.
            effects.slope += size * slope;
            if matches!(term.shape, Shape::Step { .. }) {
                effects.jump += size;
            }
            match term.multiplier {
                Multiplier::Rate => effects.rate += size,
                Multiplier::One if term.shape == Shape::Chebyshev(0) => {}
                Multiplier::One => effects.curve += size,
            }
        }
        effects
    }

    const fn whole(self) -> i64 {
        2 * (self.curve + self.rate)
    }

    /// The effect of an input that moves this far in so many updates: on the terms, over their steps, and behind the lag.
    fn moved(self, spec: &InputSpec, reach_q24: i64, updates: u32) -> i64 {
        let half_q24 = (i64::from(spec.span_hi_q24) - i64::from(spec.span_lo_q24)) / 2;
        let moved_q16 = ((reach_q24.min(MOST_REACH) << 16) / half_q24.max(1)).min(2 * ONE_Q16) + 1;
        let turned = scaled(self.rate, rate_change_q16(spec, reach_q24, updates));
        scaled(self.slope, moved_q16).min(self.whole()) + self.jump + turned
    }

    fn of_fault(self, spec: &InputSpec, memory: &InputState, parents: Parents<'_>, held_updates: u32) -> i64 {
        let is_limited = spec.source == ValueSource::WarmUp || parents.reach_q24(0).is_some();
        if !is_limited || parents.are_open() {
            return self.whole();
        }
        let mut off = 0;
        if spec.lag.is_used() && memory.settled_updates <= spec.settling_updates {
            off = decayed(2 * self.rate, spec, memory.settled_updates);
        }
        if held_updates > 0 {
            off += self.while_held(spec, parents, held_updates.max(memory.held_updates));
        }
        off
    }

    fn while_held(self, spec: &InputSpec, parents: Parents<'_>, updates: u32) -> i64 {
        if spec.source == ValueSource::WarmUp {
            return scaled(self.rate, rate_change_q16(spec, 0, updates));
        }
        self.moved(spec, parents.reach_q24(updates).unwrap_or(MOST_REACH), updates)
    }
}

/// Farther than any span.
const MOST_REACH: i64 = 1 << 33;

/// The most that the rate, in parts of its border, can change while the input moves this far in so many updates, Q16.
fn rate_change_q16(spec: &InputSpec, reach_q24: i64, updates: u32) -> i64 {
    if !spec.lag.is_used() {
        return 0;
    }
    let turned_q16 = in_taus_q16(spec, updates).min(2 * ONE_Q16.cast_unsigned()).cast_signed() + 1;
    let far = i64::from(spec.lag.rate_hi.max(spec.lag.rate_lo.saturating_neg())).max(1);
    // The border in 2^−24 °C per update is far·2^−rate_shift; α·reach in the same unit.
    let product = ((reach_q24.min(MOST_REACH) >> 2) + 1) * (i64::from(spec.lag.alpha_mantissa >> 4) + 1);
    // Six places are left out above, and sixteen are for Q16.
    let places = u32::from(spec.lag.alpha_shift.saturating_sub(spec.lag.rate_shift));
    let moved = match places.checked_sub(22) {
        Some(right) => product >> right.min(62),
        None => product.saturating_mul(1 << (22 - places)),
    };
    let moved_q16 = (moved / far).saturating_add(1).min(2 * ONE_Q16);
    (moved_q16 + ((moved_q16 * turned_q16) >> 16) + turned_q16).min(2 * ONE_Q16)
}

/// Some slow updates in time constants, Q16, rounded down.
fn in_taus_q16(spec: &InputSpec, updates: u32) -> u64 {
    let shift = u32::from(spec.lag.alpha_shift).saturating_sub(16);
    (u64::from(updates) * u64::from(spec.lag.alpha_mantissa)) >> shift.min(63)
}

/// At least `effect·exp(−n·α)`, up to 32 time constants: whole halves, and between them the chord of 2⁻ᶠ, which lies above it by 6 % at most.
fn decayed(effect: i64, spec: &InputSpec, updates: u32) -> i64 {
    let halves_q16 = (in_taus_q16(spec, updates).min(1 << 21) * LOG2_E_Q16) >> 16;
    let rest_q16 = (halves_q16 & 0xFFFF) as i64;
    let chord = scaled(effect, ONE_Q16 - rest_q16 / 2);
    (chord >> (halves_q16 >> 16)) + 1
}

/// `effect` times a part in Q16 that is at most 2, rounded up.
const fn scaled(effect: i64, part_q16: i64) -> i64 {
    ((effect >> 16) + 1).saturating_mul(part_q16)
}

/// Q40 counts per tick in 0.001 °/h, rounded up: times the scale factor in 10⁻¹⁵ arcsec, over a thousand ticks in ns.
fn milli_dph(image: &Image, effect_q40: i64) -> u32 {
    let d = image.description();
    let (effect, of_effect) = short(effect_q40.unsigned_abs());
    let (angle, of_angle) = short(d.scale_factor_femto_arcsec);
    let whole = (effect * angle).div_ceil(u64::from(d.tick_ns.max(1))).div_ceil(1000);
    match (of_effect + of_angle).checked_sub(40) {
        Some(left) => {
            let most = u64::from(u32::MAX) >> left.min(32);
            if whole > most { UNBOUNDED } else { (whole << left) as u32 }
        }
        None => {
            let right = 40 - (of_effect + of_angle);
            u32::try_from((whole >> right) + 1).unwrap_or(UNBOUNDED)
        }
    }
}

/// A number in 31 bits, rounded up, and its binary places.
const fn short(number: u64) -> (u64, u32) {
    let places = (64 - number.leading_zeros()).saturating_sub(31);
    ((number >> places) + (places > 0) as u64, places)
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::compensator::Compensator;
    use crate::input::LagSpec;

    fn with_lag(alpha_shift: u8) -> InputSpec {
        let lag = LagSpec {
            alpha_mantissa: 1 << 30,
            alpha_shift,
            rate_shift: 8,
            rate_lo: -1000,
            rate_hi: 900,
            ..LagSpec::default()
        };
        InputSpec { lag, ..InputSpec::UNUSED }
    }

    /// Closed form: 2⁻ᶠ lies below its chord by 6.1 % at most, and above no point of it.
    #[test]
    fn a_lag_decays_no_faster_than_its_exponential() {
        let spec = with_lag(38);
        let alpha = 2.0_f64.powi(30 - 38);
        for updates in 0..8000 {
            let exact = 1e12 * (-(alpha * f64::from(updates)).min(32.0)).exp();
            let bound = decayed(1_000_000_000_000, &spec, updates) as f64;
            assert!(bound >= exact && bound <= exact * 1.064 + 2.0 * 65_536.0, "{updates}: {bound} of {exact}");
        }
    }

    /// Closed form: arcsec per second is °/h.
    #[test]
    fn units_are_those_of_a_rate() {
        for (femto, tick_ns) in [(1_513_000_000_000, 100_000), (1, 100_000), (u64::MAX, 1_000_000_000), (1 << 40, 1)] {
            let mut d = crate::Description::empty();
            (d.scale_factor_femto_arcsec, d.tick_ns) = (femto, tick_ns);
            let image = Image::new(d).unwrap();
            for effect in [1_i64, 1 << 20, (1 << 40) + 7, 1 << 54] {
                let exact = effect as f64 / 2.0_f64.powi(40) * femto as f64 * 1e-15 / (f64::from(tick_ns) * 1e-9) * 1e3;
                let milli = milli_dph(&image, effect);
                let fits = exact * 1.000_01 + 1.0 < f64::from(u32::MAX);
                let near = f64::from(milli) >= exact * (1.0 - 1e-12) && f64::from(milli) <= exact * 1.000_01 + 2.0;
                assert!(if fits { near } else { milli == UNBOUNDED }, "{femto} {tick_ns} {effect}: {milli} of {exact}");
            }
        }
    }

    /// Closed form: α·reach/far, in the units of the image.
    #[test]
    fn a_rate_changes_by_the_way_of_its_input() {
        for (alpha_shift, reach_q24) in [(38, 1 << 16), (38, 1), (44, 1 << 24), (31, 5)] {
            let spec = with_lag(alpha_shift);
            let alpha = 2.0_f64.powi(30 - i32::from(alpha_shift));
            let moved = alpha * reach_q24 as f64 * 256.0 / 1000.0;
            let exact = (moved * (1.0 + 3.0 * alpha) + 3.0 * alpha).min(2.0);
            let found = rate_change_q16(&spec, reach_q24, 3) as f64 / 65_536.0;
            assert!(
                found >= exact && found <= exact * 1.01 + 0.01 * moved.min(2.0) + 8.0 / 65_536.0 + 4.0 * alpha,
                "{found} of {exact}"
            );
        }
    }

    /// SAG-CORE-031: none before the first value; more while it may be wrong, less after, without end while nothing comes.
    #[test]
    fn the_bound_follows_the_status() {
        let mut d = *Image::decode(include_bytes!("../../../testdata/image/paper.img")).unwrap().description();
        (d.inputs[0].largest_step_q8, d.inputs[0].step_growth) = (128, 8);
        let image = Image::new(d).unwrap();
        let gyro = Compensator::new(image);
        let (mut state, mut bound) = (State::new(), ErrorBound::new());
        assert_eq!(bound.milli_dph(), UNBOUNDED);
        let mut update = |code: Option<i32>| {
            gyro.update(&mut state, &[code]).unwrap();
            let ticks = state.ticks_to_update();
            gyro.advance(&mut state, 0, ticks).unwrap();
            bound.update(&image, &state);
            (state.status(), bound.milli_dph())
        };
        assert_eq!(update(None).1, UNBOUNDED);
        let first = update(Some(20 << 24));
        let settled = (0..10).map(|_| update(Some(20 << 24))).last().unwrap();
        assert!(settled.0 == Status::OK && settled.1 >= 100 && settled.1 <= first.1, "{first:?} {settled:?}");
        let held: std::vec::Vec<u32> = (0..100).map(|_| update(None).1).collect();
        assert!(held.windows(2).all(|pair| pair[1] >= pair[0]) && held[99] > settled.1, "{settled:?} {held:?}");
        assert!(update(Some(120 << 24)).1 >= held[99]);
        // Without a limit of slope a value may be wrong at any time.
        d.inputs[0].step_growth = 0;
        let unlimited = Image::new(d).unwrap();
        bound.update(&unlimited, &state);
        assert!(bound.milli_dph() == UNBOUNDED || bound.milli_dph() >= first.1, "{bound:?} {first:?}");
        assert!(ErrorBound::is_open_ended(Status::STUCK) && !ErrorBound::is_open_ended(Status::SURVIVOR));
    }
}
