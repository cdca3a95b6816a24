//! Fields whose text is known before they are read: a time of even steps, and a value that has not changed.
//!
//! ```text
//! time:   text(n+1) = text(n) + (text(n) − text(n−1)), digit by digit        value: text(n+1) = text(n)
//! ```
//!
//! The text that is expected, with the delimiter behind it, is compared as one number of 16 bytes. Where it is what the row holds, the
//! value follows without reading a digit; where it is not, the field is read as ever. So the result is the same for any log (a property
//! test holds it), and only the time differs: half of the bytes of an evenly sampled log are times, and a thermometer repeats itself.
//!
//! Fails to save anything where times jitter in their last digit or a thermometer never repeats: after [`MOST_MISSES`] in a row nothing
//! more is expected of that column in the piece.

use crate::ingest::number::Decimal;

/// Bytes that are compared at once, delimiter included.
const BYTES: usize = 16;
/// So many unexpected fields in a row end the expectation.
const MOST_MISSES: u8 = 16;
/// A one in every byte.
const ONES: u128 = u128::MAX / 255;
/// Added to a byte, sets its highest bit from the byte after `9` on, up to two digits and a carry.
const ABOVE_NINE: u128 = ONES * (0x80 - (b'9' as u128 + 1));
/// Passes of carries until a sum has digits alone: one for each digit at most.
const MOST_CARRIES: usize = BYTES;

/// The next field of a column.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Expected {
    /// Its bytes, the first one lowest, and its delimiter.
    text: u128,
    /// Ones where `text` has bytes; zero where nothing is expected.
    mask: u128,
    length: usize,
    value: f64,
    time_ns: i64,
    step: Step,
    /// The last time, if that was read.
    last: Option<LastTime>,
    misses: u8,
}

/// From one time to the next.
#[derive(Clone, Copy, Debug, Default)]
struct Step {
    ns: i64,
    /// Its digits, each in the byte of its place.
    digits: u128,
    /// A one in the byte of each digit and of the decimal point.
    places: u128,
    /// A one in the byte of the decimal point.
    point: u128,
}

/// A time that was read.
#[derive(Clone, Copy, Debug)]
struct LastTime {
    decimal: Decimal,
    length: usize,
    time_ns: i64,
}

/// The bytes at the start of `bytes` as one number.
#[inline(always)]
fn first_bytes(bytes: &[u8]) -> Option<u128> {
    Some(u128::from_le_bytes(*bytes.first_chunk::<BYTES>()?))
}

/// Ones in the first bytes.
#[inline(always)]
fn mask_of(bytes: usize) -> u128 {
    u128::MAX >> (8 * (BYTES - bytes))
}

impl Expected {
    #[inline(always)]
    fn is_at(&self, bytes: &[u8]) -> bool {
        self.mask != 0 && first_bytes(bytes).is_some_and(|found| (found ^ self.text) & self.mask == 0)
    }

    /// The value at the start of `bytes` and its length, if its text and delimiter are those of the last row.
    #[inline(always)]
    pub(crate) fn value_at(&mut self, bytes: &[u8]) -> Option<(f64, usize)> {
        let is_there = self.is_at(bytes);
        self.misses = if is_there { 0 } else { self.misses.saturating_add(1) };
        is_there.then_some((self.value, self.length))
    }

    /// Expects once more what was read.
    #[inline(always)]
    pub(crate) fn repeat(&mut self, bytes: &[u8], length: usize, value: f64) {
        match first_bytes(bytes).filter(|_| length < BYTES && self.misses < MOST_MISSES) {
            Some(text) => (self.text, self.mask, self.length, self.value) = (text, mask_of(length + 1), length, value),
            None => self.mask = 0,
        }
    }

    /// The time at the start of `bytes`, ns, and its length, if it is the next of even steps.
    #[inline(always)]
    pub(crate) fn time_at(&mut self, bytes: &[u8]) -> Option<(i64, usize)> {
        if !self.is_at(bytes) {
            return None;
        }
        self.misses = 0;
        let here = (self.time_ns, self.length);
        self.advance();
        Some(here)
    }

    /// Expects the next time after one that was read.
    #[inline(never)]
    pub(crate) fn follow(&mut self, bytes: &[u8], read: (Decimal, usize), time_ns: i64) {
        self.misses = if self.mask != 0 { self.misses.saturating_add(1) } else { self.misses };
        self.mask = 0;
        if self.misses > MOST_MISSES {
            return;
        }
        let now = LastTime { decimal: read.0, length: read.1, time_ns };
        let before = self.last.replace(now);
        if let Some((step, text)) = before.and_then(|before| Step::between(before, now, bytes)) {
            self.mask = mask_of(now.length + 1);
            (self.text, self.length, self.time_ns, self.step) = (text & self.mask, now.length, time_ns, step);
            self.last = None;
            self.advance();
        }
    }

