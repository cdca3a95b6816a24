//! The stimulus of a record, and the hash of its results.

/// The linear congruential generator s ← 1664525·s + 1013904223 mod 2³² (Knuth and Lewis; Numerical Recipes §7.1).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Noise {
    state: u32,
}

impl Noise {
    pub(crate) const fn new(seed: u32) -> Self {
        Self { state: seed }
    }

    /// The next state.
    pub(crate) fn word(&mut self) -> u32 {
        self.state = self.state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        self.state
    }

    /// The upper `bits` of the next state, about zero: −2^(bits − 1) … 2^(bits − 1) − 1; 0 bits give 0; at most 31.
    pub(crate) fn about_zero(&mut self, bits: u32) -> i32 {
        let word = self.word();
        match bits.min(31) {
            0 => 0,
            bits => (word >> (32 - bits)) as i32 - (1 << (bits - 1)),
        }
    }
}

/// Over words: h ← (h xor word)·16777619 mod 2³², from 2166136261 (the form of FNV-1a, a word at a time).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hash(u32);

impl Hash {
    pub(crate) const fn new() -> Self {
        Self(2_166_136_261)
    }

    pub(crate) fn add(&mut self, word: u32) {
        self.0 = (self.0 ^ word).wrapping_mul(16_777_619);
    }

    pub(crate) const fn value(self) -> u32 {
        self.0
    }
}

/// Lower and upper word.
pub(crate) const fn halves(value: i64) -> [u32; 2] {
    [value as u32, (value >> 32) as u32]
}
