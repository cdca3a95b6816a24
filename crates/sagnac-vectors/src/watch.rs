//! The watch over thermometers that stand still, and the vote of several, driven by records.
//!
//! | operation | inputs | outputs |
//! |---|---|---|
//! | 0 start | shows, still, command shows | 0 |
//! | 1 watch | updates, seed, drift, bits, drift of the command, set value, flags | hash, updates that name one, all that were named, the last named, value of thermometer 0, command, 0 |
//! | 2 vote | votes, seed, agree, bits, base, set code, flags | hash, votes that leave one out, all that were left out, the last result, its code, 0, 0 |
//!
//! Watch: flags 1 (bits 0 to 3, one for each thermometer): it stands still; 2⁴: it has no sample in the updates in which the generator says
//! so; 2⁸: it has none at all; 2¹²: it is set to the value before the first update; 2¹⁶: the heater has a command. Each update moves
//! the command by its drift; draws a word, whose upper four bits say which of the 2⁴ have a sample; and moves each thermometer but
//! those that stand still by drift + noise. All sums wrap. The hash is over the named thermometers.
//!
//! Vote: flags 1 (bits 0 to 7, one for each code): it is missing in the votes in which the generator says so; 2⁸: in all of them; 2¹⁶: its
//! code is the set one. Each vote draws a word, whose upper eight bits say which of the former are there; each code is base + noise.
//! The result is 1 if there is a code, the outvoted·2⁸, the voters·2¹⁶; the hash is over result and code.

use sagnac_core::{MOST_VOTERS, Watch, WatchSpec, vote};

use crate::stimulus::{Hash, Noise};
use crate::{INPUTS, OUTPUTS};

/// Thermometers of the watch.
const THERMOMETERS: usize = 4;
/// Flag of the watch: the heater has a command.
const COMMAND: u32 = 1 << 16;

/// The machine of this module.
#[derive(Clone, Copy, Debug)]
pub struct WatchMachine {
    watch: Watch<THERMOMETERS>,
    values: [i32; THERMOMETERS],
    command: i32,
    ticks: u64,
}

impl Default for WatchMachine {
    fn default() -> Self {
        Self::new()
    }
}

impl WatchMachine {
    /// A watch that takes nothing for evidence, with all values 0.
    pub const fn new() -> Self {
        let spec = WatchSpec { shows: u32::MAX, still: u32::MAX, command_shows: 0 };
        Self { watch: Watch::new(spec), values: [0; THERMOMETERS], command: 0, ticks: 0 }
    }

    /// Number of updates and votes so far.
    pub const fn ticks(&self) -> u64 {
        self.ticks
    }

    /// Runs one record; `None` if there is no such operation.
    pub fn step(&mut self, operation: u32, inputs: &[u32; INPUTS]) -> Option<[u32; OUTPUTS]> {
        match operation {
            0 => {
                let [shows, still, command_shows, ..] = *inputs;
                let watch = Watch::new(WatchSpec { shows, still, command_shows });
                *self = Self { watch, ticks: self.ticks, ..Self::new() };
                Some([0; OUTPUTS])
            }
            1 => Some(self.watch(inputs)),
            2 => Some(self.vote(inputs)),
            _ => None,
        }
    }

    fn watch(&mut self, inputs: &[u32; INPUTS]) -> [u32; OUTPUTS] {
        let [updates, seed, drift, bits, command_drift, set, flags, _] = *inputs;
        let (mut noise, mut hash) = (Noise::new(seed), Hash::new());
        let (mut times, mut all, mut last) = (0, 0, 0);
        for (bit, value) in self.values.iter_mut().enumerate() {
            if flags >> (12 + bit) & 1 == 1 {
                *value = set.cast_signed();
            }
        }
        for _ in 0..updates {
            self.command = self.command.wrapping_add(command_drift.cast_signed());
            let present = !(flags >> 8) & (!(flags >> 4) | noise.word() >> 28);
            let mut seen = [None; THERMOMETERS];
            for (bit, (value, seen)) in self.values.iter_mut().zip(&mut seen).enumerate() {
                let moved = drift.cast_signed().wrapping_add(noise.about_zero(bits));
                if flags >> bit & 1 == 0 {
                    *value = value.wrapping_add(moved);
                }
                *seen = (present >> bit & 1 == 1).then_some(*value);
            }
            last = self.watch.update(&seen, (flags & COMMAND != 0).then_some(self.command));
            times += u32::from(last != 0);
            all |= last;
            hash.add(last);
        }
        self.ticks += u64::from(updates);
        let [first, ..] = self.values;
        [hash.value(), times, all, last, first.cast_unsigned(), self.command.cast_unsigned(), 0]
    }

    fn vote(&mut self, inputs: &[u32; INPUTS]) -> [u32; OUTPUTS] {
        let [votes, seed, agree, bits, base, set, flags, _] = *inputs;
        let (mut noise, mut hash) = (Noise::new(seed), Hash::new());
        let (mut times, mut all, mut result, mut code) = (0, 0, 0, 0);
        for _ in 0..votes {
            let present = !(flags >> 8) & (!flags | noise.word() >> 24);
            let mut codes = [None; MOST_VOTERS];
            for (bit, slot) in codes.iter_mut().enumerate() {
                let drawn = base.cast_signed().wrapping_add(noise.about_zero(bits));
                let cast = if flags >> (16 + bit) & 1 == 1 { set.cast_signed() } else { drawn };
                *slot = (present >> bit & 1 == 1).then_some(cast);
            }
            let vote = vote(&codes, agree);
            result = u32::from(vote.code.is_some()) | u32::from(vote.outvoted) << 8 | u32::from(vote.voters) << 16;
            code = vote.code.unwrap_or(0).cast_unsigned();
            times += u32::from(vote.outvoted != 0);
            all |= u32::from(vote.outvoted);
            hash.add(result);
            hash.add(code);
        }
        self.ticks += u64::from(votes);
        [hash.value(), times, all, result, code, 0, 0]
    }
}