    /// From one time to the next.
    #[inline(always)]
    fn advance(&mut self) {
        let next_ns = self.time_ns.checked_add(self.step.ns);
        match next_ns.zip(self.step.next_text(self.text)) {
            Some((time_ns, text)) => (self.time_ns, self.text) = (time_ns, text),
            None => (self.mask, self.last) = (0, None),
        }
    }
}

impl Step {
    /// The step between two times, and the text of the later one with what follows; `None` where they differ in form.
    fn between(before: LastTime, now: LastTime, bytes: &[u8]) -> Option<(Self, u128)> {
        let text = first_bytes(bytes).filter(|_| now.length < BYTES && now.length == before.length)?;
        let mut units = now.decimal.less(before.decimal).filter(|units| *units > 0)?;
        let field = &bytes[..now.length];
        if !field[0].is_ascii_digit() {
            return None;
        }
        let mut digits = 0;
        for place in (0..now.length).rev().filter(|place| field[*place] != b'.') {
            digits |= u128::from(units % 10) << (8 * place);
            units /= 10;
        }
        let point = field.iter().position(|byte| *byte == b'.').map_or(0, |place| 1 << (8 * place));
        let ns = now.time_ns.checked_sub(before.time_ns)?;
        (units == 0).then_some((Self { ns, digits, places: ONES & mask_of(now.length), point }, text))
    }

    /// Adds the step to the digits of a text; `None` where the sum has a digit more.
    #[inline(always)]
    fn next_text(&self, text: u128) -> Option<u128> {
        let mut sum = text + self.digits;
        for _ in 0..MOST_CARRIES {
            let over = ((sum + ABOVE_NINE) >> 7) & self.places;
            if over == 0 {
                return Some(sum);
            }
            if over & 1 != 0 {
                return None;
            }
            let carry = over >> 8;
            let carry = (carry & !self.point) | ((carry & self.point) >> 8);
            sum = sum - 10 * over + carry;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const NS_PLACES: u32 = 9;

    fn read(text: &str) -> (Decimal, usize) {
        Decimal::read(text.as_bytes()).unwrap()
    }

    /// Times as a logger writes them; how many of them were expected.
    fn expected_of(texts: &[String]) -> usize {
        let (mut expected, mut hits) = (Expected::default(), 0);
        for text in texts {
            let line = format!("{text},25.0000,1234567\n");
            let (decimal, length) = read(&line);
            let time_ns = decimal.scaled(NS_PLACES).unwrap();
            match expected.time_at(line.as_bytes()) {
                Some(found) => {
                    assert_eq!(found, (time_ns, length), "{text}");
                    hits += 1;
                }
                None => expected.follow(line.as_bytes(), (decimal, length), time_ns),
            }
        }
        hits
    }

    #[test]
    fn even_times_are_expected_over_every_carry() {
        let hundredths: Vec<String> = (1..20_000).map(|n| format!("{}.{:02}", n / 100, n % 100)).collect();
        // Two rows begin, and each digit more of the seconds costs two.
        assert_eq!(expected_of(&hundredths), hundredths.len() - 6);
        let whole: Vec<String> = (0..5000).map(|n| (1_700_000_000 + 97 * n).to_string()).collect();
        assert_eq!(expected_of(&whole), whole.len() - 2);
        // Every other time a unit longer: nothing is expected, and nothing is wrong.
        let uneven: Vec<String> = (0..500).map(|n| format!("{}.5", 100 + 3 * n + n % 2)).collect();
        assert_eq!(expected_of(&uneven), 0);
    }

    proptest! {
        /// Whatever is expected is what the digits say.
        #[test]
        fn what_is_expected_is_what_is_there(
            start in 0_u64..99_999_999, steps in prop::collection::vec((1_u64..2000, 1_usize..40), 1..20), places in 0_usize..5,
        ) {
            let mut at = start;
            let mut texts = Vec::new();
            for (step, count) in steps {
                for _ in 0..count {
                    at += step;
                    let power = 10_u64.pow(places as u32);
                    let point = if places == 0 { String::new() } else { format!(".{:01$}", at % power, places) };
                    texts.push(format!("{}{point}", at / power));
                }
            }
            expected_of(&texts);
        }
    }
}
