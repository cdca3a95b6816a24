//! Chance, and the numbers, words and bytes that break programs.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Text that is a number, nearly one, or far from what a quantity may be.
const NUMBERS: [&str; 42] = [
    "0",
    "-0",
    "1",
    "-1",
    "0.5",
    "1e-9",
    "1e5",
    "-1e6",
    "1e10",
    "1e19",
    "-1e30",
    "1e60",
    "1e154",
    "1e300",
    "1e308",
    "-1e308",
    "1.7976931348623157e308",
    "1e309",
    "4.9e-324",
    "1e-320",
    "NaN",
    "nan",
    "inf",
    "-inf",
    "Infinity",
    "2147483648",
    "-2147483649",
    "4294967296",
    "9007199254740993",
    "9223372036854775807",
    "-9223372036854775808",
    "18446744073709551616",
    "1,5",
    "1.234,5",
    "0x10",
    "1_000",
    "+3",
    "--1",
    " 7 ",
    "-",
    "#N/A",
    "",
];

/// Text that means something to a terminal, a spreadsheet, a shell, a path or a parser.
const WORDS: [&str; 24] = [
    "",
    " ",
    "a",
    "none",
    "auto",
    "true",
    "\u{1b}[31mred\u{1b}[0m",
    "\u{1b}]0;title\u{7}",
    "a\u{8}b",
    "\u{0}",
    "\u{202e}evil",
    "\u{85}",
    "#x",
    "=1+1",
    "\"",
    "'",
    "a,b",
    "a;b\tc",
    "a\nb",
    "../../out",
    "%s%n",
    "\u{fffd}",
    "Ω°µ",
    "<script>alert(1)</script>",
];

/// A source of chance that depends on the number of a case alone.
pub(super) struct Chance(ChaCha8Rng);

impl Chance {
    pub(super) fn of(case: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(case))
    }

    /// Below `end`, which is at least 1.
    pub(super) fn below(&mut self, end: usize) -> usize {
        self.0.random_range(0..end.max(1))
    }

    pub(super) fn one_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }

    pub(super) fn pick<T: Clone>(&mut self, from: &[T]) -> T {
        from[self.below(from.len())].clone()
    }

    /// In [0, 1).
    pub(super) fn unit(&mut self) -> f64 {
        self.0.random::<f64>()
    }

    pub(super) fn number(&mut self) -> &'static str {
        self.pick(&NUMBERS)
    }

    pub(super) fn word(&mut self) -> String {
        let word = self.pick(&WORDS);
        if self.one_in(12) { word.repeat(1 + self.below(3000)) } else { word.to_owned() }
    }

    /// A finite number of any size, as a quantity of 64 bits.
    pub(super) fn double(&mut self) -> f64 {
        match self.below(4) {
            0 => f64::from_bits(self.0.random()),
            1 => self.unit() * 2.0 - 1.0,
            2 => (self.unit() * 2.0 - 1.0) * 10_f64.powi(self.below(40) as i32 - 10),
            _ => self.number().parse().unwrap_or(f64::NAN),
        }
    }

    /// Damages bytes: a few changed, cut, repeated, removed or put in from elsewhere.
    pub(super) fn damage(&mut self, mut bytes: Vec<u8>) -> Vec<u8> {
        for _ in 0..=self.below(4) {
            if bytes.is_empty() {
                return bytes;
            }
            let at = self.below(bytes.len());
            let length = (1 + self.below(64)).min(bytes.len() - at);
            match self.below(7) {
                0 => bytes[at] = self.0.random(),
                1 => bytes[at] ^= 1 << self.below(8),
                2 => bytes.truncate(at),
                3 => drop(bytes.drain(at..at + length)),
                4 => {
                    let piece = bytes[at..at + length].to_vec();
                    let to = self.below(bytes.len());
                    bytes.splice(to..to, piece.repeat(1 + self.below(20)));
                }
                5 => {
                    let value = self.pick(&[0_u8, 0xff, 0x7f, 0x80, b'9', b'\n']);
                    bytes[at..at + length].fill(value);
                }
                _ => {
                    let value: u64 = self.pick(&[0, 1, u64::MAX, 1 << 31, i64::MAX as u64, 1 << 40]);
                    let value = &value.to_le_bytes()[..length.min(8)];
                    bytes[at..at + value.len()].copy_from_slice(value);
                }
            }
        }
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::Chance;

    #[test]
    fn a_case_is_the_same_each_time_and_differs_from_the_next() {
        let bytes: Vec<u8> = (0..=255).collect();
        let damaged = |case| Chance::of(case).damage(bytes.clone());
        assert_eq!(damaged(7), damaged(7));
        let other = (0..100).filter(|case| damaged(*case) != damaged(case + 1)).count();
        assert!(other > 90, "{other}");
    }
}
