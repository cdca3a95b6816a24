//! Upsets of memory: a bit of a [`State`] that turned over by itself.
//!
//! What only a slow update changes has a checksum. What changes every tick has none; it has bounds ([`Compensator::is_plausible`]).
//!
//! Not found: an upset of the remainder below one count, which is an error below one count; in an image with an output limit, one of what
//! is held back; and one of the increment while it slews, which the end of the slew shows. A scale correction that changed within its
//! bounds is in force until the next slow update finds it.

use super::{ACCUMULATOR_BOUND, Compensator, ONE_Q32, State};
use crate::checksum::Checksum;
use crate::image::{MAX_INCREMENT, MAX_SCALE};

impl State {
    /// A checksum of what only a slow update changes. A board keeps it after each slow update and compares it before the next.
    ///
    /// **SAG-CORE-027** An upset of the state shows before the next slow update; the state then restarts, and UPSET reports it.
    pub fn checksum(&self) -> u32 {
        let flags =
            u32::from(self.slow_status.bits()) | u32::from(self.corrected_once) << 16 | u32::from(self.warm) << 17;
        let own = Checksum::START
            .long(self.k_q32)
            .long(self.target)
            .long(self.slope)
            .word(self.gentle_ticks)
            .word(self.updates)
            .word(flags);
        self.inputs.iter().fold(own, |sum, input| input.add_to(sum)).sum()
    }
}

impl Compensator {
    /// False if the parts of a state that change each tick are beyond what this image can make of them.
    #[inline]
    pub fn is_plausible(&self, state: &State) -> bool {
        let description = self.image.description();
        let limits = description.output_limit < i32::MAX.cast_unsigned();
        let held_back =
            limits && (state.overflow || state.accumulator.unsigned_abs() <= ACCUMULATOR_BOUND.unsigned_abs());
        let steady = state.slewing_ticks == 0 && state.increment == state.target;
        let slews = state.slewing_ticks > 0
            && state.slewing_ticks <= description.slew_ticks
            && state.increment.unsigned_abs() <= description.increment_bound().unsigned_abs();
        (held_back || state.accumulator >> 32 == 0)
            && (steady || slews)
            && state.slope.unsigned_abs() <= 2 * MAX_INCREMENT.unsigned_abs()
            && state.k_q32.wrapping_sub(ONE_Q32).unsigned_abs() <= MAX_SCALE.unsigned_abs() + 1
            && state.ticks_to_update <= description.period_ticks
    }

    /// The state that goes on after an upset: as after [`State::warm`], with the part of a count that was not output yet. A slow update is
    /// due at once. What an output limit held back is lost.
    pub const fn restart(&self, upset: &State) -> State {
        let mut state = State::warm();
        state.accumulator = upset.accumulator & (ONE_Q32 - 1);
        state.updates = upset.updates.wrapping_add(1);
        state
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Image;
    use crate::status::Status;

    const PAPER: &[u8] = include_bytes!("../../../../testdata/image/paper.img");

    fn running() -> (Compensator, State) {
        let gyro = Compensator::new(Image::decode(PAPER).unwrap());
        let mut state = State::new();
        let period = gyro.image().description().period_ticks;
        for update in 0..3 {
            let codes = [Some((20 << 24) + update); 4];
            gyro.update(&mut state, &codes[..gyro.image().inputs().len()]).unwrap();
            gyro.advance(&mut state, 1000, period).unwrap();
        }
        (gyro, state)
    }

    type Flip = fn(&mut State, u32);

    /// SAG-CORE-027: each bit of each field of a slow update changes the checksum.
    #[test]
    fn every_flipped_bit_of_a_slow_update_is_seen() {
        let (_, state) = running();
        let fields: [(u32, Flip); 8] = [
            (64, |state, bit| state.k_q32 ^= 1 << bit),
            (64, |state, bit| state.target ^= 1 << bit),
            (64, |state, bit| state.slope ^= 1 << bit),
            (32, |state, bit| state.gentle_ticks ^= 1 << bit),
            (32, |state, bit| state.updates ^= 1 << bit),
            (16, |state, bit| state.slow_status = Status::from_bits(state.slow_status.bits() ^ 1 << bit)),
            (1, |state, _| state.corrected_once ^= true),
            (1, |state, _| state.warm ^= true),
        ];
        let mut flips = 0;
        for (bits, flip) in fields {
            for bit in 0..bits {
                let mut upset = state;
                flip(&mut upset, bit);
                assert_ne!(upset.checksum(), state.checksum(), "bit {bit}");
                flips += 1;
            }
        }
        for at in 0..state.inputs.len() {
            for input in state.inputs[at].flipped() {
                let mut upset = state;
                upset.inputs[at] = input;
                assert_ne!(upset.checksum(), state.checksum(), "input {at}");
                flips += 1;
            }
        }
        assert_eq!(flips, 274 + 4 * (64 + 64 + 33 + 32 + 8 + 8 + 16 + 32 + 32 + 32));
    }

    /// SAG-CORE-027: a bit above the range of a field that changes each tick is seen, and no state of a run is called upset.
    #[test]
    fn what_changes_each_tick_has_bounds() {
        let (gyro, state) = running();
        assert!(gyro.is_plausible(&state) && gyro.is_plausible(&State::new()));
        for bit in 32..64 {
            let mut upset = state;
            upset.accumulator ^= 1 << bit;
            assert!(!gyro.is_plausible(&upset), "accumulator, bit {bit}");
            assert_eq!(gyro.restart(&upset).remainder(), state.remainder());
        }
        for bit in 0..64 {
            let mut upset = state;
            upset.increment ^= 1 << bit;
            assert!(!gyro.is_plausible(&upset), "increment, bit {bit}");
        }
        for bit in 27..64 {
            let mut upset = state;
            upset.k_q32 ^= 1 << bit;
            assert!(!gyro.is_plausible(&upset), "k, bit {bit}");
        }
        for bit in 20..32 {
            let mut upset = state;
            upset.ticks_to_update ^= 1 << bit;
            assert!(!gyro.is_plausible(&upset), "ticks to the update, bit {bit}");
        }
    }
}
